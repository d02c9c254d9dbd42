"""The closed form on NumPy arrays: an impact at many times, and the outcome of many impacts at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.impact import STANDARD_GRAVITY, VARIANTS, Impact
from analytic.sliding import Motion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trajectory:
    """An impact at given times; every array has the shape of `time`. SI units per metre of width."""

    time: Array
    force: Array
    impulse: Array
    flow_velocity: Array
    flow_displacement: Array
    flow_kinetic_energy: Array
    barrier_velocity: Array
    barrier_displacement: Array
    barrier_kinetic_energy: Array
    phase: NDArray[np.str_]


def trajectory(impact: Impact, time: ArrayLike) -> Trajectory:
    """Evaluate `impact` at the times `time` [s], an array of any shape.

    The values equal those of the methods of `Impact`, which see for their meaning.
    """
    times = np.asarray(time, dtype=float)
    since = times - impact.arrival_time
    starts = np.array([phase.start for phase in impact.phases])
    index = np.maximum(np.searchsorted(starts, since, side="left") - 1, 0)
    u = since - starts[index]

    def gather(values: list[float]) -> Array:
        return np.array(values)[index]

    def motion(motions: list[Motion]) -> tuple[Array, Array]:
        v, a, j = (gather([getattr(m, name) for m in motions]) for name in ("velocity", "acceleration", "jerk"))
        displacement = gather([m.displacement for m in motions]) + u * (v + u * (a / 2 + u * j / 6))
        return displacement, v + u * (a + u * j / 2)

    force, rate = gather([p.force for p in impact.phases]), gather([p.force_rate for p in impact.phases])
    # A phase may begin after its motion: the flow that moves on unchanged keeps the description of its first phase.
    offsets = [(p.flow.shifted(p.start), p.barrier.shifted(p.start)) for p in impact.phases]
    flow_displacement, flow_velocity = motion([flow for flow, _ in offsets])
    barrier_displacement, barrier_velocity = motion([barrier for _, barrier in offsets])
    barrier_mass = 0.0 if impact.barrier_mass is None or impact.fixed else impact.barrier_mass
    return Trajectory(
        time=times,
        force=force + u * rate,
        impulse=gather([p.impulse for p in impact.phases]) + u * (force + u * rate / 2),
        flow_velocity=flow_velocity,
        flow_displacement=flow_displacement,
        flow_kinetic_energy=impact.flow_mass * flow_velocity**2 / 2,
        barrier_velocity=barrier_velocity,
        barrier_displacement=barrier_displacement,
        barrier_kinetic_energy=barrier_mass * barrier_velocity**2 / 2,
        phase=np.array([p.name for p in impact.phases])[index],
    )


@dataclass(frozen=True)
class Outcomes:
    """Results of many impacts of a flow on a barrier at rest; arrays of one shape. Times count from arrival [s]."""

    impulse: Array
    """[N s/m]."""
    peak_force: Array
    """[N/m]."""
    peak_time: Array
    impact_end_time: Array
    common_velocity: Array
    """[m/s]."""
    barrier_velocity_max: Array
    """[m/s]."""
    barrier_velocity_at_impact_end: Array
    """[m/s]."""
    stop_time: Array
    """0 where the barrier never moves, infinite where it never stops."""
    barrier_displacement_final: Array
    """[m]; infinite where the barrier never stops."""


def outcomes(
    *,
    flow_mass: ArrayLike,
    barrier_mass: ArrayLike,
    flow_length: ArrayLike,
    speed: ArrayLike,
    base_friction: ArrayLike,
    geometry_change: ArrayLike,
    rise_ratio: ArrayLike,
    vertical_load_ratio: ArrayLike = 0.0,
    variant: str = VARIANTS[0],
    gravity: float = STANDARD_GRAVITY,
    slope: float = 0.0,
) -> Outcomes:
    """Outcome of each of many impacts; the inputs broadcast against each other.

    Inputs have the meaning, unit and range they have in `Impact`; an infinite `barrier_mass` is a fixed barrier.
    The barrier is at rest before the impact. A million impacts take a fraction of a second.

    Raises:
        ValueError: an input is out of its range, or the variant is unknown; one sentence names the first bad value.
    """
    if variant not in VARIANTS:
        raise ValueError(f"variant is {variant!r}, it must be one of {', '.join(VARIANTS)}.")
    m1 = _checked("flow_mass", flow_mass)
    m2 = _checked("barrier_mass", barrier_mass, finite=False)
    length = _checked("flow_length", flow_length)
    v = _checked("speed", speed)
    tan = _checked("base_friction", base_friction, zero=True)
    change = _checked("geometry_change", geometry_change, high=1.0)
    tau = _checked("rise_ratio", rise_ratio, high=1.0)
    kappa = _checked("vertical_load_ratio", vertical_load_ratio, zero=True)
    if variant == "as_printed" and np.any(kappa != 0):
        raise ValueError("vertical_load_ratio must be 0 with as_printed.")
    share = 1 - kappa * tan
    if np.any(share <= 0):
        raise ValueError("vertical_load_ratio times base_friction must be below 1 everywhere.")

    fixed = np.isinf(m2)
    angle = math.radians(slope)
    held = (tan > abs(math.tan(angle))) | fixed
    if slope != 0 and not np.all(held):
        worst = np.min(np.broadcast_to(tan, held.shape)[~held])
        raise ValueError(
            f"base_friction is {worst:.4g}, on a slope of {slope:g} degrees it must be above "
            f"{abs(math.tan(angle)):.4g} everywhere, else the barrier slides by its own weight."
        )
    deceleration = gravity * (tan * math.cos(angle) - math.sin(angle))
    T2 = 8 * change * length / (3 * v)
    J = v * m1 / (1 + m1 / m2)
    # The force less the friction that it brings along moves m2 as the whole force moves a mass larger by 1 / share.
    m2 = m2 / share
    R = np.where(fixed, np.inf, np.where(fixed, 1.0, m2) * deceleration)
    if variant == "momentum_closed":
        J = _momentum_closed_impulse(m1, m2, v, T2, tau, deceleration, R)
    F, T1 = 2 * J / T2, tau * T2
    common = np.where(fixed, 0.0, v - J / m1)
    if variant == "as_printed":
        found = _printed(common, J, T2, m2, deceleration, fixed)
    else:
        found = _stick_slip(F, T1, T2, m2, R, deceleration)
    maximum, at_end, stop, displacement = found
    return Outcomes(*np.broadcast_arrays(J, F, T1, T2, common, maximum, at_end, stop, displacement))


def _momentum_closed_impulse(
    m1: Array, m2: Array, v: Array, T2: Array, tau: Array, deceleration: Array, R: Array
) -> Array:
    """Impulse that leaves both bodies with one velocity at T2, see `Impact`."""
    reduced = m1 / (1 + m1 / m2)
    A = reduced * (v + deceleration * T2)
    finite_R = np.where(np.isinf(R), 0.0, R)
    J = (A + np.sqrt(np.maximum(A**2 - reduced * deceleration * tau * finite_R * T2**2, 0.0))) / 2
    _, at_end, _, _ = _stick_slip(2 * m1 * v / T2, tau * T2, T2, m2, R, deceleration)
    return np.where(at_end > 0, J, m1 * v)  # both at rest at T2: the flow has lost all its momentum


def _stick_slip(F: Array, T1: Array, T2: Array, m2: Array, R: Array, deceleration: Array) -> tuple[Array, ...]:
    """Largest velocity, velocity at T2, stop time and final displacement; section 3.3 of the audit, phase by phase."""
    D = T2 - T1
    r = np.minimum(R / F, 1.0)
    q = 1 - r
    a = F / m2  # peak acceleration
    v_a, x_a = a * T1 * q**2 / 2, a * T1**2 * q**3 / 6
    maximum = v_a + a * q**2 * D / 2
    at_end = a * (q**2 * T1 / 2 + (q - 0.5) * D)
    # Time from T1 to the stop if that comes before T2: the root of v_a + a (q u - u^2 / 2D).
    early = np.where(D > 0, D * q * (1 + np.sqrt(T2 / np.where(D > 0, D, 1.0))), np.inf)
    before_end = early <= D
    at_end = np.where(before_end, 0.0, at_end)
    u = np.where(before_end, early, D)
    safe_D = np.where(D > 0, D, 1.0)
    x = x_a + v_a * u + a * (q * u**2 / 2 - u**3 / (6 * safe_D))
    slides_on = ~before_end & (at_end > 0)
    coasting = np.where(slides_on & (deceleration == 0), np.inf, 0.0)
    coasting = np.where(
        slides_on & (deceleration > 0), at_end / np.where(deceleration > 0, deceleration, 1.0), coasting
    )
    stop = T1 + u + coasting
    x = x + np.where(slides_on, at_end * np.where(np.isinf(coasting), 1.0, coasting) / 2, 0.0)
    moved = q > 0
    x = np.where(np.isinf(coasting), np.inf, x)
    return tuple(np.where(moved, value, 0.0) for value in (maximum, at_end, stop, x))


def _printed(common: Array, J: Array, T2: Array, m2: Array, deceleration: Array, fixed: Array) -> tuple[Array, ...]:
    """Eqs. (12), (15) and (16) to the letter, for a barrier at rest before the impact."""
    at_end = np.where(fixed, 0.0, J / m2 - deceleration * T2)
    has_friction = deceleration > 0
    coasting = np.where(has_friction, common / np.where(has_friction, deceleration, 1.0), np.where(fixed, 0.0, np.inf))
    displacement = common * coasting / 2 - deceleration * T2**2 / 2 + J * T2 / (3 * m2)
    zero = np.zeros_like(at_end)
    return (
        np.where(fixed, zero, common),
        at_end,
        np.where(fixed, zero, T2 + coasting),
        np.where(fixed, zero, displacement),
    )


def _checked(name: str, value: ArrayLike, *, high: float = np.inf, zero: bool = False, finite: bool = True) -> Array:
    array = np.asarray(value, dtype=float)
    good = ((array >= 0) if zero else (array > 0)) & (array <= high) & (np.isfinite(array) | (not finite))
    if not np.all(good):
        bad = array[~good].flat[0]
        left, right = "[" if zero else "(", ")" if np.isinf(high) and finite else "]"
        raise ValueError(f"{name} is {bad:g}, it must be a number in {left}0, {high:g}{right} everywhere.")
    return array
