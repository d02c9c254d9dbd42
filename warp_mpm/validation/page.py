"""The page of a validation: Markdown with one plot per case, and the table in the terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.table import Table as RichTable
from rich.text import Text

from analytic.whole_file import write_whole
from warp_mpm.performance.machine import processor
from warp_mpm.plotting.style import GREY, RUN_COLOURS, grid, save
from warp_mpm.validation.case import Case, Check, Outcome, Panel, Point, number

KNOWN_ANSWERS = """\
# Validation

The simulator against closed-form solutions, against experiments, against the paper, and against itself as it is
refined. `python -m warp_mpm validate` computes every number and every picture of this page; `--only NAME` runs one
case, `--quick` coarser or shorter variants of most.

A limit belongs to the case, not to the result: what misses it stays here as **short**, with the reason. Errors are
differences from the reference, as shares of it unless the table says otherwise. Curves of the reference are dashed and
grey.
"""


MEASURED = """\
# Held against measurements

What was measured, beside what the simulator makes of it. `python -m warp_mpm validate --measured` computes every number
and every picture of this page; `--only NAME` runs one case, `--quick` coarser ones, `--finer 2` halves every spacing.
The figures that gate stand in the cases, with their source. The measured curves are not shipped: `--data DIR` reads
them from a folder, draws them, and compares whole curves.

Each limit was written into the docstring of its case, with its reason, before the case was first run, and is printed
below as it stands there; what was changed after a run had been seen says so. What misses its limit stays on this page
as **short**, with what was tried.

Not compared: dam breaks onto a box and a column (Kleefsman, Yeh and Petroff), which are three-dimensional.

