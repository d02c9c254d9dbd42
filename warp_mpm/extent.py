"""How far a scene's material and barrier can get until the end of the run: what a fitted domain must hold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mpm.scenario import Barrier, Prescribed, Scenario, Sliding, Trapezoid, Wall
from warp_mpm.scenario.inflow import APPROACH
from warp_mpm.scenario.site import all_standing, lowest_ground

LARGEST_FITTED_GRID = 2_000_000
"""Most nodes that a grid fitted to the scene gets; beyond, the fitted edges move in and what leaves is counted."""

BEHIND_A_WALL = 8
"""Cells of a fitted domain behind the face of a wall without end, where nothing flows."""


@dataclass(frozen=True)
class Travel:
    """What is known beforehand of a barrier's motion."""

    upstream: float = 0.0
    """Greatest displacement against x [m]."""
    downstream: float = 0.0
    """Greatest displacement along x [m]; of a barrier that the flow pushes, a bound of it."""
    speed: float = 0.0
    """Greatest speed that is not the flow's doing [m/s]."""


@dataclass(frozen=True)
class Edges:
    """Edges of a region: x [m] at t = 0, from where it rides with the barrier, and y [m]."""

    left: float
    right: float
    bottom: float
    top: float

    def nodes(self, spacing: float) -> float:
        """Number of nodes of a grid over it."""
        return (self.right - self.left) * (self.top - self.bottom) / spacing**2


@dataclass(frozen=True)
class Extent:
    """The domain of a scene: as given, else fitted."""

    edges: Edges
    """What the domain gets."""
    wanted: Edges
    """What it would get, were there no bound on the size of a grid."""
    speed: float
    """Speed [m/s] that material was reckoned with."""


def domain_extent(scenario: Scenario, vertices: Sequence[NDArray[np.float64]] = ()) -> Extent:
    """The domain's edges where given, else as far as the flow can get until the end.

    How far that is: twice the speed that a point has if the whole fall, the flow's speed and the barrier's own are its
    own, because the jet that a blunt front squeezes out of a corner runs ahead of the flow; upward, also as high as a
    barrier that is driven through the flow heaps it up. What gets further still is counted as it leaves.

    The domain rides with the barrier, so that it reaches further by the barrier's way on the side that this leaves.

    Args:
        scenario: the scene.
        vertices: of the outlines of bodies beside the scenario's, [V, 2] each [m].
    """
    if not scenario.plain:
        return _site_extent(scenario, vertices)
    spacing, domain, flow = scenario.numerics.spacing_m, scenario.domain, scenario.flow
    outline = np.concatenate(flow.outlines)
    x_low, y_low = (float(low) for low in outline.min(axis=0))
    x_high, y_high = (float(high) for high in outline.max(axis=0))
    length = x_high - x_low
    barrier, driven = scenario.barrier, False
    if barrier is not None:
        driven = isinstance(barrier.motion, Prescribed)
        x_low, x_high = min(x_low, 0.0), max(x_high, 0.0)
        if isinstance(barrier.shape, Trapezoid):
            base, _, height = barrier.shape.base_crest_height
            x_high, y_high = max(x_high, base), max(y_high, height)
    for corners in vertices:
        x_low, x_high = min(x_low, float(corners[:, 0].min())), max(x_high, float(corners[:, 0].max()))
        y_low, y_high = min(y_low, float(corners[:, 1].min())), max(y_high, float(corners[:, 1].max()))
    gx, gy = scenario.gravity.vector
    time = scenario.output.end_time_s
    travel = barrier_travel(scenario)
    fall = 2.0 * abs(gy) * _height_of_fall(scenario) + 2.0 * abs(gx) * (x_high - x_low)
    fast = 2.0 * math.sqrt((flow.greatest_speed + travel.speed) ** 2 + fall)
    rise = min(fast * time, fast**2 / (2.0 * abs(gy)) if gy else math.inf)
    reach = fast * time + 0.5 * abs(gx) * time**2

    falls = _height_of_fall(scenario)
    behind = min(reach, 4.0 * (length if falls == flow.depth else max(length, falls)))
    if driven or travel.upstream > 0.0:
        # What a barrier throws upstream gets as far as what runs downstream elsewhere.
        behind = (reach if travel.upstream > 0.0 else behind) + travel.downstream
    elif scenario.ground is not None and scenario.ground.friction > 0.0:
        # A barrier that the flow pushes goes where the flow goes, but for a tail that the ground brings to rest.
        behind = max(behind, travel.downstream + length)
    if flow.inflow is not None:
        # Upstream of the section there is nothing but what is about to arrive; what comes back over it leaves.
        x_low = min(x_low, flow.inflow.x_m) - APPROACH * spacing - travel.downstream
        behind = 0.0
    ahead = reach + travel.upstream
    if barrier is not None and driven and isinstance(barrier.shape, Wall):
        # Nothing flows there; behind a wall at rest the same room costs memory, and no time.
        ahead = BEHIND_A_WALL * spacing
    heap = max(heaped_height(scenario), _filled_height(scenario))
    highest = max(y_high, heap) if math.isfinite(heap) else y_high
    if scenario.ground is not None:
        bottom = 0.0
    elif domain.bottom_m is not None:
        bottom = domain.bottom_m
    else:
        sunk = 0.5 * abs(gy) * time**2 + flow.depth
        bottom = y_low - (fast * time + sunk if travel.speed else min(reach, flow.greatest_speed * time + sunk))
    # A wall at an edge stands still while the grid rides, which must not leave it behind.
    beyond_left = travel.downstream if domain.left_edge == "wall" else 0.0
    beyond_right = travel.upstream if domain.right_edge == "wall" else 0.0
    wanted = Edges(
        left=domain.left_m - beyond_left if domain.left_m is not None else x_low - behind,
        right=domain.right_m + beyond_right if domain.right_m is not None else x_high + ahead,
        bottom=bottom,
        top=domain.top_m if domain.top_m is not None else highest + rise,
    )
    # What is certain is kept if half of the nodes can hold it: where flow and barrier are, and a driven barrier's way.
    inner = Edges(x_low, x_high, bottom, y_high)
    if driven:
        way = Edges(x_low - travel.downstream, x_high + travel.upstream, bottom, highest)
        inner = way if way.nodes(spacing) <= 0.5 * LARGEST_FITTED_GRID else inner
    return _bounded(scenario, wanted, inner, fast)


