"""The units in C in both versions of the standard: one model, so one answer; rates, tunables, terminals."""

from __future__ import annotations

import math
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from lxml import etree

from analytic.impact import VARIANTS
from fmu import c_unit

Open = Callable[[str], Any]
FMI3 = [unit.name for unit in c_unit.C_UNITS if unit.fmi == "3.0"]
CLOSED_FORMS = pytest.mark.parametrize("unit", ["BarrierSliding", "BarrierSlidingC", "BarrierSlidingC3"])
ANCHORS = pytest.mark.parametrize("unit", ["GroundAnchor", "GroundAnchorC", "GroundAnchorC3"])


def test_importer_gets_the_same_from_both_versions(archives: dict[str, Path]) -> None:
    """fmpy's own simulation, with inputs: the same numbers to the last bit."""
    inputs = np.array(
        [(0.0, 0.0, 0.0), (1.0, -60e3, 1e5), (4.0, -60e3, 1e5)],
        dtype=[("time", float), ("external_force", float), ("vertical_load", float)],
    )
    found = [
        simulate_fmu(
            str(archives[name]), stop_time=4.0, output_interval=0.01, input=inputs, start_values={"speed": 12.0}
        )
        for name in ("BarrierSlidingC", "BarrierSlidingC3")
    ]
    assert found[0].tolist() == found[1].tolist()
    assert found[0]["barrier_displacement"][-1] > 0.5


@ANCHORS
def test_anchor_yields_and_remembers(unit: str, open_unit: Open) -> None:
    host = open_unit(unit).initialize(stiffness=1e5, slack=0.1, yield_force=4e4)
    expected = [(0.1, 0.0, False), (0.3, -2e4, False), (0.7, -4e4, True), (0.6, -3e4, True), (0.2, 0.0, True)]
    for displacement, force, yielded in expected:
        host["barrier_displacement"] = displacement
        host.run(0.1)
        assert host["force"] == pytest.approx(force, abs=1e-9)
        assert bool(host["yielded"]) is yielded
        assert host["utilisation"] == pytest.approx(-force / 4e4)


def test_anchors_are_the_same(open_unit: Open) -> None:
    draw = random.Random(3)
    hosts = [open_unit(name).initialize(slack=0.05) for name in ("GroundAnchor", "GroundAnchorC", "GroundAnchorC3")]
    for _ in range(200):
        values = {"barrier_displacement": draw.uniform(-1, 3)}
        if draw.random() < 0.1:
            values |= {"stiffness": draw.uniform(1e4, 1e6), "yield_force": draw.uniform(1e4, 3e5)}
        found = []
        for host in hosts:
            for name, value in values.items():
                host[name] = value
            found.append(host.run(0.01).outputs())
        assert found[0] == found[1] == found[2]


@ANCHORS
def test_anchor_may_be_tuned(unit: str, open_unit: Open, capfd: pytest.CaptureFixture[str]) -> None:
    host = open_unit(unit).initialize(stiffness=1e5, yield_force=1e6)
    host["barrier_displacement"] = 0.5
    assert host.run(0.1)["force"] == -5e4
    host["stiffness"] = 2e5
    assert host["force"] == -5e4  # from the next step on
    assert host.run(0.1)["force"] == -1e5
    host["yield_force"] = 6e4
    assert host.run(0.1)["force"] == -6e4
    host["stiffness"] = 0.0
    with pytest.raises(FMICallException):
        host.step(0.1)
    assert "stiffness is 0 N/m2, it must be a finite number in (0, inf) N/m2." in "".join(capfd.readouterr())


