"""Exact motion of a body on a frictional base while the forces on it are linear in time; standard library only.

The one integrator of stick and slip in Python: the closed form is built from it, and it is shipped inside the FMU.
`fmu/c/barrier_sliding.c` has the same in C, in the same order of operations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion of a body from `start` on, a cubic in time: displacement, velocity, acceleration, jerk at the start."""

    start: float
    displacement: float
    velocity: float
    acceleration: float = 0.0
    jerk: float = 0.0

    def displacement_at(self, t: float) -> float:
        """Displacement [m] at the time `t` [s]."""
        u = t - self.start
        return self.displacement + u * (self.velocity + u * (self.acceleration / 2 + u * self.jerk / 6))

    def velocity_at(self, t: float) -> float:
        """Velocity [m/s] at the time `t` [s]."""
        u = t - self.start
        return self.velocity + u * (self.acceleration + u * self.jerk / 2)

    def shifted(self, t: float) -> Motion:
        """The same motion, described from the time `t` on."""
        acceleration = self.acceleration + (t - self.start) * self.jerk
        return Motion(t, self.displacement_at(t), self.velocity_at(t), acceleration, self.jerk)


def coulomb_motion(
    before: Motion,
    start: float,
    end: float,
    force: float,
    force_rate: float,
    friction: float,
    friction_rate: float,
    mass: float,
) -> Iterator[Motion]:
    """Motion between two times, exact but for round-off: its instants are roots of linear and quadratic equations.

    The body holds still while the force stays within the friction, slips when it exceeds it, and stops when its
    velocity is spent, be it to hold still or to go back.

    Args:
        before: motion of the body up to `start`.
        start, end: times [s].
        force, force_rate: force along the base at `start` [N/m], of either sign, and its rate [N/(m s)].
        friction, friction_rate: largest force that the base resists at `start` [N/m] >= 0, and its rate [N/(m s)];
            the friction may be infinite.
        mass: [kg/m], may be infinite.

    Yields:
        The pieces of the motion in order of time, each of which lasts until the next begins; none where `end` is not
        after `start`.
    """
    t, displacement, velocity = start, before.displacement_at(start), before.velocity_at(start)
    while t < end:
        waited = False
        if velocity != 0:
            direction = math.copysign(1.0, velocity)
        else:
            direction = _breakaway(force, force_rate, friction, friction_rate)
            if direction == 0:
                yield Motion(t, displacement, 0.0)
                wait, direction = _wait(force, force_rate, friction, friction_rate)
                if t + wait >= end:
                    return
                t, force, friction = t + wait, force + wait * force_rate, friction + wait * friction_rate
                waited = True  # it sets out with force and friction equal, whatever rounding says
        acceleration = 0.0 if waited else (force - direction * friction) / mass
        jerk = (force_rate - direction * friction_rate) / mass
        piece = Motion(t, displacement, velocity, acceleration, jerk)
        yield piece
        slip = first_stop(velocity, acceleration, jerk)
        if t + slip >= end:
            return
        t, force, friction = t + slip, force + slip * force_rate, friction + slip * friction_rate
        displacement, velocity = piece.displacement_at(t), 0.0
        # What stops a body cannot drive it on: keeps rounding from setting it going again at the same instant.
        force = direction * min(direction * force, friction)


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
    """Displacement [m] and velocity [m/s] at the end of `coulomb_motion` over a `duration` [s]."""
    before = Motion(0.0, displacement, velocity)
    pieces = coulomb_motion(before, 0.0, duration, force, force_rate, friction, friction_rate, mass)
    last = [before, *pieces][-1]
    return last.displacement_at(duration), last.velocity_at(duration)


def first_stop(velocity: float, acceleration: float, jerk: float) -> float:
    """Time [s] at which a motion first comes to rest after its start, infinite if it does not."""
    a, b, c = jerk / 2, acceleration, velocity
    if c == 0:
        return -b / a if a * b < 0 else math.inf
    discriminant = b * b - 4 * a * c
    if discriminant < 0:
        return math.inf
    q = -(b + math.copysign(math.sqrt(discriminant), b)) / 2
    first = q / a if a != 0 else math.inf
    second = c / q if q != 0 else math.inf
    # A root of +0.0 is a positive one that underflowed: the motion starts with a velocity that is not nil.
    return min((root for root in (first, second) if math.copysign(1.0, root) > 0), default=math.inf)


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
