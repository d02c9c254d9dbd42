"""Outlines of bodies: polylines with the solid on their right. Pure NumPy.

Walking along the vertices, the solid lies on the right and the flow on the left. A closed outline is brought into that
order (clockwise) by itself. An open one goes on straight beyond its first and its last vertex, without end: a level
ground is two vertices, and a barrier's faces go on below the ground, where mirror images of the flow may lie.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_mpm import geometry

Array = NDArray[np.float64]

ENDLESS = 1e30
"""Length [m] that stands for no end."""

TIE = 1e-12
"""Relative difference of two distances that are the same corner's."""


FEW = 8
"""Pieces up to which all of an outline's are looked at."""

TILE = 16
"""Columns and rows of places that are looked at together first."""


@dataclass(frozen=True)
class Segments:
    """Straight pieces of an outline, G of them, each with the line that it lies on: normal · x = offset."""

    begin: Array
    """[G, 2] a vertex of the outline [m]."""
    along: Array
    """[G, 2] unit vector; the solid is on its right."""
    low: Array
    """[G] where the piece begins, along it from `begin` [m]: 0, or -ENDLESS."""
    high: Array
    """[G] where it ends."""
    normal: Array
    """[G, 2] out of the solid."""
    offset: Array
    """[G] [m]."""
    closed: bool

    def __len__(self) -> int:
        return len(self.offset)

    @property
    def numbers(self) -> Array:
        """All of a piece in a row [G, 9], in the order of the fields."""
        columns = (self.begin, self.along, self.low[:, None], self.high[:, None], self.normal, self.offset[:, None])
        return np.concatenate(columns, axis=1)

    @cached_property
    def hull(self) -> Array:
        """Offset [G] of those pieces on whose line's one side the whole solid lies; ENDLESS of the others."""
        ends = [self.begin, self.begin + np.where(self.high < ENDLESS, self.high, 1.0)[:, None] * self.along]
        if not self.closed:
            ends.append(self.begin[:1] - self.along[:1])
        corners = np.concatenate(ends)
        above = self.plane(corners).max(axis=1)
        return np.where(above <= 1e-9 * (1.0 + np.abs(corners).max()), self.offset, ENDLESS)

    def plane(self, place: Array) -> Array:
        """Distance [G, N] of `place` [N, 2] from the lines, negative on the solid's side."""
        x, y = place[:, 0], place[:, 1]
        return self.normal[:, :1] * x + self.normal[:, 1:] * y - self.offset[:, None]

    def nearest(self, place: Array) -> tuple[Array, Array, NDArray[np.int64]]:
        """Signed distance [N] (negative in the solid), outward normal [N, 2] and nearest piece [N] of `place` [N, 2].

        Beside a corner the normal is the direction from it; of its two pieces the one that faces the place more counts.
        """
        count = len(place)
        planes = self.plane(place)
        best, facing, over = np.full(count, np.inf), np.zeros(count), np.zeros(count)
        piece = np.zeros(count, dtype=np.int64)
        for k in range(len(self)):
            t = (place - self.begin[k]) @ self.along[k]
            beyond = np.maximum(np.maximum(self.low[k] - t, t - self.high[k]), 0.0)
            across = np.abs(planes[k])
            distance = np.where(beyond > 0.0, np.hypot(across, beyond), across)
            tie = (beyond + over > 0.0) & (np.abs(distance - best) <= TIE * distance)
            better = np.where(tie, across > facing, distance < best)
            best, facing = np.where(better, distance, best), np.where(better, across, facing)
            over, piece = np.where(better, beyond, over), np.where(better, k, piece)
        line = planes[piece, np.arange(count)]
        distance = np.where(over > 0.0, np.copysign(best, line), line)
        normal = self.normal[piece]
        corner = over > 0.0
        if corner.any():
            t = np.einsum("nd,nd->n", place - self.begin[piece], self.along[piece])
            foot = self.begin[piece] + np.clip(t, self.low[piece], self.high[piece])[:, None] * self.along[piece]
            length = np.where(distance == 0.0, 1.0, distance)
            normal = np.where(corner[:, None], (place - foot) / length[:, None], normal)
        return distance, normal, piece

    def nearest_within(self, place: Array, reach: float) -> tuple[Array, Array, NDArray[np.int64]]:
        """As `nearest` where the distance is less than `reach` [m]. Further away it may be infinite, with its sign, and
        normal and piece are of no matter: of a long profile only the pieces about a place are looked at."""
        if self.closed or len(self) <= FEW or (self.along[:, 0] < 0.0).any():
            return self.nearest(place)
        x, y = place[:, 0], place[:, 1]
        distance = np.copysign(np.inf, y - self._height(x))
        normal, piece = np.zeros(place.shape), np.zeros(len(place), dtype=np.int64)
        start, end = (self.begin[:, 0] + limit * self.along[:, 0] for limit in (self.low, self.high))
        stretch = np.floor(x / (16.0 * reach)).astype(np.int64)
        order = np.argsort(stretch, kind="stable")
        for members in np.split(order, np.flatnonzero(np.diff(stretch[order])) + 1):
            low, high = x[members].min() - reach, x[members].max() + reach
            own = np.flatnonzero((end >= low) & (start <= high))
            heights = [self._height_on(own, np.clip(at, low, high)) for at in (start[own], end[own])]
            near = members[(y[members] > np.min(heights) - reach) & (y[members] < np.max(heights) + reach)]
            found, across, number = self._some(own).nearest(place[near])
            close = np.abs(found) < reach
            at = near[close]
            distance[at], normal[at], piece[at] = found[close], across[close], own[number[close]]
        return distance, normal, piece

    def nearest_on(self, x: Array, y: Array, reach: float) -> tuple[Array, NDArray[np.int64]]:
        """Signed distance and nearest piece [columns, rows] of the places of a grid with `x` [columns] and `y` [rows]
        in rising order, as `nearest_within`. Of a large grid few places are near: whole tiles of it are told to lie
        further away than `reach` [m] by their middles."""
        (middle_x, half_x), (middle_y, half_y) = _tiles(x), _tiles(y)
        middles = np.stack(np.meshgrid(middle_x, middle_y, indexing="ij"), axis=-1).reshape(-1, 2)
        far = (reach + float(np.hypot(half_x, half_y))) * (1.0 + 1e-9)
        apart = self.nearest_within(middles, far)[0].reshape(len(middle_x), len(middle_y))
        distance = _spread(np.copysign(np.inf, apart), len(x), len(y))
        piece = np.zeros(distance.shape, dtype=np.int64)
        near = np.nonzero(_spread(np.abs(apart) < far, len(x), len(y)))
        if near[0].size:
            distance[near], _, piece[near] = self.nearest_within(np.column_stack([x[near[0]], y[near[1]]]), reach)
        return distance, piece

    def _some(self, which: NDArray[np.int64]) -> Segments:
        return Segments(
            self.begin[which],
            self.along[which],
            self.low[which],
            self.high[which],
            self.normal[which],
            self.offset[which],
            self.closed,
        )

    def _height_on(self, which: NDArray[np.int64], x: Array) -> Array:
        """y of some pieces' lines at `x`; of upright ones where they begin, whose other end is their neighbour's."""
        run = self.along[which, 0]
        rise = np.where(run > 0.0, self.along[which, 1] / np.where(run > 0.0, run, 1.0), 0.0)
        return self.begin[which, 1] + (x - self.begin[which, 0]) * rise

    def _height(self, x: Array) -> Array:
        """y at `x` of the surface of an open outline that leads along x."""
        piece = np.clip(np.searchsorted(self.begin[:, 0], x, side="right") - 1, 0, len(self) - 1)
        return self._height_on(piece, x)

    def grown(self, by: Array) -> Segments:
        """The outline with each piece moved outward by its own distance `by` [G] m and joined again at the corners."""
        offset = self.offset + by
        count, farthest = len(self), 20.0 * float(np.abs(by).max(initial=0.0))
        begin = self.begin + self.normal * by[:, None]
        end = self.begin + self.along * np.clip(self.high, 0.0, None)[:, None]
        end = np.where(self.high[:, None] < ENDLESS, end, self.begin) + self.normal * by[:, None]
        for k in range(count if self.closed else count - 1):
            after = (k + 1) % count
            (ax, ay), (bx, by_) = self.normal[k], self.normal[after]
            cross = ax * by_ - ay * bx
            corner = 0.5 * (end[k] + begin[after])
            if abs(cross) > 1e-9:
                met = np.array([by_ * offset[k] - ay * offset[after], ax * offset[after] - bx * offset[k]]) / cross
                if np.hypot(*(met - self.begin[after])) <= farthest:
                    corner = met
            end[k] = begin[after] = corner
        low = np.where(self.low > -ENDLESS, 0.0, self.low)
        length = np.maximum(np.einsum("gd,gd->g", end - begin, self.along), 0.0)
        return Segments(begin, self.along, low, np.where(self.high < ENDLESS, length, self.high), self.normal, offset,
                        self.closed)  # fmt: skip

    def box(self, left: float, right: float, bottom: float, top: float) -> Array | None:
        """Smallest box [4] (x from, x to, y from, y to) around the outline's part inside a window; None if outside."""
        found = []
        for k in range(len(self)):
            low, high = float(self.low[k]), float(self.high[k])
            for axis, (least, most) in enumerate(((left, right), (bottom, top))):
                start, step = float(self.begin[k, axis]), float(self.along[k, axis])
                if step == 0.0:
                    if not least <= start <= most:
                        low, high = 1.0, 0.0
                    continue
                first, last = sorted(((least - start) / step, (most - start) / step))
                low, high = max(low, first), min(high, last)
            if low <= high:
                found += [self.begin[k] + low * self.along[k], self.begin[k] + high * self.along[k]]
        if not found:
            return None
        (x0, y0), (x1, y1) = np.min(found, axis=0), np.max(found, axis=0)
        return np.array([x0, x1, y0, y1])


