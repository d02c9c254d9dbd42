"""Reading a run folder: the one place that knows how runs are stored.

results = Results.open("runs/set_iib")
results.time_series["impact_force_x"]          # [samples] N/m
results.snapshots.at(1.0)["pore_pressure"]     # [points] Pa
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import NoneType, TracebackType
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from warp_mpm.extras import missing
from warp_mpm.quantities import SUMMED_UP, Quantity, quantity_of_column
from warp_mpm.quantities.figures import NUMBERS
from warp_mpm.quantities.points import POINT_FIELDS, POSITION
from warp_mpm.quantities.time_series import NAMED
from warp_mpm.recording import run_folder
from warp_mpm.recording.loads import MEANINGS
from warp_mpm.recording.time_series import column_named
from warp_mpm.scenario import Scenario
from warp_mpm.snapshot import Snapshot

Array = NDArray[np.float64]

COMPONENTS = {"solid_velocity": 2, "liquid_velocity": 2, "effective_stress": 4}
"""Components of a field in the plane; VTK's others are zero."""


RECORD_KINDS: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(("status", "title", "scenario_file", "started", "ended", "device", "machine"), (str,)),
    **dict.fromkeys(("problem", "git_commit"), (str, NoneType)),
    "git_changed": (bool, NoneType),
    **dict.fromkeys(("command", "resumed"), (list,)),
    **dict.fromkeys(("effects", "versions", "quantities"), (dict,)),
    **dict.fromkeys(("preparation_time", "simulated_time", "wall_time"), (int, float)),
    **dict.fromkeys(("time_step_min", "time_step_max"), (int, float, NoneType)),
    **dict.fromkeys(("material_points", "steps", "points_left", "points_pushed_out", "voids_closed"), (int,)),
    **dict.fromkeys(("gaps_bounded", "barrier_iterations", "barrier_unconverged"), (int,)),
    **dict.fromkeys((f"steps_limited_by_{limit}" for limit in ("wave", "drag", "law", "output")), (int,)),
}
"""What the entries of a run's record are, as far as anyone reads them."""

_NUMBER = (int, float, NoneType)

SUMMARY_KINDS: dict[str, tuple[type, ...]] = {
    **dict.fromkeys(NUMBERS, _NUMBER),
    **dict.fromkeys(("force_still_rises", "barrier_at_rest"), (bool, NoneType)),
    **dict.fromkeys(("title", "status", "time_step_limit", "mechanism"), (str, NoneType)),
    **dict.fromkeys(("definitions", "mechanism_measures", "not_recorded", "verdict"), (dict, NoneType)),
    "notes": (list,),
    "barriers": (list, NoneType),
}
"""The same of its summary; figures of quantities that a script records are numbers too."""

PRECISIONS = ("float64", "float32")
"""What `effects.precision` of a record may be."""

_WORDS = {str: "a text", NoneType: "null", bool: "true or false", list: "a list", dict: "a group of fields"}


class ResultsError(ValueError):
    """A run folder that cannot be read; the message names the file and what is wrong with it."""


