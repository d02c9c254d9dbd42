"""The report as a PDF to hand over: a cover with the verdict, the pictures, an appendix; one run or several."""

from __future__ import annotations

import contextlib
import io
import textwrap
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from analytic.version import versions
from analytic.whole_file import whole_file
from warp_mpm import plotting
from warp_mpm.report.content import run_content
from warp_mpm.results import Results, ResultsError

PAGE = (8.27, 11.69)
"""A4 [inches]."""

LEFT, RIGHT, TOP, BOTTOM = 0.08, 0.95, 0.95, 0.06
"""Edges of what is printed, as shares of the page."""

LETTERS = 102
"""In a line of 9 points."""

RESOLUTION = 160
"""Of the pictures [dots per inch]."""

WIDEST_TABLE = 4
"""Runs side by side in a table; of more, it goes on below."""

Rows = Sequence[tuple[str, Sequence[str]]]


def write_pdf(runs: Sequence[Results], target: str | Path, *, times: Sequence[float] | None = None) -> None:
    """Write the report, whole or not at all.

    Args:
        runs: at least one.
        target: the PDF file; one that is there is replaced.
        times: [s] of the still pictures, see `plotting.still_times`.

    Raises:
        ResultsError: a run cannot be read, has no snapshot, or all times lie after the end.
        UnwrittenError: the file cannot be written.
    """
    stills = plotting.still_times(runs, times)
    names = [results.path.resolve().name for results in runs]
    contents = [run_content(results, name) for results, name in zip(runs, names, strict=True)]
    title = contents[0]["title"] if len(runs) == 1 else "Comparison: " + " · ".join(names)
    with whole_file(Path(target)) as aside, PdfPages(aside, metadata={"Title": title, "Creator": "warp-mpm"}) as pages:
        book = _Book(pages, title)
        _cover(book, contents)
        _pictures(book, runs, stills)
        _appendix(book, contents)


class _Book:
    """Pages that fill from the top."""

    def __init__(self, pages: PdfPages, title: str):
        self._pages, self._title, self._number = pages, title, 0
        self._figure: Figure | None = None
        self._y = 0.0

    def text(self, words: str, *, size: float = 9.0, weight: str = "normal", colour: str = "black") -> None:
        """A paragraph over the page's width."""
        width = int(LETTERS * 9.0 / size)
        for line in [part for paragraph in words.split("\n") for part in textwrap.wrap(paragraph, width) or [""]]:
            self._room(size)
            assert self._figure is not None
            self._figure.text(LEFT, self._y, _plain(line), fontsize=size, fontweight=weight, color=colour, va="top")
            self._y -= _height(size)

    def heading(self, words: str) -> None:
        """Of a part; it does not stand alone at the end of a page."""
        if self._y < BOTTOM + 0.12:
            self.turn()
        self.skip(6.0)
        self.text(words, size=12.0, weight="bold", colour="#0072B2")
        self.skip(2.0)

    def skip(self, points: float) -> None:
        self._y -= _height(points)

    def table(self, rows: Rows, header: Sequence[str] = (), *, size: float = 8.0) -> None:
        """Rows of a name and the cells of each run."""
        count = max((len(cells) for _, cells in rows), default=1)
        names = 0.34 if count < 3 else 0.27
        width = (RIGHT - LEFT - names) / count
        letters = int(width * PAGE[0] * 72 / (0.6 * size))
        for name, cells in ([("", list(header))] if header else []) + [(name, list(cells)) for name, cells in rows]:
            parts = [textwrap.wrap(cell, letters, break_long_words=True) or [""] for cell in cells]
            head = textwrap.wrap(name, int(names * PAGE[0] * 72 / (0.6 * size)), drop_whitespace=False) or [""]
            lines = max(len(head), *(len(part) for part in parts))
            self._room(size * lines)
            assert self._figure is not None
            for line in range(lines):
                if line < len(head):
                    self._figure.text(LEFT, self._y, _plain(head[line]), fontsize=size, color="#61656B", va="top")
                for column, part in enumerate(parts):
                    if line < len(part):
                        bold = "bold" if not name and header else "normal"
                        x = LEFT + names + column * width
                        self._figure.text(x, self._y, _plain(part[line]), fontsize=size, va="top", fontweight=bold)
                self._y -= _height(size)
            self._y -= _height(0.15 * size)

    def picture(self, figure: Figure, caption: str, *, tallest: float = 0.8) -> None:
        """A picture in its own proportions, as wide as the page or as high as a share of it, with words below."""
        image = _image(figure)
        width = RIGHT - LEFT
        height = width * PAGE[0] * image.shape[0] / image.shape[1] / PAGE[1]
        if height > tallest:
            width, height = width * tallest / height, tallest
        if self._figure is None or self._y - height - 0.04 < BOTTOM:
            self.turn()
        assert self._figure is not None
        panel = self._figure.add_axes((LEFT, self._y - height, width, height))
        panel.imshow(image, aspect="auto", interpolation="antialiased")
        panel.set_axis_off()
        self._y -= height + 0.008
        self.text(caption, size=8.0, colour="#61656B")
        self.skip(8.0)

    def turn(self) -> None:
        """A new page."""
        self.end()
        self._figure = Figure(figsize=PAGE)
        FigureCanvasAgg(self._figure)
        self._number += 1
        foot = textwrap.shorten(self._title, 110, placeholder=" …")
        self._figure.text(LEFT, 0.03, _plain(foot), fontsize=7, color="#61656B")
        self._figure.text(RIGHT, 0.03, f"{self._number}", fontsize=7, color="#61656B", ha="right")
        self._y = TOP

    def end(self) -> None:
        """Of the page that is being filled."""
        if self._figure is not None:
            self._pages.savefig(self._figure)
            self._figure = None

    def _room(self, size: float) -> None:
        if self._figure is None or self._y - _height(size) < BOTTOM:
            self.turn()


