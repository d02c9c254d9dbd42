"""The arrays of a simulation on its device: material points, grid and clock, at the start of a scene."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..discretization import MaterialPoints
from ..effects import Effects
from ..grid import GridLayout
from ..kernels import layout as at
from ..scenario import Scenario
from ..scenario.checks import BYTES_PER_POINT
from ..scenario.inflow import APPROACH
from ..simulator.bodies import Body
from ..simulator.bodies.arrays import Group, filled
from ..simulator.bodies.room import open_corner_volumes, solid_cells


@contextmanager
def memory_for(scenario: Scenario) -> Iterator[None]:
    """Tell what a scene asks for where its memory cannot be had.

    Raises:
        MemoryError: with a sentence that names the field that decides.
    """
    try:
        yield
    except (MemoryError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "allocate" not in str(error):  # Warp's own are RuntimeErrors
            raise
        spacing = scenario.numerics.spacing_m
        points = scenario.flow.volume / spacing**2 * scenario.numerics.points_per_cell
        raise MemoryError(
            f"numerics.spacing_m = {spacing:g} asks for {points:.3g} material points and a grid, about "
            f"{points * BYTES_PER_POINT / 1e9:.2g} GB, more than can be had here"
        ) from None


def point_arrays(
    scenario: Scenario,
    effects: Effects,
    types: SimpleNamespace,
    initial: MaterialPoints,
    *,
    liquid_stiffness: NDArray[np.float64],
    device: Any,
) -> Group:
    """State of the material points at the start; fields that nothing is said of begin at 0.

    `liquid_stiffness` is the bulk modulus of each point's liquid [N] [Pa], infinite where there is none.
    """
    count = len(initial.volume)
    given: dict[str, Any] = {
        "position": initial.position,
        "velocity": np.tile(initial.velocity, (1, types.components // types.dimensions)),
        "stress": initial.effective_stress,
        "reference_volume": initial.volume,
        "volume": initial.volume,
        "inside": np.where(initial.waits, at.WAITING, at.INSIDE).astype(np.int32),
    }
    if effects.arriving:
        given["pace"] = initial.pace
    if effects.liquid:
        given["liquid_strain"] = -initial.pore_pressure / liquid_stiffness
    for name, field in effects.point_fields.items():
        start = field.start(scenario, initial) if callable(field.start) else field.start
        shape = (count, *getattr(getattr(types, field.kind), "_shape_", ()))
        given[name] = np.ascontiguousarray(np.broadcast_to(start, shape))
    return filled(types.Points(), types.point_fields, given, dict.fromkeys(types.point_fields, count), device)


def span_of(points: Group, types: SimpleNamespace, begin: int, end: int) -> Any:
    """The structure of the points from `begin` to before `end`: a look at the same arrays."""
    structure = types.Points()
    for name, array in points.arrays.items():
        setattr(structure, name, array[begin:end])
    return structure


def arrival_arrays(scenario: Scenario, types: SimpleNamespace, *, device: Any) -> Group:
    """The table of an inflow, how far it has come, and what it has brought."""
    inflow = scenario.flow.inflow
    assert inflow is not None
    given = {
        "times": inflow.times,
        "velocities": inflow.velocities,
        "ways": inflow.ways,
        "stretches": inflow.stretches(scenario.gravity.acceleration_m_per_s2),
        "section": inflow.x_m,
        "base": inflow.base,
        "slope": inflow.slope,
        "entry": inflow.x_m - APPROACH * scenario.numerics.spacing_m,
        "fastest": inflow.greatest_speed,
    }
    shapes = {"conveyed": at.CONVEYED_SIZE, "inflow": at.INFLOW_SIZE}
    return filled(types.Arrival(), types.arrival_fields, given, shapes, device)


def grid_arrays(
    bodies: Sequence[Body], effects: Effects, types: SimpleNamespace, grid: GridLayout, *, device: Any
) -> Group:
    """Nodes, corners of the smoothing grid, and the list of blocks in use."""
    blocks = (grid.layers * grid.columns // at.BLOCK, grid.rows // at.BLOCK)
    shapes: dict[str, Any] = dict.fromkeys(types.grid_fields, (grid.layers * grid.columns, grid.rows))
    shapes |= {"block": blocks, "telling": blocks, "active": blocks[0] * blocks[1], "active_count": 1, "shift": 2}
    given: dict[str, Any] = {}
    if effects.bodies and not effects.passing:
        given["solid"] = solid_cells(bodies, grid)
    if effects.smoothing_grid:
        given["corner_room"] = 1.0 / open_corner_volumes(bodies, grid)
    if effects.density_correction:
        given["corner_space"] = 1.0 / open_corner_volumes(bodies, grid, depth_in_cells=0.5)
    return filled(types.Grid(), types.grid_fields, given, shapes, device)


def clock_arrays(
    scenario: Scenario, effects: Effects, initial: MaterialPoints, *, surfaces: int, device: Any
) -> dict[str, Any]:
    """Clock, counters, balance, limiters, impulses on the surfaces, sums and what is in the flow, by their names;
    entries as in `kernels.layout`."""
    clock = np.zeros(at.CLOCK_SIZE)
    clock[at.SMALLEST_TIME_STEP] = math.inf
    clock[at.SPEED_MAX] = scenario.flow.greatest_speed**2
    there = slice(None, initial.there)
    solid, liquid = float(initial.solid_mass[there].sum()), float(initial.liquid_mass[there].sum())
    if not effects.two_phase:
        solid, liquid = solid + liquid, 0.0
    balance = np.zeros(at.BALANCE_SIZE)
    balance[at.INITIAL_MASS_SOLID] = balance[at.ACTIVE_MASS_SOLID] = solid
    balance[at.INITIAL_MASS_LIQUID] = balance[at.ACTIVE_MASS_LIQUID] = liquid
    return {
        "clock": wp.array(clock, dtype=wp.float64, device=device),
        "counters": wp.zeros(at.COUNTERS_SIZE, dtype=wp.int32, device=device),
        "running": wp.zeros(at.RUNNING_SIZE, dtype=wp.int32, device=device),
        "balance": wp.array(balance, dtype=wp.float64, device=device),
        "limiters": wp.zeros(at.LIMITERS_SIZE, dtype=wp.float64, device=device),
        "reactions": wp.zeros(effects.dimensions * surfaces, dtype=wp.float64, device=device),
        "left": wp.zeros(at.LEFT_SIZE + effects.dimensions - 2, dtype=wp.float64, device=device),
        "flow": wp.zeros(at.FLOW_SIZE * len(initial.spans), dtype=wp.int32, device=device),
        "sums": wp.zeros(at.LEDGER_SIZE, dtype=wp.float64, device=device),
    }
