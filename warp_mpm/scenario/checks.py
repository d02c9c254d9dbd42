"""What makes a scene impossible, though each of its fields is allowed: one sentence per problem."""

from __future__ import annotations

from typing import TYPE_CHECKING

from warp_mpm.scenario.barrier import Sliding, Trapezoid
from warp_mpm.scenario.site import all_standing, lowest_ground, site_problems

if TYPE_CHECKING:
    from warp_mpm.scenario.scene import Scenario

LARGEST_SCENE = 20_000_000
"""Most material points that a scenario may ask for."""

LARGEST_GRID = 100_000_000
"""Most nodes of the grid between edges that a scenario may ask for."""

BYTES_PER_NODE = 120
"""Rough memory of one node of the grid in a two-phase run."""

LARGEST_SNAPSHOTS = 1e12
"""Most bytes of snapshots that a scenario may ask for."""

BYTES_PER_SNAPSHOT_POINT = 110
"""Size on the disk of one material point in a snapshot."""

BYTES_PER_POINT = 500
"""Rough memory of one material point in a two-phase run, grid and output included."""


def problems(scenario: Scenario) -> list[str]:
    """All that makes the scene impossible; empty where nothing does."""
    found = [*site_problems(scenario), *_impossible_domain(scenario), *_excessive_size(scenario)]
    barrier = scenario.barrier
    if scenario.ground is None and barrier is not None and isinstance(barrier.motion, Sliding):
        found.append("ground = null is not allowed with a sliding barrier, which needs a base to slide on")
    elif scenario.ground is None and barrier is not None and isinstance(barrier.shape, Trapezoid):
        found.append(
            f'ground = null is not allowed with barrier.shape of the kind "{barrier.shape.kind}", which has no '
            'underside and would lift what flows beneath it; give a ground, or the kind "wall", which has no end below '
            "either"
        )
    inertial = getattr(scenario.flow.material, "inertial_drag_coefficient", 0.0)
    if scenario.numerics.drag == "explicit" and inertial > 0.0:
        found.append(
            f"flow.material.inertial_drag_coefficient = {inertial:g} is not allowed with "
            'numerics.drag = "explicit"; it must be 0, or the drag "semi_implicit"'
        )
    flow = scenario.flow
    if flow.initial_pore_pressure_ratio is not None and flow.initial_stress == "zero":
        found.append(
            f"flow.initial_pore_pressure_ratio = {flow.initial_pore_pressure_ratio:g} is not allowed with "
            'flow.initial_stress = "zero"; it must be null'
        )
    if flow.initial_pore_pressure_ratio is not None and flow.formulation == "dry":
        found.append(
            f"flow.initial_pore_pressure_ratio = {flow.initial_pore_pressure_ratio:g} is not allowed in a dry flow, "
            "which has no liquid; it must be null"
        )
    return found


def _extent(scenario: Scenario) -> tuple[float, float, float, float]:
    """Smallest and greatest x, smallest and greatest y [m] of flow and barriers."""
    outline = scenario.flow.polygon
    x_low, y_low = outline.min(axis=0)
    x_high, y_high = outline.max(axis=0)
    for _, x, _, standing in all_standing(scenario):
        x_low, x_high = min(x_low, x), max(x_high, x)
        if standing is not None:
            x_low, x_high = min(x_low, standing[:, 0].min()), max(x_high, standing[:, 0].max())
            y_high = max(y_high, standing[:, 1].max())
    return float(x_low), float(x_high), float(y_low), float(y_high)