def _bounded(scenario: Scenario, wanted: Edges, inner: Edges, fast: float) -> Extent:
    """The wanted edges, drawn in toward what must be inside where the grid would be larger than a fitted one gets."""
    domain, excess = scenario.domain, math.sqrt(wanted.nodes(scenario.numerics.spacing_m) / LARGEST_FITTED_GRID)
    if excess <= 1.0:
        return Extent(wanted, wanted, fast)
    edges = Edges(
        left=wanted.left if domain.left_m is not None else inner.left - (inner.left - wanted.left) / excess,
        right=wanted.right if domain.right_m is not None else inner.right + (wanted.right - inner.right) / excess,
        bottom=wanted.bottom,
        top=wanted.top if domain.top_m is not None else inner.top + (wanted.top - inner.top) / excess,
    )
    return Extent(edges, wanted, fast)


def _filled_height(scenario: Scenario) -> float:
    """Height [m] to which what arrives may fill the room between the section and a barrier, up to the height at which
    it goes over the barrier or back over the section."""
    inflow, barrier = scenario.flow.inflow, scenario.barrier
    if inflow is None or barrier is None or not inflow.x_m < 0.0:
        return 0.0
    crest = barrier.shape.base_crest_height[2] if isinstance(barrier.shape, Trapezoid) else math.inf
    filled = 2.0 * (scenario.flow.volume + scenario.flow.deposited_volume) / -inflow.x_m
    return min(filled, crest, inflow.base + 2.0 * inflow.greatest_depth) + inflow.greatest_depth


