"""Runs the cases of a sweep, on Dask or in processes of this machine, and gathers their key figures in one table."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from warp_mpm.engine import Engine, Processes, SchedulerError, Task, dask_engine
from warp_mpm.extras import missing
from warp_mpm.recording import run_folder
from warp_mpm.recording.run_folder import RunFolder
from warp_mpm.results import Results, ResultsError
from warp_mpm.run import run_scenario
from warp_mpm.scenario import Scenario
from warp_mpm.sweep.design import Case, Sweep, SweepError

SWEEP, CASES, TABLE = "sweep.json", "cases", "results.parquet"
"""What the folder of a sweep holds: the resolved sweep, a run folder for each case, the table."""

Row = dict[str, Any]


def run_sweep(
    sweep: Sweep,
    base: Scenario,
    out: str | Path,
    *,
    workers: int = 2,
    scheduler: str | None = None,
    on_dask: bool = True,
    device: str = "cpu",
    retry_failed: bool = False,
    on_start: Callable[[int, int, str], None] = lambda total, done, dashboard: None,
    on_case: Callable[[Row], None] = lambda row: None,
    make_simulation: Callable[[Scenario], Any] | None = None,
) -> list[Row]:
    """Run all cases that have not been run, and write the table of all.

    A case that fails is a row of the table and does not stop the others; a worker that dies has its case run again by
    another. Called again with the same folder, only what is missing is run.

    Args:
        sweep: what varies.
        base: the scenario that it varies.
        out: folder of the sweep; made if need be.
        workers: processes on this machine, one case at a time each.
        scheduler: address of a Dask scheduler that has workers; None starts `workers` of them here.
        on_dask: false runs the cases in processes of this machine, without Dask; a case whose process dies has failed.
        device: of the simulations.
        retry_failed: cases that failed before are run again.
        on_start: called with the number of cases, of those done before, and the address of the dashboard or "".
        on_case: called with the row of each case as it ends.
        make_simulation: stands in for the simulation, in tests.

    Returns:
        Rows in the order of the cases: `case`, `status`, `problem`, the varied fields, the key figures (SI).

    Raises:
        SweepError: Dask is not installed, a case is impossible, or the folder holds another sweep; nothing was run.
    """
    _check_installed(on_dask)
    out = Path(out)
    cases = sweep.cases(base)
    _claim(out, {**sweep.model_dump(mode="json"), "scenario": base.resolved()})
    done = {case.number: row for case in cases if (row := _row_of(case, out, retry_failed)) is not None}
    waiting = [case for case in cases if case.number not in done]
    tasks = {
        case.name: Task(
            case.name,
            run_case,
            (case.scenario.resolved(), str(_folder(case, out).resolve()), device, make_simulation),
        )
        for case in waiting
    }
    by_name = {case.name: case for case in waiting}
    with _engine(workers, scheduler, on_dask=on_dask) as (engine, dashboard):
        on_start(len(cases), len(done), dashboard)
        try:
            for ended in engine.run(list(tasks.values())):
                case = by_name[ended.task.name]
                problem = ended.problem or ended.result
                row = _row_of(case, out, retry_failed=False) or _row(case, "failed", problem, {})
                done[case.number] = row
                on_case(row)
        finally:
            rows = [done[number] for number in sorted(done)]
            write_table(rows, out / TABLE)
    return rows


def run_case(
    scenario: dict[str, Any],
    folder: str,
    device: str = "cpu",
    make_simulation: Callable[[Scenario], Any] | None = None,
) -> str | None:
    """Run one case into its folder, in a worker; returns what went wrong, or None.

    What an earlier worker left there, which died, is replaced; but where it had finished the case (Dask asks again for
    a result that was lost with its worker) the run is kept.
    """
    path = Path(folder)
    with contextlib.suppress(ResultsError):
        if Results.open(path).record.get("status") == "finished":
            return None

    def simulation(scene: Scenario) -> Any:
        from warp_mpm.simulation import Simulation

        return Simulation(scene, device=device)

    try:
        outcome = run_scenario(
            Scenario.model_validate(scenario),
            path,
            make_simulation=make_simulation or simulation,
            force=path.exists(),
            pictures=False,
        )
    except Exception as error:  # whatever it is, it is this case's alone
        return f"{type(error).__name__}: {error}"
    return None if outcome.finished else "stopped before its end"


def write_table(rows: list[Row], target: Path) -> None:
    """Write the table as Parquet, whole or not at all; a group of figures is left to the cases' own folders."""
    import pandas as pd

    aside = target.with_name(target.name + run_folder.ASIDE)
    frame = pd.DataFrame(rows)
    for name in frame.columns:
        # A column of lists or mixed values has no one type, but its text has.
        if frame[name].dtype == object and not all(isinstance(value, str | None) for value in frame[name]):
            kinds = {type(value) for value in frame[name] if value is not None}
            if not kinds <= {bool} and not kinds <= {int, float}:
                frame[name] = [None if value is None else json.dumps(value) for value in frame[name]]
    frame.to_parquet(aside, index=False)
    aside.replace(target)


def _claim(out: Path, content: dict[str, Any]) -> None:
    """Make the folder this sweep's, or see that it is.

    Raises:
        SweepError: it is another's.
    """
    if (out / SWEEP).exists():
        try:
            before = json.loads((out / SWEEP).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            raise SweepError(f"{out / SWEEP} cannot be read; choose another folder with --out.") from None
        if before != json.loads(json.dumps(content)):
            raise SweepError(f"{out} holds another sweep, or this one before it was changed; choose another folder.")
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise SweepError(f"{out} holds something that is no sweep; choose another folder with --out.")
    try:
        (out / CASES).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = f"a link to {out.readlink()}, which is not there" if out.is_symlink() else error.strerror
        raise SweepError(f"{out} cannot be made: {reason}; choose another folder with --out.") from None
    RunFolder(out).write(SWEEP, content)


def _folder(case: Case, out: Path) -> Path:
    return out / CASES / case.name


def _row_of(case: Case, out: Path, retry_failed: bool) -> Row | None:
    """The row of a case that has been run; None where it is still to be run."""
    try:
        results = Results.open(_folder(case, out))
        status = results.record.get("status")
        if status == "finished":
            return _row(case, status, None, results.summary)
        if status == "failed" and not retry_failed:
            return _row(case, status, results.record.get("problem"), {})
    except ResultsError:
        pass
    return None


def _row(case: Case, status: str, problem: str | None, summary: dict[str, Any]) -> Row:
    figures = {name: value for name, value in summary.items() if not isinstance(value, dict)}
    for name in ("title", "status"):
        figures.pop(name, None)
    return {"case": case.number, "status": status, "problem": problem, **case.values, **figures}


def _check_installed(on_dask: bool) -> None:
    """Ask for the optional packages before hours of runs, not after.

    Raises:
        SweepError: one is not installed.
    """
    try:
        for package in (*(("distributed",) if on_dask else ()), "pandas", "pyarrow"):
            import_module(package)
    except ModuleNotFoundError:
        raise SweepError(missing("sweep", "Dask, pandas and pyarrow", "sweep")) from None


@contextmanager
def _engine(workers: int, scheduler: str | None, *, on_dask: bool) -> Iterator[tuple[Engine, str]]:
    """What runs the cases, and the address of its dashboard or "".

    Raises:
        SweepError: the scheduler does not answer.
    """
    if not on_dask:
        yield Processes(workers), ""
        return
    try:
        with dask_engine(workers, scheduler) as engine:
            yield engine
    except SchedulerError as error:
        raise SweepError(str(error)) from None
