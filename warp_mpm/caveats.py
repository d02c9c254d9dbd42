"""Sentences on what a reader must know before he trusts a scene or its figures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from warp_mpm.extent import domain_caveats
from warp_mpm.scenario import Prescribed, Scenario

LEAST_CELLS = 4.0
"""Cells over the flow's depth below which even peak forces were a tenth off (case 1 at 3.75: 11 %)."""

WATER = 1000.0
"""Density [kg/m³] that no rock falls short of."""

BOUNDS = {
    "float64": {"mass_error": 1e-9, "momentum_error": 1e-6, "energy_error": 0.02},
    "float32": {"mass_error": 1e-4, "momentum_error": 1e-3, "energy_error": 0.02},
}
"""Greatest relative errors of the ledger that call for no remark, by precision."""


def scene_caveats(scenario: Scenario) -> list[str]:
    """What looks like a slip in a scene that could be run; before it is."""
    flow, found = scenario.flow, []
    cells = flow.depth / scenario.numerics.spacing_m
    if cells < LEAST_CELLS * (1.0 - 1e-9):
        found.append(
            f"The flow's depth has {cells:.2g} cells; below {LEAST_CELLS:g} (numerics.spacing_m = "
            f"{flow.depth / LEAST_CELLS:.3g}) expect figures to be off by a tenth and more."
        )
    grains = flow.material.grain_density_kg_per_m3
    if grains < WATER:
        found.append(f"flow.material.grain_density_kg_per_m3 = {grains:g} is lighter than water; rock has about 2650.")
    driven = scenario.barrier is not None and isinstance(scenario.barrier.motion, Prescribed)
    if scenario.barrier is not None and not driven and not _can_arrive(scenario):
        found.append(
            f"The flow does not get to the barrier by t = {scenario.output.end_time_s:g} s; look at "
            "flow.velocity_m_per_s, the flow's distance, gravity.tilt_deg and output.end_time_s."
        )
    return [*found, *domain_caveats(scenario)]


def _can_arrive(scenario: Scenario) -> bool:
    """No front is faster than one that slides without friction and spreads as a dam break does, 2 √(g h) ahead."""
    flow, end = scenario.flow, scenario.output.end_time_s
    acceleration, _ = scenario.gravity.vector
    x, y = flow.polygon.T
    along, across = flow.velocity_m_per_s
    speed = along + abs(across) + 2.0 * math.sqrt(scenario.gravity.acceleration_m_per_s2 * float(np.ptp([0.0, *y])))
    # Where gravity holds it back, a front is farthest before the end.
    farthest = min(speed / -acceleration, end) if speed > 0.0 > acceleration else end
    reach = speed * farthest + 0.5 * acceleration * farthest**2
    return float(x.max()) + max(reach, 0.0) >= -scenario.numerics.spacing_m  # the face starts at x = 0


def run_caveats(record: Mapping[str, Any], summary: Mapping[str, Any]) -> list[str]:
    """What the figures of a run do not tell by themselves.

    Args:
        record: of the run folder (run.json).
        summary: its key figures.
    """
    found = []
    if record.get("git_changed"):
        found.append("The program's source differed from its commit when this was run.")
    if record.get("points_left"):
        left = summary.get("left_volume") or 0.0
        found.append(f"{record['points_left']:,} material points ({left:.3g} m³/m) left the domain.")
    if record.get("barrier_unconverged"):
        found.append(f"The barrier's motion was not solved to its tolerance in {record['barrier_unconverged']} steps.")
    precision = record.get("effects", {}).get("precision", "float64")
    for name, bound in BOUNDS[precision].items():
        value = summary.get(name)
        if value is not None and value > bound:
            found.append(f"{name} = {value:.2g} is above {bound:g}.")
    unknown = summary.get("not_recorded") or {}
    if unknown:
        needed = sorted({name for names in unknown.values() for name in names})
        found.append(
            f"Not known, because output.quantities leaves out {', '.join(needed)}: {', '.join(sorted(unknown))}."
        )
    if summary.get("peak_force") == 0.0:
        found.append("The flow did not touch the barrier.")
    if summary.get("barrier_at_rest") is False:
        found.append(
            f"The barrier still slides at {summary['barrier_velocity_final']:.3g} m/s at the end of the run: its "
            "displacement is not final."
        )
    if impact_goes_on(summary):
        found.append(
            "The impact is not over at the end of the run: its duration is not known; impulse, volumes and mechanism "
            "are those so far."
        )
    return found


def impact_goes_on(summary: Mapping[str, Any]) -> bool:
    """The force on the face is still falling at the end of the run."""
    return bool(summary.get("peak_force")) and summary.get("impact_end_time") is None
