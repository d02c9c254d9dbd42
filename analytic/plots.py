"""Figures of the closed form, of calibrations, of field events and of designs. Colours are Okabe and Ito's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analytic.arrays import Trajectory, trajectory
from analytic.calibration import Calibration, KeyFigures
from analytic.field_data import SYNTHETIC, Agreement, Events
from analytic.force_record import moving_mean
from analytic.impact import Impact
from analytic.sweep_fit import SMALL_DISPLACEMENT
from analytic.whole_file import UnwrittenError, whole_file

if TYPE_CHECKING:
    from analytic.reliability import Reliability  # with SciPy's statistics, which take a second
    from analytic.sweep import Run

Array = NDArray[np.float64]

BLUE, ORANGE, GREEN, PURPLE, GREY, YELLOW, SKY = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#6E6E6E",
    "#E69F00",
    "#56B4E9",
)
FORMATS = ("png", "pdf", "svg")


class PlotError(ValueError):
    """A picture that cannot be written; one sentence."""


def check_path(path: Path) -> None:
    """Refuse a picture file before anything is computed for it.

    Raises:
        PlotError: the format is unknown or the folder does not exist.
    """
    if path.suffix.lstrip(".").lower() not in FORMATS:
        raise PlotError(f"{path} has the suffix {path.suffix!r}, a picture is one of {', '.join(FORMATS)}.")
    if not path.parent.is_dir():
        raise PlotError(f"{path} cannot be written, the folder {path.parent} does not exist.")


def save(figure: Figure, path: Path) -> None:
    """Write a picture, whole or not at all.

    Raises:
        PlotError: see `check_path`, or the file cannot be written.
    """
    check_path(path)
    FigureCanvasAgg(figure)
    try:
        with whole_file(path) as aside:
            figure.savefig(aside, dpi=150, format=path.suffix.lstrip(".").lower())
    except UnwrittenError as error:
        raise PlotError(str(error)) from None


def impacts(curves: Mapping[str, Impact], title: str = "") -> Figure:
    """Force, velocities, displacement and kinetic energies against time, one colour for each impact (as Fig. 9)."""
    end = max(_end(impact) for impact in curves.values())
    first = min(impact.arrival_time for impact in curves.values())
    time = np.linspace(first - 0.05 * (end - first), end, 1200)
    figure = Figure(figsize=(9, 6.5), layout="constrained")
    figure.suptitle(title, fontsize=11)
    axes = figure.subplots(2, 2, sharex=True).ravel()
    for colour, (label, impact) in zip((BLUE, ORANGE, GREEN, PURPLE, YELLOW, GREY), curves.items(), strict=False):
        at: Trajectory = trajectory(impact, time)
        axes[0].plot(time, at.force / 1e3, color=colour, label=label)
        axes[1].plot(time, at.flow_velocity, color=colour, label=f"{label}: flow")
        axes[1].plot(time, at.barrier_velocity, color=colour, linestyle="--", label=f"{label}: barrier")
        axes[2].plot(time, at.flow_kinetic_energy / 1e3, color=colour)
        axes[2].plot(time, at.barrier_kinetic_energy / 1e3, color=colour, linestyle="--")
        axes[3].plot(time, at.barrier_displacement, color=colour)
        if not impact.fixed:
            axes[0].axhline(impact.threshold_force / 1e3, color=colour, linewidth=0.8, linestyle=":")
    for axis, label in zip(
        axes,
        ("impact force F [kN/m]", "velocity [m/s]", "kinetic energy [kJ/m]", "barrier displacement Δx [m]"),
        strict=True,
    ):
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    for axis in axes[2:]:
        axis.set_xlabel("time [s]")
    if any(not impact.fixed for impact in curves.values()):
        axes[0].plot([], [], color=GREY, linewidth=0.8, linestyle=":", label="force that moves the barrier")
    axes[0].legend(fontsize=8)
    axes[1].legend(["flow", "barrier"], fontsize=8)
    axes[2].legend(["flow", "barrier"], fontsize=8)
    return figure


def _end(impact: Impact) -> float:
    stop = impact.stop_time if np.isfinite(impact.stop_time) else 0.0
    return 1.1 * max(stop, impact.impact_end_time)


def calibrations(records: Sequence[tuple[str, Mapping[str, Array], Sequence[Calibration]]]) -> Figure:
    """Recorded and closed-form force and kinetic energies, one row for each record (as Figs. 10 and 11).

    `records`: title, time series and the calibrations on it.
    """
    figure = Figure(figsize=(10, 2.6 * len(records) + 0.6), layout="constrained")
    rows = figure.subplots(len(records), 2, squeeze=False)
    for (title, series, fits), (left, right) in zip(records, rows, strict=True):
        time = series["time"]
        measured = fits[0].measured
        filtered = moving_mean(time, series["impact_force_x"], measured.filter_window)
        left.plot(time, series["impact_force_x"] / 1e3, color=GREY, alpha=0.35, linewidth=0.6)
        left.plot(time, filtered / 1e3, color=GREY, linewidth=1.2, label=f"recorded, {measured.filter_window:g} s mean")
        for name, style in (("flow_kinetic_energy", "-"), ("barrier_kinetic_energy", "--")):
            if name in series:
                right.plot(time, series[name] / 1e3, color=GREY, linestyle=style)
        fine = np.linspace(time[0], time[-1], 1500)
        for colour, fit in zip((BLUE, ORANGE), fits, strict=False):
            at = trajectory(fit.impact, fine)
            label = f"{fit.rule.replace('_', ' ')}: λ = {fit.geometry_change:.3g}, τ = {fit.rise_ratio:.3g}"
            left.plot(fine, at.force / 1e3, color=colour, label=label)
            right.plot(fine, at.flow_kinetic_energy / 1e3, color=colour)
            right.plot(fine, at.barrier_kinetic_energy / 1e3, color=colour, linestyle="--")
        left.set_ylabel("force [kN/m]")
        right.set_ylabel("kinetic energy [kJ/m]")
        left.set_title(title, fontsize=9, loc="left")
        right.set_title("flow (solid), barrier (dashed)", fontsize=9, loc="left")
        left.legend(fontsize=7)
        for axis in (left, right):
            axis.grid(alpha=0.3)
            axis.set_xlabel("time [s]", fontsize=8)
    return figure


KEY_FIGURE_LABELS = {
    "peak_force": ("peak force [kN/m]", 1e-3),
    "rise_time": ("rise time T1 [s]", 1.0),
    "duration": ("duration T2 [s]", 1.0),
    "flow_kinetic_energy_at_peak": ("flow energy at T1 [kJ/m]", 1e-3),
    "barrier_kinetic_energy_max": ("largest barrier energy [kJ/m]", 1e-3),
    "barrier_displacement_final": ("final displacement [m]", 1.0),
}
"""Quantities of the paper's Figs. 13 and 14, with their factors to the plotted units."""


