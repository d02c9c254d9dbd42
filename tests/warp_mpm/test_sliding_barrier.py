"""The barrier's equation of motion: stick and slip, momentum, and its coupling with the flow."""

import json
from pathlib import Path

import numpy as np
import pytest

from warp_mpm.scenario import json_schema
from warp_mpm.simulation import Simulation

INTERVAL = 0.01


def scene(load_scene, name="case_1", motion=None, **changes):
    changes = {"numerics.spacing_m": 0.5, "output.end_time_s": 1.0} | changes
    if motion is not None:
        changes["barrier.motion"] = {"kind": "sliding"} | motion
    return load_scene(name, **changes)


def history(simulation, until=1.0):
    """Samples every INTERVAL, as arrays by name."""
    samples = []
    for time in INTERVAL * np.arange(1, round(until / INTERVAL) + 1):
        simulation.advance(time)
        samples.append(simulation.sample())
    return {name: np.array([sample[name] for sample in samples]) for name in samples[0]}


@pytest.mark.parametrize("mass", [81.0, 72_000.0])
def test_momentum_of_the_barrier_is_what_flow_and_base_gave_it(load_scene, mass):
    """Also for a barrier of a thousandth of the flow's mass, which an explicit coupling would throw out of sight."""
    friction = 0.29
    simulation = Simulation(scene(load_scene, motion={"mass_kg_per_m": mass, "base_friction": friction}))
    told = history(simulation)
    push = told["impact_force_x"] + told["top_force_x"] + told["back_force_x"]
    gained = np.cumsum(push - told["base_force"]) * INTERVAL
    received = np.cumsum(np.abs(push)) * INTERVAL
    assert received[-1] > 0.0
    assert np.abs(mass * told["barrier_velocity"] - gained).max() < 1e-9 * received[-1]
    # Coulomb: while it slides through a whole interval, friction is tan delta times the normal force.
    limit = friction * told["base_normal_force"]
    assert (told["base_force"] <= limit * (1.0 + 1e-9) + 1e-6).all()
    moving = np.minimum(told["barrier_velocity"], np.roll(told["barrier_velocity"], 1))[1:] > 0.1
    assert moving.sum() > 20
    np.testing.assert_allclose(told["base_force"][1:][moving], limit[1:][moving], rtol=1e-9)
    # Stable: no faster than the flow that pushes it and slides down its face, and each step's equation was solved.
    assert told["barrier_velocity"].max() < told["speed_max"].max() / np.sin(np.radians(59.7))
    assert told["barrier_velocity"].min() >= 0.0
    assert simulation.record["barrier_unconverged"] == 0
    assert np.abs(told["momentum_residual_x"]).max() < 1e-9 * 810_000.0


def test_a_jump_of_the_flows_impulse_is_closed_in_on(load_scene):
    """At 1.235 s a node is let go at the very velocity at which the barrier's balance turns."""
    simulation = Simulation(load_scene("set_iib"))
    for record in range(1, 249):
        simulation.advance(0.005 * record)
    assert simulation.record["barrier_unconverged"] == 0


def test_a_light_barrier_goes_with_the_flow(load_scene):
    """A thousandth of the flow's mass on a smooth base does not hold it up. It takes the speed of the flow's fastest
    part, which on an inclined face is more the steeper that comes down: v_x - v_y cot(beta) <= |v| / sin(beta)."""
    simulation = Simulation(scene(load_scene, motion={"mass_kg_per_m": 81.0, "base_friction": 0.0}))
    told = history(simulation)
    mean = told["momentum_x"] / 81_000.0
    assert told["barrier_velocity"][-1] > mean[-1] > 0.98 * 10.0
    assert told["barrier_velocity"].max() < told["speed_max"].max() / np.sin(np.radians(59.7))
    assert told["barrier_displacement"][-1] > 4.0


def test_base_friction_stops_it_and_never_pulls_it_back(load_scene):
    simulation = Simulation(
        scene(load_scene, motion={"mass_kg_per_m": 72_000.0, "base_friction": 0.4}, **{"output.end_time_s": 3.0})
    )
    told = history(simulation, until=3.0)
    assert told["barrier_velocity"].max() > 0.3
    assert told["barrier_velocity"].min() >= 0.0
    assert (np.diff(told["barrier_displacement"]) >= 0.0).all()
    assert told["barrier_velocity"][-1] == 0.0  # at rest, not creeping
    assert told["base_friction_work"][-1] >= 0.0


