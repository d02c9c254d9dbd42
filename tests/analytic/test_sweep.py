"""From planned scenes to fitted constants: scenes that can be run, a fit that finds what made a table."""

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from analytic import fitted, sweep, sweep_fit
from analytic.arrays import trajectory
from analytic.cli import app
from analytic.fitted import CONSTANTS, Constants, calibrated_impact, coefficients
from analytic.impact import Impact
from analytic.scene import Scene, read_scene, scene_of
from warp_mpm.scenario import Scenario

ROOT = Path(__file__).parents[2]
TEMPLATE = json.loads((ROOT / "scenarios" / "set_i.json").read_text())
TABLE = ROOT / "docs" / "data" / "sweep.csv"
PLAN = sweep.plan(TEMPLATE, 64)

SLIDING = Constants(
    jet=1.3, weight=0.7, mass_exponent=0.25, rise=0.3, rise_length_exponent=0.5, rise_angle_exponent=-0.9
)
FIXED = replace(SLIDING, mass_exponent=0.0)


# --- plan ------------------------------------------------------------------------------------------------------------


def test_every_planned_scene_is_a_scenario_within_the_ranges() -> None:
    fixed = 0
    for content in PLAN.values():
        scene = scene_of(Scenario.model_validate(content))
        fixed += scene.fixed
        low, high = sweep.RANGES["froude_number"]
        assert low * 0.999 <= scene.froude_number <= high * 1.001
        assert scene.porosity is not None
        assert scene.barrier_height is not None
        assert 1.24 <= scene.barrier_height / scene.flow_height <= 4.01
        if scene.barrier_mass is not None:
            assert 0.49 <= scene.barrier_mass / scene.flow_mass <= 3.01
        assert fitted.beyond_fit(scene) == []
    assert fixed == pytest.approx(sweep.FIXED_SHARE * 64, abs=3)


def test_the_plan_fills_its_ranges_evenly() -> None:
    scenes = [scene_of(Scenario.model_validate(content)) for content in PLAN.values()]
    for values, (low, high) in [
        ([math.log(scene.froude_number) for scene in scenes], map(math.log, sweep.RANGES["froude_number"])),
        ([scene.face_angle for scene in scenes], sweep.RANGES["face_angle"]),
    ]:
        counts, _ = np.histogram(np.array(values, dtype=float), bins=8, range=(low, high))
        assert counts.min() >= 6  # 64 scenes in 8 bins


def test_a_plan_can_be_repeated() -> None:
    assert sweep.plan(TEMPLATE, 8, seed=3) == sweep.plan(TEMPLATE, 8, seed=3)
    assert sweep.plan(TEMPLATE, 8, seed=3) != sweep.plan(TEMPLATE, 8, seed=4)
    with pytest.raises(ValueError, match="count is 0, it must be at least 1"):
        sweep.plan(TEMPLATE, 0)


# --- the fitted rule -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("barrier_mass", [None, 60000.0, 160000.0])
@pytest.mark.parametrize("rise_share", [0.1, 1.0])
def test_peak_force_and_its_time_are_those_of_the_formulas(barrier_mass: float | None, rise_share: float) -> None:
    """lambda and tau are chosen through the impulse of momentum_closed, which Impact finds on its own."""
    scene = Scene(
        flow_mass=81000.0,
        flow_length=15.0,
        flow_height=3.0,
        speed=10.0,
        face_angle=70.0,
        barrier_mass=barrier_mass,
        base_friction=None if barrier_mass is None else 0.3,
    )
    at = replace(CONSTANTS["fixed" if scene.fixed else "sliding"], rise=rise_share * 0.3)
    impact = calibrated_impact(scene, **coefficients(scene, at).model)
    turned, share = 1 - math.cos(math.radians(70)), 1.0 if barrier_mass is None else 1 / (1 + 81000 / barrier_mass)
    pressure = (at.jet * turned + at.weight / scene.froude_number**2) * share**at.mass_exponent
    assert impact.peak_force / (1800 * 3 * 10**2) == pytest.approx(pressure, rel=1e-9)
    rise = at.rise * 5**at.rise_length_exponent * turned**at.rise_angle_exponent
    assert impact.peak_time * 10 / 3 == pytest.approx(rise, rel=1e-9)
    assert impact.vertical_load_ratio == (0 if barrier_mass is None else pytest.approx(1 / math.tan(math.radians(70))))