def _site_extent(scenario: Scenario, vertices: Sequence[NDArray[np.float64]]) -> Extent:
    """The same on a ground that is not level, or with several barriers: the grid rests, and holds their ways.

    The flow may fall to the lowest ground of the profile, whose ends are those of a fitted domain, and rise from there
    as high as twice its speed takes it.
    """
    domain, flow, ground = scenario.domain, scenario.flow, scenario.ground
    assert ground is not None
    outline = np.concatenate(flow.outlines)
    if flow.inflow is not None:
        outline = np.concatenate([outline, flow.inflow.approach(scenario.numerics.spacing_m)])
    (x_low, y_low), (x_high, y_high) = outline.min(axis=0), outline.max(axis=0)
    length, flow_top = float(x_high - x_low), float(y_high)
    speed = 0.0
    for _, x, barrier, standing in all_standing(scenario):
        travel = travel_of(barrier, scenario)
        speed = max(speed, travel.speed)
        lying = np.array([[x, 0.0]]) if standing is None else standing
        x_low = min(x_low, float(lying[:, 0].min()) - travel.upstream)
        x_high = max(x_high, float(lying[:, 0].max()) + travel.downstream)
        y_high = max(y_high, float(lying[:, 1].max()))
    for corners in vertices:
        (x_low, y_low), (x_high, y_high) = (
            np.minimum((x_low, y_low), corners.min(axis=0)),
            np.maximum((x_high, y_high), corners.max(axis=0)),
        )
    x_low, x_high, y_high = float(x_low), float(x_high), float(y_high)
    first, last = ground.ends
    left = domain.left_m if domain.left_m is not None else min(x_low, first) if first > -math.inf else x_low
    right = domain.right_m if domain.right_m is not None else max(x_high, last) if last < math.inf else x_high
    lowest = lowest_ground(scenario, left, right)
    gx, gy = scenario.gravity.vector
    time = scenario.output.end_time_s
    fall = 2.0 * abs(gy) * max(flow_top - lowest, flow.depth) + 2.0 * abs(gx) * (x_high - x_low)
    fast = 2.0 * math.sqrt((flow.greatest_speed + speed) ** 2 + fall)
    reach = fast * time + 0.5 * abs(gx) * time**2
    # Upstream a flow spreads as on level ground, unless it may run down there too.
    upstream = ground.profile[ground.profile[:, 0] < float(outline[:, 0].min()), 1]
    falls_back = gx < 0.0 or (len(upstream) > 0 and bool(upstream.min() < float(outline[:, 1].min())))
    behind = reach if falls_back or speed > 0.0 else min(reach, 4.0 * max(length, flow.depth))
    if flow.inflow is not None:
        # What comes back over the section leaves; so does what would heap up there higher than twice the flow's depth.
        behind, y_high = 0.0, max(y_high, flow.inflow.base + 3.0 * flow.inflow.greatest_depth)
    rise = fast**2 / (2.0 * abs(gy)) if gy else math.inf
    left = domain.left_m if domain.left_m is not None else min(x_low, max(x_low - behind, first))
    right = domain.right_m if domain.right_m is not None else max(x_high, min(x_high + reach, last))
    bottom = lowest_ground(scenario, left, right)
    heap = heaped_height(scenario)
    top = max(y_high, min(flow_top + fast * time, lowest + rise), heap if math.isfinite(heap) else 0.0)
    if not ground.level:
        top = max(top, ground.range(max(left, first), min(right, last))[1])
    wanted = Edges(left, right, bottom, domain.top_m if domain.top_m is not None else top)
    return _bounded(scenario, wanted, Edges(x_low, x_high, bottom, y_high), fast)


def _height_of_fall(scenario: Scenario) -> float:
    """The flow's depth [m]; of a flow that begins above the ground, the height from which it falls."""
    depth, top = scenario.flow.depth, float(np.concatenate(scenario.flow.outlines)[:, 1].max())
    return top if scenario.ground is not None and top > depth * (1.0 + 1e-6) else depth


def barrier_travel(scenario: Scenario) -> Travel:
    """How far and how fast the scene's first barrier gets until the end; see `travel_of`."""
    return Travel() if scenario.barrier is None else travel_of(scenario.barrier, scenario)


def travel_of(barrier: Barrier, scenario: Scenario) -> Travel:
    """How far and how fast a barrier gets until the end: a driven one exactly, one that slides at most."""
    time = scenario.output.end_time_s
    if isinstance(barrier.motion, Prescribed):
        return _driven(barrier.motion, time)
    if not isinstance(barrier.motion, Sliding):
        return Travel()
    flow, (gx, gy) = scenario.flow, scenario.gravity.vector
    mass = barrier.mass
    assert mass is not None
    held = barrier.motion.base_friction_coefficient * abs(gy)
    # The momentum of a flow that is all as fast as its front, shared with the barrier; friction at its base stops it.
    flow_mass = flow.volume * flow.material.density + flow.deposited_mass
    front = flow.greatest_speed + 2.0 * math.sqrt(abs(gy) * flow.depth)
    pushed = flow_mass / (flow_mass + mass) * front
    slowed = held - gx
    downstream = pushed * time + 0.5 * max(-slowed, 0.0) * time**2
    if slowed > 0.0:
        downstream = min(downstream, pushed**2 / (2.0 * slowed))
    # Where the ground falls upstream, it may slide that way by itself.
    pull = max(-gx - held, 0.0)
    return Travel(upstream=0.5 * pull * time**2, downstream=downstream, speed=pull * time)


