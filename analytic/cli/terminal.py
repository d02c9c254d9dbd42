"""Tables for a person, JSON for a program, and one sentence for a mistake."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.command_line import tell

AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON, SI units per metre of width.")]
Plot = Annotated[
    Path | None, typer.Option("--plot", metavar="FILE", help="Draw the result into a png, pdf or svg file.")
]


SMALLEST, LARGEST = 1e-12, 1e12
"""Sizes [SI] of the numbers that may be given: no impact has others, and products of them stay numbers."""


def check_sizes(given: Mapping[str, Any]) -> None:
    """Refuse numbers, also of a distribution, with which the formulas cannot be computed."""
    for name, value in given.items():
        for number in getattr(value, "parameters", value if isinstance(value, tuple) else (value,)):
            if number and math.isfinite(number) and not SMALLEST <= abs(number) <= LARGEST:
                raise ValueError(f"{name} is {value}, it must be nil or from {SMALLEST:g} to {LARGEST:g} in size.")


def print_json(content: Any) -> None:
    """Print JSON; what is infinite or not a number becomes null, which JSON has no other word for."""
    typer.echo(json.dumps(_finite(content), indent=2, ensure_ascii=False))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> None:
    """Print a table, columns of words to the left and columns of numbers to the right, and notes under it.

    By hand: a table library takes longer to load than an impact takes to predict.
    """
    columns = list(zip(header, *rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    numeric = [all(cell[:1] in "0123456789+-–≥" or cell == "never" for cell in column[1:]) for column in columns[1:]]

    def line(cells: Sequence[str]) -> str:
        padded = [
            cell.rjust(w) if right else cell.ljust(w) for cell, w, right in zip(cells, widths, align, strict=True)
        ]
        return "  ".join(padded).rstrip()

    align = [False, *numeric]
    lines = ["", title, "", line(header), "─" * (sum(widths) + 2 * (len(widths) - 1)), *map(line, rows), ""]
    tell("\n".join([*lines, *notes]))


def number(value: float | None, digits: int = 4) -> str:
    """A number for a table; a dash where there is none."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "never" if value > 0 else "-∞"
    return f"{value:.{digits}g}" if abs(value) < 10**digits else f"{value:.0f}"


def write_plot(make: Any, path: Path) -> None:
    """Draw `make()` into `path` and say so."""
    from analytic import plots

    plots.save(make(), path)
    typer.echo(f"Figure: {path}", err=True)


def check_plot(path: Path | None) -> None:
    """Refuse a picture file that cannot be written before anything is computed."""
    if path is not None:
        from analytic import plots

        plots.check_path(path)
