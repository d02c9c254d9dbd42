"""One sentence and an exit code for what cannot be done."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

from warp_mpm.whole_file import UnwrittenError

if TYPE_CHECKING:
    from warp_mpm.results import Results

BAD_INPUT = 2
"""Exit code of an input that cannot be used."""

DEFAULT_TIMES = "a sixth, a third and two thirds of the run"
"""What a help text says of `plotting.still_times` that are not given."""


@contextmanager
def refusals() -> Iterator[None]:
    """Turn a ValueError, which all bad inputs raise, and what the disk refuses into a sentence and exit code 2."""
    try:
        yield
    except (ValueError, UnwrittenError) as error:
        complain(str(error))
        raise typer.Exit(BAD_INPUT) from None
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        complain(f"{place}{error.strerror or error}".rstrip(".") + ".")
        raise typer.Exit(BAD_INPUT) from None


def complain(sentence: str) -> None:
    """Print a sentence to standard error, red on a terminal."""
    typer.secho(sentence, err=True, fg=typer.colors.RED if sys.stderr.isatty() else None)


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
