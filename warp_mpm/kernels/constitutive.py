"""End of the step at the material points: position, strains, effective stress, pore pressure ("update stress last")."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from ..simulator.bodies.kernels import BESIDE, CUT, DEEP
from .arrival import make_arrival
from .elementary import make_elementary
from .layout import (
    BESIDE_CUT,
    DIVERGED,
    FLOW_END,
    FLOW_STEP,
    GAPS_BOUNDED,
    INSIDE,
    LEFT_ENERGY,
    LEFT_LIQUID_MASS,
    LEFT_MOMENTUM_X,
    LEFT_MOMENTUM_Y,
    LEFT_MOMENTUM_Z,
    LEFT_SOLID_MASS,
    POINTS_LEFT,
    POINTS_PUSHED,
    SPEED_MAX,
    SURROUNDED,
    TIME_STEP,
    VOIDS_CLOSED,
)

WORST = 0.6
"""Crowding beyond which more makes no difference: drops that land on each other must not be thrown apart."""

SHRUNK = 0.9
"""Share of the porosity at the start below which a point's own bounds the time step, by 5 % and more; what is less the
Courant number has room for."""


def make_constitutive(
    types: SimpleNamespace,
    shapes: SimpleNamespace,
    vectors: SimpleNamespace,
    pore: SimpleNamespace,
    bodies_of: Any,
    module: str,
) -> SimpleNamespace:
    """Build the kernels `advect`, `update` and `bound` (over points).

    What is rare, or looks beyond its own point, stands in `advect` and `bound`. `update` is left with nothing
    but arithmetic on numbers of its own point, without branches or neighbours: a compiler turns that into vector
    instructions, which take a fifth of the time.
    """
    effects = types.effects
    F = types.scalar
    X, T, G = types.X, types.T, types.G
    S = types.S
    Points = types.Points
    Grid = types.Grid
    Parameters = types.Parameters
    hats = shapes.hats
    cell_of, layer_of = shapes.cell_of, shapes.layer_of
    solid_of, liquid_of, section, across = vectors.solid_of, vectors.liquid_of, vectors.section, vectors.across
    trace, shear_rate, sound = vectors.trace, vectors.shear_rate, vectors.sound
    SPATIAL = types.dimensions == 3
    CORNER_LAYERS = 2 if SPATIAL else 1
    pressure_at, filter_share = pore.pressure, pore.filter_share
    porosity = pore.porosity
    elementary = make_elementary(types)
    read, write, larger, smaller = elementary.read, elementary.write, elementary.larger, elementary.smaller

    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    displacement = types.scheme.displacement
    law = types.law
    trial, back, extra, law_leave, volume_ratio = law.trial, law.back, law.extra, law.leave, law.volume_ratio
    OPENS = effects.skeleton.opens
    EXTRA_STRESS = effects.skeleton.extra_stress
    AT_ONCE = effects.skeleton.vectorised
    BODIES = effects.bodies
    Bodies = types.Bodies
    Book = types.Book
    set_back = bodies_of.set_back if BODIES else None
    in_box = bodies_of.in_box if BODIES else None
    about = bodies_of.about if BODIES else None
    near_some = bodies_of.near_some if BODIES else None
    RESTING = not effects.passing
    CORNERS = effects.smoothing_grid
    SMOOTHING = effects.volumetric_smoothing
    RELAXATION = effects.pressure_relaxation
    DENSITY = effects.density_correction
    POROSITY = effects.porosity_update
    VISCOSITY = effects.bulk_viscosity
    MOVING = effects.moving
    PARTLY_DRY = "corner_wet" in types.grid_fields and LIQUID
    OWN_DIVERGENCE = "liquid_divergence" in types.point_fields and TWO_PHASE
    SOLID_GAP = effects.smoothing_grid and OPENS
    LIQUID_GAP = effects.smoothing_grid and effects.liquid

    @wp.func
    def room(filling: F) -> F:
        """Largest volume strain of a gap [-]: it cannot exceed what the points around leave free."""
        return -wp.log(wp.clamp(filling, F(1.0e-12), F(1.0)))

    @wp.func
    def rest(points: Points, p: wp.int32):
        """Make a point one at rest to `update`, which passes over all of them: nothing of it changes."""
        points.gradient[p] = G()
        if CORNERS:
            points.smooth[p] = S()
        if RELAXATION:
            points.surrounded[p] = 0
        if OWN_DIVERGENCE:
            points.liquid_divergence[p] = F(0.0)
        law_leave(points, p)

    @wp.func
    def leave(points: Points, p: wp.int32, x: X, parameters: Parameters, left: wp.array(dtype=wp.float64)):
        """Take a point out of the domain, and keep account of what it takes along."""
        points.inside[p] = 0
        rest(points, p)  # passed over from now on, but by `update`
        reference = points.reference_volume[p]
        v = points.velocity[p]
        solid = parameters.solid_density * reference
        of_solid = solid_of(v)
        momentum = solid * of_solid
        energy = F(0.5) * solid * wp.dot(of_solid, of_solid)
        total = solid
        if TWO_PHASE:
            liquid = parameters.liquid_density * reference
            of_liquid = liquid_of(v)
            momentum += liquid * of_liquid
            energy += F(0.5) * liquid * wp.dot(of_liquid, of_liquid)
            total += liquid
            wp.atomic_add(left, wp.static(LEFT_LIQUID_MASS), wp.float64(liquid))
        energy -= total * wp.dot(parameters.gravity, x)
        wp.atomic_add(left, wp.static(LEFT_SOLID_MASS), wp.float64(solid))
        wp.atomic_add(left, wp.static(LEFT_MOMENTUM_X), wp.float64(momentum[0]))
        wp.atomic_add(left, wp.static(LEFT_MOMENTUM_Y), wp.float64(momentum[1]))
        if SPATIAL:
            wp.atomic_add(left, wp.static(LEFT_MOMENTUM_Z), wp.float64(momentum[2]))
        wp.atomic_add(left, wp.static(LEFT_ENERGY), wp.float64(energy))

    @wp.func
    def in_grid(x: X, sx: F, sy: F, parameters: Parameters) -> wp.bool:
        """Whether a point lies two cells and more away from the edges of the grid."""
        margin = F(2.0)
        result = (
            sx >= margin and sx < F(parameters.columns) - margin and sy >= margin and sy < F(parameters.rows) - margin
        )
        if SPATIAL:
            sz = (x[2] - parameters.front) * parameters.inverse_spacing
            result = result and sz >= margin and sz < F(parameters.layers) - margin
        return result

    @wp.func
    def carry(
        p: wp.int32,
        points: Points,
        grid: Grid,
        parameters: Parameters,
        bodies: Bodies,
        book: Book,
    ):
        """Bring the corners' averages to the points, then move these with the flow and out of what is solid."""
        time_step = F(book.clock[wp.static(TIME_STEP)])
        shift = F(grid.shift[0])
        x = read(points.position, p)
        if CORNERS:
            ci, cj, fx, fy = cell_of(x, shift, parameters)
            first = (ci - 1) * parameters.rows + cj - 1
            hx = hats(fx)
            hy = hats(fy)
            smooth = S()
            least_filling = F(1.0)
            if SPATIAL:
                cl, fz = layer_of(x, parameters)
                first += (cl - 1) * parameters.layer
                hz = hats(fz)
            for q in range(wp.static(CORNER_LAYERS)):
                for k in range(2):
                    for m in range(2):
                        place = first + k * parameters.rows + m
                        share = hx[k] * hy[m]
                        if SPATIAL:
                            place += q * parameters.layer
                            share *= hz[q]
                        corner = read(grid.corner, place)
                        smooth += share * corner
                        if PARTLY_DRY:
                            # Beside what is dry the liquid has a free surface.
                            least_filling = smaller(read(grid.corner_wet, place), least_filling)
                        else:
                            least_filling = smaller(corner[0], least_filling)
            if RELAXATION:
                # With the part that was left out of the average.
                smooth[2] += parameters.true_liquid_density * wp.dot(parameters.gravity, x)
                # Beside a free surface the projection is one-sided and would drain it: nothing is filtered there.
                surrounded = wp.where(least_filling > F(0.6), wp.int32(wp.static(SURROUNDED)), wp.int32(0))
                if BODIES:
                    if surrounded != 0:
                        beside = wp.bool(False)
                        if RESTING:
                            beside = (read(grid.solid, ci * parameters.rows + cj) & wp.static(CUT)) != 0
                        else:
                            reach = F(wp.static(BESIDE)) * parameters.spacing
                            beside = near_some(bodies, bodies.cuts, section(x), ci, parameters.columns, reach)
                        if beside:
                            surrounded = wp.int32(wp.static(BESIDE_CUT))
                write(points.surrounded, p, surrounded)
            write(points.smooth, p, smooth)

        before = x
        x += displacement(points, p, grid, x, shift, time_step, parameters)
        if BODIES:
            # Bodies and grid as they will lie in the next step: whatever their speed, no point reaches beyond them.
            shift = F(grid.shift[1])
        sx = (x[0] - parameters.left - shift) * parameters.inverse_spacing
        sy = (x[1] - parameters.bottom) * parameters.inverse_spacing
        within = in_grid(x, sx, sy, parameters)
        if BODIES:
            solid = wp.int32(1)
            if RESTING:
                if within:
                    solid = read(grid.solid, wp.int32(sx) * parameters.rows + wp.int32(sy)) & wp.static(DEEP)
            if solid != 0:
                for body in range(bodies.count):
                    seen = section(x)
                    if in_box(read(bodies.ahead, body), seen):
                        if MOVING:
                            seen -= read(bodies.next, body)
                        first_piece, last_piece = about(bodies, body, wp.int32(sx), parameters.columns)
                        pushed = set_back(bodies.pieces, first_piece, last_piece, seen, F(-0.5) * parameters.spacing)
                        if pushed[0] != F(0.0) or pushed[1] != F(0.0):
                            x += across(pushed)
                            wp.atomic_add(book.counters, wp.static(POINTS_PUSHED), 1)
                sx = (x[0] - parameters.left - shift) * parameters.inverse_spacing
                sy = (x[1] - parameters.bottom) * parameters.inverse_spacing
                within = in_grid(x, sx, sy, parameters)
        if not within:
            # A position that is no number compares false above; such a point has not left, the run has diverged.
            if sound(x):
                leave(points, p, x, parameters, book.left)
                wp.atomic_add(book.counters, wp.static(POINTS_LEFT), 1)
            else:
                x = before
                book.counters[wp.static(DIVERGED)] = 1
        write(points.position, p, x)

        if SOLID_GAP:
            gap = read(points.solid_gap, p)
            if gap > F(0.0):
                largest = room(read(points.smooth, p)[0])
                if gap > largest:
                    write(points.solid_gap, p, largest)
                    wp.atomic_add(book.limiters, wp.static(GAPS_BOUNDED), wp.float64(1.0))

    @wp.kernel(module=module)
    def advect(points: Points, grid: Grid, parameters: Parameters, bodies: Bodies, book: Book):
        p = wp.int32(wp.tid())
        end = book.flow[wp.static(FLOW_END)]
        step = book.flow[wp.static(FLOW_STEP)]
        while p < end:
            if read(points.inside, p) == wp.static(INSIDE):
                carry(p, points, grid, parameters, bodies, book)
            p += step

    @wp.func
    def settle(
        points: Points,
        p: wp.int32,
        stress: T,
        gradient: G,
        volume: F,
        gap: F,
        time_step: F,
        parameters: Parameters,
    ):
        """From the trial stress to what the law allows, and what the skeleton opens by."""
        allowed, opening = back(points, p, stress, gradient, volume, time_step, parameters)
        after = volume
        if OPENS:
            after *= F(1.0) - opening
            # As a strain, -ln(1 - opening), so that the reverse strain closes the gap.
            write(points.solid_gap, p, gap + opening / (F(1.0) - F(0.5) * opening))
        if EXTRA_STRESS:
            write(points.extra_stress, p, extra(points, p, allowed, gradient, time_step, parameters))
        write(points.stress, p, allowed)
        write(points.volume, p, after)

    @wp.kernel(module=module)
    def update(points: Points, parameters: Parameters, clock: wp.array(dtype=wp.float64)):
        """Strains, effective stress and pore pressure at the end of the step, from the rates at the point.

        Points that have left pass through as well, as `leave` has made them: at rest, so that nothing changes.
        """
        p = wp.tid()
        time_step = F(clock[wp.static(TIME_STEP)])
        gradient = read(points.gradient, p)
        divergence = trace(gradient)
        smooth = S()
        if CORNERS:
            smooth = read(points.smooth, p)
        reference = read(points.reference_volume, p)
        volume = read(points.volume, p)
        if TWO_PHASE:
            n = porosity(reference, volume, parameters)
        liquid_divergence = F(0.0)
        if SMOOTHING:
            divergence = smooth[1]
            if TWO_PHASE:
                liquid_divergence = smooth[4]
        if OWN_DIVERGENCE:
            liquid_divergence = read(points.liquid_divergence, p)

        if VISCOSITY:
            # Artificial, linear (Landshoff), on compression only: keeps a front of sound from ringing.
            mixture = divergence
            if TWO_PHASE:
                mixture = (F(1.0) - n) * divergence + n * liquid_divergence
            write(points.viscous_pressure, p, -parameters.bulk_viscosity * smaller(mixture, F(0.0)))

        if DENSITY:
            # What the points around claim over what there is; a flow that is compressed claims less.
            ratio = smooth[0] * volume / reference
            now = larger(smaller(ratio - F(1.0), F(wp.static(WORST))), -F(wp.static(WORST)))
            crowding = read(points.crowding, p)
            share = smaller(time_step * shear_rate(gradient), F(1.0))
            write(points.crowding, p, crowding + share * (now - crowding))

        volume_strain = divergence * time_step
        borne = volume_strain
        gap = F(0.0)
        if OPENS:
            # A skeleton that has opened bears nothing until the gap has closed.
            gap = read(points.solid_gap, p)
            closed = smaller(gap, larger(-borne, F(0.0)))
            borne += closed
            gap -= closed
        stress, deviatoric = trial(points, p, read(points.stress, p), gradient, borne, time_step, parameters)
        write(points.deviatoric_strain, p, read(points.deviatoric_strain, p) + deviatoric)
        volume *= volume_ratio(borne)
        if LIQUID:
            # Eq. (A12); the strain is a record of volume, so a gap that has opened must close before pressure builds.
            strain = read(points.liquid_strain, p)
            if TWO_PHASE:
                n = porosity(reference, volume, parameters)
                strain += time_step * ((F(1.0) - n) * divergence + n * liquid_divergence) / n
            else:
                strain += volume_strain / parameters.porosity
            if RELAXATION:
                # The residual r = (1 - P) p of the projection P is noise, and little else; of a smooth pressure
                # (1 - P) r is less still, of fourth order in the spacing. One step old, r needs no further transfer.
                # What P r gives back goes to points beside a cut as well, so that no liquid is lost.
                share = smaller(parameters.relaxation_rate * time_step, F(1.0))
                surrounded = read(points.surrounded, p)
                own = filter_share(surrounded) * read(points.pressure_residual, p)
                correction = share * (own - smooth[3]) / parameters.liquid_bulk_modulus
                write(points.pressure_residual, p, pressure_at(read(points.liquid_strain, p), parameters) - smooth[2])
                filtered = wp.where(strain < F(0.0), smaller(strain + correction, F(0.0)), strain)
                strain = wp.where(surrounded != 0, filtered, strain)
            write(points.liquid_strain, p, strain)
        if AT_ONCE:
            settle(points, p, stress, gradient, volume, gap, time_step, parameters)
        else:
            write(points.stress, p, stress)
            write(points.volume, p, volume)
            if OPENS:
                write(points.solid_gap, p, gap)

    @wp.func
    def limit(p: wp.int32, points: Points, parameters: Parameters, book: Book):
        """What only few points come to: voids that are closed, or have shrunk, a gap in the liquid as large as the room
        there is."""
        grains = parameters.grain_share * read(points.reference_volume, p)
        volume = read(points.volume, p)
        if POROSITY:
            # The stiffness K_L n_S / n of what is left of the liquid's share carries the fast wave.
            n = porosity(read(points.reference_volume, p), volume, parameters)
            if n < F(wp.static(SHRUNK)) * parameters.porosity:
                stiffer = parameters.porosity * (F(1.0) - n) / (n * (F(1.0) - parameters.porosity))
                own = solid_of(read(points.velocity, p))
                faster = wp.float64(wp.sqrt(stiffer) - F(1.0)) * parameters.wave_speed
                total = wp.float64(wp.sqrt(wp.dot(own, own))) + faster
                wp.atomic_max(book.clock, wp.static(SPEED_MAX), total * total)
        if volume < grains:
            # The stress of closed voids rises faster than the volume on which it acts falls: waves gain speed.
            v = solid_of(read(points.velocity, p))
            gain = wp.float64(wp.sqrt(grains / volume) - F(1.0)) * parameters.wave_speed
            speed = wp.float64(wp.sqrt(wp.dot(v, v))) + gain
            wp.atomic_max(book.clock, wp.static(SPEED_MAX), speed * speed)
            wp.atomic_add(book.limiters, wp.static(VOIDS_CLOSED), wp.float64(1.0))
        if LIQUID_GAP:
            if read(points.liquid_strain, p) > F(0.0):
                largest = room(read(points.smooth, p)[0]) / parameters.porosity
                if read(points.liquid_strain, p) > largest:
                    write(points.liquid_strain, p, largest)
                    wp.atomic_add(book.limiters, wp.static(GAPS_BOUNDED), wp.float64(1.0))

    @wp.kernel(module=module)
    def bound(points: Points, parameters: Parameters, book: Book):
        p = wp.int32(wp.tid())
        end = book.flow[wp.static(FLOW_END)]
        step = book.flow[wp.static(FLOW_STEP)]
        while p < end:
            if read(points.inside, p) > 0:
                limit(p, points, parameters, book)
            p += step

    kernels = SimpleNamespace(advect=advect, update=update, bound=bound)
    if effects.arriving:
        kernels.hold = make_arrival(types, vectors, pore, rest, module)
    if not AT_ONCE:

        @wp.kernel(module=module)
        def yielding(points: Points, parameters: Parameters, book: Book):
            """What `update` leaves to a law that the compiler cannot turn into vector instructions."""
            p = wp.tid()
            gap = F(0.0)
            if OPENS:
                gap = read(points.solid_gap, p)
            settle(
                points,
                p,
                read(points.stress, p),
                read(points.gradient, p),
                read(points.volume, p),
                gap,
                F(book.clock[wp.static(TIME_STEP)]),
                parameters,
            )

        kernels.yielding = yielding
    return kernels
