"""The sliding barrier as a unit: the closed form as a function of time, and exact sliding under loads from outside."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from scipy.integrate import solve_ivp

from analytic.impact import PHASES, VARIANTS, Impact
from analytic.sliding import slide

Open = Callable[[str], Any]
BOTH = pytest.mark.parametrize("unit", ["BarrierSliding", "BarrierSlidingC"])
PAPER = {  # Fig. 9: masses, speed and friction of the example
    "flow_mass": 81000.0,
    "barrier_mass": 81000.0,
    "flow_length": 15.0,
    "flow_height": 3.0,
    "speed": 10.0,
    "base_friction": 0.29,
    "rise_ratio": 0.35,
}


def random_parameters(draw: random.Random) -> dict[str, Any]:
    """Parameters over the ranges in which flows and barriers lie, all variants, fixed and sliding barriers."""
    parameters = {
        "flow_mass": draw.uniform(1e3, 5e5),
        "barrier_mass": draw.uniform(1e3, 5e5),
        "flow_length": draw.uniform(1, 100),
        "flow_height": draw.uniform(0.2, 5),
        "speed": draw.uniform(1, 30),
        "arrival_time": draw.choice([0.0, draw.uniform(0, 2)]),
        "base_friction": draw.choice([0.0, draw.uniform(0, 1)]),
        "geometry_change": draw.uniform(0.05, 1),
        "rise_ratio": draw.choice([1.0, draw.uniform(0.01, 1)]),
        "vertical_load_ratio": draw.choice([0.0, draw.uniform(0, 0.9)]),
        "gravity": draw.uniform(1, 20),
        "variant": draw.randint(1, 3),
        "barrier_fixed": draw.random() < 0.2,
    }
    if not parameters["barrier_fixed"] and draw.random() < 0.5:
        parameters["barrier_initial_velocity"] = draw.uniform(0, 0.9) * parameters["speed"]
    if draw.random() < 0.3:
        parameters["s1max"] = draw.uniform(0.05, 1) * parameters["flow_length"]
    if parameters["variant"] == 3:
        parameters["vertical_load_ratio"] = 0.0  # the paper's formulas have no such term
    steepest = math.degrees(math.atan(parameters["base_friction"]))
    if steepest and draw.random() < 0.6:
        parameters["slope"] = draw.uniform(-0.95, 0.95) * steepest
    return parameters


def impact_of(parameters: dict[str, Any]) -> Impact:
    given = {**parameters, "variant": VARIANTS[parameters["variant"] - 1]}
    if given.pop("barrier_fixed"):
        del given["barrier_mass"], given["base_friction"]
    if "s1max" in given:
        del given["geometry_change"]
    return Impact(**given)


@BOTH
def test_unit_is_the_closed_form(unit: str, open_unit: Open) -> None:
    """C unit = Python unit = `analytic`, over random parameters and times, to 1e-12 of each quantity's scale."""
    draw, host = random.Random(5), open_unit(unit)
    host.initialize()
    worst = 0.0
    for _ in range(300):
        parameters = random_parameters(draw)
        impact = impact_of(parameters)
        host.again(**parameters)
        times = sorted(draw.uniform(0, impact.impact_end_time * 2) for _ in range(6))
        top_speed = impact.speed + impact.friction_deceleration * times[-1]
        top_force = max(impact.peak_force, 1.0)
        scales = {
            "impact_force": top_force,
            "peak_force": top_force,
            "peak_pressure": top_force / impact.flow_height,
            "barrier_velocity": top_speed,
            "barrier_displacement": top_speed * times[-1],
            "flow_velocity": top_speed,
            "flow_kinetic_energy": impact.flow_mass * top_speed**2,
            "barrier_kinetic_energy": parameters["barrier_mass"] * top_speed**2,
        }
        for time in times:
            host.run(time - host.time)
            time = host.time
            expected = {
                "impact_force": impact.force(time),
                "peak_force": impact.peak_force,
                "peak_pressure": impact.peak_pressure,
                "barrier_velocity": impact.barrier_velocity(time),
                "barrier_displacement": impact.barrier_displacement(time),
                "flow_velocity": impact.flow_velocity(time),
                "flow_kinetic_energy": impact.flow_kinetic_energy(time),
                "barrier_kinetic_energy": impact.barrier_kinetic_energy(time),
            }
            found = host.outputs()
            assert PHASES[found.pop("impact_phase") - 1] == impact.phase(time), (parameters, time)
            for name, value in expected.items():
                error = abs(found[name] - value) / scales[name]
                assert error < 1e-12, (name, parameters, time, found[name], value)
                worst = max(worst, error)
    assert worst < 1e-12


