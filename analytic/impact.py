"""Impact of a debris flow on a rigid barrier as exact functions of time, standard library only.

The flow is a box of mass m1, length L and depth h that arrives with the velocity v1,0. It pushes the barrier with a
force F(t) that rises linearly from nil to F_peak at T1 and falls linearly to nil at T2. A barrier that is not fixed
slides on its base against the friction R = m2 g tan(delta_b), on a slope of the angle theta against what its weight
leaves of it, R = m2 g (tan(delta_b) cos(theta) - sin(theta)). Three variants answer for its motion:

`stick_slip`
    The consistent one and the default. The barrier holds still until F exceeds R, slides, and stops when its velocity
    is spent, be that before or after T2.
`momentum_closed`
    As above, with the impulse raised until flow and barrier have one common velocity at T2 although friction acts
    meanwhile. It raises F_peak, so a geometry change calibrated for another variant does not carry over.
`as_printed`
    The paper's Eqs. (10)-(16) to the letter, for comparison only: friction drags a resting barrier backwards, the
    velocity jumps at T2, and the kinematics ignore the rise ratio.

All quantities are SI per metre of width. Every function of time is evaluated from a polynomial of at most third degree
in the time since its phase began: there is no time step and no integration error. Equation numbers are the paper's;
`docs/closed_form.md` derives the corrected forms. This file is shipped inside the FMU, hence it imports nothing but
the standard library and `analytic.sliding`, which is shipped with it.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

from analytic.sliding import Motion, coulomb_motion

STANDARD_GRAVITY = 9.81
"""Acceleration of gravity [m/s^2], the paper's value."""

VARIANTS = ("stick_slip", "momentum_closed", "as_printed")
"""Names of the model variants; the first is the default."""

PHASES = ("approach", "stick", "acceleration", "deceleration", "inertia", "rest")
"""Names of the phases of an impact.

`approach`: the flow has not arrived. `stick`: the force acts, the barrier does not move. `acceleration` and
`deceleration`: the barrier slides while the force is above (below) the friction. `inertia`: the force has ended,
the barrier still slides. `rest`: the force has ended, the barrier does not move.
"""


@dataclass(frozen=True, slots=True)
class Phase:
    """A stretch of time, counted from arrival, in which the force is linear and both motions are cubics."""

    name: str
    start: float
    force: float
    force_rate: float
    impulse: float
    flow: Motion
    barrier: Motion


