"""The command line, with a stand-in for the simulation: output, exit codes, and what it refuses."""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import warp_mpm.simulation
from analytic.whole_file import UnwrittenError
from warp_mpm.cli import BAD_INPUT, DIVERGED, INTERRUPTED, app
from warp_mpm.description import described
from warp_mpm.recording import run_folder
from warp_mpm.results import Results
from warp_mpm.scenario import Scenario

SCENES = Path(__file__).parents[2] / "scenarios"
SET_IIB = str(SCENES / "set_iib.json")


@pytest.fixture
def command(monkeypatch, tmp_path, flying_points):
    monkeypatch.setattr(warp_mpm.simulation, "Simulation", flying_points)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    return lambda *arguments: CliRunner().invoke(app, [str(argument) for argument in arguments])


def run(command, *arguments):
    return command("run", SET_IIB, "--spacing", "0.5", "--until", "1", *arguments)


@pytest.mark.usefixtures("runs_with_pictures")
def test_run_fills_the_default_folder_and_tells_the_figures(command):
    result = run(command)
    assert result.exit_code == 0, result.output
    folder = Path("runs/set_iib")
    assert {item.name for item in folder.iterdir()} == set(run_folder.OWN_FILES)
    results = Results.open(folder)
    assert results.scenario.numerics.spacing_m == 0.5
    assert results.scenario.output.end_time_s == 1.0
    assert results.record["scenario_file"] == SET_IIB
    peak = results.summary["peak_force"]
    assert f"{peak / 1e3:,.1f} kN/m" in result.stdout
    for words in (
        "Set IIb",
        "peak force",
        "volume [m³/m]",
        "mechanism seen",
        "wall time",
        "Results are in runs/set_iib",
    ):
        assert words in result.stdout
    # In a pipe: a line when it begins to run, one for every tenth, and no control characters.
    assert result.stdout.count("of 1 s  ") == 11
    assert "\x1b" not in result.stdout


def test_a_figure_has_one_line_in_a_file_however_narrow_the_terminal(command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    lines = [line.rstrip() for line in run(command, "--no-pictures").stdout.splitlines()]
    assert any(line.startswith("volume [m³/m] ") and line.endswith(" beyond") for line in lines)


def test_brackets_in_a_title_are_only_brackets(command):
    Path("scene.json").write_text(json.dumps({**json.loads(Path(SET_IIB).read_text()), "title": "[bold]a[/] [/x]"}))
    result = command("run", "scene.json", "--spacing", "0.5", "--until", "0.5")
    assert result.exit_code == 0
    assert "[bold]a[/] [/x]" in result.stdout


def test_quiet_run_says_nothing(command):
    result = run(command, "--quiet", "--out", "here")
    assert (result.exit_code, result.output) == (0, "")
    assert (Path("here") / run_folder.SUMMARY).is_file()


def test_a_report_that_cannot_be_written_costs_no_result(command, monkeypatch):
    def write_report(results, target):
        raise UnwrittenError(errno.ENOSPC, "No space left on device", str(target))

    monkeypatch.setattr("warp_mpm.report.write_report", write_report)
    result = run(command, "--out", "here", "--report")
    assert result.exit_code == BAD_INPUT
    assert "peak force" in result.stdout
    assert result.stderr.strip().endswith("here/report.html cannot be written: No space left on device.")


def test_an_existing_run_needs_force(command):
    assert run(command, "--out", "here").exit_code == 0
    before = (Path("here") / run_folder.TIME_SERIES).stat()
    result = run(command, "--out", "here")
    assert result.exit_code == BAD_INPUT
    assert "here holds a run already" in result.stderr
    assert (Path("here") / run_folder.TIME_SERIES).stat() == before
    assert run(command, "--out", "here", "--force").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--spacing", "-1"), "--spacing = -1.0 is not allowed"),
        (("--spacing", "nan"), "--spacing = NaN is not allowed"),
        (("--until", "0"), "--until = 0.0 is not allowed"),
        (("--until", "5e-324"), "--until = 5e-324 is not allowed"),
        (
            ("--until", "soon"),
            "--until = soon is not allowed; it must be a finite number at least 1e-09 and at most 1e+06.",
        ),
        (("--spacing", "40"), "--spacing = 40 leaves less than one material point for the flow of 45 m³/m; it must"),
        (("--jobs", "0"), "--jobs = 0 is not allowed; it must be a whole number at least 1 and at most 1024.\n"),
        (("--spacing",), "Option '--spacing' requires an argument.\n"),
        (("--velocity", "3"), "No such option: --velocity"),
    ],
)
def test_bad_option(command, arguments, sentence):
    result = command("run", SET_IIB, *arguments)
    assert result.exit_code == BAD_INPUT
    assert sentence in result.stderr
    assert not Path("runs").exists()


