"""Measured impact events: reading a table of them, and how well each pressure model meets them.

The field data of the paper (139 events of the Jiangjia Ravine) are not public. `synthetic_events` generates a set to
the published ranges; wherever it appears it is marked SYNTHETIC.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analytic.empirical import EmpiricalModel
from analytic.impact import STANDARD_GRAVITY
from analytic.whole_file import write_whole

Array = NDArray[np.float64]

SYNTHETIC = "SYNTHETIC"
"""The mark of a data set that was generated, not measured."""

UNITS = {
    "density": {"kg/m3": 1.0, "t/m3": 1e3, "g/cm3": 1e3},
    "speed": {"m/s": 1.0, "km/h": 1 / 3.6},
    "height": {"m": 1.0, "cm": 1e-2},
    "peak_pressure": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6},
}
"""Columns that a table of events needs, and the factors from the units they may have to SI."""

PLAUSIBLE = {
    "density": (500.0, 4000.0),
    "speed": (0.01, 100.0),
    "height": (0.001, 100.0),
    "peak_pressure": (1.0, 1e8),
}
"""Ranges [SI] beyond which a value is taken for a mistake of the unit or of the pen."""

PLAUSIBLE_RATIO = (0.02, 50.0)
"""The same for p / (rho (v^2 + g h))."""

SHOWN_PROBLEMS = 10
"""Problems that an error names one by one."""


class FieldDataError(ValueError):
    """A table of events that cannot be used. `problems` holds one sentence for each."""

    def __init__(self, path: Path, problems: Sequence[str]):
        shown = list(problems[:SHOWN_PROBLEMS])
        if len(problems) > SHOWN_PROBLEMS:
            shown.append(f"... and {len(problems) - SHOWN_PROBLEMS} more.")
        super().__init__("\n".join(f"{path}: {problem}" for problem in shown))
        self.problems = tuple(problems)


@dataclass(frozen=True)
class Events:
    """Impact events; arrays of one length, SI units."""

    density: Array
    speed: Array
    height: Array
    peak_pressure: Array
    synthetic: bool
    """Whether the table says that it was generated."""

    def __len__(self) -> int:
        return len(self.density)


def read_events(path: str | Path) -> Events:
    """Read a CSV table of events.

    Lines before the header may begin with `#`; if one says SYNTHETIC, the set is taken as generated. The header
    names the columns with their units, `density [kg/m3],speed [m/s],height [m],peak_pressure [kPa]`; other columns
    are ignored. Commas, semicolons or tabs separate; numbers have a decimal point.

    Raises:
        FieldDataError: the file, its header or a row is wrong; one sentence for each problem.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise FieldDataError(path, [f"cannot be read: {error.strerror or error}."]) from None
    except UnicodeDecodeError:
        raise FieldDataError(path, ["is not UTF-8 text."]) from None
    numbered = [(number, line) for number, line in enumerate(lines, start=1) if line.strip()]
    comments = [line for _, line in numbered if line.lstrip().startswith("#")]
    table = [(number, line) for number, line in numbered if not line.lstrip().startswith("#")]
    if len(table) < 2:
        raise FieldDataError(path, ["holds no event; the first line names the columns, each further line is an event."])
    header = table[0][1]
    delimiter = max(",;\t", key=header.count)
    names, problem = _cells(*table[0], delimiter)
    if problem:
        raise FieldDataError(path, [problem])
    columns, width = _columns(path, names), len(names)
    problems: list[str] = []
    values: dict[str, list[float]] = {name: [] for name in UNITS}
    for number, line in table[1:]:
        cells, problem = _cells(number, line, delimiter)
        if problem:
            problems.append(problem)
            continue
        if len(cells) != width:
            problems.append(f"line {number} has {len(cells)} cells, the header has {width}.")
            continue
        row, found = _row(number, cells, columns)
        problems += found
        for name, value in row.items():
            values[name].append(value)
    if problems:
        raise FieldDataError(path, problems)
    arrays = {name: np.array(column) for name, column in values.items()}
    return Events(**arrays, synthetic=any(SYNTHETIC in line for line in comments))


def _cells(number: int, line: str, delimiter: str) -> tuple[list[str], str]:
    """Cells of one line, and what is wrong with it; a quoted cell does not go on in the next line."""
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=True))], ""
    except csv.Error as error:
        if "unexpected end of data" in str(error):
            return [], f"line {number} opens a quote that is not closed in the line; an event is one line."
        if "field larger" in str(error):
            return [], f"line {number} has a cell of more than {csv.field_size_limit():,} characters."
        return [], f"line {number} cannot be split into cells: {error}."


