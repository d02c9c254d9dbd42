"""The background grid of a scene. Pure NumPy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .kernels.layout import BLOCK
from .scenario import Scenario, Trapezoid

MARGIN = 4
"""Columns and rows of nodes around the region that material may reach; the first row above a ground is row 4 of the
first row of blocks, which holds all that the ground concerns."""

LARGEST_GRID = 2_000_000
"""Most nodes that a grid fitted to the scene gets; beyond, the fitted edges move in and what leaves is counted."""


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


def fit_grid(scenario: Scenario, vertices: Sequence[NDArray[np.float64]] = ()) -> GridLayout:
    """The grid for a scene: its domain's edges where given, else as far as the flow can get until the end.

    How far that is: twice the speed that a point has if the whole fall and speed are its own, because the jet that a
    blunt front squeezes out of a corner runs ahead of the flow. What gets further still is counted as it leaves.

    Args:
        scenario: the scene.
        vertices: of the outlines of bodies beside the scenario's, [V, 2] each [m].
    """
    spacing = scenario.numerics.spacing_m
    domain = scenario.domain
    outline = scenario.flow.polygon
    x_low, y_low = outline.min(axis=0)
    x_high, y_high = outline.max(axis=0)
    flow_left, flow_right = x_low, x_high
    depth = scenario.flow.depth
    if scenario.barrier is not None:
        x_low, x_high = min(x_low, 0.0), max(x_high, 0.0)
        if isinstance(scenario.barrier.shape, Trapezoid):
            base, _, height = scenario.barrier.shape.base_crest_height
            x_high, y_high = max(x_high, base), max(y_high, height)
    for corners in vertices:
        x_low, x_high = min(x_low, corners[:, 0].min()), max(x_high, corners[:, 0].max())
        y_low, y_high = min(y_low, corners[:, 1].min()), max(y_high, corners[:, 1].max())
    gx, gy = scenario.gravity.vector
    time = scenario.output.end_time_s
    speed = scenario.flow.speed
    fall = 2.0 * abs(gy) * depth + 2.0 * abs(gx) * (x_high - x_low)
    fast = 2.0 * math.sqrt(speed**2 + fall)
    rise = min(fast * time, fast**2 / (2.0 * abs(gy)) if gy else math.inf)
    reach = fast * time + 0.5 * abs(gx) * time**2
    left = domain.left_m if domain.left_m is not None else x_low - min(reach, 4.0 * (flow_right - flow_left))
    right = domain.right_m if domain.right_m is not None else x_high + reach
    top = domain.top_m if domain.top_m is not None else y_high + rise
    if scenario.ground is not None:
        bottom = 0.0
    elif domain.bottom_m is not None:
        bottom = domain.bottom_m
    else:
        bottom = y_low - min(reach, speed * time + 0.5 * abs(gy) * time**2 + depth)

    excess = math.sqrt((right - left) * (top - bottom) / spacing**2 / LARGEST_GRID)
    if excess > 1.0:
        if domain.right_m is None:
            right = x_high + (right - x_high) / excess
        if domain.left_m is None:
            left = x_low - (x_low - left) / excess
        if domain.top_m is None:
            top = y_high + (top - y_high) / excess

    first_column = math.floor(left / spacing + 1e-9) - MARGIN
    last_column = math.ceil(right / spacing - 1e-9) + MARGIN
    first_row = math.floor(bottom / spacing + 1e-9) - MARGIN
    last_row = math.ceil(top / spacing - 1e-9) + MARGIN
    # Whole blocks; the extra cells go to the open ends.
    columns = math.ceil((last_column - first_column) / BLOCK) * BLOCK
    rows = math.ceil((last_row - first_row) / BLOCK) * BLOCK
    return GridLayout(spacing, first_column * spacing, first_row * spacing, columns, rows)
