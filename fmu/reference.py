"""Reference results that ship inside the archives, in the layout of the FMI cross-check rules.

``{unit}_in.csv`` holds the inputs over time, ``{unit}_ref.csv`` the outputs at every communication point and
``{unit}_ref.opt`` the settings of the run. Names are quoted as in the XML, time comes first. A unit that can be driven
in another way has more of them, ``{unit}_{way}_in.csv`` and so on, and with them ``{unit}_{way}_start.csv``, the start
values that differ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from .units import barrier_sliding, debris_flow, ground_anchor
from .units.interface import Interface
from .units.slave import UnitError, UnitSlave

InputHistory = Callable[[float], dict[str, float]]


def barrier_inputs(time: float) -> dict[str, float]:
    """An anchor that takes up 60 kN/m after 1 s, and flow that weighs 100 kN/m on the barrier from 1.5 s on."""
    return {
        "external_force": -60e3 if time >= 1.0 else 0.0,
        "vertical_load": 100e3 if time >= 1.5 else 0.0,
        "impact_force_input": 0.0,
    }


def anchor_inputs(time: float) -> dict[str, float]:
    """A barrier that slides 1 m in 2 s and is pulled back half the way."""
    return {"barrier_displacement": time / 2 if time <= 2.0 else 1.5 - time / 4}


def pushed_inputs(time: float) -> dict[str, float]:
    """A force from outside that rises to 500 kN/m in 0.5 s, stays for 1 s and falls to a thrust of 80 kN/m; the flow
    weighs half of it. From 2 s on something pulls the barrier back."""
    force = 1e6 * min(time, 0.5) if time <= 1.5 else max(80e3, 500e3 - 1e6 * (time - 1.5))
    return {
        "external_force": -300e3 if time >= 2.0 else 0.0,
        "vertical_load": force / 2,
        "impact_force_input": force,
    }


@dataclass(frozen=True)
class Case:
    """One way to drive a unit."""

    slave: type[UnitSlave]
    inputs: InputHistory
    start: Mapping[str, float] = field(default_factory=dict)


_CASES: dict[str, dict[str, Case]] = {
    "BarrierSliding": {
        "": Case(barrier_sliding.BarrierSlidingSlave, barrier_inputs),
        "force_input": Case(barrier_sliding.BarrierSlidingSlave, pushed_inputs, {"impact_force_source": 2}),
    },
    "GroundAnchor": {"": Case(ground_anchor.GroundAnchorSlave, anchor_inputs)},
}


def pulled_inputs(time: float) -> dict[str, float]:
    """Something that pulls a sliding barrier back with 100 kN/m from 0.5 s on."""
    return {"barrier_velocity_input": 0.0, "external_force": -100e3 if time >= 0.5 else 0.0}


def driven_inputs(time: float) -> dict[str, float]:
    """Another unit that sets the barrier in motion from 0.3 s on, 4 m/s2 up to 2 m/s."""
    return {"barrier_velocity_input": min(max(4.0 * (time - 0.3), 0.0), 2.0), "external_force": 0.0}


def still_inputs(time: float) -> dict[str, float]:
    """The scenario alone."""
    return {"barrier_velocity_input": 0.0, "external_force": 0.0}


SIMULATED_END, SIMULATED_STEP, SIMULATED_TOLERANCE = 1.0, 0.05, 0.01
"""End and communication step [s] of the simulator's reference run, and how near another machine must come to it."""


def base_of(name: str) -> str:
    """Name of the Python unit that a unit is the twin of: without what stands for C and the version of the standard."""
    return name.removesuffix("3").removesuffix("C")


def files(interface: Interface) -> dict[str, bytes]:
    """The reference files of a unit by name; none for the simulator's, see ``simulated_files``."""
    cases = _CASES.get(base_of(interface.name), {})
    return _cases(interface, cases, (interface.stop_time, interface.step_size, 1e-9))