@CLOSED_FORMS
def test_base_friction_may_be_tuned(unit: str, open_unit: Open) -> None:
    """A base that is drained under way: the barrier goes on from where it is, as one of that friction would."""
    host, other = open_unit(unit).initialize(impact_force_source=2), open_unit(unit)
    mass, tangent, push = 81000.0, 0.29, 3e5
    host["impact_force_input"] = push
    host.run(1.0)
    speed = push / mass - tangent * 9.81
    assert host["barrier_velocity"] == pytest.approx(speed, rel=1e-12)
    host["base_friction"] = 0.1
    host.run(0.5)
    assert host["barrier_velocity"] == pytest.approx(speed + 0.5 * (push / mass - 0.1 * 9.81), rel=1e-12)
    closed = open_unit(unit).initialize().run(1.0)
    before = closed["peak_force"]
    closed["base_friction"] = 0.05
    closed.run(3.0)
    assert closed["peak_force"] == before  # the triangle is what it was at the start
    assert closed["barrier_displacement"] > 1.3 * other.initialize().run(4.0)["barrier_displacement"]


@CLOSED_FORMS
def test_tuned_friction_goes_along_with_a_state(unit: str, open_unit: Open) -> None:
    """Of the variant whose impulse depends on the friction at the start."""
    host = open_unit(unit).initialize(variant=2).run(0.5)
    host["base_friction"] = 0.1
    host.run(0.2)
    state, data = host.save(), host.serialized(host.save())
    first = host.run(0.4, 0.4).outputs()
    for kept in (state, host.deserialized(data)):
        host.restore(kept, 0.7)
        assert host.run(0.4, 0.4).outputs() == first
    peak = first["peak_force"]
    assert peak == open_unit(unit).initialize(variant=2)["peak_force"]


@CLOSED_FORMS
@pytest.mark.parametrize(
    ("start", "tuned", "says"),
    [
        ({"slope": 10.0}, 0.1, "base_friction is 0.1, on a slope of 10 degrees it must be above 0.1763"),
        ({"variant": 3}, 0.1, "base_friction must stay as it was, or choose 1 (stick_slip)."),
        ({"vertical_load_ratio": 0.5}, 2.5, "vertical_load_ratio is 0.5, it must be in [0, 0.4)."),
        ({}, math.nan, "base_friction is nan, it must be a finite number in [0, inf)."),
    ],
)
def test_tuned_friction_is_checked(
    unit: str, start: dict[str, Any], tuned: float, says: str, open_unit: Open, capfd: pytest.CaptureFixture[str]
) -> None:
    host = open_unit(unit).initialize(**start).run(0.1)
    host["base_friction"] = tuned
    with pytest.raises(FMICallException):
        host.step(0.1)
    assert says in "".join(capfd.readouterr())


@CLOSED_FORMS
def test_vertical_load_ratio_holds_for_a_force_from_outside(unit: str, open_unit: Open) -> None:
    """The flow presses on the barrier with kappa times its push, whoever tells the push."""
    mass, tangent, kappa, push = 81000.0, 0.29, 0.6, 5e5
    host = open_unit(unit).initialize(impact_force_source=2, vertical_load_ratio=kappa)
    host["impact_force_input"] = push
    host.run(0.5)
    friction = tangent * (mass * 9.81 + kappa * push)
    assert host["barrier_velocity"] == pytest.approx(0.5 * (push - friction) / mass, rel=1e-12)
    host["impact_force_input"] = -1e7  # lifts it off its base, which then has no friction, not a negative one
    before = host["barrier_velocity"]
    host.run(0.001)
    assert host["barrier_velocity"] == pytest.approx(before - 0.001 * 1e7 / mass, rel=1e-9)


@pytest.mark.parametrize("variant", [1, 2, 3])
@pytest.mark.parametrize("unit", ["BarrierSlidingC3"])
def test_rates_are_those_of_the_outputs(unit: str, variant: int, open_unit: Open) -> None:
    """Against differences over a short time, before, within and after the impact, sliding and at rest."""
    names = [
        "impact_force",
        "peak_force",
        "barrier_velocity",
        "barrier_displacement",
        "flow_velocity",
        "flow_kinetic_energy",
        "barrier_kinetic_energy",
    ]
    host, h = open_unit(unit), 1e-5
    host.initialize()
    moved = 0
    for arrival, fixed in ((0.0, False), (0.4, False), (0.0, True)):
        for time in (0.2, 0.35, 0.6, 0.9, 1.2, 1.5, 2.2, 4.0):
            host.again(variant=variant, arrival_time=arrival, barrier_fixed=fixed)
            host.run(time - h)
            before = host.reals(names)
            host.run(h)
            references = [host.variables[name].valueReference for name in names]
            rates = host.fmu.getOutputDerivatives(references, [1] * len(names))
            values = host.reals(names)
            host.run(h)
            after = host.reals(names)
            moved += values[2] != 0
            for name, rate, low, value, high in zip(names, rates, before, values, after, strict=True):
                measured = (high - low) / (2 * h)
                scale = max(abs(value), abs(measured), 1.0)
                assert rate == pytest.approx(measured, abs=2e-4 * scale), (name, time, VARIANTS[variant - 1], fixed)
    assert moved > 5


