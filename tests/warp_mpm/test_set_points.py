"""An initial state other than the scenario's."""

import numpy as np
import pytest

from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation


def body(formulation="two_phase"):
    """A cube of mixture, or of a dry elastic material, at rest in free space."""
    material = {"grain_density_kg_per_m3": 2600, "porosity": 0.5, "young_modulus_Pa": 2e6, "poisson_ratio": 0.25}
    material |= {"law": "elastic"} if formulation == "dry" else {"friction_angle_deg": 20}
    if formulation != "dry":
        material |= {"liquid_density_kg_per_m3": 1000, "liquid_bulk_modulus_Pa": 3e7}
    if formulation == "two_phase":
        material |= {"hydraulic_conductivity_m_per_s": 1e-4}
    flow = {
        "formulation": formulation,
        "shape": {"kind": "polygon", "vertices_m": [[0, 0], [1, 0], [1, 1], [0, 1]]},
        "velocity_m_per_s": [0, 0],
        "initial_stress": "zero",
        "material": material,
    }
    scene = {"title": "cube", "gravity": {"acceleration_m_per_s2": 0}, "flow": flow, "ground": None}
    scene |= {"numerics": {"spacing_m": 0.25}, "output": {"end_time_s": 1e-3}}
    return Simulation(Scenario.model_validate(scene))


def test_the_state_is_that_which_was_set():
    simulation = body()
    points = simulation.points()
    number = len(points["position"])
    state = {
        "solid_velocity": np.tile([1.0, 2.0], (number, 1)),
        "liquid_velocity": np.tile([3.0, 4.0], (number, 1)),
        "effective_stress": np.tile([-4e3, -3e3, -2e3, 1e3], (number, 1)),
        "pore_pressure": 1e3 * points["position"][:, 1],
    }
    simulation.set_points(**state)
    for name, values in state.items():
        np.testing.assert_allclose(simulation.points()[name], values, rtol=1e-14)


def test_momentum_of_a_set_velocity_is_accounted_for():
    simulation = body()
    number = simulation.material_points
    simulation.set_points(
        solid_velocity=np.tile([2.0, 0.0], (number, 1)), liquid_velocity=np.tile([0.0, 1.0], (number, 1))
    )
    simulation.advance(1e-3)
    sample = simulation.sample()
    assert sample["momentum_x"] == pytest.approx(2.0 * 1300.0, rel=1e-12)
    assert sample["momentum_y"] == pytest.approx(500.0, rel=1e-12)
    assert abs(sample["momentum_residual_x"]) < 1e-8
    assert abs(sample["momentum_residual_y"]) < 1e-8


def test_the_first_step_knows_the_set_speed():
    simulation = body("dry")
    simulation.set_points(solid_velocity=np.tile([500.0, 0.0], (simulation.material_points, 1)))
    simulation.advance(1e-3)
    # At rest the step would be more than ten times this: sound runs at sqrt(E_oed / rho) = 43 m/s.
    numerics = simulation.scenario.numerics
    assert simulation.record["time_step_max"] <= numerics.courant_number * numerics.spacing_m / 500.0


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ({"liquid_velocity": np.zeros((64, 2))}, "knows no liquid_velocity"),
        ({"solid_velocity": np.zeros(64)}, r"shape \(64, 2\), not \(64,\)"),
        ({"effective_stress": np.full((64, 4), np.nan)}, "needs finite effective_stress"),
    ],
)
def test_what_cannot_be_set_is_refused_in_one_sentence(state, words):
    simulation = body("dry")
    with pytest.raises(ValueError, match=words):
        simulation.set_points(**state)


def test_a_run_that_has_begun_is_not_changed():
    simulation = body("dry")
    simulation.advance(1e-3)
    with pytest.raises(ValueError, match="has made steps already"):
        simulation.set_points(solid_velocity=np.zeros((64, 2)))


@pytest.mark.parametrize("transfer", ["aflip", pytest.param("flip", marks=pytest.mark.slow)])
def test_a_velocity_over_the_depth_is_that_which_could_be_set(load_scene, transfer):
    """The scheme's own fields and the first step are those of the velocities too, and all momentum is counted."""
    changes = {"numerics.spacing_m": 0.5, "numerics.transfer": transfer}
    given = Simulation(load_scene("case_1", **changes | {"flow.velocity_profile": [[0, 0], [0.1, 0], [1, 2]]}))
    points = given.points()
    fastest = given.scenario.flow.greatest_speed  # the scheme's damping goes by it
    by_hand = Simulation(load_scene("case_1", **changes | {"flow.velocity_m_per_s": [fastest, 0.0]}))
    by_hand.set_points(solid_velocity=points["solid_velocity"], liquid_velocity=points["liquid_velocity"])
    for simulation in (given, by_hand):
        simulation.advance(0.05)
    assert given.sample()["momentum_x"] > 0.0
    # What lies still at the start weighs as much as what moves.
    assert abs(given.sample()["momentum_residual_x"]) < 1e-9 * given.sample()["momentum_x"]
    for name, values in given.points().items():
        np.testing.assert_allclose(
            values, by_hand.points()[name], rtol=1e-9, atol=1e-9 * np.abs(values).max(), err_msg=name
        )