def test_a_vertical_face_bears_no_vertical_load_and_a_flat_one_keeps_below_locking() -> None:
    scene = Scene(
        flow_mass=81000.0,
        flow_length=15.0,
        flow_height=3.0,
        speed=10.0,
        barrier_mass=81000.0,
        base_friction=0.5,
        face_angle=90.0,
    )
    assert coefficients(scene).vertical_load_ratio == 0
    assert coefficients(replace(scene, face_angle=60.0)).vertical_load_ratio == pytest.approx(1 / math.sqrt(3))
    flat = coefficients(replace(scene, face_angle=5.0))
    assert flat.vertical_load_ratio * 0.5 < 1
    assert flat.geometry_change == 1
    assert calibrated_impact(replace(scene, face_angle=5.0)).barrier_displacement_final >= 0


def test_the_calibrated_variant_needs_the_face_angle() -> None:
    scene = Scene(flow_mass=81000.0, flow_length=15.0, flow_height=3.0, speed=10.0)
    with pytest.raises(ValueError, match="face_angle is None, the calibrated variant needs"):
        coefficients(scene)


def test_what_lies_beyond_the_fit_is_said() -> None:
    wall = read_scene(ROOT / "scenarios" / "case_5.json")
    assert fitted.beyond_fit(wall) == ["H/h = inf is outside the fitted range 1.25 to 4."]
    slow = replace(wall, speed=1.0)
    assert fitted.beyond_fit(slow)[0].startswith("Fr = 0.184 is outside")


# --- table and fit ---------------------------------------------------------------------------------------------------


def made_up(name: str, content: dict[str, Any]) -> sweep.Run:
    """A row as if the closed form with known constants were the truth."""
    scene = scene_of(Scenario.model_validate(content))
    impact = calibrated_impact(scene, **coefficients(scene, FIXED if scene.fixed else SLIDING).model)
    return sweep.Run(
        name=name,
        fixed=scene.fixed,
        flow_mass=scene.flow_mass,
        flow_length=scene.flow_length,
        flow_height=scene.flow_height,
        speed=scene.speed,
        porosity=scene.porosity or math.nan,
        face_angle=scene.face_angle or math.nan,
        barrier_height=scene.barrier_height or math.nan,
        barrier_mass=scene.barrier_mass or math.nan,
        base_friction=scene.base_friction or math.nan,
        peak_force=impact.peak_force,
        rise_time=impact.peak_time,
        duration=impact.duration,
        impulse=impact.impulse,
        vertical_load_ratio=math.nan if scene.fixed else impact.vertical_load_ratio,
        barrier_displacement_final=math.nan if scene.fixed else impact.barrier_displacement_final,
        barrier_velocity_max=math.nan if scene.fixed else impact.barrier_velocity_max,
        at_rest=True,
    )


MADE_UP = [made_up(name, content) for name, content in PLAN.items()]


@pytest.mark.parametrize(("fixed", "constants"), [(True, FIXED), (False, SLIDING)], ids=["fixed", "sliding"])
def test_the_fit_finds_the_constants_that_made_the_table(fixed: bool, constants: Constants) -> None:
    # lambda and tau are cut off at 1 in some scenes, whose peak forces and times do not tell the constants.
    runs = [run for run in sweep_fit.usable(MADE_UP, fixed) if _inside(coefficients(run.scene, constants))]
    found = sweep_fit.fit(runs)
    for name, value in vars(constants).items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-3), name
    held_out = sweep_fit.score(runs, sweep_fit.cross_validated(runs))
    assert held_out.peak_force_median < 1e-3
    paper = sweep_fit.score(runs, [sweep_fit.paper_rule(run.scene) for run in runs])
    assert paper.peak_force_median > 0.1
    if not fixed:
        assert held_out.within_two == 1
        assert held_out.displacement_factor == pytest.approx(1, abs=1e-2)
        assert paper.displacement_factor > 1.5


