"""The time series of a run, one line of text per sample."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TextIO

from warp_mpm.quantities import TIME_SERIES, Quantity, quantity_of_column
from warp_mpm.recording.run_folder import RunFolderError
from warp_mpm.recording.schedule import Schedule
from warp_mpm.state.samples import Window


def column_named(heading: str) -> Quantity | None:
    """Quantity of the column with this heading; None where no run writes such a column."""
    quantity = quantity_of_column(heading.partition(" [")[0])
    return quantity if quantity is not None and quantity.heading == heading else None


class TimeSeriesRecorder:
    """Appends the simulation's samples to a CSV file; each line is on its way to the disk before the next step.

    The header gives names and units (`impact_force_x [N/m]`); numbers are written with all their digits.
    """

    def __init__(
        self,
        path: Path,
        interval: float,
        *,
        quantities: Collection[str] | None = None,
        mark: Mapping[str, Any] | None = None,
    ):
        """Create the file, or go on at an earlier `mark` in it; what was written after that is dropped.

        Args:
            path: of the file.
            interval: [s] between samples.
            quantities: keys of those that are recorded; None: all that the simulation has.
            mark: from `mark`.

        Raises:
            FileExistsError: there is one already.
            RunFolderError: the file does not reach to the mark.
        """
        self.schedule = Schedule(interval)
        self.latest: dict[str, float] = {}
        """The last sample, for whoever shows progress."""
        self._quantities = quantities
        self._columns: list[str] = []
        self._window: Any = None
        """When the sample before was taken; the forces of the next one are means since then."""
        self._file: TextIO
        if mark is None:
            self._file = path.open("x", encoding="utf-8", newline="")
            return
        self.schedule.count = mark["records"]
        self._window = Window.of(mark["window"]) if mark["window"] is not None else None
        try:
            self._file = path.open("r+", encoding="utf-8", newline="")
            header = self._file.readline().rstrip("\n").split(",")
            size = path.stat().st_size
        except OSError as error:
            raise RunFolderError(f"{path} cannot be read: {error.strerror or error}.") from None
        except ValueError as error:
            raise RunFolderError(f"{path} cannot be read: {error}.") from None
        found = {heading: column_named(heading) for heading in header}
        unknown = [heading for heading, quantity in found.items() if quantity is None]
        if size < mark["bytes"] or unknown == [""]:
            self._file.close()
            raise RunFolderError(f"{path} is damaged: it does not reach to the checkpoint.")
        if unknown:
            self._file.close()
            raise RunFolderError(
                f"{path} has the column {unknown[0]!r}, which no run writes by itself; the script that registered the "
                "quantity can go on with the run."
            )
        self._columns = [getattr(quantity, "key", "") for quantity in found.values()]
        self._file.truncate(mark["bytes"])
        self._file.seek(mark["bytes"])

    def mark(self) -> dict[str, Any]:
        """Bring everything to the disk and tell where the file stands, and when the last sample was taken."""
        self._file.flush()
        os.fsync(self._file.fileno())
        window = self._window.plain() if self._window is not None else None
        return {"records": self.schedule.count, "bytes": os.fstat(self._file.fileno()).st_size, "window": window}

    def record(self, simulation: Any) -> None:
        """Append one sample."""
        sample = simulation.sample(self._quantities, since=self._window)
        self._window = simulation.window().after(self._window)
        if not self._columns:
            self._columns = [key for key in dict.fromkeys((*TIME_SERIES, *sample)) if key in sample]
            self._file.write(",".join(_quantity(key).heading for key in self._columns) + "\n")
        # One write per line, so that a reader at work at the same time sees whole lines.
        self._file.write(",".join(repr(float(sample[name])) for name in self._columns) + "\n")
        self._file.flush()
        self.latest = sample

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _quantity(key: str) -> Quantity:
    """Of a sample's entry.

    Raises:
        KeyError: it has no entry in the table, so that its unit would go unsaid.
    """
    quantity = TIME_SERIES.get(key) or quantity_of_column(key)
    if quantity is None:
        raise KeyError(f"No unit is known for {key}; add it to warp_mpm/quantities/time_series.py.")
    return quantity