def _driven(motion: Prescribed, end: float) -> Travel:
    given = np.array(motion.times_s)
    times = np.concatenate([[0.0], given[(given > 0.0) & (given < end)], [end]])
    velocities = np.interp(times, given, motion.velocities_m_per_s)
    steps, sums = np.diff(times), velocities[1:] + velocities[:-1]
    displacement = np.concatenate([[0.0], np.cumsum(0.5 * sums * steps)])
    # Between two times it may turn round.
    turns = np.flatnonzero(velocities[1:] * velocities[:-1] < 0.0)
    before, after = velocities[turns], velocities[turns + 1]
    turned = displacement[turns] + 0.5 * before**2 / (before - after) * steps[turns]
    reached = np.concatenate([displacement, turned])
    return Travel(
        upstream=max(0.0, -float(reached.min())),
        downstream=max(0.0, float(reached.max())),
        speed=float(np.abs(velocities).max()),
    )


def heaped_height(scenario: Scenario) -> float:
    """Height [m] to which a barrier that is driven through the flow heaps it up, 0 without one: as a heap no steeper
    than 1:1, and between a wall without end and a wall at the domain's edge as high as the room there makes it
    (infinite where there is none)."""
    barrier, domain, flow = scenario.barrier, scenario.domain, scenario.flow
    travel = barrier_travel(scenario)
    if barrier is None or not travel.speed > 0.0:
        return 0.0
    heap = math.sqrt(2.0 * flow.volume)
    if isinstance(barrier.shape, Wall) and domain.left_edge == "wall" and domain.left_m is not None:
        room = -travel.upstream - domain.left_m
        return max(heap, flow.volume / room if room > 0.0 else math.inf)
    return heap


def domain_caveats(scenario: Scenario) -> list[str]:
    """Why material may leave the domain of a scene though it should not, before it is run."""
    domain, found = scenario.domain, []
    extent, travel = domain_extent(scenario), barrier_travel(scenario)
    edges, wanted = extent.edges, extent.wanted
    if edges != wanted:
        nodes = wanted.nodes(scenario.numerics.spacing_m)
        found.append(
            f"At speeds up to {extent.speed:.3g} m/s the flow may reach x = {wanted.left:.3g} to {wanted.right:.3g} m "
            f"and y = {wanted.top:.3g} m, {nodes:.2g} nodes at numerics.spacing_m = {scenario.numerics.spacing_m:g}; a "
            f"fitted domain gets {LARGEST_FITTED_GRID:.1g} and ends at x = {edges.left:.3g} and {edges.right:.3g} m, "
            f"y = {edges.top:.3g} m. Give domain.left_m, right_m or top_m if more must stay."
        )
    if scenario.barrier is None or not isinstance(scenario.barrier.motion, Prescribed) or not scenario.plain:
        return found
    outline = np.concatenate(scenario.flow.outlines)
    x_low, x_high = float(outline[:, 0].min()), float(outline[:, 0].max())
    for side, edge, place, way, cut in (
        ("left", domain.left_edge, domain.left_m, travel.downstream, x_low),
        ("right", domain.right_edge, domain.right_m, -travel.upstream, x_high),
    ):
        passed = place is not None and (place + way > cut if side == "left" else place + way < cut)
        if edge == "open" and place is not None and way and passed:
            found.append(
                f"The domain rides with the barrier, by {way:.3g} m: its {side} edge, domain.{side}_m = {place:g}, "
                f"then lies at x = {place + way:.3g} m, inside of the flow's own place at the start."
            )
    heap = heaped_height(scenario)
    if math.isinf(heap):
        found.append(
            f"The barrier is driven {travel.upstream:.3g} m upstream, up to or beyond the wall at domain.left_m = "
            f"{domain.left_m:g}: the flow between them has no room left."
        )
    elif domain.top_m is not None and heap > domain.top_m:
        found.append(
            f"The barrier heaps the flow up to {heap:.3g} m or higher; domain.top_m = {domain.top_m:g} lies below."
        )
    return found
