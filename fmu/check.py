"""Checks of an archive as an importer meets it: valid, right at once, the same at any step, honest about state."""

from __future__ import annotations

import contextlib
import io
import math
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .instance import instance

QUICK_SETTINGS = {"spacing": 1.0}
"""Parameters for a quick run, of those units that have them: a coarse grid will do for a life cycle."""


class CheckError(Exception):
    """A check that failed; the message is one sentence."""


@dataclass(frozen=True)
class Result:
    """What came of one check."""

    name: str
    passed: bool
    detail: str


def check_archive(path: Path) -> list[Result]:
    """Run all checks on an archive; none of them stops the next.

    Raises:
        CheckError: the file is no archive that could be checked.
    """
    if not zipfile.is_zipfile(path):
        raise CheckError(f"{path} is no FMU archive.")
    results = []
    with tempfile.TemporaryDirectory(prefix="fmu_check_") as folder:
        for name, check in _CHECKS.items():
            try:
                results.append(Result(name, True, check(path, Path(folder))))
            except CheckError as error:
                results.append(Result(name, False, str(error)))
            except Exception as error:  # a check that breaks is a failed one
                results.append(Result(name, False, f"{type(error).__name__}: {error}"))
    return results


def _valid(path: Path, folder: Path) -> str:
    from fmpy.validation import validate_fmu

    problems = validate_fmu(str(path))
    _demand(not problems, "; ".join(problems))
    return "fmpy's checker has nothing to report"


def _complete(path: Path, folder: Path) -> str:
    with zipfile.ZipFile(path) as file:
        names = file.namelist()
    icon = "terminalsAndIcons/icon.png" if "terminalsAndIcons/terminalsAndIcons.xml" in names else "model.png"
    for needed in ("documentation/index.html", "documentation/licenses/license.txt", icon):
        _demand(needed in names, f"{needed} is missing.")
    platforms = sorted({name.split("/")[1] for name in names if name.startswith("binaries/")})
    return f"page, licence, icon; binaries for {', '.join(platforms)}"


def _units(path: Path, folder: Path) -> str:
    from fmpy import read_model_description

    description = read_model_description(str(path))
    units = {unit.name: unit for unit in description.unitDefinitions}
    for variable in description.modelVariables:
        _demand(bool(variable.description), f"{variable.name} has no description.")
        if variable.type in ("Real", "Float64"):
            _demand(variable.unit in units, f"{variable.name} has no unit.")
            _demand(units[variable.unit].baseUnit is not None, f"{variable.unit} has no SI base units.")
    return f"{len(description.modelVariables)} variables, {len(units)} units"


def _starts_right(path: Path, folder: Path) -> str:
    with instance(path, folder, QUICK_SETTINGS) as unit:
        unit.initialize()
        values = unit.outputs()
        wrong = [name for name, value in values.items() if isinstance(value, float) and not math.isfinite(value)]
        _demand(not wrong, f"{', '.join(wrong)} undefined after initialization.")
        return f"{len(values)} outputs defined at the start"


def _reference(path: Path, folder: Path) -> str:
    with zipfile.ZipFile(path) as file:
        cases = [name.removesuffix("_ref.csv") for name in file.namelist() if name.endswith("_ref.csv")]
        if not cases:
            return "no reference results in this archive"
        worst = max(_missed_by(path, file, case) for case in cases)
    ways = "" if len(cases) == 1 else f", driven in {len(cases)} ways"
    return f"reproduced to {worst:.0e}{ways}"


def _missed_by(path: Path, file: zipfile.ZipFile, case: str) -> float:
    """Largest difference from one set of reference results, over each output's largest value."""
    from fmpy import simulate_fmu

    given, expected = (
        np.genfromtxt(io.BytesIO(file.read(f"{case}_{kind}.csv")), delimiter=",", names=True) for kind in ("in", "ref")
    )
    options = {
        key: float(value)
        for key, value in (line.split(", ") for line in file.read(f"{case}_ref.opt").decode().splitlines())
    }
    start = {}
    if f"{case}_start.csv" in file.namelist():
        names, values = file.read(f"{case}_start.csv").decode().splitlines()
        start = dict(zip((name.strip('"') for name in names.split(",")), values.split(","), strict=True))
    found = simulate_fmu(
        str(path),
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        start_values=start,
        input=given,
        use_event_mode=False,
    )
    worst = 0.0
    for column in expected.dtype.names or ():
        scale = max(float(np.abs(expected[column]).max()), 1e-9)
        worst = max(worst, float(np.abs(found[column] - expected[column]).max()) / scale)
    name = case.split("/")[-1]
    _demand(
        worst <= options["RelTol"], f"the reference results {name} are missed by {worst:.1e} of their largest value."
    )
    return worst


def _any_step(path: Path, folder: Path) -> str:
    ends = []
    with instance(path, folder, QUICK_SETTINGS) as unit:
        if "spacing" in unit.variables:
            return "not asked of a simulation: its own time steps end where a communication step does"
        for count in (4, 20, 1000):
            unit.again()
            for _ in range(count):
                unit.step(2.0 / count)
            ends.append(unit.real_outputs())
    spread = np.ptp(np.array(ends), axis=0) / np.maximum(np.abs(ends[0]), 1e-9)
    _demand(bool(spread.max() <= 1e-9), f"steps of 0.5, 0.1 and 0.002 s differ by {spread.max():.1e}.")
    return f"steps of 0.5, 0.1 and 0.002 s agree to {spread.max():.0e}"


def _state(path: Path, folder: Path) -> str:
    with instance(path, folder, QUICK_SETTINGS) as unit:
        unit.initialize()
        unit.step(0.2)
        state, time = unit.save(), unit.time
        data = unit.serialized(state)
        unit.step(0.1)
        first = unit.real_outputs()
        for restored in (state, unit.deserialized(data)):
            unit.restore(restored, time)
            unit.step(0.1)
            _demand(unit.real_outputs() == first, "a restored state does not go on as the first time.")
        return f"restored bit for bit, {len(data)} bytes serialized"


def _reset(path: Path, folder: Path) -> str:
    with instance(path, folder, QUICK_SETTINGS) as unit, instance(path, folder, QUICK_SETTINGS) as other:
        unit.initialize()
        unit.step(0.3)
        first = unit.real_outputs()
        unit.again()
        unit.step(0.3)
        other.initialize()
        other.step(0.3)
        _demand(unit.real_outputs() == first == other.real_outputs(), "a reset or a second instance differs.")
    return "a reset and a second instance give the same"


def _refusal(path: Path, folder: Path) -> str:
    with instance(path, folder, QUICK_SETTINGS) as unit:
        name = next(
            name
            for name, v in unit.variables.items()
            if v.causality == "parameter" and v.type in ("Real", "Float64") and v.min is not None
        )
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            try:
                unit.initialize(**{name: -1.0})
            except Exception:
                refused = True
            else:
                refused = False
        _demand(refused, f"{name} = -1 is accepted.")
        _demand(f"{name} is -1" in said.getvalue(), f"{name} = -1 is refused without its name and value.")
        return said.getvalue().strip().splitlines()[0].split(": ")[-1].removeprefix("[ERROR] ")


_CHECKS: dict[str, Callable[[Path, Path], str]] = {
    "valid": _valid,
    "complete": _complete,
    "units": _units,
    "right at the start": _starts_right,
    "reference results": _reference,
    "any step": _any_step,
    "state": _state,
    "reset": _reset,
    "bad parameter": _refusal,
}


def _demand(condition: bool, complaint: str) -> None:
    if not condition:
        raise CheckError(complaint)
