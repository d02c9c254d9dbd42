"""Figures of a run. Every axis carries its unit; colour-blind readers can tell the colours (Okabe and Ito's) apart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.patches import Rectangle

from warp_mpm.results import Results, ResultsError, Snapshot
from warp_mpm.scenario import Fixed, Scenario, Trapezoid
from warp_mpm.summary import FILTER_WINDOW, moving_mean

BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#6E6E6E"
PRESSURE_TIMES = (1.0, 2.0, 4.0)
"""Times [s] of the paper's Figs. 4 to 6."""


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, whole or not at all."""
    aside = path.with_name(path.name + ".new")
    FigureCanvasAgg(figure)
    figure.savefig(aside, dpi=150, format="png")
    aside.replace(path)


def force_and_displacement(results: Results) -> Figure:
    """Forces, barrier displacement and kinetic energies against time (as the paper's Fig. 7).

    Raises:
        ResultsError: the scene has no barrier, or the time series cannot be read.
    """
    series, scenario = results.time_series, results.scenario
    if "impact_force_x" not in series or scenario.barrier is None:
        raise ResultsError(f"{results.path} has no barrier, so there is no impact force to draw.")
    time = series["time"]
    moves = not isinstance(scenario.barrier.motion, Fixed)
    rows = 3 if moves else 2
    figure = Figure(figsize=(7.5, 2.0 + 2.0 * rows), layout="constrained")
    axes = figure.subplots(rows, 1, sharex=True, height_ratios=[2.0] + [1.0] * (rows - 1))
    figure.suptitle(scenario.title, fontsize=11)

    forces = axes[0]
    raw = series["impact_force_x"] / 1e3
    filtered = moving_mean(time, series["impact_force_x"]) / 1e3
    forces.plot(time, raw, color=BLUE, alpha=0.3, linewidth=0.7)
    forces.plot(time, filtered, color=BLUE, label="impact, horizontal $F_{2,x}$")
    lines = (
        ("impact_force_y", "impact, vertical $F_{2,y}$", ORANGE, "-"),
        ("top_force", "crest $F_3$", GREEN, "-"),
        ("base_force", "base friction $F_4$", PURPLE, "--"),
    )
    for name, label, colour, style in lines:
        if name in series and np.any(series[name]):
            forces.plot(time, moving_mean(time, series[name]) / 1e3, color=colour, linestyle=style, label=label)
    peak = int(np.argmax(filtered))
    forces.plot(time[peak], filtered[peak], "o", color=BLUE, markersize=4)
    forces.annotate(
        f"{filtered[peak]:.0f} kN/m at {time[peak]:.2f} s",
        (time[peak], filtered[peak]),
        xytext=(8, 2),
        textcoords="offset points",
        fontsize=9,
    )
    forces.set_ylabel("force [kN/m]")
    forces.axhline(0.0, color=GREY, linewidth=0.6)
    forces.legend(fontsize=9, title=f"means over {FILTER_WINDOW:g} s", title_fontsize=8)

    if moves:
        moved = axes[1]
        displacement = series["barrier_displacement"]
        moved.plot(time, displacement, color=BLUE)
        moved.set_ylabel("barrier\ndisplacement [m]")
        moved.annotate(
            f"{displacement[-1]:.2f} m",
            (time[-1], displacement[-1]),
            xytext=(-4, -12),
            textcoords="offset points",
            ha="right",
            fontsize=9,
        )
    energy = axes[-1]
    energy.plot(time, series["flow_kinetic_energy"] / 1e3, color=BLUE, label="flow")
    if moves and "barrier_kinetic_energy" in series:
        energy.plot(time, series["barrier_kinetic_energy"] / 1e3, color=ORANGE, linestyle="--", label="barrier")
    energy.set_ylabel("kinetic\nenergy [kJ/m]")
    energy.legend(fontsize=9)
    energy.set_ylim(bottom=0.0)
    energy.set_xlabel("time [s]")
    energy.set_xlim(float(time[0]), float(time[-1]))
    for panel in axes:
        panel.grid(color="#DDDDDD", linewidth=0.5)
    return figure


def pore_pressure(results: Results, times: Sequence[float] = PRESSURE_TIMES) -> Figure:
    """The flow at several times [s], coloured by pore pressure, with the barrier to scale (the paper's Figs. 4 to 6).

    A dry flow is coloured by its speed. Times after the end of the run are left out; if none is left, the last
    snapshot is drawn.

    Raises:
        ResultsError: the snapshots cannot be read.
    """
    scenario, snapshots = results.scenario, results.snapshots
    if len(snapshots) == 0:
        raise ResultsError(f"{results.path} holds no snapshot to draw.")
    wanted = [time for time in times if time <= snapshots.times[-1] + 1e-9] or [float(snapshots.times[-1])]
    frames = [snapshots.at(time) for time in wanted]
    wet = "pore_pressure" in frames[0]
    shown = [_shown(frame, wet) for frame in frames]
    # A few points of a jet that lands must not take the whole scale for themselves.
    top = max(float(np.quantile(values, 0.99)) if len(values) else 0.0 for values in shown) or 1.0

    left, right, bottom, high = _window(scenario, frames)
    # Panels as wide as a page, but no taller than a third of one; the rest of the width is labels and scale.
    aspect = (right - left) / (high - bottom)
    panel_height = min(max(7.0 / aspect, 0.6), 3.2)
    width = min(max(panel_height * aspect, 4.0), 7.0) + 2.0
    figure = Figure(figsize=(width, (panel_height + 0.35) * len(frames) + 0.8), layout="compressed")
    axes = np.atleast_1d(figure.subplots(len(frames), 1, sharex=True))
    figure.suptitle(scenario.title, fontsize=11)
    drawn: Any = None
    for panel, frame, values in zip(axes, frames, shown, strict=True):
        drawn = _draw_points(panel, frame, values, top)
        _draw_surroundings(panel, scenario, frame, (left, right, bottom, high))
        unit = "kPa" if wet else "m/s"
        most = f"greatest {'pore pressure' if wet else 'speed'} {float(values.max(initial=0.0)):.0f} {unit}"
        panel.set_title(f"t = {frame.time:.2f} s   {most}", fontsize=9, loc="left")
        panel.set(xlim=(left, right), ylim=(bottom, high), aspect="equal", ylabel="y [m]")
    axes[-1].set_xlabel("x [m]")
    label = "pore pressure [kPa]" if wet else "speed of the solid [m/s]"
    figure.colorbar(drawn, ax=list(axes), label=label, extend="max", shrink=0.9, pad=0.01)
    return figure


def _shown(frame: Snapshot, wet: bool) -> np.ndarray:
    return frame["pore_pressure"] / 1e3 if wet else np.hypot(*frame["solid_velocity"].T)


def _window(scenario: Scenario, frames: Sequence[Snapshot]) -> tuple[float, float, float, float]:
    """Limits [m] that hold the material and the barrier in all frames."""
    points = np.concatenate([frame.position for frame in frames])
    if scenario.barrier is not None and isinstance(scenario.barrier.shape, Trapezoid):
        outlines = [_moved(scenario.barrier.shape, frame.barrier_displacement or 0.0) for frame in frames]
        points = np.concatenate([points, *outlines])
    (left, bottom), (right, high) = points.min(axis=0), points.max(axis=0)
    margin = 0.03 * max(right - left, high - bottom)
    if scenario.ground is not None:
        bottom = 0.0
    return float(left - margin), float(right + margin), float(bottom - margin), float(high + margin)


def _moved(shape: Trapezoid, displacement: float) -> np.ndarray:
    return shape.polygon + np.array([displacement, 0.0])


def _draw_points(panel: Axes, frame: Snapshot, values: np.ndarray, top: float) -> EllipseCollection:
    """Each material point as a disc to scale, wide enough to meet its neighbours in a flow that has stretched."""
    diameter = 1.4 * np.sqrt(frame["volume"])
    discs = EllipseCollection(
        diameter,
        diameter,
        np.zeros(len(diameter)),
        units="xy",
        offsets=frame.position,
        offset_transform=panel.transData,
        cmap="viridis",
        linewidths=0.0,
    )
    discs.set_array(values)
    discs.set_clim(0.0, top)
    panel.add_collection(discs)
    return discs


def _draw_surroundings(
    panel: Axes, scenario: Scenario, frame: Snapshot, window: tuple[float, float, float, float]
) -> None:
    left, right, bottom, high = window
    if scenario.ground is not None:
        panel.axhspan(bottom, 0.0, color="#D9D2C5", linewidth=0.0)
        panel.axhline(0.0, color=GREY, linewidth=0.8)
    if scenario.barrier is None:
        return
    shift = frame.barrier_displacement or 0.0
    if isinstance(scenario.barrier.shape, Trapezoid):
        now, start = _moved(scenario.barrier.shape, shift), scenario.barrier.shape.polygon
        panel.add_patch(PolygonPatch(now, facecolor="#B5B5B5", edgecolor="#333333", linewidth=0.8))
        if abs(shift) > 0.002 * (right - left):
            panel.add_patch(PolygonPatch(start, fill=False, edgecolor=GREY, linewidth=0.8, linestyle=":"))
    else:
        panel.add_patch(Rectangle((shift, 0.0), right - shift, high, facecolor="#B5B5B5", edgecolor="#333333"))
