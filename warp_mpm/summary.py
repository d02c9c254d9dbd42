"""Key figures of a run, from its time series and snapshots. SI, per metre of width."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.force_record import (
    START_SHARE,
    cumulative_impulse,
    filtered_peak,
    impact_end,
    moving_mean,
    still_rises,
)
from warp_mpm import mechanism
from warp_mpm.design_checks import verdict
from warp_mpm.quantities import left_out
from warp_mpm.quantities.figures import FIGURES, NEEDED
from warp_mpm.quantities.time_series import NAMED
from warp_mpm.results import ResultsError, Snapshots
from warp_mpm.scenario import Scenario, Sliding
from warp_mpm.snapshot import Snapshot

Array = NDArray[np.float64]
Series = Mapping[str, Array]

DEFINITIONS = {name: figure.meaning for name, figure in FIGURES.items()} | {
    "mechanism": mechanism.RULE,
    "verdict": "what the run says to the scenario's design group; null without one (docs/how_to/design_checks.md)",
    "notes": "what must be known before the scene and its figures are trusted",
}
"""How each figure is taken."""


def summarize(
    scenario: Scenario, series: Series, snapshots: Sequence[Snapshot] | Snapshots | None, run: Mapping[str, Any]
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
        ("run_up_max", "run_up"),
        ("barrier_velocity_max", "barrier_velocity"),
    ):
        figures[name], figures[f"{name}_time"] = _peak(series, column)
    for name in ("pressure_patch", "pore_pressure_patch"):
        figures |= _patch(series, name)
    figures["pressure_patch_m"] = scenario.output.pressure_patch_m
    figures["pressure_patch_s"] = scenario.output.pressure_patch_s
    figures |= load_figures(series)
    displacement = series.get("barrier_displacement")
    figures["barrier_displacement_final"] = None if displacement is None else float(displacement[-1])
    velocity = series.get("barrier_velocity")
    figures["barrier_velocity_final"] = None if velocity is None else float(velocity[-1])
    slides = scenario.barrier is not None and isinstance(scenario.barrier.motion, Sliding)
    figures["barrier_at_rest"] = bool(velocity[-1] == 0.0) if slides and velocity is not None else None
    if snapshots is not None and len(snapshots) > 0:
        figures |= mechanism.deposit(scenario, snapshots[-1])
        figures["mechanism"], figures["mechanism_measures"] = mechanism.impact_mechanism(scenario, snapshots)
    for name in series:
        if name not in NAMED:  # of a script, or on a script's body: `quantities.SUMMED_UP`
            (figures[f"{name}_max"], figures[f"{name}_max_time"]), values = _peak(series, name), series[name]
            figures[f"{name}_final"] = float(values[-1])
    figures["verdict"] = verdict(scenario, series, figures)
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


def load_figures(series: Series) -> dict[str, float | None]:
    """Height of the peak force and greatest moments, all of moving means; None of what there is not."""
    time, force, height = series["time"], series.get("impact_force_x"), series.get("impact_force_height")
    figures: dict[str, float | None] = {"peak_force_height": None}
    if force is not None and height is not None and len(time) > 1:
        filtered = moving_mean(time, force)
        peak = filtered_peak(filtered)
        if filtered[peak] > 0.0:
            figures["peak_force_height"] = float(moving_mean(time, force * height)[peak] / filtered[peak])
    for name in ("toe_moment", "heel_moment"):
        figures[f"{name}_filtered"] = figures[f"{name}_filtered_time"] = None
        if name in series:
            means = {name: moving_mean(time, series[name]), "time": time}
            figures[f"{name}_filtered"], figures[f"{name}_filtered_time"] = _peak(means, name)
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


def _patch(series: Series, name: str) -> dict[str, float | None]:
    """Greatest pressure on a patch of the face, its time and its height; None where there was none."""
    greatest, time = _peak(series, name)
    pressed, height = bool(greatest), series.get(f"{name}_height")
    at = None if height is None or not pressed else float(height[int(np.argmax(series[name]))])
    return {f"{name}_max": greatest, f"{name}_max_time": time if pressed else None, f"{name}_max_height": at}


def _peak(series: Series, name: str) -> tuple[float | None, float | None]:
    if name not in series:
        return None, None
    index = int(np.argmax(series[name]))
    return float(series[name][index]), float(series["time"][index])