class Snapshots:
    """The snapshots of a run, read one at a time. A context manager; `close` sets the file free."""

    def __init__(self, path: str | Path):
        """Open the file.

        Raises:
            ResultsError: it is missing or damaged.
        """
        self._path = path = Path(path)
        try:
            self._file = h5py.File(path, "r", locking=False)
        except OSError as error:
            if isinstance(error, FileNotFoundError):
                reason = "is missing"
            elif error.errno is not None:  # of the system, not of what is in the file
                reason = f"cannot be read: {os.strerror(error.errno)}"
            else:
                reason = f"cannot be read as HDF5: {error}"
            raise ResultsError(f"{path} {reason}.") from None
        try:
            self._root = self._file["VTKHDF"]
            steps = self._root["Steps"]
            self._count = min(int(steps.attrs["NSteps"]), len(steps["Values"]))
            self.times: Array = steps["Values"][: self._count]
            self._begin = steps["PointOffsets"][: self._count]
            self._number = self._root["NumberOfPoints"][: self._count]
            self.names: tuple[str, ...] = tuple(name for name in POINT_FIELDS if name in self._root["PointData"])
        except KeyError as error:
            self._file.close()
            raise ResultsError(f"{path} does not hold the snapshots of a run: {error}.") from None

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Snapshot]:
        return (self[index] for index in range(self._count))

    def __getitem__(self, index: int) -> Snapshot:
        """Snapshot by its number; negative numbers count from the end.

        Raises:
            IndexError: there is no such snapshot.
            ResultsError: the file ends too early.
        """
        if not -self._count <= index < self._count:
            raise IndexError(f"{self._path} holds {self._count} snapshots; there is none with number {index}.")
        index %= self._count
        rows = slice(int(self._begin[index]), int(self._begin[index] + self._number[index]))
        try:
            fields = {}
            for name in self.names:
                values = self._root["PointData"][name][rows].astype(float)
                fields[name] = values[:, : COMPONENTS[name]] if name in COMPONENTS else values
            displacement = float(self._root["FieldData/barrier_displacement"][index])
            position = self._root["Points"][rows, :2].astype(float)
        except (OSError, KeyError) as error:
            raise ResultsError(f"{self._path} is damaged: {error}.") from None
        return Snapshot(
            time=float(self.times[index]),
            barrier_displacement=None if np.isnan(displacement) else displacement,
            position=position,
            fields=fields,
        )

    def at(self, time: float) -> Snapshot:
        """The snapshot nearest to `time` [s].

        Raises:
            ResultsError: there is no snapshot at all.
        """
        if self._count == 0:
            raise ResultsError(f"{self._path} holds no snapshot.")
        return self[int(np.argmin(np.abs(self.times - time)))]

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@dataclass(frozen=True)
class SurfaceLoads:
    """What acted on a surface of a barrier, in n slots, at T times; pressures are means over the interval."""

    edges: Array
    """[n + 1] of the slots, along the surface [m]."""
    place: Array
    """[n + 1] the same downstream of the toe, before the barrier moves [m]."""
    height: Array
    """[n + 1] the same above the base [m]."""
    pressures: Mapping[str, Array]
    """[T, n] each in Pa: `normal` of both phases, `liquid` what of it the liquid phase bears, `shear` along the surface
    toward its next slot, `pore_pressure`; those that the scene tells."""


@dataclass(frozen=True)
class Loads:
    """Loads on the barriers by height and time."""

    times: Array
    """[T] ends of the intervals [s]."""
    surfaces: Mapping[str, SurfaceLoads]
    """`impact`, `top` and `back`, those that the barrier has, and `NAME_face`, `NAME_top` and `NAME_back` of each
    further one."""


def read_loads(path: str | Path) -> Loads:
    """Loads by height from a run's `loads.h5`.

    Raises:
        ResultsError: the file is missing or damaged.
    """
    path = Path(path)
    try:
        with h5py.File(path, "r", locking=False) as file:
            rows = int(file.attrs["rows"])
            groups = [name for name in file if isinstance(file[name], h5py.Group)]
            names = [name for name in ("impact", "top", "back") if name in groups]
            names += [name for name in groups if name not in names]
            surfaces = {
                name: SurfaceLoads(
                    file[name]["edges"][()],
                    file[name]["place"][()],
                    file[name]["height"][()],
                    {kind: file[name][kind][:rows] for kind in MEANINGS if kind in file[name]},
                )
                for name in names
            }
            return Loads(file["time"][:rows], surfaces)
    except FileNotFoundError:
        raise ResultsError(f"{path} is missing: output.loads_by_height = true records it.") from None
    except OSError as error:
        reason = f"read: {os.strerror(error.errno)}" if error.errno is not None else f"read as HDF5: {error}"
        raise ResultsError(f"{path} cannot be {reason}.") from None
    except (KeyError, ValueError) as error:
        raise ResultsError(f"{path} does not hold the loads of a run: {error}.") from None


