"""The material points, to scale, with barrier and ground."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from warp_mpm.fields import colour_limits, field_named, field_values, solid_density_of
from warp_mpm.plotting.site import draw_barriers, draw_ground, draw_section, lowest
from warp_mpm.plotting.style import heading
from warp_mpm.quantities.points import Drawn
from warp_mpm.results import Results, ResultsError, Snapshot
from warp_mpm.scenario import Scenario
from warp_mpm.scenario.site import all_standing

STILL_SHARES = (1 / 6, 1 / 3, 2 / 3)
"""Times of still pictures as shares of a run; of the paper's 6 s they are 1, 2 and 4 s, as in its Figs. 4 to 6."""

LETTER = 0.085
"""Mean width of a letter of a label [inches], rounded up."""

Window = tuple[float, float, float, float]
"""left, right, bottom, top [m]."""


def pore_pressure(results: Results, times: Sequence[float] | None = None) -> Figure:
    """The flow at several times, coloured by pore pressure, a dry one by its speed; see `field_panels`."""
    wet = "pore_pressure" in results.snapshots.names
    return field_panels([results], "pore_pressure" if wet else "speed", times)


def still_times(runs: Sequence[Results], times: Sequence[float] | None = None) -> list[float]:
    """Times [s] of still pictures, less those after the last snapshot of the longest run.

    Args:
        runs: at least one.
        times: [s] that are wanted; None for the snapshots nearest to `STILL_SHARES`.

    Raises:
        ResultsError: a run holds no snapshot, or all times lie beyond the end.
    """
    for results in runs:
        if len(results.snapshots) == 0:
            raise ResultsError(f"{results.path} holds no snapshot to draw.")
    there = max((results.snapshots.times for results in runs), key=lambda one: float(one[-1]))
    end = float(there[-1])
    if times is None:
        return sorted({float(there[np.argmin(np.abs(there - share * end))]) for share in STILL_SHARES})
    within = [time for time in times if time <= end + 1e-9]
    if not within:
        asked = ", ".join(f"{time:g}" for time in times)
        raise ResultsError(f"There is nothing to draw at {asked} s: the last snapshot is at t = {end:g} s.")
    return within


def field_panels(runs: Sequence[Results], name: str, times: Sequence[float] | None = None) -> Figure:
    """The flow at several times, coloured by a field, one column for each run (the paper's Figs. 4 to 6).

    Args:
        runs: at least one.
        name: of a field, see `warp_mpm.fields`.
        times: [s], see `still_times`; those after the end of all runs are left out.

    Raises:
        ResultsError: the snapshots cannot be read, all times lie after their end, or a run has no such field.
        ValueError: the field is not known.
    """
    field = field_named(name)
    wanted = still_times(runs, times)
    frames = [[results.snapshots.at(time) for time in wanted] for results in runs]
    values = [[shown(results, frame, field) for frame in row] for results, row in zip(runs, frames, strict=True)]
    low, high = colour_limits(np.concatenate([one for row in values for one in row]), field.signed)
    # One window for all, so that lengths compare from panel to panel.
    windows = np.array([window(results.scenario, row) for results, row in zip(runs, frames, strict=True)])
    left, bottom = windows[:, [0, 2]].min(axis=0)
    right, top = windows[:, [1, 3]].max(axis=0)
    view = (float(left), float(right), float(bottom), float(top))

    # Panels as wide as a page, but no taller than a third of one; the rest of the width is labels and scale.
    aspect = (right - left) / (top - bottom)
    page = 7.0 if len(runs) == 1 else 5.0
    panel_height = min(max(page / aspect, 0.6), 3.2)
    width = min(max(panel_height * aspect, 4.0), page) * len(runs) + 2.0
    figure = Figure(figsize=(width, (panel_height + 0.35) * len(wanted) + 0.8), layout="compressed")
    axes = figure.subplots(len(wanted), len(runs), squeeze=False, sharex=True, sharey=True)
    drawn: Any = None
    for column, results in enumerate(runs):
        for row, frame in enumerate(frames[column]):
            panel = axes[row, column]
            drawn = draw_points(panel, frame, values[column][row], field, (low, high))
            draw_surroundings(panel, results.scenario, frame, view, results.barrier_displacements(frame))
            greatest = f"{values[column][row].max(initial=0.0):.3g} {field.shown_unit.strip('-')}"
            caption = f"t = {frame.time:.2f} s, greatest {greatest.strip()}"
            if row == 0 and len(runs) > 1:
                caption = f"{in_lines(results.scenario.title, min(panel_height * aspect, page))}\n{caption}"
            panel.set_title(caption.replace("$", r"\$"), fontsize=9, loc="left")
            panel.set_ylabel("y [m]" if column == 0 else "")
        axes[-1, column].set_xlabel("x [m]")
    if len(runs) == 1:
        heading(figure, runs[0].scenario.title)
    figure.colorbar(
        drawn,
        ax=list(axes.ravel()),
        label=in_lines(field.title, 0.7 * figure.get_figheight()),
        extend="both" if field.signed else "max",
        shrink=0.9,
        pad=0.01,
    )
    return figure


