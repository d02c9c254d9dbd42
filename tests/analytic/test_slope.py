"""A barrier on a slope: the closed form against the simulator's rigid barrier, by hand, and on the command line."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from analytic.arrays import trajectory
from analytic.cli import app
from analytic.fitted import calibrated_impact, coefficients
from analytic.impact import Impact
from analytic.scene import Scene
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation

CASE_1 = Path(__file__).parents[2] / "scenarios" / "case_1.json"
MASS, FRICTION = 90_000.0, 0.4


def impact(slope: float, **changes: Any) -> Impact:
    inputs: dict[str, Any] = {
        "flow_mass": 81_000.0,
        "barrier_mass": MASS,
        "flow_length": 15.0,
        "flow_height": 3.0,
        "speed": 10.0,
        "base_friction": FRICTION,
        "s1max": 2.0,
        "rise_ratio": 0.35,
        "slope": slope,
    }
    return Impact(**(inputs | changes))


def test_by_hand() -> None:
    """A slope of 3 in 4, on which 0.8 of the weight presses and 0.6 pulls."""
    slope = math.degrees(math.atan(0.75))
    found = impact(slope, base_friction=1.0)
    assert found.friction == pytest.approx(MASS * 9.81 * (1.0 * 0.8 - 0.6))
    uphill = impact(-slope, base_friction=1.0)
    assert uphill.friction == pytest.approx(MASS * 9.81 * (1.0 * 0.8 + 0.6))
    # After the impact it slides on with 0.2 g of deceleration.
    left = found.barrier_velocity_at_impact_end
    assert left > 0
    assert found.stop_time == pytest.approx(found.impact_end_time + left / (0.2 * 9.81))
    # The load that the flow brings along acts with tan(delta_b), not with what the slope leaves of it.
    loaded = impact(slope, base_friction=1.0, vertical_load_ratio=0.5)
    assert loaded.threshold_force == pytest.approx(found.friction / (1 - 0.5 * 1.0))


@pytest.mark.parametrize("slope", [15.0, *(pytest.param(slope, marks=pytest.mark.slow) for slope in (0.0, -8.0))])
def test_moves_as_the_simulator_s_rigid_barrier_under_the_same_force(slope: float) -> None:
    """The force comes from outside, as the triangle's mean over each interval, while the flow is sent away."""
    content = json.loads(CASE_1.read_text())
    content["gravity"]["tilt_deg"] = slope
    content["flow"]["velocity_m_per_s"] = [-100.0, 0.0]
    content["barrier"]["motion"] = {"kind": "sliding", "mass_kg_per_m": MASS, "base_friction": FRICTION}
    scenario = Scenario.model_validate(content).replaced({"numerics.spacing_m": 1.0})
    simulation = Simulation(scenario)
    found = impact(slope)
    interval = 0.01
    times = interval * np.arange(1, round(1.1 * (found.stop_time + 0.1) / interval))
    curves = trajectory(found, times)
    pushes = np.diff(np.array([0.0, *(found.impulse_until(t) for t in times)])) / interval
    moved, velocity = [], []
    for time, push in zip(times, pushes, strict=True):
        simulation.set_external_force(float(push))
        simulation.advance(float(time))
        moved.append(simulation.barrier_displacement)
        velocity.append(simulation.barrier_velocity)
    assert simulation.sample()["impact_force_x"] == 0.0  # the flow took no part
    scene = Scene(flow_mass=1.0, flow_length=1.0, flow_height=1.0, speed=1.0, barrier_mass=MASS, slope=slope)
    assert simulation.sample()["base_normal_force"] == pytest.approx(scene.weight_on_base)
    assert max(velocity) > 1
    assert velocity[-1] == 0
    # It starts, turns and stops within an interval, in which the simulator sees the mean force.
    assert np.array(velocity) == pytest.approx(curves.barrier_velocity, abs=0.01 * found.barrier_velocity_max)
    assert np.array(moved) == pytest.approx(curves.barrier_displacement, abs=0.005 * found.barrier_displacement_final)


@pytest.mark.parametrize("slope", [22.0, -22.0])
def test_a_barrier_that_slides_by_its_own_weight_is_refused(slope: float) -> None:
    with pytest.raises(ValueError, match=r"base_friction is 0\.4, on a slope of -?22 degrees it must be above 0\.404"):
        impact(slope)
    assert impact(slope, barrier_mass=None).barrier_displacement_final == 0
    with pytest.raises(ValueError, match=r"slope is 90, it must be a number in \(-90, 90\) degrees"):
        impact(90)


