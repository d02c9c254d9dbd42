"""A host that makes random calls to a unit, in any order and with any numbers; run as a program of its own.

    python call_sequences.py ARCHIVE UNPACKED COUNT LOG

It ends with 0 where every call was answered as it may be. Hypothesis makes the sequences. The calls of the present one
are written to LOG beforehand, for one that ends the process.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
from ctypes import c_double, c_int, c_uint
from pathlib import Path
from typing import Any

from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))

from forked_worker import forked_workers

DISCARD, ERROR = 2, 3
NUMBERS = [0.0, 1.0, -1.0, 0.5, 0.1, 10.0, 1e5, -1e5, 1e-15, 1e9, 1e200, -1e300, math.inf, -math.inf, math.nan, 5e-324]
SIZES = [0.1, 0.01, 1.0, 0.0, 1e-15, -0.1, 1e300, math.inf, math.nan]
QUICK = {"spacing": 1.0, "reply_time_limit": 10.0}
"""Of the simulator: no call takes long, a step of 1e300 s neither."""

archive, unpacked, count, log = sys.argv[1:]
description = read_model_description(archive)
fmi3 = description.fmiVersion.startswith("3")
variables = [v for v in description.modelVariables if v.causality != "independent"]
outputs = [v.valueReference for v in variables if v.causality == "output" and v.type in ("Real", "Float64")]
allowed = {DISCARD, ERROR}

numbers = st.sampled_from(NUMBERS)
places = st.integers(0, 3)
call = st.one_of(
    st.tuples(st.just("set_up"), numbers, st.none() | numbers),
    st.tuples(st.just("start")),
    st.tuples(st.sampled_from(["enter", "leave", "terminate", "reset", "save", "derivatives", "slopes", "replace"])),
    st.tuples(st.just("step"), st.sampled_from(SIZES)),
    st.tuples(st.just("step"), st.just(0.1)),
    st.tuples(st.just("step_from"), numbers, st.sampled_from(SIZES)),
    st.tuples(st.just("set"), st.integers(0, len(variables) - 1), numbers),
    st.tuples(st.just("get"), st.integers(0, len(variables) - 1)),
    st.tuples(st.sampled_from(["restore", "forget", "serialize"]), places),
    st.tuples(st.just("damage"), places, st.integers(0, 5000), st.integers(0, 255), st.integers(0, 50)),
)


class Host:
    """One instance, and the states that were taken of it."""

    def __init__(self) -> None:
        self.fmu: Any = (FMU3Slave if fmi3 else FMU2Slave)(
            guid=description.guid,
            unzipDirectory=unpacked,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="i",
        )
        self.fmu.instantiate()
        self.time = 0.0
        self.states: list[Any] = []
        for variable in variables:
            if variable.name in QUICK:
                self.set(variables.index(variable), QUICK[variable.name])

    def _named(self, old: str, new: str) -> Any:
        return getattr(self.fmu, new if fmi3 else old)

    def set_up(self, start: float, stop: float | None) -> None:
        self.time = start
        if fmi3:
            self.fmu.enterInitializationMode(startTime=start, stopTime=stop)
        else:
            self.fmu.setupExperiment(startTime=start, stopTime=stop)

    def start(self) -> None:
        """What a host in its right mind does, so that many sequences come to steps."""
        self.fmu.reset()
        self.time = 0.0
        for variable in variables:
            if variable.name in QUICK:
                self.set(variables.index(variable), QUICK[variable.name])
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def enter(self) -> None:
        self.fmu.enterInitializationMode()

    def leave(self) -> None:
        self.fmu.exitInitializationMode()

    def terminate(self) -> None:
        self.fmu.terminate()

    def reset(self) -> None:
        self.fmu.reset()
        self.time = 0.0

    def replace(self) -> None:
        """Free the instance and make another."""
        self.free()
        self.__init__()  # type: ignore[misc]

    def step(self, size: float) -> None:
        self.step_from(self.time, size)

    def step_from(self, time: float, size: float) -> None:
        self.fmu.doStep(time, size)
        self.time = time + size
        values = (self.fmu.getFloat64 if fmi3 else self.fmu.getReal)(outputs)
        assert all(math.isfinite(value) for value in values), f"a step was OK, but the outputs are {values}"

    def set(self, place: int, value: float) -> None:
        variable = variables[place]
        kind = "Int64" if variable.type == "Enumeration" else variable.type
        given: Any = value
        if kind in ("Integer", "Int64"):
            given = int(value) % 7 if math.isfinite(value) else 0
        elif kind == "Boolean":
            given = value > 0
        elif kind == "String":
            given = "" if value == 0 else f"/nowhere/{value}"
        getattr(self.fmu, f"set{kind}")([variable.valueReference], [given])

    def get(self, place: int) -> None:
        variable = variables[place]
        kind = "Int64" if variable.type == "Enumeration" else variable.type
        getattr(self.fmu, f"get{kind}")([variable.valueReference])

    def derivatives(self) -> None:
        if fmi3:
            self.fmu.getOutputDerivatives(outputs, [1] * len(outputs))
        else:
            size = len(outputs)
            references, orders, values = (c_uint * size)(*outputs), (c_int * size)(*[1] * size), (c_double * size)()
            self.fmu.fmi2GetRealOutputDerivatives(self.fmu.component, references, size, orders, values)

    def slopes(self) -> None:
        """Directional derivatives of all outputs with respect to all that are numbers and may change between steps."""
        knowns = [
            v.valueReference
            for v in variables
            if v.type in ("Real", "Float64") and (v.causality == "input" or v.variability == "tunable")
        ]
        self.fmu.getDirectionalDerivative(outputs, knowns, [1.0] * len(knowns))

    def save(self) -> None:
        self.states.append(self._named("getFMUstate", "getFMUState")())

    def restore(self, place: int) -> None:
        if place < len(self.states):
            self._named("setFMUstate", "setFMUState")(self.states[place])

    def forget(self, place: int) -> None:
        if place < len(self.states):
            self._named("freeFMUstate", "freeFMUState")(self.states.pop(place))

    def serialize(self, place: int) -> bytes:
        if place >= len(self.states):
            return b""
        data = self._named("serializeFMUstate", "serializeFMUState")(self.states[place])
        self.states.append(self._named("deSerializeFMUstate", "deserializeFMUState")(data))
        return data

    def damage(self, place: int, where: int, what: int, cut: int) -> None:
        """Bytes with one changed, and some cut off or added; they must not become a state."""
        data = bytearray(self.serialize(place) or b"a few bytes that are no state")
        data[where % len(data)] ^= what
        data = data[:-cut] if cut % 2 else data + bytes(cut)
        state = self._named("deSerializeFMUstate", "deserializeFMUState")(bytes(data))
        self._named("setFMUstate", "setFMUState")(state)

    def free(self) -> None:
        while self.states:
            self.forget(0)
        self._named("fmi2FreeInstance", "fmi3FreeInstance")(self.fmu.component)


@settings(
    max_examples=int(count),
    deadline=None,
    database=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.generate],
)
@given(st.lists(call, min_size=1, max_size=25))
def sequences(calls: list[tuple[Any, ...]]) -> None:
    Path(log).write_text(repr(calls))
    host = Host()
    for name, *arguments in calls:
        try:
            getattr(host, name)(*arguments)
        except FMICallException as error:
            if error.status not in allowed:
                raise AssertionError(f"{name}{tuple(arguments)} was answered with {error.status}") from None
    host.free()


if __name__ == "__main__":
    with contextlib.ExitStack() as workers:
        scenario = Path(unpacked) / "resources" / "scenario.json"
        if scenario.exists():
            python = workers.enter_context(forked_workers(scenario, QUICK["spacing"]))
            os.environ["WARP_MPM_PYTHON"] = str(python)
        sequences()
