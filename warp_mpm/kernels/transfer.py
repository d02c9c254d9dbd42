"""Transfer between material points and grid: clear, scatter (points to grid), gather (grid to points)."""

from types import SimpleNamespace

import warp as wp

from .layout import (
    BLOCK,
    GRID_SHIFT,
    SPEED_MAX,
    TIME_STEP,
)


def make_transfer(types: SimpleNamespace, shapes: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build the kernels `clear` (over blocks), `scatter` and `gather` (over points)."""
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

    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    FLIP = effects.transfer == "flip"
    APIC = effects.transfer == "apic"
    CORNERS = effects.smoothing_grid
    SMOOTHING = effects.volumetric_smoothing
    RELAXATION = effects.pressure_relaxation
    PORE_FORCE = effects.effective_contact_force
    DRAG_RATE = effects.two_phase

    @wp.kernel(module=module)
    def clear(grid: Grid):
        """Empty the nodes of every block that was in use. A block's mark is 2 when points touched it this step, 1 when
        they did in the step before (its corners are still to be emptied), 0 when it is not in use."""
        bi, bj = wp.tid()
        mark = grid.block[bi, bj]
        if mark > 0:
            grid.block[bi, bj] = mark - 1
            for a in range(wp.static(BLOCK)):
                for b in range(wp.static(BLOCK)):
                    i = bi * wp.static(BLOCK) + a
                    j = bj * wp.static(BLOCK) + b
                    grid.mass[i, j] = F(0.0)
                    grid.momentum[i, j] = V()
                    grid.force[i, j] = V()
                    if PORE_FORCE:
                        grid.pore_force[i, j] = V2()

    @wp.kernel(module=module)
    def scatter(points: Points, grid: Grid, parameters: Parameters, clock: wp.array(dtype=wp.float64)):
        """Mass, momentum and internal force of the points to the nodes, per unit of each phase's density.

        Internal forces per node: solid -sum V (sigma' - (1 - n) p I) grad w, liquid +sum V n p grad w, with p
        compression positive: audit 3.4, action and reaction between the phases included.
        """
        p = wp.tid()
        if points.inside[p] == 0:
            return
        x = points.position[p]
        shift = F(clock[wp.static(GRID_SHIFT)])
        sx = (x[0] - parameters.left - shift) * parameters.inverse_spacing
        sy = (x[1] - parameters.bottom) * parameters.inverse_spacing
        ci = wp.int32(sx)
        cj = wp.int32(sy)
        fx = sx - F(ci)
        fy = sy - F(cj)
        wx = weights(fx)
        wy = weights(fy)
        dx = slopes(fx) * parameters.inverse_spacing
        dy = slopes(fy) * parameters.inverse_spacing
        reference = points.reference_volume[p]
        volume = points.volume[p]
        stress = points.stress[p]
        velocity = points.velocity[p] * reference

        grid.block[(ci - 1) / wp.static(BLOCK), (cj - 1) / wp.static(BLOCK)] = 2
        grid.block[(ci + 1) / wp.static(BLOCK), (cj - 1) / wp.static(BLOCK)] = 2
        grid.block[(ci - 1) / wp.static(BLOCK), (cj + 1) / wp.static(BLOCK)] = 2
        grid.block[(ci + 1) / wp.static(BLOCK), (cj + 1) / wp.static(BLOCK)] = 2

        pressure = F(0.0)
        if LIQUID:
            pressure = wp.max(
                -parameters.liquid_bulk_modulus * points.liquid_strain[p], -parameters.cavitation_pressure
            )
        solid_pressure = pressure
        liquid_force = F(0.0)
        if TWO_PHASE:
            n = parameters.porosity
            solid_pressure = (F(1.0) - n) * pressure
            liquid_force = volume * n * pressure
        xx = (solid_pressure - stress[0]) * volume
        yy = (solid_pressure - stress[1]) * volume
        xy = -stress[3] * volume
        pore = pressure * volume

        to_x = V3(F(-0.5) - fx, F(0.5) - fx, F(1.5) - fx)
        to_y = V3(F(-0.5) - fy, F(0.5) - fy, F(1.5) - fy)
        affine_x = V()
        affine_y = V()
        if APIC:
            affine_x = points.affine_x[p] * (parameters.spacing * reference)
            affine_y = points.affine_y[p] * (parameters.spacing * reference)
        for k in range(3):
            for m in range(3):
                i = ci + (k - 1)
                j = cj + (m - 1)
                w = wx[k] * wy[m]
                gx = dx[k] * wy[m]
                gy = wx[k] * dy[m]
                grid.mass[i, j] += w * reference
                if FLIP:
                    grid.momentum[i, j] += w * velocity
                else:
                    grid.momentum[i, j] += w * (velocity + to_x[k] * affine_x + to_y[m] * affine_y)
                if TWO_PHASE:
                    grid.force[i, j] += V(
                        xx * gx + xy * gy, xy * gx + yy * gy, liquid_force * gx, liquid_force * gy
                    )
                else:
                    grid.force[i, j] += V(xx * gx + xy * gy, xy * gx + yy * gy)
                if PORE_FORCE:
                    grid.pore_force[i, j] += V2(pore * gx, pore * gy)

    @wp.kernel(module=module)
    def gather(points: Points, grid: Grid, parameters: Parameters, clock: wp.array(dtype=wp.float64)):
        """Velocities and velocity gradient from the nodes to the points; volume strain rates to the corners."""
        p = wp.tid()
        if points.inside[p] == 0:
            return
        x = points.position[p]
        shift = F(clock[wp.static(GRID_SHIFT)])
        time_step = F(clock[wp.static(TIME_STEP)])
        sx = (x[0] - parameters.left - shift) * parameters.inverse_spacing
        sy = (x[1] - parameters.bottom) * parameters.inverse_spacing
        ci = wp.int32(sx)
        cj = wp.int32(sy)
        fx = sx - F(ci)
        fy = sy - F(cj)
        wx = weights(fx)
        wy = weights(fy)
        dx = slopes(fx) * parameters.inverse_spacing
        dy = slopes(fy) * parameters.inverse_spacing

        to_x = V3(F(-0.5) - fx, F(0.5) - fx, F(1.5) - fx)
        to_y = V3(F(-0.5) - fy, F(0.5) - fy, F(1.5) - fy)
        smooth = V()
        increment = V()
        along_x = V()
        along_y = V()
        affine_x = V()
        affine_y = V()
        for k in range(3):
            for m in range(3):
                i = ci + (k - 1)
                j = cj + (m - 1)
                w = wx[k] * wy[m]
                v = grid.velocity[i, j]
                smooth += w * v
                if FLIP:
                    increment += w * grid.increment[i, j]
                else:
                    affine_x += (w * to_x[k]) * v
                    affine_y += (w * to_y[m]) * v
                along_x += (dx[k] * wy[m]) * v
                along_y += (wx[k] * dy[m]) * v

        if FLIP:
            pic = wp.min(parameters.pic_rate * time_step, F(1.0))
            old = points.velocity[p]
            new = old + increment + pic * (smooth - old - increment)
            if TWO_PHASE:
                # What the grid does not see of v_L - v_S is damped by the drag like what it does see.
                decay = F(1.0) / (F(1.0) + parameters.drag_rate * time_step)
                unseen = V2(
                    old[2] - old[0] - smooth[2] + increment[2] + smooth[0] - increment[0],
                    old[3] - old[1] - smooth[3] + increment[3] + smooth[1] - increment[1],
                )
                new = V(
                    new[0],
                    new[1],
                    new[0] + smooth[2] - smooth[0] + decay * unseen[0],
                    new[1] + smooth[3] - smooth[1] + decay * unseen[1],
                )
            points.velocity[p] = new
            points.advection[p] = V2(smooth[0], smooth[1])
            wp.atomic_max(clock, wp.static(SPEED_MAX), wp.float64(wp.length_sq(new)))
        else:
            points.velocity[p] = smooth
            points.affine_x[p] = affine_x * (F(4.0) * parameters.inverse_spacing)
            points.affine_y[p] = affine_y * (F(4.0) * parameters.inverse_spacing)
            wp.atomic_max(clock, wp.static(SPEED_MAX), wp.float64(wp.length_sq(smooth)))

        # Gradient entries: dvx/dx, dvx/dy, dvy/dx, dvy/dy of the solid.
        points.gradient[p] = V4(along_x[0], along_y[0], along_x[1], along_y[1])
        divergence = along_x[0] + along_y[1]
        liquid_divergence = F(0.0)
        if TWO_PHASE:
            liquid_divergence = along_x[2] + along_y[3]
            points.liquid_divergence[p] = liquid_divergence
        if CORNERS:
            hx = hats(fx)
            hy = hats(fy)
            reference = points.reference_volume[p]
            excess = F(0.0)
            residual = F(0.0)
            if RELAXATION:
                residual = points.pressure_residual[p]
                # Excess over the hydrostatic part, so that water at rest is left as it is.
                excess = (
                    -parameters.liquid_bulk_modulus * points.liquid_strain[p]
                    - parameters.true_liquid_density * wp.dot(parameters.gravity, x)
                )
            for k in range(2):
                for m in range(2):
                    h = hx[k] * hy[m] * reference
                    if TWO_PHASE:
                        grid.corner[ci - 1 + k, cj - 1 + m] += S(
                            h, h * divergence, h * excess, h * residual, h * liquid_divergence
                        )
                    elif LIQUID:
                        grid.corner[ci - 1 + k, cj - 1 + m] += S(h, h * divergence, h * excess, h * residual)
                    else:
                        grid.corner[ci - 1 + k, cj - 1 + m] += S(h, h * divergence)

    return SimpleNamespace(clear=clear, scatter=scatter, gather=gather)
