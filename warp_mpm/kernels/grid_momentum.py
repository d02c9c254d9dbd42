"""Equations of motion at the nodes, with the drag between the phases."""

from types import SimpleNamespace

import warp as wp

from .layout import BLOCK, TIME_STEP


def make_grid_momentum(types: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build the kernel `move` (workers on the blocks in use)."""
    effects = types.effects
    F = types.scalar
    V2 = types.V2
    V = types.V
    Grid = types.Grid
    Parameters = types.Parameters
    TWO_PHASE = effects.two_phase
    IMPLICIT_DRAG = effects.drag == "semi_implicit"
    POROSITY = effects.porosity_update
    FLIP = effects.transfer == "flip"
    LIQUID_ALONE = effects.liquid_alone

    @wp.func
    def free_velocity(grid: Grid, parameters: Parameters, i: wp.int32, j: wp.int32, time_step: F) -> V:
        """Velocities at the end of the step under internal forces and gravity alone, from the momentum."""
        inverse = F(1.0) / grid.mass[i, j]
        result = grid.velocity[i, j] * inverse
        if FLIP:
            force = grid.force[i, j]
            g = parameters.gravity
            solid = inverse / parameters.solid_density
            if TWO_PHASE:
                liquid = inverse / parameters.liquid_density
                result += time_step * V(
                    force[0] * solid + g[0], force[1] * solid + g[1], force[2] * liquid + g[0], force[3] * liquid + g[1]
                )
            else:
                result += time_step * V(force[0] * solid + g[0], force[1] * solid + g[1])
        return result

    @wp.func
    def dragged(free: V, coefficient: F, parameters: Parameters, time_step: F) -> V:
        """Exchange momentum between the phases, after their own forces. Per node and direction the two unknowns
        decouple into the mixture's velocity, which drag leaves alone, and w = v_L - v_S, which decays at the rate
        Q (1 / n_S rho_S + 1 / n rho_L): over the step by a factor of 1 / (1 + rate dt), explicitly of 1 - rate dt.
        `coefficient` is Q over its value at the initial porosity."""
        total = parameters.solid_density + parameters.liquid_density
        solid_share = parameters.solid_density / total
        liquid_share = parameters.liquid_density / total
        lost = coefficient * parameters.drag_rate * time_step
        if IMPLICIT_DRAG:
            lost = lost / (F(1.0) + lost)
        x = lost * (free[2] - free[0])
        y = lost * (free[3] - free[1])
        return free + V(liquid_share * x, liquid_share * y, -solid_share * x, -solid_share * y)

    @wp.kernel(module=module)
    def move(grid: Grid, parameters: Parameters, clock: wp.array(dtype=wp.float64)):
        """From the momentum of every node in use to its velocity (with FLIP: and the increment of that)."""
        worker = wp.tid()
        time_step = F(clock[wp.static(TIME_STEP)])
        for s in range(worker, grid.active_count[0] * wp.static(BLOCK), parameters.workers):
            block = grid.active[s / wp.static(BLOCK)]
            bi = block / parameters.block_rows
            bj = block - bi * parameters.block_rows
            i = bi * wp.static(BLOCK) + s % wp.static(BLOCK)
            for b in range(wp.static(BLOCK)):
                j = bj * wp.static(BLOCK) + b
                mass = grid.mass[i, j]
                if mass > F(0.0):
                    old = grid.velocity[i, j] / mass
                    new = free_velocity(grid, parameters, i, j, time_step)
                    if LIQUID_ALONE:
                        if TWO_PHASE:
                            grid.liquid_alone[i, j] = V2(new[2], new[3])
                        else:
                            grid.liquid_alone[i, j] = new + grid.liquid_alone[i, j] / mass
                    if TWO_PHASE:
                        coefficient = F(1.0)
                        if POROSITY:
                            coefficient = grid.drag[i, j] / mass
                        new = dragged(new, coefficient, parameters, time_step)
                    grid.velocity[i, j] = new
                    if FLIP:
                        grid.increment[i, j] = new - old

    return SimpleNamespace(move=move)