def _impossible_domain(scenario: Scenario) -> list[str]:
    domain = scenario.domain
    x_low, x_high, y_low, y_high = _extent(scenario)
    problems = []
    if domain.left_m is not None and domain.left_m > x_low:
        problems.append(f"domain.left_m = {domain.left_m:g} cuts the scene; it must be at most {x_low:g}")
    if domain.right_m is not None and domain.right_m < x_high:
        problems.append(f"domain.right_m = {domain.right_m:g} cuts the scene; it must be at least {x_high:g}")
    if domain.top_m is not None and domain.top_m < y_high:
        problems.append(f"domain.top_m = {domain.top_m:g} cuts the scene; it must be at least {y_high:g}")
    if domain.bottom_m is not None:
        if scenario.ground is not None:
            where = " at y = 0" if scenario.ground.level else ""
            problems.append(f"domain.bottom_m is not allowed with a ground, which is the lower edge{where}")
        elif domain.bottom_m > y_low:
            problems.append(f"domain.bottom_m = {domain.bottom_m:g} cuts the scene; it must be at most {y_low:g}")
    return problems


def _excessive_size(scenario: Scenario) -> list[str]:
    problems = []
    points = scenario.flow.volume / scenario.numerics.spacing_m**2 * scenario.numerics.points_per_cell
    if points > LARGEST_SCENE:
        problems.append(
            f"numerics.spacing_m = {scenario.numerics.spacing_m:g} asks for {points:.3g} material points "
            f"(about {points * BYTES_PER_POINT / 1e9:.3g} GB of memory); at most {LARGEST_SCENE:.3g} are allowed"
        )
    if points < 1.0:
        problems.append(
            f"numerics.spacing_m = {scenario.numerics.spacing_m:g} leaves less than one material point for the flow "
            f"of {scenario.flow.volume:.3g} m³/m; it must be smaller"
        )
    domain = scenario.domain
    x_low, x_high, y_low, y_high = _extent(scenario)
    given = (domain.left_m, domain.right_m, domain.bottom_m, domain.top_m)
    left, right, low, high = (
        asked if asked is not None else fitted
        for asked, fitted in zip(given, (x_low, x_high, y_low, y_high), strict=True)
    )
    low = lowest_ground(scenario, left, right) if scenario.ground is not None else low
    nodes = (right - left) * (high - low) / scenario.numerics.spacing_m**2
    if nodes > LARGEST_GRID:
        problems.append(
            f"domain of {right - left:.3g} m by {high - low:.3g} m at numerics.spacing_m = "
            f"{scenario.numerics.spacing_m:g} asks for a grid of {nodes:.3g} nodes (about "
            f"{nodes * BYTES_PER_NODE / 1e9:.3g} GB of memory); at most {LARGEST_GRID:.3g} are allowed"
        )
    snapshots = points * BYTES_PER_SNAPSHOT_POINT * scenario.output.end_time_s / scenario.output.snapshot_interval_s
    if points <= LARGEST_SCENE and snapshots > LARGEST_SNAPSHOTS:
        problems.append(
            f"output.snapshot_interval_s = {scenario.output.snapshot_interval_s:g} asks for about "
            f"{snapshots / 1e9:.3g} GB on the disk; at most {LARGEST_SNAPSHOTS / 1e9:.3g} GB are allowed"
        )
    output = scenario.output
    if scenario.design is not None and scenario.barrier is None:
        problems.append("design needs a barrier")
    if output.loads_by_height and scenario.barrier is None:
        problems.append("output.loads_by_height = true needs a barrier")
    elif output.loads_by_height:
        slots = (x_high - x_low + 2.0 * (y_high - y_low)) / scenario.numerics.spacing_m
        loads = 32.0 * slots * output.end_time_s / output.time_series_interval_s
        if loads > LARGEST_SNAPSHOTS:
            problems.append(
                f"output.loads_by_height = true at output.time_series_interval_s = {output.time_series_interval_s:g} "
                f"asks for about {loads / 1e9:.3g} GB on the disk; at most {LARGEST_SNAPSHOTS / 1e9:.3g} GB are allowed"
            )
    for name in ("time_series_interval_s", "snapshot_interval_s"):
        interval = getattr(scenario.output, name)
        if scenario.output.end_time_s / interval > 1e7:
            problems.append(
                f"output.{name} = {interval:g} asks for more than ten million records until "
                f"end_time_s = {scenario.output.end_time_s:g}; it must be longer"
            )
    return problems