class Results:
    """A run folder, read as it is asked for."""

    def __init__(self, path: str | Path):
        self.path = Path(path)

    @classmethod
    def open(cls, path: str | Path) -> Results:
        """The results in a run folder, of a run that ended or still goes on.

        Raises:
            ResultsError: the folder is missing, is no run's, or is of a version whose layout is another.
        """
        folder = Path(path)
        try:
            if not (folder / run_folder.RECORD).is_file():
                reason = "holds no run (run.json is missing)" if folder.is_dir() else "is no folder"
                raise ResultsError(f"{folder} {reason}.")
        except OSError as error:
            raise ResultsError(f"{folder} cannot be read: {error.strerror or error}.") from None
        results = cls(folder)
        layout = results.record.get("format")
        if layout != run_folder.FORMAT:
            raise ResultsError(
                f"{folder / run_folder.RECORD} has format = {layout!r}, which another version wrote; "
                f"this one reads {run_folder.FORMAT}."
            )
        return results

    @cached_property
    def scenario(self) -> Scenario:
        """The resolved scenario.

        Raises:
            ScenarioError: the file is missing or damaged.
        """
        return Scenario.load(self.path / run_folder.SCENARIO)

    @cached_property
    def record(self) -> dict[str, Any]:
        """Versions, device, status and times of the run.

        Raises:
            ResultsError: the file is missing or damaged, or an entry is of another kind than a run writes.
        """
        record = self._json(run_folder.RECORD, RECORD_KINDS.get)
        precision = record.get("effects", {}).get("precision", PRECISIONS[0])
        if precision not in PRECISIONS:
            raise ResultsError(
                f"{self.path / run_folder.RECORD} is damaged: effects.precision = {json.dumps(precision)[:80]} must be "
                f"{' or '.join(PRECISIONS)}."
            )
        return record

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Key figures of the run.

        Raises:
            ResultsError: the run has not come to its end, or the file is damaged.
        """
        if not (self.path / run_folder.SUMMARY).exists():
            raise ResultsError(
                f"{self.path / run_folder.SUMMARY} is missing: the run has not come to its end; to go on with it: "
                f"python -m warp_mpm run --resume {self.path}"
            )
        return self._json(run_folder.SUMMARY, _kinds_of_figure)

    @cached_property
    def time_series(self) -> dict[str, Array]:
        """Columns by name, each [samples] in SI units; a last line that was cut off is left out.

        Raises:
            ResultsError: the file is missing or damaged.
        """
        return read_time_series(self.path / run_folder.TIME_SERIES, self._own_quantities())

    def barrier_displacements(self, snapshot: Snapshot) -> dict[str, float]:
        """Displacement [m] of every barrier at the time of a snapshot, by its name.

        Raises:
            ResultsError: the time series is missing or damaged.
        """
        found = {"barrier": snapshot.barrier_displacement or 0.0}
        for one in self.scenario.barriers:
            column = f"{one.name}_barrier_displacement"
            if one.motion.kind != "fixed" and column in self.time_series:
                found[one.name] = float(np.interp(snapshot.time, self.time_series["time"], self.time_series[column]))
        return found

    @cached_property
    def quantities(self) -> dict[str, Quantity]:
        """What the columns of the time series are, by name.

        Raises:
            ResultsError: the time series or the record is missing or damaged.
        """
        own = self._own_quantities()
        found = {name: own.get(name) or quantity_of_column(name) for name in self.time_series}
        return {name: quantity for name, quantity in found.items() if quantity is not None}

    def _own_quantities(self) -> dict[str, Quantity]:
        """Those that the script registered which made the run."""
        if not (self.path / run_folder.RECORD).exists():
            return {}
        own = {}
        for name, said in self.record.get("quantities", {}).items():
            try:
                unit, meaning, label, symbol = (str(said[part]) for part in ("unit", "meaning", "label", "symbol"))
                own[name] = Quantity(name, unit, meaning, label, symbol)
            except (KeyError, TypeError):
                raise ResultsError(
                    f"{self.path / run_folder.RECORD} is damaged: quantities.{name} = {json.dumps(said)[:80]} must be "
                    "a group of unit, meaning, label and symbol."
                ) from None
        return own

    def frame(self) -> Any:
        """The time series as a pandas DataFrame, indexed by time [s]; `frame.attrs["units"]` has each column's unit and
        `frame.attrs["meanings"]` what it is. Needs pandas, of the extra `xarray`.

        Raises:
            ModuleNotFoundError: pandas is not installed; the sentence says what to install.
            ResultsError: the file is missing or damaged.
        """
        pd = _optional("Results.frame()", "pandas")

        series = self.time_series
        known = self.quantities
        columns = {name: values for name, values in series.items() if name != "time"}
        frame = pd.DataFrame(columns, index=pd.Index(series["time"], name="time"))
        frame.attrs["units"] = {name: quantity.unit for name, quantity in known.items()}
        frame.attrs["meanings"] = {name: quantity.meaning for name, quantity in known.items()}
        return frame

    def dataset(self) -> Any:
        """The snapshots as an xarray Dataset over (time, point), with `units` and `long_name` on every variable; the
        time series of the barrier's displacement goes with them. Needs xarray, of the extra of that name.

        Where points have left the domain, the rows of later times are filled up with NaN, and a row is then no longer
        the same point at all times.

        Raises:
            ModuleNotFoundError: xarray is not installed; the sentence says what to install.
            ResultsError: the file is missing or damaged.
        """
        xr = _optional("Results.dataset()", "xarray")

        frames = list(self.snapshots)
        most = max((len(frame.position) for frame in frames), default=0)

        def stacked(arrays: list[Array]) -> Array:
            whole = np.full((len(arrays), most, *arrays[0].shape[1:]), np.nan)
            for index, values in enumerate(arrays):
                whole[index, : len(values)] = values
            return whole

        kinds = {1: (), 2: ("axis",), 4: ("component",)}
        variables: dict[str, Any] = {}
        for name in ("position", *self.snapshots.names):
            arrays = [frame.position if name == "position" else frame[name] for frame in frames]
            width = arrays[0].shape[1] if arrays[0].ndim == 2 else 1
            one = POINT_FIELDS.get(name, POSITION)
            said = {"units": one.unit, "long_name": one.meaning}
            variables[name] = (("time", "point", *kinds[width]), stacked(arrays), said)
        shifts = [np.nan if frame.barrier_displacement is None else frame.barrier_displacement for frame in frames]
        moved = NAMED["barrier_displacement"]
        variables[moved.name] = ("time", shifts, {"units": moved.unit, "long_name": moved.meaning})
        coordinates = {
            "time": ("time", [frame.time for frame in frames], {"units": "s"}),
            "axis": ["x", "y"],
            "component": ["xx", "yy", "zz", "xy"],
        }
        return xr.Dataset(variables, coordinates, {"title": self.scenario.title})

    @cached_property
    def loads(self) -> Loads:
        """Loads on the barrier by height and time, of a run with `output.loads_by_height`.

        Raises:
            ResultsError: the file is missing or damaged.
        """
        return read_loads(self.path / run_folder.LOADS)

    @cached_property
    def snapshots(self) -> Snapshots:
        """The snapshots, read one at a time.

        Raises:
            ResultsError: the file is missing or damaged.
        """
        return Snapshots(self.path / run_folder.SNAPSHOTS)

    def _json(self, name: str, kinds_of: Callable[[str], tuple[type, ...] | None]) -> dict[str, Any]:
        """A group of fields, each of the kinds that `kinds_of` tells for its name, if any."""
        try:
            content = json.loads((self.path / name).read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise ResultsError(f"{self.path / name} is missing.") from None
        except OSError as error:
            raise ResultsError(f"{self.path / name} cannot be read: {error.strerror or error}.") from None
        except (ValueError, RecursionError) as error:
            raise ResultsError(f"{self.path / name} cannot be read: {error}.") from None
        if not isinstance(content, dict):
            raise ResultsError(f"{self.path / name} does not hold a group of fields.")
        for entry, value in content.items():
            kinds = kinds_of(entry)
            if kinds is None:
                continue
            right = isinstance(value, kinds) and (bool in kinds or not isinstance(value, bool))
            if not (right and (not isinstance(value, float) or math.isfinite(value))):
                words = [_WORDS[kind] for kind in kinds if kind in _WORDS]
                words += ["a number" if float in kinds else "a whole number"] if int in kinds else []
                raise ResultsError(
                    f"{self.path / name} is damaged: {entry} = {json.dumps(value)[:80]} must be {' or '.join(words)}."
                )
        return content


def _kinds_of_figure(name: str) -> tuple[type, ...] | None:
    """Kinds of an entry of a summary; None where any will do."""
    of_own_quantity = name.endswith(tuple(f"_{figure}" for figure in SUMMED_UP))
    return SUMMARY_KINDS.get(name, _NUMBER if of_own_quantity else None)


def _optional(what: str, package: str) -> Any:
    """An optional package as a module.

    Raises:
        ModuleNotFoundError: it is not installed; the sentence says what to install.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError:
        raise ModuleNotFoundError(missing(what, package, "xarray"), name=package) from None


