"""Drag between the phases, semi-implicit and explicit, against the exact decay of their relative velocity."""

import numpy as np
import pytest
import warp as wp

from warp_mpm.effect_rules import effect_rules
from warp_mpm.effects import Effects
from warp_mpm.kernels.layout import layout
from warp_mpm.kernels.pore_pressure import make_pore_pressure
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.simulation import Simulation
from warp_mpm.summary import energy_error

BLOCK = {"kind": "polygon", "vertices_m": [[-12, 4], [-8, 4], [-8, 8], [-12, 8]]}
CONDUCTIVITY = 0.05
# Rate at which v_L - v_S decays: n^2 rho_L g / k (1 / n_S rho_S + 1 / n rho_L).
RATE = 0.25 * 1000.0 * 9.81 / CONDUCTIVITY * (1.0 / 1300.0 + 1.0 / 500.0)
DURATION = 0.02


def flying_block(load_scene, drag, courant_number):
    """A block far from everything, no gravity, its liquid faster than its solid."""
    changes = {
        "numerics.spacing_m": 0.5,
        "numerics.drag": drag,
        "numerics.courant_number": courant_number,
        "gravity.acceleration_m_per_s2": 0.0,
        "flow.shape": BLOCK,
        "flow.velocity_m_per_s": [0.0, 0.0],
        "flow.initial_stress": "zero",
        "flow.material.hydraulic_conductivity_m_per_s": CONDUCTIVITY,
        "output.end_time_s": DURATION,
        "barrier": None,
        "ground": None,
    }
    simulation = Simulation(load_scene("case_1", **changes))
    number = simulation.material_points
    simulation.set_points(liquid_velocity=np.tile([1.0, -0.5], (number, 1)))
    return simulation


def relative_velocity(simulation):
    """Mean of v_L - v_S [2] m/s."""
    points = simulation.points()
    solid, liquid = points["solid_mass"], points["liquid_mass"]
    return liquid @ points["liquid_velocity"] / liquid.sum() - solid @ points["solid_velocity"] / solid.sum()


@pytest.mark.parametrize(("drag", "sign"), [("semi_implicit", 1.0), ("explicit", -1.0)])
def test_relative_velocity_decays_at_the_rate_of_darcys_law(load_scene, drag, sign):
    """First order in the step, from above if implicit, from below if explicit; both to the exact exponential. Inside
    the block the phases push on each other too, but over the whole block these forces cancel."""
    exact = np.array([1.0, -0.5]) * np.exp(-RATE * DURATION)
    errors = []
    for courant_number in (0.8, 0.4, 0.2):
        simulation = flying_block(load_scene, drag, courant_number)
        simulation.advance(DURATION)
        errors.append((relative_velocity(simulation) - exact) / exact)
    errors = np.array(errors)
    assert (sign * errors > 0.0).all()
    # Half the step, half the error: to within the second-order term, of the size of the error itself.
    np.testing.assert_allclose(errors[1:] / errors[:-1], 0.5, atol=np.abs(errors[0]).max())
    # Next to nothing remains when both extremes are extrapolated to a step of zero.
    assert np.abs(2.0 * errors[2] - errors[1]).max() < 0.02


def test_gravity_works_on_the_liquid_that_moves_through_the_skeleton(load_scene):
    """m_L g · ∫ (v_L - v_S) dt, which decays as above; and without it the ledger would see energy come from nowhere."""
    simulation = flying_block(load_scene, "semi_implicit", 0.2)
    gravity = np.array([0.3, -9.7])
    simulation._parameters.gravity = simulation._types.V2(*gravity)
    liquid = simulation.points()["liquid_mass"].sum()
    assert simulation.sample()["seepage_work"] == 0.0
    for record in range(1, 41):
        simulation.advance(DURATION * record / 40)
        work = simulation.sample()["seepage_work"]
    exact = liquid * gravity @ [1.0, -0.5] * (1.0 - np.exp(-RATE * DURATION)) / RATE
    # The drag is of first order in the step: 1.4 % too much here, 0.9 % with two thirds of the step.
    assert work == pytest.approx(exact, rel=0.02)


def test_a_permeable_flow_creates_no_energy(load_scene):
    changes = {
        "numerics.spacing_m": 0.5, "flow.velocity_m_per_s": [0.0, 0.0], "output.end_time_s": 1.0,
        "flow.material.hydraulic_conductivity_m_per_s": 1.0,
    }  # fmt: skip
    simulation = Simulation(load_scene("case_1", **changes))
    samples = []
    for record in range(101):
        simulation.advance(0.01 * record)
        samples.append(simulation.sample())
    series = {name: np.array([sample[name] for sample in samples]) for name in samples[0]}
    assert series["seepage_work"][-1] > 0.0
    assert energy_error(series) == 0.0
    # Liquid that sinks has less potential energy than the skeleton that it is carried with.
    assert energy_error(series | {"seepage_work": np.zeros(101)}) > 1e-4


