"""A run in a folder and a run in memory are one loop; a script's recorder stands beside theirs."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from warp_mpm.accuracy.measure import judged_series, measure
from warp_mpm.recording import Moments, Schedule, SeriesInMemory, Watcher, record_until
from warp_mpm.results import Results
from warp_mpm.run import resume_run, run_in_memory, run_scenario
from warp_mpm.simulation import Simulation

ROOT = Path(__file__).parents[2]
COARSE = {"numerics.spacing_m": 0.5, "output.end_time_s": 0.8}


@pytest.fixture(scope="module")
def folder(load_scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "run"
    run_scenario(load_scene("case_1", **COARSE), path, make_simulation=Simulation)
    return Results.open(path)


def test_memory_holds_what_the_folder_holds(folder):
    run = run_in_memory(folder.scenario, make_simulation=Simulation)
    assert run.finished
    assert list(run.time_series) == list(folder.time_series)
    for name, values in folder.time_series.items():
        np.testing.assert_array_equal(run.time_series[name], values, err_msg=name)
    assert [one.time for one in run.snapshots] == folder.snapshots.times.tolist()
    for ours, theirs in zip(run.snapshots, folder.snapshots, strict=True):
        np.testing.assert_array_equal(ours.position.astype(np.float32), theirs.position.astype(np.float32))
        assert ours.barrier_displacement == theirs.barrier_displacement
    assert run.summary.keys() == folder.summary.keys()
    for name, value in folder.summary.items():
        if isinstance(value, float) and name != "wall_time":
            assert run.summary[name] == pytest.approx(value, rel=1e-6), name  # volumes are of single precision there
    of_the_source = {"The program's source differed from its commit when this was run."}
    assert set(run.summary["notes"]) == set(folder.summary["notes"]) - of_the_source


def test_a_study_measures_the_same_run(folder):
    """One that records no snapshots lands on the same times here, which are multiples of the samples', and is judged by
    means over 10 ms."""
    found, series = measure(folder.scenario), dict(folder.time_series)
    assert len(series["time"]) == 161  # every 5 ms
    judged = judged_series(series)
    assert judged["time"] == pytest.approx(0.01 * np.arange(81))
    for name, values in found["curves"].items():
        assert values == pytest.approx(judged[name], rel=1e-6, abs=1e-9), name
    assert found["figures"]["peak_force"] == pytest.approx(judged["impact_force_x"].max(), rel=1e-12)
    assert found["figures"]["pore_pressure_max"] == folder.summary["pore_pressure_max"]  # of all samples


def test_a_study_that_is_given_up_says_when(load_scene):
    found = measure(load_scene("case_1", **COARSE), limit=0.0)
    assert found["status"] == "given up"
    assert found["problem"] == f"given up at t = {found['end_time']:.3g} s"
    assert 0.0 < found["end_time"] < 0.8


def script():
    place = importlib.util.spec_from_file_location("own_recorder", ROOT / "docs/develop/own_recorder.py")
    module = importlib.util.module_from_spec(place)
    place.loader.exec_module(module)
    return module


def test_recorder_of_a_script(tmp_path):
    path = script().main(tmp_path / "run", spacing=0.5, until=0.85)
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    assert table[:, 0] == pytest.approx([*np.arange(9) / 10, 0.85])  # the end too
    scene = Results.open(tmp_path / "run").scenario
    volume = scene.flow.volume
    assert table[:8, 1:].sum(axis=1) == pytest.approx(volume, rel=0.01)  # then some has passed the last strip
    assert table[0, 1:].max() == pytest.approx(scene.flow.depth, rel=0.01)


def test_a_recorder_is_closed_however_the_run_ends(load_scene, tmp_path):
    class Failing:
        closed = False

        def __init__(self):
            self.schedule = Schedule(0.2)

        def record(self, simulation):
            if simulation.time > 0.3:
                raise RuntimeError("of my own")

        def close(self):
            self.closed = True

    scene = load_scene("case_1", **COARSE)
    for run in (
        lambda recorder: run_scenario(scene, tmp_path / "run", make_simulation=Simulation, recorders=[recorder]),
        lambda recorder: run_in_memory(scene, make_simulation=Simulation, recorders=[recorder]),
    ):
        recorder = Failing()
        with pytest.raises(RuntimeError, match="of my own"):
            run(recorder)
        assert recorder.closed
    assert Results.open(tmp_path / "run").record["status"] == "failed"


def test_a_recorder_goes_on_with_a_run(load_scene, tmp_path):
    scene = load_scene("case_1", **COARSE | {"output.checkpoint_interval_s": 0.1})
    times, asked = [], []
    run_scenario(scene, tmp_path / "run", make_simulation=Simulation, stop=lambda: asked.append(0) or len(asked) > 100)
    begin = Results.open(tmp_path / "run").time_series["time"][-1]
    watcher = Watcher(Schedule(0.2), lambda simulation: times.append(simulation.time))
    resume_run(tmp_path / "run", make_simulation=Simulation, recorders=[watcher])
    assert times[0] == pytest.approx(begin, abs=0.1)
    assert times[1:] == pytest.approx([time for time in (0.2, 0.4, 0.6, 0.8) if time > times[0] + 1e-9])


def test_times_that_are_listed(load_scene):
    simulation = Simulation(load_scene("case_1", **COARSE))
    series, moments = SeriesInMemory(Moments([0.0, 0.11, 0.3])), Moments([0.11])
    seen = []
    record_until(simulation, [series, Watcher(moments, lambda one: seen.append(one.time))], 0.3)
    assert [sample["time"] for sample in series.samples] == [0.0, 0.11, 0.3]
    assert seen == [0.11, 0.3]
    assert series.series()["top_force"].shape == (3,)