def _tiles(places: Array) -> tuple[Array, float]:
    """Middles of the tiles that rising places fall into, and half of the longest one's length."""
    first = np.arange(0, len(places), TILE)
    low, high = places[first], places[np.minimum(first + TILE, len(places)) - 1]
    return 0.5 * (low + high), 0.5 * float((high - low).max(initial=0.0))


def _spread(tiles: NDArray[Any], columns: int, rows: int) -> NDArray[Any]:
    """What is known of tiles, at each of their places [columns, rows]."""
    return np.repeat(np.repeat(tiles, TILE, axis=1)[:, :rows], TILE, axis=0)[:columns]


class Outline:
    """A polyline with the solid on its right.

    Args:
        vertices: [V, 2] in metres at t = 0. A closed outline needs three or more, an open one two or more.
        closed: the last vertex joins the first, in either order. An open outline goes on straight beyond its ends.

    Raises:
        ValueError: too few vertices, numbers that are not finite, an outline that crosses itself or encloses nothing.
    """

    def __init__(self, vertices: Sequence[Sequence[float]] | ArrayLike, *, closed: bool = True) -> None:
        corners = np.array(vertices, dtype=np.float64)
        least = 3 if closed else 2
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < least:
            raise ValueError(f"vertices of shape {corners.shape} make no outline; it needs {least} or more of [x, y]")
        if not np.isfinite(corners).all():
            raise ValueError("vertices must be finite numbers")
        if closed:
            crossing = geometry.crossing_edges(corners)
            if crossing is not None:
                raise ValueError(
                    f"vertices must not cross or touch themselves; the side after corner {crossing[0] + 1} meets "
                    f"the side after corner {crossing[1] + 1}"
                )
            if not geometry.area(corners) > 0.0:
                raise ValueError("vertices must enclose an area greater than 0")
            corners = geometry.anticlockwise(corners)[::-1]
        elif np.hypot(*(corners[1] - corners[0])) == 0.0 or np.hypot(*(corners[-1] - corners[-2])) == 0.0:
            raise ValueError("an open outline goes on beyond its ends; its first and last piece need a length")
        self.vertices: Array = np.ascontiguousarray(corners)
        self.closed = closed

    @cached_property
    def segments(self) -> Segments:
        """Its straight pieces; piece k runs from vertex k. One without length stands for a blunted corner, with a
        normal between its neighbours'."""
        begin = self.vertices if self.closed else self.vertices[:-1]
        end = np.roll(self.vertices, -1, axis=0) if self.closed else self.vertices[1:]
        step = end - begin
        length = np.hypot(step[:, 0], step[:, 1])
        normal = np.stack([-step[:, 1], step[:, 0]], axis=1) / np.where(length > 0.0, length, 1.0)[:, None] + 0.0
        for k in np.flatnonzero(length == 0.0):
            between = normal[k - 1] + normal[(k + 1) % len(normal)]
            normal[k] = between / math.hypot(*between)
        along = np.stack([normal[:, 1], -normal[:, 0]], axis=1) + 0.0
        low, high = np.zeros(len(length)), length.copy()
        if not self.closed:
            low[0], high[-1] = -ENDLESS, ENDLESS
        # From the lower end, where a scene's numbers are round.
        lower = np.where((end[:, 1] < begin[:, 1])[:, None], end, begin)
        return Segments(begin, along, low, high, normal, np.einsum("gd,gd->g", normal, lower), self.closed)

    def distance(self, place: ArrayLike) -> Array:
        """Signed distance [N] in metres of `place` [N, 2] from the outline at t = 0, negative inside the solid."""
        return self.segments.nearest(np.atleast_2d(np.asarray(place, dtype=np.float64)))[0]

    def normal(self, place: ArrayLike) -> Array:
        """Outward normal [N, 2] at the point of the outline that is nearest to `place` [N, 2]."""
        return self.segments.nearest(np.atleast_2d(np.asarray(place, dtype=np.float64)))[1]