def test_factor_of_one_step(load_scene):
    """1 / (1 + r dt) if implicit, 1 - r dt if explicit, for the phases as a whole and whatever else they do."""
    step = 1e-3
    for drag, factor in (("semi_implicit", 1.0 / (1.0 + RATE * step)), ("explicit", 1.0 - RATE * step)):
        simulation = flying_block(load_scene, drag, 0.95)
        simulation.advance(step)
        assert simulation.steps == 1
        np.testing.assert_allclose(relative_velocity(simulation), factor * np.array([1.0, -0.5]), rtol=1e-11)


def test_both_ways_agree_as_the_step_goes_to_zero(load_scene):
    """The whole fields, not their means alone."""
    differences = []
    for courant_number in (0.4, 0.2, 0.1):
        fields = []
        for drag in ("semi_implicit", "explicit"):
            simulation = flying_block(load_scene, drag, courant_number)
            simulation.advance(DURATION)
            fields.append(simulation.points()["liquid_velocity"])
        differences.append(np.abs(fields[0] - fields[1]).max())
    ratios = np.divide(differences[1:], differences[:-1])
    np.testing.assert_allclose(ratios, 0.5, atol=0.1)


def test_momentum_passes_from_phase_to_phase_and_none_is_lost(load_scene):
    simulation = flying_block(load_scene, "semi_implicit", 0.8)
    simulation.advance(DURATION)
    points = simulation.points()
    total = points["solid_mass"] @ points["solid_velocity"] + points["liquid_mass"] @ points["liquid_velocity"]
    np.testing.assert_allclose(total, 16.0 * 500.0 * np.array([1.0, -0.5]), rtol=1e-12)


def test_explicit_drag_pays_in_steps(load_scene):
    """At k = 1e-4 m/s: the step falls to the time in which the phases' velocities meet, and the record says so."""
    changes = {"numerics.spacing_m": 0.5, "barrier": None, "ground": None}
    records = {}
    for drag in ("semi_implicit", "explicit"):
        simulation = Simulation(load_scene("case_1", **changes | {"numerics.drag": drag}))
        simulation.advance(0.02)
        records[drag] = simulation.record
    implicit, explicit = records["semi_implicit"], records["explicit"]
    assert explicit["steps"] > 40 * implicit["steps"]
    assert explicit["steps_limited_by_drag"] >= explicit["steps"] - 1
    assert implicit["steps_limited_by_wave"] >= implicit["steps"] - 1
    # 0.95 of the uniform-slip limit 2 k n_S rho_S / (n g rho_m) = 2.94e-5 s.
    assert explicit["time_step_max"] == pytest.approx(0.95 * 2.94e-5, rel=0.01)


def errors_of_the_slip(load_scene, exact, duration, *, volume=1.0, **changes):
    """Relative errors of the slip in the middle of a flying block, where nothing is felt of its edges yet, against an
    `exact` one, with two Courant numbers, and the points there; `volume`: share that its skeleton is pressed to."""
    errors = []
    for courant_number in (0.4, 0.1):
        base = {
            "numerics.spacing_m": 0.5,
            "numerics.courant_number": courant_number,
            "gravity.acceleration_m_per_s2": 0.0,
            "flow.shape": BLOCK,
            "flow.velocity_m_per_s": [0.0, 0.0],
            "flow.initial_stress": "zero",
            "flow.material.hydraulic_conductivity_m_per_s": CONDUCTIVITY,
            "output.end_time_s": duration,
        }
        simulation = Simulation(load_scene("case_1", **base | changes))
        if volume != 1.0:
            volumes = simulation._point_arrays["volume"]
            volumes.assign(volume * volumes.numpy())
        simulation.set_points(liquid_velocity=np.tile([1.0, -0.5], (simulation.material_points, 1)))
        simulation.advance(duration)
        points = simulation.points()
        middle = (np.abs(points["position"] - [-10.0, 6.0]) < 0.5).all(axis=1)
        points = {name: values[middle] for name, values in points.items()}
        slip = (points["liquid_velocity"] - points["solid_velocity"]).mean(axis=0)
        assert slip[1] / slip[0] == pytest.approx(-0.5, rel=1e-3)
        errors.append(np.hypot(*slip) / exact - 1.0)
    return errors, points


def test_inertial_drag_slows_the_slip_by_its_square(load_scene):
    """In the middle of a flying block, where nothing is felt of its edges yet: dw/dt = -(a + b w) w has
    w = a / ((a / w_0 + b) exp(a t) - b). First order in the step."""
    coefficient, duration = 0.1, 0.006
    permeability = CONDUCTIVITY * 1e-3 / (1000.0 * 9.81)
    square = 0.125 * 1000.0 * coefficient / np.sqrt(permeability) * (1.0 / 1300.0 + 1.0 / 500.0)
    start = np.hypot(1.0, 0.5)
    exact = RATE / ((RATE / start + square) * np.exp(RATE * duration) - square)
    changes = {"barrier": None, "ground": None, "flow.material.inertial_drag_coefficient": coefficient}
    errors, _ = errors_of_the_slip(load_scene, exact, duration, **changes)
    # Darcy's law alone would leave more than twice as much.
    assert start * np.exp(-RATE * duration) > 2.0 * exact
    # A quarter of the step, a quarter of the error; next to nothing remains at a step of zero.
    assert 0.0 < errors[1] < 0.35 * errors[0]
    assert abs(4.0 * errors[1] - errors[0]) / 3.0 < 0.02


