"""Contact of the flow with solid bodies, for both phases.

A body acts on single nodes or on mirrored pairs of nodes, where it sees the mean of both, which is the velocity at the
surface itself; which nodes, with which normal and for which surface, is decided in `simulator.bodies.nodes` alone.
Where the mixture approaches, both phases take the surface's normal velocity: nothing flows in or out. Where it leaves,
it is free. Coulomb friction acts on the solid, whose normal force is the total one less what the liquid's pressure
carries, and drag passes it on to the liquid. Reactions follow from the momentum change of both phases, Eq. (A14).
"""

from types import SimpleNamespace
from typing import Any

import warp as wp

from .layout import TIME_STEP


def make_contact(types: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build the kernels `press` (over groups of places of contact), and `collect` and `push` (over places) where some
    body slides, and the functions `respond` and `impulse` for its equation of motion."""
    effects = types.effects
    F = types.scalar
    V2 = types.V2
    V = types.V
    Grid = types.Grid
    Parameters = types.Parameters
    Contact = types.Contact
    Bodies = types.Bodies
    MOVING = effects.moving
    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    receive = types.scheme.receive
    FRICTION = effects.friction
    CARRIED = FRICTION and LIQUID
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
        """Change of the phases' velocities at the surface. `mass` is the solid's, or the mixture's where
        both phases move as one; `liquid_free` serves only to find the effective normal force."""
        target = wp.dot(surface_velocity, normal)
        solid = V2(velocity[0], velocity[1])
        solid_normal = wp.dot(solid, normal)
        change = F(0.0)
        liquid_change = F(0.0)
        approach = target - solid_normal
        if TWO_PHASE:
            liquid_normal = velocity[2] * normal[0] + velocity[3] * normal[1]
            approach += parameters.liquid_ratio * (target - liquid_normal)
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
                normal_force = change
                if TWO_PHASE:
                    normal_force += parameters.liquid_ratio * liquid_change
                if LIQUID:
                    # What the liquid's pressure carries, where the surface holds the mixture at all.
                    carried = parameters.filling_ratio * (target - wp.dot(liquid_free, normal))
                    normal_force = wp.where(approach > F(0.0), normal_force - carried, F(0.0))
                tangent = V2(-normal[1], normal[0])
                slip = wp.dot(surface_velocity - solid, tangent)
                inertia = F(1.0)
                share = F(0.0)
                if TWO_PHASE:
                    if IMPLICIT_DRAG:
                        drag = parameters.drag_per_mass * time_step
                        share = drag / (parameters.liquid_ratio + drag)
                        inertia += parameters.liquid_ratio * share
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
                change[0] + parameters.liquid_ratio * change[2],
                change[1] + parameters.liquid_ratio * change[3],
            )
        else:
            result = V2(change[0], change[1])
        return -mass * result

    @wp.func
    def leaves(velocity: V, normal: V2, surface_velocity: V2, parameters: Parameters) -> wp.bool:
        """Whether the mixture moves away from the surface."""
        result = wp.dot(V2(velocity[0], velocity[1]) - surface_velocity, normal)
        if TWO_PHASE:
            liquid = wp.dot(V2(velocity[2], velocity[3]) - surface_velocity, normal)
            result += parameters.liquid_ratio * liquid
        return result > F(0.0)

    @wp.func
    def add(grid: Grid, i: wp.int32, j: wp.int32, change: V):
        grid.velocity[i, j] += change
        receive(grid, i, j, change)

    @wp.func
    def record(reactions: wp.array(dtype=wp.float64), surface: wp.int32, force: V2):
        wp.atomic_add(reactions, 2 * surface, wp.float64(force[0]))
        wp.atomic_add(reactions, 2 * surface + 1, wp.float64(force[1]))

    @wp.kernel(module=module)
    def press(
        contact: Contact,
        bodies: Bodies,
        grid: Grid,
        parameters: Parameters,
        clock: wp.array(dtype=wp.float64),
        reactions: wp.array(dtype=wp.float64),
    ):
        """A body whose velocity is known acts on the flow."""
        group = wp.tid()
        block = contact.block[group]
        used = wp.bool(True)
        if block >= 0:
            bi = block / parameters.block_rows
            used = grid.block[bi, block - bi * parameters.block_rows] != 0
        if used:
            time_step = F(clock[wp.static(TIME_STEP)])
            moving = V2()
            if MOVING:
                v = bodies.velocity[contact.body]
                moving = V2(F(v[0]), F(v[1]))
            for e in range(contact.start[group], contact.start[group + 1]):
                surface = contact.surface[e]
                node = contact.node[e]
                mass = F(0.0)
                if surface >= 0:
                    mass = grid.mass[node[0], node[1]]
                if mass > F(0.0):
                    normal = contact.normal[e]
                    mirror = contact.mirror[e]
                    friction = F(0.0)
                    if FRICTION:
                        friction = bodies.friction[surface]
                    velocity = grid.velocity[node[0], node[1]]
                    liquid_free = V2()
                    if CARRIED:
                        liquid_free = grid.liquid_alone[node[0], node[1]]
                    other = F(0.0)
                    if mirror[0] >= 0:
                        other = grid.mass[mirror[0], mirror[1]]
                    if other > F(0.0):
                        mean = F(0.5) * (velocity + grid.velocity[mirror[0], mirror[1]])
                        # Where the surface is left but the node behind it is not, it acts alone on what lies behind.
                        if leaves(velocity, normal, moving, parameters) or not leaves(mean, normal, moving, parameters):
                            velocity = mean
                            if CARRIED:
                                liquid_free = F(0.5) * (liquid_free + grid.liquid_alone[mirror[0], mirror[1]])
                        else:
                            other = F(0.0)
                    both = mass
                    if other > F(0.0):
                        both = F(4.0) * mass * other / (mass + other)
                    change = respond(both, velocity, liquid_free, normal, friction, moving, parameters, time_step)
                    if other > F(0.0):
                        add(grid, node[0], node[1], change * (F(0.5) * both / mass))
                        add(grid, mirror[0], mirror[1], change * (F(0.5) * both / other))
                    else:
                        add(grid, node[0], node[1], change)
                    record(reactions, surface, impulse(both, change, parameters))

    kernels: dict[str, Any] = {"press": press}

    if effects.sliding:

        @wp.kernel(module=module)
        def collect(contact: Contact, bodies: Bodies, grid: Grid, parameters: Parameters):
            """What a sliding body's surface sees of the flow: inertia (zero: nothing there) and velocities."""
            e = wp.tid()
            node = contact.node[e]
            mirror = contact.mirror[e]
            mass = F(0.0)
            if contact.surface[e] >= 0:
                mass = grid.mass[node[0], node[1]]
            if mass > F(0.0):
                velocity = grid.velocity[node[0], node[1]]
                liquid_free = V2()
                if CARRIED:
                    liquid_free = grid.liquid_alone[node[0], node[1]]
                pair = wp.int32(0)
                if mirror[0] >= 0:
                    other = grid.mass[mirror[0], mirror[1]]
                    if other > F(0.0):
                        v = bodies.velocity[contact.body]
                        moving = V2(F(v[0]), F(v[1]))
                        normal = contact.normal[e]
                        mean = F(0.5) * (velocity + grid.velocity[mirror[0], mirror[1]])
                        if leaves(velocity, normal, moving, parameters) or not leaves(mean, normal, moving, parameters):
                            pair = wp.int32(1)
                            mass = F(4.0) * mass * other / (mass + other)
                            velocity = mean
                            if CARRIED:
                                liquid_free = F(0.5) * (liquid_free + grid.liquid_alone[mirror[0], mirror[1]])
                contact.pair[e] = pair
                contact.velocity[e] = velocity
                if CARRIED:
                    if e < contact.liquid_free.shape[0]:
                        contact.liquid_free[e] = liquid_free
            contact.mass[e] = mass

        @wp.kernel(module=module)
        def push(
            contact: Contact,
            bodies: Bodies,
            grid: Grid,
            parameters: Parameters,
            clock: wp.array(dtype=wp.float64),
            reactions: wp.array(dtype=wp.float64),
        ):
            """A sliding body acts on the flow, as its equation of motion has found."""
            e = wp.tid()
            mass = contact.mass[e]
            if mass > F(0.0):
                time_step = F(clock[wp.static(TIME_STEP)])
                node = contact.node[e]
                mirror = contact.mirror[e]
                surface = contact.surface[e]
                v = bodies.velocity[contact.body]
                friction = F(0.0)
                if FRICTION:
                    friction = bodies.friction[surface]
                liquid_free = V2()
                if CARRIED:
                    if e < contact.liquid_free.shape[0]:
                        liquid_free = contact.liquid_free[e]
                change = respond(
                    mass,
                    contact.velocity[e],
                    liquid_free,
                    contact.normal[e],
                    friction,
                    V2(F(v[0]), F(v[1])),
                    parameters,
                    time_step,
                )
                if contact.pair[e] == 1:
                    add(grid, node[0], node[1], change * (F(0.5) * mass / grid.mass[node[0], node[1]]))
                    add(grid, mirror[0], mirror[1], change * (F(0.5) * mass / grid.mass[mirror[0], mirror[1]]))
                else:
                    add(grid, node[0], node[1], change)
                record(reactions, surface, impulse(mass, change, parameters))

        kernels["collect"] = collect
        kernels["push"] = push

    return SimpleNamespace(kernels=kernels, respond=respond, impulse=impulse)