def test_missing_scenario(command):
    result = command("run", "none.json")
    assert result.exit_code == BAD_INPUT
    assert result.stderr == "none.json: Cannot read the scenario: No such file or directory.\n"


def test_unknown_device(command, monkeypatch):
    def refuse(scenario, device):
        raise ValueError(f"device = {device!r} does not exist here; it must be one of cpu")

    monkeypatch.setattr(warp_mpm.simulation, "Simulation", refuse)
    result = run(command, "--device", "cuda:9")
    assert result.exit_code == BAD_INPUT
    assert result.stderr == "--device = 'cuda:9' does not exist here; it must be one of cpu\n"
    assert not Path("runs").exists()


def test_divergence_keeps_what_was_computed(command, monkeypatch, flying_points):
    class Diverging(flying_points):
        def advance(self, until, **stop):
            if until > 0.5:
                raise warp_mpm.simulation.SimulationDiverged("The run diverged at t = 0.5 s.")
            super().advance(until, **stop)

    monkeypatch.setattr(warp_mpm.simulation, "Simulation", Diverging)
    result = run(command, "--out", "here")
    assert result.exit_code == DIVERGED
    assert "The run diverged at t = 0.5 s. What was computed before is in here, with a state" in result.stderr
    assert (Path("here") / run_folder.CHECKPOINT).is_file()
    again = command("run", "--resume", "here")
    assert again.exit_code == DIVERGED
    assert Results.open("here").time_series["time"][-1] == pytest.approx(0.5)
    assert Results.open("here").record["status"] == "failed"


@pytest.mark.usefixtures("runs_with_pictures")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_ends_cleanly_and_says_how_to_go_on(command, monkeypatch, flying_points, number):
    class Interrupted(flying_points):
        def advance(self, until, **stop):
            super().advance(until, **stop)
            if until == pytest.approx(0.5):
                os.kill(os.getpid(), number)

    monkeypatch.setattr(warp_mpm.simulation, "Simulation", Interrupted)
    before = signal.getsignal(signal.SIGINT)  # ignored, where the tests run in a shell's background
    result = run(command, "--out", "here")
    assert result.exit_code == INTERRUPTED
    assert "Stopped at t = 0.500 s; everything up to there is in here. To run it to the end:" in result.stderr
    assert "run --resume here" in result.stderr
    results = Results.open("here")
    assert results.record["status"] == "stopped"
    assert results.summary["end_time"] == pytest.approx(0.5)
    assert results.snapshots.times[-1] == pytest.approx(0.5)
    assert (Path("here") / run_folder.PRESSURE_PLOT).is_file()
    assert signal.getsignal(signal.SIGINT) is before  # the shell has its Ctrl-C back


@pytest.mark.usefixtures("runs_with_pictures")
def test_a_stopped_run_goes_on(command, monkeypatch, flying_points):
    class Interrupted(flying_points):
        def advance(self, until, **stop):
            super().advance(until, **stop)
            if until == pytest.approx(0.52):  # between two snapshots
                os.kill(os.getpid(), signal.SIGINT)

    assert run(command, "--out", "whole", "--no-pictures").exit_code == 0
    with monkeypatch.context() as context:
        context.setattr(warp_mpm.simulation, "Simulation", Interrupted)
        assert run(command, "--out", "here", "--no-pictures").exit_code == INTERRUPTED
    assert command("run", "--resume", "here").exit_code == 0
    for name in (run_folder.TIME_SERIES, run_folder.SCENARIO):
        assert (Path("here") / name).read_bytes() == (Path("whole") / name).read_bytes()
    assert list(Results.open("here").snapshots.times) == list(Results.open("whole").snapshots.times)
    record = Results.open("here").record
    assert record["status"] == "finished"
    assert record["resumed"][0]["simulated_time"] == pytest.approx(0.52)
    assert {item.name for item in Path("here").iterdir()} == set(run_folder.OWN_FILES)
    again = command("run", "--resume", "here", "--no-pictures")
    assert again.exit_code == 0
    assert again.stderr == "The run in here had finished before; nothing was left to simulate.\n"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--resume", "none"), "none is no folder."),
        (("--resume", "none", "--spacing", "1"), "--resume DIR goes on with a run as it was begun"),
        ((), "run needs a scenario file, or --resume DIR"),
    ],
)
def test_nothing_to_go_on_with(command, arguments, sentence):
    result = command("run", *arguments)
    assert result.exit_code == BAD_INPUT
    assert sentence in result.stderr


