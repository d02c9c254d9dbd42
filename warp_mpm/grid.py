"""The background grid of a scene and the barrier's contact nodes on it. Pure NumPy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .extent import domain_extent
from .kernels.layout import BACK, BLOCK, FACE, TOP
from .scenario import Barrier, Scenario, Trapezoid

MARGIN = 4
"""Columns and rows of nodes around the region that material may reach; the first row above a ground is row 4 of the
first row of blocks, which holds all that the ground concerns."""


@dataclass(frozen=True)
class GridLayout:
    """A grid of square cells; node (i, j) at x = left + (i + 1/2) spacing, y = bottom + (j + 1/2) spacing."""

    spacing: float
    left: float
    """x of the grid's left edge at t = 0 [m], a multiple of the spacing."""
    bottom: float
    columns: int
    rows: int

    @property
    def ground_row(self) -> int:
        """First row of nodes above y = 0."""
        return round(-self.bottom / self.spacing)

    def node_positions(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """x of the columns [columns] and y of the rows [rows] of nodes at t = 0 [m]."""
        x = self.left + (np.arange(self.columns, dtype=np.float64) + 0.5) * self.spacing
        y = self.bottom + (np.arange(self.rows, dtype=np.float64) + 0.5) * self.spacing
        return x, y


@dataclass(frozen=True)
class ContactNodes:
    """Nodes through which the barrier acts, C of them; those of surfaces with friction come first."""

    node: NDArray[np.int32]
    """[C, 2]"""
    mirror: NDArray[np.int32]
    """[C, 2] the node's mirror image in the surface; (-1, -1) where the node stands alone."""
    normal: NDArray[np.float64]
    """[C, 2] out of the barrier."""
    surface: NDArray[np.int32]
    """[C] FACE, TOP or BACK."""
    friction: NDArray[np.float64]
    """[C]"""


def fit_grid(scenario: Scenario) -> GridLayout:
    """The grid over a scene's domain (`domain_extent`), with a margin around."""
    spacing = scenario.numerics.spacing_m
    edges = domain_extent(scenario).edges
    first_column = math.floor(edges.left / spacing + 1e-9) - MARGIN
    last_column = math.ceil(edges.right / spacing - 1e-9) + MARGIN
    first_row = math.floor(edges.bottom / spacing + 1e-9) - MARGIN
    last_row = math.ceil(edges.top / spacing - 1e-9) + MARGIN
    # Whole blocks; the extra cells go to the open ends.
    columns = math.ceil((last_column - first_column) / BLOCK) * BLOCK
    rows = math.ceil((last_row - first_row) / BLOCK) * BLOCK
    return GridLayout(spacing, first_column * spacing, first_row * spacing, columns, rows)


def barrier_planes(barrier: Barrier) -> list[tuple[int, tuple[float, float], float]]:
    """Surfaces of the barrier as (surface, outward normal, offset): the barrier is where normal . x <= offset for all.

    The planes of face and back go on below the ground, where mirror images of the flow may lie.
    """
    if not isinstance(barrier.shape, Trapezoid):
        return [(FACE, (-1.0, 0.0), 0.0)]
    base, crest, height = barrier.shape.base_crest_height
    run = 0.5 * (base - crest)
    length = math.hypot(run, height)
    sine, cosine = height / length, run / length
    return [
        (FACE, (-sine, cosine), 0.0),
        (TOP, (0.0, 1.0), height),
        (BACK, (sine, cosine), sine * base),
    ]


def contact_nodes(barrier: Barrier, grid: GridLayout, depth_in_cells: float = 4.0) -> ContactNodes:
    """Nodes that take the barrier's velocity along its normal.

    A plane along the grid (an upright face, a crest on a multiple of the spacing) acts on mirrored pairs, exactly at
    its place. Any other plane acts on the nodes inside it and within half a cell outside: the splines then vanish
    between half a cell outside and half a cell inside, without bias. A node belongs to the plane nearest to it; those
    deeper than `depth_in_cells` are out of the flow's reach and left out.

    A node outside an inclined face or back acts only at a cell or more below the crest: nearer, its splines reach over
    the crest and would hold up what flows over. The sliding distance would then hang, by a tenth, on where the crest's
    corner happens to lie among the nodes.
    """
    spacing = grid.spacing
    x, y = grid.node_positions()
    planes = barrier_planes(barrier)
    distance = []
    aligned = []
    for _, (nx, ny), offset in planes:
        d = (nx * x[:, None] + ny * y[None, :] - offset) / spacing
        along_grid = abs(abs(nx) + abs(ny) - 1.0) < 1e-12
        on_line = along_grid and abs(offset / spacing - round(offset / spacing)) < 1e-6
        aligned.append(on_line)
        distance.append(d if on_line else d - 0.5)
    stacked = np.array(distance)
    nearest = stacked.argmax(axis=0)
    outermost = stacked.max(axis=0)
    touching = (outermost < 0.0) & (outermost > -depth_in_cells) & (y[None, :] > -3.0 * spacing)
    if isinstance(barrier.shape, Trapezoid):
        crest = barrier.shape.base_crest_height[2]
        inclined = np.array(
            [not level and surface != TOP for level, (surface, _, _) in zip(aligned, planes, strict=True)]
        )
        outside = inclined[nearest] & (outermost > -0.5)
        touching &= ~(outside & (y[None, :] > crest - spacing * (1.0 - 1e-9)))
    node = np.argwhere(touching).astype(np.int32)
    plane = nearest[touching]
    deep = outermost[touching]
    normals = np.array([normal for _, normal, _ in planes])
    surfaces = np.array([surface for surface, _, _ in planes], dtype=np.int32)
    normal = normals[plane]
    mirror = np.full_like(node, -1)
    paired = np.array(aligned)[plane] & (deep > -1.0)
    image = node + np.rint(normal).astype(np.int32)
    paired &= ~touching[np.clip(image[:, 0], 0, grid.columns - 1), np.clip(image[:, 1], 0, grid.rows - 1)]
    mirror[paired] = image[paired]
    friction = np.array([barrier.friction.face, barrier.friction.top, barrier.friction.back])
    surface = surfaces[plane]
    order = np.argsort(friction[surface] == 0.0, kind="stable")
    node, mirror, normal, surface = node[order], mirror[order], normal[order], surface[order]
    return ContactNodes(node, mirror, normal, surface, friction[surface])


def open_corner_volumes(scenario: Scenario, grid: GridLayout, depth_in_cells: float = 0.0) -> NDArray[np.float64]:
    """Volume [columns, rows] of the cell around each corner of the grid that is open to flow [m3/m], at least an
    eighth of a cell. Sampled at 8 x 8 places where a solid is near.

    Faces that do not lie along the grid count as `depth_in_cells` further back: points rest that deep in them.
    """
    spacing = grid.spacing
    x = grid.left + (np.arange(grid.columns) + 1.0) * spacing
    y = grid.bottom + (np.arange(grid.rows) + 1.0) * spacing
    share = np.ones((grid.columns, grid.rows))
    if scenario.ground is not None:
        share *= np.clip(y / spacing + 0.5, 0.0, 1.0)[None, :]
    if scenario.barrier is not None:
        planes = [
            (surface, (nx, ny), offset - (depth_in_cells * spacing if nx and ny else 0.0))
            for surface, (nx, ny), offset in barrier_planes(scenario.barrier)
        ]
        offsets = (np.arange(8) + 0.5) / 8.0 - 0.5
        low = np.full((grid.columns, grid.rows), -np.inf)
        for _, (nx, ny), offset in planes:
            low = np.maximum(low, nx * x[:, None] + ny * y[None, :] - offset)
        share[low < -spacing] = 0.0
        near = np.argwhere(np.abs(low) <= spacing)
        if len(near):
            sample_x = x[near[:, 0], None, None] + offsets[None, :, None] * spacing
            sample_y = y[near[:, 1], None, None] + offsets[None, None, :] * spacing
            inside = np.ones(np.broadcast_shapes(sample_x.shape, sample_y.shape), dtype=bool)
            for _, (nx, ny), offset in planes:
                inside &= nx * sample_x + ny * sample_y <= offset
            free = ~inside
            if scenario.ground is not None:
                free &= sample_y > 0.0
            share[near[:, 0], near[:, 1]] = free.mean(axis=(1, 2))
    return np.maximum(share, 0.125) * spacing**2