def test_c_moves_as_python_under_loads(open_unit: Open) -> None:
    """Random parameters, slopes and loads from outside, the impact force from the closed form or an input."""
    draw, python, c = random.Random(8), open_unit("BarrierSliding"), open_unit("BarrierSlidingC")
    python.initialize()
    c.initialize()
    phases = set()
    for _ in range(200):
        parameters = random_parameters(draw)
        parameters["variant"] = draw.choice([1, 2])
        parameters["impact_force_source"] = draw.choice([1, 1, 2])
        impact = impact_of({name: value for name, value in parameters.items() if name != "impact_force_source"})
        for host in (python, c):
            host.again(**parameters)
        weight = parameters["barrier_mass"] * parameters["gravity"]
        speed, reach = impact.speed, 0.0
        for _ in range(8):
            loads = {
                "external_force": draw.choice([0.0, draw.uniform(-2, 2) * weight]),
                "vertical_load": draw.choice([0.0, draw.uniform(-0.5, 2) * weight]),
                "impact_force_input": draw.uniform(0, 2) * weight,
            }
            size = draw.uniform(0, impact.duration / 2)
            for host in (python, c):
                for name, value in loads.items():
                    host[name] = value
                host.run(size)
            found, expected = c.outputs(), python.outputs()
            phases.add(expected["impact_phase"])
            assert found["impact_phase"] == expected["impact_phase"], (parameters, loads)
            # The largest velocity and way that the loads could have led to are the scales of rounding.
            speed += size * (6 * weight + impact.peak_force) / parameters["barrier_mass"]
            reach += size * speed
            assert found["barrier_velocity"] == pytest.approx(expected["barrier_velocity"], abs=1e-12 * speed)
            assert found["barrier_displacement"] == pytest.approx(expected["barrier_displacement"], abs=1e-12 * reach)
    assert len(phases) == len(PHASES)


@BOTH
@pytest.mark.parametrize("slope", [12.0, -12.0])
def test_slope_against_small_steps(unit: str, slope: float, open_unit: Open) -> None:
    """Pushed up and down a slope by forces from outside, which have to overcome the weight along it, too."""
    mass, tangent, load = 8e4, 0.4, 3e4
    along = mass * 9.81 * math.sin(math.radians(slope))
    friction = tangent * (mass * 9.81 * math.cos(math.radians(slope)) + load)
    changes = {"barrier_mass": mass, "base_friction": tangent, "slope": slope, "impact_force_source": 2}
    host = open_unit(unit).initialize(**(PAPER | changes))
    host["vertical_load"] = load
    place = (0.0, 0.0)
    for pushed in (1.3 * friction, 0.0, -1.3 * friction, 0.0):
        host["external_force"] = pushed - along
        host.run(1.0)
        place = reference_slide(place, 1.0, lambda t, pushed=pushed: pushed, friction, mass)
        assert (host["barrier_displacement"], host["barrier_velocity"]) == pytest.approx(place, abs=1e-4)
    host["external_force"] = 0.0  # the base holds it against its weight
    host.run(5.0)
    assert host["barrier_velocity"] == 0.0
    rest = host["barrier_displacement"]
    host["external_force"] = friction - along - 1.0
    host.run(1.0)
    assert host["barrier_displacement"] == rest
    host["external_force"] = friction - along + 1.0
    host.run(1.0)
    assert host["barrier_displacement"] - rest == pytest.approx(0.5 / mass, rel=1e-6)


@BOTH
@pytest.mark.parametrize("sizes", [[0.5] * 8, [0.1] * 40, [0.001] * 4000, "random"])
def test_same_trajectory_at_any_step(unit: str, sizes: list[float] | str, open_unit: Open) -> None:
    if sizes == "random":
        draw = random.Random(3)
        sizes = [draw.uniform(0.0001, 0.2) for _ in range(60)]
    impact = Impact(**PAPER, geometry_change=0.41)
    host = open_unit(unit).initialize(**PAPER)
    for size in sizes:
        host.run(float(size))
        assert abs(host["barrier_displacement"] - impact.barrier_displacement(host.time)) < 1e-9
        assert abs(host["barrier_velocity"] - impact.barrier_velocity(host.time)) < 1e-9
        assert abs(host["impact_force"] - impact.force(host.time)) < 1e-9 * impact.peak_force


