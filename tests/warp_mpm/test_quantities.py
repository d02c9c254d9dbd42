"""A quantity is said once: every reader of runs takes its words, unit and factor from the table."""

import importlib.util
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.plotting import comparison, force_and_displacement
from warp_mpm.quantities import TIME_SERIES, Sampled, quantities_of, recorded_quantities, register
from warp_mpm.quantities.figures import FIGURES, NEEDED
from warp_mpm.quantities.points import DRAWN, POINT_FIELDS
from warp_mpm.quantities.time_series import NAMED, OWN
from warp_mpm.recording.run_folder import RunFolderError
from warp_mpm.report.content import run_content
from warp_mpm.results import Results, ResultsError
from warp_mpm.run import resume_run, run_scenario
from warp_mpm.simulation import Simulation

ROOT = Path(__file__).parents[2]
TABLES = (*TIME_SERIES.values(), *FIGURES.values(), *DRAWN.values(), *POINT_FIELDS.values())


@pytest.fixture(autouse=True)
def no_quantity_stays():
    yield
    OWN.clear()


def test_every_quantity_is_said_whole():
    for quantity in TABLES:
        assert quantity.unit, quantity.name
        assert quantity.meaning, quantity.name
        # A meaning is read without its neighbours.
        assert not re.search(r"\bthe same\b|\bthat (patch|moving mean)\b", quantity.meaning), quantity.name
    assert all(set(needs) <= set(NAMED) for needs in NEEDED.values())
    assert all(set(one.needs) <= set(POINT_FIELDS) for one in DRAWN.values())


def test_units_that_people_read():
    assert TIME_SERIES["impact_force_x"].title == "horizontal impact force F₂,x [kN/m]"
    assert TIME_SERIES["impact_force_x"].text(12.3e3, ".0f") == "12 kN/m"
    assert TIME_SERIES["top_force_x"].heading == "top_force [N/m]"
    assert (DRAWN["volumetric_strain"].shown_unit, DRAWN["volumetric_strain"].factor) == ("%", 100.0)
    assert FIGURES["overtopped_volume"].column == "beyond [m³/m]"
    assert TIME_SERIES["time_step"].words == "time step"


VIEWS = (
    *("warp_mpm/terminal.py", "warp_mpm/animation.py", "warp_mpm/fields.py", "warp_mpm/accuracy/errors.py"),
    *("warp_mpm/report", "warp_mpm/plotting", "warp_mpm/commands", "fmu/units/debris_flow.py", "fmu/worker.py"),
)


def test_no_view_has_a_unit_or_a_factor_of_its_own():
    """Of what a run records. Words of one picture may stand in it; units and factors may not."""
    found = []
    for view in VIEWS:
        place = ROOT / view
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            text = path.read_text(encoding="utf-8")
            found += [f"{path.name}: {hit}" for hit in re.findall(r"k(?:N|Pa|J)\b|/ 1e3|\* ?1e-3", text)]
    assert found == []


@pytest.mark.parametrize(
    ("quantity", "message"),
    [
        (Sampled("Front", "m", "place"), "must be small letters"),
        (Sampled("time_step", "s", "mine"), "one of the package's own"),
        (Sampled("bow_force_x", "N/m", "mine"), "one of the package's own"),
        (Sampled("pore_pressure", "Pa", "mine"), "would make a second pore_pressure_max"),
        (Sampled("front", "", "mine"), "the unit of the quantity 'front'"),
        (Sampled("front", "m,s", "mine"), "the unit of the quantity 'front'"),
        (Sampled("front", "m", ""), "the meaning of the quantity 'front'"),
        (Sampled("front", "m", "mine", key="other"), "must be its name"),
    ],
)
def test_quantities_that_are_refused(quantity, message):
    with pytest.raises(ValueError, match=message):
        register(quantity)
    assert not OWN


def test_a_quantity_may_ask_for_a_scene(load_scene):
    register(Sampled("front", "m", "place", there=lambda scenario: scenario.barrier is None))
    assert "front" in quantities_of(load_scene("case_1", barrier=None))
    assert "front" not in quantities_of(load_scene("case_1"))


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """The run of `docs/develop/own_quantity.py`, read after its quantities are gone."""
    folder = tmp_path_factory.mktemp("own")
    place = importlib.util.spec_from_file_location("own_quantity", ROOT / "docs/develop/own_quantity.py")
    script = importlib.util.module_from_spec(place)
    place.loader.exec_module(script)
    try:
        script.main(folder / "run", spacing=0.5, until=0.8)
    finally:
        OWN.clear()
    return Results.open(folder / "run")


def test_own_quantities_are_columns_with_unit_and_meaning(own):
    header = (own.path / "timeseries.csv").read_text().partition("\n")[0]
    assert header.endswith(",time_step [s],front [m],barrier_load [N/m]")
    assert own.quantities["front"].title == "front of the flow x_f [m]"
    frame = own.frame()
    assert frame.attrs["units"]["barrier_load"] == "N/m"
    assert frame.attrs["meanings"]["front"] == "x of the foremost material point"
    series = own.time_series
    forces = [series[name] for name in ("impact_force_x", "top_force", "back_force_x")]
    np.testing.assert_array_equal(series["barrier_load"], sum(forces))
    fronts = [frame.position[:, 0].max() for frame in own.snapshots]
    assert np.interp(own.snapshots.times, series["time"], series["front"]) == pytest.approx(fronts, rel=1e-5)


