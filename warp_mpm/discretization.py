"""Material points of a flow and the stress they start with. Pure NumPy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mpm import geometry
from warp_mpm.scenario import Scenario

Array = NDArray[np.float64]

SMALLEST_POINT = 0.25
"""Least volume of a material point, as a share of a whole one; a smaller piece is joined to a neighbour."""


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


def fill_polygon(polygon: geometry.Polygon, spacing: float, points_per_cell: int) -> tuple[Array, Array]:
    """Material points that fill a polygon.

    A node of the background grid lies at the origin. Each cell is cut into `points_per_cell` equal squares, and every
    square that lies whole in the polygon gets a point at its middle. A square that the outline cuts gets a point at the
    centroid of its part inside, with that part's volume; a part smaller than `SMALLEST_POINT` of a square is joined to
    its largest neighbour. Volume and centre of volume are therefore those of the polygon, to rounding.

    Args:
        polygon: simple polygon, vertices [V, 2] in metres.
        spacing: side of a grid cell [m].
        points_per_cell: a square number.

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
    side = spacing / per_side

    low = np.floor(polygon.min(axis=0) / side).astype(np.int64)
    high = np.ceil(polygon.max(axis=0) / side).astype(np.int64)
    columns, rows = np.maximum(high - low, 1)
    middle_x = (low[0] + np.arange(columns) + 0.5) * side
    middle_y = (low[1] + np.arange(rows) + 0.5) * side
    middles = np.stack(np.meshgrid(middle_x, middle_y, indexing="ij"), axis=-1).reshape(-1, 2)

    cut = _cut_squares(polygon, middles, side)
    volume = np.where(geometry.contains(polygon, middles), side * side, 0.0)
    position = middles.copy()
    square = 0.5 * side * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for index in np.flatnonzero(cut):
        part = geometry.clip_convex(polygon, middles[index] + square)
        volume[index] = geometry.area(part)
        if volume[index] > 0.0:
            position[index] = geometry.centroid(part)

    _join_slivers(volume, position, (int(columns), int(rows)), np.flatnonzero(cut), SMALLEST_POINT * side * side)
    filled = volume > 0.0
    return position[filled], volume[filled]


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
    columns, rows = shape
    for index in sorted(candidates, key=lambda candidate: volume[candidate]):
        if not 0.0 < volume[index] < least:
            continue
        column, row = divmod(int(index), rows)
        # Neighbours across a side come before those across a corner.
        for steps in (((-1, 0), (1, 0), (0, -1), (0, 1)), ((-1, -1), (-1, 1), (1, -1), (1, 1))):
            neighbours = [
                (column + i) * rows + row + j for i, j in steps if 0 <= column + i < columns and 0 <= row + j < rows
            ]
            target = max(neighbours, key=lambda neighbour: volume[neighbour], default=int(index))
            if target != index and volume[target] > 0.0:
                joined = volume[target] + volume[index]
                position[target] = (volume[target] * position[target] + volume[index] * position[index]) / joined
                volume[target], volume[index] = joined, 0.0
                break


def _along_slopes(scenario: Scenario, position: Array, stress: Array) -> tuple[Array, Array]:
    """cos² alpha [N] of the slope that the flow's surface and the ground share at each point, and the stress [N, 4] of
    a level layer, as that of one along the slope."""
    assert scenario.ground is not None
    surface = geometry.surface_slope(scenario.flow.polygon, position)
    ground = scenario.ground.slope(position[:, 0])
    shared = np.where(surface * ground > 0.0, np.sign(ground) * np.minimum(np.abs(surface), np.abs(ground)), 0.0)
    square = 1.0 / (1.0 + shared**2)
    lateral, vertical = square * stress[:, 0], square * stress[:, 1]
    xx = square * (lateral + shared**2 * vertical)
    yy = square * (vertical + shared**2 * lateral)
    xy = square * shared * (lateral - vertical)
    return square, np.stack([xx, yy, square * stress[:, 2], xy], axis=1)


def material_points(scenario: Scenario) -> MaterialPoints:
    """The scenario's flow as material points, with masses and initial stress.

    Geostatic start (paper, §2.2): along each vertical below the outline the pore pressure is hydrostatic, or the given
    share of the weight; the vertical effective stress carries the rest, and the horizontal ones are K0 times it.
    Gravity's component along the ground is left out of the initial stress.

    Over a profile the stress is that of a long slope of the angle alpha that surface and ground share, the lesser of
    the two where both fall to one side: normal to the slope, cos² alpha of what lies above, and K0 along it. Under a
    level surface it is the whole, whatever the ground: a pond is at rest.
    """
    flow, numerics = scenario.flow, scenario.numerics
    material = flow.material
    position, volume = fill_polygon(flow.polygon, numerics.spacing_m, numerics.points_per_cell)
    pore_pressure = np.zeros(len(volume))
    effective_stress = np.zeros((len(volume), 4))
    if flow.initial_stress == "geostatic":
        depth = geometry.depth_below_surface(flow.polygon, position)
        downward = -scenario.gravity.vector[1]
        liquid_density = getattr(material, "liquid_density_kg_per_m3", 0.0)
        # What the liquid bears of the weight above, as a density: hydrostatic, or the given share of it.
        share = flow.initial_pore_pressure_ratio
        borne = liquid_density if share is None else share * material.density
        pore_pressure = borne * downward * depth
        vertical = -(material.density - borne) * downward * depth
        lateral = flow.lateral_stress_ratio * vertical
        effective_stress[:, 0], effective_stress[:, 1], effective_stress[:, 2] = lateral, vertical, lateral
        if scenario.ground is not None and not scenario.ground.level:
            square, rotated = _along_slopes(scenario, position, effective_stress)
            pore_pressure, effective_stress = square * pore_pressure, rotated
    return MaterialPoints(
        position=position,
        volume=volume,
        solid_mass=material.solid_partial_density * volume,
        liquid_mass=material.liquid_partial_density * volume,
        effective_stress=effective_stress,
        pore_pressure=pore_pressure,
    )
