"""Time series of an impact from a run folder's `timeseries.csv` or any CSV file whose header names units."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Series = dict[str, Array]

UNITS = {
    "time": {"s": 1.0, "ms": 1e-3},
    "impact_force_x": {"N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6},
    "base_normal_force": {"N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6},
    "flow_kinetic_energy": {"J/m": 1.0, "kJ/m": 1e3, "MJ/m": 1e6},
    "barrier_kinetic_energy": {"J/m": 1.0, "kJ/m": 1e3, "MJ/m": 1e6},
    "barrier_velocity": {"m/s": 1.0},
    "barrier_displacement": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
}
"""Columns that this package reads, with the factors from the units they may have to SI."""

LARGEST = 1e15
"""Value [SI] beyond which a number is a mistake; far below it the square of a number has an end."""

NEEDED = ("time", "impact_force_x")


class TimeSeriesError(ValueError):
    """A time series that cannot be used; one sentence that names the file, the line or column, and what is wrong."""


def read_time_series(path: str | Path) -> Series:
    """Read the columns of `UNITS` that the file has; a folder stands for its `timeseries.csv`.

    The header reads `time [s],impact_force_x [N/m],...`; time increases, and a force is the mean over the interval
    that ends at its time. Other columns are ignored, and so is a last line without an end, which a run that is still
    going leaves behind.

    Returns:
        Arrays [samples] in SI units by column name; `time` and `impact_force_x` are there.

    Raises:
        TimeSeriesError: the file is missing, or a column, unit or number is wrong.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "timeseries.csv"
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise TimeSeriesError(f"{path} cannot be read: {error.strerror or error}.") from None
    except UnicodeDecodeError:
        raise TimeSeriesError(f"{path} is not UTF-8 text.") from None
    header, _, body = text.partition("\n")
    columns = _columns(path, header.strip())
    body = body[: body.rfind("\n") + 1]
    if body.count("\n") < 3:
        raise TimeSeriesError(f"{path} holds fewer than three samples.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a file without rows is only worth a warning to NumPy
            table = np.loadtxt(body.splitlines(), delimiter=",", ndmin=2)
    except (ValueError, UserWarning) as error:
        raise TimeSeriesError(f"{path} holds something else than rows of numbers: {str(error).rstrip('.')}.") from None
    if table.shape[1] != header.count(",") + 1:
        raise TimeSeriesError(
            f"{path} has {header.count(',') + 1} columns in its header, {table.shape[1]} in its rows."
        )
    series = {name: table[:, place] * factor for name, (place, factor) in columns.items()}
    for name, values in series.items():
        bad = np.flatnonzero(~(np.abs(values) <= LARGEST))
        if bad.size:
            raise TimeSeriesError(
                f"{path} line {bad[0] + 2}: {name} is {values[bad[0]]:g}, it must be a finite number of at most "
                f"{LARGEST:g} in size."
            )
    stalled = np.flatnonzero(np.diff(series["time"]) <= 0)
    if stalled.size:
        raise TimeSeriesError(f"{path} line {stalled[0] + 3}: time does not increase.")
    return series


def _columns(path: Path, header: str) -> dict[str, tuple[int, float]]:
    found: dict[str, tuple[int, float]] = {}
    if "," not in header and (";" in header or "\t" in header):
        between = "semicolons" if ";" in header else "tabs"
        raise TimeSeriesError(f"{path}: there are {between} between its columns, where there must be commas.")
    for place, cell in enumerate(header.split(",")):
        name, _, unit = (part.strip() for part in cell.partition("["))
        if name not in UNITS:
            continue
        unit = unit.removesuffix("]").strip()
        if name in found:
            raise TimeSeriesError(f"{path}: column {name} is given twice.")
        if unit not in UNITS[name]:
            allowed = ", ".join(f"[{known}]" for known in UNITS[name])
            raise TimeSeriesError(f"{path}: column {name} has the unit {unit!r}, it must be one of {allowed}.")
        found[name] = (place, UNITS[name][unit])
    for name in NEEDED:
        if name not in found:
            raise TimeSeriesError(f"{path}: column {name} [{next(iter(UNITS[name]))}] is missing.")
    return found
