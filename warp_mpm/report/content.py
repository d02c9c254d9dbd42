"""What the report says of a run, as plain data: figures, curves, ledger, effects, settings, versions, warnings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.arrays import trajectory
from analytic.calibration import RULES, Calibration, CalibrationError, calibrate, misfit
from analytic.force_record import FILTER_WINDOW, moving_mean
from analytic.scene import SceneError, scene_of
from warp_mpm.caveats import run_caveats, scene_caveats
from warp_mpm.description import described
from warp_mpm.effect_rules import effect_rules
from warp_mpm.quantities import Quantity, Sampled
from warp_mpm.quantities.figures import FIGURES
from warp_mpm.quantities.time_series import NAMED, OF_BARRIER, columns_of_further
from warp_mpm.results import Results
from warp_mpm.scenario import Scenario
from warp_mpm.scenario.site import all_standing
from warp_mpm.terminal import summary_rows

Array = NDArray[np.float64]

MOST_SAMPLES = 3000
"""Samples of a curve beyond which it is thinned; a line across a page shows no more."""

CHARTS: dict[str, tuple[str, ...]] = {
    "impact force on the face": ("impact_force_x", "impact_force_y"),
    "friction": ("top_force", "base_force"),
    "barrier velocity": ("barrier_velocity",),
    "barrier displacement": ("barrier_displacement",),
    "kinetic energy": ("flow_kinetic_energy", "barrier_kinetic_energy"),
    "other energies of the flow, and work": (
        *("flow_gravitational_energy", "flow_elastic_energy", "barrier_work", "base_friction_work"),
    ),
    "greatest pressure on a patch of the face": ("pressure_patch", "pore_pressure_patch"),
    "height of the impact force": ("impact_force_height",),
    "overturning moment": ("toe_moment", "heel_moment"),
    "greatest pore pressure in a cell, which may grow with each refinement": ("pore_pressure_max",),
}
"""Columns of each chart, of one unit; what a script records besides has a chart of its own."""

CLOSED_FORM = {
    "impact_force_x": "force",
    "barrier_velocity": "barrier_velocity",
    "barrier_displacement": "barrier_displacement",
    "flow_kinetic_energy": "flow_kinetic_energy",
    "barrier_kinetic_energy": "barrier_kinetic_energy",
}
"""Columns that the closed form predicts, and the names of its own."""


def run_content(results: Results, name: str) -> dict[str, Any]:
    """All that the page says of one run, its points apart.

    Raises:
        ResultsError: the run cannot be read.
    """
    scenario, series, record = results.scenario, results.time_series, results.record
    fits, no_fit = _closed_forms(results)
    return {
        "name": name,
        "title": scenario.title,
        "description": "; ".join(described(scenario)),
        "source": scenario.source,
        "status": record.get("status"),
        "end": float(series["time"][-1]),
        "peak_time": results.summary.get("peak_force_filtered_time"),
        "figures": summary_rows(results.summary),
        "charts": [
            chart
            for title, names in (CHARTS | own_charts(results)).items()
            if (chart := _chart(results, title, names, fits)) is not None
        ],
        "closed_form": [_fit_row(fit, series) for fit in fits],
        "ledger": ledger(series, results.summary),
        "effects": {rule.effect: f"{_text(rule.value)}: {rule.reason}" for rule in effect_rules(scenario)},
        "settings": {path: _text(value) for path, value in flattened(scenario.resolved())},
        "versions": _versions(record),
        "warnings": [*_unfinished(results), *scene_caveats(scenario), *run_caveats(record, results.summary), *no_fit],
        "notes": list(scenario.notes),
    } | setting(scenario)


def setting(scenario: Scenario) -> dict[str, Any]:
    """What stands around the flow, for the viewer: `ground`, `barriers` and `section`."""
    return {"ground": _ground(scenario), "barriers": _barriers(scenario), "section": _section(scenario)}


def flattened(content: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Paths and values of the leaves of nested groups, as `Scenario.replaced` names them."""
    leaves: list[tuple[str, Any]] = []
    for key, value in content.items():
        if isinstance(value, Mapping):
            leaves += flattened(value, f"{prefix}{key}.")
        else:
            leaves.append((prefix + key, value))
    return leaves


