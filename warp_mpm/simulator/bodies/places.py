"""Places of contact: where along its outline a body acts on the grid.

At a place of contact a body sees the flow's velocity there, and its impulse goes to the same nodes with the same
weights, so that what it takes from the flow is what the flow takes from it.

A piece of outline along a line of cell corners acts on mirrored pairs of nodes, of which the mean is the velocity at
the surface itself, and on the nodes a row further back, one by one. Any other acts at points of the surface, with the
splines' own weights, two to a cell; where `Body.dense_corners` says so, three to a cell next to a corner.

Most pairs on level ground share no node with another place: each is done on its own. Where places share nodes, at an
inclined face and in a corner, and where their body slides, they are joined: their impulses are found together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mpm.grid import GridLayout
from warp_mpm.kernels.layout import BLOCK

from .body import Body, Driven, Sliding
from .outline import ENDLESS, Array, Segments
from .side import Side

PER_CELL = 2.0
"""Points of a surface per side of a cell."""

PER_CELL_AT_CORNERS = 3.0
"""The same next to a corner of an outline that has them closer there. What a fluid at rest gives to the nodes of a
corner cannot be borne whole by two, and drives a current along the surface; by three it can."""

NEXT_TO_CORNERS = 2.0
"""Cells on either side of such a corner."""

SINGLE, DOUBLE = np.array([0.0, 1.0, 0.0]), np.array([0.5, 0.5, 0.0])
"""Weights of the middle node alone, and of a mirrored pair."""

ROWS = 2.0
"""Cells behind a piece along the grid in which nodes act: no point gets deeper."""


@dataclass(frozen=True)
class Places:
    """C places of contact of all bodies."""

    position: NDArray[np.float64]
    """[C, 2] at t = 0 [m]; in space [C, 3], as normals are."""
    first: NDArray[np.int32]
    """[C] lowest of the 3 x 3 nodes, in space of 3 x 3 x 3, counted through; -1 where it follows from the position in
    every step."""
    weight_x: NDArray[np.float64]
    """[C, 3]"""
    weight_y: NDArray[np.float64]
    """[C, 3]"""
    normal: NDArray[np.float64]
    """[C, 2] out of the body."""
    piece: NDArray[np.int32]
    """[C] of the body's outline."""
    body: NDArray[np.int32]
    """[C]"""
    length: NDArray[np.float64]
    """[C] of the surface for which it stands [m]; 0 of nodes further back."""
    weight_z: NDArray[np.float64]
    """[C, 3] in space, else [C, 0]."""

    def __len__(self) -> int:
        return len(self.first)

    def chosen(self, which: NDArray[Any]) -> Places:
        """Some of them, or all in another order."""
        return Places(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    @staticmethod
    def together(parts: Sequence[Places]) -> Places:
        return Places(*(np.concatenate([getattr(p, name) for p in parts]) for name in Places.__dataclass_fields__))


def places_of(bodies: Sequence[Body], grid: GridLayout, passing: Sequence[bool]) -> Places:
    """Places of contact of all bodies, in the order of the bodies and along their outlines.

    Args:
        bodies: all that the flow meets.
        grid: on which they act.
        passing: of each body whether it moves relative to the grid.
    """
    found = []
    for number, body in enumerate(bodies):
        on_grid = np.zeros(len(body.outline.segments), dtype=bool)
        if not passing[number]:
            on_grid = along_grid(body.outline.segments, grid)
            if on_grid.any():
                found.append(_pairs(body, number, grid, on_grid))
        others = [b for k, b in enumerate(bodies) if k != number and not passing[number] and not passing[k]]
        found.append(_points(body, number, grid, ~on_grid, others, passing[number]))
    places = Places.together(found)
    return places if grid.layers == 1 else _in_space(places, bodies, grid)


def _in_space(section: Places, bodies: Sequence[Body], grid: GridLayout) -> Places:
    """Those of the section in every layer that has one on either side, and those of the sides."""
    layers = np.arange(1, grid.layers - 1)
    found = []
    for number, body in enumerate(bodies):
        if isinstance(body.outline, Side):
            found.append(_of_side(body.outline, number, grid))
            continue
        own = section.chosen(section.body == number)
        count, times = len(own), len(layers)
        z = np.repeat(grid.front + (layers + 0.5) * grid.spacing, count)
        first = np.tile(own.first, times) + np.repeat((layers - 1) * grid.columns * grid.rows, count)
        found.append(
            Places(
                np.column_stack([np.tile(own.position, (times, 1)), z]),
                first.astype(np.int32),
                np.tile(own.weight_x, (times, 1)),
                np.tile(own.weight_y, (times, 1)),
                np.column_stack([np.tile(own.normal, (times, 1)), np.zeros(len(z))]),
                np.tile(own.piece, times),
                np.tile(own.body, times),
                np.tile(own.length, times),
                np.tile(SINGLE, (len(z), 1)),
            )
        )
    return Places.together(found)


def _of_side(side: Side, number: int, grid: GridLayout) -> Places:
    """Mirrored pairs of nodes at a plane across z, and the nodes a row further back, as `_pairs`."""
    x, y = grid.node_positions()
    columns, rows = np.meshgrid(np.arange(1, grid.columns - 1), np.arange(1, grid.rows - 1), indexing="ij")
    i, j = columns.ravel(), rows.ravel()
    found = []
    for layer in range(1, grid.layers - 1):
        z = grid.front + (layer + 0.5) * grid.spacing
        distance = (z - side.z) * side.facing / grid.spacing
        if not -ROWS < distance < 0.0:
            continue
        paired = distance > -1.0
        lowest = min(layer, layer + side.facing) if paired else layer - 1
        count = len(i)
        found.append(
            Places(
                np.column_stack([x[i], y[j], np.full(count, z)]),
                ((lowest * grid.columns + i - 1) * grid.rows + j - 1).astype(np.int32),
                np.tile(SINGLE, (count, 1)),
                np.tile(SINGLE, (count, 1)),
                np.tile([0.0, 0.0, float(side.facing)], (count, 1)),
                np.zeros(count, dtype=np.int32),
                np.full(count, number, dtype=np.int32),
                np.zeros(count),
                np.tile(DOUBLE if paired else SINGLE, (count, 1)),
            )
        )
    return Places.together(found)


def sharing(places: Places, bodies: Sequence[Body], grid: GridLayout, passing: Sequence[bool]) -> NDArray[np.bool_]:
    """Which places are joined to others [C]: they share a node with one, or may come to do so, or their body has
    corners or slides."""
    if any(passing):
        return np.ones(len(places), dtype=bool)
    spacing = grid.spacing
    first = places.first.astype(np.int64)
    free = first < 0
    i = np.floor((places.position[:, 0] - grid.left) / spacing).astype(np.int64) - 1
    j = np.floor((places.position[:, 1] - grid.bottom) / spacing).astype(np.int64) - 1
    first = np.where(free, i * grid.rows + j, first)
    offset = (np.arange(3)[:, None] * grid.rows + np.arange(3)[None, :]).ravel()
    acts = (places.weight_x[:, :, None] * places.weight_y[:, None, :]).reshape(-1, 9) != 0.0
    if grid.layers > 1:
        offset = (np.arange(3)[:, None] * grid.columns * grid.rows + offset).ravel()
        acts = (places.weight_z[:, :, None] * acts[:, None, :]).reshape(-1, 27) != 0.0
    acts[free] = True
    node = first[:, None] + offset
    nodes = grid.layers * grid.columns * grid.rows
    inside = acts & (node >= 0) & (node < nodes)
    count = np.bincount(node[inside], minlength=nodes)
    shared = (inside & (count[np.clip(node, 0, len(count) - 1)] > 1)).any(axis=1)
    whole = np.array([isinstance(body.motion, Sliding) or len(body.outline.segments) > 1 for body in bodies])
    return shared | whole[places.body] | free


def along_grid(pieces: Segments, grid: GridLayout) -> NDArray[np.bool_]:
    """Pieces [G] that lie along a line of cell corners."""
    straight = np.abs(np.abs(pieces.normal).sum(axis=1) - 1.0) < 1e-12
    origin = np.abs(pieces.normal) @ np.array([grid.left, grid.bottom])
    cells = (pieces.offset * pieces.normal.sum(axis=1) - origin) / grid.spacing
    return straight & (np.abs(cells - np.round(cells)) < 1e-6)


def _pairs(body: Body, number: int, grid: GridLayout, on_grid: NDArray[np.bool_]) -> Places:
    """Mirrored pairs of nodes at the pieces along the grid, and the nodes a row further back."""
    x, y = grid.node_positions()
    distance, nearest = body.outline.segments.nearest_on(x, y, 3.0 * grid.spacing)
    distance /= grid.spacing
    node = np.argwhere((distance < 0.0) & (distance > -ROWS) & on_grid[nearest])
    at = (node[:, 0], node[:, 1])
    piece, normal = nearest[at], body.outline.segments.normal[nearest[at]]
    step = np.rint(normal).astype(np.int64)
    paired = distance[at] > -1.0
    margin = ((node >= 1) & (node < (grid.columns - 2, grid.rows - 2))).all(axis=1)
    node, piece, normal, step, paired = node[margin], piece[margin], normal[margin], step[margin], paired[margin]
    low = np.where(paired[:, None], np.minimum(node, node + step), node)
    # The middle one of three is the node; with its mirror image, the first two or the last two.
    along_x, along_y = paired & (step[:, 0] != 0), paired & (step[:, 1] != 0)
    first = low - np.stack([~along_x, ~along_y], axis=1)
    return Places(
        np.column_stack([x[node[:, 0]], y[node[:, 1]]]),
        (first[:, 0] * grid.rows + first[:, 1]).astype(np.int32),
        np.where(along_x[:, None], DOUBLE, SINGLE),
        np.where(along_y[:, None], DOUBLE, SINGLE),
        normal,
        piece.astype(np.int32),
        np.full(len(node), number, dtype=np.int32),
        np.where(paired, grid.spacing, 0.0),
        np.zeros((len(node), 0)),
    )


def _points(
    body: Body, number: int, grid: GridLayout, wanted: NDArray[np.bool_], others: Sequence[Body], passing: bool
) -> Places:
    """Points of the pieces that do not lie along the grid."""
    pieces, spacing = body.outline.segments, grid.spacing
    step = spacing / PER_CELL
    low = np.array([grid.left, grid.bottom])
    high = low + spacing * np.array([grid.columns, grid.rows])
    reach = float((high - low).sum())
    sideways = not (isinstance(body.motion, Driven) and any(vy for _, vy in body.motion.velocities))
    position, piece, length = [np.zeros((0, 2))], [np.zeros(0, dtype=np.int32)], [np.zeros(0)]
    for k in np.flatnonzero(wanted):
        middle = float((0.5 * (low + high) - pieces.begin[k]) @ pieces.along[k])
        window = (middle - reach, middle + reach)
        stretches = [(float(pieces.low[k]), float(pieces.high[k]))]
        if not passing and others:
            stretches = _free_stretches(pieces.begin[k], pieces.along[k], stretches[0], window, grid, others)
        for stretch in stretches:
            s, apart = _laid(stretch, window, step)
            if body.dense_corners:
                s, apart = _closer(s, apart, stretch, spacing)
            at = pieces.begin[k] + s[:, None] * pieces.along[k]
            near = ((at > low + 2.0 * spacing) & (at < high - 2.0 * spacing)).all(axis=1)
            if passing:
                # Anywhere along x, and along y too where it moves that way.
                near = (at[:, 1] > low[1] + 2.0 * spacing) & (at[:, 1] < high[1] - 2.0 * spacing) | (not sideways)
            position.append(at[near])
            piece.append(np.full(int(near.sum()), k, dtype=np.int32))
            length.append(apart[near])
    places, of = np.concatenate(position), np.concatenate(piece)
    count = len(of)
    return Places(
        places,
        np.full(count, -1, dtype=np.int32),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        pieces.normal[of],
        of,
        np.full(count, number, dtype=np.int32),
        np.concatenate(length),
        np.zeros((count, 0)),
    )


def _laid(stretch: tuple[float, float], window: tuple[float, float], step: float) -> tuple[NDArray[Any], Array]:
    """Places along a piece, and the length for which each stands: a step, the first and last half of that from its
    ends; within the window where it has none."""
    start, end = stretch
    begins, stops = start > -ENDLESS, end < ENDLESS
    length = (end if stops else window[1]) - (start if begins else window[0])
    if length <= 0.0:
        return np.zeros(0), np.zeros(0)
    count = max(1, math.ceil(length / step - 1e-9))
    apart = length / count if begins and stops else step
    places: NDArray[Any] = (np.arange(count) + 0.5) * apart
    lengths = np.full(count, apart)
    if begins:
        return start + places, lengths
    return ((end - places)[::-1] if stops else window[0] + places), lengths


def _closer(
    places: NDArray[Any], lengths: Array, stretch: tuple[float, float], spacing: float
) -> tuple[NDArray[Any], Array]:
    """The same, divided as `PER_CELL_AT_CORNERS` says next to the ends of the piece."""
    if len(places) == 0:
        return places, lengths
    edges = np.append(places - 0.5 * lengths, places[-1] + 0.5 * lengths[-1])
    at_corner = np.zeros(len(places), dtype=bool)
    for end in stretch:
        at_corner |= np.abs(places - end) < NEXT_TO_CORNERS * spacing
    parts = []
    for group in np.split(np.arange(len(places)), np.flatnonzero(np.diff(at_corner)) + 1):
        begin, end = edges[group[0]], edges[group[-1] + 1]
        count = len(group)
        if at_corner[group[0]]:
            count = math.ceil((end - begin) * PER_CELL_AT_CORNERS / spacing - 1e-9)
        parts.append(np.linspace(begin, end, count + 1)[:-1])
    edges = np.append(np.concatenate(parts), edges[-1])
    return 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)