@BOTH
def test_paper_example(unit: str, open_unit: Open) -> None:
    """Fig. 9, lambda = 0.41, tau = 0.35: peak, largest velocity and final displacement worked out by hand."""
    host = open_unit(unit).initialize(**PAPER)
    assert host["peak_force"] == pytest.approx(493902.439, rel=1e-9)
    host.run(4.0)
    assert host["barrier_displacement"] == pytest.approx(1.36484471, rel=1e-8)
    assert host["flow_velocity"] == pytest.approx(5.0, rel=1e-12)


@BOTH
def test_outputs_are_right_after_initialization(unit: str, open_unit: Open) -> None:
    host = open_unit(unit).initialize(start_time=0.7, **PAPER)
    impact = Impact(**PAPER, geometry_change=0.41)
    assert host["impact_force"] == pytest.approx(impact.force(0.7), rel=1e-12)
    assert host["barrier_displacement"] == pytest.approx(impact.barrier_displacement(0.7), rel=1e-12)
    given = open_unit(unit).initialize(impact_force_source=2, impact_force_input=5e4)
    assert given["impact_force"] == 5e4


@BOTH
def test_outputs_can_be_read_in_initialization_mode(unit: str, open_unit: Open) -> None:
    host = open_unit(unit)
    host.fmu.setupExperiment(startTime=0.0)
    host.fmu.enterInitializationMode()
    for speed, peak in ((10.0, 493902.439), (20.0, 4 * 493902.439)):
        host["speed"] = speed
        assert host["peak_force"] == pytest.approx(peak, rel=1e-9)
    host["speed"] = -1.0
    assert math.isnan(host["peak_force"])


def reference_slide(
    start: tuple[float, float], end: float, force: Callable[[float], float], friction: float, mass: float
) -> tuple[float, float]:
    """Sliding by tiny explicit steps with the friction resolved in each: slow, simple, first order."""
    displacement, velocity, time = *start, 0.0
    step = end / 400_000
    for _ in range(400_000):
        applied = force(time + step / 2)
        if velocity == 0 and abs(applied) <= friction:
            time += step
            continue
        direction = math.copysign(1.0, velocity if velocity else applied)
        after = velocity + step * (applied - direction * friction) / mass
        if velocity and after * velocity < 0:
            after = 0.0
        displacement += step * (velocity + after) / 2
        velocity, time = after, time + step
    return displacement, velocity


@pytest.mark.parametrize(
    ("start", "force", "rate"),
    [
        ((0.0, 0.0), 0.0, 3e5),  # waits, then slips forward
        ((0.0, 0.0), 3e5, -3e5),  # slips, stops, waits, slips back
        ((0.0, 0.0), -2.5e5, 1e5),
        ((0.0, 2.0), -1e5, -2e5),  # stops and goes back without a pause
        ((0.0, 1.0), 0.0, 0.0),  # slides to rest
        ((0.0, -1.0), 1.5e5, 1e5),
    ],
)
def test_slide_against_small_steps(start: tuple[float, float], force: float, rate: float) -> None:
    friction, mass, duration = 1.8e5, 8e4, 2.0
    found = slide(*start, duration, force, rate, friction, 0.0, mass)
    expected = reference_slide(start, duration, lambda t: force + rate * t, friction, mass)
    assert found == pytest.approx(expected, abs=5e-5)  # the small steps are off by about one step's travel


def test_slide_in_parts_is_slide_in_one() -> None:
    draw = random.Random(11)
    for _ in range(500):
        x, v = draw.uniform(-1, 1), draw.choice([0.0, draw.uniform(-3, 3)])
        f, rate, r, friction_rate, mass = (
            draw.uniform(-4e5, 4e5),
            draw.uniform(-5e5, 5e5),
            draw.uniform(5e4, 2e5),
            draw.uniform(0, 5e4),
            9e4,
        )
        whole = slide(x, v, 1.5, f, rate, r, friction_rate, mass)
        t = 0.0
        for cut in [*sorted(draw.uniform(0, 1.5) for _ in range(7)), 1.5]:
            x, v = slide(x, v, cut - t, f + t * rate, rate, r + t * friction_rate, friction_rate, mass)
            t = cut
        assert (x, v) == pytest.approx(whole, abs=1e-9)