def read_time_series(path: str | Path, own: Mapping[str, Quantity] | None = None) -> dict[str, Array]:
    """Columns of a run's `timeseries.csv` by name (without unit), each [samples].

    Args:
        path: of the file.
        own: quantities that the run's script registered, by name.

    Raises:
        ResultsError: the file is missing or damaged, a number in it is not finite, or its time does not increase.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")  # a spreadsheet that saved it puts a mark in front
    except FileNotFoundError:
        raise ResultsError(f"{path} is missing.") from None
    except OSError as error:
        raise ResultsError(f"{path} cannot be read: {error.strerror or error}.") from None
    except ValueError as error:
        raise ResultsError(f"{path} cannot be read: {error}.") from None
    lines = text.split("\n")[:-1]  # what follows the last line's end is empty, or a line that was cut off
    if not lines:
        raise ResultsError(f"{path} is empty.")
    header = lines[0].split(",")
    headings = {one.heading for one in (own or {}).values()}
    unknown = [heading for heading in header if column_named(heading) is None and heading not in headings]
    if unknown:
        raise ResultsError(f"{path} has the column {unknown[0]!r}, which no run writes.")
    names = [label.partition(" [")[0] for label in header]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ResultsError(f"{path} has the column {twice[0]!r} twice.")
    if "time" not in names:
        raise ResultsError(f"{path} has no column 'time [s]'.")
    values = np.empty((len(lines) - 1, len(header)))
    for number, line in enumerate(lines[1:]):
        cells = line.split(",")
        try:
            if len(cells) != len(header):
                raise ValueError
            values[number] = [float(cell) for cell in cells]
        except ValueError:
            raise ResultsError(f"{path} is damaged in line {number + 2}.") from None
    if not np.isfinite(values).all():
        line, column = np.argwhere(~np.isfinite(values))[0]
        raise ResultsError(
            f"{path} line {line + 2}: {names[column]} is {values[line, column]:g}, it must be a finite number."
        )
    stalled = np.flatnonzero(np.diff(values[:, names.index("time")]) <= 0.0)
    if stalled.size:
        raise ResultsError(f"{path} line {stalled[0] + 3}: time does not increase.")
    return {name: values[:, column] for column, name in enumerate(names)}
