"""A simulation that is asked to stop does so between two steps, and no step changes by it; how commands are ended."""

import os
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from analytic.command_line import CommandLine, add_version, ended_as_by_ctrl_c
from analytic.whole_file import whole_file
from warp_mpm import batch, cli
from warp_mpm import simulation as stepping
from warp_mpm.results import Results
from warp_mpm.run import resume_run, run_scenario
from warp_mpm.simulation import Simulation
from warp_mpm.terminal import StopOnSignal

ROOT = Path(__file__).parents[2]


@pytest.fixture(params=["sliding", "prescribed"])
def scenario(request, load_scene):
    motion = {"kind": "prescribed", "times_s": [0.0, 0.1, 0.2], "velocities_m_per_s": [0.0, -1.0, 2.0]}
    changes = {"barrier.motion": motion} if request.param == "prescribed" else {}
    return load_scene("case_1", **{"numerics.spacing_m": 1.0}, **changes)


@pytest.mark.parametrize("steps_at_once", [1, 3])
def test_looking_up_changes_no_step(scenario, monkeypatch, steps_at_once):
    whole = Simulation(scenario)
    for time in (0.1, 0.2):
        whole.advance(time)
    monkeypatch.setattr(stepping, "MOST_STEPS_AT_ONCE", steps_at_once)
    pieces, looks = Simulation(scenario), []
    pieces._steps_at_once = steps_at_once
    for time in (0.1, 0.2):
        pieces.advance(time, stop=lambda: bool(looks.append(pieces.steps)))
    assert looks[:3] == [steps_at_once, 2 * steps_at_once, 3 * steps_at_once]
    assert pieces.save_state() == whole.save_state()


def test_a_stop_within_an_interval_loses_nothing(scenario, monkeypatch):
    whole = Simulation(scenario)
    for time in (0.1, 0.2):
        whole.advance(time)
    monkeypatch.setattr(stepping, "MOST_STEPS_AT_ONCE", 1)
    stopped = Simulation(scenario)
    stopped._steps_at_once = 1
    stopped.advance(0.1, stop=lambda: stopped.steps == 4)
    assert (stopped.steps, stopped.time < 0.1) == (4, True)
    again = Simulation(scenario)
    again.restore_state(stopped.save_state())
    for time in (0.1, 0.2):
        again.advance(time)
    assert again.save_state() == whole.save_state()


def test_ctrl_c_is_heard_within_an_interval(scenario, monkeypatch):
    """Python's own handler, as in a notebook: the signal comes while the device is at work."""
    monkeypatch.setattr(stepping, "MOST_STEPS_AT_ONCE", 1)
    simulation = Simulation(scenario)
    simulation._steps_at_once = 1
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            simulation.advance(0.2, stop=lambda: simulation.steps == 3 and bool(os.kill(os.getpid(), signal.SIGINT)))
    finally:
        signal.signal(signal.SIGINT, before)
    assert simulation.steps == 3
    simulation.advance(0.2)
    assert simulation.time == 0.2


def test_a_run_that_was_stopped_within_an_interval_goes_on_bit_for_bit(scenario, tmp_path, monkeypatch):
    scenario = scenario.replaced(
        {"output.end_time_s": 0.3, "output.time_series_interval_s": 0.1, "output.snapshot_interval_s": 0.1}
    )
    run_scenario(scenario, tmp_path / "whole", make_simulation=Simulation)
    monkeypatch.setattr(stepping, "MOST_STEPS_AT_ONCE", 1)
    made = []

    def simulation(scene):
        made.append(Simulation(scene))
        made[-1]._steps_at_once = 1
        return made[-1]

    outcome = run_scenario(scenario, tmp_path / "cut", make_simulation=simulation, stop=lambda: made[-1].time > 0.13)
    assert not outcome.finished
    assert 0.13 < Results.open(tmp_path / "cut").time_series["time"][-1] < 0.2
    assert resume_run(tmp_path / "cut", make_simulation=Simulation).finished
    one, other = (Results.open(tmp_path / name) for name in ("whole", "cut"))
    for name, values in one.time_series.items():
        np.testing.assert_array_equal(values, other.time_series[name])
    for name, values in one.snapshots[-1].fields.items():
        np.testing.assert_array_equal(values, other.snapshots[-1][name])


# -- the command line --------------------------------------------------------------------------------------------------

ENDS = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]


@pytest.fixture
def unheard():
    """What nobody hears fails the test, and does not end the process that runs it."""

    def fail(number, frame):
        raise AssertionError(f"nobody heard {signal.Signals(number).name}")

    before = {number: signal.signal(number, fail) for number in ENDS}
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a process in the background does without
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def send(number):
    os.kill(os.getpid(), number)


