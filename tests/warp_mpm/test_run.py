"""A whole run with a stand-in for the simulation: what lands in the folder, whatever happens."""

import gc
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm import plotting
from warp_mpm.cli import app
from warp_mpm.loading import no_garbage
from warp_mpm.recording import run_folder
from warp_mpm.recording.run_folder import RunFolder, RunFolderError
from warp_mpm.report import write_report
from warp_mpm.results import Results, ResultsError, Snapshots
from warp_mpm.run import evaluate, resume_run, run_scenario
from warp_mpm.scenario import Scenario

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.mark.usefixtures("runs_with_pictures")
def test_a_finished_run(tmp_path, coarse_case_1, flying_points):
    seen = []
    outcome = run_scenario(
        coarse_case_1, tmp_path / "run", make_simulation=flying_points, origin="case_1.json", on_progress=seen.append
    )
    assert outcome.finished
    results = Results.open(tmp_path / "run")
    assert sorted(item.name for item in (tmp_path / "run").iterdir()) == sorted(run_folder.OWN_FILES)
    assert results.scenario == coarse_case_1
    assert Scenario.load(tmp_path / "run" / "scenario.json") == coarse_case_1
    record = results.record
    assert record["status"] == "finished"
    assert record["versions"]["warp-lang"]
    assert record["scenario_file"] == "case_1.json"
    assert record["simulated_time"] == 3.0
    assert len(results.time_series["time"]) == 601
    assert len(results.snapshots) == 61
    for name in (run_folder.FORCE_PLOT, run_folder.PRESSURE_PLOT):
        assert (tmp_path / "run" / name).read_bytes().startswith(PNG)
    assert seen[-1].time == 3.0
    assert seen[-1].sample["impact_force_x"] == pytest.approx(0.0, abs=1e-6)
    assert seen[-1].time_left == 0.0

    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary == outcome.summary
    contract = "peak_force peak_force_time impulse impact_end_time pore_pressure_max barrier_velocity_max "
    contract += "barrier_displacement_final retained_volume overtopped_volume mechanism mass_error momentum_error "
    contract += "energy_error material_points steps wall_time"
    assert set(contract.split()) <= summary.keys()
    assert summary["impulse"] == pytest.approx(0.5 * flying_points.PEAK * 1.5)
    assert summary["barrier_displacement_final"] == pytest.approx(0.9)
    assert summary["pore_pressure_max"] == pytest.approx(1e5)
    assert summary["pore_pressure_max_time"] == pytest.approx(1.0)
    assert summary["pore_pressure_max_anywhere"] == pytest.approx(3e5)
    assert summary["material_points"] == len(results.snapshots[0].position)
    assert summary["mass_error"] == 0.0
    assert (summary["steps"], summary["time_step_limit"]) == (600, "wave")
    # The points fly off downstream: at 3 s all are beyond the crest, which is at 8.4 m.
    assert summary["overtopped_volume"] + summary["on_crest_volume"] == pytest.approx(45, rel=0.3)


def test_snapshots_hold_the_state(tmp_path, coarse_case_1, flying_points):
    run_scenario(coarse_case_1, tmp_path, make_simulation=flying_points)
    simulation = flying_points(coarse_case_1)
    simulation.advance(1.0)
    expected = simulation.points()
    frame = Results.open(tmp_path).snapshots.at(1.0)
    assert frame.time == 1.0
    # Single precision: 6e-8 of the greatest coordinate.
    assert np.abs(frame.position - expected["position"]).max() < 1e-7 * 30
    for name in ("solid_velocity", "liquid_velocity", "effective_stress", "pore_pressure"):
        assert frame[name] == pytest.approx(expected[name], rel=1e-6, abs=1e-6)


@pytest.mark.usefixtures("runs_with_pictures")
def test_a_stopped_run_keeps_all_and_says_so(tmp_path, coarse_case_1, flying_points):
    times = []
    outcome = run_scenario(
        coarse_case_1,
        tmp_path,
        make_simulation=flying_points,
        on_progress=lambda progress: times.append(progress.time),
        stop=lambda: len(times) > 0 and times[-1] >= 1.199,  # known one interval later
    )
    assert not outcome.finished
    results = Results.open(tmp_path)
    assert results.record["status"] == "stopped"
    assert results.time_series["time"][-1] == pytest.approx(1.205)
    assert results.snapshots.times[-1] == pytest.approx(1.205)
    assert results.summary["end_time"] == pytest.approx(1.205)
    assert (tmp_path / run_folder.PRESSURE_PLOT).exists()


def test_a_failed_run_keeps_all_and_says_why(tmp_path, coarse_case_1, flying_points):
    with pytest.raises(ArithmeticError, match="diverged"):
        run_scenario(coarse_case_1, tmp_path, make_simulation=lambda scene: flying_points(scene, fail_at=1.0))
    results = Results.open(tmp_path)
    assert results.record["status"] == "failed"
    assert results.record["problem"] == "the run has diverged"
    assert results.time_series["time"][-1] == pytest.approx(1.0)
    assert results.snapshots.times[-1] == pytest.approx(1.0)


def test_nothing_is_created_when_the_simulation_cannot_be_made(tmp_path, coarse_case_1):
    def refuse(scenario):
        raise ValueError("no such device")

    with pytest.raises(ValueError, match="no such device"):
        run_scenario(coarse_case_1, tmp_path / "run", make_simulation=refuse)
    assert not (tmp_path / "run").exists()


def test_an_existing_run_is_refused_before_the_simulation_is_made(tmp_path, coarse_case_1, flying_points):
    (tmp_path / run_folder.RECORD).write_text("{}")
    with pytest.raises(RunFolderError):
        run_scenario(coarse_case_1, tmp_path, make_simulation=lambda scene: pytest.fail("made"))


