"""Snapshots of the material points in one HDF5 file, laid out as VTKHDF so that ParaView opens it as an animation.

Layout: https://docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format/index.html (version 2.2, UnstructuredGrid
with time steps). Every material point is a vertex cell. All steps lie one after another in the same data sets. The
unit of a field is its data set's attribute `unit`: a slash in a name would be a path.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from warp_mpm.quantities.points import POINT_FIELDS
from warp_mpm.recording.hdf5 import FILE_OPTIONS, bring_to_disk, failures_of_the_disk, reopened
from warp_mpm.recording.schedule import Schedule

VTK_VERTEX = 1

FILLED = (
    "Points",
    "Offsets",
    "NumberOfPoints",
    "FieldData/barrier_displacement",
    "Steps/PointOffsets",
    "Steps/CellOffsets",
    "Steps/Values",
)
"""Data sets beside the point fields to which every snapshot adds."""


class SnapshotRecorder:
    """Writes positions and point fields, in single precision.

    The file's structure and its room are laid down before the first snapshot, and later snapshots only fill numbers
    in. A process that is killed at any moment leaves a file that opens, with all snapshots before the last.
    """

    def __init__(self, path: Path, interval: float, end_time: float, *, mark: Mapping[str, int] | None = None):
        """Create the file with room for the snapshots until `end_time` [s], every `interval` [s] and at the end; or go
        on at an earlier `mark` in it, dropping what was written after that.

        Raises:
            FileExistsError: there is one already.
            RunFolderError: the file does not reach to the mark.
        """
        self.schedule = Schedule(interval)
        self._path = path
        self._room = int(end_time / interval * (1.0 + 1e-9)) + 3
        self._count = 0
        self._points = 0
        self._file: h5py.File | None = None
        self._root: h5py.Group
        self._steps: h5py.Group
        self._fields: dict[str, h5py.Dataset] = {}
        self._filled: dict[str, h5py.Dataset] = {}
        self._buffers: dict[str, np.ndarray] = {}
        if mark is None:
            self._file = h5py.File(path, "x", **FILE_OPTIONS)
            self._root = self._file.create_group("VTKHDF")
        else:
            self._reopen(mark)

    def _reopen(self, mark: Mapping[str, int]) -> None:
        self.schedule.count = mark["records"]
        self._count, self._points = mark["snapshots"], mark["points"]
        with reopened(self._path) as file:
            self._file = file
            self._root = root = file["VTKHDF"]
            self._steps = steps = root["Steps"]
            if min(len(steps["Values"]), int(steps.attrs["NSteps"])) < self._count:
                raise ValueError("it does not reach to the checkpoint")
            self._fields = dict(root["PointData"].items())
            # A stop gave back the room that was not used.
            number, room = len(root["Connectivity"]), self._room
            for dataset in (root["Points"], root["Types"], *self._fields.values()):
                dataset.resize(room * number, axis=0)
            root["Offsets"].resize(room * (number + 1), axis=0)
            root["NumberOfPoints"].resize(room, axis=0)
            root["FieldData/barrier_displacement"].resize(room, axis=0)
            steps.visititems(lambda _, item: item.resize(room, axis=0) if isinstance(item, h5py.Dataset) else None)
            self._set_constants()
            steps["Values"].resize(self._count, axis=0)
            steps.attrs.modify("NSteps", self._count)
            self._filled = {name: root[name] for name in FILLED}

    def _set_constants(self) -> None:
        """Numbers that are the same for every snapshot, over the whole room."""
        steps = self._steps
        steps["PartOffsets"][:] = np.arange(self._room)
        steps["NumberOfParts"][:] = 1
        steps["ConnectivityIdOffsets"][:] = 0
        steps["FieldDataOffsets/barrier_displacement"][:] = np.arange(self._room)
        steps["FieldDataSizes/barrier_displacement"][:] = 1  # one component, one tuple

    def mark(self) -> dict[str, int]:
        """Bring everything to the disk and tell where the file stands."""
        assert self._file is not None
        bring_to_disk(self._file, self._path)
        return {"records": self.schedule.count, "snapshots": self._count, "points": self._points}

    def record(self, simulation: Any) -> None:
        """Append one snapshot.

        Raises:
            OSError: it could not be written; those before are kept.
        """
        with failures_of_the_disk():
            self._append(simulation)

    def _append(self, simulation: Any) -> None:
        points = dict(simulation.points())
        position = np.asarray(points.pop("position"))
        if self._count == 0:
            most = max(len(position), getattr(simulation, "material_points", 0))  # more may arrive
            self._lay_out(most, {name: np.asarray(values) for name, values in points.items()})
        assert self._file is not None
        filled = self._filled
        number, begin, step = len(position), self._points, self._count
        _fill(filled["Points"], begin, self._as_vtk("position", position))
        for name, dataset in self._fields.items():
            _fill(dataset, begin, self._as_vtk(name, np.asarray(points[name])))

        # Readers look for a step's offsets after those of the steps before, each one longer than its cells.
        _fill(filled["Offsets"], begin + step, np.arange(number + 1))
        _fill(filled["NumberOfPoints"], step, np.array([number]))
        _fill(filled["Steps/PointOffsets"], step, np.array([begin]))
        _fill(filled["Steps/CellOffsets"], step, np.array([[begin]]))
        displacement = getattr(simulation, "barrier_displacement", None)
        shift = np.nan if displacement is None else displacement
        _fill(filled["FieldData/barrier_displacement"], step, np.array([shift]))
        # The count goes last: until it is written, a reader does not look at the new snapshot. VTK wants as many times
        # as steps, so their data set alone grows, inside the room that is set aside for it.
        self._count, self._points = step + 1, begin + number
        times = filled["Steps/Values"]
        times.id.set_extent((self._count,))
        _fill(times, step, np.array([simulation.time]))
        h5py.h5a.open(self._steps.id, b"NSteps").write(np.array(self._count))
        self._file.flush()

    def _as_vtk(self, name: str, values: np.ndarray) -> np.ndarray:
        """Values in single precision with VTK's components, in a buffer that is used again for the next snapshot."""
        shape = _vtk_shape(values)
        if name not in self._buffers or len(self._buffers[name]) < len(values):
            self._buffers[name] = np.zeros(shape, np.float32)
        buffer = self._buffers[name][: len(values)]
        filled = buffer[:, : values.shape[1]] if values.ndim == 2 else buffer
        filled[...] = values
        return buffer

    def close(self) -> None:
        """Give back the room that was not used and close the file."""
        if self._file is None:
            return
        with failures_of_the_disk():
            try:
                self._give_back()
            finally:
                file, self._file = self._file, None
                file.close()

    def _give_back(self) -> None:
        if self._count > 0:
            for dataset in (self._root["Points"], self._root["Types"], *self._fields.values()):
                dataset.resize(self._points, axis=0)
            self._root["Offsets"].resize(self._points + self._count, axis=0)
            self._root["NumberOfPoints"].resize(self._count, axis=0)
            self._root["FieldData/barrier_displacement"].resize(self._count, axis=0)
            self._steps.visititems(
                lambda _, item: item.resize(self._count, axis=0) if isinstance(item, h5py.Dataset) else None
            )

    def _lay_out(self, number: int, fields: dict[str, np.ndarray]) -> None:
        """Create every group, attribute and data set; `number` is the most points that any snapshot will have."""
        unknown = sorted(fields.keys() - POINT_FIELDS.keys())
        if unknown:
            raise KeyError(f"No unit is known for {', '.join(unknown)}; add it to warp_mpm/quantities/points.py.")
        root, room, number = self._root, self._room, max(number, 1)
        root.attrs["Version"] = np.array([2, 2])
        root.attrs.create("Type", np.bytes_("UnstructuredGrid"))
        self._dataset(root, "Points", room * number, 3, np.float32, chunk=number)
        # As many cells as points, and all fields of a step begin at the same point: one data set under several names.
        self._dataset(root, "NumberOfPoints", room, None, np.int64)
        for name in ("NumberOfCells", "NumberOfConnectivityIds"):
            root[name] = root["NumberOfPoints"]
        # Cell i is the vertex i in every step: the list of vertices is shared, the types are all the fill value.
        root.create_dataset("Connectivity", data=np.arange(number))
        self._dataset(root, "Offsets", room * (number + 1), None, np.int64, chunk=number + 1)
        root.create_dataset(
            "Types", (room * number,), np.uint8, maxshape=(None,), chunks=(number,), fillvalue=VTK_VERTEX
        )

        self._steps = steps = root.create_group("Steps")
        steps.attrs["NSteps"] = 0
        self._dataset(steps, "Values", 1, None, np.float64, chunk=room)
        steps["Values"].attrs["unit"] = "s"
        self._dataset(steps, "PartOffsets", room, None, np.int64)
        self._dataset(steps, "NumberOfParts", room, None, np.int64)
        self._dataset(steps, "PointOffsets", room, None, np.int64)
        self._dataset(steps, "CellOffsets", room, 1, np.int64)
        self._dataset(steps, "ConnectivityIdOffsets", room, 1, np.int64)

        point_data, point_offsets = root.create_group("PointData"), steps.create_group("PointDataOffsets")
        for name, values in fields.items():
            quantity = POINT_FIELDS[name]
            _, *components = _vtk_shape(values)
            columns = components[0] if components else None
            dataset = self._dataset(point_data, name, room * number, columns, np.float32, chunk=number)
            dataset.attrs["unit"], dataset.attrs["meaning"] = quantity.unit, quantity.meaning
            self._fields[name] = dataset
            point_offsets[name] = steps["PointOffsets"]

        field_data, field_offsets = root.create_group("FieldData"), steps.create_group("FieldDataOffsets")
        self._dataset(field_data, "barrier_displacement", room, None, np.float64)
        self._dataset(field_offsets, "barrier_displacement", room, None, np.int64)
        sizes = steps.create_group("FieldDataSizes")
        self._dataset(sizes, "barrier_displacement", room, 2, np.int64)
        self._set_constants()
        self._filled = {name: root[name] for name in FILLED}
        assert self._file is not None
        self._file.flush()

    def _dataset(
        self,
        group: h5py.Group,
        name: str,
        rows: int,
        columns: int | None,
        kind: type,
        chunk: int | None = None,
    ) -> h5py.Dataset:
        """A data set whose room is set aside at once, so that filling it changes nothing in the file's structure."""
        creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        creation.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        if chunk is not None:
            creation.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        trailing = () if columns is None else (columns,)
        creation.set_chunk((chunk or rows, *trailing))
        space = h5py.h5s.create_simple((rows, *trailing), (h5py.h5s.UNLIMITED, *trailing))
        identifier = h5py.h5d.create(
            group.id, name.encode(), h5py.h5t.py_create(np.dtype(kind), logical=True), space, dcpl=creation
        )
        return h5py.Dataset(identifier)


def _vtk_shape(values: np.ndarray) -> tuple[int, ...]:
    """Shape with VTK's components: vectors of three, symmetric tensors of six (xx, yy, zz, xy, yz, xz)."""
    width = {2: 3, 4: 6}.get(values.shape[1] if values.ndim == 2 else 0)
    return values.shape if width is None else (len(values), width)


def _fill(dataset: h5py.Dataset, begin: int, rows: np.ndarray) -> None:
    """Write rows from `begin` on, by HDF5's own call: h5py's indexing takes longer than the writing."""
    space = dataset.id.get_space()
    space.select_hyperslab((begin, *(0 for _ in rows.shape[1:])), rows.shape)
    dataset.id.write(h5py.h5s.create_simple(rows.shape), space, rows)
