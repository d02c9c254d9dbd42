"""Tables of measurements, which are not shipped: read from a folder that the user gives."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KNOWN: Mapping[str, tuple[str, ...]] = {
    "lobovsky2014_H300_pressure_event_mean_0p02": ("t_star", "p1_z3mm", "p2_z15mm", "p3_z30mm", "p4_z80mm"),
    "lobovsky2014_H300_water_levels": ("gauge", "t_star", "h_star"),
    "lobovsky2014_fronts": ("H_m", "t_star", "x_over_H"),
    "martin_moyce_1952_and_koshizuka_oka_1996": ("series", "T_or_tau", "Z_or_H"),
    "buchner2002_wall_pressure": ("sensor", "t_star", "p_star"),
    **{
        f"usgs_flume_{mix}_rough_x{place}m": ("t_s", "h_m", "sd_h_m", "sigma_kPa", "sd_sigma_kPa", "p_kPa", "sd_p_kPa")
        for mix in ("SGM", "SG")
        for place in (32, 66, 90)
    },
}
"""Columns that cases read, by the table's name, which is that of its file without `.csv`."""


class Table:
    """Columns of a table by their name, as in its header."""

    def __init__(self, columns: Mapping[str, list[str]]):
        self._columns = columns

    def text(self, name: str) -> NDArray[np.str_]:
        """A column as it stands."""
        return np.array(self._columns[name])

    def numbers(self, name: str, *, where: Mapping[str, str] | None = None) -> Array:
        """A column of numbers, of the rows in which other columns hold these words."""
        kept = np.ones(len(self._columns[name]), dtype=bool)
        for other, word in (where or {}).items():
            kept &= self.text(other) == word
        return self.text(name)[kept].astype(float)


WORDS = ("gauge", "series", "sensor", "run")
"""Columns that hold no numbers."""


def read_table(path: Path, needed: tuple[str, ...]) -> Table:
    """A comma-separated table whose first lines, up to its header, may begin with #.

    Args:
        path: of the file.
        needed: columns that it must have; of the others none is looked at.

    Raises:
        ValueError: the file is no such table; one sentence with the line.
        OSError: it cannot be read.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"{path} is no text file; it must be a table of comma-separated values.") from None
    numbered = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(line for _, line in numbered))
    header = [name.strip() for name in rows[0]] if rows else []
    missing = [name for name in needed if name not in header]
    if missing:
        raise ValueError(f"{path} has no column {missing[0]}; it must have {', '.join(needed)}.")
    if len(rows) < 3:
        raise ValueError(f"{path} has {len(rows) - 1} rows; it must have at least two.")
    columns: dict[str, list[str]] = {name: [] for name in needed}
    for (number, _), row in zip(numbered[1:], rows[1:], strict=True):
        if len(row) != len(header):
            raise ValueError(f"{path} line {number} has {len(row)} values; it must have {len(header)}.")
        for name in needed:
            value = row[header.index(name)].strip()
            if name not in WORDS and not _is_number(value):
                raise ValueError(f"{path} line {number}: {name} = {value[:40]!r} must be a number.")
            columns[name].append(value)
    return Table(columns)


def _is_number(value: str) -> bool:
    try:
        return bool(np.isfinite(float(value)))
    except ValueError:
        return False


class Tables:
    """The tables of a folder, those of `KNOWN` that it has; without a folder there are none."""

    def __init__(self, folder: Path | None = None):
        """Read them all, so that what is wrong with one is told before anything is computed.

        Raises:
            ValueError: the folder is none, holds none of the tables, or one of them is not as it must be.
        """
        self._tables: dict[str, Table] = {}
        if folder is None:
            return
        if not folder.is_dir():
            raise ValueError(f"--data {folder} is no folder; it must hold tables of measurements.")
        for name, needed in KNOWN.items():
            file = folder / f"{name}.csv"
            if file.is_file():
                self._tables[name] = read_table(file, needed)
        if not self._tables:
            raise ValueError(
                f"--data {folder} holds no table of measurements; it must hold some of {', '.join(KNOWN)}."
            )

    def get(self, name: str) -> Table | None:
        """A table of `KNOWN`; None where it is not there."""
        if name not in KNOWN:
            raise KeyError(name)
        return self._tables.get(name)

    @property
    def names(self) -> tuple[str, ...]:
        """Those that are there."""
        return tuple(self._tables)