def _columns(path: Path, header: list[str]) -> dict[str, tuple[int, str]]:
    """Place and unit of every needed column."""
    found: dict[str, tuple[int, str]] = {}
    problems = []
    for place, cell in enumerate(header):
        name, _, unit = cell.partition("[")
        name, unit, units = name.strip(), unit.strip().removesuffix("]").replace("³", "3"), UNITS.get(name.strip())
        if units is None:
            continue
        if name in found:
            problems.append(f"column {name} is given twice, in {found[name][1]} and in {unit or 'no unit'}.")
        elif unit not in units:
            shown = f"the unit {unit!r}" if unit else "no unit"
            problems.append(f"column {name} has {shown}, it must be one of {', '.join(f'[{name}]' for name in units)}.")
        else:
            found[name] = (place, unit)
    named = {cell.partition("[")[0].strip() for cell in header}
    problems += [f"column {name} [{next(iter(UNITS[name]))}] is missing." for name in UNITS if name not in named]
    if problems:
        raise FieldDataError(path, problems)
    return found


def _row(number: int, cells: list[str], columns: dict[str, tuple[int, str]]) -> tuple[dict[str, float], list[str]]:
    """Values [SI] and problems of one line."""
    row, problems = {}, []
    for name, (place, unit) in columns.items():
        cell, factor = cells[place].strip(), UNITS[name][unit]
        low, high = (bound / factor for bound in PLAUSIBLE[name])
        try:
            value = float(cell)
        except ValueError:
            problems.append(f"line {number}: {name} is {cell!r}, it must be a plain number in {unit}.")
            continue
        if not low <= value <= high:
            problems.append(f"line {number}: {name} is {value:g} {unit}, it must be in [{low:g}, {high:g}] {unit}.")
            continue
        row[name] = value * factor
    if len(row) == len(UNITS):
        ratio = row["peak_pressure"] / (row["density"] * (row["speed"] ** 2 + STANDARD_GRAVITY * row["height"]))
        if not PLAUSIBLE_RATIO[0] <= ratio <= PLAUSIBLE_RATIO[1]:
            low, high = PLAUSIBLE_RATIO
            problems.append(
                f"line {number}: peak_pressure is {ratio:.3g} times density (speed^2 + g height), it must be in "
                f"[{low:g}, {high:g}]; is it in {columns['peak_pressure'][1]}?"
            )
    return row, problems


# --- how well a model meets the events -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Agreement:
    """One model against the events."""

    model: EmpiricalModel
    pressure: Array
    """Computed peak pressure of each event [Pa]."""
    slope: float
    """Of the line through the origin that fits computed over measured pressures by least squares [-]."""
    scatter: float
    """Standard deviation of computed / measured over its mean [-]."""
    relative_error: Array
    """(computed - measured) / computed of each event, as the paper defines it: at most 1 [-]."""


def agreement(model: EmpiricalModel, events: Events) -> Agreement:
    """How well `model` meets `events`."""
    computed = model.pressure(events.density, events.speed, events.height)
    measured = events.peak_pressure
    ratio = computed / measured
    return Agreement(
        model=model,
        pressure=computed,
        slope=float(computed @ measured / (measured @ measured)),
        scatter=float(np.std(ratio) / np.mean(ratio)),
        relative_error=(computed - measured) / computed,
    )


# --- the generated set -----------------------------------------------------------------------------------------------

PUBLISHED_RANGES = {
    "density": (1600.0, 2300.0),
    "speed": (3.0, 14.0),
    "height": (0.2, 2.7),
}
"""Ranges of the 139 field events as the paper states them (section 3.3) [SI]."""


def synthetic_events(count: int = 139, seed: int = 1) -> Events:
    """A generated set of events within the published ranges, with p = 0.90 rho v^2 and no scatter.

    Speed and depth are lognormal (means 8 m/s and 0.71 m, standard deviations of the logarithm 0.28 and 0.5,
    correlation 0.5), the density is normal (2100, 130 kg/m^3), all clipped to the ranges. With this population, and
    hardly any other, the published slopes of Armanini's and Cui's formulas come out together; it stands in for data
    that are not public, and proves nothing about any model.
    """
    draw = np.random.default_rng(seed)
    first, second = draw.standard_normal((2, count))
    second = 0.5 * first + math.sqrt(1 - 0.5**2) * second
    speed = _lognormal(8.0, 0.28, first)
    height = _lognormal(0.71, 0.5, second)
    density = 2100 + 130 * draw.standard_normal(count)
    clipped = {
        name: np.clip(values, *PUBLISHED_RANGES[name])
        for name, values in (("density", density), ("speed", speed), ("height", height))
    }
    return Events(**clipped, peak_pressure=0.9 * clipped["density"] * clipped["speed"] ** 2, synthetic=True)


def _lognormal(mean: float, sigma: float, normal: Array) -> Array:
    return mean * np.exp(sigma * normal - sigma**2 / 2)


def write_events(events: Events, path: str | Path, remarks: Iterable[str] = ()) -> None:
    """Write a table that `read_events` reads; a synthetic set says so in its first line."""
    marks = [f"{SYNTHETIC}: generated, not measured."] if events.synthetic else []
    lines = [f"# {line}" for line in [*marks, *remarks]]
    lines.append("density [kg/m3],speed [m/s],height [m],peak_pressure [kPa]")
    for row in zip(events.density, events.speed, events.height, events.peak_pressure / 1e3, strict=True):
        lines.append("{:.1f},{:.4f},{:.4f},{:.4f}".format(*row))
    write_whole(Path(path), "\n".join(lines) + "\n")
