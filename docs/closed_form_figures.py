"""Draws the figures of closed_form.md and empirical.md that need no simulation: python docs/closed_form_figures.py."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from analytic import plots
from analytic.arrays import trajectory
from analytic.empirical import select
from analytic.field_data import agreement, read_events
from analytic.scene import Scene

DOCS = Path(__file__).parent
FIGURES = DOCS / "figures"
FIG_9 = Scene(
    flow_mass=81000.0, flow_length=15.0, flow_height=3.0, speed=10.0, barrier_mass=81000.0, base_friction=0.29
)


def fig_9() -> Figure:
    """Force and kinetic energies of the paper's Fig. 9 example, corrected."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    time = np.linspace(0, 3.2, 1500)
    for column, geometry_change in enumerate((0.41, 0.72)):
        force, energy = axes[0, column], axes[1, column]
        for colour, rise_ratio in ((plots.BLUE, 0.2), (plots.ORANGE, 0.35), (plots.GREEN, 0.5)):
            at = trajectory(FIG_9.impact(geometry_change=geometry_change, rise_ratio=rise_ratio), time)
            force.plot(time, at.force / 1e3, color=colour, label=f"τ = {rise_ratio}")
            energy.plot(time, at.flow_kinetic_energy / 1e3, color=colour)
            energy.plot(time, 10 * at.barrier_kinetic_energy / 1e3, color=colour, linestyle="--")
        force.axhline(FIG_9.impact().friction / 1e3, color=plots.GREY, linestyle=":", label="friction R")
        force.set_title(f"λ = {geometry_change}", fontsize=10)
        force.legend(fontsize=8)
        energy.set_xlabel("time [s]")
    axes[0, 0].set_ylabel("impact force [kN/m]")
    axes[1, 0].set_ylabel("kinetic energy [kJ/m]\nflow (solid), 10 × barrier (dashed)")
    for axis in axes.ravel():
        axis.grid(alpha=0.3)
    return figure


def variants() -> Figure:
    """The three variants side by side, and the one fitted to simulations."""
    from analytic.fitted import calibrated_impact

    curves = {name: FIG_9.impact(variant=name) for name in ("stick_slip", "momentum_closed")}
    curves["as_printed (force as stick_slip)"] = FIG_9.impact(variant="as_printed")
    curves["calibrated, β = 60°"] = calibrated_impact(replace(FIG_9, face_angle=60.0))
    return plots.impacts(curves, "m1 = m2 = 81 000 kg/m, L = 15 m, h = 3 m, 10 m/s, λ = 0.41, τ = 0.35")


def field() -> Figure:
    """Figs. 12 and 15 on the synthetic set."""
    events = read_events(DOCS / "data" / "synthetic_events.csv")
    return plots.field(events, [agreement(model, events) for model in select()])


if __name__ == "__main__":
    for name, figure in (("fig_9", fig_9()), ("variants", variants()), ("fig_12_15_synthetic", field())):
        plots.save(figure, FIGURES / f"{name}.png")
