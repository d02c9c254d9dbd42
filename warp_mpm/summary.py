"""Key figures of a run, from its time series and snapshots. SI, per metre of width."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.force_record import (
    END_SHARE,
    FILTER_WINDOW,
    RESIDUAL_SHARE,
    SETTLED_SHARE,
    START_SHARE,
    cumulative_impulse,
    filtered_peak,
    impact_end,
    moving_mean,
    still_rises,
)
from warp_mpm import mechanism
from warp_mpm.recording.chosen import left_out
from warp_mpm.results import ResultsError, Snapshots
from warp_mpm.scenario import Scenario, Sliding

Array = NDArray[np.float64]
Series = Mapping[str, Array]

DEFINITIONS = {
    "peak_force": "greatest horizontal force on the impacted face, each value a mean over one interval of the series; "
    "its time is the end of that interval; where force_still_rises, that so far, at least",
    "peak_force_filtered": f"the same of the force's moving mean over {FILTER_WINDOW:g} s",
    "force_still_rises": "whether that moving mean is greatest where the run ends; null without an impact",
    "impact_start_time": f"start of the first interval whose force exceeds {START_SHARE:.0%} of peak_force",
    "rise_time": "T1: peak_force_filtered_time less impact_start_time; null where force_still_rises",
    "residual_force": f"mean force over the last {RESIDUAL_SHARE:.0%} of the run",
    "impact_end_time": (
        "first time after the peak from which the filtered force, less the residual force, stays below "
        f"{END_SHARE:.0%} of the filtered peak less the residual force; null where that is only in the last "
        f"{RESIDUAL_SHARE:.0%} of the run, or the force has not settled by then: residual_force is above "
        f"{SETTLED_SHARE:.0%} of the filtered peak and, at the rate of its last change, would change by more than "
        f"{END_SHARE:.0%} of that peak in as long as the impact has lasted"
    ),
    "impact_duration": "T2: impact_end_time less impact_start_time",
    "impulse": "time integral of the horizontal force on the impacted face over the whole run",
    "impact_impulse": "the same from impact_start_time to impact_end_time",
    "barrier_velocity_max": "greatest velocity downstream; 0 of a barrier that only slides upstream",
    "barrier_displacement_final": "at the end of the run; not final unless barrier_at_rest",
    "pore_pressure_max": (
        "greatest pore pressure upstream of the barrier's crest at any sample: at the material points, less their "
        "noise about the mean over a cell"
    ),
    "pore_pressure_max_anywhere": "greatest pore pressure of any single material point, noise and jets included",
    "retained_volume": "material upstream of the crest at the end, at the flow's initial density",
    "on_crest_volume": "material above the crest at the end",
    "overtopped_volume": "material beyond the crest at the end; left_volume is what has left the domain",
    "mechanism": mechanism.RULE,
    "notes": "what must be known before the scene and its figures are trusted",
    "mass_error": "greatest change of the mass of both phases, inside and departed together, over the initial mass",
    "momentum_error": "greatest momentum not accounted for by the recorded impulses, over the greatest of the flow's "
    "momentum and the impulse of its weight",
    "energy_error": "greatest energy that appeared beyond what was there at the start less the work done on the "
    "barrier and beyond gravity's work on liquid that seeps, over the flow's initial energy; plastic flow and drag "
    "only take energy away",
}
"""How each figure that could be understood in several ways is taken."""


def summarize(
    scenario: Scenario, series: Series, snapshots: Snapshots | None, run: Mapping[str, Any]
) -> dict[str, Any]:
    """All key figures of a run that may have ended at any moment; one that the scene does not have, or that was not
    reached, is None.

    Args:
        scenario: what was run.
        series: columns of the time series.
        snapshots: None leaves out what is measured on them.
        run: what the run knows of itself (`material_points`, `steps`, `wall_time`, ...), taken over as it is.

    Raises:
        ResultsError: the series has no sample, or a figure is no finite number.
    """
    if len(series["time"]) == 0:
        raise ResultsError("The time series has no sample: the run ended before its first.")
    figures: dict[str, Any] = {"title": scenario.title, "end_time": float(series["time"][-1]), **run}
    figures |= impact_figures(series["time"], series.get("impact_force_x"))
    for name, column in (
        ("pore_pressure_max", "pore_pressure_max"),
        ("pore_pressure_max_anywhere", "pore_pressure_max_anywhere"),
        ("barrier_velocity_max", "barrier_velocity"),
    ):
        figures[name], figures[f"{name}_time"] = _peak(series, column)
    displacement = series.get("barrier_displacement")
    figures["barrier_displacement_final"] = None if displacement is None else float(displacement[-1])
    velocity = series.get("barrier_velocity")
    figures["barrier_velocity_final"] = None if velocity is None else float(velocity[-1])
    slides = scenario.barrier is not None and isinstance(scenario.barrier.motion, Sliding)
    figures["barrier_at_rest"] = bool(velocity[-1] == 0.0) if slides and velocity is not None else None
    if snapshots is not None and len(snapshots) > 0:
        figures |= mechanism.deposit(scenario, snapshots[-1])
        figures["mechanism"], figures["mechanism_measures"] = mechanism.impact_mechanism(scenario, snapshots)
    unknown = not_recorded(scenario)
    errors: dict[str, Callable[[], float | None]] = {
        "mass_error": lambda: mass_error(series),
        "momentum_error": lambda: momentum_error(series, scenario.gravity.acceleration_m_per_s2),
        "energy_error": lambda: energy_error(series),
    }
    figures |= {name: None if name in unknown else error() for name, error in errors.items()}
    if unknown:
        figures["not_recorded"] = unknown
    for name, value in (figures | figures.get("mechanism_measures", {})).items():
        if isinstance(value, float) and not math.isfinite(value):
            raise ResultsError(f"{name} is {value}; every figure of a run must be a finite number.")
    figures["definitions"] = DEFINITIONS
    return figures


NEEDED = {
    "peak_force": ("impact_force_x",),
    "peak_force_filtered": ("impact_force_x",),
    "impulse": ("impact_force_x",),
    "impact_start_time": ("impact_force_x",),
    "rise_time": ("impact_force_x",),
    "impact_duration": ("impact_force_x",),
    "impact_impulse": ("impact_force_x",),
    "residual_force": ("impact_force_x",),
    "pore_pressure_max": ("pore_pressure_max",),
    "pore_pressure_max_anywhere": ("pore_pressure_max_anywhere",),
    "barrier_velocity_max": ("barrier_velocity",),
    "barrier_velocity_final": ("barrier_velocity",),
    "barrier_at_rest": ("barrier_velocity",),
    "barrier_displacement_final": ("barrier_displacement",),
    "mass_error": ("solid_mass", "liquid_mass", "left_mass"),
    "momentum_error": (
        *("momentum_residual_x", "momentum_residual_y", "momentum_x", "momentum_y", "solid_mass", "liquid_mass"),
    ),
    "energy_error": (
        *("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy"),
        *("left_energy", "barrier_work", "seepage_work"),
    ),
}
"""Quantities of the time series that a figure is taken from."""


def not_recorded(scenario: Scenario) -> dict[str, list[str]]:
    """Figures that are not known because `output.quantities` leaves out what they are taken from, with what that is."""
    missing = left_out(scenario)
    lacks = {figure: [name for name in needed if name in missing] for figure, needed in NEEDED.items()}
    return {figure: names for figure, names in lacks.items() if names}


def impact_figures(time: Array, force: Array | None) -> dict[str, float | None]:
    """Peak, times and impulses of the force on the impacted face (`DEFINITIONS`), of a record that may end at any
    moment and have any shape.

    Args:
        time: ends of the intervals [s], increasing, the first the start of the run.
        force: mean over the interval that ends then [N/m]; None without a barrier.

    Raises:
        ValueError: a force is no finite number.
    """
    names = (
        *("peak_force", "peak_force_time", "peak_force_filtered", "peak_force_filtered_time", "force_still_rises"),
        *("residual_force", "impact_start_time", "impact_end_time", "rise_time", "impact_duration", "impulse"),
        "impact_impulse",
    )
    figures: dict[str, float | None] = dict.fromkeys(names)
    if force is None or len(time) < 2:
        return figures
    if not np.isfinite(force).all():
        raise ValueError(f"The impact force at t = {time[~np.isfinite(force)][0]:g} s is not a finite number.")
    impulse = cumulative_impulse(time, force)
    figures["impulse"] = float(impulse[-1])
    peak = int(np.argmax(force))
    filtered = moving_mean(time, force)
    highest = filtered_peak(filtered)
    if not (force[peak] > 0.0 and filtered[highest] > 0.0):
        return figures | {"peak_force": max(float(force[peak]), 0.0)}
    rises = still_rises(filtered)
    start = float(time[max(int(np.argmax(force > START_SHARE * force[peak])) - 1, 0)])
    figures |= {
        "peak_force": float(force[peak]),
        "peak_force_time": float(time[peak]),
        "peak_force_filtered": float(filtered[highest]),
        "peak_force_filtered_time": float(time[highest]),
        "force_still_rises": rises,
        "impact_start_time": start,
        "rise_time": None if rises else float(time[highest]) - start,
    }
    end = impact_end(time, force, filtered, start)
    figures["residual_force"] = end.residual_force
    if end.over:
        figures["impact_end_time"] = end.time
        figures["impact_duration"] = end.time - start
        figures["impact_impulse"] = float(np.interp(end.time, time, impulse) - np.interp(start, time, impulse))
    return figures


def mass_error(series: Series) -> float | None:
    """Greatest relative change of the mass, in the domain and departed together."""
    if "solid_mass" not in series:
        return None
    whole = series["solid_mass"] + series.get("liquid_mass", 0.0) + series.get("left_mass", 0.0)
    return float(np.abs(whole - whole[0]).max() / whole[0])


STANDSTILL = 1e-30
"""Speed [m/s] below which nothing moves: single precision does not hold its square."""


def momentum_error(series: Series, gravity: float) -> float | None:
    """Greatest momentum residual over the greatest of the flow's momentum and the impulse of its weight; None where
    nothing moves."""
    if "momentum_residual_x" not in series:
        return None
    residual = np.hypot(series["momentum_residual_x"], series["momentum_residual_y"]).max()
    momentum = np.hypot(series["momentum_x"], series["momentum_y"]).max()
    mass = series["solid_mass"][0] + (series["liquid_mass"][0] if "liquid_mass" in series else 0.0)
    scale = float(np.maximum(momentum, mass * gravity * (series["time"][-1] - series["time"][0])))
    return None if scale <= STANDSTILL * float(mass) else float(residual) / scale


def energy_error(series: Series) -> float | None:
    """Greatest energy created, over the flow's initial energy; 0 where energy was only lost, NaN where an energy is no
    number."""
    parts: Sequence[str] = ("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy")
    if any(part not in series for part in parts):
        return None
    total = sum((series[part] for part in parts), np.zeros(len(series["time"])))
    total = total + series.get("left_energy", 0.0) + series.get("barrier_work", 0.0) - series.get("seepage_work", 0.0)
    scale = float(sum(abs(series[part][0]) for part in parts))
    # Unlike max, which takes 0 where it is offered no number.
    return None if scale == 0.0 else float(np.maximum((total - total[0]).max(), 0.0)) / scale


def _peak(series: Series, name: str) -> tuple[float | None, float | None]:
    if name not in series:
        return None, None
    index = int(np.argmax(series[name]))
    return float(series[name][index]), float(series["time"][index])