def in_lines(words: str, length: float) -> str:
    """Words in lines no longer than `length` [inches], for labels that matplotlib itself does not wrap."""
    return textwrap.fill(words, max(8, int(length / LETTER)), break_on_hyphens=False)


def shown(results: Results, frame: Snapshot, field: Drawn) -> np.ndarray:
    """Values [N] of a field of a snapshot.

    Raises:
        ResultsError: the run has no such field.
    """
    values = field_values(frame, field.name, solid_density_of(results.scenario, frame))
    if values is None:
        raise ResultsError(f"{results.path} has no {field.words}: it is a {results.scenario.flow.formulation} flow.")
    return values


def window(scenario: Scenario, frames: Sequence[Snapshot]) -> Window:
    """Limits [m] that hold the barrier and 97 % of the material in every frame: the thread of a jet that has run far
    ahead would leave the rest too small to see."""
    spans = [np.quantile(frame.position, (0.005, 0.97), axis=0) for frame in frames if len(frame.position)]
    points = np.concatenate([*spans, np.zeros((1, 2))])
    for name, _, _, standing in all_standing(scenario):
        if standing is not None:
            moved = [frame.barrier_displacement or 0.0 if name == "barrier" else 0.0 for frame in frames]
            points = np.concatenate([points, *(standing + np.array([shift, 0.0]) for shift in moved)])
    (left, bottom), (right, high) = points.min(axis=0), points.max(axis=0)
    margin = 0.03 * max(right - left, high - bottom)
    if scenario.ground is not None:
        bottom = min(lowest(scenario, left - margin, right + margin), bottom if not scenario.ground.level else 0.0)
    return float(left - margin), float(right + margin), float(bottom - margin), float(high + margin)


def draw_points(
    panel: Axes, frame: Snapshot, values: np.ndarray, field: Drawn, limits: tuple[float, float]
) -> EllipseCollection:
    """Each material point as a disc to scale, wide enough to meet its neighbours in a flow that has stretched."""
    diameter = 1.4 * np.sqrt(frame["volume"])
    discs = EllipseCollection(
        diameter,
        diameter,
        np.zeros(len(diameter)),
        units="xy",
        offsets=frame.position,
        offset_transform=panel.transData,
        cmap="RdBu_r" if field.signed else "viridis",
        linewidths=0.0,
    )
    discs.set_array(values)
    discs.set_clim(*limits)
    panel.add_collection(discs)
    return discs


def draw_surroundings(
    panel: Axes, scenario: Scenario, frame: Snapshot, limits: Window, moved: Mapping[str, float] | None = None
) -> None:
    """Ground, barriers where they stand and, dotted, where they stood, and an inflow's section; the panel's limits.

    Args:
        panel: to draw on.
        scenario: of the run.
        frame: of which the first barrier's displacement is taken where `moved` is not given.
        limits: of the panel.
        moved: displacements of the barriers by name [m], from `Results.barrier_displacements`.
    """
    left, right, bottom, high = limits
    panel.set(xlim=(left, right), ylim=(bottom, high), aspect="equal")
    draw_ground(panel, scenario, left, right, bottom)
    shown = {"barrier": frame.barrier_displacement or 0.0} if moved is None else moved
    draw_barriers(panel, scenario, shown, right, high)
    if scenario.flow.inflow is not None:
        draw_section(panel, scenario.flow.inflow, linewidth=0.8, linestyle=":")
