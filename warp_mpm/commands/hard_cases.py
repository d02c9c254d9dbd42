"""`python -m warp_mpm hard-cases`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

UNSTABLE = 1


def hard_cases(
    quick: Annotated[
        bool, typer.Option("--quick", help="Leave out the large scenes and the runs at half the time step.")
    ] = False,
    small: Annotated[bool, typer.Option("--small", help="Leave out the large scenes, which take minutes.")] = False,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this case; may be given again.", show_default=False)
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for pictures and figures.")] = Path(
        "runs/hard_cases"
    ),
    page: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the page of the record, its pictures beside it.")
    ] = None,
) -> None:
    """Run the scenes that were chosen to break the code, and tell for each whether it is stable.

    A scene is a file of scenarios/hard/. What is demanded of it, and why, is in warp_mpm/hard_cases/criteria.py. The
    folder then holds a picture of each case and hard_cases.json with all figures.

    Exit codes: 0 all are stable, 1 some are not, 2 the input cannot be used.
    """
    from rich.console import Console
    from rich.table import Table

    from warp_mpm.hard_cases import collection
    from warp_mpm.hard_cases.measure import measure
    from warp_mpm.hard_cases.record import COLUMNS, picture, record_page, row
    from warp_mpm.scenario_errors import ScenarioError

    pictures = out if page is None else page.with_suffix("")
    try:
        cases = collection.hard_cases(only, small=small or quick)
        for folder in (out, pictures):
            folder.mkdir(parents=True, exist_ok=True)
    except (ValueError, ScenarioError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(2) from None
    except OSError as error:
        typer.echo(f"Cannot write to {out}: {error.strerror}.", err=True)
        raise typer.Exit(2) from None

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console.width = 140
    outcomes = []
    for case in cases:
        measured = measure(case.scenario, halve=not quick)
        picture(case, measured, pictures / f"{case.name}.png")
        outcomes.append((case, measured))
        failed = measured.failures(case.scenario)
        state = "stable" if not failed else "NOT STABLE: " + ", ".join(f"{c.figure} {v:.3g}" for c, v in failed)
        console.print(f"{case.name:<20} {measured.figures['wall_time']:6.1f} s  {state}", soft_wrap=True)
        if measured.problem:
            console.print(f"  {measured.problem}", soft_wrap=True)

    table = Table(box=None, padding=(0, 1, 0, 0))
    for heading in ("case", *(heading for _, heading in COLUMNS), "verdict"):
        table.add_column(heading, no_wrap=heading != "verdict")
    for case, measured in outcomes:
        table.add_row(*row(case, measured))
    console.print(table)
    figures = {
        case.name: {
            "stable": not measured.failures(case.scenario),
            "problem": measured.problem,
            "figures": measured.figures,
        }
        for case, measured in outcomes
    }
    (out / "hard_cases.json").write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    if page is not None:
        page.write_text(record_page(outcomes, pictures.name), encoding="utf-8")
    stable = sum(not measured.failures(case.scenario) for case, measured in outcomes)
    console.print(f"{stable} of {len(cases)} cases are stable; pictures and figures are in {out}", soft_wrap=True)
    if stable < len(cases):
        raise typer.Exit(UNSTABLE)
