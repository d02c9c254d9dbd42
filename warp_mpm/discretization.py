"""Material points of a flow and the stress they start with. Pure NumPy."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_mpm import geometry
from warp_mpm.scenario import Inflow, Scenario, Skeleton
from warp_mpm.scenario.arriving import part_at
from warp_mpm.scenario.inflow import APPROACH
from warp_mpm.scenario.material import formulation_of
from warp_mpm.scenario.other_material import OtherMaterial
from warp_mpm.simulator.laws import LAWS

Array = NDArray[np.float64]

TOUCHING = 1e-3
"""Cells by which the underside of a body may lie off the surface that it stands on."""

SMALLEST_POINT = 0.25
"""Least volume of a material point, as a share of a whole one; a smaller piece is joined to a neighbour."""

SMALLEST_PART = 0.005
"""Least part of a cell, as a share of it, that has points of its own where a flow at rest is filled exactly. Contact
hardly holds nodes that lighter points alone reach: in a corner of the ground they would sink in."""

EQUAL_WEIGHTS: dict[int, tuple[float, ...]] = {
    2: (-math.sqrt(1 / 3), math.sqrt(1 / 3)),
    3: (-math.sqrt(1 / 2), 0.0, math.sqrt(1 / 2)),
    4: tuple(
        sign * math.sqrt((1 + other * math.sqrt(4 / 5)) / 3) for sign, other in ((-1, 1), (-1, -1), (1, -1), (1, 1))
    ),
}
"""Places in (-1, 1) whose mean is that of any polynomial of third degree (Chebyshev's quadrature), by their number."""

ACROSS, ACROSS_SHARES = 0.5 + math.sqrt(3 / 20) * np.array([-1.0, 0.0, 1.0]), np.array([5.0, 8.0, 5.0]) / 18.0
"""Three places in (0, 1) that integrate polynomials of fifth degree, and what each stands for (Gauss)."""

UPWARD = 0.5 + 0.5 * np.array(EQUAL_WEIGHTS[2])
"""Two places in (0, 1) for those of third degree."""


class Span(NamedTuple):
    """Points of one material that follow each other, from `begin` to before `end`."""

    material: int
    """Place among the flow's materials."""
    begin: int
    end: int


@dataclass(frozen=True)
class MaterialPoints:
    """Initial state of N material points; stresses in Pa, tension positive, pore pressure compression positive."""

    position: Array
    """[N, 2] m."""
    volume: Array
    """[N] m³/m."""
    solid_mass: Array
    """[N] kg/m."""
    liquid_mass: Array
    """[N] kg/m; zeros for a dry flow."""
    effective_stress: Array
    """[N, 4] xx, yy, zz, xy."""
    pore_pressure: Array
    """[N]; zeros for a dry flow."""
    velocity: Array
    """[N, 2] m/s, of both phases; zeros of what has yet to arrive."""
    entry: Array
    """[N] way of the inflow [m] at which a point comes into the approach, increasing among those of one material; -inf
    of what is there at the start, which comes first. Until then its x is the one that it would have had at way 0, were
    the flow to go on upstream, and its y that at the section."""
    pace: Array
    """[N] velocity of what arrives over the mean over its depth [-]; 0 of what is there at the start."""
    material: NDArray[np.int32]
    """[N] place of its material among those of the flow (`scenario.flow.materials`)."""

    @property
    def spans(self) -> list[Span]:
        """Parts of one material each, in their order, that are as long as can be."""
        ends = [*(np.flatnonzero(np.diff(self.material)) + 1).tolist(), len(self.material)]
        return [Span(int(self.material[begin]), begin, end) for begin, end in zip([0, *ends], ends, strict=False)]

    @property
    def there(self) -> int:
        """How many are there at the start; the others arrive."""
        return int((~self.waits).sum())

    @property
    def waits(self) -> NDArray[np.bool_]:
        """[N] whether a point has yet to arrive."""
        return self.entry > -math.inf


@dataclass(frozen=True)
class ArrivingPoints:
    """N points that arrive, as `MaterialPoints` has them."""

    position: Array
    volume: Array
    below: Array
    """[N] m below the surface."""
    entry: Array
    pace: Array
    way: Array
    """[N] way of the inflow [m] at which a point passes the section."""


@dataclass(frozen=True)
class _Part:
    """N points of one body of the scene."""

    position: Array
    volume: Array
    below: Array
    """[N] m below its surface."""
    slope: Array
    """[N] dy/dx of the long slope whose stress it has."""
    pore_pressure_ratio: Callable[[Array], float | Array | None]
    """λ_p at places x [M] [m], one or [M]; None: hydrostatic."""
    lateral_stress_ratio: float
    material: Skeleton
    velocity: tuple[float, float] | Array = (0.0, 0.0)
    """Of all, or [N, 2] [m/s]."""
    outline: geometry.Polygon | None = None
    """[V, 2] [m]; None of what arrives."""

    def borne(self, x: Array) -> float | Array:
        """What the liquid bears at places x [M] [m] of the weight above, as a density [kg/m³]: hydrostatic, or the
        given share of it."""
        ratio = self.pore_pressure_ratio(x)
        if ratio is None:
            return float(getattr(self.material, "liquid_density_kg_per_m3", 0.0))
        return ratio * self.material.density


def fill_polygon(
    polygon: geometry.Polygon, spacing: float, points_per_cell: int, *, at_rest: bool = False
) -> tuple[Array, Array]:
    """Material points that fill a polygon.

    A node of the background grid lies at the origin. Each cell is cut into `points_per_cell` equal squares, and every
    square that lies whole in the polygon gets a point at its middle. A square that the outline cuts gets a point at the
    centroid of its part inside, with that part's volume; a part smaller than `SMALLEST_POINT` of a square is joined to
    its largest neighbour. Volume and centre of volume are therefore those of the polygon, to rounding.

    What lies at rest on a slope, whose surface cuts the cells, must get from its points alone the forces that keep it
    there: then mass, weight and the force of a hydrostatic pressure come to each node exactly, see `_fill_exactly`. One
    point to a cell cannot do that.

    Args:
        polygon: simple polygon, vertices [V, 2] in metres.
        spacing: side of a grid cell [m].
        points_per_cell: a square number.
        at_rest: whether what is filled is at rest.

    Returns:
        positions [N, 2] in metres and volumes [N] in m³/m, ordered by column and row.

    Raises:
        ValueError: `points_per_cell` is no square number, or the spacing is not greater than 0.
    """
    per_side = math.isqrt(points_per_cell)
    if points_per_cell < 1 or per_side**2 != points_per_cell:
        raise ValueError(f"points_per_cell = {points_per_cell} must be a square number (1, 4, 9, ...)")
    if not spacing > 0.0:
        raise ValueError(f"spacing = {spacing} must be greater than 0")
    polygon = geometry.anticlockwise(np.asarray(polygon, dtype=float))
    if at_rest and per_side > 1 and _lies_on_a_slope(polygon):
        return _fill_exactly(polygon, spacing, per_side)
    side = spacing / per_side
    shape, middles, cut = _squares(polygon, side)
    volume = np.where(geometry.contains(polygon, middles), side * side, 0.0)
    position = middles.copy()
    for index in np.flatnonzero(cut):
        part = _part_in_square(polygon, middles[index], side)
        volume[index] = geometry.area(part)
        if volume[index] > 0.0:
            position[index] = geometry.centroid(part)

    _join_slivers(volume, position, shape, np.flatnonzero(cut), SMALLEST_POINT * side * side)
    filled = volume > 0.0
    return position[filled], volume[filled]


def _lies_on_a_slope(polygon: geometry.Polygon) -> bool:
    """Whether an edge of an anticlockwise polygon looks down and is neither level nor upright, but for rounding."""
    along = np.roll(polygon, -1, axis=0) - polygon
    rounding = 1e-9 * np.abs(along).max(axis=1)
    return bool(((along[:, 0] > rounding) & (np.abs(along[:, 1]) > rounding)).any())


def _fill_exactly(polygon: geometry.Polygon, spacing: float, per_side: int) -> tuple[Array, Array]:
    """Points that integrate over an anticlockwise polygon, cell by cell, what a flow at rest gives to the nodes.

    In a cell, a spline of the nodes is of second degree in x and in y, and so is its slope times a pressure that is
    linear, but for one degree more in one of them. A whole cell has `per_side`² points of equal volume, a part of a
    cell six to each trapezoid of it; a part of less than `SMALLEST_PART` is joined to a neighbour.
    """
    shape, middles, cut = _squares(polygon, spacing)
    whole = geometry.contains(polygon, middles)
    steps = 0.5 * spacing * np.array(EQUAL_WEIGHTS[per_side])
    lattice = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    share = whole.astype(float)
    parts = {}
    for index in map(int, np.flatnonzero(cut)):
        parts[index] = _part_in_square(polygon, middles[index], spacing)
        share[index] = geometry.area(parts[index]) / spacing**2
    filled = share > 1e-14  # what is less is rounding, and has no centre
    joined: dict[int, list[int]] = {}
    for index in map(int, np.flatnonzero(filled & (share < SMALLEST_PART))):
        largest = _largest_neighbour(share, index, shape)
        if largest is not None and share[largest] >= SMALLEST_PART:
            joined.setdefault(largest, []).append(index)
            filled[index] = False
    positions, volumes = [], []
    for index in map(int, np.flatnonzero(filled)):
        if share[index] > 1.0 - 1e-12:
            position, volume = middles[index] + lattice, np.full(per_side**2, (spacing / per_side) ** 2)
        else:
            position, volume = _integrating(parts[index])
        if index in joined:
            own = volume.sum()
            more = share[joined[index]] * spacing**2
            off = np.array([geometry.centroid(parts[other]) for other in joined[index]]) - volume @ position / own
            position = position + more @ off / (own + more.sum())
            volume = volume * (1.0 + more.sum() / own)
        positions.append(position[volume > 0.0])
        volumes.append(volume[volume > 0.0])
    return np.concatenate(positions), np.concatenate(volumes)


def _integrating(part: geometry.Polygon) -> tuple[Array, Array]:
    """Points in a polygon that integrate polynomials of fourth degree over it: six to each of the trapezoids between
    lines through its corners, upright or level, of which there are fewer."""
    upright, level = _trapezoids(part), _trapezoids(part[:, ::-1])
    turned = len(level) < len(upright)
    x, low, high = np.moveaxis(level if turned else upright, 1, 0)[..., None]
    across = x[:, 0] + (x[:, 1] - x[:, 0]) * ACROSS
    begin = low[:, 0] + (low[:, 1] - low[:, 0]) * ACROSS
    height = high[:, 0] + (high[:, 1] - high[:, 0]) * ACROSS - begin
    position = np.stack(np.broadcast_arrays(across[..., None], begin[..., None] + height[..., None] * UPWARD), axis=-1)
    volume = np.repeat((0.5 * (x[:, 1] - x[:, 0]) * ACROSS_SHARES * height).ravel(), len(UPWARD))
    return position.reshape(-1, 2)[:, :: -1 if turned else 1], volume


def _trapezoids(polygon: geometry.Polygon) -> Array:
    """Trapezoids [T, 3, 2] of a polygon: x of their upright sides, y of the lower edge there, y of the upper one."""
    found: list[Any] = []
    begin, end = polygon, np.roll(polygon, -1, axis=0)
    lines = np.unique(polygon[:, 0])
    for left, right in pairwise(lines):
        if right - left <= 1e-12 * (lines[-1] - lines[0]):
            continue
        middle = 0.5 * (left + right)
        spans = (begin[:, 0] < middle) != (end[:, 0] < middle)
        (x0, y0), (x1, y1) = begin[spans].T, end[spans].T
        slope = (y1 - y0) / (x1 - x0)
        edges = sorted(zip(y0 + slope * (left - x0), y0 + slope * (right - x0), strict=True), key=sum)
        found += [((left, right), low, high) for low, high in zip(edges[::2], edges[1::2], strict=True)]
    return np.array(found)


def _squares(polygon: geometry.Polygon, side: float) -> tuple[tuple[int, int], Array, NDArray[np.bool_]]:
    """Columns and rows of the squares about a polygon, their middles [N, 2] and which of them its outline may cut."""
    low = np.floor(polygon.min(axis=0) / side).astype(np.int64)
    high = np.ceil(polygon.max(axis=0) / side).astype(np.int64)
    columns, rows = np.maximum(high - low, 1)
    middle_x = (low[0] + np.arange(columns) + 0.5) * side
    middle_y = (low[1] + np.arange(rows) + 0.5) * side
    middles = np.stack(np.meshgrid(middle_x, middle_y, indexing="ij"), axis=-1).reshape(-1, 2)
    return (int(columns), int(rows)), middles, _cut_squares(polygon, middles, side)


def _part_in_square(polygon: geometry.Polygon, middle: Array, side: float) -> geometry.Polygon:
    """What of a polygon lies in a square."""
    square = 0.5 * side * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return geometry.clip_convex(polygon, middle + square)


def _cut_squares(polygon: geometry.Polygon, middles: Array, side: float) -> NDArray[np.bool_]:
    """Squares that the polygon's outline may pass through [N]: its edges come within half a diagonal of the middle."""
    reach = 0.5 * math.sqrt(2.0) * side * (1.0 + 1e-9)
    near = np.zeros(len(middles), dtype=bool)
    for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        along = end - start
        length_squared = float(along @ along)
        share = np.clip((middles - start) @ along / length_squared, 0.0, 1.0) if length_squared > 0.0 else 0.0
        nearest = start + np.multiply.outer(share, along)
        near |= np.hypot(*(middles - nearest).T) <= reach
    return near


def _join_slivers(
    volume: Array, position: Array, shape: tuple[int, int], candidates: NDArray[np.int64], least: float
) -> None:
    """Move the volume of pieces below `least` to their largest neighbour, in place, smallest piece first."""
    for index in sorted(candidates, key=lambda candidate: volume[candidate]):
        if not 0.0 < volume[index] < least:
            continue
        target = _largest_neighbour(volume, int(index), shape)
        if target is not None:
            joined = volume[target] + volume[index]
            position[target] = (volume[target] * position[target] + volume[index] * position[index]) / joined
            volume[target], volume[index] = joined, 0.0


def _largest_neighbour(volume: Array, index: int, shape: tuple[int, int]) -> int | None:
    """Of the squares about one, which holds most; those across a side come before those across a corner. None: all are
    empty."""
    columns, rows = shape
    column, row = divmod(index, rows)
    for steps in (((-1, 0), (1, 0), (0, -1), (0, 1)), ((-1, -1), (-1, 1), (1, -1), (1, 1))):
        neighbours = [
            (column + i) * rows + row + j for i, j in steps if 0 <= column + i < columns and 0 <= row + j < rows
        ]
        target = max(neighbours, key=lambda neighbour: volume[neighbour], default=index)
        if target != index and volume[target] > 0.0:
            return target
    return None


def arriving_points(inflow: Inflow, spacing: float, points_per_cell: int) -> ArrivingPoints:
    """Material points of all that arrives, in the order in which they come into the approach.

    Drawn as it passes the section, the flow is cut into columns as wide as a point, and these into rows from its
    underside on; the top row of a column gets what is left, joined to the row below where that is less than
    `SMALLEST_POINT` of a whole point. What is too low for a point of its own is added to the next column. The volume is
    therefore that of the table, to rounding.

    With a velocity that varies over the depth, a point of pace f stands for f of its column's volume, and points of a
    row lie f times as far apart as it passes: columns are narrower by the greatest pace, so that no row is thin.

    Args:
        inflow: what arrives.
        spacing: side of a grid cell [m].
        points_per_cell: a square number.
    """
    side = spacing / math.isqrt(points_per_cell)
    way, volume, _ = inflow.profile
    width = side / inflow.greatest_pace
    edges = np.arange(0.0, way[-1] + width, width)
    moving = np.concatenate([[True], np.diff(way) > 0.0])  # where the flow stands still, nothing passes
    until = np.interp(edges, way[moving], volume[moving])
    columns = np.diff(until)
    least = SMALLEST_POINT * side * width
    for place in range(len(columns) - 1):
        if columns[place] < least:
            columns[place + 1] += columns[place]
            columns[place] = 0.0
    if len(columns) > 1 and columns[-1] < least:
        last = int(np.flatnonzero(columns[:-1]).max(initial=0))
        columns[last] += columns[-1]
        columns[-1] = 0.0
    height, middle, bottom, top = [], [], [], []
    for column in np.flatnonzero(columns):
        depth = columns[column] / width
        rows = max(math.floor(depth / side + 1.0 - SMALLEST_POINT), 1)
        low = side * np.arange(rows)
        high = np.append(low[1:], depth)
        middle.append(np.full(rows, edges[column] + 0.5 * width))
        height.append(np.full(rows, depth))
        bottom.append(low)
        top.append(high)
    low, high, depth, ways = (np.concatenate(part) for part in (bottom, top, height, middle))
    pace = inflow.paces(0.5 * (low + high) / depth)
    volumes = (high - low) * width * pace
    volumes *= inflow.volume / volumes.sum()
    start = inflow.x_m - pace * ways
    entry = ways - APPROACH * spacing / pace
    order = np.argsort(entry, kind="stable")
    position = np.stack([start, inflow.base + 0.5 * (low + high)], axis=1)
    below = depth - 0.5 * (low + high)
    return ArrivingPoints(position[order], volumes[order], below[order], entry[order], pace[order], ways[order])


def _time_of(inflow: Inflow, way: Array) -> Array:
    """Times [N] at which the flow has gone a way [N] [m]."""
    shares = np.linspace(0.0, 1.0, 33)[:-1]
    times = np.append((inflow.times[:-1, None] + np.diff(inflow.times)[:, None] * shares).ravel(), inflow.times[-1])
    ways = np.array([inflow.way(time) for time in times])
    moving = np.concatenate([[True], np.diff(ways) > 0.0])
    return np.interp(way, ways[moving], times[moving])


def _along_slope(slope: Array, stress: Array) -> tuple[Array, Array]:
    """cos² alpha [N] of slopes dy/dx [N], and the stress [N, 4] of a level layer, as that of one along the slope."""
    square = 1.0 / (1.0 + slope**2)
    lateral, vertical = square * stress[:, 0], square * stress[:, 1]
    xx = square * (lateral + slope**2 * vertical)
    yy = square * (vertical + slope**2 * lateral)
    xy = square * slope * (lateral - vertical)
    return square, np.stack([xx, yy, square * stress[:, 2], xy], axis=1)


def _shared_slope(scenario: Scenario, outline: geometry.Polygon, position: Array) -> Array:
    """Slope dy/dx [N] that a body's surface and the ground share at each of its points: the lesser of the two where
    both fall to one side."""
    if scenario.ground is None or scenario.ground.level:
        return np.zeros(len(position))
    surface, ground = geometry.surface_slope(outline, position), scenario.ground.slope(position[:, 0])
    return np.where(surface * ground > 0.0, np.sign(ground) * np.minimum(np.abs(surface), np.abs(ground)), 0.0)


def material_points(scenario: Scenario) -> MaterialPoints:
    """The scenario's flow as material points, with masses and initial stress: what is there at the start, what lies
    there, and what arrives, in this order.

    Geostatic start (paper, §2.2): along each vertical below the outline the pore pressure is hydrostatic, or the given
    share of the weight, constant or along the flow; the vertical effective stress carries the rest, and the horizontal
    ones are K0 times it. A body bears what stands on it, and its liquid the pressure of the liquid there.
    Gravity's component along the ground is left out of the initial stress.

    Over a profile the stress is that of a long slope of the angle alpha that surface and ground share, the lesser of
    the two where both fall to one side: normal to the slope, cos² alpha of what lies above, and K0 along it. Under a
    level surface it is the whole, whatever the ground: a pond is at rest. What arrives has the slope of the ground.
    """
    flow, numerics = scenario.flow, scenario.numerics
    parts: list[_Part] = []
    lateral = flow.lateral_stress_ratio
    if flow.shape is not None:
        outline = flow.shape.polygon
        filled = _filled(scenario, outline, at_rest=not any(flow.velocity_m_per_s))
        velocity = _velocity(scenario, outline, *filled[:3])
        parts.append(_Part(*filled, flow.pore_pressure_ratio, lateral, flow.material, velocity, outline))
    for deposit in flow.deposits:
        material, outline = flow.material_of(deposit), deposit.shape.polygon
        own = _lateral(scenario, deposit, material)
        filled = _filled(scenario, outline, at_rest=True)
        parts.append(_Part(*filled, lambda _: None, own, material, outline=outline))
    there = sum(len(part.volume) for part in parts)
    entry, pace = np.full(there, -math.inf), np.zeros(there)
    if flow.inflow is not None:
        coming = arriving_points(flow.inflow, numerics.spacing_m, numerics.points_per_cell)
        for chosen, part in _by_material(scenario, flow.inflow, coming):
            parts.append(part)
            entry, pace = np.append(entry, coming.entry[chosen]), np.append(pace, coming.pace[chosen])
    stresses = [_initial_stress(scenario, part, parts) for part in parts]
    volume = np.concatenate([part.volume for part in parts])
    materials = flow.materials
    place = np.repeat([materials.index(part.material) for part in parts], [len(part.volume) for part in parts])
    return MaterialPoints(
        position=np.concatenate([part.position for part in parts]),
        volume=volume,
        solid_mass=np.array([material.solid_partial_density for material in materials])[place] * volume,
        liquid_mass=np.array([material.liquid_partial_density for material in materials])[place] * volume,
        effective_stress=np.concatenate([effective for effective, _ in stresses]),
        pore_pressure=np.concatenate([pore for _, pore in stresses]),
        velocity=np.concatenate([np.broadcast_to(part.velocity, (len(part.volume), 2)) for part in parts]),
        entry=entry,
        pace=pace,
        material=place.astype(np.int32),
    )


def _lateral(scenario: Scenario, body: OtherMaterial, material: Skeleton) -> float:
    """K0 of a body that may be of another material than the flow's."""
    if body.lateral_stress_coefficient is not None:
        return body.lateral_stress_coefficient
    return LAWS.named(material.law).lateral_stress_ratio(material) if body.other else scenario.flow.lateral_stress_ratio


def _by_material(
    scenario: Scenario, inflow: Inflow, coming: ArrivingPoints
) -> Iterator[tuple[NDArray[np.int64], _Part]]:
    """Of what arrives, the points [M] that are of one material and the part that they make, by material."""
    flow, parts = scenario.flow, scenario.flow.arriving
    time = _time_of(inflow, coming.way)
    place = part_at(parts, time, inflow.density(time))
    given = flow.pore_pressure_ratio(np.full(len(time), inflow.x_m))
    if inflow.pore_pressure_ratios is not None:
        given = np.interp(time, inflow.times, inflow.pore_pressure_ratios)
    for number, part in enumerate(parts):
        chosen = np.flatnonzero(place == number)
        ratio = None if formulation_of(part.material) == "dry" else given
        own = ratio[chosen] if isinstance(ratio, np.ndarray) else ratio
        slope = np.full(len(chosen), inflow.slope)
        lateral = _lateral(scenario, part.own, part.material)
        places = coming.position[chosen], coming.volume[chosen], coming.below[chosen], slope
        yield chosen, _Part(*places, _alike(own), lateral, part.material)


def _alike(ratio: float | Array | None) -> Callable[[Array], float | Array | None]:
    """A ratio that is known already, as if it were one of the place."""
    return lambda _: ratio


def _filled(scenario: Scenario, outline: geometry.Polygon, *, at_rest: bool) -> tuple[Array, Array, Array, Array]:
    """Position, volume, depth below the surface and shared slope of the points of a body that is there at the start."""
    numerics = scenario.numerics
    position, volume = fill_polygon(outline, numerics.spacing_m, numerics.points_per_cell, at_rest=at_rest)
    below = geometry.depth_below_surface(outline, position)
    return position, volume, below, _shared_slope(scenario, outline, position)


def _velocity(
    scenario: Scenario, outline: geometry.Polygon, position: Array, volume: Array, below: Array
) -> tuple[float, float] | Array:
    """Velocity [N, 2] of the points of the flow; one for all of them where it does not vary over the depth.

    The momentum is that of the stated velocity, to rounding: what the middles of the points miss of the profile's mean
    is made good by one factor.
    """
    flow = scenario.flow
    if not flow.sheared:
        return flow.velocity_m_per_s
    over = np.array([1.0, -1.0])
    above = geometry.depth_below_surface(outline * over, position * over)  # the underside, seen from below
    depth = above + below
    paces = flow.paces(np.divide(above, depth, out=np.ones(len(depth)), where=depth > 0.0))
    paces /= np.average(paces, weights=volume)
    return np.multiply.outer(paces, np.array(flow.velocity_m_per_s))


def _load(others: Sequence[_Part], surface: Array, downward: float, near: float) -> tuple[Array, Array]:
    """Total stress and pressure of the liquid [N] [Pa] that other bodies put on places [N, 2] of a body's surface."""
    total, pore = np.zeros(len(surface)), np.zeros(len(surface))
    for other in others:
        if other.outline is None:
            continue
        on = geometry.stands_on(other.outline, surface, near)
        if not on.any():
            continue
        # Just above the underside, where the surface straight above is that of the body that stands there.
        foot = surface[on] + [0.0, 2.0 * near]
        height = geometry.depth_below_surface(other.outline, foot) + 2.0 * near
        further = [one for one in others if one is not other]
        above, pore_above = _load(further, surface[on] + height[:, None] * [0.0, 1.0], downward, near)
        total[on] += above + other.material.density * downward * height
        if formulation_of(other.material) != "dry":
            pore[on] += pore_above + other.borne(foot[:, 0]) * downward * height
    return total, pore


def _initial_stress(scenario: Scenario, part: _Part, parts: Sequence[_Part]) -> tuple[Array, Array]:
    """Effective stress [N, 4] and pore pressure [N] of a part of the scene."""
    flow, material = scenario.flow, part.material
    pore_pressure = np.zeros(len(part.volume))
    effective_stress = np.zeros((len(part.volume), 4))
    if flow.initial_stress == "geostatic":
        depth, borne = part.below, part.borne(part.position[:, 0])
        downward = -scenario.gravity.vector[1]
        pore_pressure = borne * downward * depth
        vertical = -(material.density - borne) * downward * depth
        if part.outline is not None and len(parts) > 1:
            surface = part.position + depth[:, None] * [0.0, 1.0]
            others = [one for one in parts if one is not part]
            load, pore = _load(others, surface, downward, TOUCHING * scenario.numerics.spacing_m)
            pore *= formulation_of(material) != "dry"
            pore_pressure += pore
            vertical -= load - pore
        lateral = part.lateral_stress_ratio * vertical
        effective_stress[:, 0], effective_stress[:, 1], effective_stress[:, 2] = lateral, vertical, lateral
        if part.slope.any():
            square, effective_stress = _along_slope(part.slope, effective_stress)
            pore_pressure = square * pore_pressure
    return effective_stress, pore_pressure
