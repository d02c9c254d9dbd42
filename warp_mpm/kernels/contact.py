"""Contact of the flow with solid bodies, for both phases, and the velocity of bodies that slide.

At a place of contact b (`simulator.bodies.places`) with weights N_i and normal n the flow has the velocity
u = sum N_i v_i of each phase. The surface's impulse per phase, lambda >= 0, changes the nodes' velocities by
lambda N_i n / m_i; it is such that u · n is the surface's own, or greater where lambda = 0. Coulomb friction acts on
the solid; its normal force is what both phases give less what the liquid's pressure carries, and that is the impulse of
the same surface on liquid which fills the whole volume and moves as it would alone. Drag passes friction on to the
liquid.

Impulses of places that share nodes, and velocities of bodies that slide, depend on each other. They are found by
projected Gauss-Seidel sweeps, starting from those of the step before.
"""

from types import SimpleNamespace
from typing import Any

import warp as wp

from .elementary import make_elementary
from .layout import BARRIER_ITERATIONS, TIME_STEP

SWEEPS = 4
"""Sweeps of a step."""
REACHED = 0.75


def make_contact(types: SimpleNamespace, shapes: SimpleNamespace, bodies_of: Any, module: str) -> SimpleNamespace:
    """Build the kernels `press` (over groups of places that stand alone) and `join` (one thread, over all others)."""
    effects = types.effects
    F = types.scalar
    V2 = types.V2
    V3 = types.V3
    V = types.V
    Grid = types.Grid
    Parameters = types.Parameters
    Contact = types.Contact
    Bodies = types.Bodies
    MOVING = effects.moving
    SLIDING = effects.sliding
    TWO_PHASE = effects.two_phase
    LIQUID = effects.liquid
    receive = types.scheme.receive
    FRICTION = effects.friction
    CARRIED = FRICTION and LIQUID
    IMPLICIT_DRAG = effects.drag == "semi_implicit"
    elementary = make_elementary(types)
    read = elementary.read
    write = elementary.write
    weights, cell_of = shapes.weights, shapes.cell_of
    displaced, look_ahead = bodies_of.displaced, bodies_of.look_ahead

    @wp.func
    def inverse_mass(contact: Contact, e: wp.int32, grid: Grid, parameters: Parameters) -> F:
        """sum N_i^2 / m_i of the solid, with weights that add up to one over the nodes that have mass; 0 where the flow
        is not at the surface: too few of the nodes have any."""
        first = contact.first[e]
        wx = contact.weight_x[e]
        wy = contact.weight_y[e]
        result = F(0.0)
        total = F(0.0)
        for k in range(3):
            for m in range(3):
                w = wx[k] * wy[m]
                if w > F(0.0):
                    mass = read(grid.mass, first + k * parameters.rows + m)
                    if mass > F(0.0):
                        result += w * w / mass
                        total += w
        if total < F(wp.static(REACHED)):
            result = F(0.0)
        elif contact.fixed[e] == 0:
            contact.weight_x[e] = wx / total
            result = result / (total * total)
        return result

    @wp.func
    def seen(contact: Contact, e: wp.int32, grid: Grid, parameters: Parameters) -> V:
        """Velocities of the flow at the place."""
        first = contact.first[e]
        wx = contact.weight_x[e]
        wy = contact.weight_y[e]
        result = V()
        for k in range(3):
            for m in range(3):
                result += (wx[k] * wy[m]) * read(grid.velocity, first + k * parameters.rows + m)
        return result

    @wp.func
    def seen_alone(contact: Contact, e: wp.int32, grid: Grid, parameters: Parameters) -> V2:
        """Velocity of the liquid alone at the place."""
        first = contact.first[e]
        wx = contact.weight_x[e]
        wy = contact.weight_y[e]
        result = V2()
        for k in range(3):
            for m in range(3):
                result += (wx[k] * wy[m]) * read(grid.liquid_alone, first + k * parameters.rows + m)
        return result

    @wp.func
    def give(contact: Contact, e: wp.int32, impulse: V, grid: Grid, parameters: Parameters):
        """Impulses per phase, over the share of the solid's mass that each has, to the nodes."""
        first = contact.first[e]
        wx = contact.weight_x[e]
        wy = contact.weight_y[e]
        for k in range(3):
            for m in range(3):
                w = wx[k] * wy[m]
                if w > F(0.0):
                    node = first + k * parameters.rows + m
                    mass = read(grid.mass, node)
                    if mass > F(0.0):
                        write(grid.velocity, node, read(grid.velocity, node) + (w / mass) * impulse)

    @wp.func
    def give_scheme(contact: Contact, e: wp.int32, impulse: V, grid: Grid, parameters: Parameters):
        """The same to what the transfer scheme keeps."""
        first = contact.first[e]
        wx = contact.weight_x[e]
        wy = contact.weight_y[e]
        for k in range(3):
            for m in range(3):
                w = wx[k] * wy[m]
                if w > F(0.0):
                    node = first + k * parameters.rows + m
                    mass = read(grid.mass, node)
                    if mass > F(0.0):
                        i = node / parameters.rows
                        receive(grid, i, node - i * parameters.rows, (w / mass) * impulse)

    @wp.func
    def give_alone(contact: Contact, e: wp.int32, impulse: V2, grid: Grid, parameters: Parameters):
        first = contact.first[e]
        wx = contact.weight_x[e]
        wy = contact.weight_y[e]
        for k in range(3):
            for m in range(3):
                w = wx[k] * wy[m]
                if w > F(0.0):
                    node = first + k * parameters.rows + m
                    mass = read(grid.mass, node)
                    if mass > F(0.0):
                        write(grid.liquid_alone, node, read(grid.liquid_alone, node) + (w / mass) * impulse)

    @wp.func
    def drag_share(parameters: Parameters, time_step: F) -> F:
        """Share of the solid's change of velocity that drag passes on to the liquid within the step."""
        share = F(0.0)
        if TWO_PHASE:
            if IMPLICIT_DRAG:
                drag = parameters.drag_per_mass * time_step
                share = drag / (parameters.liquid_ratio + drag)
        return share

    @wp.func
    def whole(contact: Contact, e: wp.int32, parameters: Parameters, time_step: F) -> V:
        """All that the place has given in the step, in the form that `give` takes."""
        n = contact.normal[e]
        t = V2(-n[1], n[0])
        solid = contact.solid[e] * n
        result = V()
        if TWO_PHASE:
            liquid = (contact.liquid[e] / parameters.liquid_ratio) * n
            if FRICTION:
                share = drag_share(parameters, time_step)
                rub = contact.rubbed[e] / (F(1.0) + parameters.liquid_ratio * share)
                solid += rub * t
                liquid += (share * rub) * t
            result = V(solid[0], solid[1], liquid[0], liquid[1])
        else:
            if FRICTION:
                solid += contact.rubbed[e] * t
            result = V(solid[0], solid[1])
        return result

    @wp.func
    def on_body(contact: Contact, e: wp.int32) -> V2:
        """Impulse of the flow on the surface, Eq. (A14)."""
        n = contact.normal[e]
        total = contact.solid[e]
        if TWO_PHASE:
            total += contact.liquid[e]
        result = -total * n
        if FRICTION:
            result -= contact.rubbed[e] * V2(-n[1], n[0])
        return result

    @wp.func
    def react(bodies: Bodies, body: wp.int32, impulse: V2):
        """A body that slides takes an impulse of the flow along x."""
        if SLIDING:
            mass = bodies.mass[body]
            if mass > wp.float64(0.0):
                v = bodies.velocity[body]
                bodies.velocity[body] = wp.vec2d(v[0] + wp.float64(impulse[0]) / mass, v[1])
                bodies.pressed[body] = bodies.pressed[body] + wp.float64(impulse[1])

    @wp.func
    def effective(contact: Contact, e: wp.int32) -> F:
        """Normal impulse less what the liquid's pressure carries."""
        result = contact.solid[e]
        if TWO_PHASE:
            result += contact.liquid[e]
        if CARRIED:
            result -= contact.alone[e]
        return result

    @wp.func
    def relax(
        contact: Contact, e: wp.int32, bodies: Bodies, grid: Grid, parameters: Parameters, time_step: F
    ) -> F:
        """Bring one place's impulses to what the velocities there now call for; returns by how much the flow's velocity
        there changes along the normal."""
        inverse = contact.inverse[e]
        n = contact.normal[e]
        t = V2(-n[1], n[0])
        body = contact.body[e]
        surface = V2()
        give_way = F(0.0)
        give_way_along = F(0.0)
        if MOVING:
            v = bodies.velocity[body]
            surface = V2(F(v[0]), F(v[1]))
            if SLIDING:
                if bodies.mass[body] > wp.float64(0.0):
                    inverse_body = F(wp.float64(1.0) / bodies.mass[body])
                    give_way = inverse_body * n[0] * n[0]
                    give_way_along = inverse_body * t[0] * t[0]
        velocity = seen(contact, e, grid, parameters)
        solid_velocity = V2(velocity[0], velocity[1]) - surface
        old = contact.solid[e]
        new = wp.max(old - wp.dot(solid_velocity, n) / (inverse + give_way), F(0.0))
        contact.solid[e] = new
        change = new - old
        given = change * n
        push = -change * n
        change_alone = F(0.0)
        liquid_given = V2()
        if TWO_PHASE:
            liquid_velocity = V2(velocity[2], velocity[3]) - surface
            if SLIDING:
                liquid_velocity += (give_way * change) * n
            liquid_inverse = inverse / parameters.liquid_ratio
            old_liquid = contact.liquid[e]
            new_liquid = wp.max(old_liquid - wp.dot(liquid_velocity, n) / (liquid_inverse + give_way), F(0.0))
            contact.liquid[e] = new_liquid
            liquid_change = new_liquid - old_liquid
            push -= liquid_change * n
            liquid_given = (liquid_change / parameters.liquid_ratio) * n
        if FRICTION:
            friction = bodies.friction[contact.surface[e]]
            if friction > F(0.0):
                if CARRIED:
                    alone = seen_alone(contact, e, grid, parameters) - surface
                    alone_inverse = inverse / parameters.filling_ratio
                    old_alone = contact.alone[e]
                    new_alone = wp.max(old_alone - wp.dot(alone, n) / alone_inverse, F(0.0))
                    contact.alone[e] = new_alone
                    change_alone = (new_alone - old_alone) / parameters.filling_ratio
                normal_force = F(0.5) * effective(contact, e) + F(0.25) * (
                    effective(contact, contact.before[e]) + effective(contact, contact.after[e])
                )
                limit = friction * wp.max(normal_force, F(0.0))
                inertia = F(1.0)
                share = drag_share(parameters, time_step)
                if TWO_PHASE:
                    inertia += parameters.liquid_ratio * share
                slip = wp.dot(solid_velocity, t)
                old_rub = contact.rubbed[e]
                new_rub = wp.clamp(old_rub - slip / (inverse / inertia + give_way_along), -limit, limit)
                contact.rubbed[e] = new_rub
                rub = new_rub - old_rub
                push -= rub * t
                given += (rub / inertia) * t
                if TWO_PHASE:
                    liquid_given += (share * rub / inertia) * t
        if TWO_PHASE:
            give(contact, e, V(given[0], given[1], liquid_given[0], liquid_given[1]), grid, parameters)
        else:
            give(contact, e, V(given[0], given[1]), grid, parameters)
        if CARRIED:
            if change_alone != F(0.0):
                give_alone(contact, e, change_alone * n, grid, parameters)
        react(bodies, body, push)
        return wp.abs(change) * inverse

    @wp.func
    def forget(contact: Contact, e: wp.int32):
        contact.solid[e] = F(0.0)
        if TWO_PHASE:
            contact.liquid[e] = F(0.0)
        if CARRIED:
            contact.alone[e] = F(0.0)
        if FRICTION:
            contact.rubbed[e] = F(0.0)

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
        give_scheme(contact, e, whole(contact, e, parameters, time_step), grid, parameters)
        force = on_body(contact, e)
        surface = contact.surface[e]
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
        """Places that share no node with another, of bodies whose velocity is known."""
        group = wp.tid()
        block = contact.block[group]
        bi = block / parameters.block_rows
        if grid.block[bi, block - bi * parameters.block_rows] != 0:
            time_step = F(clock[wp.static(TIME_STEP)])
            for e in range(contact.start[group], contact.start[group + 1]):
                inverse = inverse_mass(contact, e, grid, parameters)
                if inverse > F(0.0):
                    contact.inverse[e] = inverse
                    forget(contact, e)
                    change = relax(contact, e, bodies, grid, parameters, time_step)
                    finish(contact, e, grid, parameters, time_step, reactions)

    @wp.kernel(module=module)
    def join(
        contact: Contact,
        bodies: Bodies,
        grid: Grid,
        parameters: Parameters,
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=wp.int32),
        reactions: wp.array(dtype=wp.float64),
    ):
        """Places that share nodes, together, and with them the bodies that slide."""
        zero = wp.float64(0.0)
        dt = clock[wp.static(TIME_STEP)]
        time_step = F(dt)
        again = F(0.0)
        if contact.last[0] > zero:
            again = F(dt / contact.last[0])
        contact.last[0] = dt
        if SLIDING:
            for body in range(bodies.count):
                mass = bodies.mass[body]
                if mass > zero:
                    external = (bodies.external_force[body] + bodies.pull[body]) * dt
                    held = bodies.held[body] * wp.float64(again)
                    bodies.held[body] = held
                    free = bodies.velocity[body][0] + (external + held) / mass
                    bodies.velocity[body] = wp.vec2d(free, zero)
                    bodies.pressed[body] = zero
        active = wp.int32(0)
        for e in range(contact.alone_count, contact.first.shape[0]):
            if contact.fixed[e] == 0:
                at = contact.position[e]
                if MOVING:
                    at += displaced(bodies, contact.body[e])
                i, j, fx, fy = cell_of(at, F(grid.shift[0]), parameters)
                if i < 1 or j < 1 or i >= parameters.columns - 1 or j >= parameters.rows - 1:
                    contact.first[e] = wp.int32(-1)
                else:
                    contact.first[e] = (i - 1) * parameters.rows + j - 1
                    contact.weight_x[e] = weights(fx)
                    contact.weight_y[e] = weights(fy)
            inverse = F(0.0)
            if contact.first[e] >= 0:
                inverse = inverse_mass(contact, e, grid, parameters)
            contact.inverse[e] = inverse
            if inverse > F(0.0):
                contact.active[active] = e
                active += 1
                contact.solid[e] = again * contact.solid[e]
                if TWO_PHASE:
                    contact.liquid[e] = again * contact.liquid[e]
                if FRICTION:
                    contact.rubbed[e] = again * contact.rubbed[e]
                if CARRIED:
                    contact.alone[e] = again * contact.alone[e]
                    if contact.alone[e] > F(0.0):
                        give_alone(
                            contact, e, (contact.alone[e] / parameters.filling_ratio) * contact.normal[e], grid, parameters
                        )
                give(contact, e, whole(contact, e, parameters, time_step), grid, parameters)
                react(bodies, contact.body[e], on_body(contact, e))
            else:
                forget(contact, e)
        sweep = wp.int32(0)
        while sweep < wp.static(SWEEPS):
            for k in range(active):
                e = contact.active[wp.where(sweep % 2 == 0, k, active - 1 - k)]
                change = relax(contact, e, bodies, grid, parameters, time_step)
            if SLIDING:
                for body in range(bodies.count):
                    mass = bodies.mass[body]
                    if mass > zero:
                        slip = bodies.velocity[body][0]
                        held_before = bodies.held[body]
                        wanted = held_before - slip * mass
                        most = bodies.base_friction[body] * wp.max(bodies.weight[body] * dt - bodies.pressed[body], zero)
                        held_now = wp.clamp(wanted, -most, most)
                        bodies.held[body] = held_now
                        after = slip + (held_now - held_before) / mass
                        if wp.abs(wanted) <= most:
                            after = zero
                        bodies.velocity[body] = wp.vec2d(after, zero)
            sweep += 1
        for k in range(active):
            finish(contact, contact.active[k], grid, parameters, time_step, reactions)
        if SLIDING:
            for body in range(bodies.count):
                if bodies.mass[body] > zero:
                    middle = wp.float64(0.5) * (bodies.velocity[body][0] + bodies.old_velocity[body][0])
                    bodies.base_impulse[body] = bodies.base_impulse[body] + bodies.held[body]
                    bodies.base_work[body] = bodies.base_work[body] - bodies.held[body] * middle
                    look_ahead(bodies, grid, body, F(-0.5) * parameters.spacing, time_step)

    return SimpleNamespace(press=press, join=join)
