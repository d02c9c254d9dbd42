"""Time on the device: the step is chosen there, so that a whole output interval needs no host."""

from types import SimpleNamespace

import warp as wp

from .layout import (
    ACTIVE_MASS_LIQUID,
    ACTIVE_MASS_SOLID,
    BACK,
    BARRIER_IMPULSE_X,
    BARRIER_VELOCITY,
    BARRIER_WORK,
    DIVERGED,
    FACE,
    FASTEST,
    GOES_ON,
    GRAVITY_IMPULSE_X,
    GRAVITY_IMPULSE_Y,
    GRID_SHIFT,
    INITIAL_MASS_LIQUID,
    INITIAL_MASS_SOLID,
    LARGEST_TIME_STEP,
    LEFT_LIQUID_MASS,
    LEFT_SOLID_MASS,
    LIMIT_DRAG,
    LIMIT_OUTPUT,
    LIMIT_WAVE,
    OLD_BARRIER_VELOCITY,
    SMALLEST_TIME_STEP,
    SPEED_MAX,
    STEPS,
    STEPS_LEFT,
    TARGET,
    TIME,
    TIME_STEP,
    TOP,
)


def make_clock(types: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build the kernels `start` (before an interval's first step) and `tick` (after each step), one thread each."""
    effects = types.effects
    Parameters = types.Parameters
    BARRIER = effects.barrier != "none"
    MOVING = effects.barrier in ("sliding", "driven")
    DRIVEN = effects.barrier == "driven"

    @wp.func
    def choose_step(parameters: Parameters, clock: wp.array(dtype=wp.float64), counters: wp.array(dtype=wp.int32)):
        """The wave and drag limits, shortened so that the steps to the target are equal."""
        speed = wp.sqrt(clock[wp.static(SPEED_MAX)])
        wave = wp.float64(parameters.spacing) / (parameters.wave_speed + speed)
        limit = wp.static(LIMIT_WAVE)
        if parameters.largest_stable_step < wave:
            wave = parameters.largest_stable_step
            limit = wp.static(LIMIT_DRAG)
        largest = parameters.courant_number * wave
        remaining = clock[wp.static(TARGET)] - clock[wp.static(TIME)]
        count = wp.ceil(remaining / largest - wp.float64(1.0e-9))
        if count <= wp.float64(1.0):
            limit = wp.static(LIMIT_OUTPUT)
        counters[limit] = counters[limit] + 1
        clock[wp.static(TIME_STEP)] = remaining / wp.max(count, wp.float64(1.0))

    @wp.func
    def drive(
        clock: wp.array(dtype=wp.float64), times: wp.array(dtype=wp.float64), velocities: wp.array(dtype=wp.float64)
    ):
        """Velocity of a driven barrier in the middle of the coming step: linear between the given times."""
        t = clock[wp.static(TIME)] + wp.float64(0.5) * clock[wp.static(TIME_STEP)]
        last = times.shape[0] - 1
        v = velocities[last]
        if t <= times[0]:
            v = velocities[0]
        else:
            for k in range(last):
                if t > times[k] and t <= times[k + 1]:
                    share = (t - times[k]) / (times[k + 1] - times[k])
                    v = velocities[k] + share * (velocities[k + 1] - velocities[k])
        clock[wp.static(BARRIER_VELOCITY)] = v
        clock[wp.static(OLD_BARRIER_VELOCITY)] = v

    @wp.kernel(module=module)
    def start(
        parameters: Parameters,
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=wp.int32),
        running: wp.array(dtype=wp.int32),
        times: wp.array(dtype=wp.float64),
        velocities: wp.array(dtype=wp.float64),
    ):
        go = wp.int32(0)
        if clock[wp.static(TIME)] < clock[wp.static(TARGET)] and counters[wp.static(DIVERGED)] == 0:
            choose_step(parameters, clock, counters)
            if DRIVEN:
                drive(clock, times, velocities)
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
        times: wp.array(dtype=wp.float64),
        velocities: wp.array(dtype=wp.float64),
    ):
        dt = clock[wp.static(TIME_STEP)]
        solid = clock[wp.static(ACTIVE_MASS_SOLID)]
        liquid = clock[wp.static(ACTIVE_MASS_LIQUID)]
        weight = (solid + liquid) * dt
        gx = wp.float64(parameters.gravity[0])
        gy = wp.float64(parameters.gravity[1])
        clock[wp.static(GRAVITY_IMPULSE_X)] = clock[wp.static(GRAVITY_IMPULSE_X)] + gx * weight
        clock[wp.static(GRAVITY_IMPULSE_Y)] = clock[wp.static(GRAVITY_IMPULSE_Y)] + gy * weight
        if BARRIER:
            total = reactions[wp.static(2 * FACE)] + reactions[wp.static(2 * TOP)] + reactions[wp.static(2 * BACK)]
            if MOVING:
                new = clock[wp.static(BARRIER_VELOCITY)]
                middle = wp.float64(0.5) * (new + clock[wp.static(OLD_BARRIER_VELOCITY)])
                work = (total - clock[wp.static(BARRIER_IMPULSE_X)]) * middle
                clock[wp.static(BARRIER_WORK)] = clock[wp.static(BARRIER_WORK)] + work
                clock[wp.static(GRID_SHIFT)] = clock[wp.static(GRID_SHIFT)] + dt * middle
                clock[wp.static(OLD_BARRIER_VELOCITY)] = new
            clock[wp.static(BARRIER_IMPULSE_X)] = total
        # Points that left this step felt gravity in it: they are taken off afterwards.
        clock[wp.static(ACTIVE_MASS_SOLID)] = clock[wp.static(INITIAL_MASS_SOLID)] - left[wp.static(LEFT_SOLID_MASS)]
        clock[wp.static(ACTIVE_MASS_LIQUID)] = clock[wp.static(INITIAL_MASS_LIQUID)] - left[wp.static(LEFT_LIQUID_MASS)]
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
        if not (speed < wp.static(FASTEST * FASTEST)) or not wp.isfinite(clock[wp.static(BARRIER_VELOCITY)]):
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
                drive(clock, times, velocities)
            clock[wp.static(SPEED_MAX)] = wp.float64(0.0)
        running[wp.static(GOES_ON)] = go

    return SimpleNamespace(start=start, tick=tick)
