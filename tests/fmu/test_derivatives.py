"""Directional derivatives of the units in C: how outputs change with what acted during the last step."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

Open = Callable[[str], Any]

OUTPUTS = [
    *("impact_force", "peak_force", "peak_pressure", "barrier_velocity", "barrier_displacement", "flow_velocity"),
    *("flow_kinetic_energy", "barrier_kinetic_energy"),
]
KNOWNS = {"external_force": 1.0, "vertical_load": 1.0, "impact_force_input": 1.0, "base_friction": 1e-6}
"""With the change by which differences are taken: far above rounding, far below what changes the kind of motion."""

SHAKEN = {"vertical_load_ratio": 0.2, "slope": 5.0}


def derivatives(host: Any, unknowns: list[str], knowns: dict[str, float]) -> list[float]:
    references = [[host.variables[name].valueReference for name in names] for names in (unknowns, knowns)]
    return list(host.fmu.getDirectionalDerivative(*references, list(knowns.values())))


def ends(host: Any, state: Any, time: float, size: float, values: dict[str, float], outputs: list[str]) -> np.ndarray:
    """Outputs after one step from a state."""
    host.restore(state, time)
    for name, value in values.items():
        host[name] = value
    host.step(size)
    return np.array(host.reals(outputs))


def worst_difference(host: Any, state: Any, time: float, size: float, values: dict[str, float]) -> tuple[float, int]:
    """Largest difference between derivatives and central differences over a step, relative to the larger of them; and
    how many there were that are not nil. Where the differences to both sides disagree, another stretch of motion begins
    nearby and there is nothing to compare."""
    worst, moving = 0.0, 0
    for name, h in KNOWNS.items():
        middle = ends(host, state, time, size, values, OUTPUTS)
        told = np.array(derivatives(host, OUTPUTS, {name: 1.0}))
        above, below = (
            ends(host, state, time, size, values | {name: values[name] + sign * h}, OUTPUTS) for sign in (1, -1)
        )
        one_sided = np.array([above - middle, middle - below]) / h
        scale = np.maximum(np.abs(told), np.abs(one_sided).max(axis=0))
        rounding = 1e-11 * np.abs(middle) / h
        if (np.ptp(one_sided, axis=0) > 0.02 * scale + 10 * rounding).any():
            continue
        difference = np.abs(told - one_sided.mean(axis=0)) - rounding
        worst = max(worst, float((difference / np.maximum(scale, 1e-9)).max()))
        moving += np.count_nonzero(told)
    return worst, moving


@pytest.mark.parametrize("unit", ["BarrierSlidingC", "BarrierSlidingC3"])
@pytest.mark.parametrize("source", [1, 2])
def test_derivatives_are_those_of_the_outputs(unit: str, source: int, open_unit: Open) -> None:
    """Against differences, over steps in which the barrier rests, sets out, slides, stops, turns round, or is lifted
    off its base; forces come from the closed form and from outside."""
    generator = np.random.default_rng(0)
    host, seen = open_unit(unit).initialize(), 0
    for _ in range(60):
        host.again(impact_force_source=source, **SHAKEN)
        values = {name: host[name] for name in KNOWNS}
        for _ in range(4):
            state, time = host.save(), host.time
            size = float(generator.choice([0.01, 0.1, 0.5]))
            values |= {
                "external_force": float(generator.choice([0.0, 1e5, -8e5, -2e5])) * generator.random(),
                "vertical_load": float(generator.choice([0.0, 1e5, -1e5, -2e6])) * generator.random(),
                "impact_force_input": float(generator.choice([0.0, 3e5, 1e6, -1e5])) * generator.random(),
                "base_friction": 0.1 + 0.5 * generator.random(),
            }
            worst, moving = worst_difference(host, state, time, size, values)
            assert worst < 1e-4, (values, time, size)
            seen += moving
            ends(host, state, time, size, values, OUTPUTS)
            host.release(state)
    assert seen > 1000


def test_a_body_that_stops_and_goes_back_in_one_step(open_unit: Open) -> None:
    """By hand: a force f < 0 on a mass m without friction changes v by t / m, whatever the sign of v; with friction,
    what is gained before the stop is lost by the later start."""
    host = open_unit("BarrierSlidingC3").initialize(
        impact_force_source=2, base_friction=0.0, barrier_mass=1000.0, barrier_initial_velocity=1.0
    )
    host["external_force"] = -2000.0
    host.step(1.0)  # stops after 0.5 s
    assert host["barrier_velocity"] == pytest.approx(-1.0)
    found = derivatives(host, ["barrier_velocity", "barrier_displacement"], {"external_force": 1.0})
    assert found == pytest.approx([1.0 / 1000.0, 0.5 / 1000.0])
    again = derivatives(host, ["barrier_velocity"], {"external_force": 2.0})
    assert again == pytest.approx([2.0 / 1000.0])


def test_inputs_set_after_the_step_change_nothing(open_unit: Open) -> None:
    host = open_unit("BarrierSlidingC").initialize().run(0.7)
    before = derivatives(host, OUTPUTS, {"external_force": 1.0})
    host["external_force"] = 1e5
    assert derivatives(host, OUTPUTS, {"external_force": 1.0}) == before
    assert before[OUTPUTS.index("barrier_velocity")] > 0.0


def test_derivatives_during_initialization(open_unit: Open) -> None:
    """Over no time nothing moves; a force that is an input goes straight through."""
    host = open_unit("BarrierSlidingC3")
    host["impact_force_source"] = 2
    host["impact_force_input"] = 5e4
    host.fmu.enterInitializationMode()
    found = derivatives(host, ["impact_force", "barrier_velocity", "flow_velocity"], {"impact_force_input": 3.0})
    assert found == [3.0, 0.0, 0.0]


@pytest.mark.parametrize("unit", ["GroundAnchorC", "GroundAnchorC3"])
def test_anchor(unit: str, open_unit: Open) -> None:
    """Slack, elastic, yielding, and elastic again on the way back."""
    host = open_unit(unit).initialize(stiffness=1e6, yield_force=1e5, slack=0.01)
    changes = {"barrier_displacement": 1.0, "stiffness": 2.0, "yield_force": 3.0}
    for displacement, force, utilisation in (
        (0.005, 0.0, 0.0),
        (0.06, -(1e6 + 0.05 * 2.0), (1e6 + 0.05 * 2.0) / 1e5 - 0.5 * 3.0 / 1e5),
        (0.31, -3.0, 0.0),
        (0.26, -(1e6 + 0.05 * 2.0), (1e6 + 0.05 * 2.0) / 1e5 - 0.5 * 3.0 / 1e5),
    ):
        host["barrier_displacement"] = displacement
        host.step(0.1)
        assert derivatives(host, ["force", "utilisation"], changes) == pytest.approx([force, utilisation], rel=1e-9)


@pytest.mark.parametrize(
    ("unit", "settings", "unknown", "known", "says"),
    [
        ("BarrierSlidingC", {}, "barrier_velocity", "speed", "with respect to speed, which is neither an input nor"),
        ("BarrierSlidingC3", {}, "external_force", "external_force", "of external_force, which is no output"),
        ("BarrierSlidingC3", {}, "impact_phase", "external_force", "is not a Real variable"),
        ("BarrierSlidingC", {"variant": 3}, "barrier_velocity", "external_force", "variant is 3 (as_printed)"),
        (
            "BarrierSlidingC3",
            {"barrier_initial_velocity": 1.0, "arrival_time": 5.0},
            *(
                "barrier_velocity",
                "external_force",
                "there are derivatives after a step that begins at arrival_time, 5 s",
            ),
        ),
        ("DebrisFlowC", {}, "impact_force_x", "external_force", "does not offer directional derivatives"),
    ],
)
def test_what_has_no_derivative_is_refused(
    unit: str, settings: dict[str, Any], unknown: str, known: str, says: str, open_unit: Open,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """In one sentence; the unit goes on."""
    host = open_unit(unit)
    if unit.startswith("Debris"):
        settings = {"spacing": 1.5}
    host.initialize(**settings)
    with pytest.raises(FMICallException) as caught:
        derivatives(host, [unknown], {known: 1.0})
    assert caught.value.status == 3
    assert says in "".join(capfd.readouterr())
    host.run(0.1)


def test_out_of_order(open_unit: Open) -> None:
    host = open_unit("BarrierSlidingC")
    with pytest.raises(FMICallException):
        derivatives(host, ["barrier_velocity"], {"external_force": 1.0})
    host.initialize()
    with pytest.raises(FMICallException):
        derivatives(host, ["barrier_velocity"], {"external_force": float("nan")})


def test_the_description_says_which_units_give_them(archives: dict[str, Path]) -> None:
    for name in ("BarrierSliding", "GroundAnchor", "DebrisFlow"):
        for suffix, attribute in (("C", "providesDirectionalDerivative"), ("C3", "providesDirectionalDerivatives")):
            with zipfile.ZipFile(archives[name + suffix]) as archive:
                told = ElementTree.fromstring(archive.read("modelDescription.xml")).find("CoSimulation")
            assert told is not None
            assert told.attrib[attribute] == ("false" if name == "DebrisFlow" else "true"), name + suffix