On a smooth ground water runs ahead of every experiment here, ours by 15 % (1.80 √(g H) where 1.57 was measured,
Ritter's solution having 2), and so it does in other codes that do not resolve its boundary layer. OpenFOAM's
interFoam has the front of Martin and Moyce's square column 9 to 21 % ahead with cells of a/20, at 1.73 √(g a) where
1.49 was measured, though 13 % behind with cells of a/8 (report F7 of github.com/Certonomous/Certonomous, 2026), and
that of their column half as wide 10 % ahead, 3 % once its clock is shifted by 0.175
(github.com/vamseeachanta/digitalmodel, pull request 1260), ours 1 % once shifted by 0.13.

In the picture a bar across reaches over what was measured, where that is known (scatter of repeats, one standard
deviation, error of digitising); a bar upward reaches from the finest spacing to the one before. A hollow mark at the
lower edge is a figure of which a run has nothing left, as where a flow has passed already. Debris stands beside the
mixture without mud; in the tables both count. Formulas and the closed form can be held against one figure alone, the
greatest mean pressure over the depth that arrives at the wall, and are given its measured speed and depth.
"""


@dataclass(frozen=True)
class Kind:
    """A page that a validation writes."""

    name: str
    """Of the page without its ending, and of the folder of its pictures."""
    introduction: str
    options: str = ""
    """Of the command, beside `--only`."""


KINDS = {
    "known answers": Kind("validation", KNOWN_ANSWERS),
    "measured": Kind("measured", MEASURED, "--measured "),
}


@dataclass(frozen=True)
class Result:
    """A case, what came of it, and how long it took [s]."""

    case: Case
    outcome: Outcome
    seconds: float
    pictures: Sequence[tuple[str, str]] = ()
    """What each shows, and its file in the folder of the page's pictures."""


# -- the page ----------------------------------------------------------------------------------------------------


def write(
    folder: Path, results: Sequence[Result], *, kind: Kind, how: str, versions: str, first: Figure | None = None
) -> Path:
    """Write the page into `folder`, beside the pictures of its cases; returns the page's path.

    Args:
        folder: of the page.
        results: of the cases, in their order.
        kind: which page it is.
        how: which variants were run, of what.
        versions: of what computed it.
        first: picture above all cases.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lines = [kind.introduction]
    seconds = sum(result.seconds for result in results)
    lines.append(f"Computed with {versions}; {how}, {seconds:.0f} s on one core ({processor()}).\n")
    if first is not None:
        save(first, folder / kind.name / "everything.png")
        lines.append(f"![Everything measured against everything computed]({kind.name}/everything.png)\n")
    lines.append("| case | verdict | largest error over its limit | time |\n| --- | --- | --- | --- |")
    for result in results:
        lines.append(
            f"| [{result.case.title}](#{_anchor(result.case.title)}) | {verdict(result.outcome)} | "
            f"{_worst(result.outcome)} | {result.seconds:.0f} s |"
        )
    for result in results:
        lines += ["", *_section(result, kind)]
    page = folder / f"{kind.name}.md"
    write_whole(page, "\n".join(lines) + "\n")
    return page


def _anchor(title: str) -> str:
    """The anchor that Markdown readers make of a heading."""
    return "".join(c for c in title.lower().replace(" ", "-") if c.isalnum() or c in "-_")


def _section(result: Result, kind: Kind) -> list[str]:
    case, outcome = result.case, result.outcome
    alone = f"Run alone: `{kind.options}--only {case.name}`."
    lines = [f"## {case.title}", "", case.tests, ""]
    if case.set_before:
        lines += [f"Reference: {case.source}. {alone}", "", "**Set before the run.** " + case.limit, ""]
    else:
        lines += [f"Reference: {case.source}. Limit: {case.limit}. {alone}", ""]
    for remark in outcome.remarks:
        lines += [remark, ""]
    for shows, file in result.pictures:
        lines += [f"![{shows}]({kind.name}/{file})", ""]
    if outcome.checks:
        lines += ["| | quantity | ours | reference | error | limit |", "| --- | --- | --- | --- | --- | --- |"]
        for check in outcome.checks:
            lines.append(f"| {' | '.join(_cells(check))} |")
        lines.append("")
    reasons = dict.fromkeys(check.remark for check in outcome.checks if check.remark and check.passed is not True)
    for reason in reasons:
        which = [check for check in outcome.checks if check.remark == reason and check.passed is not True]
        mark = "Short" if any(check.passed is False for check in which) else "Note"
        names = "; ".join(check.quantity for check in which)
        lines += [f"*{mark}* ({names}): {reason}.", ""]
    for table in outcome.tables:
        lines += [f"**{table.title}**", "", f"| {' | '.join(table.columns)} |", "| --- " * len(table.columns) + "|"]
        lines += [f"| {' | '.join(row)} |" for row in table.rows]
        lines.append("")
    return lines[:-1]


def _cells(check: Check) -> list[str]:
    return [
        {True: "ok", False: "**short**", None: ""}[check.passed],
        check.quantity,
        f"{number(check.ours)} {check.unit.replace('-', '') if check.unit == '-' else check.unit}".strip(),
        check.reference,
        "" if check.error is None else _share(check.error, check),
        "" if check.limit is None else _share(check.limit, check),
    ]


def _share(value: float, check: Check) -> str:
    smallest = check.limit if check.limit is not None else value
    if check.percent and (smallest >= 1e-3 or smallest == 0.0):
        return f"{100.0 * value:.0f} %" if value >= 1.0 else f"{100.0 * value:.2g} %"
    return f"{value:.2g}"


def verdict(outcome: Outcome) -> str:
    """`ok`, `short` with how many of the judged checks are, or `reported`."""
    judged = [check for check in outcome.checks if check.passed is not None]
    if outcome.short:
        return f"**short** ({len(outcome.short)} of {len(judged)})"
    return "ok" if judged else "reported"


def _worst(outcome: Outcome) -> str:
    """The largest error over its limit among the checks that have one."""
    shares = [check.error / check.limit for check in outcome.checks if check.error is not None and check.limit]
    return f"{max(shares):.2g}" if shares else ""


MOST_LABELS = 6
"""A longer legend stands below its panel, where it hides nothing."""

SECOND_BAND = "#B5651D"
"""Colour of a second band beside a grey one."""

# -- plots -------------------------------------------------------------------------------------------------------


def draw(case: Case, outcome: Outcome, folder: Path) -> list[tuple[str, str]]:
    """Write a case's pictures into `folder`; returns what each shows and its file there."""
    written = []
    if outcome.panels:
        save(drawn(outcome.panels), folder / f"{case.name}.png")
        written.append((case.title, f"{case.name}.png"))
    for name, figure in outcome.pictures.items():
        save(figure, folder / f"{case.name}-{name}.png")
        written.append((name.replace("-", " "), f"{case.name}-{name}.png"))
    return written


def drawn(panels: Sequence[Panel]) -> Figure:
    """All panels of a case, two in a row."""
    columns = min(len(panels), 2)
    rows = math.ceil(len(panels) / columns)
    height = 4.4 if any(len(_labels(panel)) > MOST_LABELS for panel in panels) else 3.3
    figure = Figure(figsize=(5.2 * columns, height * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for panel, place in zip(panels, axes, strict=False):
        _draw(place, panel)
    for place in axes[len(panels) :]:
        place.set_visible(False)
    return figure


def _labels(panel: Panel) -> list[str]:
    labels = [*(curve.label for curve in panel.curves), *(band.label for band in panel.bands)]
    return [label for label in labels if label]


def _draw(place: Axes, panel: Panel) -> None:
    colours = iter(RUN_COLOURS * 4)
    for band, colour in zip(panel.bands, (GREY, SECOND_BAND) * len(panel.bands), strict=False):
        label = band.label or None
        place.fill_between(band.x, band.low, band.high, color=colour, alpha=0.25, linewidth=0.0, label=label)
    for curve in panel.curves:
        label = curve.label or None
        if curve.style == "reference":
            place.plot(curve.x, curve.y, color=GREY, linestyle="--", linewidth=1.6, label=label, zorder=1)
        elif curve.style[0].isalpha() and curve.style[0] in "kbr":
            colour = {"k": "#000000", "b": RUN_COLOURS[0], "r": RUN_COLOURS[1]}[curve.style[0]]
            place.plot(curve.x, curve.y, curve.style[1:], color=colour, label=label, linewidth=1.2, markersize=4)
        else:
            place.plot(curve.x, curve.y, curve.style, color=next(colours), label=label, linewidth=1.2, markersize=4)
    place.set(title=panel.title, xlabel=panel.x_label, ylabel=panel.y_label)
    place.title.set_fontsize(10)
    if panel.log_x:
        place.set_xscale("log")
    if panel.log_y:
        place.set_yscale("log")
    if panel.x_range is not None:
        place.set_xlim(*panel.x_range)
    grid(place)
    if len(_labels(panel)) > MOST_LABELS:
        place.legend(fontsize=7, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.22))
    elif _labels(panel):
        place.legend(fontsize=8)


WITHIN = 0.25
"""How near a computed figure is to what was measured, to be counted in the picture of all."""


def everything(outcomes: Sequence[Outcome]) -> Figure | None:
    """Each figure that was measured and computed as one point, with the ends of both; None where there is none."""
    points = [point for outcome in outcomes for point in outcome.points if point.measured > 0.0]
    if not any(point.computed > 0.0 for point in points):
        return None
    figure = Figure(figsize=(8.0, 7.7), layout="constrained")
    place = figure.subplots()
    values = [value for point in points for value in (point.measured, point.computed) if value > 0.0]
    ends = np.array([0.6 * min(values), 1.6 * max(values)])
    nearest = 1.0 - WITHIN, 1.0 + WITHIN
    place.fill_between(ends, nearest[0] * ends, nearest[1] * ends, color=GREY, alpha=0.2, linewidth=0.0)
    place.plot(ends, ends, color=GREY, linewidth=1.0)
    colours, marks = iter(RUN_COLOURS * 2), iter("os^Dv<>P" * 2)
    for by in dict.fromkeys(point.by for point in points):
        own = [point for point in points if point.by == by]
        near = sum(nearest[0] <= point.computed / point.measured <= nearest[1] for point in own)
        colour, mark = next(colours), next(marks)
        drawn = [point for point in own if point.computed > 0.0]
        place.errorbar(
            [point.measured for point in drawn], [point.computed for point in drawn],
            xerr=_bars([[p.measured_low, p.measured, p.measured_high] for p in drawn]),
            yerr=_bars([[p.computed_low, p.computed, p.computed_high] for p in drawn]),
            fmt=mark, color=colour, ecolor=(colour, 0.45), label=f"{by}: {near} of {len(own)}",
            markersize=4.5, elinewidth=0.8, capsize=1.5, linewidth=0.0,
        )  # fmt: skip
        nothing = [point.measured for point in own if point.computed <= 0.0]
        if nothing:
            at_edge = np.full(len(nothing), ends[0])
            place.plot(nothing, at_edge, mark, color=colour, markerfacecolor="none", clip_on=False)
    place.set(xscale="log", yscale="log", xlim=ends, ylim=ends, xlabel="measured", ylabel="computed", aspect="equal")
    _name([point for point in points if point.label and point.computed > 0.0], place)
    place.set_title("Everything measured against everything computed, each in its own unit", fontsize=10)
    grid(place)
    title = f"figures within {100.0 * WITHIN:.0f} % (grey)"
    place.legend(fontsize=8, loc="upper left", title=title, title_fontsize=8)
    return figure


def _bars(values: list[list[float]]) -> NDArray[np.float64]:
    """Lengths [2, N] of bars that reach from N values to their ends, of [low, value, high] each."""
    return np.maximum(np.diff(np.array(values).reshape(-1, 3), axis=1), 0.0).T


def _name(points: Sequence[Point], place: Axes) -> None:
    """Write the labels of points to the left of them, one above the other."""
    above = 0.0
    for point in sorted(points, key=lambda point: point.computed):
        above = max(point.computed, 1.12 * above)
        place.annotate(
            point.label, (point.measured, point.computed), (0.8 * point.measured, above), fontsize=6.5, ha="right",
            va="center", arrowprops={"arrowstyle": "-", "linewidth": 0.4, "color": GREY, "shrinkB": 3.0},
        )  # fmt: skip


# -- the terminal ------------------------------------------------------------------------------------------------


def summary_table(results: Sequence[Result]) -> RichTable:
    """One line per case."""
    table = RichTable(box=None, padding=(0, 2, 0, 0))
    for heading in ("case", "verdict", "error / limit", "time"):
        table.add_column(heading, justify="right" if heading in ("error / limit", "time") else "left")
    for result in results:
        short = bool(result.outcome.short)
        table.add_row(
            result.case.name,
            Text(verdict(result.outcome).replace("*", ""), style="red" if short else "green"),
            _worst(result.outcome),
            f"{result.seconds:.1f} s",
        )
    return table


def check_table(outcome: Outcome) -> RichTable:
    """One line per check."""
    table = RichTable(box=None, padding=(0, 2, 0, 0))
    for heading in ("", "quantity", "ours", "reference", "error", "limit"):
        table.add_column(heading)
    for check in outcome.checks:
        first, *rest = _cells(check)
        style: Any = {True: "green", False: "bold red", None: "dim"}[check.passed]
        table.add_row(Text(first.replace("*", ""), style=style), *(Text(cell) for cell in rest))
    return table