def test_without_inertial_drag_nothing_of_it_is_there(load_scene):
    plain, dragged = (
        Simulation(load_scene("case_1", **COARSE | {"flow.material.inertial_drag_coefficient": coefficient}))
        for coefficient in (0.0, 0.4)
    )
    assert "inertial_drag_rate" not in plain._types.Parameters.vars
    assert "inertial_drag_rate" in dragged._types.Parameters.vars
    assert plain.effects.module_name in dragged.effects.module_name.replace("-inertial_drag", "")


COARSE = {"numerics.spacing_m": 0.5, "output.end_time_s": 0.1}


def test_inertial_drag_is_implicit_alone(load_scene):
    changes = {"numerics.drag": "explicit", "flow.material.inertial_drag_coefficient": 0.4}
    with pytest.raises(
        ScenarioError, match=r'inertial_drag_coefficient = 0.4 is not allowed with numerics.drag = "exp'
    ):
        load_scene("case_1", **changes)
    for kept in ({"numerics.drag": "explicit"}, {"flow.material.inertial_drag_coefficient": 0.4}):
        for rule in effect_rules(load_scene("case_1", **kept)):
            load_scene("case_1", **kept).replaced(rule.switched)


@pytest.mark.parametrize("law", ["kozeny_carman", "exponential"])
def test_conductivity_follows_the_porosity(law):
    """The function that the nodes' drag rests on, against the formulas."""
    effects = Effects("two_phase", drag="semi_implicit", porosity_update=True, conductivity=law)
    types = layout(effects)
    resistance = make_pore_pressure(types).resistance
    parameters = types.Parameters()
    parameters.porosity = 0.45
    if law == "exponential":
        parameters.conductivity_scale = 0.04

    @wp.kernel(module="unique", enable_backward=False)
    def over(n: wp.array(dtype=wp.float64), parameters: types.Parameters):
        p = wp.tid()
        n[p] = resistance(n[p], parameters)

    given = np.linspace(0.05, 0.95, 19)
    found = wp.array(given, dtype=wp.float64, device="cpu")
    wp.launch(over, len(given), [found, parameters], device="cpu")
    permeability = {
        "kozeny_carman": given**3 / (1.0 - given) ** 2 / (0.45**3 / 0.55**2),
        "exponential": np.exp((given - 0.45) / 0.04),
    }[law]
    np.testing.assert_allclose(found.numpy(), 1.0 / permeability, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "inertial"), [("kozeny_carman", 0.0), ("exponential", 0.0), ("exponential", 1e-3)])
def test_drag_decays_at_the_rate_of_the_porosity_that_there_is(load_scene, law, inertial):
    """As a flying block whose skeleton has been pressed together: n²/k there in place of that at the start; with
    Forchheimer's part besides, n³/√κ, as in the test of that above. First order in the step."""
    ratio, duration = 0.9, 0.006
    n = 1.0 - 0.5 / ratio
    resisting = {
        "kozeny_carman": (0.5 / n) ** 3 * ((1.0 - n) / 0.5) ** 2,
        "exponential": np.exp((0.5 - n) / 0.04),
    }[law]
    rate = RATE * (n / 0.5) ** 2 * resisting
    permeability = CONDUCTIVITY * 1e-3 / (1000.0 * 9.81)
    square = n**3 * 1000.0 * inertial * np.sqrt(resisting / permeability) * (1.0 / 1300.0 + 1.0 / 500.0)
    start = np.hypot(1.0, 0.5)
    exact = rate / ((rate / start + square) * np.exp(rate * duration) - square)
    changes = {
        "flow.material.porosity_update": True,
        "flow.material.conductivity_law": law,
        "flow.material.inertial_drag_coefficient": inertial,
    }
    errors, points = errors_of_the_slip(load_scene, exact, duration, volume=ratio, **changes)
    assert points["porosity"] == pytest.approx(n, abs=1e-3)
    assert 0.0 < errors[1] < 0.35 * errors[0]
    assert abs(4.0 * errors[1] - errors[0]) / 3.0 < 0.02


def test_a_conductivity_that_follows_needs_a_porosity_that_does(load_scene):
    follows = {"flow.material.conductivity_law": "kozeny_carman"}
    with pytest.raises(
        ScenarioError, match='conductivity_law = "kozeny_carman" is not allowed with porosity_update = f'
    ):
        load_scene("case_1", **follows)
    both = follows | {"flow.material.porosity_update": True}
    with pytest.raises(
        ScenarioError, match=r'conductivity_law = "kozeny_carman" is not allowed with numerics\.drag = "ex'
    ):
        load_scene("case_1", **both, **{"numerics.drag": "explicit"})
    scenario = load_scene("case_1", **both)
    for rule in effect_rules(scenario):
        scenario.replaced(rule.switched)
