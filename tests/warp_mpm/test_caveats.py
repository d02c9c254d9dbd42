"""What a reader is told before he trusts a scene or its figures; and that a sound scene calls for no remark."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from warp_mpm.caveats import impact_goes_on, run_caveats, scene_caveats
from warp_mpm.cli import app
from warp_mpm.commands.several import _print as print_several
from warp_mpm.commands.sweep import _print as print_sweep
from warp_mpm.effect_rules import with_law
from warp_mpm.report.content import run_content
from warp_mpm.results import Results
from warp_mpm.run import run_scenario
from warp_mpm.scenario import Scenario
from warp_mpm.terminal import displacement, sliding_distance

SCENES = sorted((Path(__file__).parents[2] / "scenarios").glob("*.json"))
FINISHED = {"status": "finished", "effects": {"precision": "float64"}}


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_shipped_scenes_call_for_no_remark(path):
    assert scene_caveats(Scenario.load(path)) == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"flow.velocity_m_per_s": [-15.0, 0.0]}, "does not get to the barrier by t = 6 s; look at flow.velocity"),
        ({"flow.shape.distance_m": 300.0}, "does not get to the barrier"),
        ({"output.end_time_s": 0.01, "flow.shape.distance_m": 5.0}, "by t = 0.01 s"),
        ({"gravity.tilt_deg": -60.0, "flow.shape.distance_m": 100.0}, "does not get to the barrier"),
        ({"flow.material.grain_density_kg_per_m3": 2.65}, "grain_density_kg_per_m3 = 2.65 is lighter than water"),
        ({"flow.lateral_stress_coefficient": 10}, "outside the yield surface: flow.lateral_stress_coefficient = 10"),
        ({"flow.lateral_stress_coefficient": 0.48}, "the law mohr_coulomb bears 0.49 to 2.04"),
        ({"flow.lateral_stress_coefficient": 0.0}, "outside the yield surface"),
        ({"flow.material.friction_angle_deg": 0.0}, "bears 1 to 1"),
        ({"flow.material.grain_density_kg_per_m3": 1000.0, "flow.material.liquid_density_kg_per_m3": 1100.0},
         "is lighter than its liquid (flow.material.liquid_density_kg_per_m3 = 1100): the skeleton starts in tension"),
        ({"flow.material.liquid_bulk_modulus_Pa": 1.0}, "liquid_bulk_modulus_Pa = 1 is too soft for the pressure of"),
        ({"flow.material.young_modulus_Pa": 1e5}, "young_modulus_Pa = 100000 is too soft for the effective stress of"),
        ({"barrier.friction": {"face": 0.3, "top": 2.5, "back": 0.3}}, "barrier.friction.top = 2.5: a friction coeff"),
        ({"ground.friction": 3.0}, "ground.friction = 3: a friction coefficient above 2, up to 72°; rock has"),
        ({"barrier.motion.base_friction": 9.0}, "barrier.motion.base_friction = 9"),
        ({"barrier.motion": {"kind": "prescribed", "times_s": [0.0], "velocities_m_per_s": [30.0]}},
         "does not get to the barrier by t = 6 s; look at flow.velocity_m_per_s, the flow's distance, barrier.motion"),
        ({"barrier.motion": {"kind": "prescribed", "times_s": [0.0], "velocities_m_per_s": [-1.0]},
          "flow.velocity_m_per_s": [-15.0, 0.0]}, "does not get to the barrier"),
        ({"numerics.spacing_m": 1.5}, "The flow's depth has 2 cells; below 4 (numerics.spacing_m = 0.75)"),
    ],
)  # fmt: skip
def test_a_slip_is_told(load_scene, changes, words):
    found = scene_caveats(load_scene("case_1", **changes))
    assert [words in sentence for sentence in found].count(True) == 1, found


@pytest.mark.parametrize(
    "changes",
    [
        {"flow.velocity_m_per_s": [0.0, 0.0]},  # spreads as a dam break does
        # Comes back down the slope.
        {"flow.velocity_m_per_s": [-2.0, 0.0], "gravity.tilt_deg": 30.0, "ground.friction": 0.1},
        {"barrier.motion": {"kind": "prescribed", "times_s": [0.0], "velocities_m_per_s": [-20.0]},
         "flow.velocity_m_per_s": [-15.0, 0.0]},  # a barrier that runs after the flow
        {"barrier.motion": {"kind": "prescribed", "times_s": [0.0, 2.0], "velocities_m_per_s": [30.0, 0.0]}},
        # The barrier slides down to a flow that stays where it is, held by the ground.
        {"gravity.tilt_deg": -30.0, "flow.shape.distance_m": 40.0, "flow.velocity_m_per_s": [0.0, 0.0],
         "ground.friction": 1.0},
        {"flow.lateral_stress_coefficient": 10, "flow.initial_stress": "zero"},
        {"flow.lateral_stress_coefficient": 3, "flow.material.cohesion_Pa": 1e5},
        {"flow.material.friction_angle_deg": 0.0, "flow.lateral_stress_coefficient": None},
        {"ground.friction": 2.0},
        {"numerics.spacing_m": 0.5},
    ],
)  # fmt: skip
def test_what_may_be_meant_is_not_called_a_slip(load_scene, changes):
    about_the_domain = "numerics.spacing_m = 0.2"
    found = scene_caveats(load_scene("case_1", **changes))
    assert [sentence for sentence in found if about_the_domain not in sentence] == []


def test_an_elastic_skeleton_bears_any_lateral_stress(load_scene):
    pressed = load_scene("case_1", **{"flow.lateral_stress_coefficient": 10})
    assert len(scene_caveats(pressed)) == 1
    assert scene_caveats(pressed.replaced(with_law(pressed, "elastic"))) == []


def test_a_barrier_that_still_slides_has_no_final_displacement():
    summary = {"barrier_displacement_final": 0.1602, "barrier_at_rest": False, "barrier_velocity_final": 0.55}
    assert displacement(summary) == "0.160 m, still sliding at 0.55 m/s"
    assert sliding_distance(summary) == "≥ 0.1602"
    assert "still slides at 0.55 m/s" in run_caveats(FINISHED, summary)[0]
    stands = summary | {"barrier_at_rest": True, "barrier_velocity_final": 0.0}
    assert displacement(stands) == "0.160 m"
    assert sliding_distance(stands) == "0.1602"
    assert run_caveats(FINISHED, stands) == []
    assert displacement({"barrier_displacement_final": None}) is None
    assert sliding_distance({}) == "–"


def test_an_impact_that_goes_on_or_never_came_is_told():
    assert impact_goes_on({"peak_force": 1e5, "impact_end_time": None})
    assert "impact is not over" in run_caveats(FINISHED, {"peak_force": 1e5, "impact_end_time": None})[0]
    assert run_caveats(FINISHED, {"peak_force": 1e5, "impact_end_time": 3.0}) == []
    assert run_caveats(FINISHED, {"peak_force": 0.0, "impact_end_time": None}) == [
        "The flow did not touch the barrier."
    ]


def test_a_barrier_that_slid_upstream_is_told():
    summary = {"barrier_displacement_final": -1.22, "barrier_at_rest": True, "barrier_velocity_final": 0.0}
    assert run_caveats(FINISHED, summary) == [
        "The barrier slid upstream, by 1.22 m: displacement and velocity are negative."
    ]
    driven = {"barrier_displacement_final": -1.22, "barrier_at_rest": None}
    assert run_caveats(FINISHED, driven) == []


def test_notes_are_the_same_wherever_they_are_told(load_scene, flying_points, tmp_path, capsys):
    """By `check` and `run`, in summary.json, in the report, and under the table of several runs and of a sweep."""
    scenario = load_scene("case_1", **{"numerics.spacing_m": 1.0, "output.end_time_s": 0.7})
    told = scene_caveats(scenario)
    assert len(told) == 1
    (tmp_path / "scene.json").write_text(json.dumps(scenario.resolved()))
    checked = CliRunner().invoke(app, ["check", str(tmp_path / "scene.json")])
    assert f"Note: {told[0]}" in checked.output
    outcome = run_scenario(scenario, tmp_path / "run", make_simulation=flying_points)
    results = Results.open(tmp_path / "run")
    after = run_caveats(results.record, results.summary)
    assert any("still rises" in sentence for sentence in after)
    assert outcome.summary["notes"] == results.summary["notes"] == [*told, *after]
    warnings = run_content(results, "run")["warnings"]
    assert set(outcome.summary["notes"]) <= set(warnings)
    print_several({"a": outcome.summary, "b": outcome.summary})
    assert f"Note, a, b: {told[0]}" in capsys.readouterr().out
    row = {"case": 0, "status": "finished", "numerics.spacing_m": 1.0}
    print_sweep([row, row | {"case": 1}], ["numerics.spacing_m"], {0: told, 1: []})
    assert f"Note, case 0: {told[0]}" in capsys.readouterr().out


def test_errors_of_the_ledger_are_held_against_the_precision():
    summary = {"momentum_error": 1e-5}
    assert "momentum_error = 1e-05" in run_caveats(FINISHED, summary)[0]
    assert run_caveats({"status": "finished", "effects": {"precision": "float32"}}, summary) == []
