"""The time series of a run, one line of text per sample."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TextIO

from warp_mpm.recording.quantities import TIME_SERIES, check_known
from warp_mpm.recording.schedule import Schedule


class TimeSeriesRecorder:
    """Appends the simulation's samples to a CSV file; each line is on its way to the disk before the next step.

    The header gives names and units (`impact_force_x [N/m]`); numbers are written with all their digits.
    """

    def __init__(self, path: Path, interval: float):
        """Create the file.

        Raises:
            FileExistsError: there is one already.
        """
        self.schedule = Schedule(interval)
        self.latest: dict[str, float] = {}
        """The last sample, for whoever shows progress."""
        self._columns: list[str] = []
        self._file: TextIO = path.open("x", encoding="utf-8", newline="")

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
