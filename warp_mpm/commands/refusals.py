"""One sentence and an exit code for what cannot be done."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer

BAD_INPUT = 2
"""Exit code of an input that cannot be used."""


@contextmanager
def refusals() -> Iterator[None]:
    """Turn a ValueError, which all bad inputs raise, and what the disk refuses into a sentence and exit code 2."""
    try:
        yield
    except ValueError as error:
        complain(str(error))
        raise typer.Exit(BAD_INPUT) from None
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        complain(f"{place}{error.strerror or error}".rstrip(".") + ".")
        raise typer.Exit(BAD_INPUT) from None


def complain(sentence: str) -> None:
    """Print a sentence to standard error, red on a terminal."""
    typer.secho(sentence, err=True, fg=typer.colors.RED if sys.stderr.isatty() else None)


def times_of(text: str) -> tuple[float, ...]:
    """Times [s] from a list with commas.

    Raises:
        ValueError: an entry is no number from 0 on.
    """
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
