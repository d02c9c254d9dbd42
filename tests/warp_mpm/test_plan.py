"""The run card: what it says of effects, size and time is what the run then does."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.discretization import material_points
from warp_mpm.performance.plan import Ahead, growth, make_plan, predicted_steps, run_ahead, what_if
from warp_mpm.recording import SnapshotRecorder, TimeSeriesRecorder, record_until
from warp_mpm.simulation import Simulation
from warp_mpm.time_step import step_limits


@pytest.fixture
def scene(load_scene):
    return load_scene("case_1", **{"numerics.spacing_m": 0.25, "output.end_time_s": 1.5})


def test_predictions_hold(scene, tmp_path):
    """Steps within 10 %. How well the time is foretold is not tested: what else the machine does would decide it."""
    card = make_plan(scene)
    simulation = Simulation(scene)
    output = scene.output
    recorders = [
        TimeSeriesRecorder(tmp_path / "series.csv", output.time_series_interval_s),
        SnapshotRecorder(tmp_path / "snapshots.vtkhdf", output.snapshot_interval_s, output.end_time_s),
    ]
    assert simulation.launched_kernels == tuple(card.kernels)
    record_until(simulation, recorders, output.end_time_s)
    assert card.steps == pytest.approx(simulation.steps, rel=0.1)
    stepping = 1e-9 * card.step_cost * card.material_points * card.steps
    assert card.wall_time == pytest.approx(stepping + card.recording_time)
    assert 0.0 < card.recording_time < card.wall_time
    assert card.material_points == simulation.material_points
    assert card.arrays == simulation.arrays
    assert sum(card.kernels.values()) == pytest.approx(card.step_cost)
    assert card.limit == "wave"


def test_steps_land_on_the_records(load_scene):
    """Where a record is due before the step that the limits allow has passed, the records rule."""
    scene = load_scene("case_1", **{"output.time_series_interval_s": 2e-4, "output.end_time_s": 0.1})
    assert predicted_steps(scene, [Ahead(0.0, 10.0, 1.0)]) == 500
    rare = load_scene("case_1", **{"output.time_series_interval_s": 0.1, "output.snapshot_interval_s": 0.1})
    step = 0.95 * 0.2 / (step_limits(rare).wave_speed + 10.0)
    assert predicted_steps(rare, [Ahead(0.0, 10.0, 1.0)]) == 60 * math.ceil(0.1 / step)


def test_the_twin_sees_the_jet(scene):
    ahead = run_ahead(scene)
    assert (ahead[0].begin, ahead[0].speed) == (pytest.approx(0.0, abs=1e-5), 10.0)
    assert ahead[-1].begin == pytest.approx(1.5 * 199 / 200)
    assert max(stretch.speed for stretch in ahead) > 12.0  # squeezed out of the corner between face and flow


def test_dearer_steps_count(load_scene):
    """Steps that cost twice as much from half time on: half as much again in the mean, twice after the first half."""
    scene = load_scene("case_1", **{"output.end_time_s": 2.0})
    ahead = [Ahead(0.0, 10.0, 1e-4), Ahead(0.5, 10.0, 1e-4), Ahead(1.0, 10.0, 2e-4)]
    assert growth(scene, ahead, until=0.7) == pytest.approx(1.5, rel=0.01)
    assert growth(scene, ahead[:1], until=0.7) == pytest.approx(1.0)
    assert growth(scene, ahead, until=2.0) == pytest.approx(1.5 / (4 / 3), rel=0.01)


def test_what_if_switches_one_effect_at_a_time(load_scene, monkeypatch):
    """Only two effects here, whose kernels other tests compile too."""
    from warp_mpm.performance import plan

    rules = [rule for rule in plan.effect_rules(load_scene("case_1")) if rule.effect in ("drag", "inertial_drag")]
    of_scene = plan.effect_rules
    monkeypatch.setattr(
        plan, "effect_rules", lambda scenario: [r for r in of_scene(scenario) if r.effect in ("drag", "inertial_drag")]
    )
    assert len(rules) == 2
    scene = load_scene(
        "case_1", **{"barrier": None, "ground": None, "numerics.spacing_m": 0.5, "output.end_time_s": 0.5}
    )
    base, drag, inertial = what_if(scene)
    assert (base.effect, drag.effect, inertial.effect) == ("as it is", "drag", "inertial_drag")
    assert drag.change == "semi-implicit → explicit"
    assert inertial.change == "off → on"
    assert drag.steps > 20 * base.steps
    assert inertial.steps == base.steps


def test_what_if_tells_the_cost_of_every_law(load_scene, monkeypatch):
    """By stand-ins that step nothing: a compilation each is much."""
    from warp_mpm.performance import plan

    stepped = []

    class Standing:
        def __init__(self, scenario, **_):
            stepped.append(scenario)
            self.simulation = SimpleNamespace(material_points=100)

    monkeypatch.setattr(plan, "Stepper", Standing)
    monkeypatch.setattr(plan, "in_turns", lambda steppers, **_: [float(100 + k) for k in range(len(steppers))])
    monkeypatch.setattr(plan, "run_ahead", lambda scenario, **_: [Ahead(0.0, 10.0, 1e-4)])
    laws = {}
    for name in ("case_1", "case_1_loose", "site_two_surges"):
        switches = what_if(load_scene(name, **{"numerics.spacing_m": 0.5, "output.end_time_s": 0.5}))
        laws[name] = [switch.change for switch in switches if switch.effect == "law"]
    assert laws["case_1"] == [
        f"mohr-coulomb → {law}" for law in ("elastic", "herschel-bulkley", "coulomb-viscous", "mu-i")
    ]
    assert laws["case_1_loose"] == laws["site_two_surges"] == laws["case_1"]
    muddy = next(one for one in stepped if one.flow.deposits and one.flow.material.law == "herschel_bulkley")
    assert "friction_angle_deg" not in (muddy.flow.deposits[0].material or {})
    # The deposit starts with the stress that its own law had given it.
    sandy = next(one for one in stepped if one.flow.deposits)
    np.testing.assert_allclose(
        material_points(muddy).effective_stress, material_points(sandy).effective_stress, rtol=1e-12
    )


def test_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    from pathlib import Path

    file = str(Path(__file__).parents[2] / "scenarios" / "case_1_dry.json")
    runner = CliRunner()
    shown = runner.invoke(app, ["plan", file, "--spacing", "0.5", "--until", "0.2"])
    assert shown.exit_code == 0, shown.output
    for words in (
        "flow.formulation = dry",
        "there is no liquid",
        "flow.material.law = mohr_coulomb",
        "points.stress",
        "set by the wave limit",
    ):
        assert words in shown.output
    told = json.loads(runner.invoke(app, ["plan", file, "--spacing", "0.5", "--until", "0.2", "--json"]).output)
    assert told["material_points"] == 732
    assert told["wall_time"] > 0.0
    assert not list(tmp_path.iterdir())
    refused = runner.invoke(app, ["plan", file, "--spacing", "-1"])
    assert refused.exit_code == 2
    assert "--spacing = -1" in refused.output
    nowhere = runner.invoke(app, ["plan", file, "--device", "cuda:7"])
    assert nowhere.exit_code == 2
    assert "cuda:7" in nowhere.output


def test_a_run_of_few_snapshots_has_a_card(load_scene):
    """More snapshots are timed than the run itself has."""
    scenario = load_scene("case_1", **{"numerics.spacing_m": 1.0, "output.end_time_s": 0.1})
    assert make_plan(scenario.replaced({"output.snapshot_interval_s": 0.1})).recording_time > 0.0
