"""The time series of a run, one line of text per sample."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

from warp_mpm.recording.quantities import TIME_SERIES, check_known
from warp_mpm.recording.run_folder import RunFolderError
from warp_mpm.recording.schedule import Schedule


class TimeSeriesRecorder:
    """Appends the simulation's samples to a CSV file; each line is on its way to the disk before the next step.

    The header gives names and units (`impact_force_x [N/m]`); numbers are written with all their digits.
    """

    def __init__(self, path: Path, interval: float, *, mark: Mapping[str, int] | None = None):
        """Create the file, or go on at an earlier `mark` in it; what was written after that is dropped.

        Raises:
            FileExistsError: there is one already.
            RunFolderError: the file does not reach to the mark.
        """
        self.schedule = Schedule(interval)
        self.latest: dict[str, float] = {}
        """The last sample, for whoever shows progress."""
        self._columns: list[str] = []
        self._file: TextIO
        if mark is None:
            self._file = path.open("x", encoding="utf-8", newline="")
            return
        self.schedule.count = mark["records"]
        try:
            self._file = path.open("r+", encoding="utf-8", newline="")
            header = self._file.readline().rstrip("\n").split(",")
            size = path.stat().st_size
        except OSError as error:
            raise RunFolderError(f"{path} cannot be read: {error.strerror or error}.") from None
        except ValueError as error:
            raise RunFolderError(f"{path} cannot be read: {error}.") from None
        names = {quantity.label: key for key, quantity in TIME_SERIES.items()}
        if size < mark["bytes"] or any(label not in names for label in header):
            self._file.close()
            raise RunFolderError(f"{path} is damaged: it does not reach to the checkpoint.")
        self._columns = [names[label] for label in header]
        self._file.truncate(mark["bytes"])
        self._file.seek(mark["bytes"])

    def mark(self) -> dict[str, int]:
        """Bring everything to the disk and tell where the file stands."""
        self._file.flush()
        os.fsync(self._file.fileno())
        return {"records": self.schedule.count, "bytes": os.fstat(self._file.fileno()).st_size}

    def record(self, simulation: Any) -> None:
        """Append one sample."""
        sample = simulation.sample()
        if not self._columns:
            check_known(set(sample), TIME_SERIES)
            self._columns = [name for name in TIME_SERIES if name in sample]
            self._file.write(",".join(TIME_SERIES[name].label for name in self._columns) + "\n")
        # One write per line, so that a reader at work at the same time sees whole lines.
        self._file.write(",".join(repr(float(sample[name])) for name in self._columns) + "\n")
        self._file.flush()
        self.latest = sample

    def close(self) -> None:
        """Close the file."""
        self._file.close()