def test_rates_in_both_versions(open_unit: Open) -> None:
    from ctypes import c_double, c_int, c_uint

    two, three = open_unit("BarrierSlidingC").initialize().run(0.7), open_unit("BarrierSlidingC3").initialize().run(0.7)
    reference = two.variables["barrier_velocity"].valueReference
    value = c_double()
    two.fmu.fmi2GetRealOutputDerivatives(two.fmu.component, (c_uint * 1)(reference), 1, (c_int * 1)(1), value)
    assert value.value == three.fmu.getOutputDerivatives([reference], [1])[0] > 0.0
    for order in (0, 2):
        with pytest.raises(FMICallException):
            three.fmu.getOutputDerivatives([reference], [order])
    with pytest.raises(FMICallException):
        open_unit("GroundAnchorC3").initialize().fmu.getOutputDerivatives([4], [1])


@pytest.mark.parametrize("name", FMI3)
def test_side_files_are_valid(name: str, archives: dict[str, Path]) -> None:
    """By the standard's own schemas; terminals name variables of the unit, and those of one name fit together."""
    schemas = Path(fmpy.__file__).parent / "schema" / "fmi3"
    variables = {v.name: v for v in read_model_description(str(archives[name])).modelVariables}
    with zipfile.ZipFile(archives[name]) as archive:
        for entry, schema in (
            ("sources/buildDescription.xml", "fmi3BuildDescription.xsd"),
            ("terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons.xsd"),
        ):
            root = etree.fromstring(archive.read(entry))
            etree.XMLSchema(etree.parse(str(schemas / schema))).assertValid(root)
        assert archive.read(f"sources/{c_unit.C_UNITS[-1].compiled}")
    members = [member.get("variableName") for member in root.iter("TerminalMemberVariable")]
    assert members
    assert set(members) <= set(variables)


def test_terminals_fit_together(archives: dict[str, Path]) -> None:
    plugs: dict[str, list[dict[str, str]]] = {}
    for name in FMI3:
        variables = {v.name: v for v in read_model_description(str(archives[name])).modelVariables}
        with zipfile.ZipFile(archives[name]) as archive:
            root = etree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
        for terminal in root.iter("Terminal"):
            members = {
                member.get("memberName"): variables[member.get("variableName")]
                for member in terminal.iter("TerminalMemberVariable")
            }
            plugs.setdefault(terminal.get("name"), []).append(
                {member: f"{v.causality} {v.unit}" for member, v in members.items()}
            )
    for ends in plugs.values():
        assert len(ends) == 2
        assert set(ends[0]) == set(ends[1])
        for member in ends[0]:
            kinds = {end[member].split()[0] for end in ends}
            assert kinds == {"input", "output"}
            assert ends[0][member].split()[1] == ends[1][member].split()[1]


def test_choices_are_enumerations(archives: dict[str, Path]) -> None:
    description = read_model_description(str(archives["BarrierSlidingC3"]))
    variables = {v.name: v for v in description.modelVariables}
    kind = variables["variant"].declaredType
    assert variables["variant"].type == "Enumeration"
    assert [item.name for item in kind.items] == list(VARIANTS)
    assert [int(item.value) for item in kind.items] == [1, 2, 3]


def test_time_is_told(open_unit: Open) -> None:
    host = open_unit("BarrierSlidingC3").initialize(start_time=0.5).run(0.25)
    assert host["time"] == 0.75
