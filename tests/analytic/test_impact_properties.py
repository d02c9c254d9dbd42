"""What must hold for every impact: conservation identities, continuity, limits, and agreement with time integration."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from analytic.impact import Impact


def decades(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers spread evenly over the orders of magnitude from 10^low to 10^high."""
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


@st.composite
def impacts(draw: st.DrawFn, **given_inputs: Any) -> Impact:
    """Impacts from a bucketful on a garden wall to a rock avalanche on a hill, of the two consistent variants."""
    speed = draw(decades(-1, 2))
    base_friction = draw(st.one_of(st.just(0.0), decades(-3, 0.5)))
    inputs: dict[str, Any] = {
        "flow_mass": draw(decades(1, 8)),
        "barrier_mass": draw(decades(1, 8)),
        "flow_length": draw(decades(-1, 3)),
        "flow_height": draw(decades(-1, 1.5)),
        "speed": speed,
        "barrier_initial_velocity": draw(
            st.one_of(st.just(0.0), st.floats(1e-6, 0.9).map(lambda share: share * speed))
        ),
        "base_friction": base_friction,
        "geometry_change": draw(st.floats(1e-3, 1)),
        "rise_ratio": draw(st.one_of(st.just(1.0), st.floats(1e-3, 1), decades(-6, 0))),
        "vertical_load_ratio": draw(st.one_of(st.just(0.0), st.floats(0, 0.95 / max(base_friction, 0.3)))),
        "variant": draw(st.sampled_from(["stick_slip", "momentum_closed"])),
        "arrival_time": draw(st.one_of(st.just(0.0), st.floats(0, 100))),
        # Up to slopes, downhill and uphill, on which the barrier barely rests.
        "slope": draw(
            st.one_of(
                st.just(0.0), st.floats(-0.95, 0.95).map(lambda share: math.degrees(math.atan(share * base_friction)))
            )
        ),
    }
    return Impact(**(inputs | given_inputs))


def from_arrival(impact: Impact) -> Impact:
    """The same impact on a clock that starts at arrival, so that large times cost no digits."""
    return replace(impact, arrival_time=0.0)


@given(impacts(), st.floats(1e-3, 1))
def test_impulse_is_the_area_under_the_force_and_independent_of_the_rise_ratio(impact: Impact, other: float) -> None:
    impact = from_arrival(impact)
    area, _ = quad(impact.force, 0, impact.impact_end_time, points=[impact.peak_time], epsrel=1e-10)
    assert impact.impulse == pytest.approx(area, rel=1e-8)
    assert impact.impulse_until(impact.impact_end_time) == pytest.approx(impact.impulse, rel=1e-12)
    if impact.variant == "stick_slip":
        assert replace(impact, rise_ratio=other).impulse == impact.impulse
        masses = impact.flow_mass * impact.barrier_mass / (impact.flow_mass + impact.barrier_mass)
        assert impact.impulse == pytest.approx(masses * impact.approach_speed, rel=1e-12)


@given(impacts(barrier_initial_velocity=0.0, variant="stick_slip", vertical_load_ratio=0.0), st.floats(1e-3, 1))
def test_largest_barrier_velocity_is_independent_of_the_rise_ratio(impact: Impact, other: float) -> None:
    share = max(1 - impact.friction / impact.peak_force, 0.0)
    expected = pytest.approx(impact.common_velocity * share**2, rel=1e-9, abs=1e-12 * impact.speed)
    assert impact.barrier_velocity_max == expected
    assert replace(impact, rise_ratio=other).barrier_velocity_max == expected


@given(impacts())
def test_work_of_the_force_goes_into_friction(impact: Impact) -> None:
    """Work on the barrier = work of base friction - that of its weight along the slope - initial kinetic energy."""
    impact = from_arrival(impact)
    assume(math.isfinite(impact.stop_time))
    work = _work(impact, lambda t: impact.barrier_velocity(t))
    tan = impact.base_friction
    angle, weight = math.radians(impact.slope), impact.barrier_mass * impact.gravity
    normal_work = weight * math.cos(angle) * impact.barrier_displacement_final
    fallen = weight * math.sin(angle) * impact.barrier_displacement_final
    dissipated = tan * (normal_work + impact.vertical_load_ratio * work) - fallen
    initial = impact.barrier_mass * impact.barrier_initial_velocity**2 / 2
    # Scaled by the energies at play; the difference of two nearly equal ones cannot be more exact than they are.
    scale = max(dissipated + abs(fallen), initial, impact.flow_mass * impact.speed**2 / 2 * 1e-9)
    assert work + initial == pytest.approx(dissipated, abs=1e-7 * scale)