@BOTH
def test_loads_from_outside_against_an_ode_solver(unit: str, open_unit: Open) -> None:
    """An anchor force and a vertical load over a sliding barrier, against SciPy between the events of our making."""
    anchor, load, tangent, mass = -4e4, 8e4, PAPER["base_friction"], PAPER["barrier_mass"]
    impact = Impact(**PAPER, geometry_change=0.41)
    host = open_unit(unit).initialize(**PAPER)
    host.run(0.5)
    host["external_force"], host["vertical_load"] = anchor, load
    friction = tangent * (mass * 9.81 + load)

    def motion(t: float, y: np.ndarray) -> list[float]:
        return [y[1], (impact.force(t) + anchor - friction) / mass]

    def stopped(t: float, y: np.ndarray) -> float:
        return y[1]

    stopped.terminal, stopped.direction = True, -1  # type: ignore[attr-defined]
    start = [impact.barrier_displacement(0.5), impact.barrier_velocity(0.5)]
    settings = {"rtol": 1e-11, "atol": 1e-12, "events": stopped}
    first = solve_ivp(motion, (0.5, impact.peak_time), start, **settings)
    second = solve_ivp(motion, (impact.peak_time, 3.0), first.y[:, -1], **settings)
    stop_time, stop_place = second.t_events[0][0], second.y_events[0][0][0]
    assert stop_time < 3.0
    for _ in range(100):
        host.run(0.025)
    assert host["barrier_velocity"] == 0.0
    assert host["barrier_displacement"] == pytest.approx(stop_place, rel=1e-9)
    assert stop_place < impact.barrier_displacement_final


@BOTH
def test_constant_load_gives_the_same_motion_at_any_step(unit: str, open_unit: Open) -> None:
    results = []
    for size, count in ((0.5, 8), (0.1, 40), (0.002, 2000)):
        host = open_unit(unit).initialize(**PAPER)
        host["external_force"] = 2e5
        host.run(*[size] * count)
        results.append((host["barrier_displacement"], host["barrier_velocity"]))
    assert results[1] == pytest.approx(results[0], rel=1e-9)
    assert results[2] == pytest.approx(results[0], rel=1e-9)


@BOTH
def test_barrier_can_be_pulled_back(unit: str, open_unit: Open) -> None:
    host = open_unit(unit).initialize(**PAPER).run(4.0)
    place = host["barrier_displacement"]
    host["external_force"] = -0.29 * 81000 * 9.81 * 0.999
    host.run(1.0)
    assert host["barrier_displacement"] == place
    host["external_force"] = -0.29 * 81000 * 9.81 - 81000  # 1 m/s2 beyond the friction
    host.run(1.0)
    assert host["barrier_displacement"] == pytest.approx(place - 0.5, abs=1e-12)
    assert host["barrier_velocity"] == pytest.approx(-1.0, abs=1e-12)


@BOTH
def test_impact_force_as_an_input(unit: str, open_unit: Open) -> None:
    """The mean of the triangle over each step, as a simulator gives it, leads to the closed form as steps shrink."""
    impact = Impact(**PAPER, geometry_change=0.41)
    errors = []
    for count in (50, 100, 200):
        size = 3.0 / count
        host = open_unit(unit).initialize(impact_force_source=2, **PAPER)
        for i in range(count):
            mean = (impact.impulse_until((i + 1) * size) - impact.impulse_until(i * size)) / size
            host["impact_force_input"] = mean
            host.run(size)
            assert host["impact_force"] == mean
        errors.append(abs(host["barrier_displacement"] - impact.barrier_displacement_final))
        assert host["flow_velocity"] == pytest.approx(5.0, rel=1e-12)  # the impulse is exact at any step
    assert errors[2] < 2e-3
    assert errors[0] / errors[2] > 8  # second order would be 16; the slip event inside a step costs some


@BOTH
def test_impact_force_input_is_ignored_by_the_closed_form(unit: str, open_unit: Open) -> None:
    host = open_unit(unit).initialize(**PAPER, impact_force_input=3e5).run(4.0)
    assert host["barrier_displacement"] == pytest.approx(1.36484471, rel=1e-8)


@BOTH
@pytest.mark.parametrize("inputs", [{}, {"external_force": -3e4, "vertical_load": 5e4}])
def test_rollback(unit: str, inputs: dict[str, float], open_unit: Open) -> None:
    """A restored state goes on as the first time, also after bytes and in another instance; the value is compared
    bit by bit."""
    host = open_unit(unit).initialize(**PAPER)
    host.run(0.4)
    for name, value in inputs.items():
        host[name] = value
    host.run(0.3)
    state, time = host.fmu.getFMUstate(), host.time
    data = host.fmu.serializeFMUstate(state)
    first = host.run(0.2, 0.3).outputs()
    host.fmu.setFMUstate(state)
    host.time = time
    assert host.run(0.2, 0.3).outputs() == first
    other = open_unit(unit).initialize()
    other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(data))
    other.time = time
    assert other.run(0.2, 0.3).outputs() == first
    host.fmu.freeFMUstate(state)


