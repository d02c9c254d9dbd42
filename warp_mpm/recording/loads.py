"""Loads on the barriers by height and time, in an HDF5 file: what presses and rubs where, slot by slot.

One group for each surface: `edges` [n + 1] along it from its lower or upstream end, `height` and `place` [n + 1] of the
same above the base and downstream of the toe of its barrier, and a row of n means over the interval for each time.
Times are those of the time series, so that forces of both add up. Room for all rows is laid down at the start, as for
the snapshots: a process that is killed leaves a file that opens.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from warp_mpm.kernels import layout as at
from warp_mpm.quantities.time_series import liquid as holds_liquid
from warp_mpm.quantities.time_series import two_phases
from warp_mpm.recording.hdf5 import (
    bring_to_the_disk,
    created,
    failures_of_the_disk,
    reopened,
    room_for,
    set_aside,
)
from warp_mpm.recording.schedule import Schedule
from warp_mpm.simulator.bodies.loads import Stretch

MEANINGS = {
    "normal": "pressure of both phases on the surface, mean over the interval",
    "liquid": "what of it the liquid phase bears",
    "shear": "friction of the flow on the surface, mean over the interval; + along the surface, toward its next slot",
    "pore_pressure": "pressure of the liquid, mean over the interval",
}
"""Data sets of a surface [times, n] in Pa."""

LARGEST_CHUNK = 1024
"""Times that lie together in the file."""


class LoadsRecorder:
    """Writes mean pressures on the slots of the barrier, at the times of the time series."""

    def __init__(self, path: Path, interval: float, end_time: float, *, mark: Mapping[str, Any] | None = None):
        """Create the file with room for the records until `end_time` [s], every `interval` [s] and at the end; or go on
        at an earlier `mark` in it, dropping what was written after that.

        Raises:
            FileExistsError: there is one already.
            RunFolderError: the file does not reach to the mark.
        """
        self.schedule = Schedule(interval)
        self._path = path
        self._room = room_for(interval, end_time)
        self._rows = 0
        self._before: tuple[float, np.ndarray] | None = None
        self._file: h5py.File | None = None
        if mark is None:
            self._file = created(path)
            self._file.attrs["rows"] = 0
            return
        self.schedule.count, self._rows = mark["records"], mark["rows"]
        self._before = (mark["time"], np.array(mark["taken"])) if mark["rows"] else None
        with reopened(path) as file:
            self._file = file
            if int(file.attrs["rows"]) < self._rows:
                raise ValueError("it does not reach to the checkpoint")
            for dataset in self._datasets():
                dataset.resize(self._room, axis=0)
            file.attrs.modify("rows", self._rows)

    def _datasets(self) -> list[h5py.Dataset]:
        """Those with a row for each time."""
        assert self._file is not None
        found = [self._file["time"]]
        for group in self._file.values():
            if isinstance(group, h5py.Group):
                found += [group[name] for name in MEANINGS if name in group]
        return found

    def mark(self) -> dict[str, Any]:
        """Bring everything to the disk and tell where the file stands."""
        assert self._file is not None
        bring_to_the_disk(self._file, self._path)
        time, taken = self._before if self._before is not None else (0.0, np.zeros(0))
        return {"records": self.schedule.count, "rows": self._rows, "time": time, "taken": taken.tolist()}

    def record(self, simulation: Any) -> None:
        """Append one row.

        Raises:
            OSError: it could not be written; those before are kept.
        """
        window = simulation.window()
        mean, before = mean_on_slots(window, self._before)
        with failures_of_the_disk():
            if self._rows == 0:
                self._lay_out(simulation)
            assert self._file is not None
            for stretch in stretches_of(simulation):
                rows = pressures(mean[stretch.slots], stretch, simulation.scenario)
                for name, values in rows.items():
                    self._file[stretch.surface][name][self._rows] = values
            self._file["time"][self._rows] = simulation.time
            # The count goes last: until it is written, a reader does not look at the new row.
            self._rows += 1
            self._file.attrs.modify("rows", self._rows)
            self._file.flush()
        self._before = before

    def _lay_out(self, simulation: Any) -> None:
        """Create every group and data set, with room for all rows."""
        assert self._file is not None
        file, room, chunk = self._file, self._room, min(self._room, LARGEST_CHUNK)
        set_aside(file, "time", (room,), chunk=chunk).attrs["unit"] = "s"
        for stretch in stretches_of(simulation):
            group = file.create_group(stretch.surface)
            x, y = stretch.place(stretch.edges).T
            for name, values in (("edges", stretch.edges), ("place", x), ("height", y)):
                group[name] = values
                group[name].attrs["unit"] = "m"
            for name in pressures(np.zeros((len(stretch), at.SLOT_SIZE)), stretch, simulation.scenario):
                dataset = set_aside(group, name, (room, len(stretch)), chunk=chunk)
                dataset.attrs["unit"], dataset.attrs["meaning"] = "Pa", MEANINGS[name]
        file.flush()

    def close(self) -> None:
        """Give back the room that was not used and close the file."""
        if self._file is None:
            return
        with failures_of_the_disk():
            try:
                if self._rows > 0:
                    for dataset in self._datasets():
                        dataset.resize(self._rows, axis=0)
            finally:
                file, self._file = self._file, None
                file.close()


def stretches_of(simulation: Any) -> list[Stretch]:
    """The surfaces of all barriers, those of the first one first."""
    return [stretch for slots in simulation.slots.values() for stretch in slots.stretches]


def mean_on_slots(window: Any, before: tuple[float, np.ndarray] | None) -> tuple[np.ndarray, tuple[float, np.ndarray]]:
    """Mean impulses [slots, SLOT_SIZE] since a mark, over the time [N/m], nil without one; and the mark for the next.

    Args:
        window: of the simulation, now.
        before: time and impulses of the mark.
    """
    taken = window.taken
    time, sums = before if before is not None else (window.time, taken)
    elapsed = window.time - time
    mean = ((taken - sums) / elapsed if elapsed > 0.0 else np.zeros_like(taken)).reshape(-1, at.SLOT_SIZE)
    return mean, (window.time, taken)


def pressures(mean: np.ndarray, stretch: Stretch, scenario: Any) -> dict[str, np.ndarray]:
    """Mean pressures [n] in Pa on the slots of a surface, by the names of `MEANINGS`, those that the scene tells.

    Args:
        mean: impulses [n, SLOT_SIZE] of the slots, over the time [N/m].
        stretch: the surface.
        scenario: of the run.
    """
    per_length = mean / np.diff(stretch.edges)[:, None]
    normal, liquid, along = per_length.T
    if two_phases(scenario):
        pore = liquid / scenario.flow.material.porosity
        return {"normal": normal + liquid, "liquid": liquid, "shear": along, "pore_pressure": pore}
    found = {"normal": normal, "shear": along}
    # Of one phase the liquid's pressure is found for friction alone.
    return found | ({"pore_pressure": liquid} if stretch.rubs and holds_liquid(scenario) else {})