@given(impacts())
def test_work_of_the_force_is_the_flow_s_loss(impact: Impact) -> None:
    impact = from_arrival(impact)
    loss = impact.flow_kinetic_energy(0) - impact.flow_kinetic_energy(impact.impact_end_time)
    assert _work(impact, impact.flow_velocity) == pytest.approx(loss, abs=1e-9 * impact.flow_kinetic_energy(0))


def _work(impact: Impact, velocity: Any) -> float:
    """Integral of F v over the impact by Gauss-Legendre points in each phase (exact: the integrand is a cubic)."""
    points, weights = np.polynomial.legendre.leggauss(4)
    total = 0.0
    starts = [phase.start for phase in impact.phases if phase.start <= impact.impact_end_time]
    for start, end in pairwise([*starts, impact.impact_end_time]):
        half = (end - start) / 2
        times = start + half * (1 + points)
        total += half * sum(w * impact.force(t) * velocity(t) for t, w in zip(times, weights, strict=True))
    return total


@given(impacts())
def test_momentum_of_the_barrier(impact: Impact) -> None:
    """m2 (v2(T2) - v2,0) = J minus what friction takes while the barrier moves and what holds it while it does not."""
    impact = from_arrival(impact)
    end = impact.impact_end_time
    resisted = 0.0
    for phase, following in pairwise([*impact.phases, impact.phases[-1]]):
        if phase.name == "approach" or phase.start >= end:
            continue
        until = min(following.start, end) if following is not phase else end
        pushed = impact.impulse_until(until) - phase.impulse
        if phase.name == "stick":
            resisted += pushed
        else:
            weight, angle = impact.barrier_mass * impact.gravity * (until - phase.start), math.radians(impact.slope)
            normal = weight * math.cos(angle) + impact.vertical_load_ratio * pushed
            resisted += impact.base_friction * normal - weight * math.sin(angle)
    gained = impact.barrier_mass * (impact.barrier_velocity(end) - impact.barrier_initial_velocity)
    momentum = impact.impulse + impact.barrier_mass * impact.barrier_initial_velocity
    assert gained == pytest.approx(impact.impulse - resisted, abs=1e-9 * momentum)


@given(impacts())
def test_the_barrier_never_moves_backwards_and_the_stages_join(impact: Impact) -> None:
    impact = from_arrival(impact)
    for before, after in pairwise(impact.phases[1:]):
        t = after.start
        force_before = before.force + (t - before.start) * before.force_rate
        # A force that rises until T2 ends with a jump; a fall of less than 1e-6 T2 is too steep for the clock's digits.
        jumps = impact.rise_ratio > 1 - 1e-6 and t > impact.peak_time * (1 - 1e-9)
        assert jumps or after.force == pytest.approx(force_before, abs=1e-9 * impact.peak_force)
        scale = impact.speed
        assert after.barrier.velocity == pytest.approx(before.barrier.velocity_at(t), abs=1e-9 * scale)
        assert after.flow.velocity == pytest.approx(before.flow.velocity_at(t), abs=1e-9 * scale)
        travel = max(impact.barrier_displacement(t), scale * impact.duration)
        assert after.barrier.displacement == pytest.approx(before.barrier.displacement_at(t), abs=1e-9 * travel)
    last = impact.phases[-1].start
    velocities = [impact.barrier_velocity(t) for t in np.linspace(0, 1.1 * last, 200)]
    assert min(velocities) >= -1e-9 * impact.speed


@given(impacts(variant="momentum_closed"))
def test_momentum_closed_ends_with_one_velocity(impact: Impact) -> None:
    impact = from_arrival(impact)
    end = impact.impact_end_time
    # Cancellation: v1(T2) is what is left of v1,0 after J / m1.
    assert impact.flow_velocity(end) == pytest.approx(impact.barrier_velocity(end), abs=1e-7 * impact.speed)
    assert impact.common_velocity == pytest.approx(impact.flow_velocity(end), abs=1e-9 * impact.speed)


@given(impacts())
def test_agrees_with_time_integration(impact: Impact) -> None:
    impact = from_arrival(impact)
    horizon = 1.05 * impact.phases[-1].start if math.isfinite(impact.stop_time) else 3 * impact.impact_end_time
    travel = impact.speed * impact.duration
    for t, v1, v2, x, J in _integrate(impact, horizon):
        assert impact.flow_velocity(t) == pytest.approx(v1, abs=1e-8 * impact.speed)
        assert impact.barrier_velocity(t) == pytest.approx(v2, abs=1e-8 * impact.speed)
        assert impact.barrier_displacement(t) == pytest.approx(x, rel=1e-8, abs=1e-8 * travel)
        assert impact.impulse_until(t) == pytest.approx(J, abs=1e-8 * impact.impulse)


