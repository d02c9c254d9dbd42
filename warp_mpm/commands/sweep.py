"""`python -m warp_mpm sweep`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.command_line import complain, refusals

CASE_FAILED = 4
"""Exit code when the sweep went through and some of its cases failed."""

SHOWN = ("peak_force_filtered", "impulse", "barrier_velocity_max", "barrier_displacement_final", "overtopped_volume")
"""Key figures of the table on the terminal; the Parquet file has all."""

MOST_NAMED = 20
"""Cases that a note under the table names."""


def sweep(
    sweep_file: Annotated[Path, typer.Argument(metavar="SWEEP", help="Sweep file (JSON).", show_default=False)],
    out: Annotated[Path | None, typer.Option(help="Folder of the sweep.", show_default="runs/NAME of the file")] = None,
    workers: Annotated[int, typer.Option(min=1, max=1024, help="Processes on this machine.")] = 2,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="Dask scheduler of a cluster.", show_default=False)
    ] = None,
    device: Annotated[str, typer.Option(help="Warp device: cpu, cuda:0, ...")] = "cpu",
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Run cases again that failed before.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the whole table as JSON, SI units.")] = False,
) -> None:
    """Vary fields of a scenario, run all cases on Dask, and write one table (results.parquet).

    A case that fails does not stop the rest; a worker that dies loses nothing but time. The same command again runs
    only what is missing. Exit codes: 0 all cases finished, 2 the input cannot be used, 4 some cases failed, 130
    interrupted.
    """
    with refusals():
        from warp_mpm.caveats import scene_caveats
        from warp_mpm.scenario import Scenario
        from warp_mpm.sweep import Sweep, run_sweep

        plan = Sweep.load(sweep_file)
        base = Scenario.load(sweep_file.parent / plan.scenario)
        folder = out if out is not None else Path("runs") / sweep_file.stem
        counter = [0, 0]

        def started(total: int, done: int, dashboard: str) -> None:
            counter[:] = [done, total]
            typer.echo(
                f"{plan.title}: {total} cases, {done} done before" + (f"; dashboard {dashboard}" if dashboard else ""),
                err=True,
            )

        def ended(row: dict[str, Any]) -> None:
            counter[0] += 1
            told = ", ".join(f"{_leaf(path)} = {_short(row[path])}" for path in plan.vary)
            end = f": {row['problem']}" if row["problem"] else ""
            typer.echo(f"[{counter[0]}/{counter[1]}] case {row['case']}: {told}: {row['status']}{end}", err=True)

        try:
            rows = run_sweep(
                plan,
                base,
                folder,
                workers=workers,
                scheduler=scheduler,
                device=device,
                retry_failed=retry_failed,
                on_start=started,
                on_case=ended,
            )
        except KeyboardInterrupt:
            complain(f"Interrupted; what has ended is in {folder}. The same command goes on from there.")
            raise typer.Exit(130) from None
        if as_json:
            typer.echo(json.dumps(rows, indent=2, ensure_ascii=False))
        else:
            _print(rows, list(plan.vary), {case.number: scene_caveats(case.scenario) for case in plan.cases(base)})
        typer.echo(f"Table: {folder / 'results.parquet'}", err=True)
        if any(row["status"] != "finished" for row in rows):
            raise typer.Exit(CASE_FAILED)


def _print(rows: list[dict[str, Any]], varied: list[str], notes: dict[int, list[str]]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from warp_mpm.caveats import told_of
    from warp_mpm.quantities.figures import FIGURES
    from warp_mpm.terminal import AT_LEAST, sliding_distance

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console.width = 200  # a file has no edge to fit to
    table = Table(box=box.SIMPLE_HEAD)
    shown = [name for name in SHOWN if any(row.get(name) is not None for row in rows)]
    for heading in ("case", *map(_leaf, varied), "status", *(FIGURES[name].column for name in shown)):
        table.add_column(heading, justify="right")
    for row in rows:
        figures = ["–" if row.get(name) is None else f"{row[name] * FIGURES[name].factor:.4g}" for name in shown]
        if "barrier_displacement_final" in shown:
            figures[shown.index("barrier_displacement_final")] = sliding_distance(row)
        table.add_row(str(row["case"]), *(_short(row[path]) for path in varied), row["status"], *figures)
    console.print(table)
    if any(row.get("barrier_at_rest") is False for row in rows):
        console.print(AT_LEAST)
    for sentence, cases in told_of(notes):
        of = "all cases" if len(cases) == len(rows) else f"case {cases[0]}" if len(cases) == 1 else None
        of = of or f"cases {', '.join(map(str, cases[:MOST_NAMED]))}" + ", …" * (len(cases) > MOST_NAMED)
        console.print(f"Note, {of}: {sentence}", soft_wrap=True)


def _leaf(path: str) -> str:
    """The last name of a path, with the number that picks from a list."""
    names = path.split(".")
    return ".".join(names[-2:] if names[-1].isdecimal() else names[-1:])


def _short(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else json.dumps(value)
