"""The simulator against itself: spacing, points per cell and time step; and how smooth its pressures are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from warp_mpm.accuracy.errors import extrapolate
from warp_mpm.fields import field_named
from warp_mpm.plotting.points import draw_points, draw_surroundings
from warp_mpm.results import Snapshot
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.summary import impact_figures
from warp_mpm.validation.case import Array, Case, Check, Curve, Outcome, Panel, Table, at_most, reference, reported
from warp_mpm.validation.paper_runs import force_history, paper_scene

SHIPPED = 0.2
"""Spacing of the shipped scenes [m]."""

SPACINGS = (0.4, 0.3, 0.2, 0.15, 0.1, 0.075)
QUICK_SPACINGS = (0.6, 0.4, 0.3, 0.2)

FIGURES: Mapping[str, tuple[str, str, float]] = {
    "peak_force_filtered": ("peak force, mean over 0.05 s", "kN/m", 1e-3),
    "peak_force": ("peak force, mean over 0.005 s", "kN/m", 1e-3),
    "impulse": ("impulse over the run", "kN s/m", 1e-3),
    "barrier_displacement_final": ("final displacement Δx_f", "m", 1.0),
    "pore_pressure_1s": ("p_L,max at t = 1 s", "kPa", 1e-3),
    "pore_pressure_max": ("p_L,max of the first second of impact", "kPa", 1e-3),
}
"""Quantities of the study: label, unit, factor from SI."""


def key_figures(scenario: Scenario) -> dict[str, float]:
    """`FIGURES` of one run [SI]."""
    series, _ = force_history(scenario, 0.005)
    time = series["time"]
    figures = {name: float(value or 0.0) for name, value in impact_figures(time, series["impact_force_x"]).items()}
    about = np.abs(time - 1.0) <= 0.05
    first = time <= figures["impact_start_time"] + 1.0
    return {
        **{name: figures[name] for name in ("peak_force_filtered", "peak_force", "impulse")},
        "barrier_displacement_final": float(series["barrier_displacement"][-1]),
        "pore_pressure_1s": float(series["pore_pressure_max"][about].mean()),
        "pore_pressure_max": float(series["pore_pressure_max"][first].max()),
    }


def refinement(quick: bool) -> Outcome:
    spacings = QUICK_SPACINGS if quick else SPACINGS
    scenes = {"case_1": "case 1"} if quick else {"case_1": "case 1", "set_iib": "Set IIb"}
    checks: list[Check] = []
    panels: list[Panel] = []
    tables: list[Table] = []
    for name, title in scenes.items():
        found = [key_figures(paper_scene(name, spacing)) for spacing in spacings]
        rows = []
        for figure, (label, unit, factor) in FIGURES.items():
            values = [factor * run[figure] for run in found]
            leads = extrapolate(spacings, values)
            shipped = values[spacings.index(SHIPPED)]
            order = "none seen" if leads.order is None else f"{leads.order:.1f}"
            rows.append(
                (
                    f"{label} [{unit}]",
                    *(f"{value:.4g}" for value in values),
                    order,
                    f"{leads.value:.4g} ± {leads.uncertainty:.2g}",
                )
            )
            checks.append(
                reported(
                    f"{title}, {label}, at {SHIPPED:g} m",
                    unit,
                    shipped,
                    reference=leads.value,
                    remark="the error is that of the shipped scene against the extrapolated value",
                )
            )
            if figure in ("peak_force_filtered", "barrier_displacement_final", "impulse", "pore_pressure_1s"):
                panels.append(
                    Panel(
                        f"{title}: {label}",
                        "spacing [m]",
                        unit,
                        [
                            Curve(spacings, values, "ours", "o-"),
                            reference([0.0, spacings[0]], [leads.value] * 2, "extrapolated"),
                        ],
                    )
                )
        columns = ("", *(f"{spacing:g} m" for spacing in spacings), "order", "extrapolated")
        tables.append(Table(f"{title} against spacing", columns, rows))
        tables.append(_turned(name, title, quick))
    remark = (
        "Each ladder changes the spacing alone; order and extrapolated value are a least-squares fit of f_0 + a d^p, "
        "with its uncertainty. Where no order between 0.5 and 2 is seen, the finest run stands for the answer. "
        "`python -m warp_mpm accuracy` does the same for any scene, with every setting of the numerics."
    )
    return Outcome(checks=checks, panels=panels, tables=tables, remarks=[remark])


def _turned(name: str, title: str, quick: bool) -> Table:
    """Points per cell and time step alone."""
    spacing = 0.4 if quick else SHIPPED
    changes: list[tuple[str, dict[str, Any]]] = [("as shipped", {})]
    changes += [(f"{count} points per cell", {"numerics__points_per_cell": count}) for count in (1, 9, 16)]
    changes += [(f"Courant number {number:g}", {"numerics__courant_number": number}) for number in (0.5, 0.25)]
    base: dict[str, float] = {}
    rows = []
    for label, change in changes:
        found = key_figures(paper_scene(name, spacing, **change))
        base = base or found
        rows.append(
            (
                label,
                *(
                    f"{factor * found[figure]:.4g} ({100 * (found[figure] / base[figure] - 1):+.1f} %)"
                    for figure, (_, _, factor) in FIGURES.items()
                ),
            )
        )
    columns = ("", *(f"{label} [{unit}]" for label, unit, _ in FIGURES.values()))
    return Table(f"{title} at {spacing:g} m: points per cell and time step", columns, rows)


# -- how smooth the pressures are --------------------------------------------------------------------------------


def pressure_residual(position: Array, pressure: Array, volume: Array, spacing: float) -> Array:
    """Point pressures [N] less their smooth grid projection: means at the corners of the cells, weighted with volume
    and bilinear hats, interpolated back."""
    cell = np.floor(position / spacing).astype(np.int64)
    share = position / spacing - cell
    cell -= cell.min(axis=0)
    shape = tuple(cell.max(axis=0) + 2)
    corners = [
        (a, b, (share[:, 0] if a else 1.0 - share[:, 0]) * (share[:, 1] if b else 1.0 - share[:, 1]))
        for a in (0, 1)
        for b in (0, 1)
    ]
    sums, weights = np.zeros(shape), np.zeros(shape)
    for a, b, hat in corners:
        at = cell[:, 0] + a, cell[:, 1] + b
        np.add.at(sums, at, hat * volume * pressure)
        np.add.at(weights, at, hat * volume)
    means = sums / np.maximum(weights, 1e-300)
    smooth = np.zeros(len(pressure))
    for a, b, hat in corners:
        smooth += hat * means[cell[:, 0] + a, cell[:, 1] + b]
    return pressure - smooth


def pressure_quality(quick: bool) -> Outcome:
    spacings = (0.2,) if quick else (0.4, 0.2, 0.1)
    times = np.arange(0.30, 2.51, 0.05)
    checks: list[Check] = []
    curves = []
    pictures: dict[str, Figure] = {}
    for spacing in spacings:
        simulation = Simulation(paper_scene("case_1", spacing))
        unit = simulation.scenario.flow.material.density * simulation.scenario.flow.speed**2
        rms = []
        for time in times:
            simulation.advance(float(time))
            points = simulation.points()
            place = points["position"] - [simulation.barrier_displacement, 0.0]
            residual = pressure_residual(place, points["pore_pressure"], points["volume"], spacing)
            rms.append(float(np.sqrt((residual**2).mean())) / unit)
            if spacing == SHIPPED and abs(time - 1.0) < 1e-9:
                pictures["field"] = _field(simulation, points)
        whole = float(np.sqrt(np.mean(np.square(rms))))
        if spacing == SHIPPED:
            checks += [
                at_most(
                    "rms of the residual over all points, t = 0.3 … 2.5 s, 0.2 m",
                    "of ρ_m v²",
                    whole,
                    0.03,
                    percent=True,
                ),
                reported(
                    "the same at the worst moment",
                    "of ρ_m v²",
                    max(rms),
                    remark=f"at t = {times[int(np.argmax(rms))]:.2f} s: the toe has just touched, and the whole "
                    "load lies on two or three cells, which no projection on them resolves",
                ),
            ]
        else:
            checks.append(reported(f"rms of the residual, {spacing:g} m", "of ρ_m v²", whole, remark="for comparison"))
        curves.append(Curve(times, 100.0 * np.array(rms), f"{spacing:g} m"))
    limit = reference([times[0], times[-1]], [3.0, 3.0], "limit")
    panel = Panel("residual of the point pressures", "time [s]", "rms / (ρ_m v²) [%]", [limit, *curves])
    return Outcome(checks=checks, panels=[panel], pictures=pictures)


def _field(simulation: Simulation, points: dict[str, Array]) -> Figure:
    """The material points coloured by their own pressures, nothing smoothed."""
    fields = {name: values for name, values in points.items() if name != "position"}
    frame = Snapshot(simulation.time, simulation.barrier_displacement, points["position"], fields)
    values = points["pore_pressure"] / 1e3
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    place = figure.subplots()
    drawn = draw_points(place, frame, values, field_named("pore_pressure"), (0.0, float(np.quantile(values, 0.999))))
    draw_surroundings(place, simulation.scenario, frame, (-13.0, 12.0, -0.5, 9.0))
    place.set(xlim=(-13.0, 12.0), ylim=(-0.5, 9.0), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    place.set_title(f"case 1 at t = {simulation.time:.2f} s: pressure of every material point", fontsize=10)
    figure.colorbar(drawn, ax=place, label="pore pressure [kPa]")
    return figure


CASES = (
    Case(
        name="pressure-quality",
        title="Smoothness of the pressure",
        tests="Case 1 of the paper at 0.2 m: how far the pressures of the material points lie from their smooth grid "
        "projection while the flow hits the barrier.",
        source="projection: corner means with bilinear hats",
        limit="root mean square 3 % of ρ_m v²",
        run=pressure_quality,
    ),
    Case(
        name="refinement",
        title="Refinement",
        tests="Case 1 and Set IIb at six spacings, with 1 to 16 points per cell and a quarter of the time step.",
        source="the runs' own limit as the spacing falls, by Richardson's extrapolation",
        limit="reported: observed order, extrapolated value, error of the shipped scenes",
        run=refinement,
        in_quick=False,
    ),
)
