"""Curves of a run against time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from analytic.force_record import FILTER_WINDOW, moving_mean
from warp_mpm.plotting.style import BLUE, GREEN, GREY, ORANGE, PURPLE, RUN_COLOURS, grid, heading
from warp_mpm.results import Results, ResultsError
from warp_mpm.scenario import Fixed

GOING = {"sliding": "sliding", "prescribed": "driven"}
"""What a barrier of each kind of motion does where it has not come to rest."""

NARROW_LEGEND = {"columnspacing": 1.2, "handlelength": 1.5, "handletextpad": 0.5}


def force_and_displacement(results: Results) -> Figure:
    """Forces, barrier displacement and kinetic energies against time (as the paper's Fig. 7).

    Raises:
        ResultsError: the scene has no barrier, or the time series cannot be read.
    """
    series, scenario = results.time_series, results.scenario
    if "impact_force_x" not in series or scenario.barrier is None:
        raise ResultsError(_no_force(results))
    time = series["time"]
    moves = not isinstance(scenario.barrier.motion, Fixed) and "barrier_displacement" in series
    energies = "flow_kinetic_energy" in series
    rows = 1 + moves + energies
    figure = Figure(figsize=(7.5, 2.5 + 2.0 * rows), layout="constrained")
    axes = figure.subplots(rows, 1, sharex=True, height_ratios=[2.0] + [1.0] * (rows - 1), squeeze=False).ravel()
    heading(figure, scenario.title)

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
    late = time[peak] > 0.5 * (time[0] + time[-1])
    forces.annotate(
        f"{filtered[peak]:.0f} kN/m at {time[peak]:.2f} s",
        (time[peak], filtered[peak]),
        xytext=(-8 if late else 8, 2),
        textcoords="offset points",
        ha="right" if late else "left",
        fontsize=9,
    )
    forces.set_ylabel(f"force [kN/m],\nmean over {FILTER_WINDOW:g} s")
    forces.axhline(0.0, color=GREY, linewidth=0.6)
    # Above the panel: within it, no corner is free of curves in every run.
    forces.legend(fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, frameon=False, **NARROW_LEGEND)

    if moves:
        moved = axes[1]
        displacement = series["barrier_displacement"]
        moved.plot(time, displacement, color=BLUE)
        moved.set_ylabel("barrier\ndisplacement [m]")
        at_rest = series.get("barrier_velocity", np.zeros(1))[-1] == 0.0
        going = "" if at_rest else f", still {GOING[scenario.barrier.motion.kind]}"
        moved.margins(y=0.25)
        moved.annotate(
            f"{displacement[-1]:.2f} m{going}",
            (time[-1], displacement.max()),  # not on the curve, wherever it goes
            xytext=(-4, 3),
            textcoords="offset points",
            ha="right",
            va="bottom",
            fontsize=9,
        )
    if energies:
        energy = axes[-1]
        energy.plot(time, series["flow_kinetic_energy"] / 1e3, color=BLUE, label="flow")
        if moves and "barrier_kinetic_energy" in series:
            energy.plot(time, series["barrier_kinetic_energy"] / 1e3, color=ORANGE, linestyle="--", label="barrier")
        energy.set_ylabel("kinetic\nenergy [kJ/m]")
        energy.legend(fontsize=9)
        energy.set_ylim(bottom=0.0)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(float(time[0]), float(time[-1]))
    for panel in axes:
        grid(panel)
    return figure


def _no_force(results: Results) -> str:
    why = "has no barrier" if results.scenario.barrier is None else "does not record impact_force_x (output.quantities)"
    return f"{results.path} {why}, so there is no impact force to draw."


COMPARED = (
    ("impact_force_x", "impact, horizontal\n$F_{2,x}$ [kN/m]", 1e-3),
    ("impact_force_y", "impact, vertical\n$F_{2,y}$ [kN/m]", 1e-3),
    ("top_force", "friction on the crest\n$F_3$ [kN/m]", 1e-3),
    ("base_force", "friction at the base\n$F_4$ [kN/m]", 1e-3),
    ("barrier_displacement", "barrier displacement\n$\\Delta x$ [m]", 1.0),
    ("flow_kinetic_energy", "kinetic energy of the flow\n[kJ/m]", 1e-3),
)
"""Column, label and factor of each panel of `comparison`."""

ALWAYS_COMPARED = ("impact_force_x", "flow_kinetic_energy")
"""Columns whose panel is there even where they are nil in all runs."""


def comparison(runs: Sequence[Results]) -> Figure:
    """Forces, barrier displacements and kinetic energies of several runs in the same panels (the paper's Fig. 7).

    Raises:
        ResultsError: none of the runs has a barrier, or a time series cannot be read.
    """
    series = [results.time_series for results in runs]
    if not any("impact_force_x" in one for one in series):
        raise ResultsError(_no_force(runs[0]))
    shown = [
        row
        for row in COMPARED
        if row[0] in ALWAYS_COMPARED or any(np.any(columns.get(row[0], 0.0)) for columns in series)
    ]
    rows = math.ceil(len(shown) / 2)
    figure = Figure(figsize=(10.0, 2.7 * rows + 0.9), layout="constrained")
    axes = figure.subplots(rows, 2, sharex=True).ravel()
    for panel in axes[len(shown) :]:
        panel.remove()
    axes = axes[: len(shown)]
    for number, (results, columns) in enumerate(zip(runs, series, strict=True)):
        colour = RUN_COLOURS[number % len(RUN_COLOURS)]
        time = columns["time"]
        for panel, (name, _, factor) in zip(axes, shown, strict=True):
            if name not in columns:
                continue
            values = columns[name] if name not in FORCE_COLUMNS else moving_mean(time, columns[name])
            label = results.scenario.title if panel is axes[0] else None
            panel.plot(time, values * factor, color=colour, linewidth=1.2, label=label)
        if np.any(columns.get("barrier_kinetic_energy", 0.0)):
            axes[-1].plot(time, columns["barrier_kinetic_energy"] / 1e3, color=colour, linewidth=1.2, linestyle="--")
            axes[-1].set_title("flow (solid), barrier (dashed)", fontsize=9)
    for panel, (_, label, _) in zip(axes, shown, strict=True):
        panel.set_ylabel(label)
        panel.axhline(0.0, color=GREY, linewidth=0.6)
        grid(panel)
    for panel in axes[-2:]:
        panel.set_xlabel("time [s]")
        panel.tick_params(labelbottom=True)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8, title=f"forces are means over {FILTER_WINDOW:g} s")
    return figure


FORCE_COLUMNS = ("impact_force_x", "impact_force_y", "top_force", "base_force")
"""Columns that are drawn as moving means."""