def test_report_of_a_run_without_its_end_says_how_to_go_on(command):
    assert run(command, "--out", "here").exit_code == 0
    (Path("here") / run_folder.SUMMARY).unlink()
    result = command("report", "here")
    assert result.exit_code == BAD_INPUT
    assert result.stderr == (
        "here/summary.json is missing: the run has not come to its end; to go on with it: "
        "python -m warp_mpm run --resume here\n"
    )


def test_check_tells_what_a_scene_is(command):
    result = command("check", *sorted(SCENES.glob("*.json")))
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    begin = lines.index(f"{SCENES / 'set_v.json'}: Set V: depth 4 m, 48 m3/m, sliding barrier")
    assert lines[begin + 1 : begin + 3] == [
        "  two-phase flow of 48 m³/m, 86,400 kg/m, 4 m deep, v = 10 m/s (Fr 1.60); slope 0°, ground friction 0",
        "  barrier H = 6 m, β = 59.7°, 90,000 kg/m, sliding with tan δ_b = 0.29; ends at 6 s; "
        "about 4,800 points on a 0.2 m grid, float64",
    ]
    told = {file.stem: described(Scenario.load(file)) for file in SCENES.glob("case_*.json")}
    assert told["case_1"] != told["case_3"]  # 60° and 80°
    assert "β = 59.7°, fixed" in told["case_1_fixed"][1]
    assert told["case_5"][1].startswith("barrier: wall without end, fixed")


def test_check_tells_of_a_driven_barrier_and_of_a_slope(command):
    hard = SCENES / "hard"
    result = command("check", hard / "driven_shaken.json", hard / "slope_30.json", hard / "domain_wall.json")
    assert "barrier H = 6 m, β = 59.7°, driven; ends at 3 s" in result.stdout
    assert "slope 30°, ground friction 0.3" in result.stdout
    assert "no barrier; ends at 4 s" in result.stdout


def test_check_tells_of_a_slip(command):
    scene = json.loads(Path(SET_IIB).read_text())
    scene["flow"]["material"]["grain_density_kg_per_m3"] = 2.65
    Path("slip.json").write_text(json.dumps(scene))
    result = command("check", "slip.json")
    assert result.exit_code == 0
    assert "Note: flow.material.grain_density_kg_per_m3 = 2.65 is lighter than water" in result.stdout


def test_check_goes_on_after_a_bad_file(command):
    Path("bad.json").write_text(json.dumps({**json.loads(Path(SET_IIB).read_text()), "flwo": 3}))
    result = command("check", "bad.json", SET_IIB)
    assert result.exit_code == BAD_INPUT
    assert result.stderr == "bad.json: flwo is not a field of a scenario; did you mean flow?\n"
    assert "set_iib.json: Set IIb: 20 m/s, sliding barrier\n  two-phase flow of 45" in result.stdout


def test_schema_is_json(command):
    schema = json.loads(command("schema").stdout)
    assert schema["properties"]["flow"]["discriminator"]["propertyName"] == "formulation"
    described = schema["$defs"]["Numerics"]["properties"]["spacing_m"]
    assert described["description"]
    assert described["default"] == 0.2


def test_import_starts_nothing():
    """Of other packages the import brings none at all, of the library next to none, and so costs no time: a Ctrl-C
    meets the command line, which knows what to do with it."""
    code = "import sys; before = set(sys.modules); import warp_mpm; print(*(set(sys.modules) - before))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    roots = {name.partition(".")[0] for name in answer}
    assert roots - {"__future__"} == {"warp_mpm"}


def test_public_names():
    assert set(warp_mpm.__all__) <= set(dir(warp_mpm))
    for name in warp_mpm.__all__:
        assert getattr(warp_mpm, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'Simulatoin'"):
        _ = warp_mpm.Simulatoin


def test_check_as_json(command, tmp_path):
    """Numbers and notes of what is right, problems of what is not; one list, and the exit code of the worst."""
    (tmp_path / "bad.json").write_text(json.dumps(json.loads(Path(SET_IIB).read_text()) | {"ground": {"friction": -1}}))
    result = command("check", SET_IIB, tmp_path / "bad.json", "--json")
    assert result.exit_code == 2
    assert result.stderr == ""
    right, wrong = json.loads(result.stdout)
    assert (right["valid"], right["problems"]) == (True, [])
    scenario = Scenario.load(SET_IIB)
    numbers = right["numbers"]
    assert numbers["bulk_density_kg_per_m3"] == scenario.flow.material.density
    assert numbers["barrier_mass_kg_per_m"] == scenario.barrier.mass
    assert numbers["flow_mass_kg_per_m"] == pytest.approx(scenario.flow.volume * scenario.flow.material.density)
    assert wrong["valid"] is False
    assert wrong["problems"] == [
        "ground.friction = -1 is not allowed; it must be a finite number at least 0 and at most 10."
    ]
