"""`python -m warp_mpm hard-cases`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from analytic.command_line import complain, refusals

UNSTABLE = 1

FIGURES = "hard_cases.json"


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
    resume: Annotated[
        bool, typer.Option("--resume", help="Take over what this program has run before into the same folder.")
    ] = False,
) -> None:
    """Run the scenes that were chosen to break the code, and tell for each whether it is stable.

    A scene is a file of scenarios/hard/. What is demanded of it, and why, is in warp_mpm/hard_cases/criteria.py. The
    folder then holds a picture of each case and hard_cases.json with all figures, which is written after each case.

    Exit codes: 0 all are stable, 1 some are not, 2 the input cannot be used, 130 interrupted; --resume then goes on.
    """
    from rich.console import Console
    from rich.table import Table

    from analytic.whole_file import write_whole
    from warp_mpm.hard_cases import collection
    from warp_mpm.hard_cases.measure import measure
    from warp_mpm.hard_cases.record import COLUMNS, Kept, picture, record_page, row
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
    with refusals():
        kept = Kept(out / FIGURES, halved=not quick, goes_on=resume)
    outcomes = []
    try:
        for case in cases:
            measured = kept.found(case)
            if measured is None or not (pictures / f"{case.name}.png").exists():
                measured = measure(case.scenario, halve=not quick)
                with refusals():
                    picture(case, measured, pictures / f"{case.name}.png")
                    kept.keep(case, measured)
            outcomes.append((case, measured))
            failed = measured.failures(case.scenario)
            state = "stable" if not failed else "NOT STABLE: " + ", ".join(f"{c.figure} {v:.3g}" for c, v in failed)
            console.print(f"{case.name:<20} {measured.figures['wall_time']:6.1f} s  {state}", soft_wrap=True)
            if measured.problem:
                console.print(f"  {measured.problem}", soft_wrap=True)
    except KeyboardInterrupt:
        complain(
            f"Interrupted; {len(outcomes)} of {len(cases)} cases are in {out / FIGURES}. The same command with "
            "--resume goes on from there."
        )
        raise typer.Exit(130) from None

    table = Table(box=None, padding=(0, 1, 0, 0))
    for heading in ("case", *(heading for _, heading in COLUMNS), "verdict"):
        table.add_column(heading, no_wrap=heading != "verdict")
    for case, measured in outcomes:
        table.add_row(*row(case, measured))
    console.print(table)
    if page is not None:
        with refusals():
            write_whole(page, record_page(outcomes, pictures.name))
    stable = sum(not measured.failures(case.scenario) for case, measured in outcomes)
    console.print(f"{stable} of {len(cases)} cases are stable; pictures and figures are in {out}", soft_wrap=True)
    if stable < len(cases):
        raise typer.Exit(UNSTABLE)
