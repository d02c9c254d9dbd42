"""Key figures of runs with more than one body of flow: what arrives, and what lay there.

The balances of a run (`summary`) hold for what is there from the start. What has yet to arrive counts as there, with
the mass and the energy that it will bring: so nothing appears from nowhere, and none of them needs to know of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mpm.discretization import fill_polygon
from warp_mpm.geometry import area
from warp_mpm.scenario import Scenario, Trapezoid

Array = NDArray[np.float64]


def with_what_arrives(scenario: Scenario, series: Mapping[str, Array]) -> dict[str, Array]:
    """The time series with what has yet to arrive until its end counted as there."""
    balanced = dict(series)
    for inflow, there in (("inflow_mass", "solid_mass"), ("inflow_energy", "flow_kinetic_energy")):
        if inflow in series and there in series and len(series[inflow]):
            balanced[there] = series[there] + (series[inflow][-1] - series[inflow])
    return balanced


def departed_volume(scenario: Scenario, figures: Mapping[str, Any]) -> float | None:
    """What has left the domain [m³/m], of the volume that is not there in the end; None where it is not known."""
    left, flow = figures.get("left_volume"), scenario.flow
    if left is None or (flow.inflow is None and not flow.deposits):
        return left
    coming = 0.0
    if flow.inflow is not None:
        coming = flow.inflow.volume - flow.inflow.volume_until(float(figures["end_time"]))
    left += flow.deposited_volume - coming
    # What has arrived is counted in points.
    return left if abs(left) > max(1e-6 * flow.volume, scenario.numerics.spacing_m**2) else 0.0


def lain_beyond(scenario: Scenario, place: float) -> float:
    """Volume [m³/m] of the deposits that lay beyond a place x [m] at the start, by the points that they are made of."""
    numerics, volume = scenario.numerics, 0.0
    for deposit in scenario.flow.deposits:
        outline = deposit.shape.polygon
        if outline[:, 0].max() > place:
            position, parts = fill_polygon(outline, numerics.spacing_m, numerics.points_per_cell, at_rest=True)
            volume += float(parts @ (position[:, 0] > place))
    return volume


def came_beyond(scenario: Scenario, volume: float, place: float) -> float:
    """What came beyond a place x [m] of a volume [m³/m] that is beyond it in the end: that less what lay there."""
    lain = lain_beyond(scenario, place)
    came = volume - lain
    return came if lain == 0.0 or came > 1e-6 * lain else 0.0  # points have single precision


def arrival_figures(scenario: Scenario, series: Mapping[str, Array], figures: Mapping[str, Any]) -> dict[str, Any]:
    """Volumes of what arrived, lay there, left and overtopped; nothing where nothing arrives and nothing lies there."""
    flow = scenario.flow
    found: dict[str, Any] = {}
    if flow.deposits:
        found["deposited_volume"] = flow.deposited_volume
        beyond, barrier = figures.get("overtopped_volume"), scenario.barrier
        if beyond is not None and barrier is not None and isinstance(barrier.shape, Trapezoid):
            found["overtopped_volume"] = came_beyond(scenario, beyond, barrier.shape.crest_end)
    if flow.inflow is not None:
        arrived = "inflow_mass" in series
        found["inflow_volume"] = flow.arrived_volume(float(series["inflow_mass"][-1])) if arrived else None
    if found and figures.get("left_volume") is not None:
        left = series.get("left_mass")
        known = None if left is None else float(left[-1]) / flow.material.density
        found["left_volume"] = departed_volume(scenario, figures) if known is None else known
        there = area(flow.shape.polygon) if flow.shape is not None else 0.0
        found["initial_volume"] = there + flow.deposited_volume
    return found
