"""Where the barriers of a scene stand on its ground, and what is impossible about that."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mpm import geometry
from warp_mpm.scenario.barrier import Barrier, FurtherBarrier, OutlineShape, Sliding, Wall

if TYPE_CHECKING:
    from warp_mpm.scenario.ground import Ground
    from warp_mpm.scenario.scene import Scenario

Array = NDArray[np.float64]

HAIR = 1e-9
"""Share of a scene's size that is rounding of the user's own arithmetic."""


def standing_outline(barrier: Barrier, x: float, ground: Ground | None) -> Array | None:
    """Vertices [V, 2] of a barrier where it stands at t = 0 [m], from the toe over the crest to the heel; None of a
    wall without end.

    The base lies at the ground's height at the toe. Where the ground falls away under it, the back of a trapezoid goes
    on down to the ground; where it never gets there, it ends at the base.

    Args:
        barrier: any.
        x: of its toe [m].
        ground: of the scene; None where there is none.
    """
    shape = barrier.shape
    if isinstance(shape, Wall):
        return None
    if ground is None or ground.level:
        return shape.outline + np.array([x, 0.0]) if x else shape.outline
    outline = shape.outline + np.array([x, float(ground.height(x))])
    if not isinstance(shape, OutlineShape):
        met = _way_down(outline[-2], outline[-1], ground)
        if met is not None:
            outline[-1] = met
    return outline


def _way_down(crest: Array, heel: Array, ground: Ground) -> Array | None:
    """Where the back, from the crest to the heel and on, meets the ground that lies below the heel; None where it lies
    on the ground already, or never gets there."""
    if ground.height(heel[0]) >= heel[1]:
        return None
    run = heel[0] - crest[0]
    if run <= 0.0:
        return np.array([heel[0], float(ground.height(heel[0]))])
    slope = (heel[1] - crest[1]) / run
    places = np.concatenate([[heel[0]], ground.profile[ground.profile[:, 0] > heel[0], 0]])
    places = np.append(places, places[-1] + 1e3 * run)
    before, above = places[0], float(heel[1] - ground.height(heel[0]))
    for place in places[1:]:
        gap = float(heel[1] + slope * (place - heel[0]) - ground.height(place))
        if gap <= 0.0:
            met = before + (place - before) * above / (above - gap)
            return np.array([met, heel[1] + slope * (met - heel[0])])
        before, above = place, float(heel[1] + slope * (place - heel[0]) - ground.height(place, lower=True))
    return None


def site_problems(scenario: Scenario) -> list[str]:
    """What is impossible about ground, barriers and how they lie to each other and to the flow."""
    flow = scenario.flow
    found = [problem for name, outline in flow.bodies for problem in _misplaced_flow(scenario, name, outline)]
    names = [one.name for one in scenario.barriers]
    for number, name in enumerate(names):
        if name in names[:number]:
            found.append(f"barriers[{number}].name = {name!r} is there twice; each barrier needs a name of its own")
    if scenario.barriers and scenario.ground is None:
        return [*found, "ground = null is not allowed with barriers, which stand on it; give a ground"]
    standing: list[tuple[str, float, Array | None]] = []
    barriers: list[tuple[str, float, Barrier]] = [("barrier", 0.0, scenario.barrier)] if scenario.barrier else []
    barriers += [(f"barriers[{number}]", one.x_m, one) for number, one in enumerate(scenario.barriers)]
    bodies = flow.bodies
    if flow.inflow is not None and not (scenario.barrier is not None and flow.inflow.x_m >= 0.0):
        bodies.append(("flow.inflow", flow.inflow.approach(scenario.numerics.spacing_m)))
    for field, x, barrier in barriers:
        outline = standing_outline(barrier, x, scenario.ground)
        found += _misplaced(scenario, field, x, barrier, outline)
        for name, body in bodies:
            area = overlap(body, outline, x)
            if area > HAIR * max(1.0, float(np.abs(body).max())) * flow.depth:
                what = "the barrier" if field == "barrier" else field
                found.append(
                    f"{name} lies inside {what} by {area:.3g} m³/m; it must lie outside "
                    f"(the barrier's toe is at x = {x:g} and its body at x >= {x:g})"
                )
        for other, place, lying in standing:
            common = _common(outline, x, lying, place)
            if common > 1e-6:
                found.append(f"{field} overlaps {other} by {common:.3g} m²; barriers may touch but not overlap")
        standing.append((field, x, outline))
    return found


def _misplaced(scenario: Scenario, field: str, x: float, barrier: Barrier, outline: Array | None) -> list[str]:
    ground, found = scenario.ground, []
    if ground is None or ground.level:
        if isinstance(barrier.shape, OutlineShape) and outline is not None and outline[-1, 1] > HAIR:
            found.append(_in_the_air(field, outline, 0.0))
        return found
    first, last = ground.ends
    if not first <= x <= last:
        place = f"{field}.x_m = {x:g}" if isinstance(barrier, FurtherBarrier) else f"the toe of {field} at x = {x:g}"
        return [f"{place} lies beyond the ground's profile; it must be from {first:g} to {last:g}"]
    at = float(ground.height(x))
    if field == "barrier" and abs(at) > 1e-6 * max(1.0, float(np.ptp(ground.profile))):
        return [
            f"ground.profile_m is at y = {at:g} m at x = 0, where the barrier's toe stands; it must be at 0 there, or "
            "ground.origin_m name the place of the toe in the profile"
        ]
    if outline is None:
        return found
    heel, hair = outline[-1], 1e-6 * float(np.ptp(outline))
    below = float(ground.height(heel[0]))
    if heel[1] > below + hair:
        found.append(_in_the_air(field, outline, below))
    top = outline[int(np.argmax(outline[:, 1]))]
    if top[1] <= float(ground.height(top[0])):
        found.append(
            f"{field}.shape lies below the ground: its crest is at y = {top[1]:g} and the ground there at "
            f"y = {float(ground.height(top[0])):g}; the crest must lie above"
        )
    if isinstance(barrier.motion, Sliding) and not isinstance(barrier.shape, Wall):
        end = x + barrier.shape.base_crest_height[0]
        low, high = ground.range(x, end)
        if high - low > 1e-6:
            found.append(
                f"{field}.motion of the kind sliding needs level ground under the barrier, from x = {x:g} to {end:g}; "
                f"it rises by {high - low:.3g} m there (a slope of one angle is gravity.tilt_deg)"
            )
    return found


def _in_the_air(field: str, outline: Array, below: float) -> str:
    return (
        f"{field}.shape ends {outline[-1, 1] - below:.3g} m above the ground, at x = {outline[-1, 0]:g}; its heel must "
        f"lie on the ground, y = {below:g} there, or below it"
    )


def _misplaced_flow(scenario: Scenario, name: str, outline: Array) -> list[str]:
    """A body of flow below the ground."""
    ground = scenario.ground
    hair = HAIR * max(1.0, float(np.abs(outline).max()))
    if ground is None:
        return []
    if ground.level:
        lowest = float(outline[:, 1].min())
        # A hair below is rounding of the user's own arithmetic.
        if lowest < -hair:
            return [f"{name} reaches y = {lowest:g} m; it must stay on or above the ground, y >= 0"]
        return []
    (first, last), x = ground.ends, outline[:, 0]
    if x.min() < first - hair or x.max() > last + hair:
        return [
            f"{name} reaches from x = {x.min():g} to {x.max():g} m; it must stay within the ground's profile, from "
            f"{first:g} to {last:g}"
        ]
    worst, place = 0.0, np.zeros(2)
    for begin, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        low, high = sorted((begin[0], end[0]))
        between = ground.profile[(ground.profile[:, 0] > low) & (ground.profile[:, 0] < high), 0]
        on = np.concatenate([[begin[0], end[0]], between])
        share = (on - begin[0]) / (end[0] - begin[0]) if high > low else np.array([0.0, 1.0])
        y = begin[1] + share * (end[1] - begin[1])
        # At an upright step the flow may stand at its foot.
        under = ground.height(on, lower=True) - y
        deepest = int(np.argmax(under))
        if under[deepest] > worst:
            worst, place = float(under[deepest]), np.array([on[deepest], y[deepest]])
    if worst > 1e3 * hair:
        return [
            f"{name} reaches y = {place[1]:g} m at x = {place[0]:g}; it must stay on or above the ground, there "
            f"y >= {place[1] + worst:g}"
        ]
    return []


def overlap(flow: Array, outline: Array | None, x: float) -> float:
    """Area [m²] that a flow's outline shares with a barrier's; with all beyond `x` [m] where that is a wall."""
    if outline is None:
        inside = geometry.clip_half_plane(flow, (-1.0, 0.0), -x)
        return geometry.area(inside) if len(inside) else 0.0
    if len(outline) == 4 and _convex(outline):
        inside = geometry.clip_convex(flow, outline)
        return geometry.area(inside) if len(inside) else 0.0
    # A simple polygon is the sum of the triangles from one of its corners, those that turn the other way counted off.
    total = 0.0
    for second, third in pairwise(outline[1:]):
        triangle = np.array([outline[0], second, third])
        turned = geometry.signed_area(triangle)
        inside = geometry.clip_convex(flow, triangle) if turned else np.zeros((0, 2))
        total += math.copysign(geometry.area(inside), -turned) if len(inside) else 0.0
    return max(total, 0.0)


def _convex(outline: Array) -> bool:
    step = np.roll(outline, -1, axis=0) - outline
    after = np.roll(step, -1, axis=0)
    cross = step[:, 0] * after[:, 1] - step[:, 1] * after[:, 0]
    return bool((cross <= 0.0).all() or (cross >= 0.0).all())


def _common(one: Array | None, x: float, other: Array | None, place: float) -> float:
    if one is None and other is None:
        return math.inf
    if one is None:
        assert other is not None
        return overlap(other, None, x)
    return overlap(one, other, place)


def all_standing(scenario: Scenario) -> list[tuple[str, float, Barrier, Array | None]]:
    """Name, x of the toe [m], barrier and `standing_outline` of every barrier, from upstream to downstream."""
    return [
        (name, x, barrier, standing_outline(barrier, x, scenario.ground)) for name, x, barrier in scenario.all_barriers
    ]


def lowest_ground(scenario: Scenario, left: float, right: float) -> float:
    """Lowest y [m] of the ground between two x; 0 where it is level."""
    assert scenario.ground is not None
    if scenario.ground.level:
        return 0.0
    first, last = scenario.ground.ends
    return scenario.ground.range(max(left, first), min(right, last))[0]