@pytest.mark.usefixtures("runs_with_pictures")
@pytest.mark.parametrize("name", ["case_1_dry", "case_1_fixed", "case_5"])
def test_scenes_of_every_kind(tmp_path, load_scene, flying_points, name):
    scenario = load_scene(name, **{"numerics.spacing_m": 0.6, "output.end_time_s": 1.0})
    summary = run_scenario(scenario, tmp_path, make_simulation=flying_points).summary
    assert (summary["pore_pressure_max"] is None) == (name == "case_1_dry")
    assert summary["retained_volume"] + summary["on_crest_volume"] + summary["overtopped_volume"] == pytest.approx(45)


@pytest.mark.usefixtures("runs_with_pictures")
def test_a_scene_without_barrier_has_a_picture_of_the_flow_alone(tmp_path, load_scene, flying_points):
    scenario = load_scene("case_1", barrier=None, **{"numerics.spacing_m": 0.6, "output.end_time_s": 0.5})

    class Unobstructed(flying_points):
        def sample(self, names=None, *, since=None):
            sample = super().sample(since=since)
            return {name: value for name, value in sample.items() if not name.startswith(("impact", "barrier"))}

    summary = run_scenario(scenario, tmp_path, make_simulation=Unobstructed).summary
    assert summary["peak_force"] is None
    assert summary["mechanism"] is None
    assert not (tmp_path / run_folder.FORCE_PLOT).exists()
    assert (tmp_path / run_folder.PRESSURE_PLOT).exists()


def test_evaluation_can_be_repeated(tmp_path, coarse_case_1, flying_points):
    outcome = run_scenario(coarse_case_1, tmp_path, make_simulation=flying_points)
    (tmp_path / run_folder.SUMMARY).unlink()
    assert evaluate(tmp_path) == outcome.summary


def test_pressure_figure_shows_the_times_asked_for(tmp_path, coarse_case_1, flying_points):
    run_scenario(coarse_case_1, tmp_path, make_simulation=flying_points)
    figure = plotting.pore_pressure(Results.open(tmp_path), times=(1.0, 2.0, 4.0))
    panels = [panel for panel in figure.axes if panel.get_ylabel() == "y [m]"]
    assert [panel.get_title(loc="left").split()[2] for panel in panels] == ["1.00", "2.00"]  # the run ends at 3 s
    for panel in panels:
        assert panel.get_aspect() == 1.0
        assert len(panel.collections[0].get_array()) == flying_points(coarse_case_1).material_points


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda path: (path / run_folder.RECORD).unlink(), "run.json is missing"),
        (
            lambda path: (path / run_folder.RECORD).write_text('{"format": 2, "status": "finished"}'),
            "run.json has format = 2, which another version wrote; this one reads 1",
        ),
        (lambda path: (path / run_folder.SUMMARY).write_text("{"), "summary.json cannot be read"),
        (lambda path: (path / run_folder.SUMMARY).write_text("[]"), "does not hold a group of fields"),
        (lambda path: (path / run_folder.SUMMARY).unlink(), "summary.json is missing"),
    ],
)
def test_spoilt_run_folder(tmp_path, coarse_case_1, flying_points, spoil, message):
    run_scenario(coarse_case_1, tmp_path, make_simulation=flying_points)
    spoil(tmp_path)
    with pytest.raises(ResultsError, match=message):
        _ = Results.open(tmp_path).summary


def test_a_string_is_a_path(tmp_path, coarse_case_1, flying_points):
    folder = str(tmp_path / "run")
    run_scenario(coarse_case_1, folder, make_simulation=flying_points)
    outcome = resume_run(folder, make_simulation=flying_points)
    assert outcome.path == tmp_path / "run"
    assert outcome.finished
    assert evaluate(folder) == outcome.summary
    assert Results(folder).summary == outcome.summary
    assert len(Snapshots(folder + "/" + run_folder.SNAPSHOTS)) > 1
    assert RunFolder(folder).path == tmp_path / "run"
    write_report([Results.open(folder)], folder + "/report.html")
    assert (tmp_path / "run" / "report.html").stat().st_size > 0
    with pytest.raises(RunFolderError, match="holds a run already"):
        run_scenario(coarse_case_1, folder, make_simulation=flying_points)


def test_commands_refuse_a_run_of_another_version(tmp_path, coarse_case_1, flying_points):
    run_scenario(coarse_case_1, tmp_path / "run", make_simulation=flying_points)
    record = tmp_path / "run" / run_folder.RECORD
    record.write_text(record.read_text().replace('"format": 1', '"format": 7'))
    for arguments in (["run", "--resume"], ["plot", "history"], ["report"]):
        result = CliRunner().invoke(app, [*arguments, str(tmp_path / "run")])
        assert result.exit_code == 2, arguments
        assert result.stderr.strip() == f"{record} has format = 7, which another version wrote; this one reads 1."


def test_no_run_folder(tmp_path):
    with pytest.raises(ResultsError, match="is no folder"):
        Results.open(tmp_path / "none")


def test_pictures_are_drawn_where_asked_for(coarse_case_1, tmp_path, flying_points):
    """They take longer than a coarse run; `plot` and `report` draw them at any time."""
    run_scenario(coarse_case_1, tmp_path / "run", make_simulation=flying_points, pictures=False)
    pictures = {run_folder.FORCE_PLOT, run_folder.PRESSURE_PLOT}
    assert {item.name for item in (tmp_path / "run").iterdir()} == {*run_folder.OWN_FILES} - pictures


def test_garbage_is_looked_for_again_once_all_is_loaded():
    def fail():
        with no_garbage():
            with no_garbage():
                assert not gc.isenabled()
            assert not gc.isenabled()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert gc.isenabled()
