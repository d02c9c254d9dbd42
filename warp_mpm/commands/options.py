"""Options that several commands share: those in place of a field of the scenario, with its range, and times."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import typer

from analytic.command_line import CommandLine, complain

if TYPE_CHECKING:
    from warp_mpm.results import Results
    from warp_mpm.scenario import Scenario

FIELDS = {"spacing": "numerics.spacing_m", "until": "output.end_time_s"}
"""Options that stand in place of a field of the scenario."""

DEFAULT_TIMES = "a sixth, a third and two thirds of the run"
"""What a help text says of `plotting.still_times` that are not given."""


class ScenarioCommandLine(CommandLine):
    """A command line with options that stand in place of fields of a scenario and have their ranges."""

    def allowed(self, parameter: Any) -> str:
        if parameter.name not in FIELDS:
            return super().allowed(parameter)
        from warp_mpm.scenario import Scenario
        from warp_mpm.scenario_errors import allowed

        return allowed(FIELDS[parameter.name], Scenario)


def with_options(scenario: Scenario, *, spacing: float | None, until: float | None) -> Scenario:
    """The scenario with what --spacing and --until say in place of its own.

    Raises:
        ScenarioError: a value is not allowed; the sentence names the option.
    """
    from warp_mpm.scenario_errors import ScenarioError

    given = {name: value for name, value in (("spacing", spacing), ("until", until)) if value is not None}
    try:
        return scenario.replaced({FIELDS[name]: value for name, value in given.items()})
    except ScenarioError as error:
        text = "\n".join(error.problems)
        for name in given:
            text = text.replace(FIELDS[name], f"--{name}")
        raise ScenarioError(text.split("\n")) from None


def agreed(question: str) -> bool:
    """Whether the user agrees; where nobody can be asked, nobody does."""
    if sys.stdin is None or sys.stderr is None or not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    return typer.confirm(question, err=True)


def print_rows(rows: Sequence[tuple[str, str]]) -> None:
    """Names and values, one below the other."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console.width = 180  # a file has no edge to fit to
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in rows:
        table.add_row(Text(name, style="dim"), Text(value))
    console.print(table)


def times_of(text: str | None) -> tuple[float, ...] | None:
    """Times [s] from a list with commas; None where none is given.

    Raises:
        ValueError: an entry is no number from 0 on.
    """
    if text is None:
        return None
    times = []
    for word in text.split(","):
        try:
            time = float(word)
        except ValueError:
            time = -1.0
        if not 0.0 <= time < float("inf"):
            raise ValueError(f"--times {text}: {word.strip()!r} must be a number of seconds at least 0.")
        times.append(time)
    return tuple(times)


def times_within(runs: Sequence[Results], times: tuple[float, ...] | None) -> list[float]:
    """Times [s] of still pictures; a line on standard error names those that the runs do not reach.

    Raises:
        ResultsError: the runs reach none of them.
    """
    from warp_mpm.plotting import still_times

    within = still_times(runs, times)
    beyond = [f"{time:g}" for time in times or () if time not in within]
    if beyond:
        end = max(float(results.snapshots.times[-1]) for results in runs)
        complain(f"Left out of --times: {', '.join(beyond)} s, beyond the last snapshot at t = {end:g} s.")
    return within