def simulated_files(resources: Path) -> dict[str, bytes]:
    """The reference files of ``DebrisFlow`` with the scenario in ``resources``: as the scenario says and, where it has
    such a barrier, with a force on it and driven.

    Raises
    ------
    UnitError: the simulator cannot run it.
    """
    from warp_mpm.scenario import Scenario

    barrier = Scenario.load(resources / debris_flow.SCENARIO).barrier
    cases = {"": Case(debris_flow.DebrisFlowSlave, still_inputs)}
    if barrier is not None and barrier.motion.kind == "sliding":
        cases["external_force"] = Case(debris_flow.DebrisFlowSlave, pulled_inputs)
    if barrier is not None:
        cases["driven"] = Case(debris_flow.DebrisFlowSlave, driven_inputs, {"barrier_motion": 2})
    times = (SIMULATED_END, SIMULATED_STEP, SIMULATED_TOLERANCE)
    return _cases(debris_flow.INTERFACE, cases, times, resources)


def _cases(
    interface: Interface, cases: Mapping[str, Case], times: tuple[float, float, float], resources: Path | None = None
) -> dict[str, bytes]:
    """The files of all cases; times: end, communication step [s], and tolerance."""
    found: dict[str, bytes] = {}
    for way, case in cases.items():
        slave = case.slave(instance_name="reference", resources=str(resources or ""))
        for name, value in case.start.items():
            slave[name] = value
        name = f"{interface.name}_{way}" if way else interface.name
        try:
            found |= _run(slave, interface, name, case.inputs, *times)
        finally:
            slave.close()
        if case.start:
            found[f"{name}_start.csv"] = (_header(list(case.start)) + _row(*case.start.values())).encode()
    return found


def _run(
    slave: UnitSlave,
    interface: Interface,
    name: str,
    inputs: InputHistory,
    end: float,
    step: float,
    tolerance: float,
) -> dict[str, bytes]:
    # The simulator's speed is its machine's, and a text has no place in a table of numbers.
    names = [v.name for v in interface.of("output") if v.name != "time_ratio" and v.kind != "String"]
    input_names = [v.name for v in interface.of("input")]
    input_lines, output_lines = [_header(["time", *input_names])], [_header(["time", *names])]
    slave.setup_experiment(0.0, end, None)
    slave.enter_initialization_mode()
    count = round(end / step)
    for number in range(count + 1):
        time = number * step
        if number == 0:
            _apply(slave, inputs(0.0))
            slave.exit_initialization_mode()
        output_lines.append(_row(time, *(_value(slave, name) for name in names)))
        given = inputs(time)
        input_lines.append(_row(time, *(given[name] for name in input_names)))
        _apply(slave, given)
        if number < count and not slave.do_step(time, step):
            raise UnitError(f"The reference run of {interface.name} failed at {time:g} s.")
    options = {"StartTime": 0.0, "StopTime": end, "StepSize": step, "RelTol": tolerance}
    return {
        f"{name}_in.csv": "".join(input_lines).encode(),
        f"{name}_ref.csv": "".join(output_lines).encode(),
        f"{name}_ref.opt": "".join(f"{key}, {value!r}\n" for key, value in options.items()).encode(),
    }


def _value(slave: UnitSlave, name: str) -> float:
    variable = slave.interface.variables[slave.interface.references[name]]
    getter = {"Real": slave.get_real, "Integer": slave.get_integer, "Boolean": slave.get_boolean}[variable.kind]
    return getter([slave.interface.references[name]])[0]


def _apply(slave: UnitSlave, values: dict[str, float]) -> None:
    references = [slave.interface.references[name] for name in values]
    slave.set_real(references, list(values.values()))


def _header(names: list[str]) -> str:
    return ",".join(f'"{name}"' for name in names) + "\n"


def _row(*values: float) -> str:
    return ",".join(repr(value) if isinstance(value, float) else str(int(value)) for value in values) + "\n"
