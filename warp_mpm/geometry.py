"""Plane geometry of a scene: the flow's outline, the barrier's outline, and what is measured on them.

A polygon is an array of vertices [V, 2] in metres, not closed (the last vertex joins the first), in either
orientation unless a function says otherwise. The x axis follows level ground, y is normal to it and points up; the toe
of the barrier's upstream face is the origin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Polygon = NDArray[np.float64]


def _next(vertices: Polygon) -> Polygon:
    """What follows each one, in turn: as `np.roll`, which takes ten times as long for so few."""
    return np.concatenate((vertices[1:], vertices[:1]))


def signed_area(polygon: Polygon) -> float:
    """Area [m²] of the polygon, positive when its vertices run anticlockwise (shoelace formula)."""
    if len(polygon) < 3:
        return 0.0
    # Measured from the first vertex, so that a polygon far from the origin keeps its digits.
    x, y = (polygon - polygon[0]).T
    return 0.5 * float(np.sum(x * _next(y) - _next(x) * y))


def area(polygon: Polygon) -> float:
    """Area [m²], that is volume per metre of width [m³/m]."""
    return abs(signed_area(polygon))


def centroid(polygon: Polygon) -> Polygon:
    """Centre of area [2] in metres; the mean of the vertices where the polygon has no area."""
    origin = polygon[0]
    x, y = (polygon - origin).T
    cross = x * _next(y) - _next(x) * y
    twice_area = float(np.sum(cross))
    if abs(twice_area) <= 1e-14 * float(np.ptp(x) * np.ptp(y)):
        return polygon.mean(axis=0)
    moment_x = float(np.sum((x + _next(x)) * cross))
    moment_y = float(np.sum((y + _next(y)) * cross))
    return origin + np.array([moment_x, moment_y]) / (3.0 * twice_area)


def anticlockwise(polygon: Polygon) -> Polygon:
    """The same polygon with its vertices in anticlockwise order."""
    return polygon if signed_area(polygon) >= 0.0 else polygon[::-1]


def clip_half_plane(polygon: Polygon, normal: tuple[float, float], offset: float) -> Polygon:
    """Part of `polygon` where `normal · x <= offset` (Sutherland–Hodgman).

    Where a concave polygon falls apart, the pieces stay joined by edges of zero width, so that area and centroid are
    still right.
    """
    if len(polygon) == 0:
        return polygon
    distance = polygon @ np.asarray(normal) - offset
    kept: list[NDArray[np.float64]] = []
    for index in range(len(polygon)):
        here, there = polygon[index - 1], polygon[index]
        d_here, d_there = distance[index - 1], distance[index]
        if (d_here <= 0.0) != (d_there <= 0.0):
            kept.append(here + (there - here) * (d_here / (d_here - d_there)))
        if d_there <= 0.0:
            kept.append(there)
    return np.array(kept).reshape(-1, 2)


def clip_convex(polygon: Polygon, window: Polygon) -> Polygon:
    """Part of `polygon` inside the convex polygon `window`."""
    window = anticlockwise(window)
    for start, end in zip(window, _next(window), strict=True):
        along = end - start
        outward = (float(along[1]), float(-along[0]))
        polygon = clip_half_plane(polygon, outward, float(np.dot(outward, start)))
        if len(polygon) == 0:
            break
    return polygon


def crossing_edges(polygon: Polygon) -> tuple[int, int] | None:
    """First pair of edges that cross or touch without being neighbours; None for a simple polygon.

    Edge i runs from vertex i to vertex i+1. O(V²) in time, O(V) in memory.
    """
    count = len(polygon)
    start, end = polygon, _next(polygon)

    def side(a: Polygon, b: Polygon, c: Polygon) -> NDArray[np.float64]:
        along, across = b - a, c - a
        cross = along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0]
        rounding = 1e-12 * np.hypot(along[..., 0], along[..., 1]) * np.hypot(across[..., 0], across[..., 1])
        return np.where(np.abs(cross) <= rounding, 0.0, np.sign(cross))

    for i in range(count - 2):
        others = np.arange(i + 2, count if i > 0 else count - 1)
        if len(others) == 0:
            continue
        a, b = start[i], end[i]
        c, d = start[others], end[others]
        s1, s2 = side(a, b, c), side(a, b, d)
        s3, s4 = side(c, d, a[None]), side(c, d, b[None])
        overlap = np.all(
            (np.maximum(c, d) >= np.minimum(a, b)) & (np.minimum(c, d) <= np.maximum(a, b)),
            axis=1,
        )
        hit = overlap & (s1 * s2 <= 0.0) & (s3 * s4 <= 0.0)
        if hit.any():
            return i, int(others[np.argmax(hit)])
    return None


def contains(polygon: Polygon, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of `points` [N, 2] lie inside the polygon (crossing number)."""
    inside = np.zeros(len(points), dtype=bool)
    x, y = points[:, 0], points[:, 1]
    for (x0, y0), (x1, y1) in zip(polygon, _next(polygon), strict=True):
        spans = (y0 > y) != (y1 > y)
        if spans.any():
            inside[spans] ^= x[spans] < x0 + (y[spans] - y0) * (x1 - x0) / (y1 - y0)
    return inside


