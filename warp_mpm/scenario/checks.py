"""What makes a scene impossible, though each of its fields is allowed: one sentence per problem."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mpm import geometry
from warp_mpm.scenario.barrier import Prescribed, Sliding, Trapezoid
from warp_mpm.scenario.inflow import APPROACH, Inflow
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


STRAIGHT = 1e-3
"""Cells by which the ground before the section of an inflow may be off a straight line: what is held there at 10 m/s
then meets it across at 1 cm/s at most, which gravity gives it in a step."""


def problems(scenario: Scenario) -> list[str]:
    """All that makes the scene impossible; empty where nothing does."""
    found = [*site_problems(scenario), *_misplaced_inflow(scenario), *_misplaced_deposits(scenario)]
    found += [*_impossible_domain(scenario), *_excessive_size(scenario)]
    barrier = scenario.barrier
    if scenario.ground is None and barrier is not None and isinstance(barrier.motion, Sliding):
        found.append("ground = null is not allowed with a sliding barrier, which needs a base to slide on")
    elif scenario.ground is None and barrier is not None and isinstance(barrier.shape, Trapezoid):
        found.append(
            f'ground = null is not allowed with barrier.shape of the kind "{barrier.shape.kind}", which has no '
            'underside and would lift what flows beneath it; give a ground, or the kind "wall", which has no end below '
            "either"
        )
    flow = scenario.flow
    named = [("flow.material", flow.material)]
    named += [
        (f"flow.{body}.material", flow.material_of(own))
        for body, own in flow.others
        if flow.material_of(own) != flow.material
    ]
    for name, material in named if scenario.numerics.drag == "explicit" else ():
        inertial = getattr(material, "inertial_drag_coefficient", 0.0)
        if inertial > 0.0:
            found.append(
                f"{name}.inertial_drag_coefficient = {inertial:g} is not allowed with "
                'numerics.drag = "explicit"; it must be 0, or the drag "semi_implicit"'
            )
        conductivity = getattr(material, "conductivity_law", "constant")
        if conductivity != "constant":
            found.append(
                f'{name}.conductivity_law = "{conductivity}" is not allowed with numerics.drag = "explicit"; it '
                'must be "constant", or the drag "semi_implicit"'
            )
    given = "flow.initial_pore_pressure_ratios"
    if flow.initial_pore_pressure_ratio is not None:
        given = f"flow.initial_pore_pressure_ratio = {flow.initial_pore_pressure_ratio:g}"
    if flow.pore_pressure_ratio_range is not None and flow.initial_stress == "zero":
        found.append(f'{given} is not allowed with flow.initial_stress = "zero"; it must be null')
    if flow.pore_pressure_ratio_range is not None and flow.formulation == "dry":
        found.append(f"{given} is not allowed in a dry flow, which has no liquid; it must be null")
    return found


def _misplaced_deposits(scenario: Scenario) -> list[str]:
    """Deposits too small for a point, or where something else lies."""
    spacing, problems = scenario.numerics.spacing_m, []
    bodies = scenario.flow.bodies
    if scenario.flow.shape is not None:
        bodies = [*bodies[1:], bodies[0]]
    for name, outline in bodies[: len(scenario.flow.deposits)]:
        volume = geometry.area(outline)
        if volume / spacing**2 * scenario.numerics.points_per_cell < 1.0:
            problems.append(
                f"numerics.spacing_m = {spacing:g} leaves less than one material point for {name} of {volume:.3g} "
                "m³/m; it must be smaller"
            )
    for place, (name, outline) in enumerate(bodies):
        for other, another in bodies[place + 1 :]:
            if _overlap(outline, another, spacing):
                problems.append(f"{name} and {other} lie in one place; they must not overlap")
    return problems


def _overlap(one: geometry.Polygon, other: geometry.Polygon, spacing: float) -> bool:
    """Whether two outlines hold some of the same, looked for at the middles of cells of a quarter of the spacing or of
    a hundredth of what they have in common."""
    low = np.maximum(one.min(axis=0), other.min(axis=0))
    high = np.minimum(one.max(axis=0), other.max(axis=0))
    if (high - low <= 1e-9 * max(1.0, float(np.abs(one).max()))).any():
        return False
    counts = np.clip(np.ceil((high - low) / (0.25 * spacing)), 1, 100).astype(int)
    x, y = (low[i] + (np.arange(counts[i]) + 0.5) / counts[i] * (high[i] - low[i]) for i in (0, 1))
    middles = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return bool((geometry.contains(one, middles) & geometry.contains(other, middles)).any())


def _misplaced_inflow(scenario: Scenario) -> list[str]:
    """An inflow that has no room, or comes too late."""
    flow, domain, inflow = scenario.flow, scenario.domain, scenario.flow.inflow
    if inflow is None:
        return []
    problems, section = [], f"flow.inflow.x_m = {inflow.x_m:g}"
    if scenario.ground is not None:
        problems += _uneven_approach(scenario, inflow)
    reach = -_travel_upstream(scenario) if scenario.barrier is not None else np.inf
    if inflow.x_m >= reach:
        way = f", which is driven to x = {reach:g}" if reach < 0.0 else " at x = 0"
        problems.append(f"{section} does not lie upstream of the barrier{way}; it must be less")
    for name, outline in flow.bodies:
        first = float(outline[:, 0].min())
        if first < inflow.x_m - 1e-9 * max(1.0, abs(first)):
            problems.append(f"{section} lies inside {name}, which begins at x = {first:g}; it must be at most that")
    approach = APPROACH * scenario.numerics.spacing_m
    if domain.left_m is not None and inflow.x_m >= domain.left_m > inflow.x_m - approach * (1.0 - 1e-9):
        problems.append(
            f"{section} has no room upstream: domain.left_m = {domain.left_m:g} must be at most "
            f"{inflow.x_m - approach:g}, {APPROACH} cells before it"
        )
    if domain.right_m is not None and domain.right_m == inflow.x_m:
        problems.append(f"{section} lies beyond domain.right_m = {domain.right_m:g}; it must be less")
    if inflow.times[0] >= scenario.output.end_time_s and flow.shape is None:
        problems.append(
            f"flow.inflow.times_s begins at {inflow.times[0]:g}, when the run has ended (output.end_time_s = "
            f"{scenario.output.end_time_s:g}); it must begin earlier"
        )
    return problems


def _uneven_approach(scenario: Scenario, inflow: Inflow) -> list[str]:
    """An inflow below its ground, or on one that is not straight before the section.

    What is held there is given its velocity anew in every step: along a ground that turns, it would be driven into it
    as often.
    """
    assert scenario.ground is not None
    section, (first, last) = f"flow.inflow.x_m = {inflow.x_m:g}", scenario.ground.ends
    if not first <= inflow.x_m <= last:
        return [f"{section} lies beyond the ground's profile; it must be from {first:g} to {last:g}"]
    if inflow.base < inflow.bed - 1e-9 * max(1.0, abs(inflow.bed)):
        return [
            f"flow.inflow.base_m = {inflow.base_m:g} lies below the ground; it must be at least {inflow.bed:g}, or null"
        ]
    begin = inflow.x_m - APPROACH * scenario.numerics.spacing_m
    x, y = scenario.ground.profile.T
    within = (x > begin) & (x <= inflow.x_m)
    x, y = np.append(begin, x[within]), np.append(scenario.ground.height(begin), y[within])
    apart = np.abs(y - inflow.bed - inflow.slope * (x - inflow.x_m))
    off = np.flatnonzero(apart > STRAIGHT * scenario.numerics.spacing_m)
    if not len(off):
        return []
    turn = np.append(x, inflow.x_m)[off[-1] + 1]
    return [
        f"{section} needs straight ground before it, from x = {begin:g} on ({APPROACH} cells); the profile turns at "
        f"x = {turn:g}"
    ]


def _travel_upstream(scenario: Scenario) -> float:
    """How far a driven barrier comes upstream until the end [m]."""
    motion = scenario.barrier.motion if scenario.barrier is not None else None
    if not isinstance(motion, Prescribed):
        return 0.0
    times = np.linspace(0.0, scenario.output.end_time_s, 1001)
    velocity = np.interp(times, motion.times_s, motion.velocities_m_per_s)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(times))])
    return max(0.0, -float(way.min()))


def _extent(scenario: Scenario) -> tuple[float, float, float, float]:
    """Smallest and greatest x, smallest and greatest y [m] of flow and barrier."""
    outline = np.concatenate(scenario.flow.outlines)
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
    volume = scenario.flow.volume + scenario.flow.deposited_volume
    points = volume / scenario.numerics.spacing_m**2 * scenario.numerics.points_per_cell
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
