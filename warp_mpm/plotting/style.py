"""Colours and files of all figures."""

from __future__ import annotations

import re
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from analytic.whole_file import whole_file
from warp_mpm.quantities import Quantity

BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#6E6E6E"
RUN_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, "#E69F00", "#56B4E9", "#000000", GREY)
"""Colours of several runs in one panel, told apart by colour-blind readers; after eight they start again, dashed."""

GROUND, BARRIER, EDGE = "#D9D2C5", "#B5B5B5", "#333333"
FORMATS = ("png", "pdf", "svg")


class PlotError(ValueError):
    """A figure that cannot be made; one sentence."""


def check_path(path: Path, formats: tuple[str, ...] = FORMATS) -> None:
    """Refuse a picture file before anything is computed for it.

    Raises:
        PlotError: the format is unknown or the folder does not exist.
    """
    if path.suffix.lstrip(".").lower() not in formats:
        raise PlotError(f"{path} has the suffix {path.suffix!r}; it must be one of {', '.join(formats)}.")
    if not path.parent.is_dir():
        raise PlotError(f"{path} cannot be written: the folder {path.parent} does not exist.")


def save(figure: Figure, path: str | Path) -> None:
    """Write a figure in the format of its suffix, whole or not at all.

    Raises:
        UnwrittenError: the file cannot be written.
    """
    FigureCanvasAgg(figure)
    path = Path(path)
    with whole_file(path) as aside:
        figure.savefig(aside, dpi=150, format=path.suffix.lstrip(".").lower())


def heading(figure: Figure, title: str) -> Text:
    """A scenario's title above its figure, in as many lines as it takes; a dollar in it begins no formula."""
    return figure.suptitle(title.replace("$", r"\$"), fontsize=11, wrap=True)


def symbol(quantity: Quantity) -> str:
    """A quantity's symbol as matplotlib sets it: F₂,x as $F_{2,x}$, Δx as $Δx$."""
    if not quantity.symbol:
        return ""
    base, index = re.fullmatch(r"([^₀-₉ₖ_]*)_?(.*)", quantity.symbol).groups()  # type: ignore[union-attr]
    index = index.translate(str.maketrans("₀₁₂₃₄₅₆₇₈₉ₖ", "0123456789k"))
    return f"${base}_{{{index}}}$" if index else f"${base}$"


def named(quantity: Quantity, between: str = " ") -> str:
    """Words and symbol of a quantity."""
    return between.join(part for part in (quantity.words, symbol(quantity)) if part)


def grid(panel: Axes) -> None:
    """Faint lines at the ticks."""
    panel.grid(color="#DDDDDD", linewidth=0.5)
