"""Contact of the flow with solid bodies, for both phases, and the velocity of bodies that slide.

At a place of contact (`simulator.bodies.places`) with weights N_i and normal n the flow of each phase has the velocity
u = sum N_i v_i. The surface's impulse on it, lambda >= 0, changes the nodes' velocities by lambda N_i n / m_i, and is
such that u · n is the surface's own, or greater where lambda = 0. Reactions are minus the impulses, Eq. (A14).

Coulomb friction acts on the solid. Its normal force is what both phases give, less what the liquid's pressure carries:
the impulse of the same surface on liquid that fills the whole volume and moves as it would alone. Drag passes friction
on to the liquid.

Places that share nodes, and bodies that slide, depend on each other. Their impulses are found by projected
Gauss-Seidel sweeps that start from the step before: what a sweep leaves is the next step's to find, so that a few
sweeps give what hundreds would.
"""

from types import SimpleNamespace
from typing import Any

import warp as wp

from .around import make_at_places
from .elementary import make_elementary
from .layout import (
    BARRIER_ITERATIONS,
    BARRIER_UNCONVERGED,
    BLOCK_SHIFT,
    SLOT_ALONG,
    SLOT_LIQUID,
    SLOT_NORMAL,
    SLOT_SIZE,
    TIME_STEP,
)
from .told import make_told

SWEEPS = 4
"""Sweeps of a step. Two or forty change the sliding distance of the paper's case 1 by 0.1 %."""

MOST = 100
"""Sweeps where a body that slides still changes its velocity, as when it starts or stops, or is lighter than a cell of
the flow."""

WEIGHTLESS = 1e-15
"""Of a ratio of masses, in place of nil."""

THINNED = 1.0e3
"""Times that the inverse mass at a place may grow in a step, before its impulse begins with less than the force of the
step before."""

REACHED = 0.75
"""Share of a place's weights that must lie on nodes with mass before the flow counts as there: more than the half that
lies on the nodes before the surface, which a flow has that is still to come. From 0.6 to 0.9 case 1 at 0.2 m slides as
far, to 0.1 %."""