@dataclass(frozen=True, kw_only=True)
class Impact:
    """One impact: its inputs, checked, and its results.

    Args:
        flow_mass: m1 [kg/m] > 0.
        barrier_mass: m2 [kg/m] > 0; `None` or infinity for a fixed barrier.
        flow_length: L_1,0 [m] > 0, length of the equivalent box.
        flow_height: h [m] > 0, depth of the flow.
        speed: v_1,0 [m/s] > 0, velocity of the flow on arrival.
        barrier_initial_velocity: v_2,0 [m/s], 0 <= v_2,0 < v_1,0; 0 for a fixed barrier.
        base_friction: tan(delta_b) [-] >= 0; required unless the barrier is fixed. On a slope more than its tangent.
        geometry_change: lambda = s1max / L_1,0 [-], in (0, 1]. Give either this or `s1max`.
        s1max: largest geometry change length of the flow [m], in (0, L_1,0].
        rise_ratio: tau = T1 / T2 [-], in (0, 1].
        vertical_load_ratio: kappa [-] >= 0, vertical load of the flow on the barrier over its horizontal force. The
            paper leaves it out (0); it adds kappa F tan(delta_b) to the friction while the force acts. kappa
            tan(delta_b) < 1.
        variant: one of `VARIANTS`.
        arrival_time: time at which the front reaches the barrier [s] >= 0; all times below count from the same zero.
        gravity: g [m/s^2] > 0.
        slope: theta [degrees] in (-90, 90), by which the ground falls in the direction of the flow. It acts on the
            barrier; the flow's own weight along the slope is not in the model.

    Raises:
        ValueError: an input is missing, not finite, or out of its range; the sentence names it, its value and the
            range.
    """

    flow_mass: float
    barrier_mass: float | None = None
    flow_length: float
    flow_height: float
    speed: float
    barrier_initial_velocity: float = 0.0
    base_friction: float | None = None
    geometry_change: float | None = None
    s1max: float | None = None
    rise_ratio: float
    vertical_load_ratio: float = 0.0
    variant: str = VARIANTS[0]
    arrival_time: float = 0.0
    gravity: float = STANDARD_GRAVITY
    slope: float = 0.0

    geometry_change_length: float = field(init=False, repr=False, compare=False)
    """s1max [m], whichever way it was given."""
    impulse: float = field(init=False, repr=False, compare=False)
    """J = integral of F dt over the whole impact [N s/m]."""
    phases: tuple[Phase, ...] = field(init=False, repr=False, compare=False)
    """The phases in order of time, which counts from arrival; each lasts until the next begins."""
    _starts: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        _check(self)
        length = self.s1max if self.s1max is not None else self.flow_length * (self.geometry_change or 0.0)
        object.__setattr__(self, "geometry_change_length", length)
        object.__setattr__(
            self,
            "impulse",
            self._momentum_closed_impulse()
            if self.variant == "momentum_closed"
            else self.reduced_mass * self.approach_speed,
        )
        object.__setattr__(self, "phases", tuple(self._march()))
        object.__setattr__(self, "_starts", tuple(phase.start for phase in self.phases))

    # --- constants of the impact ---------------------------------------------------------------------------------

    @property
    def fixed(self) -> bool:
        """Whether the barrier is fixed to the ground (m2 -> infinity)."""
        return self.barrier_mass is None or math.isinf(self.barrier_mass)

    @property
    def approach_speed(self) -> float:
        """v_1,0 - v_2,0 [m/s]."""
        return self.speed - self.barrier_initial_velocity

    @property
    def reduced_mass(self) -> float:
        """m1 m2 / (m1 + m2) [kg/m]; m1 where the barrier is fixed."""
        if self.barrier_mass is None or self.fixed:
            return self.flow_mass
        return self.flow_mass / (1 + self.flow_mass / self.barrier_mass)

    @property
    def friction(self) -> float:
        """R = m2 g (tan(delta_b) cos(theta) - sin(theta)) [N/m], the force that the barrier at rest withstands.

        Infinite where it is fixed.
        """
        if self.barrier_mass is None or self.fixed:
            return math.inf
        return self.barrier_mass * self.friction_deceleration

    @property
    def friction_deceleration(self) -> float:
        """g (tan(delta_b) cos(theta) - sin(theta)) [m/s^2]; 0 where the barrier is fixed."""
        return 0.0 if self.fixed else friction_deceleration(self.gravity, self.base_friction or 0.0, self.slope)

    @property
    def threshold_force(self) -> float:
        """R / (1 - kappa tan(delta_b)) [N/m], the force beyond which the barrier moves; infinite where it is fixed."""
        return self.friction / self._driving_share

    @property
    def duration(self) -> float:
        """T2 = 8 s1max / (3 (v_1,0 - v_2,0)) [s], Eq. (8), counted from arrival."""
        return 8 * self.geometry_change_length / (3 * self.approach_speed)

    @property
    def peak_force(self) -> float:
        """F_peak [N/m]: twice the impulse over the duration, equal to 3/4 K1 (v_1,0 - v_2,0) by Eqs. (5)-(8)."""
        return 2 * self.impulse / self.duration

    @property
    def peak_pressure(self) -> float:
        """F_peak / h [Pa]."""
        return self.peak_force / self.flow_height

    @property
    def peak_time(self) -> float:
        """Time of F_peak [s]: arrival + T1, Eq. (9)."""
        return self.arrival_time + self.rise_ratio * self.duration

    @property
    def impact_end_time(self) -> float:
        """Time at which the force has fallen to nil [s]: arrival + T2."""
        return self.arrival_time + self.duration

    @property
    def common_velocity(self) -> float:
        """Velocity [m/s] of flow and barrier together after an inelastic impact with this impulse, (v_1,0 - J / m1).

        Equal to v_CM of Eq. (A17) except in the variant `momentum_closed`.
        """
        return 0.0 if self.fixed else self.speed - self.impulse / self.flow_mass

    @property
    def barrier_velocity_max(self) -> float:
        """Largest velocity of the barrier [m/s]; v_CM (1 - R / F_peak)^2 in `stick_slip` with v_2,0 = kappa = 0."""
        # The velocity is extreme where F = R, and a phase begins there.
        return max(phase.barrier.velocity for phase in self.phases)

    @property
    def barrier_velocity_at_impact_end(self) -> float:
        """Velocity of the barrier at T2 [m/s], at the end of the impact stage."""
        return self._phase(self.duration).barrier.velocity_at(self.duration)

    @property
    def stop_time(self) -> float:
        """Time at which the barrier stops for good [s]; the arrival time if it never moves, infinite if never stops."""
        moving = [i for i, phase in enumerate(self.phases) if _moves(phase.barrier)]
        if not moving or moving[-1] == 0:
            return self.arrival_time
        stop = moving[-1] + 1
        return self.arrival_time + self.phases[stop].start if stop < len(self.phases) else math.inf

    @property
    def barrier_displacement_final(self) -> float:
        """Final displacement of the barrier [m]; infinite where it never stops (no base friction)."""
        return math.inf if math.isinf(self.stop_time) else self.phases[-1].barrier.displacement

    @property
    def barrier_kinetic_energy_max(self) -> float:
        """Largest kinetic energy of the barrier [J/m]."""
        return self._barrier_energy(max(abs(phase.barrier.velocity) for phase in self.phases))

    # --- functions of time -----------------------------------------------------------------------------------------

    def phase(self, t: float) -> str:
        """Name of the phase at the time `t` [s]; at the instant between two phases, the earlier one."""
        return self._phase(t - self.arrival_time).name

    def force(self, t: float) -> float:
        """Horizontal impact force F [N/m] at the time `t` [s], Eqs. (6) and (A35)."""
        since = t - self.arrival_time
        phase = self._phase(since)
        return phase.force + (since - phase.start) * phase.force_rate

    def impulse_until(self, t: float) -> float:
        """Integral of F from arrival to the time `t` [N s/m]."""
        since = t - self.arrival_time
        phase = self._phase(since)
        u = since - phase.start
        return phase.impulse + u * (phase.force + u * phase.force_rate / 2)

    def flow_velocity(self, t: float) -> float:
        """Velocity v1 [m/s] of the flow's centre of mass at the time `t` [s]."""
        since = t - self.arrival_time
        return self._phase(since).flow.velocity_at(since)

    def flow_displacement(self, t: float) -> float:
        """Travel [m] of the flow's centre of mass since arrival (negative before) at the time `t` [s]."""
        since = t - self.arrival_time
        return self._phase(since).flow.displacement_at(since)

    def flow_kinetic_energy(self, t: float) -> float:
        """E_k1 = m1 v1^2 / 2 [J/m] at the time `t` [s], Eq. (11)."""
        return self.flow_mass * self.flow_velocity(t) ** 2 / 2

    def barrier_velocity(self, t: float) -> float:
        """Velocity v2 [m/s] of the barrier at the time `t` [s]."""
        since = t - self.arrival_time
        return self._phase(since).barrier.velocity_at(since)

    def barrier_displacement(self, t: float) -> float:
        """Displacement of the barrier since arrival [m] at the time `t` [s]."""
        since = t - self.arrival_time
        return self._phase(since).barrier.displacement_at(since)

    def barrier_kinetic_energy(self, t: float) -> float:
        """E_k2 = m2 v2^2 / 2 [J/m] at the time `t` [s], Eq. (13); nil where the barrier is fixed."""
        return self._barrier_energy(self.barrier_velocity(t))

    def scaled_to_speed(self, speed: float) -> Impact:
        """The same flow at another speed, by the paper's rule (section 3.2): s1max grows and tau falls with the speed.

        `s1max` is capped at the flow's length and the rise ratio at 1. `speed` [m/s] is the new v_1,0.
        """
        _require("speed", speed, 0, math.inf, open_low=True)
        ratio = speed / self.speed
        s1max = min(self.geometry_change_length * ratio, self.flow_length)
        rise_ratio = min(self.rise_ratio / ratio, 1.0)
        return replace(self, speed=speed, s1max=s1max, geometry_change=None, rise_ratio=rise_ratio)

    # --- construction ------------------------------------------------------------------------------------------------

    def _phase(self, since: float) -> Phase:
        """Phase at the time `since` arrival [s]."""
        # bisect_left: an instant between two phases belongs to the earlier, so T2 is the end of the impact stage.
        return self.phases[max(bisect_left(self._starts, since) - 1, 0)]

    @property
    def _driving_share(self) -> float:
        """1 - kappa tan(delta_b): what is left of the force when the friction that it brings along is taken off."""
        return 1.0 if self.fixed else 1 - self.vertical_load_ratio * (self.base_friction or 0.0)

    @property
    def _driven_mass(self) -> float:
        """Mass [kg/m] that the whole force would move, against the threshold force, as the driving share moves m2.

        (F (1 - kappa tan) - R) / m2 = (F - R / (1 - kappa tan)) / (m2 / (1 - kappa tan)).
        """
        return math.inf if self.barrier_mass is None or self.fixed else self.barrier_mass / self._driving_share

    def _barrier_energy(self, velocity: float) -> float:
        return 0.0 if self.barrier_mass is None or self.fixed else self.barrier_mass * velocity**2 / 2

    def _momentum_closed_impulse(self) -> float:
        """Impulse [N s/m] that leaves flow and barrier with one velocity at T2 although friction acts until then."""
        stopping = self.flow_mass * self.speed
        if self.barrier_mass is None or self.fixed:
            return stopping
        T2, R, deceleration = self.duration, self.threshold_force, self.friction_deceleration
        reduced_mass = self.flow_mass / (1 + self.flow_mass / self._driven_mass)
        if self._barrier_at_impact_end(stopping).velocity <= 0:
            return stopping  # both are at rest at T2: the common velocity is nil
        never_at_rest = reduced_mass * (self.approach_speed + deceleration * T2)
        ratio = R * T2 / (2 * never_at_rest)
        if ratio >= 1 or self.barrier_initial_velocity > deceleration * ratio * self.rise_ratio * T2 / 2:
            return never_at_rest
        A = reduced_mass * (self.speed + deceleration * T2)
        return (A + math.sqrt(A**2 - reduced_mass * deceleration * self.rise_ratio * R * T2**2)) / 2

    def _barrier_at_impact_end(self, impulse: float) -> Motion:
        motion = Motion(0.0, 0.0, self.barrier_initial_velocity)
        for start, end, force, rate in self._force_pieces(impulse):
            pieces = coulomb_motion(motion, start, end, force, rate, self.threshold_force, 0.0, self._driven_mass)
            motion = list(pieces)[-1].shifted(end)
        return motion

    def _force_pieces(self, impulse: float) -> list[tuple[float, float, float, float]]:
        """Start, end, force at the start and its rate of each piece in which F stays above or below the threshold."""
        T2, R = self.duration, self.threshold_force
        T1 = self.rise_ratio * T2
        peak = 2 * impulse / T2
        rise, fall = peak / T1, -peak / (T2 - T1) if T1 < T2 else 0.0
        knots = [(0.0, 0.0, rise), (T1, peak, fall), (T2, 0.0, 0.0)]
        if 0 < R < peak:
            knots += [(R / rise, R, rise), (T1 + (1 - R / peak) * (T2 - T1), R, fall)]
        knots.sort(key=lambda knot: knot[0])
        return [(a[0], b[0], a[1], a[2]) for a, b in pairwise(knots) if b[0] > a[0]]

    def _march(self) -> Iterator[Phase]:
        flow = Motion(0.0, 0.0, self.speed)
        barrier = Motion(0.0, 0.0, self.barrier_initial_velocity)
        yield Phase("approach", 0.0, 0.0, 0.0, 0.0, flow, barrier)
        printed = self.variant == "as_printed"
        if printed:
            flow, barrier = self._printed_motions()
        threshold = self.threshold_force
        impulse = 0.0
        for start, end, force, rate in self._force_pieces(self.impulse):
            if printed:
                pieces = [barrier.shifted(start)]
            else:
                flow = Motion(
                    start,
                    flow.displacement_at(start),
                    flow.velocity_at(start),
                    -force / self.flow_mass,
                    -rate / self.flow_mass,
                )
                pieces = list(coulomb_motion(barrier, start, end, force, rate, threshold, 0.0, self._driven_mass))
            for piece in pieces:
                u = piece.start - start
                above = force > threshold or (force == threshold and rate > 0)
                name = "stick" if not _moves(piece) else "acceleration" if above else "deceleration"
                yield Phase(
                    name,
                    piece.start,
                    force + u * rate,
                    rate,
                    impulse + u * (force + u * rate / 2),
                    flow.shifted(piece.start),
                    piece,
                )
            impulse += (end - start) * (force + (end - start) * rate / 2)
            barrier = pieces[-1]
        yield from self._after_impact(flow.shifted(self.duration), barrier.shifted(self.duration))

    def _printed_motions(self) -> tuple[Motion, Motion]:
        """Eqs. (10), (12) and (14): the force is taken to rise until T2, friction to act from the first instant."""
        jerk = 2 * self.impulse / self.duration**2
        flow = Motion(0.0, 0.0, self.speed, 0.0, -jerk / self.flow_mass)
        if self.barrier_mass is None or self.fixed:
            return flow, Motion(0.0, 0.0, 0.0)
        # Eq. (14) prints v_2,0 without the time that Eqs. (16) and (A38) give it.
        deceleration = -self.friction_deceleration
        return flow, Motion(0.0, 0.0, self.barrier_initial_velocity, deceleration, jerk / self.barrier_mass)

    def _after_impact(self, flow: Motion, barrier: Motion) -> Iterator[Phase]:
        end, deceleration = flow.start, self.friction_deceleration
        if self.variant == "as_printed":  # Eq. (15): both bodies start anew from v_CM and decelerate alike
            flow = Motion(end, flow.displacement, self.common_velocity, -deceleration)
            barrier = replace(barrier, velocity=self.common_velocity)
        else:
            flow = Motion(end, flow.displacement, flow.velocity)
        if barrier.velocity <= 0:
            yield Phase("rest", end, 0.0, 0.0, self.impulse, flow, Motion(end, barrier.displacement, 0.0))
            return
        sliding = Motion(end, barrier.displacement, barrier.velocity, -deceleration)
        yield Phase("inertia", end, 0.0, 0.0, self.impulse, flow, sliding)
        if deceleration > 0:
            stop = end + barrier.velocity / deceleration
            at_rest = Motion(stop, sliding.displacement + barrier.velocity**2 / (2 * deceleration), 0.0)
            flow = replace(flow.shifted(stop), velocity=0.0, acceleration=0.0) if flow.acceleration else flow
            yield Phase("rest", stop, 0.0, 0.0, self.impulse, flow, at_rest)


