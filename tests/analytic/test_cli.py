"""The command line as a user meets it: numbers, tables, pictures, sentences and exit codes."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread
from typer.testing import CliRunner, Result

from analytic import plots
from analytic.arrays import trajectory
from analytic.cli import app
from analytic.empirical import MODELS
from analytic.field_data import agreement, read_events
from analytic.impact import Impact
from analytic.scene import read_scene

ROOT = Path(__file__).parents[2]
SCENARIOS = ROOT / "scenarios"
FIG_9 = [
    "--flow-mass",
    "81000",
    "--barrier-mass",
    "81000",
    "--flow-length",
    "15",
    "--flow-height",
    "3",
    "--speed",
    "10",
    "--base-friction",
    "0.29",
    "--lambda",
    "0.41",
    "--tau",
    "0.35",
]


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def answer(*arguments: str) -> Any:
    """The JSON that a call prints."""
    result = call(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def refusal(*arguments: str) -> str:
    """The sentence with which a call is refused."""
    result = call(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1
    return lines[0]


@pytest.fixture
def run_folder(tmp_path: Path) -> Path:
    """A run folder as the simulator writes it, its history made by the closed form."""
    scene = read_scene(SCENARIOS / "set_i.json")
    impact = scene.impact(geometry_change=0.5, rise_ratio=0.3, arrival_time=0.3, vertical_load_ratio=0.5)
    time = np.arange(1001) * 0.005
    curves = trajectory(impact, time)
    force = np.concatenate([[0.0], np.diff(curves.impulse) / 0.005])
    columns = {
        "time [s]": time,
        "impact_force_x [N/m]": force,
        "base_normal_force [N/m]": scene.barrier_mass * scene.gravity + 0.5 * force,
        "barrier_velocity [m/s]": curves.barrier_velocity,
        "barrier_displacement [m]": curves.barrier_displacement,
        "flow_kinetic_energy [J/m]": curves.flow_kinetic_energy,
        "barrier_kinetic_energy [J/m]": curves.barrier_kinetic_energy,
        "time_step [s]": np.full(1001, 1e-4),
    }
    folder = tmp_path / "made_up"
    folder.mkdir()
    (folder / "scenario.json").write_text((SCENARIOS / "set_i.json").read_text())
    lines = [",".join(columns), *(",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True))]
    (folder / "timeseries.csv").write_text("\n".join(lines) + "\n")
    return folder


def assert_is_picture(path: Path) -> None:
    pixels = imread(path)
    assert min(pixels.shape[:2]) > 300
    assert pixels[..., :3].std() > 0.05  # not blank


# --- predict ---------------------------------------------------------------------------------------------------------


def test_predict_gives_the_example_of_fig_9() -> None:
    found = answer("predict", *FIG_9)
    expected = {
        "peak_force": 493902,
        "peak_time": 0.574,
        "impact_end_time": 1.64,
        "impulse": 405000,
        "common_velocity": 5,
        "barrier_velocity_max": 1.42277,
        "barrier_velocity_at_impact_end": 0.715307,
        "stop_time": 1.89143,
        "barrier_displacement_final": 1.36484,
    }
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=5e-6)


def test_predict_in_other_variants_and_fixed() -> None:
    assert answer("predict", *FIG_9, "--variant", "as_printed")["barrier_displacement_final"] == pytest.approx(
        3.30134, rel=5e-6
    )
    fixed = [option for option in FIG_9 if option not in ("--barrier-mass",)]
    del fixed[2]  # the barrier's mass
    found = answer("predict", *fixed, "--fixed")
    assert found["barrier_displacement_final"] == 0
    assert found["inputs"]["barrier_mass"] is None
    never = answer("predict", *FIG_9, "--base-friction", "0")
    assert never["stop_time"] is None
    assert never["barrier_displacement_final"] is None


def test_predict_takes_the_same_from_a_scenario() -> None:
    options = ("--lambda", "0.41", "--tau", "0.35")
    found = answer("predict", str(SCENARIOS / "set_iib.json"), *options)
    assert found["peak_force"] == pytest.approx(2079.59e3, rel=1e-5)
    assert found["barrier_displacement_final"] == pytest.approx(12.4454, rel=1e-5)
    slower = answer("predict", str(SCENARIOS / "set_iib.json"), *options, "--speed", "10")
    assert slower["inputs"]["speed"] == 10
    scaled = answer("predict", str(SCENARIOS / "set_iib.json"), *options, "--reference-speed", "10")
    assert scaled["barrier_displacement_final"] == pytest.approx(10.0229, rel=1e-5)
    assert scaled["inputs"]["rise_ratio"] == pytest.approx(0.175)


def test_predict_says_what_it_assumes() -> None:
    notes = answer("predict", str(SCENARIOS / "set_iib_fixed.json"))["notes"]
    assert notes == [
        "λ = 0.72 is the paper's for this kind of barrier.",
        "τ = 0.35 is assumed; the paper names no value.",
    ]
    assert answer("predict", *FIG_9)["notes"] == []


def test_predict_prints_a_table_and_draws(tmp_path: Path) -> None:
    result = call("predict", *FIG_9, "--plot", str(tmp_path / "impact.png"))
    assert result.exit_code == 0
    assert "final barrier displacement" in result.stdout
    assert "1.36484" in result.stdout
    assert_is_picture(tmp_path / "impact.png")
    assert [path.name for path in tmp_path.iterdir()] == ["impact.png"]


def test_predict_answers_at_once() -> None:
    """What takes long to load is left alone: arrays, pictures, statistics, tables, the simulator."""
    code = (
        "import sys; from analytic.__main__ import main\n"
        f"sys.argv = ['analytic', 'predict', *{FIG_9!r}]\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print(*sys.modules)"
    )
    answer = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    assert "1.36484" in answer
    loaded = set(answer.splitlines()[-1].split())
    assert "analytic.impact" in loaded
    assert not loaded & {"numpy", "matplotlib", "scipy", "rich", "warp", "warp_mpm", "fmpy"}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--flow-mass", "-1"], "--flow-mass = -1.0 is not allowed; it must be a number in (0, inf)."),
        (["--tau", "1.5"], "--tau = 1.5 is not allowed; it must be a number in (0, 1] (it is T1 / T2)."),
        (["--tau", "nan"], "--tau = nan is not allowed; it must be a number in (0, 1] (it is T1 / T2)."),
        (
            ["--lambda", "2"],
            "--lambda = 2.0 is not allowed; it must be a number in (0, 1] (it is s1max / flow_length).",
        ),
        (["--s1max", "20"], "--lambda is 0.41 and s1max is 20.0, give only one."),
        (["--fixed"], "--barrier-mass is 81000 and the barrier is fixed, give only one."),
        (
            ["--variant", "new"],
            "--variant = 'new' is not allowed; it must be one of stick_slip, momentum_closed, as_printed, calibrated.",
        ),
        (["--plot", "a.gif"], "a.gif has the suffix '.gif', a picture is one of png, pdf, svg."),
        (["--plot", "no/a.png"], "no/a.png cannot be written, the folder no does not exist."),
    ],
)
def test_predict_refuses_in_one_sentence(arguments: list[str], sentence: str) -> None:
    assert refusal("predict", *FIG_9, *arguments) == sentence


def test_predict_names_what_is_missing(tmp_path: Path) -> None:
    assert refusal("predict", "--tau", "0.3").startswith("flow_mass is missing, give --flow-mass or a scenario")
    assert "none.json: Cannot read the scenario" in refusal("predict", str(tmp_path / "none.json"))
    assert refusal("predict", *FIG_9[:2], *FIG_9[4:10]).startswith("barrier_mass is missing")
    s1max = [*FIG_9[:-4], "--tau", "0.35", "--s1max", "15.1"]
    assert refusal("predict", *s1max).startswith("--s1max = 15.1 is not allowed; it must be a number in (0, 15]")


@pytest.mark.parametrize("command", ["predict", "compare", "calibrate", "field", "design"])
def test_help_shows_an_example(command: str) -> None:
    result = call(command, "--help")
    assert result.exit_code == 0
    assert f"python -m analytic {command}" in result.output


# --- calibrate and compare -------------------------------------------------------------------------------------------


def test_calibrate_reads_a_run_folder(run_folder: Path, tmp_path: Path) -> None:
    peak, fit = answer("calibrate", str(run_folder), "--plot", str(tmp_path / "fig_10.png"))
    assert (peak["rule"], fit["rule"]) == ("peak", "least_squares")
    assert fit["geometry_change"] == pytest.approx(0.5, rel=0.01)
    assert fit["rise_ratio"] == pytest.approx(0.3, abs=0.01)
    assert fit["vertical_load_ratio"] == pytest.approx(0.5)
    assert fit["misfit"]["barrier_displacement"] > 0.1  # without the vertical load it slides farther
    assert "moving mean over 0.05 s" in fit["filter"]
    assert_is_picture(tmp_path / "fig_10.png")
    loaded = answer("calibrate", str(run_folder), "--with-vertical-load")[1]
    assert loaded["misfit"]["barrier_displacement"] < 0.02


def test_calibrate_reads_any_csv_with_a_scenario(run_folder: Path) -> None:
    series = str(run_folder / "timeseries.csv")
    given = answer("calibrate", series, "--scenario", str(SCENARIOS / "set_i.json"))
    assert given[1]["geometry_change"] == pytest.approx(0.5, rel=0.01)
    assert refusal("calibrate", series).endswith("give the scenario of a CSV file with --scenario.")


def test_calibrate_prints_a_table(run_folder: Path) -> None:
    result = call("calibrate", str(run_folder), "--filter-window", "0.1")
    assert "Filter: peak of the moving mean over 0.1 s" in result.stdout
    assert "least squares" in result.stdout
    assert re.search(r"the paper's λ = 0\.41 needs a peak of \d+ kN/m, and no moving mean reaches that", result.stdout)
    paper = answer("calibrate", str(run_folder))[0]["paper"]
    assert paper["geometry_change"] == 0.41
    assert paper["filter_window"] is None
    assert paper["largest_force"] < paper["peak_force"]
    assert refusal("calibrate", str(run_folder), "--filter-window", "-1").startswith(
        "--filter-window = -1 is not allowed"
    )
    assert "timeseries.csv cannot be read" in refusal("calibrate", str(run_folder.parent))


def test_compare_holds_the_closed_form_against_a_run(run_folder: Path, tmp_path: Path) -> None:
    plot = tmp_path / "fig_14.png"
    found = answer("compare", str(run_folder), "--variant", "stick_slip", "--plot", str(plot))["made_up"]
    assert list(found) == ["simulated", "stick_slip", "notes"]
    assert found["notes"] == []
    assert found["simulated"]["at_least"] == []
    assert found["simulated"]["peak_force"] == pytest.approx(564.76e3 * 0.41 / 0.5, rel=0.03)
    assert found["stick_slip"]["peak_force"] == pytest.approx(564.76e3, rel=1e-4)
    assert_is_picture(plot)
    table = call("compare", str(run_folder), "--lambda", "0.5", "--tau", "0.3").stdout
    assert "simulated" in table
    assert "Δx_f [m]" in table
    assert "≥" not in table


def cut(run_folder: Path, end: float) -> str:
    """The run folder, its record ended at ``end`` [s]; a summary without T2, as the simulator writes it then."""
    series = run_folder / "timeseries.csv"
    header, *rows = series.read_text().splitlines()
    kept = [row for row in rows if float(row.split(",")[0]) <= end]
    series.write_text("\n".join([header, *kept]) + "\n")
    summary = {"peak_force": 1e5, "impact_end_time": None, "impact_duration": None, "barrier_at_rest": False}
    (run_folder / "summary.json").write_text(json.dumps(summary))
    return str(run_folder)


def test_compare_marks_what_was_not_over_and_compares_nothing_with_it(run_folder: Path, tmp_path: Path) -> None:
    plot = tmp_path / "fig_14.png"
    path = cut(run_folder, 1.5)  # the impact ends at 2.3 s, the barrier has its greatest velocity at 1.4 s
    found = answer("compare", path, "--plot", str(plot))["made_up"]
    assert found["simulated"]["at_least"] == ["duration", "impulse", "barrier_displacement_final"]
    assert found["stick_slip"]["at_least"] == []
    assert len(found["notes"]) == 2
    assert "the impact is not over at the end of the record" in found["notes"][0]
    assert "the barrier still moves at 0.532 m/s" in found["notes"][1]
    assert_is_picture(plot)
    lines = call("compare", path).stdout.splitlines()
    header = next(line for line in lines if "T2 [s]" in line)
    for mark in ("T2 [s]", "J [kN s/m]", "Δx_f [m]"):
        end = header.index(mark) + len(mark)
        for line in lines:
            if "  simulated  " in line:
                assert "≥" in line[end - 10 : end]
            if any(f"  {variant}  " in line for variant in ("stick_slip", "as_printed", "calibrated")):
                assert line[:end].rstrip()[-1].isdigit()  # no difference from a bound
                assert "%" in line
    early = answer("compare", cut(run_folder, 1.2))["made_up"]["simulated"]["at_least"]
    assert early[3:] == ["barrier_velocity_max", "barrier_kinetic_energy_max"]  # while it still gains speed


def test_calibrate_says_that_the_impact_was_not_over(run_folder: Path) -> None:
    assert answer("calibrate", str(run_folder))[0]["notes"] == []
    path = cut(run_folder, 1.5)
    for entry in answer("calibrate", path):
        assert entry["measured"]["at_least"] == ["duration", "impulse"]
        assert "the impact is not over at the end of the record" in entry["notes"][0]
    table = call("calibrate", path).stdout
    assert "made_up: the impact is not over at the end of the record" in table
    assert "least squares and κ are of the part that was recorded" in table


def test_compare_shows_the_variants_of_a_scenario_and_the_pressure_formulas() -> None:
    found = answer("compare", str(SCENARIOS / "set_i.json"))["set_i"]
    assert found["as_printed"]["barrier_displacement_final"] == pytest.approx(3.64063, rel=1e-5)
    assert found["stick_slip"]["barrier_displacement_final"] == pytest.approx(1.51752, rel=1e-5)
    fixed = call("compare", str(SCENARIOS / "set_i_fixed.json")).stdout
    assert "as_printed" not in fixed
    assert "Armanini et al. (2011)" in fixed
    assert refusal("compare", str(SCENARIOS / "set_i.json"), "--variant", "x").startswith(
        "--variant = 'x' is not allowed"
    )


@pytest.mark.parametrize(
    ("names", "title"),
    [
        (["set_i"], "Closed-form impact, sliding barrier"),
        (["set_i", "set_v"], "Closed-form impact, sliding barriers"),
        (["set_i_fixed", "set_v_fixed"], "Closed-form impact, fixed barriers"),
        (["set_i", "set_i_fixed"], "Closed-form impact, fixed and sliding barriers"),
    ],
)
def test_compare_draws_all_bars_under_a_title_that_is_true(
    names: list[str], title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures: list[Figure] = []
    monkeypatch.setattr(plots, "save", lambda figure, path: figures.append(figure))
    call("compare", *(str(SCENARIOS / f"{name}.json") for name in names), "--plot", str(tmp_path / "fig.png"))
    (figure,) = figures
    assert figure.get_suptitle() == title
    FigureCanvasAgg(figure).draw()
    (legend,) = figure.legends
    assert not any(legend.get_window_extent().overlaps(axis.bbox) for axis in figure.axes)
    assert all(axis.get_legend() is None for axis in figure.axes)


# --- field -----------------------------------------------------------------------------------------------------------


def test_field_marks_the_synthetic_set_everywhere(tmp_path: Path) -> None:
    events = str(ROOT / "docs" / "data" / "synthetic_events.csv")
    table = call("field", events, "--plot", str(tmp_path / "fig_15.png"))
    assert "SYNTHETIC" in table.stdout
    assert_is_picture(tmp_path / "fig_15.png")
    figure = plots.field(read_events(events), [agreement(MODELS["cui_2015"], read_events(events))])
    assert "SYNTHETIC" in figure.get_suptitle()
    assert all([text.get_text() for text in axis.texts] == ["SYNTHETIC"] for axis in figure.axes)
    found = answer("field", events)
    assert found["synthetic"] is True
    slopes = {entry["model"]: entry["slope"] for entry in found["models"]}
    assert slopes["closed_form"] == pytest.approx(1.1574, abs=1e-4)
    assert "hungr_1984" not in slopes


def test_field_takes_models_and_coefficients() -> None:
    events = str(ROOT / "docs" / "data" / "synthetic_events.csv")
    only = answer("field", events, "--model", "hungr_1984", "--coefficient", "hungr_1984.a=0.9")["models"]
    assert [entry["model"] for entry in only] == ["hungr_1984"]
    assert only[0]["slope"] == pytest.approx(1, abs=1e-4)
    assert "needs your coefficient a" in refusal("field", events, "--model", "hungr_1984")
    assert refusal("field", events, "--coefficient", "hungr=1").endswith("MODEL.NAME=VALUE with a number.")
    assert "unverified" in call("field", "--models").stdout
    assert answer("field", "--models")[0]["name"] == "closed_form"


def test_field_refuses_mixed_units_line_by_line(tmp_path: Path) -> None:
    path = tmp_path / "mixed.csv"
    path.write_text(
        "density [kg/m3],speed [m/s],height [m],peak_pressure [kPa]\n1800,5,1,45\n1.8,5,1,45\n1800,5,1,45000\n"
    )
    result = call("field", str(path))
    assert result.exit_code == 2
    assert result.stdout == ""
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 2
    assert "line 3: density is 1.8 kg/m3" in lines[0]
    assert "line 4: peak_pressure is 718 times" in lines[1]


# --- design ----------------------------------------------------------------------------------------------------------

FLOW = [
    "--density",
    "1800",
    "--flow-length",
    "15",
    "--flow-height",
    "3",
    "--speed",
    "10",
    "--base-friction",
    "0.29",
    "--limit",
    "1",
]


def test_design_gives_a_trapezoid_that_predict_confirms(tmp_path: Path) -> None:
    found = answer("design", *FLOW, "--plot", str(tmp_path / "chart.png"))
    assert found["face_angle_deg"] == 60
    again = answer("predict", *FIG_9, "--barrier-mass", repr(found["mass"]))
    assert again["barrier_displacement_final"] == pytest.approx(1, rel=1e-6)
    area = (found["base_width"] + found["crest_width"]) / 2 * found["height"]
    assert 2000 * area == pytest.approx(found["mass"])
    assert_is_picture(tmp_path / "chart.png")
    same = answer("design", str(SCENARIOS / "case_1.json"), "--limit", "1")
    assert same["mass"] == pytest.approx(found["mass"])


def scenario_with(tmp_path: Path, **barrier: Any) -> str:
    """Case 1 with other groups in its barrier."""
    content = json.loads((SCENARIOS / "case_1.json").read_text())
    content["barrier"] |= barrier
    content["gravity"]["acceleration_m_per_s2"] = 9.8
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(content))
    return str(path)


def test_design_takes_the_barrier_of_the_scenario_and_says_so(tmp_path: Path) -> None:
    motion = {"kind": "sliding", "density_kg_per_m3": 2400, "base_friction": 0.29}
    shape = {"kind": "trapezoid", "base_width_m": 11, "crest_width_m": 4, "height_m": 5}
    path = scenario_with(tmp_path, motion=motion, shape=shape)
    found = answer("design", path, "--limit", "1")
    area = (found["base_width"] + found["crest_width"]) / 2 * 5
    assert found["height"] == 5
    assert found["mass"] == pytest.approx(2400 * area)
    inputs = found["inputs"]
    assert inputs["barrier_density"] == {"value": 2400, "source": "scenario"}
    assert inputs["barrier_height"] == {"value": 5, "source": "scenario"}
    assert inputs["base_friction"] == {"value": 0.29, "source": "scenario"}
    assert inputs["gravity"] == {"value": 9.8, "source": "scenario"}
    assert inputs["rise_ratio"] == {"value": 0.35, "source": "assumed"}
    assert inputs["face_angle"] == {"value": [60, 80], "source": "assumed"}
    other = answer("design", path, "--limit", "1", "--barrier-density", "2000", "--height", "6", "--gravity", "9.81")
    assert other["mass"] == pytest.approx(answer("design", *FLOW)["mass"])
    assert other["inputs"]["barrier_density"] == {"value": 2000, "source": "given"}
    # A mass in place of the density is spread over the barrier's area; a wall without end has neither.
    by_mass = scenario_with(tmp_path, motion={"kind": "sliding", "mass_kg_per_m": 9e4, "base_friction": 0.29})
    assert answer("design", by_mass, "--limit", "1")["inputs"]["barrier_density"]["value"] == pytest.approx(2000)
    wall = scenario_with(
        tmp_path,
        motion={"kind": "sliding", "mass_kg_per_m": 9e4, "base_friction": 0.29},
        shape={"kind": "wall"},
    )
    inputs = answer("design", wall, "--limit", "1")["inputs"]
    assert inputs["barrier_height"] == {"value": 6, "source": "assumed"}
    assert inputs["barrier_density"] == {"value": 2000, "source": "assumed"}


def test_design_prints_what_it_rests_on() -> None:
    text = call("design", *FLOW).stdout
    for line in (
        "density of the barrier       2000  kg/m³  assumed",
        "height of the barrier H         6  m      assumed",
        "base friction tan δ_b        0.29  -      given",
        "λ                            0.41  -      assumed",
        "slope of the ground θ           0  °      assumed",
    ):
        assert line in text
    calibrated = answer("design", str(SCENARIOS / "case_4.json"), "--limit", "1", "--calibrated")
    assert calibrated["inputs"]["geometry_change"]["source"] == "fitted"
    assert calibrated["inputs"]["geometry_change"]["value"] == calibrated["coefficients"]["geometry_change"]


def test_design_with_an_uncertain_speed(tmp_path: Path) -> None:
    uncertain = [*FLOW[:6], "--speed", "lognormal(10, 0.2)", *FLOW[8:], "--samples", "100000"]
    found = answer("design", *uncertain, "--plot", str(tmp_path / "reliability.png"))
    # The lightest barrier for the median speed fails in half of all cases.
    assert found["probability"] == pytest.approx(0.5, abs=0.01)
    assert_is_picture(tmp_path / "reliability.png")
    safe = answer("design", *uncertain, "--probability", "0.02")
    assert safe["probability"] <= 0.02
    assert safe["probability"] > 0.019
    assert safe["mass"] > found["mass"]
    given = answer("design", *uncertain, "--barrier-mass", repr(safe["mass"]))
    assert given["probability"] == pytest.approx(safe["probability"], abs=1e-4)
    table = call("design", *uncertain).stdout
    assert "probability of sliding farther" in table
    assert "lognormal(10, 0.2)  m/s    given" in table
    assert "density of the barrier" in table
    assert given["inputs"]["speed"] == {"value": "lognormal(10, 0.2)", "source": "given"}
    assert given["inputs"]["barrier_mass"]["source"] == "given"
    assert "barrier_density" not in given["inputs"]  # of no effect on a given mass
    assert "total Sobol' index" in table


def test_design_refuses_in_one_sentence() -> None:
    assert refusal("design", *FLOW[:-2]) == "limit is missing, give --limit in metres."
    assert refusal("design", *FLOW[2:]).startswith("density is missing, give --density or a scenario file.")
    assert refusal("design", *FLOW, "--probability", "0.1").startswith("--probability needs an uncertain input")
    assert refusal("design", *FLOW, "--speed", "fast").startswith(
        "--speed = 'fast' is not allowed; it must be a number, or one of"
    )
    assert refusal("design", *FLOW, "--height", "-1").startswith(
        "--height = -1 is not allowed; it must be a number in (0, inf)"
    )
    fixed = refusal("design", str(SCENARIOS / "case_1_fixed.json"), "--limit", "1")
    assert fixed.startswith("base_friction is missing, give --base-friction or a scenario of a sliding barrier")


def test_core_and_command_line_agree() -> None:
    impact = Impact(
        flow_mass=81000.0,
        barrier_mass=81000.0,
        flow_length=15.0,
        flow_height=3.0,
        speed=10.0,
        base_friction=0.29,
        geometry_change=0.41,
        rise_ratio=0.35,
        vertical_load_ratio=0.4,
    )
    found = answer("predict", *FIG_9, "--vertical-load-ratio", "0.4")
    assert found["barrier_displacement_final"] == impact.barrier_displacement_final


def test_design_says_how_far_off_it_may_be_and_what_does_better() -> None:
    notes = answer("design", str(SCENARIOS / "case_1.json"), "--limit", "1")["notes"]
    assert "off by a factor of two" in " ".join(notes)
    assert "python -m warp_mpm design SCENARIO" in " ".join(notes)


LOST = "--speed = 'normal(10, 1e-300)' is not allowed; it must be a number where its spread is nothing beside it."
SIZE = "it must be nil or from 1e-12 to 1e+12 in size."


@pytest.mark.parametrize(
    ("command", "options", "sentence"),
    [
        ("predict", ["--speed", "1e300"], f"--speed = 1e+300 is not allowed; {SIZE}"),
        ("predict", ["--flow-length", "1e308"], f"--flow-length = 1e+308 is not allowed; {SIZE}"),
        ("predict", ["--lambda", "5e-324"], f"--lambda = 5e-324 is not allowed; {SIZE}"),
        ("predict", ["--arrival-time", "1e308"], f"--arrival-time = 1e+308 is not allowed; {SIZE}"),
        ("predict", ["--reference-speed", "1e-308"], f"--reference-speed = 1e-308 is not allowed; {SIZE}"),
        ("design", ["--density", "1e300"], f"--density = 1e+300 is not allowed; {SIZE}"),
        ("design", ["--speed", "lognormal(1e200, 0.1)"], f"--speed = lognormal(1e+200, 0.1) is not allowed; {SIZE}"),
        ("design", ["--speed", "normal(10, 1e-300)"], LOST),
        ("design", ["--speed", "lognormal(10, 1e300)"], f"--speed = lognormal(10, 1e+300) is not allowed; {SIZE}"),
        (
            "design",
            ["--speed", "normal(1e308, 1e308)"],
            f"--speed = normal(1e+308, 1e+308) is not allowed; {SIZE}",
        ),
        ("design", ["--seed", "-1"], "--seed = -1 is not allowed; it must be a whole number at least 0."),
    ],
)
def test_numbers_of_no_impact_are_refused(command, options, sentence):
    """Of such sizes the formulas' products are none any longer: a design went on for ever."""
    common = ["--flow-length", "15", "--flow-height", "3", "--speed", "10", "--base-friction", "0.29"]
    own = (
        ["--flow-mass", "8e4", "--barrier-mass", "8e4"]
        if command == "predict"
        else ["--density", "1800", "--limit", "1"]
    )
    result = CliRunner().invoke(app, [command, *own, *common, *options])
    assert (result.exit_code, result.stderr.strip()) == (2, sentence)


def test_no_angle_is_read_into_a_friction_that_cannot_be_one():
    words = "predict --flow-mass 8e4 --barrier-mass 8e4 --flow-length 15 --flow-height 3 --speed 10 --base-friction"
    notes = {value: CliRunner().invoke(app, [*words.split(), value]).stdout for value in ("20", "1e9")}
    assert "where degrees were meant, 0.36." in notes["20"]
    assert "is the tangent of 90 degrees." in notes["1e9"]
