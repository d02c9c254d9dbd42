"""What a reader is told before he trusts a scene or its figures; and that a sound scene calls for no remark."""

from pathlib import Path

import pytest

from warp_mpm.caveats import impact_goes_on, run_caveats, scene_caveats
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
        ({"numerics.spacing_m": 1.5}, "The flow's depth has 2 cells; below 4 (numerics.spacing_m = 0.75)"),
    ],
)
def test_a_slip_is_told(load_scene, changes, words):
    found = scene_caveats(load_scene("case_1", **changes))
    assert [words in sentence for sentence in found].count(True) == 1, found


@pytest.mark.parametrize(
    "changes",
    [
        {"flow.velocity_m_per_s": [0.0, 0.0]},  # spreads as a dam break does
        {"flow.velocity_m_per_s": [-2.0, 0.0], "gravity.tilt_deg": 30.0},  # comes back down the slope
        {"barrier.motion": {"kind": "prescribed", "times_s": [0.0], "velocities_m_per_s": [-1.0]},
         "flow.velocity_m_per_s": [-15.0, 0.0]},
        {"numerics.spacing_m": 0.5},
    ],
)  # fmt: skip
def test_what_may_be_meant_is_not_called_a_slip(load_scene, changes):
    assert scene_caveats(load_scene("case_1", **changes)) == []


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


def test_errors_of_the_ledger_are_held_against_the_precision():
    summary = {"momentum_error": 1e-5}
    assert "momentum_error = 1e-05" in run_caveats(FINISHED, summary)[0]
    assert run_caveats({"status": "finished", "effects": {"precision": "float32"}}, summary) == []