def _free_stretches(
    begin: Array,
    along: Array,
    whole: tuple[float, float],
    window: tuple[float, float],
    grid: GridLayout,
    others: Sequence[Body],
) -> list[tuple[float, float]]:
    """Where along a piece no other body is. Places are laid from there: friction in the cell of a barrier's toe depends
    on how far from the toe the first one is, and would scatter with the spacing if that did."""

    def free(s: NDArray[Any]) -> NDArray[np.bool_]:
        at = begin + s[:, None] * along
        apart = [other.outline.segments.nearest_within(at, grid.spacing)[0] for other in others]
        return np.asarray(np.min(apart, axis=0) > -1e-9 * grid.spacing)

    start, end = max(whole[0], window[0]), min(whole[1], window[1])
    if end <= start:
        return []
    s = np.linspace(start, end, max(3, math.ceil(4.0 * PER_CELL * (end - start) / grid.spacing) + 1))
    is_free = free(s)
    turns = np.flatnonzero(is_free[1:] != is_free[:-1])
    occupied, open_ = np.where(is_free[turns], s[turns + 1], s[turns]), np.where(is_free[turns], s[turns], s[turns + 1])
    for _ in range(60 if len(turns) else 0):
        between = 0.5 * (occupied + open_)
        at_free = free(between)
        open_, occupied = np.where(at_free, between, open_), np.where(at_free, occupied, between)
    # To a millionth of a cell, so that rounding in the bisection, which hangs on the domain, makes no other run.
    open_ = np.round(open_ / (1e-6 * grid.spacing)) * (1e-6 * grid.spacing)
    ends = [*([whole[0]] if is_free[0] else []), *open_, *([whole[1]] if is_free[-1] else [])]
    return list(zip(map(float, ends[::2]), map(float, ends[1::2]), strict=True))


