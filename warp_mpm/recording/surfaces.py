"""Barriers and ground as polygons in a VTKHDF file, beside the material points of the snapshots in ParaView.

The file has the snapshots' times, so that both play together. The cell array `part` tells ground (0) from the barriers
(1 and on, from upstream to downstream).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from warp_mpm.recording.run_folder import ASIDE
from warp_mpm.scenario import Scenario
from warp_mpm.scenario.site import all_standing

VTK_POLYGON = 7
GROUND, BARRIER = 0, 1

Outline = NDArray[np.float64]


def outlines(scenario: Scenario, extent: tuple[float, float, float]) -> list[tuple[int, str, Outline]]:
    """Part, name and corners [V, 2] of each surface before the barriers move.

    Args:
        scenario: of the run.
        extent: left, right and top [m] of what the material reaches, beyond which nothing needs to be shown.
    """
    left, right, top = extent
    barriers = all_standing(scenario)
    for _, x, _, standing in barriers:
        if standing is not None:
            base = float(standing[:, 0].max()) - x
            right, top = max(right, x + 1.2 * base), max(top, float(standing[:, 1].max()))
        else:
            right = max(right, x) + 0.1 * (max(right, x) - left)
    found: list[tuple[int, str, Outline]] = []
    ground = scenario.ground
    if ground is not None and ground.level:
        depth = 0.04 * (right - left)
        found.append((GROUND, "ground", np.array([[left, -depth], [right, -depth], [right, 0.0], [left, 0.0]])))
    elif ground is not None:
        inside = ground.profile[(ground.profile[:, 0] > left) & (ground.profile[:, 0] < right)]
        ends = [[x, float(ground.height(x))] for x in (right, left)]
        line = np.concatenate([ends[:1], inside[::-1], ends[1:]])
        below = float(line[:, 1].min()) - 0.04 * (right - left)
        found.append((GROUND, "ground", np.concatenate([[[left, below], [right, below]], line])))
    for number, (name, x, _, standing) in enumerate(barriers, start=BARRIER):
        if standing is None:
            foot = 0.0 if ground is None else float(ground.height(x))
            standing = np.array([[x, foot], [right, foot], [right, top], [x, top]])
        found.append((number, name, standing))
    return found


def write_surfaces(
    scenario: Scenario,
    times: Sequence[float],
    displacements: Sequence[Mapping[str, float]],
    extent: tuple[float, float, float],
    target: Path,
) -> bool:
    """Write the surfaces at the times of the snapshots, whole or not at all; False where the scene has none.

    Args:
        scenario: of the run.
        times: [s].
        displacements: of the barriers at these times, by name [m].
        extent: see `outlines`.
        target: the file; one that is there is replaced.
    """
    parts = outlines(scenario, extent)
    if not parts or len(times) == 0:
        target.unlink(missing_ok=True)
        return False
    corners = np.concatenate([outline for _, _, outline in parts])
    steps, cells, points = len(times), len(parts), len(corners)
    positions = np.zeros((steps, points, 3), dtype=np.float32)
    positions[:, :, :2] = corners
    offsets = np.concatenate([[0], np.cumsum([len(outline) for _, _, outline in parts])])
    for (_, name, _), first, last in zip(parts, offsets, offsets[1:], strict=False):
        positions[:, first:last, 0] += np.array([moved.get(name, 0.0) for moved in displacements])[:, None]
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
        root["CellData/part"] = np.tile([part for part, _, _ in parts], steps).astype(np.int32)
        root["CellData/part"].attrs["meaning"] = ", ".join(f"{part} {name}" for part, name, _ in parts)
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