def test_the_calibrated_variant_keeps_its_peak_force_on_a_slope() -> None:
    """lambda and tau are chosen through the impulse of momentum_closed, which knows the slope."""
    flow: dict[str, Any] = {"flow_mass": 81e3, "flow_length": 15.0, "flow_height": 3.0, "speed": 10.0}
    level = Scene(**flow, barrier_mass=MASS, base_friction=0.29, face_angle=60.0)
    tilted = replace(level, slope=5.0)
    assert coefficients(tilted) != coefficients(level)
    assert calibrated_impact(tilted).peak_force == pytest.approx(calibrated_impact(level).peak_force, rel=1e-9)
    assert calibrated_impact(tilted).barrier_displacement_final > calibrated_impact(level).barrier_displacement_final


# --- command line ----------------------------------------------------------------------------------------------------


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def answer(*arguments: str) -> Any:
    result = call(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


@pytest.fixture
def tilted(tmp_path: Path) -> Any:
    def write(slope: float, ground_friction: float = 0.0) -> str:
        content = json.loads(CASE_1.read_text())
        content["gravity"]["tilt_deg"] = slope
        content["ground"]["friction"] = ground_friction
        path = tmp_path / f"tilted_{slope:g}.json"
        path.write_text(json.dumps(content))
        return str(path)

    return write


def test_all_commands_take_the_slope_and_say_what_they_leave_out(tilted: Any) -> None:
    path = tilted(5, ground_friction=0.3)
    predicted = answer("predict", path)
    compared = answer("compare", path)["tilted_5"]
    designed = answer("design", path, "--limit", "1")
    for found in (predicted, compared, designed):
        assert "The friction between flow and ground is left out." in found["notes"]
        assert any("the flow's is left out, 69.3 kN/m" in note for note in found["notes"])
    for command in (["predict", path], ["compare", path], ["design", path, "--limit", "1"]):
        text = call(*command).stdout
        assert "the flow's is left out, 69.3 kN/m" in text
        assert "The friction between flow and ground is left out." in text
    moved = predicted["barrier_displacement_final"]
    assert compared["stick_slip"]["barrier_displacement_final"] == moved
    assert moved > 2 * answer("predict", str(CASE_1))["barrier_displacement_final"]
    assert answer("predict", str(CASE_1), "--slope", "5")["barrier_displacement_final"] == pytest.approx(moved)
    again = answer("predict", path, "--barrier-mass", repr(designed["mass"]))
    assert again["barrier_displacement_final"] == pytest.approx(1, rel=1e-6)
    assert designed["mass"] > 1.3 * answer("design", str(CASE_1), "--limit", "1")["mass"]


def test_a_slope_beyond_the_friction_angle_is_refused_in_one_sentence(tilted: Any) -> None:
    path = tilted(20)
    for command in (["predict", path], ["compare", path], ["design", path, "--limit", "1"]):
        result = call(*command)
        assert (result.exit_code, result.stdout) == (2, "")
        assert "on a slope of 20 degrees it must be above 0.364" in result.stderr
        assert len(result.stderr.strip().splitlines()) == 1
    assert answer("predict", path, "--fixed")["barrier_displacement_final"] == 0


def test_an_uncertain_design_takes_the_slope(tilted: Any) -> None:
    options = ["--limit", "1", "--speed", "lognormal(10, 0.2)", "--samples", "20000"]
    level, steep = (answer("design", tilted(slope), *options)["mass"] for slope in (0, 5))
    assert steep > 1.3 * level
    safe = [*options, "--probability", "0.1"]
    assert answer("design", tilted(5), *safe)["mass"] > 1.3 * answer("design", tilted(0), *safe)["mass"]
    # Samples of the friction in which the barrier would not rest are not cut off in silence.
    loose = call("design", tilted(5), *options, "--base-friction", "uniform(0.05, 0.3)", "--barrier-mass", "90000")
    assert loose.exit_code == 2
    assert "on a slope of 5 degrees it must be above 0.08749 everywhere" in loose.stderr


def test_design_says_where_a_flow_at_rest_would_push_the_barrier_on(tilted: Any) -> None:
    path = tilted(14)
    light = answer("design", path, "--limit", "50")
    assert light["base_resistance"] < 81e3 * 9.81 * math.sin(math.radians(14))
    assert any("pushes the barrier on for ever" in note for note in light["notes"])
    heavy = answer("design", tilted(5), "--limit", "1")
    assert heavy["base_resistance"] == pytest.approx(
        heavy["mass"] * 9.81 * (0.29 * math.cos(math.radians(5)) - math.sin(math.radians(5)))
    )
    assert not any("for ever" in note for note in heavy["notes"])
