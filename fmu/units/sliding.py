"""Motion of a body on a frictional base while the forces on it are linear in time."""

from __future__ import annotations

import math


def slide(
    displacement: float,
    velocity: float,
    duration: float,
    force: float,
    force_rate: float,
    friction: float,
    friction_rate: float,
    mass: float,
) -> tuple[float, float]:
    """Displacement [m] and velocity [m/s] after a stretch of time, exact but for round-off.

    The body holds still while the force stays within the friction, slips when it exceeds it, and stops when its
    velocity is spent, be it to hold still or to go back. The instants are roots of linear and quadratic equations.
    ``model.c`` of the C unit is this function line by line.

    Parameters
    ----------
    displacement, velocity: at the start [m], [m/s].
    duration: [s].
    force, force_rate: horizontal force at the start [N/m] and its rate [N/(m s)], of either sign.
    friction, friction_rate: largest force that the base resists at the start [N/m] >= 0, and its rate [N/(m s)].
    mass: [kg/m].
    """
    left = duration
    while left > 0:
        settled = 0.0  # a body that waited starts with the force and the friction equal
        if velocity != 0:
            direction = math.copysign(1.0, velocity)
        else:
            direction = _breakaway(force, force_rate, friction, friction_rate)
            if direction == 0:
                wait, direction = _wait(force, force_rate, friction, friction_rate)
                if wait >= left:
                    return displacement, 0.0
                force, friction, left = force + wait * force_rate, friction + wait * friction_rate, left - wait
                settled = 1.0
        acceleration = 0.0 if settled else (force - direction * friction) / mass
        jerk = (force_rate - direction * friction_rate) / mass
        run = min(first_stop(velocity, acceleration, jerk), left)
        displacement += run * (velocity + run * (acceleration / 2 + run * jerk / 6))
        if run >= left:
            return displacement, velocity + run * (acceleration + run * jerk / 2)
        velocity = 0.0
        force, friction, left = force + run * force_rate, friction + run * friction_rate, left - run
    return displacement, velocity


def _breakaway(force: float, force_rate: float, friction: float, friction_rate: float) -> float:
    """Direction in which a body at rest begins to move: 1, -1, or 0 if the base holds it."""
    for direction in (1.0, -1.0):
        excess, rate = direction * force - friction, direction * force_rate - friction_rate
        if excess > 0 or (excess == 0 and rate > 0):
            return direction
    return 0.0


def _wait(force: float, force_rate: float, friction: float, friction_rate: float) -> tuple[float, float]:
    """Time [s] until the force on a held body exceeds the friction, and the direction in which it does."""
    waits = []
    for direction in (1.0, -1.0):
        excess, rate = direction * force - friction, direction * force_rate - friction_rate
        waits.append((-excess / rate if rate > 0 else math.inf, direction))
    return waits[1] if waits[1][0] < waits[0][0] else waits[0]


def first_stop(velocity: float, acceleration: float, jerk: float) -> float:
    """Time [s] at which a motion first comes to rest after its start, infinite if it does not."""
    a, b, c = jerk / 2, acceleration, velocity
    if c == 0:
        return -b / a if a * b < 0 else math.inf
    discriminant = b * b - 4 * a * c
    if discriminant < 0:
        return math.inf
    q = -(b + math.copysign(math.sqrt(discriminant), b)) / 2
    first = q / a if a != 0 and q / a > 0 else math.inf
    second = c / q if q != 0 and c / q > 0 else math.inf
    return min(first, second)
