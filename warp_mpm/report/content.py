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
from warp_mpm.results import Results
from warp_mpm.scenario import Trapezoid, Wall
from warp_mpm.terminal import summary_rows

Array = NDArray[np.float64]

MOST_SAMPLES = 3000
"""Samples of a curve beyond which it is thinned; a line across a page shows no more."""

CURVES: tuple[tuple[str, str, float, tuple[tuple[str, str], ...]], ...] = (
    (
        "impact force on the face",
        "kN/m",
        1e-3,
        (("impact_force_x", "F₂,x, horizontal"), ("impact_force_y", "F₂,y, vertical")),
    ),
    ("friction", "kN/m", 1e-3, (("top_force", "F₃, on the crest"), ("base_force", "F₄, at the base"))),
    ("barrier velocity", "m/s", 1.0, (("barrier_velocity", "v₂"),)),
    ("barrier displacement", "m", 1.0, (("barrier_displacement", "Δx"),)),
    (
        "kinetic energy",
        "kJ/m",
        1e-3,
        (("flow_kinetic_energy", "Eₖ₁, flow"), ("barrier_kinetic_energy", "Eₖ₂, barrier")),
    ),
    (
        "other energies of the flow, and work",
        "kJ/m",
        1e-3,
        (
            ("flow_gravitational_energy", "gravitational"),
            ("flow_elastic_energy", "elastic"),
            ("barrier_work", "work on the barrier"),
            ("base_friction_work", "work of base friction"),
        ),
    ),
    ("greatest pore pressure upstream of the crest", "kPa", 1e-3, (("pore_pressure_max", "p_L,max"),)),
)
"""Title, unit, factor from SI, and the columns of each chart."""

FORCES = ("impact_force_x", "impact_force_y", "top_force", "base_force")
"""Columns drawn as moving means, with the raw values faint behind them."""

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
        "charts": [chart for chart in (_chart(series, *chart, fits) for chart in CURVES) if chart is not None],
        "closed_form": [_fit_row(fit, series) for fit in fits],
        "ledger": ledger(series, results.summary),
        "effects": {rule.effect: f"{_text(rule.value)}: {rule.reason}" for rule in effect_rules(scenario)},
        "settings": {path: _text(value) for path, value in flattened(scenario.resolved())},
        "versions": _versions(record),
        "warnings": [*_unfinished(results), *scene_caveats(scenario), *run_caveats(record, results.summary), *no_fit],
        "notes": list(scenario.notes),
        "ground": scenario.ground is not None,
        "barrier": _outline(results),
    }


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
    """What was there, what came and went, and what is not accounted for."""
    rows = []

    def row(label: str, value: float | None, unit: str, factor: float = 1.0) -> None:
        if value is not None:
            rows.append((label, f"{value * factor:,.4g} {unit}".strip()))

    def at(name: str, index: int) -> float | None:
        return float(series[name][index]) if name in series else None

    def total(index: int) -> float | None:
        parts = ("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy")
        return sum(float(series[part][index]) for part in parts) if all(part in series for part in parts) else None

    for label, name in (("mass of solid at the start", "solid_mass"), ("mass of liquid at the start", "liquid_mass")):
        row(label, at(name, 0), "kg/m")
    row("mass that left the domain", at("left_mass", -1), "kg/m")
    row("error of mass, relative", summary.get("mass_error"), "")
    row("momentum along x at the start", at("momentum_x", 0), "kN s/m", 1e-3)
    row("momentum along x at the end", at("momentum_x", -1), "kN s/m", 1e-3)
    row("impulse on the impacted face", summary.get("impulse"), "kN s/m", 1e-3)
    row("error of momentum, relative", summary.get("momentum_error"), "")
    first, last = total(0), total(-1)
    row("energy of the flow at the start", first, "kJ/m", 1e-3)
    row("energy of the flow at the end", last, "kJ/m", 1e-3)
    row("work done on the barrier", at("barrier_work", -1), "kJ/m", 1e-3)
    row("  of it taken by base friction", at("base_friction_work", -1), "kJ/m", 1e-3)
    row("work of gravity on seepage", at("seepage_work", -1), "kJ/m", 1e-3)
    row("energy that left the domain", at("left_energy", -1), "kJ/m", 1e-3)
    if first is not None and last is not None:
        spent = first - last - (at("barrier_work", -1) or 0.0) - (at("left_energy", -1) or 0.0)
        spent += at("seepage_work", -1) or 0.0
        row("dissipated in the flow", spent, "kJ/m", 1e-3)
    row("energy created, relative", summary.get("energy_error"), "")
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

    return {
        "rule": fit.rule.replace("_", " "),
        "λ": f"{fit.geometry_change:.3f}" + ("" if fit.within_range else " (out of range)"),
        "τ": f"{fit.rise_ratio:.3f}",
        "F_peak": f"{impact.peak_force / 1e3:,.0f} kN/m",
        "T₁, T₂": f"{impact.peak_time - impact.arrival_time:.3f} s, {impact.duration:.3f} s",
        "Δx": f"{impact.barrier_displacement_final:.2f} m",
        "misfit of F": percent(distance.force),
        "of Eₖ₁": percent(distance.flow_kinetic_energy),
        "of v₂": percent(distance.barrier_velocity),
        "of Δx": percent(distance.barrier_displacement),
    }


def _chart(
    series: Mapping[str, Array],
    title: str,
    unit: str,
    factor: float,
    columns: tuple[tuple[str, str], ...],
    fits: list[Calibration],
) -> dict[str, Any] | None:
    time, lines = series["time"], []
    for number, (name, label) in enumerate(columns):
        if name not in series or not np.any(series[name]):
            continue
        if name in FORCES:
            lines.append(_line(time, series[name] * factor, f"{label}, raw", number, "faint"))
            smooth = moving_mean(time, series[name]) * factor
            lines.append(_line(time, smooth, f"{label}, mean over {FILTER_WINDOW:g} s", number, "solid"))
        else:
            lines.append(_line(time, series[name] * factor, label, number, "solid"))
        for style, fit in zip(("dashed", "dotted"), fits, strict=False):
            if name in CLOSED_FORM:
                values = getattr(trajectory(fit.impact, time), CLOSED_FORM[name]) * factor
                rule = fit.rule.replace("_", " ")
                lines.append(_line(time, values, f"{label}: closed form, {rule}", number, style))
    return {"title": title, "unit": unit, "lines": lines} if lines else None


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


def _outline(results: Results) -> dict[str, Any] | None:
    barrier = results.scenario.barrier
    if barrier is None:
        return None
    if isinstance(barrier.shape, Wall):
        return {"kind": "wall"}
    assert isinstance(barrier.shape, Trapezoid)
    return {"kind": "polygon", "corners": barrier.shape.polygon.tolist()}


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
    if isinstance(value, list) and len(value) > 8:
        return f"{len(value)} entries"
    return str(value)
