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

OVERTOPPED_SHARE = 0.05
"""Least share of the flow beyond the crest's upstream edge that counts as overtopping."""

JET_ENERGY_SHARE = 0.3
"""Least kinetic energy of the material that passes the crest, over that of the arriving flow, of an airborne jet."""

JUMP_DEPTH_RATIO = 1.5
"""Least depth upstream of the barrier, over the flow's, that counts as a jump."""

JUMP_REACH = 1.0
"""Distance from the barrier's toe, over the flow's depth, that a jump must have reached; nearer, it is a dead zone."""

RULE = (
    f"airborne jet: at least {OVERTOPPED_SHARE:.0%} of the flow passed the crest's upstream edge, with at least "
    f"{JET_ENERGY_SHARE:.0%} of the initial specific kinetic energy; otherwise, where a depth of {JUMP_DEPTH_RATIO:g} "
    f"times the initial one was seen farther than {JUMP_REACH:g} depths upstream of the toe: standing jump if "
    f"{OVERTOPPED_SHARE:.0%} passed the crest, bore if not; where it was not seen: dead zone; none: the flow did not "
    "reach the barrier"
)
"""The criterion in words, for the summary."""


def deposit(scenario: Scenario, snapshot: Snapshot) -> dict[str, float | None]:
    """Volumes [m³/m] upstream of the crest, on it, and beyond it, at the flow's initial density.

    The crest is where the barrier stands at the snapshot. What has left the domain is in neither.
    """
    volume = snapshot["solid_mass"] / scenario.flow.material.solid_partial_density
    left = scenario.flow.volume - float(volume.sum())
    result: dict[str, float | None] = {
        "initial_volume": scenario.flow.volume,
        # Rounding of single precision is no departure.
        "left_volume": left if abs(left) > 1e-6 * scenario.flow.volume else 0.0,
        "retained_volume": None,
        "on_crest_volume": None,
        "overtopped_volume": None,
    }
    if scenario.barrier is not None:
        crest_start, crest_end = _crest(scenario)
        x = snapshot.position[:, 0] - (snapshot.barrier_displacement or 0.0)
        result["retained_volume"] = float(volume[x <= crest_start].sum())
        result["on_crest_volume"] = float(volume[(x > crest_start) & (x <= crest_end)].sum())
        result["overtopped_volume"] = float(volume[x > crest_end].sum())
    return result


def impact_mechanism(scenario: Scenario, snapshots: Iterable[Snapshot]) -> tuple[str | None, dict[str, float | None]]:
    """Name of the mechanism (`RULE`) and the measures it rests on; no name without a barrier.

    Measures: `overtopped_share` [-], the most of the flow that was beyond the crest's upstream edge at one time;
    `overtopping_energy_share` [-]; `jump_depth_ratio` [-], the greatest depth upstream of the toe over the initial one;
    `jump_reach` [m], the farthest upstream that the jump's depth was seen; `run_up` [m], the highest point reached
    upstream of the crest.
    """
    if scenario.barrier is None:
        return None, {}
    depth, density = scenario.flow.depth, scenario.flow.material.solid_partial_density
    crest_start, crest_end = _crest(scenario)
    bin_width = max(2.0 * scenario.numerics.spacing_m, 0.25 * depth)
    share, energy, passed = 0.0, 0.0, 0.0
    depth_ratio, reach, run_up, touched = 0.0, 0.0, 0.0, False
    for snapshot in snapshots:
        mass = snapshot["solid_mass"]
        x = snapshot.position[:, 0] - (snapshot.barrier_displacement or 0.0)
        y = snapshot.position[:, 1]
        velocity = snapshot["solid_velocity"]
        touched = touched or bool((x > -0.5 * scenario.numerics.spacing_m).any())
        share = max(share, float(mass[x > crest_start].sum()) / (density * scenario.flow.volume))
        # Weighted with the flux through the crest, so that a slow pool on it does not count for more than a fast jet.
        crossing = (x > crest_start) & (x <= crest_end) & (velocity[:, 0] > 0.0)
        flux = mass[crossing] * velocity[crossing, 0]
        energy += float(flux @ (0.5 * (velocity[crossing] ** 2).sum(axis=1)))
        passed += float(flux.sum())
        upstream = x < 0.0
        if upstream.any():
            column = np.floor(-x[upstream] / bin_width).astype(np.int64)
            local = np.bincount(column, weights=mass[upstream] / density) / bin_width / depth
            depth_ratio = max(depth_ratio, float(local.max()))
            thick = np.flatnonzero(local >= JUMP_DEPTH_RATIO)
            if len(thick) > 0:
                reach = max(reach, float(thick[-1] + 1) * bin_width)
        before_crest = x <= crest_start
        if before_crest.any():
            run_up = max(run_up, float(y[before_crest].max()))
    arriving = 0.5 * scenario.flow.speed**2
    energy_share = energy / passed / arriving if passed > 0.0 and arriving > 0.0 else 0.0
    measures: dict[str, float | None] = {
        "overtopped_share": share,
        "overtopping_energy_share": energy_share if passed > 0.0 else None,
        "jump_depth_ratio": depth_ratio,
        "jump_reach": reach,
        "run_up": run_up,
    }
    overtopped = share >= OVERTOPPED_SHARE
    if not touched:
        return "none", measures
    if overtopped and energy_share >= JET_ENERGY_SHARE:
        return "airborne jet", measures
    if reach > JUMP_REACH * depth:
        return ("standing jump" if overtopped else "bore"), measures
    return "dead zone", measures


def _crest(scenario: Scenario) -> tuple[float, float]:
    """x of the crest's two ends [m] before the barrier moves; a wall without end has no crest to pass."""
    assert scenario.barrier is not None
    shape: Any = scenario.barrier.shape
    if isinstance(shape, Trapezoid):
        return float(shape.polygon[1, 0]), float(shape.polygon[2, 0])
    return np.inf, np.inf
