"""Transfer between material points and grid: clear, scatter (points to grid), gather (grid to points)."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from ..simulator.bodies.kernels import RUBBED, RUBS
from .elementary import make_elementary
from .layout import (
    BLOCK,
    BLOCK_SHIFT,
    SPEED_MAX,
    TIME_STEP,
)

EVEN = 0.1
"""Crowding up to which nothing is done: an even arrangement of points varies by that as it crosses the grid."""

LEAST_HALF = 0.25
"""Least volume, as a share, to which half a step takes a point: beyond, a step would turn it inside out."""


def make_transfer(
    types: SimpleNamespace, shapes: SimpleNamespace, pore: SimpleNamespace, bodies_of: Any, module: str
) -> SimpleNamespace:
    """Build the kernels `clear` (workers on the blocks in use), `forget`, `scatter` and `gather` (over points)."""
    effects = types.effects
    F = types.scalar
    V2 = types.V2
    V3 = types.V3
    V4 = types.V4
    V = types.V
    S = types.S
    Points = types.Points
    Grid = types.Grid
    Parameters = types.Parameters
    weights = shapes.weights
    slopes = shapes.slopes
    hats = shapes.hats
    cell_of = shapes.cell_of
    elementary = make_elementary(types)
    read, write, add, larger = elementary.read, elementary.write, elementary.add, elementary.larger

    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    scheme = types.scheme
    empty, start, column, deposit, collect = (
        scheme.clear,
        scheme.start,
        scheme.column,
        scheme.deposit,
        scheme.collect,
    )
    force_share, impulse_share = scheme.force_share, scheme.impulse_share
    CORNERS = effects.smoothing_grid
    DENSITY = effects.density_correction
    RELAXATION = effects.pressure_relaxation
    VISCOSITY = effects.bulk_viscosity
    EXTRA_STRESS = effects.skeleton.extra_stress
    LIQUID_ALONE = effects.liquid_alone
    ALONE_OF_MIXTURE = LIQUID_ALONE and not TWO_PHASE
    in_hull = bodies_of.in_hull if ALONE_OF_MIXTURE else None
    about = bodies_of.about if ALONE_OF_MIXTURE else None
    nearest = bodies_of.nearest if ALONE_OF_MIXTURE else None
    PROFILE = effects.profile
    MOVING = effects.moving
    RESTING = not effects.passing
    Bodies = types.Bodies
    Book = types.Book
    POROSITY = effects.porosity_update
    CONDUCTIVITY = effects.conductivity != "constant"
    BEYOND = "drag_beyond" in types.grid_fields
    resistance = pore.resistance
    OWN_DIVERGENCE = "liquid_divergence" in types.point_fields
    pressure_at = pore.pressure
    porosity = pore.porosity

    @wp.kernel(module=module)
    def clear(grid: Grid, parameters: Parameters):
        """Empty the nodes of the blocks that were in use. A block's mark is its place in the list of active blocks,
        counted from one; zero when it is not in use."""
        worker = wp.tid()
        for s in range(worker, grid.active_count[0] * wp.static(BLOCK), parameters.workers):
            block = grid.active[s / wp.static(BLOCK)]
            bi = block / parameters.block_rows
            bj = block - bi * parameters.block_rows
            i = bi * wp.static(BLOCK) + s % wp.static(BLOCK)
            grid.block[bi, bj] = 0
            for b in range(wp.static(BLOCK)):
                j = bj * wp.static(BLOCK) + b
                grid.mass[i, j] = F(0.0)
                grid.velocity[i, j] = V()
                empty(grid, i, j)
                if LIQUID_ALONE:
                    grid.liquid_alone[i, j] = V2()
                if POROSITY:
                    grid.drag[i, j] = F(0.0)
                    if BEYOND:
                        grid.drag_beyond[i, j] = F(0.0)
                if CORNERS:
                    grid.corner[i, j] = S()

    @wp.kernel(module=module)
    def forget(grid: Grid):
        """Forget the list of active blocks, once they are empty."""
        grid.active_count[0] = 0

    @wp.func
    def mark(grid: Grid, block: wp.int32, parameters: Parameters):
        """Add a block to the list of those in use, unless it is there."""
        if read(grid.block, block) == 0:
            bi = block / parameters.block_rows
            bj = block - bi * parameters.block_rows
            if wp.atomic_cas(grid.block, bi, bj, 0, 1) == 0:
                place = wp.atomic_add(grid.active_count, 0, 1)
                grid.active[place] = block

    @wp.kernel(module=module)
    def scatter(points: Points, grid: Grid, parameters: Parameters, bodies: Bodies, book: Book):
        """Mass, momentum and internal force of the points to the nodes, the latter two of each phase.

        Internal forces per node: solid -sum V (sigma' - (1 - n) p I) grad w, liquid +sum V n p grad w, with p
        compression positive: audit 3.4, action and reaction between the phases included.
        """
        p = wp.tid()
        if read(points.inside, p) <= 0:
            return
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
        masses = V()
        if TWO_PHASE:
            liquid_mass = reference * parameters.liquid_density
            masses = V(mass, mass, liquid_mass, liquid_mass)
        else:
            masses = V(mass, mass)
        time_step = F(book.clock[wp.static(TIME_STEP)])
        gravity = V()
        if TWO_PHASE:
            gravity = V(parameters.gravity[0], parameters.gravity[1], parameters.gravity[0], parameters.gravity[1])
        else:
            gravity = V(parameters.gravity[0], parameters.gravity[1])

        left = ((ci - 1) >> wp.static(BLOCK_SHIFT)) * parameters.block_rows
        right = ((ci + 1) >> wp.static(BLOCK_SHIFT)) * parameters.block_rows
        low = (cj - 1) >> wp.static(BLOCK_SHIFT)
        high = (cj + 1) >> wp.static(BLOCK_SHIFT)
        mark(grid, left + low, parameters)
        mark(grid, right + low, parameters)
        mark(grid, left + high, parameters)
        mark(grid, right + high, parameters)

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
        xx = (solid_pressure - stress[0]) * push
        yy = (solid_pressure - stress[1]) * push
        xy = -stress[3] * push
        # Force on a node: force_x times the weight's slope (per cell) along x, plus force_y times that along y.
        force_x = V()
        force_y = V()
        if TWO_PHASE:
            force_x = V(xx, xy, liquid_force, F(0.0))
            force_y = V(xy, yy, F(0.0), liquid_force)
        else:
            force_x = V(xx, xy)
            force_y = V(xy, yy)
        momentum, change_x, change_y = start(points, p, masses, gravity, time_step, parameters)

        to_x = V3(F(-0.5) - fx, F(0.5) - fx, F(1.5) - fx)
        to_y = V3(F(-0.5) - fy, F(0.5) - fy, F(1.5) - fy)

        # What depends on x alone is formed once per column of nodes.
        for k in range(3):
            column_momentum = column(wx[k], dx[k], to_x[k], momentum, force_x, change_x)
            column_force = dx[k] * force_x
            column_slope = wx[k] * force_y
            column_change = wx[k] * change_y
            column_mass = wx[k] * mass
            for m in range(3):
                node = first + k * parameters.rows + m
                add(grid.mass, node, wy[m] * column_mass)
                if POROSITY:
                    # The coefficient n^2 rho_L g / k goes with n^2, and with the conductivity where that is not kept.
                    ratio = n / parameters.porosity
                    if CONDUCTIVITY:
                        add(grid.drag, node, wy[m] * column_mass * ratio * ratio * resisting)
                        if BEYOND:
                            # n^3 rho_L C_F / sqrt(kappa)
                            beyond = ratio * ratio * ratio * wp.sqrt(resisting)
                            add(grid.drag_beyond, node, wy[m] * column_mass * beyond)
                    else:
                        add(grid.drag, node, wy[m] * column_mass * ratio * ratio)
                deposit(grid, node, wy[m], dy[m], to_y[m], column_momentum, column_change, column_force, column_slope)

        if ALONE_OF_MIXTURE:
            rubbed = wp.bool(False)
            # Only nodes of a surface that rubs read it. A point's farthest node is 1.5 sqrt(2) cells away, and
            # a node acts for a face up to half a cell outside.
            if RESTING:
                rubbed = (read(grid.solid, ci * parameters.rows + cj) & wp.static(RUBS)) != 0
            else:
                for body in range(bodies.count):
                    if read(bodies.rubs, body) == 1:
                        seen = x
                        if MOVING:
                            moved = bodies.displacement[body]
                            seen -= V2(F(moved[0]), F(moved[1]))
                        reach = F(wp.static(RUBBED)) * parameters.spacing
                        first_piece, last_piece = about(bodies, body, ci, parameters.columns)
                        if PROFILE:
                            # In a valley no piece alone tells that a place is far away.
                            distance, _direction, _piece = nearest(bodies.pieces, first_piece, last_piece, seen)
                            if distance < reach:
                                rubbed = wp.bool(True)
                        elif in_hull(bodies.pieces, bodies.hull, first_piece, last_piece, seen, reach):
                            rubbed = wp.bool(True)
            if rubbed:
                # Of liquid that fills the whole volume, times the mixture's mass over its own.
                alone = pressure * volume * parameters.inverse_spacing * time_step / parameters.filling_ratio
                share = impulse_share(time_step)
                along_x = V2(alone, F(0.0)) - share * force_x
                along_y = V2(F(0.0), alone) - share * force_y
                for k in range(3):
                    for m in range(3):
                        excess = (dx[k] * wy[m]) * along_x + (wx[k] * dy[m]) * along_y
                        add(grid.liquid_alone, first + k * parameters.rows + m, excess)

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
    def speed_squared(velocity: V) -> wp.float64:
        """Of the faster phase [m2/s2]."""
        result = velocity[0] * velocity[0] + velocity[1] * velocity[1]
        if TWO_PHASE:
            result = larger(result, velocity[2] * velocity[2] + velocity[3] * velocity[3])
        return wp.float64(result)

    @wp.kernel(module=module)
    def gather(points: Points, grid: Grid, parameters: Parameters, book: Book):
        """Velocities and velocity gradient from the nodes to the points; volume strain rates to the corners."""
        p = wp.tid()
        if read(points.inside, p) <= 0:
            return
        x = read(points.position, p)
        shift = F(grid.shift[0])
        time_step = F(book.clock[wp.static(TIME_STEP)])
        ci, cj, fx, fy = cell_of(x, shift, parameters)
        first = (ci - 1) * parameters.rows + cj - 1
        wx = weights(fx)
        wy = weights(fy)

        # Along each of the three columns of nodes first, then across.
        second = first + parameters.rows
        third = second + parameters.rows
        left, left_lean, left_slope = line(
            wy, fy, read(grid.velocity, first), read(grid.velocity, first + 1), read(grid.velocity, first + 2)
        )
        centre, centre_lean, centre_slope = line(
            wy, fy, read(grid.velocity, second), read(grid.velocity, second + 1), read(grid.velocity, second + 2)
        )
        right, right_lean, right_slope = line(
            wy, fy, read(grid.velocity, third), read(grid.velocity, third + 1), read(grid.velocity, third + 2)
        )
        smooth, lean_x, slope_x = line(wx, fx, left, centre, right)
        along_x = slope_x * parameters.inverse_spacing
        along_y = mean(wx, left_slope, centre_slope, right_slope) * parameters.inverse_spacing

        # Moments about the point, not about the middle node.
        lean_x += (F(0.5) - fx) * smooth
        lean_y = mean(wx, left_lean, centre_lean, right_lean) + (F(0.5) - fy) * smooth
        velocity = collect(points, p, grid, first, wx, wy, smooth, lean_x, lean_y, time_step, parameters)
        fastest = speed_squared(velocity)
        # Few points are the fastest so far, and a load is cheaper than a store that the next point waits for.
        if fastest > book.clock[wp.static(SPEED_MAX)]:
            wp.atomic_max(book.clock, wp.static(SPEED_MAX), fastest)

        # The points move by v dt with the velocity that they have now, which is that of the middle of the step. Its
        # gradient there is L (I + dt L / 2)^-1 of the gradient L at the places where the step began (Hughes and
        # Winget 1980): volume and rotation are then those of the points' own motion, to second order.
        half = F(0.5) * time_step
        determinant = along_x[0] * along_y[1] - along_y[0] * along_x[1]
        trace = along_x[0] + along_y[1]
        ratio = F(1.0) / larger(F(1.0) + half * (trace + half * determinant), F(wp.static(LEAST_HALF)))
        xx = ratio * (along_x[0] + half * determinant)
        yy = ratio * (along_y[1] + half * determinant)
        xy = ratio * along_y[0]
        yx = ratio * along_x[1]
        # Gradient entries: dvx/dx, dvx/dy, dvy/dx, dvy/dy of the solid.
        write(points.gradient, p, V4(xx, xy, yx, yy))
        divergence = xx + yy
        liquid_divergence = F(0.0)
        if TWO_PHASE:
            # The liquid's own gradient, in the places to which the solid takes the points.
            liquid_trace = along_x[2] + along_y[3]
            product = along_x[0] * along_x[2] + along_y[0] * along_x[3] + along_x[1] * along_y[2]
            product += along_y[1] * along_y[3]
            liquid_divergence = ratio * (liquid_trace + half * (trace * liquid_trace - product))
        if OWN_DIVERGENCE:
            write(points.liquid_divergence, p, liquid_divergence)
        if DENSITY:
            # Beyond what a regular arrangement of points varies by, crowding counts as compression (of both phases), at
            # the rate of the shearing that brings it about; the corners' averages keep the pressures smooth.
            stretch = xx - yy
            shear = xy + yx
            squeeze = (
                parameters.density_correction
                * wp.sqrt(stretch * stretch + shear * shear)
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
                if read(points.surrounded, p) == 1:
                    residual = read(points.pressure_residual, p)
                # Excess over the hydrostatic part, so that water at rest is left as it is.
                excess = pressure_at(read(points.liquid_strain, p), parameters)
                excess -= parameters.true_liquid_density * wp.dot(parameters.gravity, x)
            for k in range(2):
                for m in range(2):
                    h = hx[k] * hy[m] * reference
                    corner = first + k * parameters.rows + m
                    if TWO_PHASE:
                        sums = S(h, h * divergence, h * excess, h * residual, h * liquid_divergence)
                        add(grid.corner, corner, sums)
                    elif LIQUID:
                        add(grid.corner, corner, S(h, h * divergence, h * excess, h * residual))
                    else:
                        add(grid.corner, corner, S(h, h * divergence))

    kernels = SimpleNamespace(clear=clear, forget=forget, scatter=scatter, gather=gather)

    if CORNERS:

        @wp.kernel(module=module)
        def average(grid: Grid, parameters: Parameters):
            """Turn the corners' sums into means, and their volume into the filling: its share of the room there."""
            worker = wp.tid()
            for s in range(worker, grid.active_count[0] * wp.static(BLOCK), parameters.workers):
                block = grid.active[s / wp.static(BLOCK)]
                bi = block / parameters.block_rows
                bj = block - bi * parameters.block_rows
                i = bi * wp.static(BLOCK) + s % wp.static(BLOCK)
                for b in range(wp.static(BLOCK)):
                    j = bj * wp.static(BLOCK) + b
                    corner = grid.corner[i, j]
                    if corner[0] > F(0.0):
                        mean = corner / corner[0]
                        filling = corner[0] * grid.corner_room[i, j]
                        if DENSITY:
                            # Up to one as everywhere; beyond one, crowding, which needs the room behind inclined faces.
                            filling = wp.max(wp.min(filling, F(1.0)), corner[0] * grid.corner_space[i, j])
                        mean[0] = filling
                        grid.corner[i, j] = mean

        kernels.average = average

    return kernels