def test_stick_and_slip_without_the_flow(load_scene):
    """Pulled from outside before the flow arrives: held up to tan delta W, then m a = F - tan delta W, exactly."""
    mass, friction = 50_000.0, 0.4
    limit = friction * mass * 9.81
    changes = {"flow.velocity_m_per_s": [-1.0, 0.0], "motion": {"mass_kg_per_m": mass, "base_friction": friction}}
    simulation = Simulation(scene(load_scene, **changes))
    for force in (0.99 * limit, -0.99 * limit):
        simulation.set_external_force(force)
        simulation.advance(simulation.time + 0.05)
        assert simulation.barrier_velocity == 0.0
        assert simulation.sample()["base_force"] == pytest.approx(force, rel=1e-12)
    simulation.set_external_force(1.5 * limit)
    simulation.advance(simulation.time + 0.1)
    assert simulation.barrier_velocity == pytest.approx(0.5 * limit / mass * 0.1, rel=1e-11)
    assert simulation.barrier_displacement == pytest.approx(0.25 * limit / mass * 0.01, rel=1e-11)
    simulation.set_external_force(0.0)
    simulation.advance(simulation.time + 0.1)
    # Friction alone: it takes half as long to stop, and does not turn round.
    assert simulation.barrier_velocity == 0.0
    # The last step, in which it stops, moves it by at most half of that step's travel too far or too short.
    stopped = 0.25 * limit / mass * 0.01 + 0.5 * (0.05 * limit / mass) ** 2 / (limit / mass)
    assert simulation.barrier_displacement == pytest.approx(stopped, rel=0.02)


def test_endless_mass_is_a_fixed_barrier(load_scene):
    """On a base without friction, so that its inertia alone holds it."""
    heavy = Simulation(scene(load_scene, motion={"mass_kg_per_m": 1e15, "base_friction": 0.0}))
    fixed = Simulation(scene(load_scene, "case_1_fixed"))
    told, expected = history(heavy), history(fixed)
    peak = expected["impact_force_x"].max()
    # It moves at J / m = 5e-10 m/s; the flow answers in proportion, amplified by its own sensitivity.
    np.testing.assert_allclose(told["impact_force_x"], expected["impact_force_x"], atol=1e-7 * peak)
    np.testing.assert_allclose(heavy.points()["position"], fixed.points()["position"], atol=1e-7)


def test_what_base_friction_holds_is_a_fixed_barrier(load_scene):
    held = Simulation(scene(load_scene, motion={"mass_kg_per_m": 1e9, "base_friction": 1.0}))
    fixed = Simulation(scene(load_scene, "case_1_fixed"))
    for simulation in (held, fixed):
        simulation.advance(1.0)
    assert held.barrier_displacement == 0.0
    np.testing.assert_allclose(held.points()["position"], fixed.points()["position"], atol=1e-8)  # two compiled codes


@pytest.mark.parametrize("force", [float("nan"), float("inf"), -float("inf"), 1e300, -1.1e15])
def test_a_force_that_is_none_is_refused(load_scene, force):
    """A spring law that divides 0 by 0 would hold the barrier still, in silence."""
    simulation = Simulation(scene(load_scene))
    with pytest.raises(ValueError, match=r"force = \S+ is not allowed; it must be a number from -1e\+15 to 1e\+15 N/m"):
        simulation.set_external_force(force)
    simulation.set_external_force(np.float32(1e5))
    simulation.advance(0.01)
    assert np.isfinite(simulation.sample()["base_force"])


@pytest.mark.parametrize("velocity", [float("nan"), float("inf"), 1e300, -10_001.0])
def test_a_velocity_that_is_none_is_refused(load_scene, velocity):
    driven = {"kind": "prescribed", "times_s": [0.0], "velocities_m_per_s": [0.0]}
    simulation = Simulation(load_scene("case_1", **{"numerics.spacing_m": 0.75, "barrier.motion": driven}))
    with pytest.raises(ValueError, match=r"velocity = \S+ is not allowed; it must be a number from -10000 to 10000 m"):
        simulation.set_barrier_velocity(velocity)


def test_on_a_slope_that_falls_upstream_its_weight_pulls_it_there(load_scene):
    """Far from the flow, with a = g (sin theta - tan delta cos theta)."""
    changes = {"gravity.tilt_deg": -30.0, "flow.shape.distance_m": 60.0, "flow.velocity_m_per_s": [0.0, 0.0]}
    simulation = Simulation(scene(load_scene, motion={"mass_kg_per_m": 9e4, "base_friction": 0.29}, **changes))
    simulation.advance(0.2)
    pull = 9.81 * (np.sin(np.radians(30.0)) - 0.29 * np.cos(np.radians(30.0)))
    assert simulation.barrier_velocity == pytest.approx(-0.2 * pull, rel=1e-9)
    assert simulation.barrier_displacement == pytest.approx(-0.02 * pull, rel=1e-9)


def test_schema_and_page_say_so():
    description = json.loads(json_schema())["$defs"]["Sliding"]["description"]
    assert "to either side" in description
    assert "upstream where the ground falls that way" in " ".join(description.split())
    page = (Path(__file__).parents[2] / "docs" / "how_to" / "barriers.md").read_text()
    assert "barrier slides upstream, and its displacement is negative" in " ".join(page.split())
