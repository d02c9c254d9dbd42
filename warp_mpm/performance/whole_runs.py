"""What a run costs beside its steps: recording, Python, the start of a process, and a neighbour on the other core."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from warp_mpm.batch import Job, run_jobs
from warp_mpm.performance.probe import clock_of
from warp_mpm.performance.table import Progress, Table
from warp_mpm.recording import Recorder, SnapshotRecorder, TimeSeriesRecorder, record_until
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation

ROUNDS = 3
"""Turns of the runs one after another and at once; the fastest of each counts."""


class _Watched:
    """Something whose call is timed, and that is otherwise as it is."""

    def __init__(self, watched: Any, call: str, clock: Callable[[], float]) -> None:
        self._watched, self._call, self._clock = watched, call, clock
        self.calls, self.spent = 0, 0.0

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._watched, name)
        if name != self._call:
            return value

        def timed(*arguments: Any, **named: Any) -> Any:
            begin = self._clock()
            try:
                return value(*arguments, **named)
            finally:
                self.spent += self._clock() - begin
                self.calls += 1

        return timed


def recording(base: Scenario, device: str, progress: Progress) -> Table:
    """Shares of a run with its records, all taken in the same run."""
    progress("recording")
    rows = []
    for spacing, end_time in ((0.2, 2.0), (0.125, 1.0)):
        scene = base.replaced({"numerics.spacing_m": spacing, "output.end_time_s": end_time})
        points, shares, each = recording_shares(scene, device=device)
        names = ("steps", "samples", "snapshots", "python")
        rows.append((f"{points:,}", *(f"{shares[name]:.1%}" for name in names), f"{each['samples'] * 1e6:.0f}"))
        rows[-1] += (f"{each['snapshots'] * 1e3:.2f}",)
    columns = (
        "points of case 1", "steps", "samples every 5 ms", "snapshots every 50 ms", "Python between them",
        "one sample [µs]", "one snapshot [ms]",
    )  # fmt: skip
    return Table("recording", "Where the time of a run goes, of the first step to the last", columns, rows)


def recording_shares(scene: Scenario, *, device: str) -> tuple[int, dict[str, float], dict[str, float]]:
    """Number of points, share of `steps`, `samples`, `snapshots` and `python` in a run's time, and the time [s] of one
    sample and one snapshot."""
    clock, output = clock_of(device), scene.output
    plain = Simulation(scene, device=device)
    plain.advance(1e-6 * output.end_time_s)
    plain.sample()
    begin = clock()
    for _ in range(1000):
        plain.advance(plain.time)
    idle = (clock() - begin) / 1000  # of an interval without a step
    simulation = _Watched(plain, "advance", clock)
    with tempfile.TemporaryDirectory() as folder:
        series = TimeSeriesRecorder(Path(folder) / "series.csv", output.time_series_interval_s)
        snapshots = SnapshotRecorder(Path(folder) / "snapshots.vtkhdf", output.snapshot_interval_s, output.end_time_s)
        watched = {"samples": _Watched(series, "record", clock), "snapshots": _Watched(snapshots, "record", clock)}
        recorders: list[Recorder] = list(watched.values())
        begin = clock()
        record_until(simulation, recorders, output.end_time_s)
        whole = clock() - begin
        for recorder in recorders:
            recorder.close()
    spent = {name: recorder.spent for name, recorder in watched.items()}
    spent["steps"] = simulation.spent - idle * simulation.calls
    spent["python"] = whole - sum(spent.values())
    each = {name: recorder.spent / recorder.calls for name, recorder in watched.items()}
    return plain.material_points, {name: seconds / whole for name, seconds in spent.items()}, each


def first_run(case: Path, progress: Progress) -> Table:
    """Time to the end of the first step in a new process, with and without kernels compiled before."""
    progress("first run, kernels compiled from nothing")
    code = (
        "import sys, time; begin = time.perf_counter()\n"
        "from warp_mpm import Scenario, Simulation\n"
        "simulation = Simulation(Scenario.load(sys.argv[1])); simulation.advance(1e-4)\n"
        "print(time.process_time(), time.perf_counter() - begin)"
    )
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"WARP_CACHE_PATH": folder, "PYTHONPATH": str(Path(__file__).parents[2])}
        for name in ("compiled from nothing", "again"):
            done = subprocess.run(
                [sys.executable, "-c", code, str(case)], env=environment, capture_output=True, text=True, check=True
            )
            busy, wall = done.stdout.split()[-2:]
            rows.append((name, f"{float(busy):.1f}", f"{float(wall):.1f}"))
    columns = ("start of case 1, to its first step", "processor [s]", "on the wall [s]")
    return Table("start", "First run and later ones", columns, rows)


def several_at_once(base: Scenario, progress: Progress) -> Table:
    """Two runs of one scene one after another, and at once as `run A B --jobs 2` does, in turns."""
    progress("two runs at once")
    scene, end_time = base, base.output.end_time_s
    measured: dict[int, list[tuple[float, float]]] = {1: [], 2: []}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "scene.json"
        file.write_text(scene.model_dump_json())
        jobs = [
            Job(run, folder / run, (str(file), "--out", str(folder / run), "--force"), end_time) for run in ("a", "b")
        ]
        for _ in range(ROUNDS):
            for at_once, taken in measured.items():
                begin, busy = time.perf_counter(), os.times()
                ends = run_jobs(jobs, at_once=at_once)
                if any(end.code != 0 for end in ends):
                    raise RuntimeError("; ".join(end.message for end in ends))
                now = os.times()
                processor = now.children_user + now.children_system - busy.children_user - busy.children_system
                taken.append((time.perf_counter() - begin, processor / len(jobs)))
    fastest = {at_once: min(wall for wall, _ in taken) for at_once, taken in measured.items()}
    leanest = {at_once: min(processor for _, processor in taken) for at_once, taken in measured.items()}
    rows = [
        ("one after the other", f"{fastest[1]:.1f}", f"{leanest[1]:.1f}", "1.00"),
        ("both at once", f"{fastest[2]:.1f}", f"{leanest[2]:.1f}", f"{fastest[1] / fastest[2]:.2f}"),
    ]
    columns = ("two runs of case 1", "on the wall [s]", "processor, each [s]", "throughput")
    return Table("several", f"Two runs on {os.cpu_count()} cores, start and figures included", columns, rows)
