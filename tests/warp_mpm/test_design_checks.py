"""The verdict on a barrier: worked by hand, for a block whose loads are known."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.design_checks import CHECKS, GUIDELINES, TOLD, verdict, verdict_rows
from warp_mpm.results import Results
from warp_mpm.run import run_scenario
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.simulation import Simulation
from warp_mpm.terminal import summary_rows

PAGE = Path(__file__).parents[2] / "docs/how_to/design_checks.md"
G = 9.81
WEIGHT = 2400.0 * 8.0 * G
"""Of a trapezoid of 3 m, 1 m and 4 m, of concrete [N/m]."""


def block(load_scene, tilt=0.0, **design):
    return load_scene(
        "case_1_fixed",
        **{
            "gravity.tilt_deg": tilt,
            "barrier.shape": {"kind": "trapezoid", "base_width_m": 3.0, "crest_width_m": 1.0, "height_m": 4.0},
            "design": {"density_kg_per_m3": 2400.0, "base_friction": 0.5} | design,
        },
    )


def constant(*, push=50e3, press=10e3, height=1.2, place=0.3, time=None):
    """A flow that pushes and presses evenly, at a height and a place on the face."""
    time = np.linspace(0.0, 2.0, 401) if time is None else time
    moment = push * height - press * (3.0 - place)
    values = {
        "impact_force_x": push, "impact_force_y": -press, "back_force_x": 0.0, "back_force_y": 0.0, "top_force": 0.0,
        "top_force_y": 0.0, "heel_moment": moment, "impact_force_height": height, "run_up": 3.2,
    }  # fmt: skip
    return {"time": time} | {name: np.full(len(time), value) for name, value in values.items()}


FIGURES = {"barrier_displacement_final": 0.0, "overtopped_volume": 2.2, "left_volume": 1.1, "run_up_max": 3.2,
           "run_up_max_time": 0.7, "residual_force": 20e3}  # fmt: skip


def answers(scenario, series, figures=FIGURES):
    found = verdict(scenario, series, figures)
    return {check["name"]: check for check in found["checks"]}, found


def test_a_block_by_hand(load_scene):
    checks, found = answers(block(load_scene), constant())
    normal, overturning = WEIGHT + 10e3, 50e3 * 1.2 - 10e3 * 2.7
    assert checks["sliding_factor"]["value"] == pytest.approx(0.5 * normal / 50e3)
    assert checks["overturning_factor"]["value"] == pytest.approx(WEIGHT * 1.5 / overturning)
    eccentricity = 1.5 - (WEIGHT * 1.5 - overturning) / normal
    assert checks["eccentricity_of_base"]["value"] == pytest.approx(eccentricity / 3.0)
    assert checks["base_pressure"]["value"] == pytest.approx(normal / 3.0 * (1.0 + 6.0 * eccentricity / 3.0))
    volume = block(load_scene).flow.volume
    assert checks["overtopped_share"]["value"] == pytest.approx(3.3 / volume)  # with what left the domain
    assert checks["freeboard"]["value"] == pytest.approx(0.8)
    assert checks["freeboard"]["time"] == 0.7
    assert found["holds"] is None  # no limit is given
    assert all(check["holds"] is None for check in checks.values())


def test_outside_the_kern_the_base_is_pressed_in_part(load_scene):
    checks, _ = answers(block(load_scene), constant(push=80e3, press=0.0, height=2.0))
    from_heel = (WEIGHT * 1.5 - 160e3) / WEIGHT
    assert 0.0 < from_heel < 1.0
    assert checks["base_pressure"]["value"] == pytest.approx(2.0 * WEIGHT / (3.0 * from_heel))
    assert checks["eccentricity_of_base"]["value"] == pytest.approx(0.5 - from_heel / 3.0)


def test_a_block_that_turns_over_has_no_base_pressure(load_scene):
    scenario = block(load_scene, bearing_resistance_Pa=1e9, eccentricity_of_base=0.33, overturning_factor=1.0)
    checks, found = answers(scenario, constant(push=200e3, press=0.0, height=2.0))
    assert checks["overturning_factor"]["value"] == pytest.approx(WEIGHT * 1.5 / 400e3)
    assert checks["base_pressure"]["value"] is None
    assert [checks[name]["holds"] for name in ("overturning_factor", "eccentricity_of_base", "base_pressure")] == [
        False,
        False,
        False,
    ]
    assert found["holds"] is False
    assert dict(verdict_rows(found))["  greatest base pressure"].startswith("without end")


def test_the_weight_pulls_on_a_slope(load_scene):
    checks, _ = answers(block(load_scene, tilt=8.0), constant())
    down, along = WEIGHT * math.cos(math.radians(8.0)), WEIGHT * math.sin(math.radians(8.0))
    assert checks["sliding_factor"]["value"] == pytest.approx(0.5 * (down + 10e3) / (50e3 + along))
    middle = 4.0 / 3.0 * (3.0 + 2.0) / (3.0 + 1.0)
    overturning = 50e3 * 1.2 - 10e3 * 2.7 + along * middle
    assert checks["overturning_factor"]["value"] == pytest.approx(down * 1.5 / overturning)


def test_partial_factors(load_scene):
    scenario = block(load_scene, load_factor=1.5, base_friction_factor=1.25, bearing_factor=1.4,
                     bearing_resistance_Pa=1.4e5)  # fmt: skip
    checks, found = answers(scenario, constant())
    assert checks["sliding_factor"]["value"] == pytest.approx(0.4 * (WEIGHT + 15e3) / 75e3)
    assert checks["overturning_factor"]["value"] == pytest.approx(WEIGHT * 1.5 / (1.5 * 33e3))
    assert checks["base_pressure"]["limit"] == pytest.approx(1e5)
    assert found["holds"] is (checks["base_pressure"]["value"] <= 1e5)


def test_the_worst_time_counts_as_a_moving_mean(load_scene):
    series = constant()
    peak = np.exp(-(((series["time"] - 1.0) / 0.3) ** 2))
    for name in ("impact_force_x", "impact_force_y", "heel_moment"):
        series[name] = series[name] * peak
    checks, _ = answers(block(load_scene), series)
    assert checks["sliding_factor"]["time"] == pytest.approx(1.0)
    assert checks["sliding_factor"]["value"] == pytest.approx(0.5 * (WEIGHT + 10e3) / 50e3, rel=0.005)
    alone = constant()
    alone["impact_force_x"] = np.where(series["time"] == 1.0, 1e6, 0.0)  # one sample of 5 ms in 50 ms
    checks, _ = answers(block(load_scene), alone)
    assert checks["sliding_factor"]["value"] == pytest.approx(0.5 * (WEIGHT + 10e3) / 1e5, rel=1e-6)


def test_without_a_load_nothing_slides_or_turns(load_scene):
    scenario = block(load_scene, sliding_factor=1.5, overturning_factor=1.5)
    checks, found = answers(scenario, constant(push=0.0, press=0.0))
    assert checks["sliding_factor"] | {"formula": ""} == {
        "name": "sliding_factor", "value": None, "time": None, "limit": 1.5, "holds": True, "formula": ""
    }  # fmt: skip
    assert found["holds"] is True
    assert dict(verdict_rows(found))["  sliding, factor of safety"] == "no load; at least 1.5: holds"


@pytest.mark.parametrize(
    ("limits", "holds"),
    [
        ({"displacement_m": 0.5, "sliding_factor": 1.5, "freeboard_m": 0.79}, True),
        ({"displacement_m": 0.5, "sliding_factor": 2.5}, False),
        ({"freeboard_m": 0.9}, False),
        ({"overtopped_volume_m3_per_m": 3.0}, False),
        ({"overtopped_volume_m3_per_m": 3.4}, True),
        ({"eccentricity_of_base": 0.01}, False),
    ],
)
def test_limits_are_judged(load_scene, limits, holds):
    _, found = answers(block(load_scene, **limits), constant())
    assert found["holds"] is holds


def test_a_barrier_that_still_slides_keeps_no_limit_yet(load_scene):
    scenario = block(load_scene, displacement_m=0.5)
    for moved, holds in ((0.3, None), (0.6, False)):
        figures = FIGURES | {"barrier_displacement_final": moved, "barrier_at_rest": False}
        checks, found = answers(scenario, constant(), figures)
        assert checks["displacement"]["holds"] is found["holds"] is holds
        assert "not final" in found["remarks"][0]
    assert dict(verdict_rows(answers(scenario, constant())[1]))["verdict"] == "holds"


def test_what_cannot_be_judged_is_said(load_scene):
    wall = load_scene("case_5", design={"sliding_factor": 1.5, "displacement_m": 1.0})
    found = verdict(wall, constant(), FIGURES)
    assert found["holds"] is None
    unstable = "A wall without end that does not slide has neither weight nor base: its stability is not judged."
    assert unstable in found["remarks"]
    assert any(remark.startswith("sliding, factor of safety: not known") for remark in found["remarks"])
    weightless = load_scene("case_1_fixed", design={"overturning_factor": 1.5})
    assert "design.density_kg_per_m3 is needed" in verdict(weightless, constant(), FIGURES)["remarks"][0]
    series = {name: values for name, values in constant().items() if name != "heel_moment"}
    assert "not known without heel_moment" in answers(block(load_scene), series)[1]["remarks"][0]
    assert verdict(load_scene("case_1"), constant(), FIGURES) is None


def test_a_wall_without_end_that_slides(load_scene):
    """By its mass it slides or not; nothing gets over it, whatever left the domain elsewhere."""
    scenario = load_scene(
        "case_5",
        **{
            "gravity.tilt_deg": 5.0,
            "barrier.motion": {"kind": "sliding", "mass_kg_per_m": 90e3, "base_friction": 0.5},
            "design": {"sliding_factor": 1.2, "overtopped_share": 0.0, "freeboard_m": 1.0, "load_factor": 1.5},
        },
    )
    series = {name: values for name, values in constant().items() if name in ("time", "impact_force_x", "run_up")}
    series["impact_force_y"] = np.full(len(series["time"]), -10e3)
    checks, found = answers(scenario, series)
    weight = 90e3 * G
    down, along = weight * math.cos(math.radians(5.0)), weight * math.sin(math.radians(5.0))
    assert checks["sliding_factor"]["value"] == pytest.approx(0.5 * (down + 15e3) / (75e3 + along))
    assert checks["sliding_factor"]["holds"] is True
    assert checks["overtopped_share"] == checks["overtopped_share"] | {"value": 0.0, "holds": True}
    assert checks["freeboard"]["holds"] is True
    assert "overturning_factor" not in checks
    assert found["holds"] is True
    rows = dict(verdict_rows(found))
    assert rows["  freeboard"].startswith("no crest to reach")
    assert "only its sliding is judged" in rows["  remark"]


def test_a_speed_whose_square_is_nothing_is_judged(load_scene):
    slow = block(load_scene).replaced({"flow.velocity_m_per_s": [1e-200, 0.0]})
    told = {entry["name"]: entry["value"] for entry in verdict(slow, constant(), FIGURES)["told"]}
    assert 0.0 < told["landing_distance"] < 1e-199


def of_second(series):
    """The same loads on the second barrier."""
    names = {"impact_force_x": "face_force_x", "impact_force_y": "face_force_y", "top_force": "top_force_x",
             "impact_force_height": "face_force_height", "run_up": "face_run_up"}  # fmt: skip
    return {f"second_{names.get(name, name)}": values for name, values in series.items() if name != "time"}


def test_further_barriers_are_judged_as_the_first_is(load_scene):
    """The same block under the same loads, as the first barrier and as a further one; the whole holds where both do."""
    limits = {"bearing_resistance_Pa": 3e5, "freeboard_m": 0.5, "overturning_factor": 1.5, "overtopped_share": 0.3}
    alone = block(load_scene, **limits)
    both = alone.replaced(
        {"barriers": [alone.resolved()["barrier"] | {"name": "second", "x_m": 20.0}],
         "barrier.shape.base_width_m": 9.0, "barrier.shape.crest_width_m": 8.0}
    )  # fmt: skip
    rows = {"barriers": [{"name": "barrier"}, {"name": "second", "passed_volume": 2.2}]}
    loads = constant()
    series = loads | of_second(loads)
    series["impact_force_x"] = 1e-3 * loads["impact_force_x"]
    expected, single = answers(alone, loads)
    checks, found = answers(both, series, FIGURES | rows)
    (second,) = found["barriers"]
    assert (second["name"], single["holds"], found["holds"]) == ("second", True, True)
    assert {check["name"]: check for check in second["checks"]} == {
        name: check | {"time": pytest.approx(check["time"]) if name != "freeboard" else 0.0}
        for name, check in expected.items()
    }
    assert checks["sliding_factor"]["value"] != pytest.approx(expected["sliding_factor"]["value"])
    told = {entry["name"]: entry["value"] for entry in second["told"]}
    assert told == pytest.approx({"static_load": 50e3, "static_load_height": 1.2,
                                  "hydrostatic_load": 0.5 * 1800.0 * G * 3.2**2})  # fmt: skip
    said = dict(verdict_rows(found))
    assert said["  second: overturning, factor of safety"].endswith("; at least 1.5: holds")
    assert said["  second: static load that stays"] == "50 kN/m"
    # The further one alone turns over.
    series["second_heel_moment"] = 10.0 * loads["heel_moment"]
    _, found = answers(both, series, FIGURES | rows)
    assert found["holds"] is False
    del series["second_heel_moment"]
    remarks = answers(both, series, FIGURES | rows)[1]["remarks"]
    assert "Barrier second: The barrier's stability is not known without second_heel_moment." in remarks


def test_a_further_barrier_that_slides_is_judged_by_its_own_mass_and_friction(load_scene):
    scenario = load_scene(
        "site_two_barriers", design={"displacement_m": 0.5, "load_factor": 1.5, "base_friction_factor": 1.25}
    )
    series = constant() | of_second(constant(push=40e3, press=-20e3))
    weight = 2000.0 * 10.5 * G
    for slid, still, holds in ((0.4, True, True), (0.7, True, False), (0.4, False, None)):
        series["second_barrier_displacement"] = np.linspace(0.0, slid, 401)
        series["second_barrier_velocity"] = np.append(np.zeros(400), 0.0 if still else 0.1)
        found = verdict(scenario, series, FIGURES)
        (second,) = found["barriers"]
        checks = {check["name"]: check for check in second["checks"]}
        assert (second["name"], found["holds"]) == ("second", holds)
        assert checks["displacement"] == checks["displacement"] | {"value": slid, "limit": 0.5, "holds": holds}
        assert checks["sliding_factor"]["value"] == pytest.approx(0.4 / 1.25 * (weight - 30e3) / 60e3)
        assert checks["sliding_factor"]["holds"] is None
        told = {True: "holds", False: "FAILS", None: "not known yet"}[holds]
        assert dict(verdict_rows(found))["  second: displacement"] == f"{slid} m; at most 0.5 m: {told}"
    assert "barriers" not in verdict(block(load_scene), constant(), FIGURES)


def test_a_boulder_is_superposed(load_scene):
    scenario = block(load_scene, boulder={"radius_m": 0.5, "speed_m_per_s": 8.0, "width_m": 6.0, "height_m": 2.0})
    checks, found = answers(scenario, constant())
    force = 0.1 * 4000e3 * 8.0**1.2 * 0.25
    told = {entry["name"]: entry["value"] for entry in found["told"]}
    assert told["boulder_force"] == pytest.approx(force)
    assert checks["sliding_factor"]["value"] == pytest.approx(0.5 * (WEIGHT + 10e3) / (50e3 + force / 6.0))
    assert checks["overturning_factor"]["value"] == pytest.approx(WEIGHT * 1.5 / (33e3 + force / 6.0 * 2.0))
    assert "not simulated" in TOLD["boulder_force"].meaning


def test_figures_beside_the_checks(load_scene):
    scenario = block(load_scene, guidelines=["hong_kong", "japan", "china"])
    _, found = answers(scenario, constant())
    told = {entry["name"]: entry["value"] for entry in found["told"]}
    assert told["static_load"] == 20e3
    assert told["static_load_height"] == pytest.approx(1.2)
    assert told["hydrostatic_load"] == pytest.approx(0.5 * 1800.0 * G * 3.2**2)
    assert told["energy_head"] == pytest.approx(3.0 + 100.0 / (2.0 * G))
    ratio, froude = told["reflected_depth"] / 3.0, 10.0 / math.sqrt(3.0 * G)
    assert (ratio - 1.0) ** 2 * (ratio + 1.0) == pytest.approx(2.0 * froude**2 * ratio)
    # On level ground a horizontal throw from 4 m.
    assert told["landing_distance"] == pytest.approx(10.0 * math.sqrt(2.0 * 4.0 / G))
    thrusts = {entry["name"]: entry["value"] for entry in found["guidelines"]}
    square = 1800.0 * 100.0 * 3.0
    assert thrusts == pytest.approx(
        {"hong_kong": 2.5 * square, "japan": square, "china": 1.33 * square * math.sin(math.atan(4.0))}
    )


def test_recalled_guidelines_are_off_unless_named(load_scene):
    assert answers(block(load_scene), constant())[1]["guidelines"] == []
    for guideline in GUIDELINES.values():
        assert "recalled" in guideline.formula


@pytest.mark.parametrize(
    ("design", "words"),
    [
        ({"displacement": 0.5}, "did you mean displacement_m?"),
        ({"load_factor": 0.0}, "design.load_factor = 0"),
        ({"guidelines": ["bavaria"]}, "design.guidelines"),
        ({"guidelines": ["japan", "japan"]}, "there twice"),
        ({"boulder": {"radius_m": 1.0}}, "design.boulder.width_m"),
    ],
)
def test_slips_in_the_design_group_are_told(load_scene, design, words):
    with pytest.raises(ScenarioError) as told:
        block(load_scene, **design)
    assert words in str(told.value)


def test_a_design_needs_a_barrier(load_scene):
    with pytest.raises(ScenarioError, match="design needs a barrier"):
        load_scene("case_1", barrier=None, design={})


def test_the_page_has_every_formula_with_its_source():
    text = PAGE.read_text()
    rows = re.findall(r"^\| (`.+)\|$", text, flags=re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[0])}
    assert {*CHECKS, *TOLD, *GUIDELINES} <= named
    assert "not simulated" in text
    for name in GUIDELINES:
        assert "recalled" in next(row for row in rows if f"`{name}`" in row.split("|")[0])


def test_the_verdict_of_a_run(tmp_path):
    """The page's own scene, coarser and shorter."""
    content = json.loads(PAGE.read_text().partition('title="checked.json"\n')[2].partition("```")[0])
    content["numerics"]["spacing_m"], content["output"]["end_time_s"] = 0.55, 0.6
    (tmp_path / "checked.json").write_text(json.dumps(content))
    answer = CliRunner().invoke(app, ["run", str(tmp_path / "checked.json"), "--out", str(tmp_path / "run")])
    assert answer.exit_code == 0, answer.output
    results = Results.open(tmp_path / "run")
    found = results.summary["verdict"]
    rows = summary_rows(results.summary)
    assert ("verdict", "does NOT hold") in rows
    assert rows[-len(verdict_rows(found)) :] == verdict_rows(found)
    assert "does NOT hold" in answer.output
    values = {check["name"]: check for check in found["checks"]}
    assert values["displacement"]["value"] == results.summary["barrier_displacement_final"]
    # A barrier that slides has a factor below one while it is pushed.
    assert values["sliding_factor"]["value"] < 1.0
    assert values["overtopped_share"]["limit"] == 0.2
    assert [entry["name"] for entry in found["guidelines"]] == ["hong_kong"]


def test_a_design_does_not_change_the_run(load_scene, tmp_path):
    coarse = {"numerics.spacing_m": 0.75, "output.end_time_s": 0.4}
    for name, design in (("plain", None), ("checked", {"displacement_m": 0.5})):
        scenario = load_scene("case_1", **coarse, design=design)
        run_scenario(scenario, tmp_path / name, make_simulation=Simulation)
    plain, checked = (Results.open(tmp_path / name) for name in ("plain", "checked"))
    assert (plain.path / "timeseries.csv").read_bytes() == (checked.path / "timeseries.csv").read_bytes()
    assert plain.summary["verdict"] is None