def by_block(places: Places, grid: GridLayout) -> tuple[NDArray[Any], NDArray[np.int32], NDArray[np.int32]]:
    """An order of the places by the block of the grid that holds their first node, those blocks, and where each one's
    places begin."""
    # In space the first node lies a layer before those that act.
    first = places.first + (grid.columns * grid.rows if grid.layers > 1 else 0)
    i, j = first // grid.rows, first % grid.rows
    blocks = ((i + 1) // BLOCK) * (grid.rows // BLOCK) + (j + 1) // BLOCK
    order = np.argsort(blocks, kind="stable")
    block, start = np.unique(blocks[order], return_index=True)
    return order, block.astype(np.int32), np.append(start, len(places)).astype(np.int32)


def neighbours(places: Places) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The places before and after each one along its piece [C]; itself at an end, and where it acts on a pair."""
    number = np.arange(len(places))
    free = places.first < 0
    along = free[:-1] & free[1:] & (places.body[:-1] == places.body[1:]) & (places.piece[:-1] == places.piece[1:])
    return number - np.append(False, along)[: len(places)], number + np.append(along, False)[: len(places)]


def coloured(
    places: Places, bodies: Sequence[Body], grid: GridLayout, passing: Sequence[bool]
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """An order of the places by colour, and where each colour begins in it: places of one colour share no node.

    Each place takes the first colour that none before it has within three cells, or any place of a body that moves
    relative to its own.
    """
    reach = 3.0 * grid.spacing * (1.0 - 1e-9)
    colour = np.full(len(places), -1)
    apart = np.array([k if passes else -1 for k, passes in enumerate(passing)])[places.body]
    for e in range(len(places)):
        near = (np.abs(places.position[:e] - places.position[e]) < reach).all(axis=1) | (apart[:e] != apart[e])
        taken = np.unique(colour[:e][near])
        free = np.flatnonzero(taken != np.arange(len(taken)))
        colour[e] = free[0] if len(free) else len(taken)
    order = np.argsort(colour, kind="stable")
    count = int(colour.max(initial=-1)) + 1
    return order, np.searchsorted(colour[order], np.arange(count + 1)).astype(np.int32)