def ledger(series: Mapping[str, Array], summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The rows of `ledger_values` in words and units."""
    return [(words, one.text(value).removesuffix(" -")) for words, value, one in ledger_values(series, summary)]


def ledger_values(series: Mapping[str, Array], summary: Mapping[str, Any]) -> list[tuple[str, float, Quantity]]:
    """What was there, what came and went, and what is not accounted for: words, value in SI units, what it is."""
    rows: list[tuple[str, float, Quantity]] = []

    def row(label: str, value: float | None, quantity: Quantity) -> None:
        if value is not None:
            rows.append((label, value, quantity))

    def column(name: str, when: str = "", label: str = "") -> None:
        quantity = NAMED[name]
        label = label or " at the ".join(part for part in (quantity.words, when) if part)
        row(label, at(name, 0 if when == "start" else -1), quantity)

    def figure(name: str, more: str = "") -> None:
        row(FIGURES[name].words + more, summary.get(name), FIGURES[name])

    def at(name: str, index: int) -> float | None:
        return float(series[name][index]) if name in series else None

    def total(index: int) -> float | None:
        parts = ("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy")
        return sum(float(series[part][index]) for part in parts) if all(part in series for part in parts) else None

    energy = NAMED["flow_kinetic_energy"]
    column("solid_mass", "start")
    column("liquid_mass", "start")
    if "inflow_mass" in series:
        column("inflow_mass")
    column("left_mass")
    figure("mass_error", ", relative")
    column("momentum_x", "start")
    column("momentum_x", "end")
    if "inflow_momentum_x" in series:
        column("inflow_momentum_x")
    figure("impulse", " on the impacted face")
    figure("momentum_error", ", relative")
    first, last = total(0), total(-1)
    row("energy of the flow at the start", first, energy)
    row("energy of the flow at the end", last, energy)
    column("barrier_work")
    column("base_friction_work", label="  of it taken by base friction")
    column("seepage_work")
    if "inflow_energy" in series:
        column("inflow_energy")
    column("left_energy")
    if first is not None and last is not None:
        spent = first - last - (at("barrier_work", -1) or 0.0) - (at("left_energy", -1) or 0.0)
        spent += (at("seepage_work", -1) or 0.0) + (at("inflow_energy", -1) or 0.0)
        row("dissipated in the flow", spent, energy)
    figure("energy_error", ", relative")
    return rows


def _unfinished(results: Results) -> list[str]:
    record = results.record
    if record.get("status") == "finished":
        return []
    reason = f": {record['problem']}" if record.get("problem") else ""
    return [f"The run is {record.get('status')} at t = {results.summary.get('end_time', 0.0):.3f} s{reason}"]


def _closed_forms(results: Results) -> tuple[list[Calibration], list[str]]:
    """The closed form calibrated by each rule; or why there is none."""
    series = results.time_series
    if "impact_force_x" not in series:
        return [], []
    try:
        scene = scene_of(results.scenario, str(results.path))
        return [calibrate(series["time"], series["impact_force_x"], scene, rule=rule) for rule in RULES], []
    except (SceneError, CalibrationError, ValueError) as error:
        return [], [f"No closed form over the curves: {error}"]


def _fit_row(fit: Calibration, series: Mapping[str, Array]) -> dict[str, str]:
    distance = misfit(fit.impact, series, fit.measured)
    impact = fit.impact

    def percent(value: float | None) -> str:
        return "–" if value is None else f"{100 * value:.1f} %"

    force, displacement = FIGURES["peak_force"], FIGURES["barrier_displacement_final"]
    return {
        "rule": fit.rule.replace("_", " "),
        "λ": f"{fit.geometry_change:.3f}" + ("" if fit.within_range else " (out of range)"),
        "τ": f"{fit.rise_ratio:.3f}",
        "F_peak": force.text(impact.peak_force, ",.0f"),
        "T₁, T₂": f"{impact.peak_time - impact.arrival_time:.3f} s, {impact.duration:.3f} s",
        "Δx": displacement.text(impact.barrier_displacement_final, ".2f"),
        "misfit of F": percent(distance.force),
        "of Eₖ₁": percent(distance.flow_kinetic_energy),
        "of v₂": percent(distance.barrier_velocity),
        "of Δx": percent(distance.barrier_displacement),
    }


def own_charts(results: Results) -> dict[str, tuple[str, ...]]:
    """Charts of each further barrier, as of the first, and of what a script records, beside those of the package."""
    charts: dict[str, tuple[str, ...]] = {}
    known = set(NAMED)
    for one in results.scenario.barriers:
        known |= columns_of_further(one.name)
        charts[f"{one.name}: force on the whole barrier"] = (f"{one.name}_force_x", f"{one.name}_force_y")
        charts[f"{one.name}: work done on the barrier"] = (f"{one.name}_barrier_work",)
        charts[f"{one.name}: run-up on the face"] = (f"{one.name}_face_run_up",)
        for title, names in CHARTS.items():
            if names[0] in OF_BARRIER:
                charts[f"{one.name}: {title}"] = tuple(
                    f"{one.name}_{OF_BARRIER[name]}" for name in names if name in OF_BARRIER
                )
    return charts | {one.words: (name,) for name, one in results.quantities.items() if name not in known}


def _chart(results: Results, title: str, names: tuple[str, ...], fits: list[Calibration]) -> dict[str, Any] | None:
    series, lines = results.time_series, []
    time = series["time"]
    for number, name in enumerate(names):
        if name not in series or not np.any(series[name]):
            continue
        quantity = results.quantities[name]
        label, values = " ".join((quantity.words, quantity.symbol)).strip(), series[name] * quantity.factor
        if isinstance(quantity, Sampled) and quantity.mean:
            lines.append(_line(time, values, f"{label}, raw", number, "faint"))
            lines.append(
                _line(time, moving_mean(time, values), f"{label}, mean over {FILTER_WINDOW:g} s", number, "solid")
            )
        else:
            lines.append(_line(time, values, label, number, "solid"))
        for style, fit in zip(("dashed", "dotted"), fits, strict=False):
            if name in CLOSED_FORM:
                predicted = getattr(trajectory(fit.impact, time), CLOSED_FORM[name]) * quantity.factor
                rule = fit.rule.replace("_", " ")
                lines.append(_line(time, predicted, f"{label}: closed form, {rule}", number, style))
    return {"title": title, "unit": _unit(results, names), "lines": lines} if lines else None


def _unit(results: Results, names: tuple[str, ...]) -> str:
    """The one in which a chart's columns are shown."""
    (unit,) = {results.quantities[name].shown_unit for name in names if name in results.quantities}
    return unit


def _line(time: Array, values: Array, label: str, colour: int, style: str) -> dict[str, Any]:
    if len(time) > MOST_SAMPLES:
        # Of each bunch of samples the one farthest from nil, so that no peak is lost.
        bunch = -(-len(time) // MOST_SAMPLES)
        starts = np.arange(0, len(time), bunch)
        chosen = np.array([start + int(np.argmax(np.abs(values[start : start + bunch]))) for start in starts])
        time, values = time[chosen], values[chosen]
    return {
        "label": label,
        "colour": colour,
        "style": style,
        "t": [round(float(value), 6) for value in time],
        "v": [float(f"{value:.6g}") for value in values],
    }


def _ground(scenario: Scenario) -> list[list[float]] | None:
    """Points of the ground's surface, which goes on straight beyond them."""
    ground = scenario.ground
    return None if ground is None else ground.profile.tolist()


def _barriers(scenario: Scenario) -> list[dict[str, Any]]:
    """Outline of each barrier, from upstream to downstream; of a wall without end its foot."""
    ground, found = scenario.ground, []
    for name, x, _, standing in all_standing(scenario):
        if standing is None:
            foot = 0.0 if ground is None else float(ground.height(x))
            found.append({"name": name, "kind": "wall", "corners": [[x, foot]]})
        else:
            found.append({"name": name, "kind": "polygon", "corners": standing.tolist()})
    return found


def _section(scenario: Scenario) -> list[list[float]] | None:
    """Foot and top of the section of an inflow."""
    inflow = scenario.flow.inflow
    if inflow is None:
        return None
    return [[inflow.x_m, inflow.base], [inflow.x_m, inflow.base + inflow.greatest_depth]]


def _versions(record: Mapping[str, Any]) -> dict[str, str]:
    commit = record.get("git_commit")
    entries = {
        "command": " ".join(["warp-mpm", *map(str, record.get("command", [])[1:])]),
        "scenario file": record.get("scenario_file"),
        "started": record.get("started"),
        "ended": record.get("ended"),
        "device": record.get("device"),
        "machine": record.get("machine"),
        "material points": record.get("material_points"),
        "time steps": record.get("steps"),
        "wall time [s]": None if record.get("wall_time") is None else f"{record['wall_time']:.1f}",
        "commit": None if commit is None else commit + (" and changes" if record.get("git_changed") else ""),
        **record.get("versions", {}),
    }
    return {key: str(value) for key, value in entries.items() if value not in (None, "")}


def _text(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "off"
    if isinstance(value, list) and len(value) > 8:
        return f"{len(value)} entries"
    return str(value)
