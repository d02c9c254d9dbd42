"""Equations of motion at the nodes, with the drag between the phases."""

from types import SimpleNamespace

import warp as wp

from .layout import BLOCK, TIME_STEP


def make_grid_momentum(types: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build the kernel `move` (over blocks) and the function `free_velocity` (before contact and drag)."""
    effects = types.effects
    F = types.scalar
    V2 = types.V2
    V = types.V
    S = types.S
    Grid = types.Grid
    Parameters = types.Parameters
    TWO_PHASE = effects.two_phase
    IMPLICIT_DRAG = effects.drag == "semi_implicit"
    FLIP = effects.transfer == "flip"
    CORNERS = effects.smoothing_grid

    @wp.func
    def free_velocity(grid: Grid, parameters: Parameters, i: wp.int32, j: wp.int32, time_step: F) -> V:
        """Velocities at the end of the step under internal forces and gravity alone."""
        inverse = F(1.0) / grid.mass[i, j]
        momentum = grid.momentum[i, j]
        force = grid.force[i, j]
        g = parameters.gravity
        solid = time_step * inverse / parameters.solid_density
        result = V()
        if TWO_PHASE:
            liquid = time_step * inverse / parameters.liquid_density
            result = V(
                momentum[0] * inverse + force[0] * solid + g[0] * time_step,
                momentum[1] * inverse + force[1] * solid + g[1] * time_step,
                momentum[2] * inverse + force[2] * liquid + g[0] * time_step,
                momentum[3] * inverse + force[3] * liquid + g[1] * time_step,
            )
        else:
            result = V(
                momentum[0] * inverse + force[0] * solid + g[0] * time_step,
                momentum[1] * inverse + force[1] * solid + g[1] * time_step,
            )
        return result

    @wp.func
    def dragged(free: V, old: V, parameters: Parameters, time_step: F) -> V:
        """Exchange momentum between the phases. Per node and direction the two unknowns decouple into the mixture's
        velocity, which drag leaves alone, and w = v_L - v_S, which decays at the rate Q (1/n_S rho_S + 1/n rho_L)."""
        total = parameters.solid_density + parameters.liquid_density
        solid_share = parameters.solid_density / total
        liquid_share = parameters.liquid_density / total
        mixture = V2(
            solid_share * free[0] + liquid_share * free[2], solid_share * free[1] + liquid_share * free[3]
        )
        w = V2(free[2] - free[0], free[3] - free[1])
        rate = parameters.drag_rate * time_step
        if IMPLICIT_DRAG:
            w = w / (F(1.0) + rate)
        else:
            w -= rate * V2(old[2] - old[0], old[3] - old[1])
        return V(
            mixture[0] - liquid_share * w[0],
            mixture[1] - liquid_share * w[1],
            mixture[0] + solid_share * w[0],
            mixture[1] + solid_share * w[1],
        )

    @wp.kernel(module=module)
    def move(grid: Grid, parameters: Parameters, clock: wp.array(dtype=wp.float64)):
        """Velocity and velocity increment of every node in use; empties the corners for this step's gather."""
        bi, bj = wp.tid()
        mark = grid.block[bi, bj]
        if mark > 0:
            time_step = F(clock[wp.static(TIME_STEP)])
            for a in range(wp.static(BLOCK)):
                for b in range(wp.static(BLOCK)):
                    i = bi * wp.static(BLOCK) + a
                    j = bj * wp.static(BLOCK) + b
                    if CORNERS:
                        grid.corner[i, j] = S()
                    mass = grid.mass[i, j]
                    if mass > F(0.0):
                        old = grid.momentum[i, j] / mass
                        new = free_velocity(grid, parameters, i, j, time_step)
                        if TWO_PHASE:
                            new = dragged(new, old, parameters, time_step)
                        grid.velocity[i, j] = new
                        if FLIP:
                            grid.increment[i, j] = new - old

    return SimpleNamespace(move=move, free_velocity=free_velocity)