def _integrate(impact: Impact, horizon: float) -> list[tuple[float, float, float, float, float]]:
    """Newton's law for flow and barrier with Coulomb friction, by an adaptive method, piece by piece between kinks.

    Written from the equations of motion alone; of the closed form it knows the triangle (F_peak, T1, T2).
    """
    T1, T2, peak = impact.peak_time, impact.impact_end_time, impact.peak_force
    m1, m2, tan, kappa = impact.flow_mass, impact.barrier_mass, impact.base_friction, impact.vertical_load_ratio
    angle = math.radians(impact.slope)
    sides = [(0.0, T1, lambda t: peak * t / T1), (T1, T2, lambda t: peak * (T2 - t) / (T2 - T1))][: 1 + (T1 < T2)]

    along, across = m2 * impact.gravity * math.sin(angle), m2 * impact.gravity * math.cos(angle)

    def net(force: float) -> float:
        return force + along - tan * (across + kappa * force)

    # Between these kinks the net force keeps its sign, so that a velocity falls through zero at most once.
    pieces = []
    for start, end, force in sides:
        kinks = [start, end]
        if net(force(start)) * net(force(end)) < 0:
            kinks.insert(1, brentq(lambda t, force=force: net(force(t)), start, end, xtol=1e-15 * T2, rtol=1e-14))
        pieces += [(a, b, force) for a, b in pairwise(kinks)]
    pieces.append((T2, horizon, lambda t: 0.0))

    scale = np.array([impact.speed, impact.speed, impact.speed * T2, impact.impulse])
    state = np.array([impact.speed, impact.barrier_initial_velocity, 0.0, 0.0])  # v1, v2, x2, J
    samples = []
    for t, end, force in pieces:
        moving = state[1] > 0 or net(force((t + end) / 2)) > 0
        while t < end:

            def rates(t: float, y: np.ndarray, moving: bool = moving, force: Any = force) -> list[float]:
                return [-force(t) / m1, net(force(t)) / m2 if moving else 0.0, y[1] if moving else 0.0, force(t)]

            def stop(t: float, y: np.ndarray) -> float:
                return y[1]

            stop.terminal = True  # type: ignore[attr-defined]
            stop.direction = -1  # type: ignore[attr-defined]
            piece = solve_ivp(
                rates,
                (t, end),
                state,
                method="DOP853",
                rtol=1e-12,
                atol=1e-13 * scale,
                events=stop if moving else None,
                dense_output=True,
            )
            samples += [(float(at), *piece.sol(at)) for at in np.linspace(t, piece.t[-1], 8)]
            t, state = piece.t[-1], piece.y[:, -1].copy()
            if piece.status == 1:
                moving, state[1] = False, 0.0
    return samples


@given(impacts(variant="stick_slip"))
def test_a_very_heavy_barrier_is_a_fixed_one(impact: Impact) -> None:
    fixed = replace(impact, barrier_mass=None, barrier_initial_velocity=0.0, vertical_load_ratio=0.0, arrival_time=0.0)
    heavy = replace(fixed, barrier_mass=1e12 * impact.flow_mass)
    assert heavy.peak_force == pytest.approx(fixed.peak_force, rel=1e-11)
    for share in (0.1, 0.5, 0.9, 1.5):
        t = share * fixed.impact_end_time
        assert heavy.flow_velocity(t) == pytest.approx(fixed.flow_velocity(t), abs=1e-10 * impact.speed)
        assert heavy.barrier_velocity(t) == pytest.approx(0, abs=1e-10 * impact.speed)


@given(impacts(variant="stick_slip", barrier_initial_velocity=0.0, arrival_time=0.0))
def test_rise_ratio_limits(impact: Impact) -> None:
    """tau -> 0: the force falls from the first instant; tau = 1: it rises to the last. Both are approached smoothly."""
    times = np.linspace(0.05, 0.95, 7) * impact.impact_end_time
    for limit, near in [(1e-12, 1e-9), (1.0, 1 - 1e-9)]:
        at, close = replace(impact, rise_ratio=limit), replace(impact, rise_ratio=near)
        for t in times:
            assert close.barrier_velocity(t) == pytest.approx(at.barrier_velocity(t), abs=1e-7 * impact.speed)
    falling = replace(impact, rise_ratio=1e-12)
    for t in times:
        expected = impact.peak_force * (1 - t / impact.impact_end_time)
        assert falling.force(t) == pytest.approx(expected, rel=1e-9)


