"""Curves of a run against time."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analytic.force_record import FILTER_WINDOW, moving_mean
from warp_mpm.plotting.style import BLUE, GREEN, GREY, ORANGE, PURPLE, RUN_COLOURS, grid, heading, named, symbol
from warp_mpm.quantities import Quantity, Sampled
from warp_mpm.quantities.time_series import NAMED, columns_of_further, further_quantities
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
    further, own = of_further_barriers([results]), own_quantities([results])
    rows = 1 + moves + energies + len(further) + len(own)
    figure = Figure(figsize=(7.5, 2.5 + 2.0 * rows), layout="constrained")
    axes = figure.subplots(rows, 1, sharex=True, height_ratios=[2.0] + [1.0] * (rows - 1), squeeze=False).ravel()
    heading(figure, scenario.title)

    forces = axes[0]
    force = NAMED["impact_force_x"]
    raw = series[force.name] * force.factor
    filtered = moving_mean(time, raw)
    forces.plot(time, raw, color=BLUE, alpha=0.3, linewidth=0.7)
    forces.plot(time, filtered, color=BLUE, label=named(force))
    lines = (("impact_force_y", ORANGE, "-"), ("top_force", GREEN, "-"), ("base_force", PURPLE, "--"))
    for name, colour, style in lines:
        if name in series and np.any(series[name]):
            values = moving_mean(time, series[name]) * NAMED[name].factor
            forces.plot(time, values, color=colour, linestyle=style, label=named(NAMED[name]))
    peak = int(np.argmax(filtered))
    forces.plot(time[peak], filtered[peak], "o", color=BLUE, markersize=4)
    late = time[peak] > 0.5 * (time[0] + time[-1])
    forces.annotate(
        f"{filtered[peak]:.0f} {force.shown_unit} at {time[peak]:.2f} s",
        (time[peak], filtered[peak]),
        xytext=(-8 if late else 8, 2),
        textcoords="offset points",
        ha="right" if late else "left",
        fontsize=9,
    )
    forces.set_ylabel(f"force [{force.shown_unit}],\nmean over {FILTER_WINDOW:g} s")
    forces.axhline(0.0, color=GREY, linewidth=0.6)
    # Above the panel: within it, no corner is free of curves in every run.
    forces.legend(fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False, **NARROW_LEGEND)

    if moves:
        moved = axes[1]
        displacement = series["barrier_displacement"] * NAMED["barrier_displacement"].factor
        moved.plot(time, displacement, color=BLUE)
        moved.set_ylabel(f"barrier\ndisplacement [{NAMED['barrier_displacement'].shown_unit}]")
        at_rest = series.get("barrier_velocity", np.zeros(1))[-1] == 0.0
        going = "" if at_rest else f", still {GOING[scenario.barrier.motion.kind]}"
        moved.margins(y=0.25)
        moved.annotate(
            f"{displacement[-1]:.2f} {NAMED['barrier_displacement'].shown_unit}{going}",
            (time[-1], displacement.max()),  # not on the curve, wherever it goes
            xytext=(-4, 3),
            textcoords="offset points",
            ha="right",
            va="bottom",
            fontsize=9,
        )
    if energies:
        energy, unit = axes[1 + moves], NAMED["flow_kinetic_energy"]
        energy.plot(time, series["flow_kinetic_energy"] * unit.factor, color=BLUE, label="flow")
        if moves and "barrier_kinetic_energy" in series:
            kinetic = series["barrier_kinetic_energy"] * unit.factor
            energy.plot(time, kinetic, color=ORANGE, linestyle="--", label="barrier")
        energy.set_ylabel(f"kinetic\nenergy [{unit.shown_unit}]")
        energy.legend(fontsize=9)
        energy.set_ylim(bottom=0.0)
    more = axes[1 + moves + energies :]
    for panel, (words, columns) in zip(more, further.items(), strict=False):
        for number, (name, quantity) in enumerate(columns.items()):
            colour = RUN_COLOURS[number % len(RUN_COLOURS)]
            panel.plot(time, _curve(series, quantity), color=colour, label=name)
            panel.set_ylabel(f"{words} [{quantity.shown_unit}]")
        panel.legend(fontsize=9)
    for panel, quantity in zip(more[len(further) :], own, strict=True):
        panel.plot(time, _curve(series, quantity), color=BLUE)
        panel.set_ylabel(_axis(quantity))
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(float(time[0]), float(time[-1]))
    for panel in axes:
        grid(panel)
    return figure


def _no_force(results: Results) -> str:
    why = "has no barrier" if results.scenario.barrier is None else "does not record impact_force_x (output.quantities)"
    return f"{results.path} {why}, so there is no impact force to draw."


COMPARED = (
    *("impact_force_x", "impact_force_y", "top_force", "base_force", "barrier_displacement", "flow_kinetic_energy"),
)
"""Columns with a panel of their own in `comparison`; what a script records comes after them."""

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
        quantity
        for quantity in (
            *(NAMED[name] for name in COMPARED),
            *(quantity for columns in of_further_barriers(runs).values() for quantity in columns.values()),
            *own_quantities(runs),
        )
        if quantity.name in ALWAYS_COMPARED or any(np.any(columns.get(quantity.name, 0.0)) for columns in series)
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
        for panel, quantity in zip(axes, shown, strict=True):
            if quantity.name not in columns:
                continue
            label = results.scenario.title if panel is axes[0] else None
            panel.plot(time, _curve(columns, quantity), color=colour, linewidth=1.2, label=label)
            if quantity.name == "flow_kinetic_energy" and np.any(columns.get("barrier_kinetic_energy", 0.0)):
                kinetic = _curve(columns, NAMED["barrier_kinetic_energy"])
                panel.plot(time, kinetic, color=colour, linewidth=1.2, linestyle="--")
                panel.set_title("flow (solid), barrier (dashed)", fontsize=9)
    for panel, quantity in zip(axes, shown, strict=True):
        panel.set_ylabel(_axis(quantity))
        panel.axhline(0.0, color=GREY, linewidth=0.6)
        grid(panel)
    for panel in axes[-2:]:
        panel.set_xlabel("time [s]")
        panel.tick_params(labelbottom=True)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8, title=f"forces are means over {FILTER_WINDOW:g} s")
    return figure


FURTHER = {"force_x": "force on\nfurther barriers", "barrier_displacement": "displacement of\nfurther barriers"}
"""Panels of all further barriers, by the end of the columns drawn; the rest that is told of each would fill pages."""


def of_further_barriers(runs: Sequence[Results]) -> dict[str, dict[str, Quantity]]:
    """Columns that are drawn of the further barriers of any of the runs, by panel and name of the barrier."""
    found: dict[str, dict[str, Quantity]] = {}
    for results in runs:
        known = further_quantities(results.scenario)
        for one in results.scenario.barriers:
            for end, words in FURTHER.items():
                column = f"{one.name}_{end}"
                if column in known and column in results.time_series:
                    found.setdefault(words, {})[one.name] = known[column]
    return found


def own_quantities(runs: Sequence[Results]) -> list[Quantity]:
    """What scripts recorded in any of the runs, beside the columns of the package."""
    found: dict[str, Quantity] = {}
    for results in runs:
        known = {*NAMED, *(column for one in results.scenario.barriers for column in columns_of_further(one.name))}
        found |= {name: one for name, one in results.quantities.items() if name not in known}
    return list(found.values())


def _curve(series: Mapping[str, Any], quantity: Quantity) -> Any:
    """A column in the unit in which it is shown; of forces the moving mean."""
    values = series[quantity.name] * quantity.factor
    return moving_mean(series["time"], values) if isinstance(quantity, Sampled) and quantity.mean else values


def _axis(quantity: Quantity) -> str:
    """Label of a panel's axis, in two or three lines."""
    lines = textwrap.wrap(quantity.words, 26)
    return "\n".join([*lines, " ".join(part for part in (symbol(quantity), f"[{quantity.shown_unit}]") if part)])
