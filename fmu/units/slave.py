"""The life cycle that all units share, made safe against what the pythonfmu wrapper does with exceptions."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import math
import sys
from collections.abc import Callable, Sequence
from typing import Any, ClassVar
from xml.etree.ElementTree import Element

from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave

from .interface import Interface, Value, Variable
from .model_description import model_description

SETUP, INITIALIZATION, STEPPING, FAILED, TERMINATED = "setup", "initialization", "stepping", "failed", "terminated"
"""The states of a unit's life."""

TIME_TOLERANCE = 1e-6
"""Largest difference [s] between the importer's communication point and the unit's own time: importers that count
nanoseconds, or that add up their steps, stay far below it."""


LARGEST = sys.float_info.max
"""Largest number that is one."""


class UnitError(Exception):
    """A call or a value that the unit refuses; the message is one sentence for the importer's log."""


def guarded(method: Callable[..., Any]) -> Callable[..., Any]:
    """Report an exception and keep the reference counts whole before it goes to the wrapper.

    On any exception the wrapper releases the class, the instance and the log queue, and releases them again when the
    instance is freed: the host then crashes, perhaps minutes later. The three references are given back here.
    """

    @functools.wraps(method)
    def call(self: UnitSlave, *args: Any) -> Any:
        try:
            return method(self, *args)
        except BaseException as error:
            self.report(_sentence(error), Fmi2Status.error)
            keep_alive(type(self), self, self.log_queue)
            raise

    return call


def keep_alive(*objects: object) -> None:
    """Add a reference to each object, to make good one that the wrapper releases without owning it."""
    # Without ctypes, in a Python cut down for embedding, the wrapper's fault stays as it is.
    with contextlib.suppress(ImportError, AttributeError):
        import ctypes

        for item in objects:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(item))


def _sentence(error: BaseException) -> str:
    if isinstance(error, ArithmeticError):
        return f"The parameters or inputs are beyond what can be computed with ({type(error).__name__})."
    known = isinstance(error, UnitError | ValueError) and str(error)
    return str(error) if known else f"{type(error).__name__}: {error}"