def comparison(title: str, figures: Mapping[str, Mapping[str, KeyFigures]], sliding: bool) -> Figure:
    """Bars of each quantity by record and source (as Fig. 13 for fixed barriers, Fig. 14 for sliding ones).

    `figures`: by record, then by source ("simulated", "closed form, ...").
    """
    names = [name for name in KEY_FIGURE_LABELS if sliding or not name.startswith("barrier")]
    figure = Figure(figsize=(10, 3.0 * -(-len(names) // 2) + 0.8), layout="constrained")
    figure.suptitle(title, fontsize=11)
    axes = figure.subplots(-(-len(names) // 2), 2).ravel()
    sources = list(dict.fromkeys(source for record in figures.values() for source in record))
    place = np.arange(len(figures))
    width = 0.8 / len(sources)
    for axis, name in zip(axes, names, strict=True):
        label, factor = KEY_FIGURE_LABELS[name]
        for index, source in enumerate(sources):
            values = [_number(getattr(record.get(source), name, None)) * factor for record in figures.values()]
            colour = GREY if source == "simulated" else (BLUE, ORANGE, GREEN, PURPLE)[index % 4]
            bars = axis.bar(place + (index - (len(sources) - 1) / 2) * width, values, width, color=colour, label=source)
            bounds = ["≥" if name in getattr(record.get(source), "at_least", ()) else "" for record in figures.values()]
            axis.bar_label(bars, bounds, fontsize=8)
        axis.set_ylabel(label)
        axis.set_xticks(place, list(figures), rotation=25, ha="right", fontsize=8)
        axis.grid(alpha=0.3, axis="y")
    # Below the panels: within one, a legend hides the bars of some record.
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(sources), fontsize=8)
    return figure


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def field(events: Events, agreements: Sequence[Agreement]) -> Figure:
    """Computed over measured pressures and relative errors of each model (as Figs. 12 and 15)."""
    mark = f"{SYNTHETIC} data, generated, not measured" if events.synthetic else "measured events"
    given = "synthetic" if events.synthetic else "measured"
    figure = Figure(figsize=(12, 5.2), layout="constrained")
    figure.suptitle(f"Peak impact pressure, {len(events)} events: {mark}", fontsize=11)
    own, all_models, errors = figure.subplots(1, 3)
    measured = events.peak_pressure / 1e3
    top = 1.05 * measured.max()
    for colour, one in zip(
        (BLUE, ORANGE, GREEN, PURPLE, YELLOW, SKY, GREY, "black", "brown"), agreements, strict=False
    ):
        computed = one.pressure / 1e3
        for axis in (own, all_models) if one is agreements[0] else (all_models,):
            axis.plot([0, top], [0, one.slope * top], color=colour, linewidth=0.9)
            label = f"{one.model.title}: slope {one.slope:.2f}" if axis is all_models else None
            axis.plot(
                measured,
                computed,
                ".",
                color=colour,
                markersize=4,
                label=label,
                zorder=3 if one is agreements[0] else 2,
            )
        errors.plot(
            measured, 100 * one.relative_error, ".", color=colour, markersize=4, zorder=3 if one is agreements[0] else 2
        )
    own.set_title(f"{agreements[0].model.title}: slope {agreements[0].slope:.2f}", fontsize=9)
    for axis in (own, all_models):
        label = f"computed = {given}" if axis is all_models else None
        axis.plot([0, top], [0, top], color="black", linewidth=0.9, linestyle="--", label=label)
        axis.set_ylim(bottom=0)
        axis.set_ylabel("computed pressure [kPa]")
    errors.axhline(0, color="black", linewidth=0.9, linestyle="--")
    errors.set_ylabel(f"(computed - {given}) / computed [%]")
    for axis in (own, all_models, errors):
        axis.set_xlim(0, top)
        axis.set_xlabel(f"{given} pressure [kPa]")
        if events.synthetic:
            _watermark(axis)
    figure.legend(loc="outside lower center", ncols=4, fontsize=8, markerscale=2)
    return figure


def _watermark(axis: Axes) -> None:
    axis.text(
        0.5, 0.5, SYNTHETIC, transform=axis.transAxes, fontsize=30, color=GREY, alpha=0.25, ha="center", va="center",
        rotation=30, zorder=0,
    )  # fmt: skip


def sweep(runs: Sequence[Run], predictions: Mapping[str, Sequence[Impact]]) -> Figure:
    """Closed-form over simulated peak force and final displacement of each run, one colour for each rule."""
    figure = Figure(figsize=(10, 4.8), layout="constrained")
    force, moved = figure.subplots(1, 2)
    small = np.array([0.0 if run.fixed else SMALL_DISPLACEMENT * run.flow_height for run in runs])
    slides = ~np.array([run.fixed for run in runs])
    simulated = np.array([run.peak_force for run in runs]) / 1e3
    slid = np.array([run.barrier_displacement_final for run in runs])[slides] + small[slides]
    for colour, (name, impacts) in zip((SKY, ORANGE, GREEN), predictions.items(), strict=False):
        found = np.array([impact.peak_force for impact in impacts]) / 1e3
        force.loglog(simulated, found, "o", color=colour, markersize=3.5, label=name)
        found = np.array([impact.barrier_displacement_final for impact in impacts])[slides] + small[slides]
        moved.loglog(slid, found, "o", color=colour, markersize=3.5, label=name)
    for axis, values, what in ((force, simulated, "peak force [kN/m]"), (moved, slid, "displacement + 0.05 h [m]")):
        ends = np.array([0.7 * values.min(), 1.4 * values.max()])
        axis.plot(ends, ends, color="black", linewidth=0.9)
        for factor in (0.5, 2):
            axis.plot(ends, factor * ends, color="black", linewidth=0.7, linestyle=":")
        axis.set_xlabel(f"simulated {what}")
        axis.set_ylabel(f"closed-form {what}")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8, title="dotted: factor of two", title_fontsize=8)
    return figure


def design_chart(
    mass_ratio: Array, speed: Array, moved: Array, limit: float, point: tuple[float, float], title: str
) -> Figure:
    """Contours of the final displacement over mass ratio and speed, the limit and the chosen barrier marked."""
    figure = Figure(figsize=(7.5, 5.2), layout="constrained")
    axis = figure.subplots()
    axis.set_title(title, fontsize=11)
    levels = [0, 0.05, 0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50]
    shades = axis.contourf(
        mass_ratio,
        speed,
        moved,
        levels=levels,
        cmap="YlOrRd",
        norm=BoundaryNorm(levels, 256, extend="max"),
        extend="max",
    )
    figure.colorbar(shades, ax=axis, label="final displacement [m]", ticks=levels)
    lines = axis.contour(mass_ratio, speed, moved, levels=levels[1:], colors="black", linewidths=0.5)
    # Each label on its line, away from the frame and from its neighbours'; the limit has its own in the legend.
    labels: list[tuple[float, float]] = []
    for index, (level, path) in enumerate(zip(levels[1:], lines.get_paths(), strict=True)):
        points = np.asarray(path.vertices)
        if len(points) > 0 and level != limit:
            x, y = points[round((0.35 if index % 2 else 0.65) * (len(points) - 1))]
            labels.append((float(x), float(y)))
    axis.clabel(lines, fmt=lambda value: f"{value:g} m", fontsize=8, manual=labels)
    if limit > 0:
        axis.contour(mass_ratio, speed, moved, levels=[limit], colors=BLUE, linewidths=2.2)
        axis.plot([], [], color=BLUE, linewidth=2.2, label=f"limit, {limit:g} m")
    axis.plot(*point, "o", color=BLUE, markeredgecolor="white", markersize=9, label="lightest barrier")
    axis.set_xlabel("mass ratio $m_2 / m_1$ [-]")
    axis.set_ylabel("flow velocity $v_{1,0}$ [m/s]")
    axis.legend(fontsize=9, loc="lower right")
    return figure


def reliability(found: Reliability, limit: float, title: str) -> Figure:
    """What share of each input the displacement's variance has, and the displacement's quantiles."""
    figure = Figure(figsize=(9.5, 3.8), layout="constrained")
    figure.suptitle(title, fontsize=11)
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.2])
    left.plot(found.curve[1], found.curve[0], color=BLUE)
    left.axvline(limit, color=ORANGE, label=f"limit, {limit:g} m")
    left.plot([limit], [1 - found.probability], "s", color=ORANGE, label=f"P(beyond) = {found.probability:.3g}")
    left.set_xlabel("final displacement [m]")
    left.set_ylabel("probability of staying below [-]")
    left.set_ylim(0, 1)
    left.legend(fontsize=8, loc="lower right")
    left.grid(alpha=0.3)
    names = list(found.sensitivity)[::-1]
    place = np.arange(len(names))
    right.barh(place, [found.sensitivity[name].total for name in names], color=SKY, label="total index")
    right.barh(place, [found.sensitivity[name].first for name in names], height=0.4, color=BLUE, label="first order")
    right.set_yticks(place, [name.replace("_", " ") for name in names])
    right.set_xlabel("share of the displacement's variance [-]")
    right.legend(fontsize=8, loc="lower right")
    right.grid(alpha=0.3, axis="x")
    return figure
