"""Equation of motion of a body that slides on its base, solved together with the contact."""

from types import SimpleNamespace

import warp as wp

from .layout import BARRIER_ITERATIONS, BARRIER_UNCONVERGED, TIME_STEP

MAX_ITERATIONS = 120

SECANTS = 12
"""Iterations of regula falsi, after which every other one halves the bracket: in one step of thousands the flow's
impulse jumps at some velocity of the barrier, at which a node is let go; only halving closes in on that."""


def make_rigid_barrier(
    types: SimpleNamespace, contact: SimpleNamespace, bodies_of: SimpleNamespace, module: str
) -> SimpleNamespace:
    """Build the kernel `slide` (one thread): the velocity at the end of the step of the
    body that `contact` belongs to.

    The flow's reaction depends on that velocity, so both are found together: a body far lighter than the flow is as
    stable as a heavy one. With v the velocity sought, J(v) the flow's impulse on the body, W its weight,

        m_2 (v - v_2) = J_x(v) + F_ext dt - sign(v) tan(delta_b) max(0, W dt - J_y(v)),

    and v = 0 where friction can hold it. The unknown is bracketed and found by regula falsi (Illinois), for the
    residual is mostly piecewise linear and decreasing. Where it jumps from one sign to the other, v is where it jumps,
    and friction takes what lies between.
    """
    F = types.scalar
    V2 = types.V2
    Contact = types.Contact
    Bodies, Grid = types.Bodies, types.Grid
    Parameters = types.Parameters
    respond = contact.respond
    impulse = contact.impulse
    FRICTION = types.effects.friction
    look_ahead = bodies_of.look_ahead
    CARRIED = types.effects.friction and types.effects.liquid
    # Relative width of a bracket that cannot be closed any further, as impulses are rounded to the scalar's precision,
    # and of one in which the velocity counts as found.
    CLOSED, FOUND = (1.0e-15, 1.0e-10) if types.effects.precision == "float64" else (1.0e-7, 1.0e-4)

    @wp.func
    def flow_impulse(
        contact: Contact, bodies: Bodies, velocity: wp.float64, parameters: Parameters, time_step: F
    ) -> wp.vec2d:
        total = wp.vec2d()
        surface_velocity = V2(F(velocity), F(0.0))
        for e in range(contact.mass.shape[0]):
            mass = contact.mass[e]
            if mass > F(0.0):
                friction = F(0.0)
                if FRICTION:
                    friction = bodies.friction[contact.surface[e]]
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
                    surface_velocity,
                    parameters,
                    time_step,
                )
                j = impulse(mass, change, parameters)
                total += wp.vec2d(wp.float64(j[0]), wp.float64(j[1]))
        return total

    @wp.kernel(module=module)
    def slide(
        contact: Contact,
        bodies: Bodies,
        grid: Grid,
        parameters: Parameters,
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=wp.int32),
    ):
        zero = wp.float64(0.0)
        dt = clock[wp.static(TIME_STEP)]
        time_step = F(dt)
        body = contact.body
        old = bodies.velocity[body][0]
        mass = bodies.mass[body]
        weight = bodies.weight[body] * dt
        external = (bodies.external_force[body] + bodies.pull[body]) * dt
        momentum = mass * old + external

        j = flow_impulse(contact, bodies, zero, parameters, time_step)
        drive = momentum + j[0]
        friction = bodies.base_friction[body] * wp.max(weight - j[1], zero)
        new = zero
        if wp.abs(drive) > friction:
            sign = wp.sign(drive)
            # At rest the drive wins over friction; a speed at which it no longer does is sought upward.
            low = zero
            low_residual = sign * drive - friction
            high = low_residual / mass
            high_residual = zero
            bracketed = wp.bool(False)
            iterations = wp.int32(0)
            tolerance = wp.float64(1.0e-13) * (wp.abs(drive) + friction)
            residual = low_residual
            v = high
            side = wp.int32(0)
            width = high
            closed = wp.float64(CLOSED) * high
            while iterations < wp.static(MAX_ITERATIONS) and wp.abs(residual) > tolerance and width > closed:
                if bracketed and iterations >= wp.static(SECANTS) and iterations % 2 == 0:
                    v = wp.float64(0.5) * (low + high)
                elif bracketed:
                    v = (low * high_residual - high * low_residual) / (high_residual - low_residual)
                else:
                    v = high
                j = flow_impulse(contact, bodies, sign * v, parameters, time_step)
                friction = bodies.base_friction[body] * wp.max(weight - j[1], zero)
                residual = sign * (momentum + j[0]) - friction - mass * v
                if residual > zero:
                    low = v
                    low_residual = residual
                    if not bracketed:
                        high *= wp.float64(2.0)
                    elif side == 1:
                        high_residual *= wp.float64(0.5)
                    side = wp.int32(1)
                else:
                    high = v
                    high_residual = residual
                    if bracketed and side == -1:
                        low_residual *= wp.float64(0.5)
                    bracketed = wp.bool(True)
                    side = wp.int32(-1)
                if bracketed:
                    width = high - low
                    closed = wp.float64(CLOSED) * high
                iterations += 1
            new = sign * v
            wp.atomic_add(counters, wp.static(BARRIER_ITERATIONS), iterations)
            if wp.abs(residual) > tolerance * wp.float64(1.0e3) and width > wp.float64(FOUND) * high:
                wp.atomic_add(counters, wp.static(BARRIER_UNCONVERGED), 1)
            # The momentum balance is closed exactly with the friction that is recorded.
            friction = momentum + j[0] - mass * new
        else:
            friction = drive
        bodies.velocity[body] = wp.vec2d(new, zero)
        look_ahead(bodies, grid, body, F(-0.5) * parameters.spacing, time_step)
        middle = wp.float64(0.5) * (old + new)
        bodies.base_impulse[body] = bodies.base_impulse[body] - friction
        bodies.base_work[body] = bodies.base_work[body] + friction * middle

    return SimpleNamespace(slide=slide)
