"""The arrays of a simulation on its device: material points, grid, contact nodes and clock, at the start of a scene."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ..discretization import MaterialPoints
from ..effects import Effects
from ..grid import GridLayout, contact_nodes, open_corner_volumes
from ..kernels import layout as at
from ..scenario import Barrier, Prescribed, Scenario
from ..scenario.checks import BYTES_PER_POINT


@dataclass(frozen=True)
class Group:
    """Arrays that kernels take together."""

    structure: Any
    """The Warp structure that holds them."""
    arrays: dict[str, Any]
    """The same, by name."""


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
    liquid_bulk_modulus: float,
    device: Any,
) -> Group:
    """State of the material points at the start; fields that nothing is said of begin at 0."""
    count = len(initial.volume)
    given: dict[str, Any] = {
        "position": initial.position,
        "velocity": np.tile(np.array(scenario.flow.velocity_m_per_s), (count, types.components // 2)),
        "stress": initial.effective_stress,
        "reference_volume": initial.volume,
        "volume": initial.volume,
        "inside": np.ones(count, dtype=np.int32),
    }
    if effects.liquid:
        given["liquid_strain"] = -initial.pore_pressure / liquid_bulk_modulus
    return _filled(types.Points(), types.point_fields, given, dict.fromkeys(types.point_fields, count), device)


def grid_arrays(
    scenario: Scenario, effects: Effects, types: SimpleNamespace, grid: GridLayout, *, device: Any
) -> Group:
    """Nodes, corners of the smoothing grid, and the list of blocks in use."""
    blocks = (grid.columns // at.BLOCK, grid.rows // at.BLOCK)
    shapes: dict[str, Any] = dict.fromkeys(types.grid_fields, (grid.columns, grid.rows))
    shapes |= {"block": blocks, "active": blocks[0] * blocks[1], "active_count": 1}
    given = {}
    if effects.smoothing_grid:
        given["corner_room"] = 1.0 / open_corner_volumes(scenario, grid)
    if effects.density_correction:
        given["corner_space"] = 1.0 / open_corner_volumes(scenario, grid, depth_in_cells=0.5)
    return _filled(types.Grid(), types.grid_fields, given, shapes, device)


def contact_arrays(barrier: Barrier, types: SimpleNamespace, grid: GridLayout, *, device: Any) -> Group:
    """Nodes through which the barrier acts, and what is gathered there in a step."""
    nodes = contact_nodes(barrier, grid)
    given: dict[str, Any] = {
        "node": nodes.node,
        "mirror": nodes.mirror,
        "normal": nodes.normal,
        "surface": nodes.surface,
        "friction": nodes.friction,
    }
    shapes = dict.fromkeys(types.contact_fields, len(nodes.node))
    return _filled(types.Contact(), types.contact_fields, given, shapes, device)


def clock_arrays(scenario: Scenario, effects: Effects, initial: MaterialPoints, *, device: Any) -> dict[str, Any]:
    """Clock, counters, impulses, sums and the prescribed motion, by their names; entries as in `kernels.layout`."""
    clock = np.zeros(at.CLOCK_SIZE)
    clock[at.SMALLEST_TIME_STEP] = math.inf
    clock[at.SPEED_MAX] = scenario.flow.speed**2
    solid, liquid = float(initial.solid_mass.sum()), float(initial.liquid_mass.sum())
    if not effects.two_phase:
        solid, liquid = solid + liquid, 0.0
    clock[at.INITIAL_MASS_SOLID] = clock[at.ACTIVE_MASS_SOLID] = solid
    clock[at.INITIAL_MASS_LIQUID] = clock[at.ACTIVE_MASS_LIQUID] = liquid
    times, velocities = np.zeros(1), np.zeros(1)
    if scenario.barrier is not None and isinstance(scenario.barrier.motion, Prescribed):
        motion = scenario.barrier.motion
        times, velocities = np.array(motion.times_s), np.array(motion.velocities_m_per_s)
    return {
        "clock": wp.array(clock, dtype=wp.float64, device=device),
        "counters": wp.zeros(at.COUNTERS_SIZE, dtype=wp.int32, device=device),
        "running": wp.zeros(at.RUNNING_SIZE, dtype=wp.int32, device=device),
        "reactions": wp.zeros(2 * at.SURFACES, dtype=wp.float64, device=device),
        "left": wp.zeros(at.LEFT_SIZE, dtype=wp.float64, device=device),
        "sums": wp.zeros(at.LEDGER_SIZE, dtype=wp.float64, device=device),
        "times": wp.array(times, dtype=wp.float64, device=device),
        "velocities": wp.array(velocities, dtype=wp.float64, device=device),
    }


def _filled(
    structure: Any, fields: Mapping[str, Any], given: Mapping[str, NDArray[Any]], shapes: Mapping[str, Any], device: Any
) -> Group:
    """The structure with an array for each of its fields: what is given, else zeros of the shape."""
    arrays = {}
    for name, field in fields.items():
        if name in given:
            array = wp.array(given[name], dtype=field.dtype, device=device)
        else:
            array = wp.zeros(shapes[name], dtype=field.dtype, device=device)
        setattr(structure, name, array)
        arrays[name] = array
    return Group(structure, arrays)
