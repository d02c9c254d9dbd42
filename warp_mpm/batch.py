"""Several scenes at once, each a process of its own: Warp's CPU backend uses one core for one scene."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from warp_mpm.engine import Processes, Task


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
    by_name = {job.name: job for job in jobs}
    ends = []
    for ended in Processes(at_once).run(
        [Task(job.name, run_command, (job.arguments,)) for job in jobs],
        on_start=lambda task: on_start(by_name[task.name]),
        on_look=lambda task: on_progress(by_name[task.name], _simulated_time(by_name[task.name].folder)),
        stop=stop,
    ):
        code, message = (ended.exit_code or 1, ended.problem or "") if ended.result is None else ended.result
        ends.append(JobEnd(by_name[ended.task.name], code, message))
        on_end(ends[-1])
    return ends


def run_command(arguments: Sequence[str]) -> tuple[int, str]:
    """`warp-mpm run` with these arguments in this process; its exit code, and what it wrote to standard error."""
    from warp_mpm.__main__ import main

    with tempfile.TemporaryFile("w+", encoding="utf-8") as told, open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(told.fileno(), 2)
        os.dup2(nowhere.fileno(), 1)
        sys.argv = ["warp-mpm", "run", *arguments, "--quiet"]
        code: Any = 0
        try:
            main()
        except SystemExit as end:
            code = end.code
        sys.stderr.flush()
        told.seek(0)
        return code if isinstance(code, int) else int(code is not None), told.read().strip()


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
