"""A run that leaves the range of sense is noticed within one output interval, and says when, where and what."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.hard_cases.measure import measure
from warp_mpm.results import Results
from warp_mpm.run import run_scenario
from warp_mpm.simulation import Simulation, SimulationDiverged


@pytest.fixture
def simulation(coarse_case_1):
    simulation = Simulation(coarse_case_1)
    simulation.advance(0.02)
    return simulation


def advance_and_sample(simulation, until):
    simulation.advance(until)
    simulation.sample()


def spoil(simulation, name, value, point=100):
    array = simulation._point_arrays[name]
    values = array.numpy()
    values[point] = value
    array.assign(values)


@pytest.mark.parametrize(
    ("name", "value", "quantity"),
    [
        ("velocity", np.nan, "the velocity"),
        ("velocity", np.inf, "the velocity"),
        ("velocity", 1e6, "the speed"),
        ("stress", np.nan, "the velocity"),  # the forces carry it to the velocities within the step
        ("stress", -np.inf, "the velocity"),
        ("liquid_strain", np.nan, "the pore pressure"),
        ("volume", np.nan, "the volume"),
    ],
)
def test_noticed_within_one_interval(simulation, name, value, quantity):
    spoil(simulation, name, value)
    with pytest.raises(SimulationDiverged, match=quantity) as caught:
        advance_and_sample(simulation, 0.025)
    sentence = str(caught.value)
    assert "diverged at t = 0.02" in sentence
    assert "near x = " in sentence
    assert "numerics.courant_number (now 0.95)" in sentence
    if value != 1e6:
        assert "near x = -1" in sentence
        assert simulation.record["points_left"] == 0  # it has not left the domain in silence


@pytest.mark.parametrize("component", range(4))
def test_a_sample_tells_of_any_velocity_that_is_no_number(simulation, component):
    """Of both phases, although the greatest speed passes over what is no number."""
    spoil(simulation, "velocity", np.where(np.arange(4) == component, np.nan, 1.0))
    with pytest.raises(SimulationDiverged, match="the velocity"):
        simulation.sample()


def test_a_barrier_at_any_speed_keeps_the_flow_on_the_grid(load_scene):
    """At 3 km/s the grid, which rides with the barrier, passes several of its cells in a step."""
    motion = {"kind": "prescribed", "times_s": [0.0, 0.02], "velocities_m_per_s": [0.0, 3000.0]}
    changes = {"numerics.spacing_m": 0.5, "barrier.motion": motion, "domain.left_m": -40.0, "domain.right_m": 40.0}
    changes["domain.top_m"] = 20.0  # the fitted ceiling is as high as such a blow can throw
    simulation = Simulation(load_scene("case_1", **changes))
    for time in np.linspace(0.01, 0.1, 10):
        simulation.advance(time)
        sample = simulation.sample()
        assert sample["solid_mass"] + sample["liquid_mass"] + sample["left_mass"] == pytest.approx(81_000, rel=1e-12)
        # Where the grid lies now, it holds all that is still there, with its splines' reach.
        x = simulation.points()["position"][:, 0] - simulation.grid.left - simulation.barrier_displacement
        assert ((x >= 0.5) & (x < 0.5 * (simulation.grid.columns - 1))).all()
    assert simulation.record["points_left"] == simulation.material_points


def test_a_state_goes_back_and_on_bit_for_bit(coarse_case_1, simulation):
    state = simulation.save_state()
    simulation.advance(0.5)
    expected = simulation.save_state()
    other = Simulation(coarse_case_1)
    for again in (other, simulation):
        again.restore_state(state)
        again.advance(0.5)
        assert again.save_state() == expected


@pytest.mark.parametrize(
    "changes",
    [
        {"flow.material.young_modulus_Pa": 3e6},
        {"flow.material.friction_angle_deg": 25.0},
        {"barrier.motion.base_friction": 0.5},
        {"gravity.tilt_deg": 1.0},
    ],
)
def test_another_scene_s_state_is_refused(coarse_case_1, simulation, changes):
    """Though its arrays are of the same sizes."""
    other = Simulation(coarse_case_1.replaced(changes))
    before = other.save_state()
    with pytest.raises(ValueError, match="it belongs to another scene"):
        other.restore_state(simulation.save_state())
    assert other.save_state() == before


def test_a_state_does_not_depend_on_what_is_recorded(coarse_case_1, simulation):
    other = Simulation(coarse_case_1.replaced({"title": "The same", "output.end_time_s": 9.0}))
    other.restore_state(simulation.save_state())
    assert other.save_state() == simulation.save_state()


def test_a_scene_without_barrier_has_no_place_of_it(load_scene, tmp_path):
    changes = {"barrier": None, "ground": None, "numerics.spacing_m": 1.0, "output.end_time_s": 0.01}
    scenario = load_scene("case_1", **changes)
    simulation = Simulation(scenario)
    assert (simulation.barrier_displacement, simulation.barrier_velocity) == (None, None)
    run_scenario(scenario, tmp_path / "run", make_simulation=Simulation)
    with Results.open(tmp_path / "run").snapshots as snapshots:
        assert [snapshot.barrier_displacement for snapshot in snapshots] == [None] * len(snapshots)


@pytest.mark.parametrize(
    "spoilt",
    [
        lambda state: state[:-1],
        lambda state: state + b"0",
        lambda state: b"",
        lambda state: state.replace(b"f8", b"f4"),
    ],
)
def test_a_spoilt_state_changes_nothing(simulation, spoilt):
    state = simulation.save_state()
    with pytest.raises(ValueError, match=r"the state (is damaged|does not fit this scenario)"):
        simulation.restore_state(spoilt(state))
    assert simulation.save_state() == state


def test_an_energy_without_end_stops_the_run(load_scene, tmp_path):
    """A liquid of 1 Pa under 29 kPa holds exp(15,000) of energy: no number, and no energy that was "lost"."""
    scenario = load_scene("case_1", **{"numerics.spacing_m": 0.75, "flow.material.liquid_bulk_modulus_Pa": 1.0})
    words = r"diverged at t = 0 s \(step 0\): flow_elastic_energy is inf\. Look at .*liquid_bulk_modulus_Pa = 1, beside"
    with pytest.raises(SimulationDiverged, match=words):
        Simulation(scenario).sample()
    path = tmp_path / "soft.json"
    path.write_text(json.dumps(scenario.resolved()))
    result = CliRunner().invoke(app, ["run", str(path), "--out", str(tmp_path / "run")])
    assert result.exit_code == 3
    assert json.loads((tmp_path / "run" / "run.json").read_text())["status"] == "failed"
    measured = measure(scenario)
    assert [criterion.figure for criterion, _ in measured.failures(scenario)] == ["diverged"]


def test_a_hard_case_that_does_not_bear_half_the_time_step_fails(coarse_case_1):
    """Its figures are those up to where it ended, which may well be alike."""
    scenario = coarse_case_1.replaced({"numerics.spacing_m": 0.75, "output.end_time_s": 0.6})

    class Brittle(Simulation):
        def advance(self, until, **stop):
            if self.scenario.numerics.courant_number < 0.5 and until > 0.5:
                raise SimulationDiverged("It broke.")
            super().advance(until, **stop)

    measured = measure(scenario, halve=True, make_simulation=Brittle)
    failed = [criterion.figure for criterion, _ in measured.failures(scenario)]
    assert {"halving_peak_force", "halving_displacement"} <= set(failed)
