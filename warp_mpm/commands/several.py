"""`python -m warp_mpm run A.json B.json ...`: several scenes at once."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from signal import SIGTERM
from typing import Any

import typer

from analytic.command_line import complain, refusals

DIVERGED, INTERRUPTED = 3, 130
"""Exit codes of `run` that leave results behind."""


def run_several(
    files: list[Path],
    out: Path | None,
    jobs: int | None,
    options: list[str],
    quiet: bool,
    as_json: bool,
    *,
    until: float | None,
    force: bool,
) -> None:
    """Run each scene in a process of its own and tell how each went.

    Args:
        files: scenarios, all checked before any begins.
        out: the folder in which each gets a folder of its name; None: runs.
        jobs: at the same time; None: as many as there are cores.
        options: of `run`, handed on to each.
        quiet: print errors only.
        as_json: print the summaries as JSON, by folder, in place of the table.
        until: end of all runs [s], as among the `options`; None: each scenario's own.
        force: older runs are replaced, as among the `options`.

    Raises:
        typer.Exit: 2 when a file cannot be used and nothing was begun; otherwise the greatest exit code of the runs.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from warp_mpm.batch import Job, JobEnd, run_jobs
    from warp_mpm.engine import cores
    from warp_mpm.recording.run_folder import RunFolder
    from warp_mpm.scenario import Scenario
    from warp_mpm.terminal import StopOnSignal

    with refusals():
        if len({file.stem for file in files}) < len(files):
            raise ValueError("Two of the scenarios have the same file name, so they would share a folder.")
        planned = []
        for file in files:
            scenario, folder = Scenario.load(file), (out or Path("runs")) / file.stem
            RunFolder.check(folder, force=force)
            end_time = until if until is not None else scenario.output.end_time_s
            planned.append(Job(file.stem, folder, (str(file), "--out", str(folder), *options), end_time))

    console = Console(quiet=quiet, stderr=True, highlight=False, markup=False)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TextColumn("{task.fields[state]}"),
        TimeRemainingColumn(),
    )
    with StopOnSignal() as signal, Progress(*columns, console=console, disable=not console.is_terminal) as bars:
        tasks: dict[str, Any] = {
            job.name: bars.add_task(job.name, total=job.end_time, state="waiting") for job in planned
        }

        def began(job: Job) -> None:
            bars.update(tasks[job.name], state="preparing")
            if not console.is_terminal:
                console.print(f"{job.name}: begun", soft_wrap=True)

        def ended(end: JobEnd) -> None:
            state = "done" if end.code == 0 else f"exit code {end.code}"
            bars.update(tasks[end.job.name], completed=end.job.end_time if end.code == 0 else None, state=state)
            if not console.is_terminal:
                console.print(f"{end.job.name}: {state}", soft_wrap=True)

        ends = run_jobs(
            planned,
            at_once=jobs or cores(),
            on_start=began,
            on_progress=lambda job, time: bars.update(tasks[job.name], completed=time, state=f"t = {time:.2f} s"),
            on_end=ended,
            stop=lambda: signal.received,
        )
    for end in ends:
        if end.code != 0:
            # Only before it has begun does a run end by the signal itself, or without a word.
            early = signal.received and (end.code == -SIGTERM or (end.code == INTERRUPTED and not end.message))
            said = "stopped before it had begun." if early else end.message or f"ended with exit code {end.code}"
            complain(f"{end.job.name}: {said}")
    begun = sorted(
        (end for end in ends if end.code in (0, DIVERGED, INTERRUPTED)), key=lambda end: planned.index(end.job)
    )
    summaries = _summaries([end.job.folder for end in begun])
    if as_json:
        typer.echo(json.dumps(summaries, indent=2, ensure_ascii=False))
    elif not quiet:
        _print(summaries)
    code = max((end.code if end.code > 0 else 1 for end in ends if end.code != 0), default=0)
    if code or signal.received:
        raise typer.Exit(INTERRUPTED if signal.received else code)


def _summaries(folders: list[Path]) -> dict[str, dict[str, Any]]:
    """Summary by folder; a run that ended before it had one is left out."""
    from warp_mpm.results import Results, ResultsError

    found = {}
    for folder in folders:
        with contextlib.suppress(ResultsError):
            found[str(folder)] = Results.open(folder).summary
    return found


def _print(summaries: dict[str, dict[str, Any]]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from warp_mpm.caveats import told_of
    from warp_mpm.quantities.figures import FIGURES
    from warp_mpm.terminal import AT_LEAST, sliding_distance

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console.width = 160  # a file has no edge to fit to
    table = Table(box=box.SIMPLE_HEAD)
    words = ("run", "status", "mechanism")
    figures = [FIGURES[name].column for name in ("peak_force_filtered", "impulse", "barrier_displacement_final")]
    for heading in (*words[:2], *figures, words[2], FIGURES["wall_time"].column):
        table.add_column(heading, justify="left" if heading in words else "right")
    for folder, summary in summaries.items():

        def cell(name: str, summary: dict[str, Any] = summary) -> str:
            return "–" if summary.get(name) is None else f"{summary[name] * FIGURES[name].factor:,.4g}"

        table.add_row(
            folder,
            str(summary.get("status")),
            cell("peak_force_filtered"),
            cell("impulse"),
            sliding_distance(summary),
            summary.get("mechanism") or "–",
            cell("wall_time"),
        )
    console.print(table)
    if any(summary.get("barrier_at_rest") is False for summary in summaries.values()):
        console.print(AT_LEAST)
    for sentence, folders in told_of({folder: summary.get("notes", []) for folder, summary in summaries.items()}):
        console.print(f"Note, {', '.join(folders)}: {sentence}", soft_wrap=True)
