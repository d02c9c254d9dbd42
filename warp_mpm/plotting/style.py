"""Colours and files of all figures."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

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


def save(figure: Figure, path: Path) -> None:
    """Write a figure in the format of its suffix, whole or not at all."""
    aside = path.with_name(path.name + ".new")
    FigureCanvasAgg(figure)
    try:
        figure.savefig(aside, dpi=150, format=path.suffix.lstrip(".").lower())
        aside.replace(path)
    except OSError:
        aside.unlink(missing_ok=True)
        raise


def grid(panel: Axes) -> None:
    """Faint lines at the ticks."""
    panel.grid(color="#DDDDDD", linewidth=0.5)