def test_standard_errors_are_those_of_linear_least_squares(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rise time is fitted linearly in its logarithm, where the standard errors are known."""
    random, noise = np.random.default_rng(1), 0.2
    runs = [
        replace(run, rise_time=run.rise_time * math.exp(random.normal(0, noise)))
        for run in sweep_fit.usable(MADE_UP, fixed=False)
    ]
    columns = [
        (1.0, math.log(run.flow_length / run.flow_height), math.log(1 - math.cos(math.radians(run.face_angle))))
        for run in runs
    ]
    matrix = np.array(columns)
    expected = noise * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    found = sweep_fit.standard_errors(runs)
    assert found.rise == pytest.approx(sweep_fit.fit(runs).rise * expected[0], rel=0.3)
    assert found.rise_length_exponent == pytest.approx(expected[1], rel=0.3)
    assert found.rise_angle_exponent == pytest.approx(expected[2], rel=0.3)
    monkeypatch.setattr(sweep_fit, "RESAMPLES", 20)
    assert sweep_fit.standard_errors(runs) == sweep_fit.standard_errors(runs)
    assert sweep_fit.standard_errors(sweep_fit.usable(MADE_UP, fixed=True)).mass_exponent == 0


def test_the_scatter_of_the_vertical_load_is_about_the_rule() -> None:
    runs = [run for run in sweep_fit.usable(MADE_UP, fixed=False) if _inside(coefficients(run.scene, SLIDING))]
    scatter, spread = sweep_fit.vertical_load_scatter(runs)
    assert scatter == pytest.approx(0, abs=1e-9)
    assert spread > 0.1
    raised = [replace(run, vertical_load_ratio=run.vertical_load_ratio + 0.1) for run in runs]
    assert sweep_fit.vertical_load_scatter(raised) == pytest.approx((0.1, spread))


def _inside(numbers: fitted.Coefficients) -> bool:
    return numbers.geometry_change < 1 and numbers.rise_ratio < 1


def test_cross_validation_predicts_no_run_with_constants_it_was_fitted_to(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = sweep_fit.usable(MADE_UP, fixed=True)
    fitted_to: list[set[str]] = []

    def fake_fit(some: list[sweep.Run]) -> Constants:
        fitted_to.append({run.name for run in some})
        return FIXED

    monkeypatch.setattr(sweep_fit, "fit", fake_fit)
    sweep_fit.cross_validated(runs)
    assert len(fitted_to) == sweep_fit.FOLDS
    left_out = [{run.name for run in runs} - names for names in fitted_to]
    assert set.union(*left_out) == {run.name for run in runs}
    assert sum(map(len, left_out)) == len(runs)


def test_a_table_reads_back(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    sweep.write_table(MADE_UP, path, "made up")
    again = sweep.read_table(path)
    assert len(again) == len(MADE_UP)
    for one, other in zip(again, MADE_UP, strict=True):
        for name, value in vars(other).items():
            expected = pytest.approx(value, rel=1e-5, nan_ok=True) if isinstance(value, float) else value
            assert getattr(one, name) == expected
    path.write_text("a,b\n1,2\n")
    with pytest.raises(ValueError, match=r"table\.csv is no table of a sweep"):
        sweep.read_table(path)
    with pytest.raises(ValueError, match="cannot be read"):
        sweep.read_table(tmp_path / "none.csv")


@pytest.fixture
def recorded(tmp_path: Path) -> tuple[Path, Scene, Impact]:
    """A run folder whose history the closed form made, the scene it shows and the impact."""
    name, content = next(
        (name, content) for name, content in PLAN.items() if content["barrier"]["motion"]["kind"] == "sliding"
    )
    scene = scene_of(Scenario.model_validate(content))
    impact = calibrated_impact(scene, arrival_time=0.2)
    time = np.arange(0, 1.2 * impact.phases[-1].start, 0.002)
    curves = trajectory(impact, time)
    force = np.concatenate([[0.0], np.diff(curves.impulse) / 0.002])
    weight = (scene.barrier_mass or 0.0) * 9.81
    folder = tmp_path / name
    folder.mkdir()
    (folder / "scenario.json").write_text(json.dumps(content))
    table = np.column_stack(
        [time, force, weight + impact.vertical_load_ratio * force, curves.barrier_velocity, curves.barrier_displacement]
    )
    header = "time [s],impact_force_x [N/m],base_normal_force [N/m],barrier_velocity [m/s],barrier_displacement [m]"
    np.savetxt(folder / "timeseries.csv", table, delimiter=",", header=header, comments="")
    return folder, scene, impact


def cut(folder: Path, end: float) -> None:
    """End the record of a run folder at ``end`` [s]."""
    header, *rows = (folder / "timeseries.csv").read_text().splitlines()
    kept = [row for row in rows if float(row.split(",")[0]) <= end]
    (folder / "timeseries.csv").write_text("\n".join([header, *kept]) + "\n")


def test_a_record_that_ends_before_the_impact_is_left_out(recorded: tuple[Path, Scene, Impact], tmp_path: Path) -> None:
    folder, _, impact = recorded
    cut(folder, impact.arrival_time + 0.6 * impact.duration)
    with pytest.raises(ValueError, match=rf"{folder.name}: the impact is not over at the end of the record"):
        sweep.collect(folder)
    found = CliRunner().invoke(app, ["sweep", "collect", str(folder), "--out", str(tmp_path / "table.csv")])
    assert found.exit_code == 2
    assert f"Left out: {folder}: the impact is not over" in found.stderr


def test_a_barrier_that_still_moves_is_marked_and_not_fitted(
    recorded: tuple[Path, Scene, Impact], tmp_path: Path
) -> None:
    folder, _, _ = recorded
    series = folder / "timeseries.csv"
    header, *rows = series.read_text().splitlines()
    last = rows[-1].split(",")
    last[3] = "0.1"  # its velocity
    series.write_text("\n".join([header, *rows[:-1], ",".join(last)]) + "\n")
    table = tmp_path / "table.csv"
    found = CliRunner().invoke(app, ["sweep", "collect", str(folder), "--out", str(table)])
    assert found.exit_code == 0
    assert f"Not at rest: {folder.name}" in found.stderr
    (run,) = sweep.read_table(table)
    assert not run.at_rest
    assert sweep_fit.usable([run], fixed=False) == []


def test_a_run_on_a_slope_is_left_out(recorded: tuple[Path, Scene, Impact]) -> None:
    folder, _, _ = recorded
    content = json.loads((folder / "scenario.json").read_text())
    content["gravity"]["tilt_deg"] = 3
    (folder / "scenario.json").write_text(json.dumps(content))
    with pytest.raises(ValueError, match=r"gravity\.tilt_deg is 3, a sweep is of level ground"):
        sweep.collect(folder)


def test_a_run_folder_becomes_a_row(recorded: tuple[Path, Scene, Impact]) -> None:
    folder, scene, impact = recorded
    run = sweep.collect(folder)
    assert run.vertical_load_ratio == pytest.approx(impact.vertical_load_ratio, rel=1e-6)
    assert run.barrier_displacement_final == pytest.approx(impact.barrier_displacement_final, rel=1e-6)
    assert run.rise_time == pytest.approx(impact.peak_time - 0.2, abs=0.05)
    assert run.at_rest
    assert not run.fixed
    assert run.scene.impact().peak_force == pytest.approx(scene.impact().peak_force)


# --- the shipped table and constants ---------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["sliding", "fixed"])
def test_the_shipped_constants_are_those_of_the_shipped_table(kind: str) -> None:
    found = sweep_fit.fit(sweep_fit.usable(sweep.read_table(TABLE), fixed=kind == "fixed"))
    for name, value in vars(CONSTANTS[kind]).items():
        assert value == pytest.approx(getattr(found, name), rel=2e-3, abs=2e-3), name  # written with three digits


def test_the_calibrated_variant_gains_on_scenes_it_was_not_fitted_to() -> None:
    runs = sweep.read_table(TABLE)
    sliding = sweep_fit.usable(runs, fixed=False)
    before = sweep_fit.score(sliding, [sweep_fit.paper_rule(run.scene) for run in sliding])
    after = sweep_fit.score(sliding, sweep_fit.cross_validated(sliding))
    assert after.peak_force_median < 0.4 * before.peak_force_median
    assert math.log(after.displacement_factor) < 0.6 * math.log(before.displacement_factor)
    assert after.within_two > before.within_two + 0.2
    fixed = sweep_fit.usable(runs, fixed=True)
    before = sweep_fit.score(fixed, [sweep_fit.paper_rule(run.scene) for run in fixed])
    after = sweep_fit.score(fixed, sweep_fit.cross_validated(fixed))
    assert after.peak_force_median < 0.6 * before.peak_force_median


# --- command line ----------------------------------------------------------------------------------------------------


def test_plan_collect_and_fit_on_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_fit, "RESAMPLES", 20)
    for name in ("standard_errors", "cross_validated"):  # the slow ones, of the same table twice
        once = cache(getattr(sweep_fit, name))
        monkeypatch.setattr(sweep_fit, name, lambda runs, once=once: once(tuple(runs)))

    def call(*arguments: str) -> Any:
        return CliRunner().invoke(app, ["sweep", *arguments])

    template, folder = str(ROOT / "scenarios" / "set_i.json"), tmp_path / "sweep"
    assert call("plan", template, str(folder), "--count", "4").exit_code == 0
    assert sorted(path.name for path in folder.iterdir()) == [f"scene_{index:03d}.json" for index in range(4)]
    Scenario.load(folder / "scene_002.json")
    dry = call("plan", str(ROOT / "scenarios" / "case_1_dry.json"), str(folder))
    assert dry.exit_code == 2
    assert "has the formulation 'dry', it must be two_phase" in dry.stderr
    nothing = call("collect", str(folder), "--out", str(tmp_path / "table.csv"))
    assert nothing.exit_code == 2
    assert "No folder holds a usable record." in nothing.stderr
    fit = call("fit", str(TABLE))
    assert fit.exit_code == 0
    assert "sliding, calibrated" in fit.stdout
    assert "a      b" in fit.stdout
    assert "their own spread is 0.24" in fit.stdout
    content = json.loads(call("fit", str(TABLE), "--json").stdout)
    assert content["fixed"]["calibrated"]["displacement_factor"] is None
    assert 0 < content["fixed"]["standard_errors"]["jet"] < 0.1
    assert 0 < content["sliding"]["vertical_load"]["scatter"] < content["sliding"]["vertical_load"]["spread"]
    small = tmp_path / "small.csv"
    sweep.write_table(sweep.read_table(TABLE)[:10], small)
    assert "a fit needs 20" in call("fit", str(small)).stderr


def test_predict_and_design_offer_the_calibrated_variant() -> None:
    def answer(*arguments: str) -> Any:
        result = CliRunner().invoke(app, [*arguments, "--json"])
        assert result.exit_code == 0, result.output
        return json.loads(result.stdout)

    path = str(ROOT / "scenarios" / "set_i.json")
    found = answer("predict", path, "--variant", "calibrated")
    expected = calibrated_impact(read_scene(path))
    assert found["barrier_displacement_final"] == pytest.approx(expected.barrier_displacement_final)
    assert "fitted to simulations" in found["notes"][0]
    assert answer("compare", path)["set_i"]["calibrated"]["peak_force"] == pytest.approx(expected.peak_force)
    own = answer("predict", path, "--variant", "calibrated", "--lambda", "0.41")
    assert own["inputs"]["geometry_change"] == pytest.approx(0.41)
    design = answer("design", path, "--limit", "1", "--calibrated")
    again = answer("predict", path, "--variant", "calibrated", "--barrier-mass", repr(design["mass"]),
                   "--face-angle", repr(design["face_angle_deg"]))  # fmt: skip
    assert again["barrier_displacement_final"] == pytest.approx(1, abs=1e-4)


@given(
    speed=st.floats(0.1, 60),
    height=st.floats(0.1, 20),
    length_ratio=st.floats(1, 100),
    mass_ratio=st.floats(0.01, 100),
    base_friction=st.floats(0, 1.5),
    face_angle=st.floats(5, 90),
)
def test_any_scene_has_calibrated_numbers_and_its_peak_force(
    speed: float, height: float, length_ratio: float, mass_ratio: float, base_friction: float, face_angle: float
) -> None:
    mass = 1800 * length_ratio * height**2
    scene = Scene(
        flow_mass=mass,
        flow_length=length_ratio * height,
        flow_height=height,
        speed=speed,
        barrier_mass=mass_ratio * mass,
        base_friction=base_friction,
        face_angle=face_angle,
    )
    numbers = coefficients(scene)
    impact = calibrated_impact(scene)
    at, turned = CONSTANTS["sliding"], 1 - math.cos(math.radians(face_angle))
    pressure = at.jet * turned + at.weight / scene.froude_number**2
    pressure *= (mass_ratio / (1 + mass_ratio)) ** at.mass_exponent
    found = impact.peak_force / (1800 * height * speed**2)
    if numbers.geometry_change < 1:
        assert found == pytest.approx(pressure, rel=1e-6)
    else:
        assert found >= pressure * (1 - 1e-9)
