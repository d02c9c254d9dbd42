"""Reference results that ship inside the archives, in the layout of the FMI cross-check rules.

``{unit}_in.csv`` holds the inputs over time, ``{unit}_ref.csv`` the outputs at every communication point and
``{unit}_ref.opt`` the settings of the run. Names are quoted as in the XML, time comes first.
"""

from __future__ import annotations

from collections.abc import Callable

from fmu.units import barrier_sliding, ground_anchor
from fmu.units.interface import Interface
from fmu.units.slave import UnitSlave

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


_CASES: dict[str, tuple[type[UnitSlave], InputHistory]] = {
    "BarrierSliding": (barrier_sliding.BarrierSlidingSlave, barrier_inputs),
    "BarrierSlidingC": (barrier_sliding.BarrierSlidingSlave, barrier_inputs),
    "GroundAnchor": (ground_anchor.GroundAnchorSlave, anchor_inputs),
}


def files(interface: Interface) -> dict[str, bytes]:
    """The reference files of a unit by name; none for a unit whose results are not the same on every machine."""
    if interface.name not in _CASES:
        return {}
    slave_class, inputs = _CASES[interface.name]
    slave = slave_class(instance_name="reference", resources="")
    steps = round(interface.stop_time / interface.step_size)
    names = [v.name for v in interface.of("output")]
    input_lines = [_header(["time", *(v.name for v in interface.of("input"))])]
    output_lines = [_header(["time", *names])]
    slave.setup_experiment(0.0, interface.stop_time, None)
    slave.enter_initialization_mode()
    for step in range(steps + 1):
        time = step * interface.step_size
        if step == 0:
            _apply(slave, inputs(0.0))
            slave.exit_initialization_mode()
        output_lines.append(_row(time, *(slave[name] for name in names)))
        given = inputs(time)
        input_lines.append(_row(time, *(given[v.name] for v in interface.of("input"))))
        _apply(slave, given)
        if step < steps and not slave.do_step(time, interface.step_size):
            raise RuntimeError(f"The reference run of {interface.name} failed at {time:g} s.")
    options = {
        "StartTime": 0.0,
        "StopTime": interface.stop_time,
        "StepSize": interface.step_size,
        "RelTol": 1e-9,
    }
    return {
        f"{interface.name}_in.csv": "".join(input_lines).encode(),
        f"{interface.name}_ref.csv": "".join(output_lines).encode(),
        f"{interface.name}_ref.opt": "".join(f"{name}, {value!r}\n" for name, value in options.items()).encode(),
    }


def _apply(slave: UnitSlave, values: dict[str, float]) -> None:
    references = [slave.interface.references[name] for name in values]
    slave.set_real(references, list(values.values()))


def _header(names: list[str]) -> str:
    return ",".join(f'"{name}"' for name in names) + "\n"


def _row(*values: float) -> str:
    return ",".join(repr(value) if isinstance(value, float) else str(int(value)) for value in values) + "\n"
