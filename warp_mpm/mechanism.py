"""Where the flow ended up, and which impact mechanism was seen, measured on the snapshots of a run.

The four mechanisms are those of Faug's phase diagram as the paper uses it (Fig. 1): dead zone, airborne jet, standing
jump and bore. The diagram predicts from Fr and H/h; here the name is given by what the material did.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from warp_mpm.results import Snapshot
from warp_mpm.scenario import Scenario, Trapezoid

AIRBORNE_SHARE = 0.2
"""Least share of the flow that is past the crest's edge and more than a flow depth above it, at one time, of a jet."""

JUMP_DEPTH_RATIO = 1.5
"""Least depth upstream of the barrier, over the flow's, that counts as a jump: h + v²/(2g) of a flow with Fr = 1."""

OVERTOPPED_SHARE = 0.05
"""Least share of the flow beyond the crest that counts as overtopping."""

RULE = (
    f"none: the flow did not reach the barrier; airborne jet: at one time at least {AIRBORNE_SHARE:.0%} of the flow "
    "was past the crest's upstream edge and more than one flow depth above the crest; otherwise, where the depth "
    f"upstream of the toe rose to {JUMP_DEPTH_RATIO:g} times the flow's or more, standing jump if at least "
    f"{OVERTOPPED_SHARE:.0%} of the flow passed the crest, bore if not; otherwise dead zone"
)
"""The criterion in words, for the summary."""


def deposit(scenario: Scenario, snapshot: Snapshot) -> dict[str, float | None]:
    """Volumes [m³/m] upstream of the crest, on it, and beyond it, at the flow's initial density.

    The crest is where the barrier stands at the snapshot. What has left the domain is in neither.
    """
    volume = snapshot["solid_mass"] / scenario.flow.material.solid_partial_density
    initial = scenario.flow.volume
    left = initial - float(volume.sum())
    result: dict[str, float | None] = {
        "initial_volume": initial,
        # Rounding of single precision is no departure.
        "left_volume": left if abs(left) > 1e-6 * initial else 0.0,
        "retained_volume": None,
        "on_crest_volume": None,
        "overtopped_volume": None,
    }
    if scenario.barrier is not None:
        crest_start, crest_end, _ = _crest(scenario)
        x = snapshot.position[:, 0] - (snapshot.barrier_displacement or 0.0)
        result["retained_volume"] = float(volume @ (x <= crest_start))
        result["on_crest_volume"] = float(volume @ ((x > crest_start) & (x <= crest_end)))
        result["overtopped_volume"] = float(volume @ (x > crest_end))
    return result


def impact_mechanism(scenario: Scenario, snapshots: Iterable[Snapshot]) -> tuple[str | None, dict[str, float]]:
    """Name of the mechanism (`RULE`) and the measures it rests on; no name without a barrier.

    Measures: `airborne_share` [-] and `overtopped_share` [-], as in the rule; `jump_depth_ratio` [-], the greatest
    depth upstream of the toe over the flow's; `run_up` [m], the greatest height of material upstream of the crest.
    """
    if scenario.barrier is None:
        return None, {}
    depth = scenario.flow.depth
    whole = scenario.flow.volume * scenario.flow.material.solid_partial_density
    crest_start, crest_end, crest_height = _crest(scenario)
    bin_width = max(2.0 * scenario.numerics.spacing_m, 0.25 * depth)
    airborne, overtopped, jump, run_up, touched = 0.0, 0.0, 0.0, 0.0, False
    for snapshot in snapshots:
        share = snapshot["solid_mass"] / whole
        x = snapshot.position[:, 0] - (snapshot.barrier_displacement or 0.0)
        y = snapshot.position[:, 1]
        touched = touched or bool((x > -0.5 * scenario.numerics.spacing_m).any())
        airborne = max(airborne, float(share[(x > crest_start) & (y > crest_height + depth)].sum()))
        overtopped = max(overtopped, float(share[x > crest_end].sum()))
        upstream = x < 0.0
        if upstream.any():
            column = np.floor(-x[upstream] / bin_width).astype(np.int64)
            area = np.bincount(column, weights=share[upstream]) * scenario.flow.volume
            jump = max(jump, float(area.max()) / bin_width / depth)
        run_up = max(run_up, float(y[x <= crest_start].max(initial=0.0)))
    measures = {
        "airborne_share": airborne,
        "overtopped_share": overtopped,
        "jump_depth_ratio": jump,
        "run_up": run_up,
    }
    if not touched:
        return "none", measures
    if airborne >= AIRBORNE_SHARE:
        return "airborne jet", measures
    if jump >= JUMP_DEPTH_RATIO:
        return ("standing jump" if overtopped >= OVERTOPPED_SHARE else "bore"), measures
    return "dead zone", measures


def _crest(scenario: Scenario) -> tuple[float, float, float]:
    """x of the crest's two ends and its height [m] before the barrier moves; a wall without end has no crest."""
    assert scenario.barrier is not None
    shape: Any = scenario.barrier.shape
    if isinstance(shape, Trapezoid):
        start, end = shape.polygon[1], shape.polygon[2]
        return float(start[0]), float(end[0]), float(end[1])
    return np.inf, np.inf, np.inf
