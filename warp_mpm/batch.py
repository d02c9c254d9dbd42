"""Several scenes at once, each a process of its own: Warp's CPU backend uses one core for one scene."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

POLL = 0.2
"""Time between looks at the processes [s]."""


@dataclass(frozen=True)
class Job:
    """One run of the command line."""

    name: str
    folder: Path
    arguments: tuple[str, ...]
    """What follows `run` on the command line."""
    end_time: float
    """[s]."""


@dataclass(frozen=True)
class JobEnd:
    """How a job ended."""

    job: Job
    code: int
    """Exit code of `run`."""
    message: str
    """What it wrote to standard error."""


def run_jobs(
    jobs: Sequence[Job],
    *,
    at_once: int,
    on_start: Callable[[Job], None] = lambda job: None,
    on_progress: Callable[[Job, float], None] = lambda job, time: None,
    on_end: Callable[[JobEnd], None] = lambda end: None,
    stop: Callable[[], bool] = lambda: False,
) -> list[JobEnd]:
    """Run jobs, some at once, until all have ended.

    Args:
        jobs: in the order in which they begin.
        at_once: processes at the same time.
        on_start, on_end: called as a job begins and ends.
        on_progress: called with the simulated time [s] of each running job, now and then.
        stop: asked now and then; true asks the running jobs to end cleanly and begins no more.

    Returns:
        The ends of the jobs that were begun, in their order of ending.
    """
    waiting, ends = list(jobs), []
    running: dict[Job, subprocess.Popen[str]] = {}
    told = False
    try:
        while running or (waiting and not stop()):
            while waiting and len(running) < at_once and not stop():
                job = waiting.pop(0)
                running[job] = subprocess.Popen(
                    [sys.executable, "-m", "warp_mpm", "run", *job.arguments, "--quiet"],
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                    text=True,
                    start_new_session=True,  # Ctrl-C is for this process, which passes it on once
                )
                on_start(job)
            time.sleep(POLL)
            if stop() and not told:
                told = True
                for process in running.values():
                    process.terminate()
            for job, process in list(running.items()):
                if process.poll() is None:
                    on_progress(job, _simulated_time(job.folder))
                    continue
                del running[job]
                assert process.stderr is not None
                end = JobEnd(job, process.returncode, process.stderr.read().strip())
                process.stderr.close()
                ends.append(end)
                on_end(end)
    finally:
        for process in running.values():
            process.terminate()
    return ends


def _simulated_time(folder: Path) -> float:
    """Time of the last sample [s]; 0 before the first."""
    try:
        with (folder / "timeseries.csv").open("rb") as file:
            file.seek(0, 2)
            file.seek(max(file.tell() - 2000, 0))
            lines = file.read().split(b"\n")
        return float(lines[-2].split(b",")[0])
    except (OSError, ValueError, IndexError):
        return 0.0
