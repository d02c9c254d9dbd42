"""Equations of motion at the nodes, with the drag between the phases."""

from types import SimpleNamespace

import warp as wp

from .layout import BLOCK, TIME_STEP
from .told import make_told


def make_grid_momentum(types: SimpleNamespace, vectors: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build the kernel `move` (workers on the blocks in use)."""
    effects = types.effects
    F = types.scalar
    V = types.V
    Grid = types.Grid
    Parameters = types.Parameters
    Book = types.Book
    TWO_PHASE = effects.two_phase
    IMPLICIT_DRAG = effects.drag == "semi_implicit"
    INERTIAL_DRAG = effects.inertial_drag
    MATERIALS = "liquid" in types.told
    told_of = make_told(types)
    ratio_of_liquid, drag_per_mass = told_of.ratio_of_liquid, told_of.drag_per_mass
    drag_beyond_per_mass, ratio_of_filling = told_of.drag_beyond_per_mass, told_of.ratio_of_filling
    UNLIKE, GAIN = "pore_impulse" in types.grid_fields, "filling_gain" in types.grid_fields
    POROSITY = effects.porosity_update
    BEYOND = "drag_beyond" in types.grid_fields
    free_velocity, keep = types.scheme.free_velocity, types.scheme.keep
    LIQUID_ALONE = effects.liquid_alone
    per_phase, of_phases = vectors.per_phase, vectors.of_phases
    solid_of, liquid_of = vectors.solid_of, vectors.liquid_of

    @wp.func
    def per_mass(mass: F, parameters: Parameters) -> V:
        """One over the mass of the phase that each entry of a node's velocity belongs to."""
        solid = F(1.0) / mass
        liquid = F(0.0)
        if TWO_PHASE:
            liquid = solid / parameters.liquid_ratio
        return per_phase(solid, liquid)

    @wp.func
    def per_masses(mass: F, ratio: F) -> V:
        """The same with the liquid's mass over the solid's; 0 for a liquid that is not there."""
        return per_phase(F(1.0) / mass, wp.where(ratio > F(0.0), F(1.0) / (ratio * mass), F(0.0)))

    @wp.func
    def dragged(free: V, ratio: F, rate: F, rate_beyond: F, time_step: F) -> V:
        """Exchange momentum between the phases, after their own forces. Per node and direction the two unknowns
        decouple into the mixture's velocity, which drag leaves alone, and w = v_L - v_S, which decays at the rate
        Q (1 / n_S rho_S + 1 / n rho_L): over the step by a factor of 1 / (1 + rate dt), explicitly of 1 - rate dt.
        `ratio` is the mass of the liquid over that of the solid, `rate` that of the decay [1/s].

        With drag b |w| w besides (Forchheimer), |w| at the end of the step obeys |w| (1 + (rate + b |w|) dt) = |w|
        before; `rate_beyond` is b [1/m]."""
        solid_share = F(1.0) / (F(1.0) + ratio)
        liquid_share = ratio * solid_share
        lost = rate * time_step
        slip = liquid_of(free) - solid_of(free)
        if INERTIAL_DRAG:
            growth = rate_beyond * time_step
            growth *= F(4.0) * wp.sqrt(wp.dot(slip, slip))
            linear = F(1.0) + lost
            lost += growth / (linear + wp.sqrt(linear * linear + growth)) * F(0.5)
        if IMPLICIT_DRAG:
            lost = lost / (F(1.0) + lost)
        exchange = lost * slip
        return free + of_phases(liquid_share * exchange, -solid_share * exchange)

    @wp.kernel(module=module)
    def move(grid: Grid, parameters: Parameters, book: Book):
        """From the momentum of every node in use to its velocity."""
        worker = wp.tid()
        time_step = F(book.clock[wp.static(TIME_STEP)])
        gravity = of_phases(parameters.gravity, parameters.gravity)
        for s in range(worker, grid.active_count[0] * wp.static(BLOCK), parameters.workers):
            block = grid.active[s / wp.static(BLOCK)]
            bi = block / parameters.block_rows
            bj = block - bi * parameters.block_rows
            i = bi * wp.static(BLOCK) + s % wp.static(BLOCK)
            if MATERIALS:
                telling = grid.telling[bi, bj]
            for b in range(wp.static(BLOCK)):
                j = bj * wp.static(BLOCK) + b
                mass = grid.mass[i, j]
                if mass > F(0.0):
                    if MATERIALS:
                        ratio = parameters.liquid_ratio
                        rate = parameters.drag_rate
                        rate_beyond = F(0.0)
                        if INERTIAL_DRAG:
                            rate_beyond = parameters.inertial_drag_rate
                        if telling == 1:
                            told = grid.told[i, j] / mass
                            ratio = ratio_of_liquid(told, parameters)
                            both = wp.where(ratio > F(0.0), F(1.0) + F(1.0) / ratio, F(0.0))
                            rate = drag_per_mass(told, parameters) * both
                            if INERTIAL_DRAG:
                                rate_beyond = drag_beyond_per_mass(told, parameters) * both
                        inverse = per_masses(mass, ratio)
                    else:
                        inverse = per_mass(mass, parameters)
                    old = wp.cw_mul(inverse, grid.velocity[i, j])
                    new = free_velocity(grid, i, j, inverse, gravity, time_step)
                    if UNLIKE:
                        if telling == 1 and ratio > F(0.0):
                            # The liquid has of the pressure what the node's own porosity gives it, so that where
                            # porosities meet it is at rest under hydrostatic pressure; the solid has the rest.
                            all_of_it = solid_of(grid.pore_impulse[i, j])
                            share = ratio / ratio_of_filling(told, parameters)
                            exchange = share * all_of_it - liquid_of(grid.pore_impulse[i, j])
                            new += wp.cw_mul(inverse, of_phases(-exchange, exchange))
                    if LIQUID_ALONE:
                        if TWO_PHASE:
                            grid.liquid_alone[i, j] = liquid_of(new)
                        elif GAIN:
                            fall = time_step * parameters.gravity
                            filling = ratio_of_filling(grid.told[i, j] / mass, parameters)
                            grid.filling_gain[i, j] = grid.filling_gain[i, j] / mass + filling * fall
                            # Before the step: without the mixture's forces.
                            grid.liquid_alone[i, j] = new + grid.liquid_alone[i, j] / mass - fall
                        else:
                            grid.liquid_alone[i, j] = new + grid.liquid_alone[i, j] / mass
                    if MATERIALS:
                        if ratio > F(0.0):
                            new = dragged(new, ratio, rate, rate_beyond, time_step)
                        else:
                            # What has no mass goes with the solid.
                            old = of_phases(solid_of(old), solid_of(old))
                            new = of_phases(solid_of(new), solid_of(new))
                    elif TWO_PHASE:
                        # Over the values at the start: n², and over that of the conductivity where it follows.
                        coefficient = F(1.0)
                        beyond = F(1.0)
                        if POROSITY:
                            coefficient = grid.drag[i, j] / mass
                            if INERTIAL_DRAG:
                                beyond = coefficient * wp.sqrt(coefficient)  # n³
                        if BEYOND:
                            beyond = grid.drag_beyond[i, j] / mass
                        rate = coefficient * parameters.drag_rate
                        rate_beyond = F(0.0)
                        if INERTIAL_DRAG:
                            rate_beyond = beyond * parameters.inertial_drag_rate
                        new = dragged(new, parameters.liquid_ratio, rate, rate_beyond, time_step)
                    grid.velocity[i, j] = new
                    keep(grid, i, j, old, new, time_step, parameters)

    return SimpleNamespace(move=move)
