"""Contact of the flow with the ground, with side walls and with the barrier, for both phases.

A surface acts on single nodes (inclined faces: the nodes inside the solid and within half a cell of it) or on mirrored
pairs of nodes (surfaces along the grid), where it sees the mean of both, which is the velocity at the surface itself.
Where the mixture approaches, both phases take the surface's normal velocity: nothing flows in or out. Where it leaves,
it is free. Coulomb friction acts on the solid, whose normal force is the total one less what the liquid's pressure
carries, and drag passes it on to the liquid. Reactions follow from the momentum change of both phases, Eq. (A14).
"""

from types import SimpleNamespace
from typing import Any

import warp as wp

from .layout import (
    BARRIER_VELOCITY,
    BLOCK,
    CEILING,
    GRID_SHIFT,
    GROUND,
    LEFT_WALL,
    RIGHT_WALL,
    TIME_STEP,
)


def make_contact(types: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build those of the kernels `ground` (workers on the blocks in use), `side_walls` (over rows), `ceiling` (over
    columns), `collect` and `barrier` (over
    contacts) that are called for, and the functions `respond` and `impulse` for the barrier's equation of motion."""
    effects = types.effects
    F = types.scalar
    V2 = types.V2
    V = types.V
    Grid = types.Grid
    Parameters = types.Parameters
    Contact = types.Contact
    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    FLIP = effects.transfer == "flip"
    FRICTION = effects.friction
    BARRIER_FRICTION = effects.barrier_friction
    GROUND_FRICTION = effects.ground == "frictional"
    BARRIER_CARRIED = effects.barrier_friction and LIQUID
    GROUND_CARRIED = effects.ground == "frictional" and LIQUID
    IMPLICIT_DRAG = effects.drag == "semi_implicit"

    @wp.func
    def respond(
        mass: F,
        velocity: V,
        liquid_free: V2,
        normal: V2,
        friction: F,
        surface_velocity: V2,
        parameters: Parameters,
        time_step: F,
    ) -> V:
        """Change of the phases' velocities at the surface. `mass` is a volume: each phase's mass is its density times
        that; `liquid_free` serves only to find the effective normal force."""
        target = wp.dot(surface_velocity, normal)
        solid = V2(velocity[0], velocity[1])
        solid_normal = wp.dot(solid, normal)
        change = F(0.0)
        liquid_change = F(0.0)
        approach = parameters.solid_density * (target - solid_normal)
        if TWO_PHASE:
            liquid_normal = velocity[2] * normal[0] + velocity[3] * normal[1]
            approach += parameters.liquid_density * (target - liquid_normal)
            change = target - solid_normal
            liquid_change = target - liquid_normal
            if approach <= F(0.0):
                change = wp.max(change, F(0.0))
                liquid_change = wp.max(liquid_change, F(0.0))
        else:
            change = wp.max(target - solid_normal, F(0.0))
        result = V()
        if TWO_PHASE:
            result = V(change * normal[0], change * normal[1], liquid_change * normal[0], liquid_change * normal[1])
        else:
            result = change * normal
        if FRICTION:
            if friction > F(0.0):
                # Per unit of `mass`, like all below.
                normal_force = parameters.solid_density * change
                if TWO_PHASE:
                    normal_force += parameters.liquid_density * liquid_change
                if LIQUID:
                    # What the liquid's pressure carries, where the surface holds the mixture at all.
                    carried = parameters.true_liquid_density * (target - wp.dot(liquid_free, normal))
                    normal_force = wp.where(approach > F(0.0), normal_force - carried, F(0.0))
                tangent = V2(-normal[1], normal[0])
                slip = wp.dot(surface_velocity - solid, tangent)
                inertia = parameters.solid_density
                share = F(0.0)
                if TWO_PHASE:
                    if IMPLICIT_DRAG:
                        drag = parameters.drag_coefficient * time_step
                        share = drag / (parameters.liquid_density + drag)
                        inertia += parameters.liquid_density * share
                limit = friction * wp.max(normal_force, F(0.0))
                stop = wp.clamp(inertia * slip, -limit, limit) / inertia
                if TWO_PHASE:
                    result += V(
                        stop * tangent[0],
                        stop * tangent[1],
                        share * stop * tangent[0],
                        share * stop * tangent[1],
                    )
                else:
                    result += stop * tangent
        return result

    @wp.func
    def impulse(mass: F, change: V, parameters: Parameters) -> V2:
        """Impulse on the surface: minus the momentum change of both phases, Eq. (A14)."""
        result = V2()
        if TWO_PHASE:
            result = V2(
                parameters.solid_density * change[0] + parameters.liquid_density * change[2],
                parameters.solid_density * change[1] + parameters.liquid_density * change[3],
            )
        else:
            result = parameters.solid_density * V2(change[0], change[1])
        return -mass * result

    @wp.func
    def leaves(velocity: V, normal: V2, surface_velocity: V2, parameters: Parameters) -> wp.bool:
        """Whether the mixture moves away from the surface."""
        result = wp.dot(V2(velocity[0], velocity[1]) - surface_velocity, normal)
        if TWO_PHASE:
            liquid = wp.dot(V2(velocity[2], velocity[3]) - surface_velocity, normal)
            result = parameters.solid_density * result + parameters.liquid_density * liquid
        return result > F(0.0)

    @wp.func
    def rub(contact: Contact, e: wp.int32) -> F:
        """Friction coefficient of a contact with the barrier; those that have one come first."""
        result = F(0.0)
        if BARRIER_FRICTION:
            if e < contact.friction.shape[0]:
                result = contact.friction[e]
        return result

    @wp.func
    def add(grid: Grid, i: wp.int32, j: wp.int32, change: V):
        grid.velocity[i, j] += change
        if FLIP:
            grid.increment[i, j] += change

    @wp.func
    def record(reactions: wp.array(dtype=wp.float64), surface: wp.int32, force: V2):
        wp.atomic_add(reactions, 2 * surface, wp.float64(force[0]))
        wp.atomic_add(reactions, 2 * surface + 1, wp.float64(force[1]))

    @wp.func
    def fixed_surface(
        grid: Grid,
        parameters: Parameters,
        i: wp.int32,
        j: wp.int32,
        mi: wp.int32,
        mj: wp.int32,
        normal: V2,
        friction: F,
        time_step: F,
        surface: wp.int32,
        reactions: wp.array(dtype=wp.float64),
    ):
        """A surface at rest between node (i, j) behind it and its mirror image (mi, mj); (i, j) again: no mirror."""
        mass = grid.mass[i, j]
        if mass > F(0.0):
            velocity = grid.velocity[i, j]
            liquid_free = V2()
            if GROUND_CARRIED:
                liquid_free = grid.liquid_alone[i, j]
            pair = wp.bool(False)
            if mi != i or mj != j:
                other = grid.mass[mi, mj]
                if other > F(0.0):
                    mean = F(0.5) * (velocity + grid.velocity[mi, mj])
                    # Where the surface is left but the node behind it is not, it acts alone on what lies behind.
                    if leaves(velocity, normal, V2(), parameters) or not leaves(mean, normal, V2(), parameters):
                        pair = wp.bool(True)
                        both = F(4.0) * mass * other / (mass + other)
                        if GROUND_CARRIED:
                            liquid_free = F(0.5) * (liquid_free + grid.liquid_alone[mi, mj])
                        change = respond(both, mean, liquid_free, normal, friction, V2(), parameters, time_step)
                        add(grid, i, j, change * (F(0.5) * both / mass))
                        add(grid, mi, mj, change * (F(0.5) * both / other))
                        record(reactions, surface, impulse(both, change, parameters))
            if not pair:
                change = respond(mass, velocity, liquid_free, normal, friction, V2(), parameters, time_step)
                add(grid, i, j, change)
                record(reactions, surface, impulse(mass, change, parameters))

    kernels: dict[str, Any] = {}

    if effects.ground != "none":

        @wp.kernel(module=module)
        def ground(
            grid: Grid, parameters: Parameters, clock: wp.array(dtype=wp.float64), reactions: wp.array(dtype=wp.float64)
        ):
            worker = wp.tid()
            time_step = F(clock[wp.static(TIME_STEP)])
            row = parameters.ground_row
            up = V2(F(0.0), F(1.0))
            friction = F(0.0)
            if GROUND_FRICTION:
                friction = parameters.ground_friction
            # The three rows that the ground concerns lie in one row of blocks.
            for s in range(worker, grid.active_count[0], parameters.workers):
                block = grid.active[s]
                bi = block / parameters.block_rows
                if block == bi * parameters.block_rows + row / wp.static(BLOCK):
                    for a in range(wp.static(BLOCK)):
                        i = bi * wp.static(BLOCK) + a
                        fixed_surface(
                            grid, parameters, i, row - 1, i, row, up, friction, time_step, wp.static(GROUND), reactions
                        )
                        fixed_surface(
                            grid,
                            parameters,
                            i,
                            row - 2,
                            i,
                            row - 2,
                            up,
                            friction,
                            time_step,
                            wp.static(GROUND),
                            reactions,
                        )

        kernels["ground"] = ground

    if effects.side_walls:

        @wp.kernel(module=module)
        def side_walls(
            grid: Grid, parameters: Parameters, clock: wp.array(dtype=wp.float64), reactions: wp.array(dtype=wp.float64)
        ):
            """Smooth walls at rest. Seen from a grid that rides with a barrier they move, so each acts at the line of
            cell corners nearest to it."""
            j = wp.tid()
            time_step = F(clock[wp.static(TIME_STEP)])
            origin = parameters.left + F(clock[wp.static(GRID_SHIFT)])
            none = F(0.0)
            c = wp.int32(
                wp.clamp((parameters.left_wall - origin) * parameters.inverse_spacing + F(0.5), none, F(2.0e9))
            )
            if c >= 2 and c < parameters.columns:
                right = V2(F(1.0), F(0.0))
                fixed_surface(grid, parameters, c - 1, j, c, j, right, none, time_step, wp.static(LEFT_WALL), reactions)
                fixed_surface(
                    grid, parameters, c - 2, j, c - 2, j, right, none, time_step, wp.static(LEFT_WALL), reactions
                )
            c = wp.int32(
                wp.clamp((parameters.right_wall - origin) * parameters.inverse_spacing + F(0.5), none, F(2.0e9))
            )
            if c >= 1 and c < parameters.columns - 1:
                left = V2(F(-1.0), F(0.0))
                fixed_surface(grid, parameters, c, j, c - 1, j, left, none, time_step, wp.static(RIGHT_WALL), reactions)
                fixed_surface(
                    grid, parameters, c + 1, j, c + 1, j, left, none, time_step, wp.static(RIGHT_WALL), reactions
                )

        kernels["side_walls"] = side_walls

    if effects.ceiling:

        @wp.kernel(module=module)
        def ceiling(
            grid: Grid, parameters: Parameters, clock: wp.array(dtype=wp.float64), reactions: wp.array(dtype=wp.float64)
        ):
            """Smooth wall above, on the line of cell corners nearest to it."""
            i = wp.tid()
            time_step = F(clock[wp.static(TIME_STEP)])
            row = parameters.ceiling_row
            down = V2(F(0.0), F(-1.0))
            none = F(0.0)
            fixed_surface(grid, parameters, i, row + 1, i, row, down, none, time_step, wp.static(CEILING), reactions)
            fixed_surface(
                grid, parameters, i, row + 2, i, row + 2, down, none, time_step, wp.static(CEILING), reactions
            )

        kernels["ceiling"] = ceiling

    if effects.barrier != "none":

        @wp.kernel(module=module)
        def collect(contact: Contact, grid: Grid, parameters: Parameters, clock: wp.array(dtype=wp.float64)):
            """What the barrier's surface sees of the flow: inertia (zero: nothing there) and velocities."""
            e = wp.tid()
            node = contact.node[e]
            mirror = contact.mirror[e]
            mass = grid.mass[node[0], node[1]]
            if mass > F(0.0):
                velocity = grid.velocity[node[0], node[1]]
                liquid_free = V2()
                if BARRIER_CARRIED:
                    liquid_free = grid.liquid_alone[node[0], node[1]]
                pair = wp.int32(0)
                if mirror[0] >= 0:
                    other = grid.mass[mirror[0], mirror[1]]
                    if other > F(0.0):
                        moving = V2(F(clock[wp.static(BARRIER_VELOCITY)]), F(0.0))
                        normal = contact.normal[e]
                        mean = F(0.5) * (velocity + grid.velocity[mirror[0], mirror[1]])
                        if leaves(velocity, normal, moving, parameters) or not leaves(mean, normal, moving, parameters):
                            pair = wp.int32(1)
                            mass = F(4.0) * mass * other / (mass + other)
                            velocity = mean
                            if BARRIER_CARRIED:
                                liquid_free = F(0.5) * (liquid_free + grid.liquid_alone[mirror[0], mirror[1]])
                contact.pair[e] = pair
                contact.velocity[e] = velocity
                if BARRIER_CARRIED:
                    if e < contact.liquid_free.shape[0]:
                        contact.liquid_free[e] = liquid_free
            contact.mass[e] = mass

        @wp.kernel(module=module)
        def barrier(
            contact: Contact,
            grid: Grid,
            parameters: Parameters,
            clock: wp.array(dtype=wp.float64),
            reactions: wp.array(dtype=wp.float64),
        ):
            e = wp.tid()
            mass = contact.mass[e]
            if mass > F(0.0):
                time_step = F(clock[wp.static(TIME_STEP)])
                surface_velocity = V2(F(clock[wp.static(BARRIER_VELOCITY)]), F(0.0))
                node = contact.node[e]
                mirror = contact.mirror[e]
                liquid_free = V2()
                if BARRIER_CARRIED:
                    if e < contact.liquid_free.shape[0]:
                        liquid_free = contact.liquid_free[e]
                change = respond(
                    mass,
                    contact.velocity[e],
                    liquid_free,
                    contact.normal[e],
                    rub(contact, e),
                    surface_velocity,
                    parameters,
                    time_step,
                )
                if contact.pair[e] == 1:
                    add(grid, node[0], node[1], change * (F(0.5) * mass / grid.mass[node[0], node[1]]))
                    add(grid, mirror[0], mirror[1], change * (F(0.5) * mass / grid.mass[mirror[0], mirror[1]]))
                else:
                    add(grid, node[0], node[1], change)
                record(reactions, contact.surface[e], impulse(mass, change, parameters))

        kernels["collect"] = collect
        kernels["barrier"] = barrier

    return SimpleNamespace(kernels=kernels, respond=respond, impulse=impulse, rub=rub)