def friction_deceleration(gravity: float, base_friction: float, slope: float) -> float:
    """g (tan(delta_b) cos(theta) - sin(theta)) [m/s^2], with which a sliding barrier slows down; theta in degrees.

    Eq. (A30), with the slope that the paper does not have.
    """
    angle = math.radians(slope)
    return gravity * (base_friction * math.cos(angle) - math.sin(angle))


def _moves(motion: Motion) -> bool:
    return motion.velocity != 0 or motion.acceleration != 0 or motion.jerk != 0


def _require(
    name: str, value: float, low: float, high: float, *, open_low: bool = False, open_high: bool = False, why: str = ""
) -> None:
    """Raise ValueError with one sentence unless `value` is a finite number in the range."""
    inside = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if inside:
        inside = (value > low if open_low else value >= low) and (value < high if open_high else value <= high)
    if not inside:
        left, right = "(" if open_low else "[", ")" if open_high or math.isinf(high) else "]"
        raise ValueError(f"{name} is {value!r}, it must be a number in {left}{low:g}, {high:g}{right}{why}.")


def _check(impact: Impact) -> None:
    for name in ("flow_mass", "flow_length", "flow_height", "speed", "gravity"):
        _require(name, getattr(impact, name), 0, math.inf, open_low=True)
    _require("rise_ratio", impact.rise_ratio, 0, 1, open_low=True, why=" (it is T1 / T2)")
    _require("arrival_time", impact.arrival_time, 0, math.inf)
    if impact.variant not in VARIANTS:
        raise ValueError(f"variant is {impact.variant!r}, it must be one of {', '.join(VARIANTS)}.")
    _require("vertical_load_ratio", impact.vertical_load_ratio, 0, math.inf)
    if impact.variant == "as_printed" and impact.vertical_load_ratio:
        raise ValueError(f"vertical_load_ratio is {impact.vertical_load_ratio!r}, it must be 0 with as_printed.")
    if impact.geometry_change is not None and impact.s1max is not None:
        raise ValueError(f"geometry_change is {impact.geometry_change!r} and s1max is {impact.s1max!r}, give only one.")
    if impact.s1max is not None:
        _require("s1max", impact.s1max, 0, impact.flow_length, open_low=True, why=" (at most the flow's length)")
    elif impact.geometry_change is not None:
        _require("geometry_change", impact.geometry_change, 0, 1, open_low=True, why=" (it is s1max / flow_length)")
    else:
        raise ValueError("geometry_change is missing, give a number in (0, 1] or s1max in metres.")
    _require("slope", impact.slope, -90, 90, open_low=True, open_high=True, why=" degrees")
    v20 = impact.barrier_initial_velocity
    if impact.fixed:
        _require("barrier_initial_velocity", v20, 0, 0, why=" (the barrier is fixed)")
        return
    _require("barrier_mass", impact.barrier_mass or 0.0, 0, math.inf, open_low=True)
    _require("barrier_initial_velocity", v20, 0, impact.speed, open_high=True, why=" (below the flow's speed)")
    if impact.base_friction is None:
        raise ValueError("base_friction is missing, a barrier that is not fixed needs a number in [0, inf).")
    _require("base_friction", impact.base_friction, 0, math.inf)
    steepest = abs(math.tan(math.radians(impact.slope)))
    if impact.slope != 0 and impact.base_friction <= steepest:
        raise ValueError(
            f"base_friction is {impact.base_friction!r}, on a slope of {impact.slope:g} degrees it must be above "
            f"{steepest:.4g}, else the barrier slides by its own weight."
        )
    if impact.vertical_load_ratio * impact.base_friction >= 1:
        limit = 1 / impact.base_friction
        raise ValueError(f"vertical_load_ratio is {impact.vertical_load_ratio!r}, it must be in [0, {limit:g}).")