def test_own_quantities_have_figures(own):
    series, summary = own.time_series, own.summary
    for name in ("front", "barrier_load"):
        place = int(np.argmax(series[name]))
        assert summary[f"{name}_max"] == series[name][place] > 0.0
        assert summary[f"{name}_max_time"] == series["time"][place]
        assert summary[f"{name}_final"] == series[name][-1]


def test_own_quantities_change_nothing_else(own, load_scene, tmp_path):
    run_scenario(own.scenario, tmp_path / "plain", make_simulation=Simulation)
    plain = Results.open(tmp_path / "plain").time_series
    assert set(own.time_series) - set(plain) == {"front", "barrier_load"}
    for name, values in plain.items():
        np.testing.assert_array_equal(values, own.time_series[name], err_msg=name)


def test_own_quantities_are_drawn(own):
    charts = {chart["title"]: chart for chart in run_content(own, "own")["charts"]}
    assert charts["load on the barrier"]["unit"] == "kN/m"
    assert charts["front of the flow"]["lines"][0]["label"] == "front of the flow x_f"
    labels = [panel.get_ylabel() for panel in force_and_displacement(own).axes]
    assert labels[-2:] == ["front of the flow\n$x_{f}$ [m]", "load on the barrier\n[kN/m]"]
    assert any("front of the flow" in panel.get_ylabel() for panel in comparison([own, own]).axes)


def test_a_quantity_is_recorded_beside_what_a_scenario_chooses_and_read_only_then(load_scene):
    asked = []
    register(Sampled("mine", "-", "one", read=lambda now: asked.append(now.time) or 1.0))
    chosen = load_scene("case_1", **{"output.quantities": ["base_force"], "numerics.spacing_m": 0.75})
    assert recorded_quantities(chosen) == ["time", "base_force", "mine"]
    simulation = Simulation(chosen)
    assert simulation.sample(["base_force"]).keys() == {"time", "base_force"}
    assert asked == []
    assert simulation.sample(recorded_quantities(chosen))["mine"] == 1.0
    assert asked == [0.0]


def test_a_quantity_that_is_no_number_says_so(load_scene):
    register(Sampled("mine", "-", "none", read=lambda now: float("nan")))
    with pytest.raises(ValueError, match="the quantity mine is nan at t = 0 s; it must be a finite number"):
        Simulation(load_scene("case_1", **{"numerics.spacing_m": 0.75})).sample()


def test_a_run_goes_on_only_with_its_quantities(load_scene, tmp_path):
    register(Sampled("mine", "-", "one", read=lambda now: now.time))
    changes = {"numerics.spacing_m": 0.75, "output.end_time_s": 0.2, "output.checkpoint_interval_s": 0.02}
    scene, asked = load_scene("case_1", **changes), []
    stop = {"stop": lambda: asked.append(0) or len(asked) > 20}
    assert not run_scenario(scene, tmp_path / "run", make_simulation=Simulation, **stop).finished
    mine = OWN.pop("mine")
    with pytest.raises(RunFolderError, match=r"has the column 'mine \[-\]', which no run writes by itself"):
        resume_run(tmp_path / "run", make_simulation=Simulation)
    register(mine)
    assert resume_run(tmp_path / "run", make_simulation=Simulation).finished
    series = Results.open(tmp_path / "run").time_series
    np.testing.assert_array_equal(series["mine"], series["time"])


def test_what_a_record_says_of_own_quantities_is_checked(own, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(own.path, folder)
    record = json.loads((folder / "run.json").read_text())
    del record["quantities"]["front"]["unit"]
    (folder / "run.json").write_text(json.dumps(record))
    with pytest.raises(ResultsError, match=r"run.json is damaged: quantities.front = "):
        _ = Results.open(folder).time_series
    del record["quantities"]
    (folder / "run.json").write_text(json.dumps(record))
    with pytest.raises(ResultsError, match=r"has the column 'front \[m\]', which no run writes"):
        _ = Results.open(folder).time_series


def test_command_lists_what_a_scene_records():
    everything = CliRunner().invoke(app, ["quantities", "--json"])
    assert {row["name"] for row in json.loads(everything.stdout)} == {one.name for one in TABLES} - set(DRAWN) | {
        name for name in DRAWN if name in POINT_FIELDS
    }
    dry = CliRunner().invoke(app, ["quantities", str(ROOT / "scenarios/case_1_dry.json"), "--json"])
    columns = [row["name"] for row in json.loads(dry.stdout) if row["file"] == "timeseries.csv"]
    assert "impact_force_x" in columns
    assert "liquid_mass" not in columns
    plain = CliRunner().invoke(app, ["quantities"]).stdout
    assert re.search(r"^  top_force \[N/m\] +force of the flow on the crest along x, F_3", plain, re.MULTILINE)
    missing = CliRunner().invoke(app, ["quantities", "none.json"])
    assert missing.exit_code == 2
    assert "none.json" in missing.stderr
