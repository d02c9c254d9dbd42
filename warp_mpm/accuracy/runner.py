"""Runs the settings of studies on all cores; what was done is not done again."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analytic.whole_file import write_whole
from warp_mpm.accuracy.measure import measure
from warp_mpm.accuracy.study import Setting
from warp_mpm.engine import Processes, Task
from warp_mpm.scenario import Scenario

Result = dict[str, Any]
"""As from `measure`."""


EXPLICIT_DRAG = 40.0
"""Cost of explicit drag over that of semi-implicit drag, as measured on the coarsest grid of case 1."""


@dataclass(frozen=True)
class StudyProgress:
    """Where a study stands."""

    done: int
    running: tuple[str, ...]
    """Names of the settings that run now."""
    left: int
    """Runs not yet begun."""
    time_left: float | None
    """Wall time [s] that is left; None until it can be told."""


class StudyError(ValueError):
    """A study that cannot be made; one sentence."""


def run_settings(
    settings: Sequence[Setting],
    folder: Path,
    *,
    jobs: int,
    on_progress: Callable[[StudyProgress], None] = lambda progress: None,
) -> dict[str, Result]:
    """Results of all settings by their keys.

    Each result is written into `folder` as its run ends, under the hash of all that decides its numbers; what is there
    is not run again. Interrupted, the runs that have not ended are lost, and nothing else.

    Args:
        settings: what to run.
        folder: of the results; made if need be.
        jobs: processes at the same time.
        on_progress: called as runs begin and end.

    Raises:
        StudyError: a worker died, for want of memory say.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found = {key: result for key in {s.key for s in settings} if (result := _read(folder / f"{key}.json")) is not None}
    # The dearest first, so that no core waits for a long one at the end.
    missing = {setting.key: setting for setting in settings if setting.key not in found}
    waiting = sorted(missing.values(), key=_cost, reverse=True)
    whole, started = sum(map(_cost, waiting)), time.perf_counter()
    spent, done = 0.0, len(found)
    on_progress(StudyProgress(done, (), len(waiting), None))
    if not waiting:
        return found
    running: dict[str, Setting] = {}

    def began(task: Task) -> None:
        running[task.name] = by_key[task.name]
        tell()

    def tell() -> None:
        elapsed = time.perf_counter() - started
        left = (whole - spent) * elapsed / spent if spent else None
        names = tuple(setting.name for setting in running.values())
        on_progress(StudyProgress(done, names, len(waiting) - done - len(running) + known, left))

    by_key, known = {setting.key: setting for setting in waiting}, done
    tasks = [
        Task(setting.key, run_setting, (setting.scenario.resolved(), str(folder / f"{setting.key}.json")))
        for setting in waiting
    ]
    for ended in Processes(jobs).run(tasks, on_start=began):
        setting = running.pop(ended.task.name)
        if ended.problem is not None:
            reason = "A run was killed, for want of memory perhaps" if ended.died else f"A run failed ({ended.problem})"
            raise StudyError(
                f"{reason}; the runs that ended are in {folder}, and the same command goes on from there, with fewer "
                "at a time by --jobs."
            )
        found[setting.key] = ended.result
        spent, done = spent + _cost(setting), done + 1
    on_progress(StudyProgress(done, (), 0, 0.0))
    return found


def run_setting(scenario: dict[str, Any], path: str) -> Result:
    """Run one setting in a worker and write its result, whole or not at all."""
    result = measure(Scenario.model_validate(scenario), profile=True)
    write_whole(Path(path), json.dumps(result))
    return result


def _read(path: Path) -> Result | None:
    """A result that was written before; None where there is none that can be used."""
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return result if isinstance(result, dict) and "figures" in result else None


def _cost(setting: Setting) -> float:
    """Relative cost of a run: points and steps."""
    scenario, numerics = setting.scenario, setting.scenario.numerics
    points = numerics.points_per_cell / numerics.spacing_m**2 * scenario.flow.volume
    steps = scenario.output.end_time_s / (numerics.courant_number * numerics.spacing_m)
    return points * steps * (EXPLICIT_DRAG if numerics.drag == "explicit" else 1.0)