@pytest.mark.parametrize("number", ENDS)
def test_a_run_is_asked_to_stop_and_asked_twice_ends_at_once(unheard, number):
    before = [signal.getsignal(one) for one in ENDS]
    with StopOnSignal() as stop:
        assert not stop.received
        send(number)
        assert stop.received
        with pytest.raises(KeyboardInterrupt):
            send(number)
    with StopOnSignal() as stop, pytest.raises(KeyboardInterrupt), stop.at_once():
        send(number)
    assert [signal.getsignal(one) for one in ENDS] == before


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminals that hang up here")
def test_what_nohup_has_ignored_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_as_by_ctrl_c(), StopOnSignal() as stop:
            send(signal.SIGHUP)
        assert not stop.received
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", ENDS)
def test_any_command_tidies_up_before_it_ends(number, tmp_path, unheard):
    app = typer.Typer(cls=CommandLine)
    add_version(app)  # of one command alone Typer makes no group

    @app.command()
    def work():
        with whole_file(tmp_path / "file"):
            send(number)

    assert CliRunner().invoke(app, ["work"]).exit_code == 130
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("package", ["warp_mpm", "analytic", "fmu"])
def test_ctrl_c_while_the_command_line_is_loaded_shows_no_traceback(package, monkeypatch):
    def interrupted():
        raise KeyboardInterrupt

    loaded = ModuleType(f"{package}.cli")
    loaded.main = interrupted
    monkeypatch.setitem(sys.modules, f"{package}.cli", loaded)
    monkeypatch.setattr(import_module(package), "cli", loaded, raising=False)
    with pytest.raises((SystemExit, KeyboardInterrupt)) as end:  # the latter would end pytest
        import_module(f"{package}.__main__").main()
    assert (end.type, end.value.args) == (SystemExit, (130,))


def test_ctrl_c_while_kernels_are_compiled_leaves_nothing(load_scene, flying_points, tmp_path, monkeypatch):
    """And a run that goes on is as it was."""
    true_prepare, asked = Simulation.prepare, []

    def prepare(self):
        if self not in asked:
            asked.append(self)
            send(signal.SIGINT)
        true_prepare(self)

    monkeypatch.setattr(Simulation, "prepare", prepare)
    scene = "scenarios/case_1.json"
    answer = CliRunner().invoke(cli.app, ["run", str(ROOT / scene), "--spacing", "1", "--out", str(tmp_path / "new")])
    assert (answer.exit_code, (tmp_path / "new").exists()) == (130, False)
    short = load_scene("case_1", **{"numerics.spacing_m": 1.0, "output.end_time_s": 0.5})
    run_scenario(short, tmp_path / "run", make_simulation=flying_points, stop=lambda: True)
    files = {file: file.read_bytes() for file in (tmp_path / "run").iterdir()}
    assert CliRunner().invoke(cli.app, ["run", "--resume", str(tmp_path / "run")]).exit_code == 130
    assert {file: file.read_bytes() for file in (tmp_path / "run").iterdir()} == files


@pytest.mark.parametrize(
    ("code", "message"), [(-signal.SIGTERM, "the process died, for want of memory perhaps"), (130, "")]
)
def test_a_run_among_several_that_had_not_begun_is_told(tmp_path, monkeypatch, unheard, code, message):
    def run_jobs(jobs, **calls):
        send(signal.SIGTERM)
        return [batch.JobEnd(jobs[0], code, message)]

    monkeypatch.setattr(batch, "run_jobs", run_jobs)
    scenes = [str(ROOT / "scenarios" / f"{name}.json") for name in ("case_1", "case_2")]
    answer = CliRunner().invoke(cli.app, ["run", *scenes, "--out", str(tmp_path)])
    assert answer.exit_code == 130
    assert "case_1: stopped before it had begun.\n" in answer.stderr


def test_workers_end_with_the_process_that_began_them():
    """Killed, for want of memory say: they hold its standard output, which ends with the last of them."""
    code = (
        "import multiprocessing, time; from warp_mpm.engine import Processes, Task\n"
        "def began(task): print(multiprocessing.active_children()[0].pid, flush=True)\n"
        "if __name__ == '__main__':\n"
        "    list(Processes(1).run([Task('long', time.sleep, (60,))], on_start=began))\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        worker = int(process.stdout.readline())
        process.kill()
        try:
            process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            os.kill(worker, signal.SIGKILL)
            pytest.fail("a worker outlived the process that began it")


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no groups of processes here")
def test_ctrl_c_at_a_terminal_is_for_the_process_that_begins_workers():
    """It goes to the whole group, of which a worker that starts still is one."""
    code = (
        "import os, signal; from warp_mpm.engine import Processes, Task\n"
        "if __name__ == '__main__':\n"
        "    signal.signal(signal.SIGINT, lambda *heard: print('heard'))\n"
        "    began = lambda task: os.killpg(0, signal.SIGINT)\n"
        "    print([one.result for one in Processes(1).run([Task('one', divmod, (7, 2))], on_start=began)])\n"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, start_new_session=True, check=True
    )
    assert (answer.stdout, answer.stderr) == ("heard\n[(3, 1)]\n", "")


def test_a_run_among_several_whose_parent_was_killed_is_kept(tmp_path):
    """It stops as if it had been asked to, with all that it has computed."""
    code = (
        "import os, signal, sys; from pathlib import Path; from warp_mpm.batch import Job, run_jobs\n"
        "def look(job, time):\n"
        "    if time > 0.0: os.kill(os.getpid(), signal.SIGKILL)\n"
        "if __name__ == '__main__':\n"
        "    folder = sys.argv[1]\n"
        "    options = ('--spacing', '1', '--until', '300', '--no-pictures', '--out', folder)\n"
        "    run_jobs([Job('run', Path(folder), ('scenarios/case_1.json', *options), 300.0)], at_once=1,\n"
        "             on_progress=look)\n"
    )
    # What it prints ends with the last process that holds it.
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "run")], cwd=ROOT, stdout=subprocess.PIPE, timeout=100)
    assert Results.open(tmp_path / "run").summary["status"] == "stopped"
