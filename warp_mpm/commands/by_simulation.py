"""How `design` and `uncertainty` begin and end: their folder, their runs, and what is told of what they found."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from analytic.command_line import INTERRUPTED, complain
from warp_mpm.commands.options import print_rows
from warp_mpm.engine import cores

if TYPE_CHECKING:
    from warp_mpm.by_simulation.runs import Runs
    from warp_mpm.scenario import Scenario


def say(sentence: str) -> None:
    """A line on standard error."""
    typer.echo(sentence, err=True)


def begun(command: str, scenario_file: Path, out: Path | None, scenario: Scenario, follows: Sequence[str]) -> Path:
    """The folder of the command, made; what must be known of the scenario is told.

    Args:
        command: its name.
        scenario_file: whose name the folder has if `out` gives none.
        out: the folder.
        scenario: as it was read.
        follows: sentences on fields that follow from the varied ones.

    Raises:
        RunError: the folder holds something else, or cannot be made.
    """
    from warp_mpm.by_simulation.runs import claim
    from warp_mpm.caveats import scene_caveats

    folder = out if out is not None else Path("runs") / f"{command}_{scenario_file.stem}"
    claim(folder, command)
    notes = scene_caveats(scenario)
    if scenario.barriers:
        further = ", ".join(one.name for one in scenario.barriers)
        notes = [
            *notes,
            f"limits and figures are those of `barrier` alone; nothing is asked of the others ({further}).",
        ]
    for sentence in (*follows, *(f"Note: {one}" for one in notes)):
        say(sentence)
    return folder


@contextmanager
def runs_in(
    folder: Path, jobs: int | None, device: str, on_progress: Callable[[int, int], None] = lambda done, total: None
) -> Iterator[Runs]:
    """What makes the runs; Ctrl-C ends the command with a sentence that says how to go on."""
    from warp_mpm.by_simulation.runs import Runs

    try:
        with Runs(folder, jobs=jobs or cores(), device=device, on_progress=on_progress) as runs:
            yield runs
    except KeyboardInterrupt:
        complain(f"Interrupted; the runs that ended are in {folder}. The same command goes on from there.")
        raise typer.Exit(INTERRUPTED) from None


def ended(content: Mapping[str, Any], rows: Sequence[tuple[str, str]], notes: Sequence[str], *, as_json: bool) -> None:
    """Print what was found, as JSON or as a table with the notes below it."""
    if as_json:
        typer.echo(json.dumps(content, indent=2, ensure_ascii=False))
        return
    print_rows(rows)
    for sentence in notes:
        typer.echo(sentence)
