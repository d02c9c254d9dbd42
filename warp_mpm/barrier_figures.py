"""Figures of each barrier of a scene with several: what hit it, how it moved, what passed it and where it landed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.force_record import cumulative_impulse, filtered_peak, moving_mean
from warp_mpm.arrival_figures import came_beyond
from warp_mpm.quantities.time_series import series_of_barrier
from warp_mpm.results import Snapshots
from warp_mpm.scenario import Scenario, Wall
from warp_mpm.scenario.site import all_standing
from warp_mpm.snapshot import Snapshot
from warp_mpm.summary import load_figures

Array = NDArray[np.float64]
Series = Mapping[str, Array]

LANDED = 1.5
"""Cells above the ground within which a point counts as on it."""


def barrier_figures(
    scenario: Scenario, series: Series, snapshots: Sequence[Snapshot] | Snapshots | None
) -> dict[str, Any]:
    """`barriers`, a table of all barriers from upstream to downstream, of a scene with further ones; nothing of any
    other.

    Each row: `name`, `x` of the toe [m]; of the horizontal force on the whole barrier `peak_force` and
    `peak_force_filtered` [N/m] with their times [s], and `impulse` [N s/m]; `face_impulse` [N s/m] on its face alone,
    as the run's `impulse` is; of the face, too, `face_peak_force_filtered` [N/m] with its time and
    `face_peak_force_height` [m], `pressure_patch_max` and `pore_pressure_patch_max` [Pa] with times and heights, and
    `run_up_max` [m] with its time; `toe_moment_filtered` and `heel_moment_filtered` [N m/m] of the whole barrier with
    their times; heights are above its own base; `displacement` [m], `velocity` [m/s] and `work` [J/m] at the end, 0 of
    a fixed one; `held_volume` [m³/m] at the end between the crest of the barrier before and its own; `passed_volume`
    [m³/m], what is beyond its own then and did not lie there at the start; `landing_distance` [m], from its heel to
    where the first of what passes it is on the ground; and `first_force_time` [s]. What is not known is None.

    Args:
        scenario: what was run.
        series: columns of the time series.
        snapshots: None leaves out what is measured on them.
    """
    if not scenario.barriers:
        return {}
    rows = []
    beyond = _volumes_beyond(scenario, series, snapshots)
    before = beyond.pop("inside", None)
    for name, x, barrier, standing in all_standing(scenario):
        own = series_of_barrier(series, name)
        row: dict[str, Any] = {"name": name, "x": x} | _force_figures(series, _force_on(series, name))
        row["face_impulse"] = _impulse(own, "impact_force_x")
        row |= _load_figures(own)
        moving = {"displacement": "barrier_displacement", "velocity": "barrier_velocity", "work": "barrier_work"}
        for figure, column in moving.items():
            values = own.get(column)
            fixed = name != "barrier" and _kind(scenario, name) == "fixed"
            row[figure] = 0.0 if fixed else None if values is None else float(values[-1])
        there = beyond.get(name)
        row["held_volume"] = None if there is None or before is None else before - there
        crest_end = x if isinstance(barrier.shape, Wall) else x + barrier.shape.crest_end
        row["passed_volume"] = None if there is None else came_beyond(scenario, there, crest_end)
        before = there
        row["landing_distance"] = _landing(scenario, name, standing, series, snapshots)
        rows.append(row)
    return {"barriers": rows}


def _kind(scenario: Scenario, name: str) -> str:
    return next(one.motion.kind for one in scenario.barriers if one.name == name)


def _load_figures(series: Series) -> dict[str, float | None]:
    """Where a barrier is loaded most, from its series; None of what that does not tell."""
    loads = load_figures(series)
    found = {"face_peak_force_height": loads.pop("peak_force_height")} | loads
    face = _force_figures(series, series.get("impact_force_x"))
    for figure in ("peak_force_filtered", "peak_force_filtered_time"):
        found[f"face_{figure}"] = face[figure]
    for name in ("pressure_patch", "pore_pressure_patch", "run_up"):
        values, height = series.get(name), series.get(f"{name}_height")
        at = None if values is None else int(np.argmax(values))
        greatest = None if at is None or values is None else float(values[at])
        found[f"{name}_max"] = greatest
        found[f"{name}_max_time"] = float(series["time"][at]) if greatest else None
        if name != "run_up":
            found[f"{name}_max_height"] = float(height[at]) if greatest and height is not None else None
    return found


def _force_on(series: Series, name: str) -> Array | None:
    """Horizontal force on the whole of a barrier [N/m]."""
    names = ("impact_force_x", "top_force", "back_force_x") if name == "barrier" else (f"{name}_force_x",)
    if any(column not in series for column in names):
        return None
    return np.sum([series[column] for column in names], axis=0)


def _force_figures(series: Series, force: Array | None) -> dict[str, float | None]:
    names = ("peak_force", "peak_force_time", "peak_force_filtered", "peak_force_filtered_time", "impulse")
    figures: dict[str, float | None] = dict.fromkeys((*names, "first_force_time"))
    time = series["time"]
    if force is None or len(time) < 2:
        return figures
    filtered = moving_mean(time, force)
    peak, highest = int(np.argmax(force)), filtered_peak(filtered)
    figures["impulse"] = float(cumulative_impulse(time, force)[-1])
    if not force[peak] > 0.0:
        return figures | {"peak_force": 0.0, "peak_force_filtered": 0.0}
    first = int(np.argmax(force > 0.01 * force[peak]))
    return figures | {
        "peak_force": float(force[peak]),
        "peak_force_time": float(time[peak]),
        "peak_force_filtered": float(filtered[highest]),
        "peak_force_filtered_time": float(time[highest]),
        "first_force_time": float(time[max(first - 1, 0)]),
    }


def _impulse(series: Series, column: str) -> float | None:
    """Time integral of a force [N s/m]."""
    if column not in series or len(series["time"]) < 2:
        return None
    return float(cumulative_impulse(series["time"], series[column])[-1])


def _volumes_beyond(
    scenario: Scenario, series: Series, snapshots: Sequence[Snapshot] | Snapshots | None
) -> dict[str, float]:
    """Volume [m³/m] beyond each barrier's crest at the end, at the flow's initial density, and `inside`, all that is
    there; what has left downstream is in none of them."""
    if snapshots is None or len(snapshots) == 0:
        return {}
    snapshot = snapshots[-1]
    volume = snapshot["solid_mass"] / scenario.flow.material.solid_partial_density
    found = {"inside": float(volume.sum())}
    for name, x, barrier in scenario.all_barriers:
        moved = _moved(name, series, snapshot)
        end = x if isinstance(barrier.shape, Wall) else x + barrier.shape.crest_end
        found[name] = float(volume @ (snapshot.position[:, 0] > end + moved))
    return found


def _moved(name: str, series: Series, snapshot: Snapshot) -> float:
    """Displacement of a barrier [m] at a snapshot; that of further ones is in the time series alone."""
    if name == "barrier":
        return snapshot.barrier_displacement or 0.0
    column = series.get(f"{name}_barrier_displacement")
    return 0.0 if column is None else float(np.interp(snapshot.time, series["time"], column))


def _landing(
    scenario: Scenario,
    name: str,
    standing: Array | None,
    series: Series,
    snapshots: Sequence[Snapshot] | Snapshots | None,
) -> float | None:
    """From the heel, where it is then, to the middle of the first that is on the ground beyond it [m], to a snapshot's
    time; None where nothing is, or something was there at the start."""
    if standing is None or snapshots is None or scenario.ground is None:
        return None
    spacing = scenario.numerics.spacing_m
    for number, snapshot in enumerate(snapshots):
        x, y = snapshot.position.T
        heel = float(standing[:, 0].max()) + _moved(name, series, snapshot)
        landed = (x > heel + spacing) & (y - scenario.ground.height(x) < LANDED * spacing)
        if landed.any():
            return float(np.median(x[landed])) - heel if number else None
    return None
