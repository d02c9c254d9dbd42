"""Transfer between material points and grid: scatter (points to grid), gather (grid to points)."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from ..simulator.bodies.kernels import RUBBED, RUBS
from .around import make_around
from .elementary import make_elementary
from .layout import (
    BLOCK_SHIFT,
    FLOW_END,
    FLOW_STEP,
    SPEED_MAX,
    TIME_STEP,
)

EVEN = 0.1
"""Crowding up to which nothing is done: an even arrangement of points varies by that as it crosses the grid."""


def make_transfer(
    types: SimpleNamespace,
    shapes: SimpleNamespace,
    vectors: SimpleNamespace,
    pore: SimpleNamespace,
    bodies_of: Any,
    module: str,
) -> SimpleNamespace:
    """Build the kernels `scatter` and `gather` (over points)."""
    effects = types.effects
    F = types.scalar
    V2 = types.V2
    V3 = types.V3
    V = types.V
    S = types.S
    Points = types.Points
    Grid = types.Grid
    Parameters = types.Parameters
    weights = shapes.weights
    slopes = shapes.slopes
    hats = shapes.hats
    cell_of, layer_of = shapes.cell_of, shapes.layer_of
    per_phase, of_phases, solid_of = vectors.per_phase, vectors.of_phases, vectors.solid_of
    on_x, on_y, on_z = vectors.on_x, vectors.on_y, vectors.on_z
    face_x, face_y, face_z = vectors.face_x, vectors.face_y, vectors.face_z
    trace, shear_rate, midway, section = vectors.trace, vectors.shear_rate, vectors.midway, vectors.section
    speed_squared = vectors.speed_squared
    SPATIAL = types.dimensions == 3
    LAYERS, CORNER_LAYERS = (3, 2) if SPATIAL else (1, 1)
    elementary = make_elementary(types)
    read, write, add, larger = elementary.read, elementary.write, elementary.add, elementary.larger

    nodes = make_around(types)
    nine, part = nodes.nine, nodes.part

    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    scheme = types.scheme
    start, column, deposit, collect = scheme.start, scheme.column, scheme.deposit, scheme.collect
    force_share, impulse_share = scheme.force_share, scheme.impulse_share
    start_across, collect_in_space = scheme.start_across, scheme.collect_in_space
    CORNERS = effects.smoothing_grid
    DENSITY = effects.density_correction
    RELAXATION = effects.pressure_relaxation
    VISCOSITY = effects.bulk_viscosity
    EXTRA_STRESS = effects.skeleton.extra_stress
    LIQUID_ALONE = effects.liquid_alone
    ALONE_OF_MIXTURE = LIQUID_ALONE and not TWO_PHASE
    near_some = bodies_of.near_some if ALONE_OF_MIXTURE else None
    RESTING = not effects.passing
    Bodies = types.Bodies
    Book = types.Book
    POROSITY = effects.porosity_update
    CONDUCTIVITY = effects.conductivity != "constant"
    BEYOND = "drag_beyond" in types.grid_fields
    DRAG = "drag" in types.grid_fields and TWO_PHASE
    PARTLY_DRY = types.partly_dry
    DRY = PARTLY_DRY and not LIQUID  # in a scene that is wet elsewhere
    TOLD = "told" in types.grid_fields
    GAIN = "filling_gain" in types.grid_fields
    UNLIKE = "pore_impulse" in types.grid_fields and TWO_PHASE
    TOLD_DRAG = "drag" in types.told and POROSITY
    TOLD_BEYOND = "drag_beyond" in types.told
    DRAG_AT, BEYOND_AT = types.told.get("drag", 0), types.told.get("drag_beyond", 0)
    resistance = pore.resistance
    OWN_DIVERGENCE = "liquid_divergence" in types.point_fields and TWO_PHASE
    pressure_at, filter_share = pore.pressure, pore.filter_share
    porosity = pore.porosity

    @wp.func
    def mark(grid: Grid, block: wp.int32, parameters: Parameters):
        """Add a block to the list of those in use, unless it is there."""
        if read(grid.block, block) == 0:
            bi = block / parameters.block_rows
            bj = block - bi * parameters.block_rows
            if wp.atomic_cas(grid.block, bi, bj, 0, 1) == 0:
                place = wp.atomic_add(grid.active_count, 0, 1)
                grid.active[place] = block

    @wp.func
    def mark_around(grid: Grid, ci: wp.int32, cj: wp.int32, first_block: wp.int32, parameters: Parameters):
        """Mark the blocks of a layer that hold the nodes around one; `first_block` is the layer's."""
        left = first_block + ((ci - 1) >> wp.static(BLOCK_SHIFT)) * parameters.block_rows
        right = first_block + ((ci + 1) >> wp.static(BLOCK_SHIFT)) * parameters.block_rows
        low = (cj - 1) >> wp.static(BLOCK_SHIFT)
        high = (cj + 1) >> wp.static(BLOCK_SHIFT)
        mark(grid, left + low, parameters)
        mark(grid, right + low, parameters)
        mark(grid, left + high, parameters)
        mark(grid, right + high, parameters)

    @wp.func
    def note_around(grid: Grid, ci: wp.int32, cj: wp.int32, first_block: wp.int32, parameters: Parameters):
        """Note that somebody tells the nodes of the same blocks something."""
        left = first_block + ((ci - 1) >> wp.static(BLOCK_SHIFT)) * parameters.block_rows
        right = first_block + ((ci + 1) >> wp.static(BLOCK_SHIFT)) * parameters.block_rows
        low = (cj - 1) >> wp.static(BLOCK_SHIFT)
        high = (cj + 1) >> wp.static(BLOCK_SHIFT)
        write(grid.telling, left + low, 1)
        write(grid.telling, right + low, 1)
        write(grid.telling, left + high, 1)
        write(grid.telling, right + high, 1)

    @wp.func
    def spread(p: wp.int32, points: Points, grid: Grid, parameters: Parameters, bodies: Bodies, book: Book):
        """Mass, momentum and internal force of the points to the nodes, the latter two of each phase.

        Internal forces per node: solid -sum V (sigma' - (1 - n) p I) grad w, liquid +sum V n p grad w, with p
        compression positive: audit 3.4, action and reaction between the phases included.
        """
        x = read(points.position, p)
        shift = F(grid.shift[0])
        ci, cj, fx, fy = cell_of(x, shift, parameters)
        first = (ci - 1) * parameters.rows + cj - 1
        wx = weights(fx)
        wy = weights(fy)
        dx = slopes(fx)
        dy = slopes(fy)
        reference = read(points.reference_volume, p)
        # Grains do not give way: once the voids are closed the same pressure acts on their volume, not on less.
        volume = larger(read(points.volume, p), parameters.grain_share * reference)
        stress = read(points.stress, p)
        mass = reference * parameters.solid_density
        liquid_mass = F(0.0)
        if TWO_PHASE:
            liquid_mass = reference * parameters.liquid_density
        masses = per_phase(mass, liquid_mass)
        time_step = F(book.clock[wp.static(TIME_STEP)])
        gravity = of_phases(parameters.gravity, parameters.gravity)

        if SPATIAL:
            cl, fz = layer_of(x, parameters)
            first += (cl - 1) * parameters.layer
            wz = weights(fz)
            dz = slopes(fz)
            to_z = V3(F(-0.5) - fz, F(0.5) - fz, F(1.5) - fz)
            blocks = parameters.layer >> wp.static(2 * BLOCK_SHIFT)
            for q in range(3):
                mark_around(grid, ci, cj, (cl - 1 + q) * blocks, parameters)
        else:
            mark_around(grid, ci, cj, 0, parameters)

        pressure = F(0.0)
        if LIQUID:
            pressure = pressure_at(read(points.liquid_strain, p), parameters)
        if VISCOSITY:
            pressure += read(points.viscous_pressure, p)
        solid_pressure = pressure
        liquid_force = F(0.0)
        if TWO_PHASE:
            n = porosity(reference, volume, parameters)
            if CONDUCTIVITY:
                resisting = resistance(n, parameters)
            solid_pressure = (F(1.0) - n) * pressure
            liquid_force = volume * n * pressure
        per_cell = parameters.inverse_spacing * force_share(time_step)
        push = volume * per_cell
        liquid_force *= per_cell
        if EXTRA_STRESS:
            stress += read(points.extra_stress, p)
        # Force on a node: force_x times the weight's slope (per cell) along x, plus force_y times that along y, ...
        force_x = of_phases(face_x(stress, solid_pressure, push), on_x(liquid_force))
        force_y = of_phases(face_y(stress, solid_pressure, push), on_y(liquid_force))
        if TOLD:
            tells = parameters.tells
            telling = parameters.excess
            if TOLD_DRAG:
                # All of it, and its change with the porosity.
                tells = 1
                ratio = n / parameters.porosity
                own_drag = parameters.drag_per_mass * ratio * ratio
                if TOLD_BEYOND:
                    own_beyond = parameters.inertial_drag_per_mass * ratio * ratio * ratio
                if CONDUCTIVITY:
                    own_drag *= resisting
                    if TOLD_BEYOND:
                        own_beyond *= wp.sqrt(resisting)
                telling[wp.static(DRAG_AT)] = own_drag
                if TOLD_BEYOND:
                    telling[wp.static(BEYOND_AT)] = own_beyond
        momentum, change_x, change_y = start(points, p, masses, gravity, time_step, parameters)

        to_x = V3(F(-0.5) - fx, F(0.5) - fx, F(1.5) - fx)
        to_y = V3(F(-0.5) - fy, F(0.5) - fy, F(1.5) - fy)

        if SPATIAL:
            force_z = of_phases(face_z(stress, solid_pressure, push), on_z(liquid_force))
            change_z = start_across(points, p, masses, parameters)

        # What depends on z alone is formed once per layer of nodes, what depends on x once per column.
        for q in range(wp.static(LAYERS)):
            layer = first
            layer_mass = mass
            layer_momentum = momentum
            layer_force_x = force_x
            layer_force_y = force_y
            layer_change_x = change_x
            layer_change_y = change_y
            if SPATIAL:
                layer = first + q * parameters.layer
                layer_mass = wz[q] * mass
                layer_momentum = column(wz[q], dz[q], to_z[q], momentum, force_z, change_z)
                layer_force_x = wz[q] * force_x
                layer_force_y = wz[q] * force_y
                layer_force_z = dz[q] * force_z
                layer_change_x = wz[q] * change_x
                layer_change_y = wz[q] * change_y
            for k in range(3):
                column_momentum = column(wx[k], dx[k], to_x[k], layer_momentum, layer_force_x, layer_change_x)
                column_force = dx[k] * layer_force_x
                if SPATIAL:
                    column_force += wx[k] * layer_force_z
                column_slope = wx[k] * layer_force_y
                column_change = wx[k] * layer_change_y
                column_mass = wx[k] * layer_mass
                for m in range(3):
                    node = layer + k * parameters.rows + m
                    add(grid.mass, node, wy[m] * column_mass)
                    if DRAG:
                        # The coefficient n^2 rho_L g / k goes with n^2, and with the conductivity where that changes.
                        ratio = n / parameters.porosity
                        if CONDUCTIVITY:
                            add(grid.drag, node, wy[m] * column_mass * ratio * ratio * resisting)
                            if BEYOND:
                                # n^3 rho_L C_F / sqrt(kappa)
                                beyond = ratio * ratio * ratio * wp.sqrt(resisting)
                                add(grid.drag_beyond, node, wy[m] * column_mass * beyond)
                        else:
                            add(grid.drag, node, wy[m] * column_mass * ratio * ratio)
                    deposit(
                        grid, node, wy[m], dy[m], to_y[m], column_momentum, column_change, column_force, column_slope
                    )

        if UNLIKE:
            impulse = pressure * volume * parameters.inverse_spacing * time_step
            for k in range(3):
                for m in range(3):
                    along = V2(impulse * dx[k] * wy[m], impulse * wx[k] * dy[m])
                    add(grid.pore_impulse, first + k * parameters.rows + m, of_phases(along, n * along))

        if TOLD:
            if tells == 1:
                for q in range(wp.static(LAYERS)):
                    if SPATIAL:
                        note_around(grid, ci, cj, (cl - 1 + q) * blocks, parameters)
                    else:
                        note_around(grid, ci, cj, 0, parameters)
                    for k in range(3):
                        for m in range(3):
                            node = first + k * parameters.rows + m
                            share = wx[k] * wy[m] * mass
                            if SPATIAL:
                                node += q * parameters.layer
                                share *= wz[q]
                            add(grid.told, node, share * telling)

        if ALONE_OF_MIXTURE:
            rubbed = wp.bool(False)
            # Only nodes of a surface that rubs read it. A point's farthest node is 1.5 sqrt(2) cells away, and
            # a node acts for a face up to half a cell outside.
            if RESTING:
                rubbed = (read(grid.solid, ci * parameters.rows + cj) & wp.static(RUBS)) != 0
            else:
                reach = F(wp.static(RUBBED)) * parameters.spacing
                rubbed = near_some(bodies, bodies.rubs, section(x), ci, parameters.columns, reach)
            if rubbed:
                # Of liquid that fills the whole volume, times the mixture's mass over its own.
                alone = pressure * volume * parameters.inverse_spacing * time_step
                share = impulse_share(time_step)
                if GAIN:
                    # Nodes know its mass: here what takes the mixture's forces away.
                    along_x = -share * solid_of(force_x)
                    along_y = -share * solid_of(force_y)
                else:
                    alone /= parameters.filling_ratio
                    along_x = on_x(alone) - share * solid_of(force_x)
                    along_y = on_y(alone) - share * solid_of(force_y)
                    if SPATIAL:
                        along_z = on_z(alone) - share * solid_of(force_z)
                for q in range(wp.static(LAYERS)):
                    for k in range(3):
                        for m in range(3):
                            node = first + k * parameters.rows + m
                            excess = (dx[k] * wy[m]) * along_x + (wx[k] * dy[m]) * along_y
                            if SPATIAL:
                                node += q * parameters.layer
                                excess = wz[q] * excess + (dz[q] * wx[k] * wy[m]) * along_z
                            add(grid.liquid_alone, node, excess)
                            if GAIN:
                                add(grid.filling_gain, node, alone * V2(dx[k] * wy[m], wx[k] * dy[m]))

    @wp.kernel(module=module)
    def scatter(points: Points, grid: Grid, parameters: Parameters, bodies: Bodies, book: Book):
        p = wp.int32(wp.tid())
        end = book.flow[wp.static(FLOW_END)]
        step = book.flow[wp.static(FLOW_STEP)]
        while p < end:
            if read(points.inside, p) > 0:
                spread(p, points, grid, parameters, bodies, book)
            p += step

    @wp.func
    def mean(w: V3, low: V, middle: V, high: V) -> V:
        return w[0] * low + w[1] * middle + w[2] * high

    @wp.func
    def line(w: V3, f: F, low: V, middle: V, high: V):
        """Of a field at three nodes in a row: its weighted mean, its first moment about the middle one and its slope,
        both in cells."""
        first = w[0] * low
        last = w[2] * high
        slope = (F(1.0) - f) * (middle - low) + f * (high - middle)
        return first + w[1] * middle + last, last - first, slope

    @wp.func
    def around(grid: Grid, first: wp.int32, wx: V3, wy: V3, fx: F, fy: F, parameters: Parameters):
        """Of the velocity at the nine nodes of a layer: mean, first moments along x and y, slopes along them."""
        all = nine(grid.velocity, first, parameters.rows, fx, fy, wx[0], wx[1], wx[2], wy[0], wy[1], wy[2])
        return part(all, 0), part(all, 1), part(all, 2), part(all, 3), part(all, 4)

    @wp.func
    def take(p: wp.int32, points: Points, grid: Grid, parameters: Parameters, book: Book):
        """Velocities and velocity gradient from the nodes to the points; volume strain rates to the corners."""
        x = read(points.position, p)
        shift = F(grid.shift[0])
        time_step = F(book.clock[wp.static(TIME_STEP)])
        ci, cj, fx, fy = cell_of(x, shift, parameters)
        first = (ci - 1) * parameters.rows + cj - 1
        wx = weights(fx)
        wy = weights(fy)

        # Moments about the point, not about the middle node.
        if SPATIAL:
            cl, fz = layer_of(x, parameters)
            first += (cl - 1) * parameters.layer
            wz = weights(fz)
            second = first + parameters.layer
            third = second + parameters.layer
            front, front_x, front_y, front_dx, front_dy = around(grid, first, wx, wy, fx, fy, parameters)
            middle, middle_x, middle_y, middle_dx, middle_dy = around(grid, second, wx, wy, fx, fy, parameters)
            back, back_x, back_y, back_dx, back_dy = around(grid, third, wx, wy, fx, fy, parameters)
            smooth, lean_z, slope_z = line(wz, fz, front, middle, back)
            along_x = mean(wz, front_dx, middle_dx, back_dx) * parameters.inverse_spacing
            along_y = mean(wz, front_dy, middle_dy, back_dy) * parameters.inverse_spacing
            along_z = slope_z * parameters.inverse_spacing
            lean_x = mean(wz, front_x, middle_x, back_x) + (F(0.5) - fx) * smooth
            lean_y = mean(wz, front_y, middle_y, back_y) + (F(0.5) - fy) * smooth
            lean_z += (F(0.5) - fz) * smooth
            velocity = collect_in_space(
                points, p, grid, first, wx, wy, wz, smooth, lean_x, lean_y, lean_z, time_step, parameters
            )
            gradient, liquid_divergence = midway(along_x, along_y, along_z, time_step)
        else:
            smooth, lean_x, lean_y, slope_x, slope_y = around(grid, first, wx, wy, fx, fy, parameters)
            along_x = slope_x * parameters.inverse_spacing
            along_y = slope_y * parameters.inverse_spacing
            lean_x += (F(0.5) - fx) * smooth
            lean_y += (F(0.5) - fy) * smooth
            velocity = collect(points, p, grid, first, wx, wy, smooth, lean_x, lean_y, time_step, parameters)
            gradient, liquid_divergence = midway(along_x, along_y, time_step)
        if DRY:
            # It has no liquid; what the nodes have of it is another material's.
            velocity = of_phases(solid_of(velocity), solid_of(velocity))
            write(points.velocity, p, velocity)
        fastest = wp.float64(speed_squared(velocity))
        # Few points are the fastest so far, and a load is cheaper than a store that the next point waits for.
        if fastest > book.clock[wp.static(SPEED_MAX)]:
            wp.atomic_max(book.clock, wp.static(SPEED_MAX), fastest)

        write(points.gradient, p, gradient)
        divergence = trace(gradient)
        if OWN_DIVERGENCE:
            write(points.liquid_divergence, p, liquid_divergence)
        if DENSITY:
            # Beyond what a regular arrangement of points varies by, crowding counts as compression (of both phases), at
            # the rate of the shearing that brings it about; the corners' averages keep the pressures smooth.
            squeeze = (
                parameters.density_correction
                * shear_rate(gradient)
                * larger(read(points.crowding, p) - F(wp.static(EVEN)), F(0.0))
            )
            divergence -= squeeze
            liquid_divergence -= squeeze
        if CORNERS:
            hx = hats(fx)
            hy = hats(fy)
            reference = read(points.reference_volume, p)
            excess = F(0.0)
            residual = F(0.0)
            if RELAXATION:
                residual = filter_share(read(points.surrounded, p)) * read(points.pressure_residual, p)
                # Excess over the hydrostatic part, so that water at rest is left as it is.
                excess = pressure_at(read(points.liquid_strain, p), parameters)
                excess -= parameters.true_liquid_density * wp.dot(parameters.gravity, x)
            if SPATIAL:
                hz = hats(fz)
            for q in range(wp.static(CORNER_LAYERS)):
                for k in range(2):
                    for m in range(2):
                        h = hx[k] * hy[m] * reference
                        corner = first + k * parameters.rows + m
                        if SPATIAL:
                            h *= hz[q]
                            corner += q * parameters.layer
                        if DRY:
                            sums = S()
                            sums[0] = h
                            sums[1] = h * divergence
                            add(grid.corner, corner, sums)
                            add(grid.corner_wet, corner, h)
                        elif TWO_PHASE:
                            sums = S(h, h * divergence, h * excess, h * residual, h * liquid_divergence)
                            add(grid.corner, corner, sums)
                        elif LIQUID:
                            add(grid.corner, corner, S(h, h * divergence, h * excess, h * residual))
                        else:
                            add(grid.corner, corner, S(h, h * divergence))

    @wp.kernel(module=module)
    def gather(points: Points, grid: Grid, parameters: Parameters, book: Book):
        p = wp.int32(wp.tid())
        end = book.flow[wp.static(FLOW_END)]
        step = book.flow[wp.static(FLOW_STEP)]
        while p < end:
            if read(points.inside, p) > 0:
                take(p, points, grid, parameters, book)
            p += step

    return SimpleNamespace(scatter=scatter, gather=gather)