class UnitSlave(Fmi2Slave):
    """Base of all units.

    A unit gives its table and the hooks `start`, `step`, `snapshot`, `restore` and `close`. Variables are
    kept in `values`, in the order of the table. They are deliberately not registered with pythonfmu: its getters form
    reference cycles, which would put off the release of a freed instance.
    """

    interface: ClassVar[Interface]
    version: ClassVar[str] = "development"

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.modelName = self.interface.name
        self.values: list[Value] = [_initial_value(variable) for variable in self.interface.variables]
        self.life = SETUP
        self.time = 0.0
        self.stop_time: float | None = None
        self.stale = True  # whether parameters or inputs were set since the outputs were computed
        self._of_kind = {
            kind: frozenset(number for number, v in enumerate(self.interface.variables) if v.kind == kind)
            for kind in ("Real", "Integer", "Boolean", "String")
        }
        references = self.interface.references
        self._inputs = [
            (
                references[v.name],
                v,
                -LARGEST if v.least is None else v.least,
                LARGEST if v.maximum is None else v.maximum,
            )
            for v in self.interface.settable_in_steps
            if v.kind == "Real"
        ]
        self._outputs = [references[v.name] for v in self.interface.of("output")]
        self._real_outputs = [references[v.name] for v in self.interface.of("output") if v.kind == "Real"]

    # --- hooks -------------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Take the parameters, which are within their ranges, and compute the outputs at the start time."""
        raise NotImplementedError

    def step(self, end: float) -> None:
        """Go from `self.time` to the time `end` [s] and set the outputs."""
        raise NotImplementedError

    def snapshot(self) -> Any:
        """All that the unit remembers beside `values` and `time`, as JSON can hold it."""
        raise NotImplementedError

    def restore(self, snapshot: Any) -> None:
        """Take back what `snapshot` gave."""
        raise NotImplementedError

    def close(self) -> None:
        """Release what the operating system must have back."""

    def __getitem__(self, name: str) -> Any:
        return self.values[self.interface.references[name]]

    def __setitem__(self, name: str, value: Value) -> None:
        self.values[self.interface.references[name]] = value

    # --- FMI life cycle ----------------------------------------------------------------------------------------------

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        return model_description(
            self.interface, version=type(self).version, tool="warp-mpm-impact, PythonFMU", needs_execution_tool=True
        )

    @guarded
    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        self._expect("Setting the times of the experiment", SETUP)
        if not math.isfinite(start_time):
            raise UnitError(f"The start time is {start_time:g} s, it must be a finite number.")
        if stop_time is not None and not start_time <= stop_time < math.inf:
            raise UnitError(
                f"The stop time is {stop_time:g} s, it must be a finite number of at least the start time, "
                f"{start_time:g} s."
            )
        self.time, self.stop_time = start_time, stop_time

    @guarded
    def enter_initialization_mode(self) -> None:
        self._expect("Entering the initialization", SETUP)
        self.life = INITIALIZATION

    @guarded
    def exit_initialization_mode(self) -> None:
        self._expect("Leaving the initialization", INITIALIZATION)
        if self.stale:
            self._begin()
        self.life = STEPPING

    def _expect(self, call: str, *stages: str) -> None:
        if self.life not in stages:
            raise UnitError(f"{call} is out of order in the {self.life} stage of a unit.")

    def do_step(self, current_time: float, step_size: float) -> bool:
        # Nothing may escape from here: the wrapper would call it fatal, and crash when the instance is freed.
        try:
            if self.life == FAILED:
                return False
            self._expect("A step", STEPPING)
            if not abs(current_time - self.time) <= TIME_TOLERANCE * max(1.0, abs(self.time)):
                raise UnitError(
                    f"The step starts at {current_time:g} s, but the unit stands at {self.time:g} s: "
                    "restore a state to go back."
                )
            end = max(current_time + step_size, self.time)
            if not 0.0 <= step_size <= LARGEST or end > LARGEST:
                raise UnitError(f"The step is {step_size:g} s long, it must be a finite number of at least 0 s.")
            stop = self.stop_time
            if stop is not None and end > stop + TIME_TOLERANCE * max(1.0, abs(stop)):
                raise UnitError(f"The step ends at {end:g} s, it must end by the stop time that was set, {stop:g} s.")
            values = self.values
            for reference, variable, low, high in self._inputs:
                if not low <= values[reference] <= high:  # type: ignore[operator]
                    raise UnitError(variable.fault(values[reference]))
            self.step(end)
            self._check_outputs()
            self.time = end
            return True
        except BaseException as error:
            self.fail(_sentence(error))
            return False

    @guarded
    def terminate(self) -> None:
        self._expect("Terminating", STEPPING, FAILED)
        self.life = TERMINATED
        self.close()

    def fail(self, message: str) -> None:
        """Tell the importer, and leave outputs that no master can take for results: some go on after a failed step."""
        self.life = FAILED
        for reference in self._outputs:
            if self.interface.variables[reference].kind == "Real":
                self.values[reference] = math.nan
        if "message" in self.interface.references:
            self["message"] = message
        self.report(message, Fmi2Status.discard)

    def report(self, message: str, status: Fmi2Status) -> None:
        """Send a message to the importer's log and to standard error: the wrapper drops the log unless asked for it."""
        self.log(message, status)
        if sys.stderr is not None:
            with contextlib.suppress(OSError, ValueError):
                sys.stderr.write(f"{self.instance_name} ({self.interface.name}): {message}\n")
                sys.stderr.flush()

    def _begin(self) -> None:
        for variable, value in zip(self.interface.variables, self.values, strict=True):
            fault = variable.fault(value) if variable.causality != "output" else None
            if fault:
                raise UnitError(fault)
        self.start()
        self._check_outputs()
        self.stale = False

    def _check_outputs(self) -> None:
        for reference in self._real_outputs:
            if not math.isfinite(self.values[reference]):  # type: ignore[arg-type]
                name = self.interface.variables[reference].name
                raise UnitError(
                    f"{name} came out as {self.values[reference]:g}: the parameters or inputs are beyond what can be "
                    "computed with."
                )

    # --- values ------------------------------------------------------------------------------------------------------

    def _get(self, kind: str, references: Sequence[int]) -> list[Any]:
        if not self._of_kind[kind].issuperset(references):
            raise UnitError(f"{self._first_stranger(kind, references)} is not a {kind} variable of this unit.")
        if self.stale and self.life == INITIALIZATION:
            self._preview()
        values = self.values
        return [values[reference] for reference in references]

    def _preview(self) -> None:
        """Outputs in initialization mode; parameters that are not yet allowed leave them undefined."""
        try:
            self._begin()
        except (UnitError, ValueError, ArithmeticError):
            for reference in self._outputs:
                self.values[reference] = _initial_value(self.interface.variables[reference])

    def _set(self, kind: str, references: Sequence[int], values: Sequence[Any]) -> None:
        if not self._of_kind[kind].issuperset(references):
            raise UnitError(f"{self._first_stranger(kind, references)} is not a {kind} variable of this unit.")
        for reference, value in zip(references, values, strict=True):
            variable = self.interface.variables[reference]
            if variable.causality == "output":
                raise UnitError(f"{variable.name} is an output, it cannot be set.")
            if self.life == TERMINATED:
                self._expect("Setting a variable", SETUP, INITIALIZATION, STEPPING, FAILED)
            if variable.variability == "fixed" and self.life not in (SETUP, INITIALIZATION):
                raise UnitError(f"{variable.name} is a fixed parameter, it cannot be set after initialization.")
            self.values[reference] = value
            self.stale = True

    def _first_stranger(self, kind: str, references: Sequence[int]) -> str:
        reference = next(r for r in references if r not in self._of_kind[kind])
        inside = 0 <= reference < len(self.interface.variables)
        return self.interface.variables[reference].name if inside else f"Value reference {reference}"

    @guarded
    def get_real(self, vrs: Sequence[int]) -> list[float]:
        return self._get("Real", vrs)

    @guarded
    def get_integer(self, vrs: Sequence[int]) -> list[int]:
        return self._get("Integer", vrs)

    @guarded
    def get_boolean(self, vrs: Sequence[int]) -> list[bool]:
        return self._get("Boolean", vrs)

    @guarded
    def get_string(self, vrs: Sequence[int]) -> list[str]:
        return self._get("String", vrs)

    @guarded
    def set_real(self, vrs: Sequence[int], values: Sequence[float]) -> None:
        self._set("Real", vrs, values)

    @guarded
    def set_integer(self, vrs: Sequence[int], values: Sequence[int]) -> None:
        self._set("Integer", vrs, values)

    @guarded
    def set_boolean(self, vrs: Sequence[int], values: Sequence[bool]) -> None:
        self._set("Boolean", vrs, [bool(value) for value in values])

    @guarded
    def set_string(self, vrs: Sequence[int], values: Sequence[str]) -> None:
        self._set("String", vrs, values)

    @classmethod
    def _identity(cls) -> str:
        return f"{cls.interface.name} {cls.version}"  # of the class: pythonfmu hides it in the instance

    # --- state -------------------------------------------------------------------------------------------------------

    @guarded
    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "unit": self._identity(),
            "life": self.life,
            "time": self.time,
            "stop_time": self.stop_time,
            "stale": self.stale,
            "values": list(self.values),
            "snapshot": self.snapshot() if self.life == STEPPING else None,
        }

    @guarded
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        if state.get("unit") != self._identity():
            raise UnitError(
                state.get("fault") or f"The state belongs to {state.get('unit')}, this is {self._identity()}."
            )
        self.values = list(state["values"])
        self.time, self.stop_time = state["time"], state["stop_time"]
        self.life, self.stale = state["life"], state["stale"]
        if state["snapshot"] is not None:
            self.restore(state["snapshot"])
        else:  # what has gone on since is no part of the state
            self.close()
            self.stale = True

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        return sealed(json.dumps(state).encode())

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        # An exception would leave the wrapper with references that it does not own, and none of an instance is known
        # here: bytes that are no state become one that cannot be restored.
        try:
            return json.loads(opened(state))
        except UnitError as error:
            return {"fault": str(error)}


def sealed(data: bytes) -> bytes:
    """The bytes of a state with a digest, by which damage is seen."""
    return hashlib.sha256(data).hexdigest().encode() + b"\n" + data


def opened(data: bytes) -> bytes:
    """What `sealed` was given."""
    digest, _, content = data.partition(b"\n")
    if hashlib.sha256(content).hexdigest().encode() != digest:
        raise UnitError("The bytes are not a state of this unit, or are damaged.")
    return content


def _initial_value(variable: Variable) -> Value:
    if variable.start is not None:
        return variable.start
    undefined: dict[str, Value] = {"Real": math.nan, "Integer": 1, "Boolean": False, "String": ""}
    return undefined[variable.kind]
