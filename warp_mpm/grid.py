"""The background grid of a scene. Pure NumPy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .extent import domain_extent
from .kernels.layout import BLOCK
from .scenario import Scenario

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
    layers: int = 1
    """In space such grids lie one behind the other."""
    front: float = 0.0
    """z of the first layer's front edge [m], a multiple of the spacing."""

    @property
    def ground_row(self) -> int:
        """First row of nodes above y = 0."""
        return round(-self.bottom / self.spacing)

    def node_positions(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """x of the columns [columns] and y of the rows [rows] of nodes at t = 0 [m]."""
        x = self.left + (np.arange(self.columns, dtype=np.float64) + 0.5) * self.spacing
        y = self.bottom + (np.arange(self.rows, dtype=np.float64) + 0.5) * self.spacing
        return x, y


def fit_grid(scenario: Scenario, vertices: Sequence[NDArray[np.float64]] = ()) -> GridLayout:
    """The grid over a scene's domain (`domain_extent`), with a margin around.

    Args:
        scenario: the scene.
        vertices: of the outlines of bodies beside the scenario's, [V, 2] each [m].
    """
    spacing = scenario.numerics.spacing_m
    edges = domain_extent(scenario, vertices).edges
    first_column = math.floor(edges.left / spacing + 1e-9) - MARGIN
    last_column = math.ceil(edges.right / spacing - 1e-9) + MARGIN
    first_row = math.floor(edges.bottom / spacing + 1e-9) - MARGIN
    last_row = math.ceil(edges.top / spacing - 1e-9) + MARGIN
    # Whole blocks; the extra cells go to the open ends.
    columns = math.ceil((last_column - first_column) / BLOCK) * BLOCK
    rows = math.ceil((last_row - first_row) / BLOCK) * BLOCK
    return GridLayout(spacing, first_column * spacing, first_row * spacing, columns, rows)