def _height(points: float) -> float:
    """Share of the page that a line of this size takes."""
    return 1.35 * points / 72.0 / PAGE[1]


def _plain(words: str) -> str:
    """A dollar begins no formula."""
    return words.replace("$", r"\$")


def _image(figure: Figure) -> np.ndarray:
    buffer = io.BytesIO()
    FigureCanvasAgg(figure)
    # As wide on the page as 7.2 inches: the figure's own width decides how large its words are.
    figure.savefig(buffer, format="png", dpi=RESOLUTION * (RIGHT - LEFT) * PAGE[0] / figure.get_size_inches()[0])
    buffer.seek(0)
    from matplotlib.image import imread

    return np.asarray(imread(buffer))


def _cover(book: _Book, contents: Sequence[dict[str, Any]]) -> None:
    book.turn()
    one = len(contents) == 1
    book.text(contents[0]["title"] if one else "Comparison of runs", size=16.0, weight="bold")
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    book.text(
        f"Impact of a debris flow on a barrier, simulated by the material point method. {made}.", colour="#61656B"
    )
    for content in contents:
        judged = dict(content["figures"]).get("verdict")
        if judged is not None:
            colour = {"holds": "#007a53", "does NOT hold": "#b00020"}.get(judged, "#61656B")
            of = "Verdict" if one else f"Verdict on {content['name']}"
            book.text(f"{of}: {judged}", size=12.0, weight="bold", colour=colour)
    for content in contents:
        book.skip(4.0)
        if not one:
            book.text(f"{content['name']}: {content['title']}", size=10.0, weight="bold")
        book.text(content["description"])
        if content["source"]:
            book.text(f"Source: {content['source']}")
        for sentence in content["warnings"]:
            book.text(f"Note: {sentence}", colour="#A05A00")
        if content["notes"]:
            book.text(f"Assumed or remarked: {'; '.join(content['notes'])}.", size=8.0, colour="#61656B")
    book.heading("Key figures and verdict")
    _tables(book, contents, "figures")
    book.skip(4.0)
    book.text(
        "Forces, masses, volumes and energies are per metre of width. Limits and partial factors are those of the "
        "scenario's design group; without limits nothing is judged.",
        size=8.0,
        colour="#61656B",
    )


def _tables(book: _Book, contents: Sequence[dict[str, Any]], part: str) -> None:
    """A part of all runs side by side, rows in the order in which they first come."""
    for start in range(0, len(contents), WIDEST_TABLE):
        some = contents[start : start + WIDEST_TABLE]
        columns = [dict(content[part]) for content in some]
        names = list(dict.fromkeys(name for column in columns for name in column))
        rows = [(name, [str(column.get(name, "–")) for column in columns]) for name in names]
        book.table(rows, [content["name"] for content in some] if len(contents) > 1 else ())
        book.skip(6.0)


def _pictures(book: _Book, runs: Sequence[Results], stills: Sequence[float]) -> None:
    for results in runs:
        name = f"{results.path.resolve().name}: " if len(runs) > 1 else ""
        book.picture(
            plotting.scene(results.scenario), f"{name}The scene before it begins, with its measures.", tallest=0.34
        )
        with contextlib.suppress(ResultsError):  # a scene without a barrier has no force to draw
            book.picture(
                plotting.force_and_displacement(results),
                f"{name}Forces on the barrier, its motion, and energies.",
                tallest=0.44,
            )
        if results.scenario.output.loads_by_height:
            with contextlib.suppress(ResultsError):  # a run that ended before its second sample has none
                book.picture(plotting.loads_by_height(results), f"{name}Pressure on the face over height and time.")
    if len(runs) > 1:
        with contextlib.suppress(ResultsError):
            book.picture(plotting.comparison(runs), "All runs in the same panels.")
    liquid = all("pore_pressure" in results.snapshots.names for results in runs)
    field = "pore_pressure" if liquid else "speed"
    words = "Pore pressure" if liquid else "Speed"
    book.picture(plotting.field_panels(runs, field, stills), f"{words} of the material at chosen times.")


def _appendix(book: _Book, contents: Sequence[dict[str, Any]]) -> None:
    book.turn()
    book.heading("Ledger: what was there, came and went, and what is not accounted for")
    _tables(book, contents, "ledger")
    book.heading("Settings")
    _tables(book, contents, "settings")
    book.heading("Effects, and why each is there or not")
    _tables(book, contents, "effects")
    book.heading("Runs and versions")
    _tables(book, contents, "versions")
    book.text(f"This report was made by {versions()}.", size=8.0, colour="#61656B")
    book.end()
