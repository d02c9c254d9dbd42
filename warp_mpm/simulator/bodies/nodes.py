"""The contact rule: through which nodes of the grid a body acts, with which normal, on behalf of which surface.

This is the one place that decides it. The kernels take what is found here (`Contact`): a place of contact is a node, or
a mirrored pair of nodes, with a normal and a surface.

A piece of outline along a line of cell corners acts on mirrored pairs, exactly at its place. Any other acts on the
nodes inside it and within half a cell outside: the splines then vanish between half a cell outside and half a cell
inside, without bias. A node belongs to the piece nearest to it; those deeper than the flow reaches are left out.

A node outside an inclined piece acts only at a cell or more below the crest: nearer, its splines reach over the crest
and would hold up what flows over. The sliding distance would then hang, by a tenth, on where the crest's corner happens
to lie among the nodes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mpm.grid import GridLayout
from warp_mpm.kernels.layout import BLOCK

from .body import Body
from .outline import Segments

DEEP, SHALLOW = 4.0, 2.0
"""Cells behind the outline in which nodes act: inclined, and straight along the grid, where no point gets as deep."""


@dataclass(frozen=True)
class Acting:
    """The outline behind whose pieces nodes act."""

    outline: Segments
    aligned: NDArray[np.bool_]
    """[G] along a line of cell corners: acts on mirrored pairs."""
    crest: NDArray[np.float64]
    """[G] height from a cell below which on no node outside the piece acts [m]."""
    depth: float
    """[cells]."""


@dataclass(frozen=True)
class ContactNodes:
    """Places of contact of one body, C of them, in groups of those whose nodes share a block of the grid."""

    node: NDArray[np.int32]
    """[C, 2]"""
    mirror: NDArray[np.int32]
    """[C, 2] the node's mirror image in the surface; (-1, -1) where the node stands alone."""
    normal: NDArray[np.float64]
    """[C, 2] out of the body."""
    surface: NDArray[np.int32]
    """[C] which of the body's surfaces."""
    block: NDArray[np.int32]
    """[groups]"""
    start: NDArray[np.int32]
    """[groups + 1]"""


def acting_outline(body: Body, grid: GridLayout, *, passing: bool) -> Acting:
    """The body's outline, its pieces that do not lie on lines of cell corners moved out by half a cell.

    Args:
        body: whose.
        grid: on which it acts.
        passing: it moves relative to the grid, so that only an edge of the domain is brought to a line, by the kernel.
    """
    pieces, spacing = body.outline.segments, grid.spacing
    along_grid = np.abs(np.abs(pieces.normal).sum(axis=1) - 1.0) < 1e-12
    cells = pieces.offset / spacing
    aligned = along_grid & (np.abs(cells - np.round(cells)) < 1e-6)
    by = np.where(aligned, 0.0, 0.5 * spacing)
    if body.edge:
        # Measured from the edges of the grid, as the kernel does.
        sign = pieces.normal.sum(axis=1)
        origin = np.abs(pieces.normal) @ np.array([grid.left, grid.bottom])
        line = np.floor((pieces.offset * sign - origin) / spacing + 0.5) * spacing + origin
        aligned, by = np.ones_like(aligned), np.zeros_like(by) if passing else line * sign - pieces.offset
    elif passing:
        aligned, by = np.zeros_like(aligned), np.full_like(by, 0.5 * spacing)
    crest = np.where(aligned, math.inf, pieces.crest())
    return Acting(pieces.grown(by), aligned, crest, SHALLOW if aligned.all() else DEEP)


def contact_nodes(body: Body, grid: GridLayout) -> ContactNodes:
    """Places of contact of a body that rests as seen from the grid."""
    spacing = grid.spacing
    acting = acting_outline(body, grid, passing=False)
    touching = np.zeros((grid.columns, grid.rows), dtype=bool)
    piece = np.zeros((grid.columns, grid.rows), dtype=np.int64)
    depth = np.full((grid.columns, grid.rows), np.inf)
    right, top = grid.left + grid.columns * spacing, grid.bottom + grid.rows * spacing
    box = acting.outline.box(grid.left, right, grid.bottom, top)
    if box is not None:
        reach = (acting.depth + 1.0) * spacing
        columns = _cells(box[0] - reach - grid.left, box[1] + reach - grid.left, spacing, grid.columns)
        rows = _cells(box[2] - reach - grid.bottom, box[3] + reach - grid.bottom, spacing, grid.rows)
        x, y = grid.node_positions()
        place = np.stack(np.meshgrid(x[columns], y[rows], indexing="ij"), axis=-1)
        distance, _, nearest = acting.outline.nearest(place.reshape(-1, 2))
        distance /= spacing
        acts = (distance < 0.0) & (distance > -acting.depth)
        outside = ~acting.aligned[nearest] & (distance > -0.5)
        acts &= ~(outside & (place.reshape(-1, 2)[:, 1] > acting.crest[nearest] - spacing * (1.0 - 1e-9)))
        window = place.shape[:2]
        touching[columns, rows], piece[columns, rows] = acts.reshape(window), nearest.reshape(window)
        depth[columns, rows] = distance.reshape(window)
    node = np.argwhere(touching).astype(np.int32)
    piece_of, normal = piece[touching], acting.outline.normal[piece[touching]]
    mirror = np.full_like(node, -1)
    image = node + np.rint(normal).astype(np.int32)
    on_grid = ((image >= 0) & (image < (grid.columns, grid.rows))).all(axis=1)
    inside = np.clip(image, 0, (grid.columns - 1, grid.rows - 1))
    paired = acting.aligned[piece_of] & (depth[touching] > -1.0) & on_grid & ~touching[inside[:, 0], inside[:, 1]]
    mirror[paired] = image[paired]
    surface = np.array(body.surface_of_piece, dtype=np.int32)[piece_of]
    blocks = (node[:, 0] // BLOCK) * (grid.rows // BLOCK) + node[:, 1] // BLOCK
    order = np.argsort(blocks, kind="stable")
    block, start = np.unique(blocks[order], return_index=True)
    return ContactNodes(
        node[order],
        mirror[order],
        normal[order],
        surface[order],
        block.astype(np.int32),
        np.append(start, len(node)).astype(np.int32),
    )


def _cells(low: float, high: float, spacing: float, count: int) -> slice:
    """Those of `count` cells from 0 on that reach between `low` and `high` [m]."""
    first = max(math.floor(low / spacing), 0) if math.isfinite(low) else 0
    last = min(math.ceil(high / spacing), count) if math.isfinite(high) else count
    return slice(min(first, count), max(last, first))
