"""The figure of a cross-check: force, velocity and displacement of the simulation and of the units."""

from __future__ import annotations

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analytic.force_record import FILTER_WINDOW, moving_mean
from analytic.plots import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY

from .cross_check import Array, CrossCheck, Trajectory

_STYLES = {
    "paper": (ORANGE, "--", "unit, the paper's λ"),
    "variant calibrated": (PURPLE, (0, (4, 1, 1, 1, 1, 1)), "unit, the variant calibrated"),
    "calibrated": (BLUE, "-", "unit, calibrated on this run"),
    "with vertical load": (GREEN, "-.", "unit, calibrated, with the flow's weight"),
    "simulated force": (SKY, ":", "unit, driven by the simulated force"),
}


def cross_check_figure(check: CrossCheck) -> Figure:
    """F(t), v2(t) and Δx(t) under one another; F alone for a fixed barrier."""
    panels = [("force", "F [kN/m]", 1e-3)]
    if not check.scene.fixed:
        panels += [("barrier_velocity", "v₂ [m/s]", 1.0), ("barrier_displacement", "Δx [m]", 1.0)]
    figure = Figure(figsize=(8, 2.7 * len(panels) + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    figure.suptitle(check.title)
    for axis, (name, label, factor) in zip(axes, panels, strict=True):
        axis.plot(
            check.simulated.time, factor * _shown(check.simulated, name), color=GREY, linewidth=2.5, label="simulation"
        )
        for comparison in check.comparisons:
            color, line, text = _STYLES[comparison.name]
            if name == "force" and comparison.name in ("simulated force", "with vertical load"):
                continue  # the simulation's own, and the calibrated one
            values = getattr(comparison.trajectory, name)
            axis.plot(comparison.trajectory.time, factor * values, color=color, linestyle=line, label=text)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
        axis.set_ylim(bottom=min(0.0, axis.get_ylim()[0]))
    handles = {label: line for axis in axes for line, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(check.simulated.time[0], check.simulated.time[-1])
    return figure


def _shown(trajectory: Trajectory, name: str) -> Array:
    values = getattr(trajectory, name)
    return moving_mean(trajectory.time, values, FILTER_WINDOW) if name == "force" else values
