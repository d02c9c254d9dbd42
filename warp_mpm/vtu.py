"""Snapshots as one VTK XML file for each time (.vtu) and a collection (.pvd), which any ParaView reads.

ParaView reads `snapshots.vtkhdf` with its times from 5.13 on; this is for older ones, and for other readers of VTK XML.
Layout: https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html, arrays raw in an appendix.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from analytic.whole_file import UnwrittenError, whole_file
from warp_mpm.quantities.points import POINT_FIELDS
from warp_mpm.recording.surfaces import VTK_POLYGON, outlines
from warp_mpm.results import Results

VTK_VERTEX = 1
COLLECTION = "snapshots.pvd"
"""The file that is opened: it lists the others with their times."""

ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
TYPES = {"float32": "Float32", "int64": "Int64", "uint8": "UInt8", "int32": "Int32"}

Arrays = Mapping[str, NDArray]


def write_vtu(results: Results, folder: Path) -> int:
    """Write the material points of each snapshot, and barrier and ground beside them; returns how many snapshots.

    Args:
        results: of the run.
        folder: made if need be; files of these names are replaced.

    Raises:
        ResultsError: the run has no snapshots.
        UnwrittenError: a file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise UnwrittenError(error.errno, "it is no folder", str(folder)) from None
    entries: list[tuple[float, int, str]] = []
    with results.snapshots as snapshots:
        extent = _extent(results)
        for number, snapshot in enumerate(snapshots):
            points, count = _in_space(snapshot.position), len(snapshot.position)
            fields = {
                f"{name} [{POINT_FIELDS[name].unit}]": _components(snapshot[name])
                for name in snapshots.names
                if name in snapshot
            }
            name = f"points_{number:05d}.vtu"
            _write(folder / name, points, np.arange(count), np.arange(1, count + 1), VTK_VERTEX, fields, {})
            entries.append((snapshot.time, 0, name))
            parts = outlines(results.scenario, extent)
            if parts:
                name = f"surfaces_{number:05d}.vtu"
                _write_surfaces(folder / name, parts, results.barrier_displacements(snapshot))
                entries.append((snapshot.time, 1, name))
        count = len(snapshots)
    with whole_file(folder / COLLECTION) as aside:
        lines = [
            f'<DataSet timestep="{time:.9g}" part="{part}" file={quoteattr(name)}/>' for time, part, name in entries
        ]
        aside.write_text(
            f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0" byte_order="{ORDER}">\n<Collection>\n'
            + "\n".join(lines)
            + "\n</Collection>\n</VTKFile>\n",
            encoding="utf-8",
        )
    return count


def _extent(results: Results) -> tuple[float, float, float]:
    """left, right, top [m] of what the material reaches in the whole run."""
    sides = [
        (*snapshot.position[:, 0][[snapshot.position[:, 0].argmin(), snapshot.position[:, 0].argmax()]],
         snapshot.position[:, 1].max())
        for snapshot in results.snapshots
        if len(snapshot.position)
    ] or [(0.0, 0.0, 0.0)]  # fmt: skip
    left, right, top = np.array(sides).T
    return float(left.min()), float(right.max()), float(top.max())


def _write_surfaces(path: Path, parts: list[tuple[int, str, NDArray]], displacements: Mapping[str, float]) -> None:
    corners = [outline + np.array([displacements.get(name, 0.0), 0.0]) for _, name, outline in parts]
    points = _in_space(np.concatenate(corners))
    offsets = np.cumsum([len(outline) for outline in corners])
    numbers = np.array([part for part, _, _ in parts], dtype=np.int32)
    _write(path, points, np.arange(len(points)), offsets, VTK_POLYGON, {}, {"part": numbers})


def _in_space(positions: NDArray) -> NDArray:
    points = np.zeros((len(positions), 3), dtype=np.float32)
    points[:, :2] = positions
    return points


def _components(values: NDArray) -> NDArray:
    """In single precision; vectors with three components, stresses with VTK's six: xx, yy, zz, xy, yz, xz."""
    values = np.asarray(values, dtype=np.float32)
    if values.ndim == 1:
        return values
    whole = np.zeros((len(values), {2: 3, 4: 6}[values.shape[1]]), dtype=np.float32)
    whole[:, : values.shape[1]] = values
    return whole


def _write(
    path: Path, points: NDArray, connectivity: NDArray, offsets: NDArray, kind: int, fields: Arrays, of_cells: Arrays
) -> None:
    cells = len(offsets)
    blocks: list[bytes] = []
    size = 0

    def array(name: str, values: NDArray) -> str:
        nonlocal size
        raw = np.ascontiguousarray(values).tobytes()
        start, block = size, np.uint64(len(raw)).tobytes() + raw
        blocks.append(block)
        size += len(block)
        components = values.shape[1] if values.ndim > 1 else 1
        return (
            f'<DataArray type="{TYPES[values.dtype.name]}" Name={quoteattr(name)} NumberOfComponents="{components}" '
            f'format="appended" offset="{start}"/>'
        )

    def group(tag: str, arrays: Arrays) -> Iterator[str]:
        yield f"<{tag}>"
        for name, values in arrays.items():
            yield array(name, values)
        yield f"</{tag}>"

    lines = [
        '<?xml version="1.0"?>',
        f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{ORDER}" header_type="UInt64">',
        "<UnstructuredGrid>",
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{cells}">',
        *group("Points", {"Points": points}),
        *group(
            "Cells",
            {
                "connectivity": connectivity.astype(np.int64),
                "offsets": offsets.astype(np.int64),
                "types": np.full(cells, kind, dtype=np.uint8),
            },
        ),
        *group("PointData", fields),
        *group("CellData", of_cells),
        "</Piece>",
        "</UnstructuredGrid>",
        '<AppendedData encoding="raw">',
    ]
    with whole_file(path) as aside, aside.open("wb") as file:
        file.write("\n".join(lines).encode() + b"\n_")
        file.writelines(blocks)
        file.write(b"\n</AppendedData>\n</VTKFile>\n")
