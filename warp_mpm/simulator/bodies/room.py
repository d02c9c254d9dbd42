"""Room that the bodies leave to the flow around the corners of the grid. Pure NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mpm.grid import GridLayout

from .body import Body
from .kernels import BESIDE, CUT, DEEP, RUBBED, RUBS
from .outline import Segments
from .places import along_grid
from .side import Side


def open_corner_volumes(bodies: Sequence[Body], grid: GridLayout, depth_in_cells: float = 0.0) -> NDArray[np.float64]:
    """Volume [columns, rows] of the cell around each corner of the grid that is open to flow [m3/m], at least an
    eighth of a cell, with the bodies where they lie at t = 0. Sampled at 8 x 8 places where an outline is near. In
    space [layers columns, rows] [m3].

    Pieces that do not lie along the grid count as `depth_in_cells` further back: points rest that deep in them.
    """
    spacing = grid.spacing
    x = grid.left + (np.arange(grid.columns) + 1.0) * spacing
    y = grid.bottom + (np.arange(grid.rows) + 1.0) * spacing
    share = np.ones((grid.columns, grid.rows))
    window = (x[0] - spacing, x[-1] + spacing, y[0] - spacing, y[-1] + spacing)
    solids = [_set_back(body, depth_in_cells * spacing) for body in bodies if not body.edge]
    near = np.zeros(share.shape, dtype=bool)
    for solid in solids:
        if len(solid) == 1 and solid.normal[0, 1] == 1.0:
            share *= np.clip((y - solid.offset[0]) / spacing + 0.5, 0.0, 1.0)[None, :]
            continue
        low, _ = _nearest(solid, x, y, window, spacing)
        share[low < -spacing] = 0.0
        near |= np.abs(low) <= spacing
    corner = np.argwhere(near)
    if len(corner):
        offsets = ((np.arange(8) + 0.5) / 8.0 - 0.5) * spacing
        sample = np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)
        place = np.stack([x[corner[:, 0]], y[corner[:, 1]]], axis=-1)[:, None] + sample
        free = np.ones(place.shape[:2], dtype=bool)
        for solid in solids:
            free &= solid.nearest_within(place.reshape(-1, 2), 4.0 * spacing)[0].reshape(free.shape) > 0.0
        share[corner[:, 0], corner[:, 1]] = free.mean(axis=1)
    if grid.layers > 1:
        z = grid.front + (np.arange(grid.layers) + 1.0) * spacing
        between = np.ones(grid.layers)
        for body in bodies:
            if isinstance(body.outline, Side):
                between *= np.clip((z - body.outline.z) * body.outline.facing / spacing + 0.5, 0.0, 1.0)
        return (np.maximum(between[:, None, None] * share, 0.125) * spacing**3).reshape(-1, grid.rows)
    return np.maximum(share, 0.125) * spacing**2


def solid_cells(bodies: Sequence[Body], grid: GridLayout) -> NDArray[np.int32]:
    """What a point in the cell around a node [columns, rows] may be near, in the bits of `kernels.DEEP` and
    `kernels.RUBS`, and whether the cell lies beside an outline that cuts cells (`kernels.CUT`), of bodies that lie
    still as seen from the grid; an edge of the domain is smooth and sets no point back."""
    x, y = grid.node_positions()
    window = (x[0] - grid.spacing, x[-1] + grid.spacing, y[0] - grid.spacing, y[-1] + grid.spacing)
    found = np.zeros((grid.columns, grid.rows), dtype=np.int32)
    # From the middle of a cell to its corner it is 0.71 cells.
    corner = 0.75 * grid.spacing
    for body in bodies:
        if not body.edge:
            pieces = body.outline.segments
            distance, nearest = _nearest(pieces, x, y, window, grid.spacing)
            found[distance < corner - 0.5 * grid.spacing] |= DEEP
            if body.rubs:
                found[distance < corner + RUBBED * grid.spacing] |= RUBS
            cuts = ~along_grid(pieces, grid)
            found[(distance < BESIDE * grid.spacing) & cuts[nearest]] |= CUT
    return found


def _set_back(body: Body, depth: float) -> Segments:
    pieces = body.outline.segments
    inclined = (pieces.normal != 0.0).all(axis=1)
    return pieces.grown(np.where(inclined, -depth, 0.0)) if depth else pieces


def _nearest(
    solid: Segments, x: NDArray[Any], y: NDArray[Any], window: tuple[float, ...], spacing: float
) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Distance from the outline and nearest piece [columns, rows] of the corners; infinite, and the first, outside the
    box of a closed one."""
    piece = np.zeros((len(x), len(y)), dtype=np.int64)
    if len(solid) == 1 and solid.normal[0, 0] == 0.0:
        return np.broadcast_to(solid.normal[0, 1] * y - solid.offset[0], piece.shape), piece
    reach = (RUBBED + 1.0) * spacing
    if not solid.closed:
        return solid.nearest_on(x, y, reach)
    low = np.full(piece.shape, np.inf)
    box = solid.box(*window)
    if box is None:
        return low, piece
    columns = (x >= box[0] - reach) & (x <= box[1] + reach)
    rows = (y >= box[2] - reach) & (y <= box[3] + reach)
    within = np.ix_(columns, rows)
    low[within], piece[within] = solid.nearest_on(x[columns], y[rows], reach)
    return low, piece
