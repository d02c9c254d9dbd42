"""Coarse runs, many at a time, that leave their key figures in a folder: what is there is not run again."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from analytic.whole_file import write_whole
from warp_mpm.accuracy.keys import run_key
from warp_mpm.accuracy.spacings import aligned
from warp_mpm.by_simulation.limits import figures_of, without_limits
from warp_mpm.engine import Engine, Standing, Task
from warp_mpm.recording.run_folder import finite
from warp_mpm.run import run_in_memory
from warp_mpm.scenario import Scenario

COARSE_CELLS = 5.0
"""Cells in the flow's depth of a coarse run."""

FOLDER = "trials"
"""Of the records, in the folder of a search."""

MARK = "by_simulation.json"
"""By which a folder is known as that of a search, with what was asked of it."""

UNREAD = ("definitions", "mechanism_measures", "notes")
"""Groups of a summary that a trial does not keep."""


@dataclass(frozen=True)
class Run:
    """What a run gave."""

    scenario: Scenario
    figures: Mapping[str, Any] | None
    """By the names of limits, SI; None where it failed."""
    problem: str | None
    """Why it failed."""
    wall_time: float
    """[s]"""


class RunError(ValueError):
    """Runs that cannot be made, or a folder that cannot be used; one sentence."""


MakeSimulation = Callable[[Scenario], Any]


class Runs:
    """Makes runs in processes of this machine and keeps what they gave. A context manager, which ends the processes."""

    def __init__(
        self,
        folder: Path,
        *,
        jobs: int,
        device: str = "cpu",
        make_simulation: MakeSimulation | None = None,
        engine: Engine | None = None,
        on_progress: Callable[[int, int], None] = lambda done, total: None,
    ):
        """Begin with what is in the folder.

        Args:
            folder: of the search, claimed by `claim`.
            jobs: processes at a time.
            device: of the simulations.
            make_simulation: stands in for the simulation, in tests.
            engine: in place of processes that stay, of which it then makes no use.
            on_progress: called with the number of runs that have ended of those begun together.
        """
        self.folder, self.device = folder / FOLDER, device
        self.made, self.found = 0, 0
        self._standing = Standing(jobs)
        self._engine: Engine = self._standing if engine is None else engine
        self._make, self._tell = make_simulation, on_progress

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *of_an_error: object) -> None:
        self._standing.__exit__()

    def __call__(self, scenarios: Sequence[Scenario]) -> list[Run]:
        """What these scenarios give, in their order. Interrupted, the runs that have not ended are lost, and no other.

        Raises:
            RunError: a process died.
        """
        files = [self.folder / f"{run_key(scenario)}.json" for scenario in scenarios]
        waiting = {file: scenario for file, scenario in zip(files, scenarios, strict=True) if read_record(file) is None}
        self.found += len(set(files)) - len(waiting)
        if waiting:
            self._run(waiting)
        return [self._read(file, scenario) for file, scenario in zip(files, scenarios, strict=True)]

    def _run(self, waiting: Mapping[Path, Scenario]) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        # The dearest first, so that no core waits for a long one at the end.
        tasks = [
            Task(file.stem, run_one, (waiting[file].resolved(), str(file.resolve()), self.device, self._make))
            for file in sorted(waiting, key=lambda file: _cost(waiting[file]), reverse=True)
        ]
        self._tell(0, len(tasks))
        for done, ended in enumerate(self._engine.run(tasks), start=1):
            if ended.problem is not None:
                raise RunError(
                    f"A run could not be made ({ended.problem}); those that ended are in {self.folder}, and the same "
                    "command goes on from there, with fewer at a time by --jobs."
                )
            self.made += 1
            self._tell(done, len(tasks))

    def _read(self, file: Path, scenario: Scenario) -> Run:
        record = read_record(file)
        if record is None:
            raise RunError(f"{file} cannot be read, though its run has ended.")
        summary = record["summary"]
        return Run(
            scenario, None if summary is None else figures_of(summary), record["problem"], float(record["wall_time"])
        )


def run_one(scenario: dict[str, Any], file: str, device: str, make_simulation: MakeSimulation | None) -> None:
    """Of a process: run a scenario and write its record, whole or not at all."""
    write_whole(Path(file), json.dumps(finite(record_of(Scenario.model_validate(scenario), device, make_simulation))))


def record_of(scenario: Scenario, device: str, make_simulation: MakeSimulation | None) -> dict[str, Any]:
    """Run a scenario in memory: `summary`, or None and the `problem`, and `wall_time` [s]."""

    def simulation(scene: Scenario) -> Any:
        from warp_mpm.simulation import Simulation

        return Simulation(scene, device=device)

    started, summary, problem = time.perf_counter(), None, None
    try:
        whole = run_in_memory(scenario, make_simulation=make_simulation or simulation).summary
        summary = {name: value for name, value in whole.items() if name not in UNREAD}
    except Exception as error:  # whatever it is, it is this run's alone
        problem = f"{type(error).__name__}: {error}"
    return {"summary": summary, "problem": problem, "wall_time": time.perf_counter() - started}


def read_record(file: Path) -> dict[str, Any] | None:
    """A record that was written before; None where there is none that can be used."""
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return record if isinstance(record, dict) and {"summary", "problem", "wall_time"} <= set(record) else None


def claim(folder: Path, command: str) -> None:
    """Make a folder, or see that it is one of a search; the runs of another question asked of it are kept.

    Raises:
        RunError: it holds something else, or cannot be made.
    """
    try:
        if folder.is_dir() and any(folder.iterdir()) and not (folder / MARK).is_file():
            raise RunError(f"{folder} holds something that no {command} has written; choose another folder with --out.")
        (folder / FOLDER).mkdir(parents=True, exist_ok=True)
        write_whole(folder / MARK, json.dumps({"command": command}) + "\n")
    except FileExistsError as error:
        raise RunError(f"{error.filename} is no folder; choose another one with --out.") from None


def coarse(scenario: Scenario, spacing: float | None = None, *, cells: float = COARSE_CELLS) -> Scenario:
    """The scenario as it is tried: coarse, with the barrier's crest on a line of the grid, judged by nobody.

    Args:
        scenario: the scene.
        spacing: asked for [m]; None: `cells` in the flow's depth.
        cells: see there.
    """
    wanted = spacing if spacing is not None else scenario.flow.depth / cells
    return without_limits(scenario).replaced({"numerics.spacing_m": aligned(scenario, wanted)})


def _cost(scenario: Scenario) -> float:
    numerics = scenario.numerics
    return scenario.flow.volume * scenario.output.end_time_s / numerics.spacing_m**3


def untouched(run: Run) -> bool:
    """Whether the flow did not push on the barrier in a run; false where that is not known."""
    figures = run.figures
    if figures is None or run.scenario.barrier is None or "peak_force" in figures.get("not_recorded", {}):
        return False
    return "peak_force" in figures and not figures["peak_force"]