@given(impacts(variant="stick_slip", arrival_time=0.0, slope=0.0))
def test_without_base_friction_the_two_bodies_end_with_one_velocity(impact: Impact) -> None:
    smooth = replace(impact, base_friction=0.0)
    end = smooth.impact_end_time
    assert smooth.barrier_velocity(end) == pytest.approx(smooth.common_velocity, abs=1e-9 * impact.speed)
    assert smooth.flow_velocity(end) == pytest.approx(smooth.common_velocity, abs=1e-9 * impact.speed)
    # Slight friction takes at most g tan (1 + kappa F / (m2 g)) T2 from the barrier's velocity.
    slight = replace(smooth, base_friction=1e-9)
    lost = 1e-9 * (impact.gravity * end + impact.vertical_load_ratio * impact.impulse / impact.barrier_mass)
    assert slight.barrier_velocity(end) == pytest.approx(smooth.common_velocity, abs=lost + 1e-9 * impact.speed)


@given(impacts(barrier_initial_velocity=0.0, variant="stick_slip", slope=0.0), st.floats(0.01, 0.999999))
def test_a_peak_below_the_friction_does_not_move_the_barrier(impact: Impact, share: float) -> None:
    force_on_mass = impact.peak_force / (impact.barrier_mass * impact.gravity)
    held = replace(impact, base_friction=force_on_mass / share, vertical_load_ratio=0.0)
    assert held.barrier_displacement_final == 0
    assert held.barrier_velocity_max == 0
    assert held.stop_time == held.arrival_time
    assert {phase.name for phase in held.phases} == {"approach", "stick", "rest"}


@given(impacts(variant="as_printed", vertical_load_ratio=0.0, arrival_time=0.0, slope=0.0), st.floats(0.0, 0.999))
def test_the_printed_formulas_to_the_letter(impact: Impact, share: float) -> None:
    m1, m2, v10, v20 = impact.flow_mass, impact.barrier_mass, impact.speed, impact.barrier_initial_velocity
    s, g, tan = impact.geometry_change_length, impact.gravity, impact.base_friction
    K1 = m1 * m2 / (m1 + m2) * (v10 - v20) / s
    q1 = 3 / 4 * K1 * (v10 - v20) / math.sqrt(s)  # Eq. (7)
    T2 = 8 / 3 * s / (v10 - v20)  # Eq. (8)
    T1 = impact.rise_ratio * T2  # Eq. (9)
    vcm = (m1 * v10 + m2 * v20) / (m1 + m2)  # Eq. (A17)
    t = share * T2
    stretched = t / impact.rise_ratio if t <= T1 else (T2 - t) / (1 - impact.rise_ratio)  # Eq. (A35)
    assert impact.force(t) == pytest.approx(q1**2 / (2 * K1) * stretched, rel=1e-8, abs=1e-8 * impact.peak_force)
    v1 = v10 - q1**2 / (4 * K1 * m1) * t**2  # Eq. (10)
    v2 = v20 - g * tan * t + q1**2 / (4 * K1 * m2) * t**2  # Eq. (12), q2^2 / K2 = q1^2 / K1
    x2 = v20 * t - g / 2 * tan * t**2 + q1**2 / (12 * K1 * m2) * t**3  # Eq. (14), v20 t as in Eq. (16)
    velocity, travel = v10 + g * tan * T2, v10 * T2 + g * tan * T2**2
    assert impact.flow_velocity(t) == pytest.approx(v1, abs=1e-9 * v10)
    assert impact.barrier_velocity(t) == pytest.approx(v2, abs=1e-9 * velocity)
    assert impact.barrier_displacement(t) == pytest.approx(x2, abs=1e-9 * travel)
    if tan > 0:
        later = T2 + 0.5 * vcm / (g * tan)
        assert impact.barrier_velocity(later) == pytest.approx(vcm / 2, rel=1e-7)  # Eq. (15)
        final = vcm**2 / (2 * g * tan) + v20 * T2 - g / 2 * tan * T2**2 + q1**2 / (12 * K1 * m2) * T2**3  # Eq. (16)
        assert impact.barrier_displacement_final == pytest.approx(final, rel=1e-9, abs=1e-9 * travel)