def make_contact(
    types: SimpleNamespace, shapes: SimpleNamespace, vectors: SimpleNamespace, bodies_of: Any, module: str
) -> SimpleNamespace:
    """Build the kernels `press` (over groups of places that stand alone) and `join` (one block of threads, over all
    others)."""
    effects = types.effects
    F = types.scalar
    V2, V3, X = types.V2, types.V3, types.X
    V = types.V
    Grid = types.Grid
    Parameters = types.Parameters
    Contact = types.Contact
    Bodies = types.Bodies
    Book = types.Book
    MOVING = effects.moving
    SLIDING = effects.sliding
    M = types.M
    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    receive = types.scheme.receive
    RECEIVES = types.scheme.receives
    FRICTION = effects.friction
    TURBULENCE = effects.turbulence
    CARRIED = FRICTION and LIQUID
    IMPLICIT_DRAG = effects.drag == "semi_implicit"
    elementary = make_elementary(types)
    read, write, larger = elementary.read, elementary.write, elementary.larger
    at_places = make_at_places(types)
    weigh, rescale, seen_at, give_at = at_places.weigh, at_places.rescale, at_places.seen, at_places.give
    weights, cell_of = shapes.weights, shapes.cell_of
    displaced, look_ahead = bodies_of.displaced, bodies_of.look_ahead
    of_phases, solid_of, liquid_of = vectors.of_phases, vectors.solid_of, vectors.liquid_of
    slip_along, limited, along, across = vectors.slip_along, vectors.limited, vectors.along, vectors.across
    DIMENSIONS = types.dimensions
    SPATIAL = DIMENSIONS == 3
    LAYERS = 3 if SPATIAL else 1
    AROUND = types.W._length_
    MATERIALS = "told" in types.grid_fields
    told_of = make_told(types)
    ratio_of_liquid, ratio_of_filling = told_of.ratio_of_liquid, told_of.ratio_of_filling
    LIQUID_WEIGHTS = MATERIALS and TWO_PHASE
    told_drag = told_of.drag_per_mass
    RUBS_ALONG = FRICTION and not SPATIAL  # a barrier, in whose slots it is kept, is of the plane

    @wp.func
    def layer_of(parameters: Parameters) -> wp.int32:
        """Nodes from a layer to the next."""
        layer = wp.int32(0)
        if SPATIAL:
            layer = parameters.layer
        return layer

    @wp.func
    def node_of(first: wp.int32, k: wp.int32, parameters: Parameters) -> wp.int32:
        """The kth of the nodes around a place, counted through."""
        return first + (k / 9) * layer_of(parameters) + (k / 3) % 3 * parameters.rows + k % 3

    @wp.func
    def noted(blocks: wp.array2d(dtype=wp.int32), first: wp.int32, parameters: Parameters) -> wp.bool:
        """Whether any of the blocks that hold a place's nodes is marked."""
        i = first / parameters.rows
        j = first - i * parameters.rows
        left = (i >> wp.static(BLOCK_SHIFT)) * parameters.block_rows
        right = ((i + 2) >> wp.static(BLOCK_SHIFT)) * parameters.block_rows
        low = j >> wp.static(BLOCK_SHIFT)
        high = (j + 2) >> wp.static(BLOCK_SHIFT)
        return (
            read(blocks, left + low) != 0
            or read(blocks, right + low) != 0
            or read(blocks, left + high) != 0
            or read(blocks, right + high) != 0
        )

    @wp.func
    def inverse_mass(contact: Contact, e: wp.int32, grid: Grid, parameters: Parameters) -> F:
        """sum N_i^2 / m_i of the solid, with weights that add up to one over the nodes that have mass; 0 where the flow
        is not at the surface: too few of the nodes have any."""
        wz = V3()
        if SPATIAL:
            wz = contact.weight_z[e]
        first = read(contact.first, e)
        sums = weigh(
            grid.mass,
            first,
            parameters.rows,
            layer_of(parameters),
            contact.weight_x[e],
            contact.weight_y[e],
            wz,
            contact.weight,
            contact.per_mass,
            e,
        )
        result = sums[0]
        total = sums[1]
        if MATERIALS:
            of_liquid = F(0.0)
            of_liquid_twice = F(0.0)
            drag = F(0.0)
            filling = F(0.0)
            # Points of other materials than the flow's have told the nodes something.
            mixed = noted(grid.telling, first, parameters)
            write(contact.mixed, e, wp.where(mixed, 1, 0))
            if mixed:
                per_mass = contact.per_mass[e]
                for k in range(AROUND):
                    if per_mass[k] > F(0.0):
                        node = node_of(first, k, parameters)
                        mass = read(grid.mass, node)
                        w = per_mass[k] * mass
                        told = read(grid.told, node) / mass
                        if TWO_PHASE:
                            ratio = ratio_of_liquid(told, parameters)
                            of_liquid += w * ratio
                            of_liquid_twice += w * per_mass[k] * ratio
                            drag += w * told_drag(told, parameters)
                        if CARRIED:
                            filled = ratio_of_filling(told, parameters)
                            filling += w * filled
            else:
                if TWO_PHASE:
                    of_liquid = total * parameters.liquid_ratio
                    of_liquid_twice = sums[0] * parameters.liquid_ratio
                    drag = total * told_drag(M(), parameters)
                if CARRIED:
                    filling = total * ratio_of_filling(M(), parameters)
            # With means of this kind the nodes get all of an impulse, and no more. Where there is no liquid, one that
            # weighs next to nothing stands in for it.
            inverse_total = F(1.0) / larger(total, F(wp.static(WEIGHTLESS)))
            # Of the liquid's own weights, w times its mass over that of the solid: a node that holds next to none of it
            # has any velocity.
            again = F(1.0)
            if contact.fixed[e] == 0:
                again = inverse_total * inverse_total
            if TWO_PHASE:
                contact.liquid_ratio[e] = larger(of_liquid * inverse_total, F(wp.static(WEIGHTLESS)))
                contact.liquid_inverse[e] = (
                    again * of_liquid_twice / (contact.liquid_ratio[e] * contact.liquid_ratio[e])
                )
                if FRICTION:
                    contact.drag_per_mass[e] = drag * inverse_total
            if CARRIED:
                contact.filling_ratio[e] = larger(filling * inverse_total, F(wp.static(WEIGHTLESS)))
                if TWO_PHASE:
                    both = contact.liquid_ratio[e] * contact.filling_ratio[e]
                    contact.filling_inverse[e] = again * of_liquid_twice / both
        if total < F(wp.static(REACHED)):
            result = F(0.0)
        elif read(contact.fixed, e) == 0:
            by = F(1.0) / total
            rescale(contact.weight, contact.per_mass, e, by)
            result *= by * by
        return result

    @wp.func
    def seen(contact: Contact, e: wp.int32, grid: Grid, parameters: Parameters) -> V:
        """Velocities of the flow at the place."""
        first = read(contact.first, e)
        if LIQUID_WEIGHTS:
            result = V()
            if read(contact.mixed, e) != 0:
                weight = contact.weight[e]
                for k in range(AROUND):
                    node = node_of(first, k, parameters)
                    mass = read(grid.mass, node)
                    if mass > F(0.0):
                        v = read(grid.velocity, node)
                        of_liquid = ratio_of_liquid(read(grid.told, node) / mass, parameters) / contact.liquid_ratio[e]
                        result += weight[k] * of_phases(solid_of(v), of_liquid * liquid_of(v))
            else:
                result = seen_at(grid.velocity, first, parameters.rows, layer_of(parameters), contact.weight, e)
        else:
            result = seen_at(grid.velocity, first, parameters.rows, layer_of(parameters), contact.weight, e)
        return result

    @wp.func
    def seen_alone(contact: Contact, e: wp.int32, grid: Grid, parameters: Parameters) -> X:
        """Velocity of the liquid alone at the place, seen with the weights of the phase that contact holds there: with
        others what is left of its velocity would not be nil, and would count as a force in every step."""
        first = read(contact.first, e)
        layer = layer_of(parameters)
        if LIQUID_WEIGHTS:
            result = X()
            if read(contact.mixed, e) != 0:
                weight = contact.weight[e]
                for k in range(AROUND):
                    node = node_of(first, k, parameters)
                    mass = read(grid.mass, node)
                    if mass > F(0.0):
                        of_liquid = ratio_of_liquid(read(grid.told, node) / mass, parameters) / contact.liquid_ratio[e]
                        result += weight[k] * of_liquid * read(grid.liquid_alone, node)
            else:
                result = seen_at(grid.liquid_alone, first, parameters.rows, layer, contact.weight, e)
        else:
            result = seen_at(grid.liquid_alone, first, parameters.rows, layer, contact.weight, e)
            if MATERIALS:
                gain = seen_at(grid.filling_gain, first, parameters.rows, layer, contact.weight, e)
                result += (F(1.0) / contact.filling_ratio[e]) * gain
        return result

    @wp.func
    def give(contact: Contact, e: wp.int32, impulse: V, grid: Grid, parameters: Parameters):
        """Impulses per phase, over the share of the solid's mass that each has, to the nodes."""
        layer = layer_of(parameters)
        give_at(grid.velocity, read(contact.first, e), parameters.rows, layer, contact.per_mass, e, impulse)

    @wp.func
    def give_scheme(contact: Contact, e: wp.int32, impulse: V, grid: Grid, parameters: Parameters):
        """The same to what the transfer scheme keeps."""
        per_mass = contact.per_mass[e]
        first = read(contact.first, e)
        column = first / parameters.rows
        row = first - column * parameters.rows
        for q in range(wp.static(LAYERS)):
            for k in range(3):
                for m in range(3):
                    share = per_mass[9 * q + 3 * k + m]
                    if share > F(0.0):
                        receive(grid, column + k, row + m, share * impulse)
            if SPATIAL:
                column += parameters.columns

    @wp.func
    def give_alone(contact: Contact, e: wp.int32, impulse: X, grid: Grid, parameters: Parameters):
        layer = layer_of(parameters)
        give_at(grid.liquid_alone, read(contact.first, e), parameters.rows, layer, contact.per_mass, e, impulse)

    @wp.func
    def liquid_ratio(contact: Contact, e: wp.int32, parameters: Parameters) -> F:
        """Mass of liquid over that of the solid at the place."""
        if MATERIALS:
            result = contact.liquid_ratio[e]
        else:
            result = parameters.liquid_ratio
        return result

    @wp.func
    def filling_ratio(contact: Contact, e: wp.int32, parameters: Parameters) -> F:
        """Mass of liquid that would fill the whole volume over that of the solid, at the place."""
        if MATERIALS:
            result = contact.filling_ratio[e]
        else:
            result = parameters.filling_ratio
        return result

    @wp.func
    def weightless_if_nil(inverse: F) -> F:
        """What is not there takes no impulse: it gives way to the least."""
        return wp.where(inverse > F(0.0), inverse, F(1.0e30))

    @wp.func
    def drag_share(contact: Contact, e: wp.int32, parameters: Parameters, time_step: F) -> F:
        """Share of the solid's change of velocity that drag passes on to the liquid within the step."""
        share = F(0.0)
        if IMPLICIT_DRAG:
            if MATERIALS:
                drag = contact.drag_per_mass[e] * time_step
            else:
                drag = parameters.drag_per_mass * time_step
            share = drag / (liquid_ratio(contact, e, parameters) + drag)
        return share

    @wp.func
    def whole(contact: Contact, e: wp.int32, parameters: Parameters, time_step: F) -> V:
        """All that the place has given in the step, in the form that `give` takes."""
        n = read(contact.normal, e)
        solid = read(contact.solid, e) * n
        liquid = X()
        if TWO_PHASE:
            liquid = (read(contact.liquid, e) / liquid_ratio(contact, e, parameters)) * n
            if FRICTION:
                share = drag_share(contact, e, parameters, time_step)
                rub = read(contact.rubbed, e) / (F(1.0) + liquid_ratio(contact, e, parameters) * share)
                solid += along(rub, n)
                liquid += along(share * rub, n)
        else:
            if FRICTION:
                solid += along(read(contact.rubbed, e), n)
        return of_phases(solid, liquid)

    @wp.func
    def on_body(contact: Contact, e: wp.int32) -> X:
        """Impulse of the flow on the surface, Eq. (A14)."""
        n = read(contact.normal, e)
        total = read(contact.solid, e)
        if TWO_PHASE:
            total += read(contact.liquid, e)
        result = -total * n
        if FRICTION:
            result -= along(read(contact.rubbed, e), n)
        return result

    @wp.func
    def slides(bodies: Bodies, body: wp.int32) -> wp.bool:
        result = wp.bool(False)
        if SLIDING:
            result = bodies.mass[body] > wp.float64(0.0)
        return result

    @wp.func
    def react(bodies: Bodies, body: wp.int32, impulse: X):
        """Note what a body that slides takes from the flow."""
        if SLIDING:
            if slides(bodies, body):
                wp.atomic_add(bodies.pushed, body, wp.vec2d(wp.float64(impulse[0]), wp.float64(impulse[1])))

    @wp.func
    def yield_to_flow(bodies: Bodies):
        """Bodies that slide change their velocity by what they have taken."""
        if SLIDING:
            for body in range(bodies.count):
                if slides(bodies, body):
                    pushed = bodies.pushed[body]
                    v = bodies.velocity[body]
                    bodies.velocity[body] = wp.vec2d(v[0] + pushed[0] / bodies.mass[body], v[1])
                    bodies.pressed[body] = bodies.pressed[body] + pushed[1]
                    bodies.pushed[body] = wp.vec2d()

    @wp.func
    def begin(bodies: Bodies, dt: wp.float64, again: wp.float64):
        """Velocities of bodies that slide, with the friction at the base of the step before."""
        if SLIDING:
            for body in range(bodies.count):
                if slides(bodies, body):
                    held = bodies.held[body] * again
                    outside = (bodies.external_force[body] + bodies.pull[body]) * dt
                    bodies.held[body] = held
                    bodies.velocity[body] = bodies.velocity[body] + wp.vec2d(
                        (outside + held) / bodies.mass[body], wp.float64(0.0)
                    )
                    bodies.pressed[body] = wp.float64(0.0)
                    bodies.pushed[body] = wp.vec2d()

    @wp.func
    def hold(bodies: Bodies, dt: wp.float64) -> wp.bool:
        """Coulomb friction at the base: a body rests where that can hold it. Returns whether some body's velocity still
        changes by more than a thousandth of itself and of what its own weight could give it in the step."""
        zero = wp.float64(0.0)
        changes = wp.bool(False)
        if SLIDING:
            for body in range(bodies.count):
                if slides(bodies, body):
                    mass = bodies.mass[body]
                    slip = bodies.velocity[body][0]
                    old = bodies.held[body]
                    wanted = old - slip * mass
                    most = bodies.base_friction[body] * wp.max(bodies.weight[body] * dt - bodies.pressed[body], zero)
                    new = wp.clamp(wanted, -most, most)
                    after = slip + (new - old) / mass
                    if wp.abs(wanted) <= most:
                        after = zero
                    bodies.held[body] = new
                    bodies.velocity[body] = wp.vec2d(after, zero)
                    scale = wp.abs(after) + bodies.weight[body] / mass * dt
                    if wp.abs(after - bodies.guess[body]) > wp.float64(1.0e-3) * scale:
                        changes = wp.bool(True)
                    bodies.guess[body] = after
        return changes

    @wp.func
    def go_on(bodies: Bodies, grid: Grid, parameters: Parameters, time_step: F):
        """Keep account of friction at the base, and note where the bodies that slide will be."""
        if SLIDING:
            for body in range(bodies.count):
                if slides(bodies, body):
                    middle = wp.float64(0.5) * (bodies.velocity[body][0] + bodies.old_velocity[body][0])
                    bodies.base_impulse[body] = bodies.base_impulse[body] + bodies.held[body]
                    bodies.base_work[body] = bodies.base_work[body] - bodies.held[body] * middle
                    look_ahead(bodies, grid, body, F(-0.5) * parameters.spacing, time_step)

    @wp.func
    def effective(contact: Contact, e: wp.int32) -> F:
        """Normal impulse less what the liquid's pressure carries."""
        result = read(contact.solid, e)
        if TWO_PHASE:
            result += read(contact.liquid, e)
        if CARRIED:
            result -= read(contact.alone, e)
        return result

    @wp.func
    def turbulent(contact: Contact, e: wp.int32, bodies: Bodies, free: F, limit: F, mobility: F, time_step: F) -> F:
        """Impulse D v² of Voellmy's friction beside Coulomb's, with the slip v at the end of the step, which obeys
        v = |free| - mobility (limit + D v²); `free` is the slip without any. So no drag bounds the step."""
        drag = bodies.turbulence[read(contact.surface, e)] * read(contact.length, e) * time_step
        left = wp.max(wp.abs(free) - limit * mobility, F(0.0))
        slip = F(2.0) * left / (F(1.0) + wp.sqrt(F(1.0) + F(4.0) * drag * mobility * left))
        return drag * slip * slip

    @wp.func
    def relax(contact: Contact, e: wp.int32, bodies: Bodies, grid: Grid, parameters: Parameters, time_step: F):
        """Bring one place's impulses to what the velocities there now call for."""
        # Divisions by what is the same for all places are written such that the compiler forms their inverse once.
        inverse = read(contact.inverse, e)
        mass = F(1.0) / inverse
        n = read(contact.normal, e)
        body = read(contact.body, e)
        surface = X()
        give_way = F(0.0)
        give_way_along = F(0.0)
        if MOVING:
            v = bodies.velocity[body]
            surface = across(V2(F(v[0]), F(v[1])))
            if SLIDING:
                if slides(bodies, body):
                    # As many places as are done at the same time share the body's mass.
                    inverse_body = contact.abreast / F(bodies.mass[body])
                    give_way = inverse_body * n[0] * n[0]
                    give_way_along = inverse_body * n[1] * n[1]
        velocity = seen(contact, e, grid, parameters)
        solid_velocity = solid_of(velocity) - surface
        old = read(contact.solid, e)
        effective_mass = mass
        if SLIDING:
            effective_mass = F(1.0) / (inverse + give_way)
        new = wp.max(old - wp.dot(solid_velocity, n) * effective_mass, F(0.0))
        write(contact.solid, e, new)
        change = new - old
        given = change * n
        push = -change * n
        change_alone = F(0.0)
        liquid_given = X()
        if TWO_PHASE:
            liquid_velocity = liquid_of(velocity) - surface
            liquid_velocity += (give_way * change) * n
            ratio = liquid_ratio(contact, e, parameters)
            if MATERIALS:
                liquid_inverse = weightless_if_nil(contact.liquid_inverse[e])
                liquid_mass = F(1.0) / (liquid_inverse + give_way)
            else:
                liquid_mass = ratio * mass
                if SLIDING:
                    liquid_mass = liquid_mass / (F(1.0) + liquid_mass * give_way)
            old_liquid = read(contact.liquid, e)
            new_liquid = wp.max(old_liquid - wp.dot(liquid_velocity, n) * liquid_mass, F(0.0))
            write(contact.liquid, e, new_liquid)
            liquid_change = new_liquid - old_liquid
            push -= liquid_change * n
            liquid_given = (liquid_change * (F(1.0) / ratio)) * n
        if FRICTION:
            friction = bodies.friction[read(contact.surface, e)]
            rubs = friction > F(0.0)
            if TURBULENCE:
                rubs = rubs or bodies.turbulence[read(contact.surface, e)] > F(0.0)
            if rubs:
                if CARRIED:
                    alone = seen_alone(contact, e, grid, parameters) - surface
                    filling = filling_ratio(contact, e, parameters)
                    if LIQUID_WEIGHTS:
                        alone_mass = F(1.0) / weightless_if_nil(contact.filling_inverse[e])
                    else:
                        alone_mass = filling * mass
                    old_alone = read(contact.alone, e)
                    new_alone = wp.max(old_alone - wp.dot(alone, n) * alone_mass, F(0.0))
                    write(contact.alone, e, new_alone)
                    change_alone = (new_alone - old_alone) * (F(1.0) / filling)
                normal_force = F(0.5) * effective(contact, e) + F(0.25) * (
                    effective(contact, read(contact.before, e)) + effective(contact, read(contact.after, e))
                )
                limit = friction * wp.max(normal_force, F(0.0))
                inertia = F(1.0)
                share = F(0.0)
                if TWO_PHASE:
                    share = drag_share(contact, e, parameters, time_step)
                    inertia += ratio * share
                slip = slip_along(solid_velocity, n)
                old_rub = read(contact.rubbed, e)
                per_inertia = F(1.0) / inertia
                mobility = inverse * per_inertia + give_way_along
                mass_along = inertia * mass
                if SLIDING:
                    mass_along = F(1.0) / mobility
                if TURBULENCE:
                    limit += turbulent(contact, e, bodies, slip - old_rub * mobility, limit, mobility, time_step)
                new_rub = limited(old_rub - slip * mass_along, limit)
                write(contact.rubbed, e, new_rub)
                rub = new_rub - old_rub
                push -= along(rub, n)
                given += along(rub * per_inertia, n)
                if TWO_PHASE:
                    liquid_given += along(rub * (share * per_inertia), n)
        give(contact, e, of_phases(given, liquid_given), grid, parameters)
        if CARRIED:
            if change_alone != F(0.0):
                give_alone(contact, e, change_alone * n, grid, parameters)
        react(bodies, body, push)

    @wp.func
    def flow_around(contact: Contact, r: wp.int32, grid: Grid, parameters: Parameters) -> wp.int32:
        """1 where any of the blocks around a run of places holds material."""
        around = contact.around[r]
        result = wp.int32(0)
        for i in range(around[0], around[1] + 1):
            for j in range(around[2], around[3] + 1):
                if read(grid.block, i * parameters.block_rows + j) != 0:
                    result = wp.int32(1)
        return result

    @wp.func
    def find(contact: Contact, e: wp.int32, bodies: Bodies, grid: Grid, parameters: Parameters):
        """The nodes of a place, and what they weigh."""
        wet = wp.bool(True)
        if read(contact.fixed, e) == 0:
            at = read(contact.position, e) + across(displaced(bodies, read(contact.body, e)))
            i, j, fx, fy = cell_of(at, F(grid.shift[0]), parameters)
            write(contact.first, e, wp.int32(-1))
            if i >= 1 and j >= 1 and i < parameters.columns - 1 and j < parameters.rows - 1:
                write(contact.first, e, (i - 1) * parameters.rows + j - 1)
                contact.weight_x[e] = weights(fx)
                contact.weight_y[e] = weights(fy)
                # Most places of a long outline are dry, and need not look at their nodes.
                wet = noted(grid.block, read(contact.first, e), parameters)
        inverse = F(0.0)
        if read(contact.first, e) >= 0 and wet:
            inverse = inverse_mass(contact, e, grid, parameters)
        write(contact.inverse, e, inverse)

    @wp.func
    def kept(before: F, now: F) -> F:
        """Share of a place's impulse that is begun with, by its inverse masses of the step before and of this one: what
        was right for a flow would throw the last wisp of it, off a thin barrier with all that the sweeps tie to it."""
        return wp.where(now > F(wp.static(THINNED)) * before, F(wp.static(THINNED)) * before / now, F(1.0))

    @wp.func
    def recall(contact: Contact, e: wp.int32, again: F):
        """Impulses to begin with: the forces of the step before, or none where nothing is."""
        share = wp.where(read(contact.inverse, e) > F(0.0), again, F(0.0))
        write(contact.solid, e, share * read(contact.solid, e))
        if TWO_PHASE:
            write(contact.liquid, e, share * read(contact.liquid, e))
        if CARRIED:
            write(contact.alone, e, share * read(contact.alone, e))
        if FRICTION:
            write(contact.rubbed, e, share * read(contact.rubbed, e))

    @wp.func
    def add(contact: Contact, first: wp.int32, share: wp.float64, e: wp.int32):
        """A share of the place's impulses, to the sums of a slot."""
        wp.atomic_add(contact.taken, first + wp.static(SLOT_NORMAL), share * wp.float64(read(contact.solid, e)))
        if TWO_PHASE:
            wp.atomic_add(contact.taken, first + wp.static(SLOT_LIQUID), share * wp.float64(read(contact.liquid, e)))
        elif CARRIED:
            wp.atomic_add(contact.taken, first + wp.static(SLOT_LIQUID), share * wp.float64(read(contact.alone, e)))
        if RUBS_ALONG:
            wp.atomic_add(contact.taken, first + wp.static(SLOT_ALONG), share * wp.float64(read(contact.rubbed, e)))

    @wp.func
    def note(contact: Contact, e: wp.int32, slot: wp.int32, surface: wp.int32, force: X):
        """Keep where along the barrier the impulse acted, and its moment about the barrier's toe."""
        foot = contact.foot[e]
        wp.atomic_add(contact.turned, 2 * surface, foot[1] * wp.float64(force[0]))
        wp.atomic_add(contact.turned, 2 * surface + 1, foot[0] * wp.float64(force[1]))
        share = contact.share[e]
        add(contact, wp.static(SLOT_SIZE) * slot, share, e)
        if share < wp.float64(1.0):
            add(contact, wp.static(SLOT_SIZE) * (slot + 1), wp.float64(1.0) - share, e)

    @wp.func
    def finish(
        contact: Contact,
        e: wp.int32,
        grid: Grid,
        parameters: Parameters,
        time_step: F,
        reactions: wp.array(dtype=wp.float64),
    ):
        """Tell the transfer scheme, and record the impulse."""
        if RECEIVES:
            give_scheme(contact, e, whole(contact, e, parameters, time_step), grid, parameters)
        force = on_body(contact, e)
        surface = read(contact.surface, e)
        for axis in range(wp.static(DIMENSIONS)):
            wp.atomic_add(reactions, wp.static(DIMENSIONS) * surface + axis, wp.float64(force[axis]))
        slot = read(contact.slot, e)
        if slot >= 0:
            note(contact, e, slot, surface, force)

    @wp.kernel(module=module)
    def press(
        contact: Contact,
        bodies: Bodies,
        grid: Grid,
        parameters: Parameters,
        book: Book,
    ):
        """Places that share no node with another, of bodies whose velocity is known."""
        group = wp.tid()
        block = contact.block[group]
        bi = block / parameters.block_rows
        if grid.block[bi, block - bi * parameters.block_rows] != 0:
            time_step = F(book.clock[wp.static(TIME_STEP)])
            for e in range(contact.start[group], contact.start[group + 1]):
                inverse = inverse_mass(contact, e, grid, parameters)
                if inverse > F(0.0):
                    write(contact.inverse, e, inverse)
                    recall(contact, e, F(0.0))
                    relax(contact, e, bodies, grid, parameters, time_step)
                    finish(contact, e, grid, parameters, time_step, book.reactions)

    kernels = SimpleNamespace(press=press)
    if not effects.joined:
        return kernels

    @wp.func_native("\n#if defined(__CUDA_ARCH__)\n__syncthreads();\n#endif\n")
    def meet():
        """All threads of the block wait for each other; on the CPU there is but one."""
        ...

    @wp.kernel(module=module)
    def join(
        contact: Contact,
        bodies: Bodies,
        grid: Grid,
        parameters: Parameters,
        book: Book,
    ):
        """Places that share nodes, together, and with them the bodies that slide. One block of threads: those of one
        colour share no node."""
        lane = wp.tid()
        dt = book.clock[wp.static(TIME_STEP)]
        time_step = F(dt)
        again = wp.float64(0.0)
        if contact.last[0] > wp.float64(0.0):
            again = dt / contact.last[0]
        meet()
        if lane == 0:
            contact.last[0] = dt
            begin(bodies, dt, again)
        for r in range(contact.runs[0] + lane, contact.runs[contact.colours], contact.lanes):
            near = flow_around(contact, r, grid, parameters)
            # One that the flow has left forgets its impulses.
            if near != 0 or read(contact.near, r) != 0:
                for e in range(read(contact.run, r), read(contact.run, r + 1)):
                    before = read(contact.inverse, e)
                    find(contact, e, bodies, grid, parameters)
                    recall(contact, e, F(again) * kept(before, read(contact.inverse, e)))
            write(contact.near, r, near)
        meet()
        for c in range(contact.colours):
            for r in range(contact.runs[c] + lane, contact.runs[c + 1], contact.lanes):
                if read(contact.near, r) != 0:
                    for e in range(read(contact.run, r), read(contact.run, r + 1)):
                        if read(contact.inverse, e) > F(0.0):
                            give(contact, e, whole(contact, e, parameters, time_step), grid, parameters)
                            if CARRIED:
                                alone = read(contact.alone, e) / filling_ratio(contact, e, parameters)
                                give_alone(contact, e, alone * read(contact.normal, e), grid, parameters)
                            react(bodies, read(contact.body, e), on_body(contact, e))
            meet()
        if lane == 0:
            yield_to_flow(bodies)
        meet()
        sweep = wp.int32(0)
        more = wp.int32(1)
        while more == 1:
            for step in range(contact.colours):
                c = wp.where(sweep % 2 == 0, step, contact.colours - 1 - step)
                for r in range(contact.runs[c] + lane, contact.runs[c + 1], contact.lanes):
                    if read(contact.near, r) != 0:
                        for e in range(read(contact.run, r), read(contact.run, r + 1)):
                            if read(contact.inverse, e) > F(0.0):
                                relax(contact, e, bodies, grid, parameters, time_step)
                meet()
                if SLIDING:
                    if lane == 0:
                        yield_to_flow(bodies)
                    meet()
            sweep += 1
            more = wp.where(sweep < wp.static(SWEEPS), wp.int32(1), wp.int32(0))
            if SLIDING:
                if lane == 0:
                    contact.more[0] = wp.where(hold(bodies, dt) and sweep < wp.static(MOST), wp.int32(1), more)
                meet()
                more = contact.more[0]
                meet()
        for c in range(contact.colours):
            for r in range(contact.runs[c] + lane, contact.runs[c + 1], contact.lanes):
                if read(contact.near, r) != 0:
                    for e in range(read(contact.run, r), read(contact.run, r + 1)):
                        if read(contact.inverse, e) > F(0.0):
                            finish(contact, e, grid, parameters, time_step, book.reactions)
            meet()
        if lane == 0:
            go_on(bodies, grid, parameters, time_step)
            if SLIDING:
                wp.atomic_add(book.counters, wp.static(BARRIER_ITERATIONS), sweep)
                if sweep == wp.static(MOST):
                    wp.atomic_add(book.counters, wp.static(BARRIER_UNCONVERGED), 1)

    kernels.join = join
    return kernels