def depth_below_surface(polygon: Polygon, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth [N] in metres of each point under the polygon's boundary straight above it.

    Under an overhang the boundary nearest above counts. A point on or outside the boundary has depth 0.
    """
    x, y = points[:, 0], points[:, 1]
    above = np.full(len(points), np.inf)
    for (x0, y0), (x1, y1) in zip(polygon, _next(polygon), strict=True):
        if x0 == x1:
            continue
        spans = (x >= min(x0, x1)) & (x <= max(x0, x1))
        height = y0 + (x[spans] - x0) * (y1 - y0) / (x1 - x0)
        above[spans] = np.minimum(above[spans], np.where(height >= y[spans], height, np.inf))
    return np.where(np.isfinite(above), above - y, 0.0)


def surface_slope(polygon: Polygon, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """dy/dx [N] of the polygon's boundary straight above each point, as `depth_below_surface` finds it; 0 on or outside
    the boundary."""
    x, y = points[:, 0], points[:, 1]
    above, slope = np.full(len(points), np.inf), np.zeros(len(points))
    for (x0, y0), (x1, y1) in zip(polygon, _next(polygon), strict=True):
        if x0 == x1:
            continue
        height = y0 + (x - x0) * (y1 - y0) / (x1 - x0)
        nearer = (x >= min(x0, x1)) & (x <= max(x0, x1)) & (height >= y) & (height < above)
        above, slope = np.where(nearer, height, above), np.where(nearer, (y1 - y0) / (x1 - x0), slope)
    return slope


def stands_on(polygon: Polygon, points: NDArray[np.float64], near: float) -> NDArray[np.bool_]:
    """Whether the polygon's underside lies at each of `points` [N, 2], to within `near` [m] of height."""
    x, y = points[:, 0], points[:, 1]
    found = np.zeros(len(points), dtype=bool)
    outline = anticlockwise(polygon)
    for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if x1 > x0:
            found |= (x >= x0) & (x <= x1) & (np.abs(y0 + (x - x0) * (y1 - y0) / (x1 - x0) - y) <= near)
    return found


def front_and_tail(depth: float, squares: float, distance: float) -> Polygon:
    """Outline of the paper's flow: a front at 45°, `squares` squares of side `depth`, a tail of three depths (§2.2).

    The toe of the front lies at x = -distance. Area (2 + squares) · depth²; `squares` need not be whole.
    """
    front = -distance - depth
    back = front - squares * depth
    vertices = [[-distance, 0.0], [front, depth], [back, depth], [back - 3.0 * depth, 0.0]]
    if squares == 0:
        del vertices[2]
    return np.array(vertices)


def trapezoid(base_width: float, crest_width: float, height: float) -> Polygon:
    """Outline [4, 2] of a symmetric barrier: toe at the origin, crest upstream, crest downstream, heel."""
    run = 0.5 * (base_width - crest_width)
    return np.array([[0.0, 0.0], [run, height], [run + crest_width, height], [base_width, 0.0]])


def maximum_depth(polygon: Polygon) -> float:
    """Greatest vertical thickness [m] of the polygon, measured at its vertices' verticals."""
    deepest = 0.0
    for x in np.unique(polygon[:, 0]):
        # Just beside a vertical edge as well as on it.
        nudge = 1e-9 * max(1.0, float(np.ptp(polygon[:, 0])))
        for line in (x - nudge, x + nudge):
            heights = []
            for (x0, y0), (x1, y1) in zip(polygon, _next(polygon), strict=True):
                if (x0 > line) != (x1 > line):
                    heights.append(y0 + (line - x0) * (y1 - y0) / (x1 - x0))
            heights.sort()
            for low, high in zip(heights[::2], heights[1::2], strict=True):
                deepest = max(deepest, high - low)
    return deepest