@BOTH
def test_reset_forgets_everything(unit: str, open_unit: Open) -> None:
    fresh = open_unit(unit).initialize().run(1.0).outputs()
    host = open_unit(unit).initialize(speed=20.0, external_force=-1e5).run(1.0)
    assert host.again().run(1.0).outputs() == fresh


REFUSED = [
    ({"flow_mass": -1.0}, "flow_mass is -1 kg/m", "(0, inf) kg/m"),
    ({"barrier_mass": math.nan}, "barrier_mass is nan", "(0, inf)"),
    ({"speed": math.inf}, "speed is inf", "(0, inf)"),
    ({"rise_ratio": 0.0}, "rise_ratio is 0", "(0, 1]"),
    ({"geometry_change": 1.5}, "geometry_change is 1.5", "(0, 1]"),
    ({"base_friction": -0.1}, "base_friction is -0.1", "[0, inf)"),
    ({"s1max": 20.0}, "s1max is 20", "15]"),
    ({"variant": 4}, "variant is 4", "1 (stick_slip), 2 (momentum_closed), 3 (as_printed)"),
    ({"barrier_initial_velocity": 12.0}, "barrier_initial_velocity is 12", "[0, 10)"),
    ({"vertical_load_ratio": 4.0}, "vertical_load_ratio is 4", "[0, 3.44828)"),
    ({"vertical_load_ratio": 0.5, "variant": 3}, "vertical_load_ratio is 0.5", "0 with as_printed"),
    ({"slope": 95.0}, "slope is 95 deg", "[-89, 89] deg"),
    ({"slope": -20.0}, "base_friction is 0.29, on a slope of -20 degrees it must be above 0.364", "its own weight"),
    ({"external_force": math.nan}, "external_force is nan", "[-1e+09, 1e+09] N/m"),
]


@BOTH
@pytest.mark.parametrize(("values", "says", "allowed"), REFUSED)
def test_bad_values_are_refused(
    unit: str, values: dict[str, Any], says: str, allowed: str, open_unit: Open, capfd: pytest.CaptureFixture[str]
) -> None:
    """Status error or worse at the end of initialization, with name, value and range, whatever loggingOn says."""
    host = open_unit(unit)
    with pytest.raises(FMICallException):
        host.initialize(**values)
    text = "".join(capfd.readouterr())
    assert says in text
    assert allowed in text
    assert host.again().run(1.0)["barrier_displacement"] > 0  # and the instance can be used again after a reset


@BOTH
def test_bad_input_fails_the_step_and_leaves_no_results(
    unit: str, open_unit: Open, capfd: pytest.CaptureFixture[str]
) -> None:
    host = open_unit(unit).initialize()
    host["external_force"] = math.nan
    try:
        status = host.step(0.1)
    except FMICallException as error:
        status = error.status
    assert status >= 2  # discard from Python, error from C
    assert "external_force is nan" in "".join(capfd.readouterr())
    assert all(math.isnan(value) for name, value in host.outputs().items() if name != "impact_phase")


@BOTH
@pytest.mark.parametrize(("name", "value"), [("impact_force", 1.0), ("speed", 5.0)])
def test_outputs_and_fixed_parameters_are_write_protected(unit: str, name: str, value: float, open_unit: Open) -> None:
    host = open_unit(unit).initialize()
    before = host[name]
    with pytest.raises(FMICallException):
        host[name] = value
    assert host[name] == before
    assert host.run(0.5)["barrier_displacement"] > 0


@BOTH
def test_printed_formulas_take_no_loads(unit: str, open_unit: Open, capfd: pytest.CaptureFixture[str]) -> None:
    host = open_unit(unit).initialize(variant=3)
    host["external_force"] = 1.0
    try:
        status = host.step(0.1)
    except FMICallException as error:
        status = error.status
    assert status >= 2
    assert "external_force and vertical_load must be 0" in "".join(capfd.readouterr())


@BOTH
def test_a_step_back_needs_a_state(unit: str, open_unit: Open, capfd: pytest.CaptureFixture[str]) -> None:
    host = open_unit(unit).initialize().run(1.0)
    host.time = 0.5
    try:
        status = host.step(0.1)
    except FMICallException as error:
        status = error.status
    assert status >= 2
    assert "the unit stands at 1 s" in "".join(capfd.readouterr())
