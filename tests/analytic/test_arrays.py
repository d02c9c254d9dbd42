"""The array layer equals the scalar core, takes any shape, and loops over no element."""

import sys
from typing import Any

import numpy as np
import pytest

from analytic.arrays import outcomes, trajectory
from analytic.impact import VARIANTS, Impact

FIELDS = (
    "impulse",
    "peak_force",
    "peak_time",
    "impact_end_time",
    "common_velocity",
    "barrier_velocity_max",
    "barrier_velocity_at_impact_end",
    "stop_time",
    "barrier_displacement_final",
)


def random_inputs(count: int, seed: int) -> dict[str, np.ndarray]:
    draw = np.random.default_rng(seed)
    tan = np.where(draw.random(count) < 0.1, 0.0, 10 ** draw.uniform(-2.5, 0.3, count))
    mass = 10 ** draw.uniform(3, 7, count)
    return {
        "flow_mass": mass,
        "barrier_mass": np.where(draw.random(count) < 0.1, np.inf, mass * 10 ** draw.uniform(-2, 2, count)),
        "flow_length": 10 ** draw.uniform(0, 2.5, count),
        "speed": 10 ** draw.uniform(-0.5, 1.7, count),
        "base_friction": tan,
        "geometry_change": draw.uniform(0.01, 1, count),
        "rise_ratio": np.where(draw.random(count) < 0.1, 1.0, draw.uniform(0.01, 1, count)),
        "vertical_load_ratio": np.where(draw.random(count) < 0.5, 0.0, draw.uniform(0, 0.4, count)),
    }


@pytest.mark.parametrize("slope", [0.0, 5.0, -5.0])
@pytest.mark.parametrize("variant", VARIANTS)
def test_outcomes_equal_the_scalar_core(variant: str, slope: float) -> None:
    inputs = random_inputs(400, seed=3)
    if variant == "as_printed":
        inputs["vertical_load_ratio"] = np.zeros(400)
    if slope:
        inputs["base_friction"] = inputs["base_friction"] + 1.01 * np.tan(np.radians(5.0))
    found = outcomes(**inputs, variant=variant, slope=slope)
    for i in range(400):
        row: dict[str, Any] = {name: float(values[i]) for name, values in inputs.items()}
        impact = Impact(**row, flow_height=1.0, variant=variant, slope=slope)
        for name in FIELDS:
            value, expected = float(getattr(found, name)[i]), getattr(impact, name)
            # Velocities and displacements are differences; what the two orders of evaluation share is the scale.
            scale = row["speed"] * (1 if "velocity" in name else impact.duration if "displacement" in name else 0)
            if name == "stop_time" and value != pytest.approx(expected, rel=1e-9):
                # The stop of a barrier that barely moves: a square root magnifies rounding, the displacement does not.
                assert impact.barrier_displacement_final < 1e-9 * row["speed"] * impact.duration
                continue
            assert value == pytest.approx(expected, rel=1e-9, abs=1e-11 * scale), (name, row)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("barrier_mass", [None, 81000.0])
def test_trajectory_equals_the_scalar_core(variant: str, barrier_mass: float | None) -> None:
    impact = Impact(
        flow_mass=81000,
        barrier_mass=barrier_mass,
        flow_length=15,
        flow_height=3,
        speed=10,
        base_friction=0.29,
        geometry_change=0.41,
        rise_ratio=0.35,
        arrival_time=0.3,
        variant=variant,
    )
    knots = [impact.arrival_time + phase.start for phase in impact.phases]
    times = np.concatenate([np.linspace(-1, 5, 200), knots]).reshape(-1, 1)
    curves = trajectory(impact, times)
    assert curves.force.shape == times.shape
    for index, t in np.ndenumerate(times):
        assert curves.phase[index] == impact.phase(t)
        for name, value in [
            ("force", impact.force(t)),
            ("impulse", impact.impulse_until(t)),
            ("flow_velocity", impact.flow_velocity(t)),
            ("flow_displacement", impact.flow_displacement(t)),
            ("flow_kinetic_energy", impact.flow_kinetic_energy(t)),
            ("barrier_velocity", impact.barrier_velocity(t)),
            ("barrier_displacement", impact.barrier_displacement(t)),
            ("barrier_kinetic_energy", impact.barrier_kinetic_energy(t)),
        ]:
            assert getattr(curves, name)[index] == pytest.approx(value, rel=1e-12, abs=1e-9), (name, t)


def test_inputs_broadcast() -> None:
    found = outcomes(
        flow_mass=81000.0,
        barrier_mass=[[81000.0], [162000.0]],
        flow_length=15.0,
        speed=np.array([5.0, 10.0, 20.0]),
        base_friction=0.29,
        geometry_change=0.41,
        rise_ratio=0.35,
    )
    assert found.barrier_displacement_final.shape == (2, 3)
    assert found.impact_end_time.shape == (2, 3)
    assert found.barrier_displacement_final[0, 1] == pytest.approx(1.36484, rel=5e-6)


def test_a_thousand_take_as_many_calls_as_a_hundred() -> None:
    """What makes a million cheap: nothing is called once per element."""

    def calls(count: int) -> int:
        inputs, events = random_inputs(count, seed=5), []
        sys.setprofile(lambda frame, event, argument: events.append(event))
        try:
            outcomes(**inputs)
        finally:
            sys.setprofile(None)
        return len(events)

    assert calls(1000) == calls(100)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"flow_mass": [1e4, -2.0]}, r"flow_mass is -2, it must be a number in \(0, inf\) everywhere\."),
        ({"speed": np.nan}, r"speed is nan"),
        ({"rise_ratio": 1.5}, r"rise_ratio is 1\.5, it must be a number in \(0, 1\] everywhere"),
        ({"geometry_change": 0.0}, r"geometry_change is 0, "),
        ({"vertical_load_ratio": 10.0}, r"vertical_load_ratio times base_friction must be below 1"),
        ({"variant": "other"}, r"variant is 'other'"),
        ({"slope": 20.0}, r"base_friction is 0\.29, on a slope of 20 degrees it must be above 0\.364 everywhere"),
        ({"slope": -20.0}, r"base_friction is 0\.29, on a slope of -20 degrees it must be above 0\.364 everywhere"),
    ],
)
def test_bad_inputs_are_named(change: dict[str, Any], sentence: str) -> None:
    inputs: dict[str, Any] = {
        "flow_mass": 1e4,
        "barrier_mass": 1e4,
        "flow_length": 10.0,
        "speed": 5.0,
        "base_friction": 0.29,
        "geometry_change": 0.41,
        "rise_ratio": 0.35,
    }
    with pytest.raises(ValueError, match=sentence):
        outcomes(**(inputs | change))
