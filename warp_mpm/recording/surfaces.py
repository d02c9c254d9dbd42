"""Barrier and ground as polygons in a VTKHDF file, beside the material points of the snapshots in ParaView.

The file has the snapshots' times, so that both play together. The cell array `part` tells ground (0) from barrier (1).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from warp_mpm.recording.run_folder import ASIDE
from warp_mpm.scenario import Scenario, Trapezoid

VTK_POLYGON = 7
GROUND, BARRIER = 0, 1

Outline = NDArray[np.float64]


def outlines(scenario: Scenario, extent: tuple[float, float, float]) -> list[tuple[int, Outline]]:
    """Part and corners [V, 2] of each surface before the barrier moves.

    Args:
        scenario: of the run.
        extent: left, right and top [m] of what the material reaches, beyond which nothing needs to be shown.
    """
    left, right, top = extent
    shape = scenario.barrier.shape if scenario.barrier is not None else None
    if isinstance(shape, Trapezoid):
        right, top = max(right, 1.2 * shape.base_crest_height[0]), max(top, shape.base_crest_height[2])
    elif shape is not None:
        right = max(right, 0.0) + 0.1 * (max(right, 0.0) - left)
    found = []
    if scenario.ground is not None:
        depth = 0.04 * (right - left)
        found.append((GROUND, np.array([[left, -depth], [right, -depth], [right, 0.0], [left, 0.0]])))
    if isinstance(shape, Trapezoid):
        found.append((BARRIER, shape.polygon))
    elif shape is not None:
        found.append((BARRIER, np.array([[0.0, 0.0], [right, 0.0], [right, top], [0.0, top]])))
    return found


def write_surfaces(
    scenario: Scenario,
    times: Sequence[float],
    displacements: Sequence[float | None],
    extent: tuple[float, float, float],
    target: Path,
) -> bool:
    """Write the surfaces at the times of the snapshots, whole or not at all; False where the scene has none.

    Args:
        scenario: of the run.
        times: [s].
        displacements: of the barrier at these times [m]; None without one.
        extent: see `outlines`.
        target: the file; one that is there is replaced.
    """
    parts = outlines(scenario, extent)
    if not parts or len(times) == 0:
        target.unlink(missing_ok=True)
        return False
    corners = np.concatenate([outline for _, outline in parts])
    moves = np.concatenate([np.full(len(outline), part == BARRIER) for part, outline in parts])
    steps, cells, points = len(times), len(parts), len(corners)
    positions = np.zeros((steps, points, 3), dtype=np.float32)
    positions[:, :, :2] = corners
    positions[:, :, 0] += np.array([shift or 0.0 for shift in displacements])[:, None] * moves
    offsets = np.concatenate([[0], np.cumsum([len(outline) for _, outline in parts])])
    every = np.arange(steps)

    aside = target.with_name(target.name + ASIDE)
    with h5py.File(aside, "w", libver=("earliest", "v108"), locking=False) as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 2])
        root.attrs.create("Type", np.bytes_("UnstructuredGrid"))
        root["Points"] = positions.reshape(-1, 3)
        root["Connectivity"] = np.arange(points)
        # Readers look for a step's offsets after those of the steps before, each one longer than its cells.
        root["Offsets"] = np.tile(offsets, steps)
        root["Types"] = np.full(steps * cells, VTK_POLYGON, dtype=np.uint8)
        for name, number in (("Points", points), ("Cells", cells), ("ConnectivityIds", points)):
            root[f"NumberOf{name}"] = np.full(steps, number, dtype=np.int64)
        root["CellData/part"] = np.tile([part for part, _ in parts], steps).astype(np.int32)
        root["CellData/part"].attrs["meaning"] = "0 ground, 1 barrier"
        group = root.create_group("Steps")
        group.attrs["NSteps"] = steps
        group["Values"] = np.asarray(times, dtype=np.float64)
        group["Values"].attrs["unit"] = "s"
        group["PartOffsets"] = every
        group["NumberOfParts"] = np.ones(steps, dtype=np.int64)
        group["PointOffsets"] = every * points
        group["CellOffsets"] = (every * cells)[:, None]
        group["ConnectivityIdOffsets"] = np.zeros((steps, 1), dtype=np.int64)
        group["CellDataOffsets/part"] = every * cells
    aside.replace(target)
    return True
