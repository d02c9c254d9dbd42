"""Many runs go through one engine; a study from Python is a table."""

import importlib.util
import os
import signal
import time
from pathlib import Path

import pytest

from warp_mpm.engine import Ended, Processes, Standing, Task, cores
from warp_mpm.results import Results
from warp_mpm.sweep import SweepError, study

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no shares of cores to ask for here")
def test_no_more_cores_than_this_process_may_use(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3, 5})
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    assert cores() == 2


def test_results_and_problems_of_tasks():
    tasks = [
        Task("right", divmod, (7, 2)),
        Task("wrong", divmod, (7, 0)),
        Task("killed", os._exit, (9,)),
        Task("last", divmod, (9, 2)),
    ]
    begun = []
    ended = {one.task.name: one for one in Processes(2).run(tasks, on_start=lambda task: begun.append(task.name))}
    assert begun == ["right", "wrong", "killed", "last"]
    assert ended["right"].result == (3, 1)
    assert ended["wrong"].problem.startswith("ZeroDivisionError: ")
    assert not ended["wrong"].died
    assert (ended["killed"].died, ended["killed"].exit_code) == (True, 9)
    assert ended["last"].result == (4, 1)  # whose neighbour was killed


def test_no_more_at_once_than_asked():
    running, most = set(), []

    def began(task):
        running.add(task.name)
        most.append(len(running))

    for one in Processes(2).run([Task(str(k), time.sleep, (0.05,)) for k in range(5)], on_start=began):
        running.discard(one.task.name)
    assert max(most) == 2
    assert len(most) == 5


def test_stop_begins_no_more_and_ends_what_runs():
    looked = []
    ended = list(
        Processes(1).run(
            [Task("long", time.sleep, (600,)), Task("never", time.sleep, (0,))],
            on_look=lambda task: looked.append(task.name),
            stop=lambda: len(looked) > 0,
        )
    )
    assert [(one.task.name, one.exit_code) for one in ended] == [("long", -signal.SIGTERM)]


def test_whoever_breaks_off_leaves_nothing_running():
    runs = Processes(2).run([Task("short", os.getpid, ()), Task("long", signal.pause, ())])
    assert next(runs).task.name == "short"
    import multiprocessing

    (left,) = multiprocessing.active_children()
    runs.close()
    left.join(20)
    assert left.exitcode == -signal.SIGTERM


def in_this_process(self, tasks, *, on_start=lambda task: None, **rest):
    """Starting a process takes longer than a case of the study; test_sweep.py has cases in processes of their own."""
    for task in tasks:
        on_start(task)
        yield Ended(task, task.function(*task.arguments))


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    place = importlib.util.spec_from_file_location("parameter_study", ROOT / "docs/develop/parameter_study.py")
    script = importlib.util.module_from_spec(place)
    place.loader.exec_module(script)
    folder = tmp_path_factory.mktemp("study") / "study"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Processes, "run", in_this_process)
        return script.main(folder, spacing=1.0, until=0.4), folder, script


def test_study_is_a_table_of_key_figures(frame):
    table, folder, _ = frame
    assert list(table["status"]) == ["finished"] * 4
    assert list(table["flow.velocity_m_per_s.0"]) == [10, 10, 20, 20]
    assert table.attrs["units"]["impulse"] == "N s/m"
    for number, row in table.iterrows():
        case = Results.open(folder / "cases" / f"{number:05d}")
        assert case.scenario.flow.velocity_m_per_s[0] == row["flow.velocity_m_per_s.0"]
        assert case.summary["peak_force"] == row["peak_force"]
    assert table["peak_force"].iloc[2] > table["peak_force"].iloc[0] > 0.0


def test_study_goes_on_with_what_is_missing(frame, monkeypatch):
    table, folder, script = frame
    monkeypatch.setattr(Processes, "run", lambda self, tasks, **rest: iter([]) if not tasks else pytest.fail("ran"))
    assert script.main(folder, spacing=1.0, until=0.4).equals(table)


def test_study_that_cannot_be(load_scene, tmp_path):
    scene = load_scene("case_1")
    with pytest.raises(SweepError, match=r"flow.material.porosity.*1.4"):
        study(scene, {"flow.material.porosity": [0.5, 1.4]}, tmp_path / "study")
    with pytest.raises(SweepError, match=r"study: .*needs distributions"):
        study(scene, {"flow.material.porosity": [0.5]}, tmp_path / "study", method="random", samples=3)
    assert not (tmp_path / "study").exists()


def test_processes_that_stay():
    """One for all tasks, of this call and the next; one that dies is replaced, and none is left at the end."""
    with Standing(1) as engine:
        first, second = engine.run([Task("first", os.getpid, ()), Task("second", os.getpid, ())])
        assert first.result == second.result != os.getpid()
        wrong, died = engine.run([Task("wrong", divmod, (7, 0)), Task("dies", os._exit, (9,))])
        assert wrong.problem.startswith("ZeroDivisionError: ")
        assert (died.died, died.exit_code) == (True, 9)
        (third,) = engine.run([Task("third", os.getpid, ())])
        assert third.result not in (first.result, os.getpid())
        # Whoever breaks off ends what runs, and can go on with others.
        long = engine.run([Task("long", time.sleep, (600,))], on_look=lambda task: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            next(long)
        (fourth,) = engine.run([Task("fourth", os.getpid, ())])
        last = fourth.result
    gone = time.monotonic() + 10.0
    while time.monotonic() < gone and Path(f"/proc/{last}").exists():
        time.sleep(0.05)
    assert not Path(f"/proc/{last}").exists()
