"""Runs that are interrupted, whatever the way: nothing that was computed is lost, and they go on bit for bit."""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from warp_mpm.recording import run_folder
from warp_mpm.recording.run_folder import RunFolderError
from warp_mpm.results import Results
from warp_mpm.run import resume_run, run_scenario
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation

ROOT = Path(__file__).parents[2]


def start(*arguments, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "warp_mpm", "run", "--no-pictures", *map(str, arguments)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def arrays(folder):
    """All numbers of a run's snapshots."""
    found = {}
    with h5py.File(folder / run_folder.SNAPSHOTS) as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


def assert_same_run(folder, whole):
    assert (folder / run_folder.TIME_SERIES).read_bytes() == (whole / run_folder.TIME_SERIES).read_bytes()
    ours, theirs = arrays(folder), arrays(whole)
    assert ours.keys() == theirs.keys()
    for name, values in theirs.items():
        assert np.array_equal(ours[name], values, equal_nan=values.dtype.kind == "f"), name
    assert Results.open(folder).record["status"] == "finished"
    assert not (folder / run_folder.CHECKPOINT).exists()


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A coarse run of Set IIb that nobody interrupts, its scenario file and its wall time without start and end."""
    folder = tmp_path_factory.mktemp("whole")
    scenario = Scenario.load(ROOT / "scenarios" / "set_iib.json").replaced(
        {"numerics.spacing_m": 0.5, "output.end_time_s": 1.5, "output.checkpoint_interval_s": 0.1}
    )
    run_scenario(scenario, folder / "run", make_simulation=Simulation)
    return folder / "run", scenario, Results.open(folder / "run").record["wall_time"]


def go_on(folder, *, in_process):
    """To the end by the command line, or in this process, which spares starting one and drawing pictures."""
    if in_process:
        assert resume_run(folder, make_simulation=Simulation).finished
        return
    goes_on = start("--resume", folder, "--quiet")
    _, complaint = goes_on.communicate(timeout=300)
    assert goes_on.returncode == 0, complaint


KILLS = [pytest.param(seed, marks=[pytest.mark.slow] if seed >= 1 else []) for seed in range(20)]


@pytest.mark.parametrize("seed", KILLS)
def test_killed_at_a_random_moment_it_goes_on_bit_for_bit(tmp_path, whole, seed):
    reference, _, wall_time = whole
    folder = tmp_path / "run"
    running = start(reference / "scenario.json", "--out", folder)
    while not (folder / run_folder.RECORD).exists():
        assert running.poll() is None, running.stderr.read()
        time.sleep(0.001)
    # From its first moment until after its last, the figures at the end included.
    time.sleep(random.Random(seed).uniform(0.0, 1.5 * wall_time))
    running.send_signal(signal.SIGKILL)
    running.communicate()
    go_on(folder, in_process=seed % 3 > 0)
    assert_same_run(folder, reference)


def test_stopped_in_time_and_again(tmp_path, whole):
    """Ctrl-C between checkpoints and between snapshots, twice, in one process."""
    reference, scenario, _ = whole
    seen = []
    run_scenario(
        scenario,
        tmp_path / "run",
        make_simulation=Simulation,
        on_progress=lambda progress: seen.append(progress.time),
        stop=lambda: bool(seen) and seen[-1] > 0.73,
    )
    resume_run(
        tmp_path / "run",
        make_simulation=Simulation,
        on_progress=lambda progress: seen.append(progress.time),
        stop=lambda: seen[-1] > 1.12,
    )
    assert Results.open(tmp_path / "run").record["status"] == "stopped"
    resume_run(tmp_path / "run", make_simulation=Simulation)
    assert_same_run(tmp_path / "run", reference)
    resumed = Results.open(tmp_path / "run").record["resumed"]
    assert [event["simulated_time"] for event in resumed] == pytest.approx([0.74, 1.13])


def test_kernels_are_compiled_before_the_clock_starts(tmp_path, coarse_case_1, flying_points):
    """Of a run and of one that goes on: their compilation is no part of the wall time."""
    calls = []

    class Told(flying_points):
        def prepare(self):
            calls.append("prepare")

        def advance(self, until, **stop):
            calls.append("advance")
            super().advance(until, **stop)

    run_scenario(coarse_case_1, tmp_path / "run", make_simulation=Told, stop=lambda: len(calls) > 3)
    assert calls.count("prepare") == 1
    assert calls[0] == "prepare"
    calls.clear()
    resume_run(tmp_path / "run", make_simulation=Told)
    assert calls.count("prepare") == 1
    assert calls[0] == "prepare"
    record = Results.open(tmp_path / "run").record
    assert record["preparation_time"] > 0.0
    assert record["resumed"][0]["preparation_time"] > 0.0


def test_records_that_only_the_stop_called_for_are_dropped(tmp_path, coarse_case_1, flying_points):
    """Stopped at a snapshot between two samples: the time series got a sample that is not in its schedule."""
    scenario = coarse_case_1.replaced({"output.snapshot_interval_s": 0.0371})
    run_scenario(scenario, tmp_path / "whole", make_simulation=flying_points)
    seen = []
    run_scenario(
        scenario,
        tmp_path / "run",
        make_simulation=flying_points,
        on_progress=lambda progress: seen.append(progress.time),
        stop=lambda: bool(seen) and seen[-1] == pytest.approx(0.515),  # the next stretch ends at 0.5194 s
    )
    assert Results.open(tmp_path / "run").time_series["time"][-1] == pytest.approx(0.5194)
    resume_run(tmp_path / "run", make_simulation=flying_points)
    assert_same_run(tmp_path / "run", tmp_path / "whole")


def test_what_was_written_after_the_checkpoint_is_cut_off(stopped, flying_points):
    path = stopped / run_folder.TIME_SERIES
    content = path.read_text()
    path.write_text(content + 100 * content.splitlines(keepends=True)[-1] + "1.0,2.0,")
    resume_run(stopped, make_simulation=flying_points, stop=lambda: True)
    time = Results.open(stopped).time_series["time"]
    assert np.diff(time) == pytest.approx(0.005)
    assert path.read_text().endswith("\n")


def test_checkpoints_do_not_change_the_run(tmp_path, whole):
    reference, scenario, _ = whole
    changed = scenario.replaced({"output.checkpoint_interval_s": 0.0137})
    run_scenario(changed, tmp_path / "run", make_simulation=Simulation)
    assert_same_run(tmp_path / "run", reference)


@pytest.fixture
def stopped(tmp_path, coarse_case_1, flying_points):
    """A run that was stopped at 1.2 s, with a stand-in for the simulation."""
    times = []
    run_scenario(
        coarse_case_1,
        tmp_path / "run",
        make_simulation=flying_points,
        on_progress=lambda progress: times.append(progress.time),
        stop=lambda: bool(times) and times[-1] >= 1.199,
    )
    return tmp_path / "run"


def cut(name, size=0.5):
    def spoil(folder):
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(size * len(content))])

    return spoil


def replaced(name, old, new):
    def spoil(folder):
        content = (folder / name).read_bytes()
        assert old in content
        (folder / name).write_bytes(content.replace(old, new, 1))

    return spoil


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (cut("checkpoint.bin"), "checkpoint.bin is damaged or no checkpoint"),
        (cut("checkpoint.bin", 0.0), "checkpoint.bin is damaged or no checkpoint"),
        (
            replaced("checkpoint.bin", b'"format": 1', b'"format": 2'),
            "checkpoint.bin is damaged: its check sum is wrong",
        ),
        (replaced("scenario.json", b'"squares": 3', b'"squares": 4'), "belongs to another scene"),
        (cut("timeseries.csv"), "timeseries.csv is damaged: it does not reach to the checkpoint"),
        (cut("snapshots.vtkhdf"), "snapshots.vtkhdf is damaged"),
        (lambda folder: (folder / "snapshots.vtkhdf").unlink(), "snapshots.vtkhdf cannot be read: No such file"),
        (lambda folder: (folder / "timeseries.csv").unlink(), "timeseries.csv cannot be read"),
        (lambda folder: (folder / "scenario.json").unlink(), "ended before it began"),
    ],
)
def test_what_cannot_go_on_is_left_as_it_is(stopped, flying_points, spoil, sentence):
    spoil(stopped)
    names = [item.name for item in stopped.iterdir() if item.name not in ("run.json", "snapshots.vtkhdf")]
    before = {name: (stopped / name).read_bytes() for name in names}
    with pytest.raises(RunFolderError, match=sentence) as caught:
        resume_run(stopped, make_simulation=flying_points)
    assert "\n" not in str(caught.value)
    assert {name: (stopped / name).read_bytes() for name in names} == before


def test_a_checkpoint_of_another_version(stopped, flying_points, monkeypatch):
    monkeypatch.setattr("warp_mpm.recording.checkpoint.versions", lambda: {"warp-mpm-impact": "9.9", "warp-lang": "1"})
    with pytest.raises(RunFolderError, match=r"written by another version \(.*; here is warp-mpm-impact 9.9"):
        resume_run(stopped, make_simulation=flying_points)


def test_a_checkpoint_that_fits_no_longer(stopped, coarse_case_1):
    # The stand-in's state is not that of a simulation.
    with pytest.raises(RunFolderError, match=r"cannot be used: the state does not fit this scenario"):
        resume_run(stopped, make_simulation=Simulation)


def test_a_second_run_is_kept_out_of_a_folder_in_use(stopped, coarse_case_1, flying_points):
    class Meddled(flying_points):
        def advance(self, until, **stop):
            if until > 2.0:
                for meddle in (
                    lambda: resume_run(stopped, make_simulation=flying_points),
                    lambda: run_scenario(coarse_case_1, stopped, make_simulation=flying_points, force=True),
                ):
                    with pytest.raises(RunFolderError, match="Another run is writing to"):
                        meddle()
            super().advance(until, **stop)

    assert resume_run(stopped, make_simulation=Meddled).finished


@pytest.mark.parametrize("share", [pytest.param(0.02, marks=pytest.mark.slow), 0.4])
def test_a_full_disk_ends_the_run_in_one_sentence_and_it_goes_on_afterwards(tmp_path, whole, share):
    """A limit on the size of files stands for a full disk; the snapshots meet it at once, or in the middle."""
    reference, _, _ = whole
    folder = tmp_path / "run"
    limit = int(share * (reference / run_folder.SNAPSHOTS).stat().st_size)

    def small_disk():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))

    filled = start(reference / "scenario.json", "--out", folder, preexec_fn=small_disk)
    _, complaint = filled.communicate(timeout=300)
    assert filled.returncode == 2, complaint
    assert f"Cannot write to {folder}: File too large. What was written before is kept" in complaint
    assert "Traceback" not in complaint
    assert not [item for item in folder.iterdir() if item.name.endswith(run_folder.ASIDE)]
    go_on(folder, in_process=share > 0.1)
    assert_same_run(folder, reference)


def test_a_checkpoint_that_cannot_be_written_leaves_the_one_before(tmp_path, whole, monkeypatch):
    reference, scenario, _ = whole
    left = [7]

    def fsync(descriptor):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(28, "No space left on device")

    with monkeypatch.context() as context:
        context.setattr(os, "fsync", fsync)
        with pytest.raises(OSError, match="No space left"):
            run_scenario(scenario, tmp_path / "run", make_simulation=Simulation)
    record = Results.open(tmp_path / "run").record
    assert record["status"] == "running"  # not even that could be written
    resume_run(tmp_path / "run", make_simulation=Simulation)
    assert Results.open(tmp_path / "run").record["resumed"][0]["simulated_time"] > 0.0
    assert_same_run(tmp_path / "run", reference)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_to(tmp_path, whole):
    tmp_path.chmod(0o500)
    running = start(whole[0] / "scenario.json", "--out", tmp_path / "run")
    _, complaint = running.communicate(timeout=300)
    assert running.returncode == 2
    assert "Cannot write to" in complaint
    assert "Traceback" not in complaint
