"""Time on the device: the step is chosen there, so that a whole output interval needs no host."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from .layout import (
    ACTIVE_MASS_LIQUID,
    ACTIVE_MASS_SOLID,
    DIVERGED,
    FASTEST,
    GOES_ON,
    GRAVITY_IMPULSE_X,
    GRAVITY_IMPULSE_Y,
    INITIAL_MASS_LIQUID,
    INITIAL_MASS_SOLID,
    LARGEST_TIME_STEP,
    LEFT_LIQUID_MASS,
    LEFT_SOLID_MASS,
    LIMIT_OUTPUT,
    LIMIT_WAVE,
    SEEPAGE_POWER,
    SEEPAGE_POWER_BEFORE,
    SEEPAGE_WORK,
    SMALLEST_TIME_STEP,
    SPEED_MAX,
    STEPS,
    STEPS_LEFT,
    TARGET,
    TIME,
    TIME_STEP,
)


def make_clock(types: SimpleNamespace, bodies_of: Any, module: str) -> SimpleNamespace:
    """Build the kernels `start` (before an interval's first step) and `tick` (after each step), one thread each."""
    effects = types.effects
    Parameters = types.Parameters
    Bodies = types.Bodies
    Grid = types.Grid
    F = types.scalar
    look_ahead = bodies_of.look_ahead if effects.driven else None
    MOVING = effects.moving
    DRIVEN = effects.driven
    TWO_PHASE = effects.two_phase

    @wp.func
    def choose_step(parameters: Parameters, clock: wp.array(dtype=wp.float64), counters: wp.array(dtype=wp.int32)):
        """The limits of waves, drag and the law, shortened so that the steps to the target are equal."""
        speed = wp.sqrt(clock[wp.static(SPEED_MAX)])
        wave = wp.float64(parameters.spacing) / (parameters.wave_speed + speed)
        limit = wp.static(LIMIT_WAVE)
        if parameters.largest_stable_step < wave:
            wave = parameters.largest_stable_step
            limit = parameters.largest_stable_step_counter
        largest = parameters.courant_number * wave
        remaining = clock[wp.static(TARGET)] - clock[wp.static(TIME)]
        count = wp.ceil(remaining / largest - wp.float64(1.0e-9))
        if count <= wp.float64(1.0):
            limit = wp.static(LIMIT_OUTPUT)
        counters[limit] = counters[limit] + 1
        clock[wp.static(TIME_STEP)] = remaining / wp.max(count, wp.float64(1.0))

    @wp.func
    def drive(bodies: Bodies, grid: Grid, parameters: Parameters, clock: wp.array(dtype=wp.float64)):
        """Velocities of the driven bodies in the middle of the coming step: linear between the given times."""
        t = clock[wp.static(TIME)] + wp.float64(0.5) * clock[wp.static(TIME_STEP)]
        for body in range(bodies.count):
            first = bodies.first_time[body]
            last = bodies.first_time[body + 1] - 1
            if first <= last:
                v = bodies.velocities[last]
                if t <= bodies.times[first]:
                    v = bodies.velocities[first]
                else:
                    for k in range(first, last):
                        if t > bodies.times[k] and t <= bodies.times[k + 1]:
                            share = (t - bodies.times[k]) / (bodies.times[k + 1] - bodies.times[k])
                            v = bodies.velocities[k] + share * (bodies.velocities[k + 1] - bodies.velocities[k])
                bodies.velocity[body] = v
                bodies.old_velocity[body] = v
                look_ahead(bodies, grid, body, F(-0.5) * parameters.spacing, F(clock[wp.static(TIME_STEP)]))

    @wp.func
    def carry(bodies: Bodies, grid: Grid, reactions: wp.array(dtype=wp.float64), dt: wp.float64) -> wp.bool:
        """Move the bodies, and the grid with the one that it rides with; whether all velocities are finite."""
        sound = wp.bool(True)
        half = wp.float64(0.5)
        for body in range(bodies.count):
            total = wp.vec2d()
            for surface in range(bodies.first_surface[body], bodies.first_surface[body + 1]):
                total += wp.vec2d(reactions[2 * surface], reactions[2 * surface + 1])
            new = bodies.velocity[body]
            middle = half * (new + bodies.old_velocity[body])
            bodies.work[body] = bodies.work[body] + wp.dot(total - bodies.impulse[body], middle)
            bodies.displacement[body] = bodies.displacement[body] + dt * middle
            bodies.old_velocity[body] = new
            bodies.impulse[body] = total
            if body == bodies.carrier:
                grid.shift[0] = grid.shift[0] + dt * middle[0]
            if not (wp.isfinite(new[0]) and wp.isfinite(new[1])):
                sound = wp.bool(False)
        return sound

    @wp.kernel(module=module)
    def start(
        parameters: Parameters,
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=wp.int32),
        running: wp.array(dtype=wp.int32),
        bodies: Bodies,
        grid: Grid,
    ):
        go = wp.int32(0)
        if clock[wp.static(TIME)] < clock[wp.static(TARGET)] and counters[wp.static(DIVERGED)] == 0:
            choose_step(parameters, clock, counters)
            if DRIVEN:
                drive(bodies, grid, parameters, clock)
            clock[wp.static(SPEED_MAX)] = wp.float64(0.0)
            go = wp.int32(1)
        running[wp.static(GOES_ON)] = go

    @wp.kernel(module=module)
    def tick(
        parameters: Parameters,
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=wp.int32),
        running: wp.array(dtype=wp.int32),
        reactions: wp.array(dtype=wp.float64),
        left: wp.array(dtype=wp.float64),
        balance: wp.array(dtype=wp.float64),
        bodies: Bodies,
        grid: Grid,
    ):
        dt = clock[wp.static(TIME_STEP)]
        solid = balance[wp.static(ACTIVE_MASS_SOLID)]
        liquid = balance[wp.static(ACTIVE_MASS_LIQUID)]
        weight = (solid + liquid) * dt
        gx = wp.float64(parameters.gravity[0])
        gy = wp.float64(parameters.gravity[1])
        balance[wp.static(GRAVITY_IMPULSE_X)] = balance[wp.static(GRAVITY_IMPULSE_X)] + gx * weight
        balance[wp.static(GRAVITY_IMPULSE_Y)] = balance[wp.static(GRAVITY_IMPULSE_Y)] + gy * weight
        if TWO_PHASE:
            power = balance[wp.static(SEEPAGE_POWER)]
            mean = wp.float64(0.5) * (balance[wp.static(SEEPAGE_POWER_BEFORE)] + power)
            balance[wp.static(SEEPAGE_WORK)] = balance[wp.static(SEEPAGE_WORK)] + dt * mean
            balance[wp.static(SEEPAGE_POWER_BEFORE)] = power
            balance[wp.static(SEEPAGE_POWER)] = wp.float64(0.0)
        sound = wp.bool(True)
        if MOVING:
            sound = carry(bodies, grid, reactions, dt)
        # Points that left this step felt gravity in it: they are taken off afterwards.
        balance[wp.static(ACTIVE_MASS_SOLID)] = (
            balance[wp.static(INITIAL_MASS_SOLID)] - left[wp.static(LEFT_SOLID_MASS)]
        )
        balance[wp.static(ACTIVE_MASS_LIQUID)] = (
            balance[wp.static(INITIAL_MASS_LIQUID)] - left[wp.static(LEFT_LIQUID_MASS)]
        )
        counters[wp.static(STEPS)] = counters[wp.static(STEPS)] + 1
        clock[wp.static(LARGEST_TIME_STEP)] = wp.max(clock[wp.static(LARGEST_TIME_STEP)], dt)
        clock[wp.static(SMALLEST_TIME_STEP)] = wp.min(clock[wp.static(SMALLEST_TIME_STEP)], dt)
        time = clock[wp.static(TIME)] + dt
        target = clock[wp.static(TARGET)]
        go = wp.int32(1)
        if time >= target - wp.float64(0.25) * dt:
            time = target
            go = wp.int32(0)
        clock[wp.static(TIME)] = time
        speed = clock[wp.static(SPEED_MAX)]
        # The greatest speed passes over NaN; a NaN anywhere in a velocity makes a position NaN, which `advect` notices.
        if not (speed < wp.static(FASTEST * FASTEST)) or not sound:
            counters[wp.static(DIVERGED)] = 1
        if counters[wp.static(DIVERGED)] != 0:
            go = wp.int32(0)
        # After its share of steps the device lets the host look up. `start` then chooses the next step as is done here.
        running[wp.static(STEPS_LEFT)] = running[wp.static(STEPS_LEFT)] - 1
        if running[wp.static(STEPS_LEFT)] <= 0:
            go = wp.int32(0)
        if go == 1:
            choose_step(parameters, clock, counters)
            if DRIVEN:
                drive(bodies, grid, parameters, clock)
            clock[wp.static(SPEED_MAX)] = wp.float64(0.0)
        running[wp.static(GOES_ON)] = go

    return SimpleNamespace(start=start, tick=tick)
