"""Bounds on the time step against the eigenvalues of the update that they bound."""

import math

import numpy as np
import pytest

from warp_mpm.effect_rules import with_law
from warp_mpm.hard_cases.measure import measure
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.simulator.schemes import SCHEMES
from warp_mpm.time_step import (
    biot_wave_speeds,
    explicit_drag_step,
    lone_point_courant_number,
    step_limits,
    undrained_wave_speed,
)

SPACING, GRAIN, LIQUID, GRAVITY = 0.2, 2600.0, 1000.0, 9.81


def true_limit(n, conductivity, oedometric_modulus, bulk_modulus):
    """Largest step for which the explicit symplectic update of one linear element's highest mode does not grow."""
    solid = 1.0 - n
    mass = np.diag([solid * GRAIN, n * LIQUID])
    coupling = solid * bulk_modulus
    stiffness = np.array([[oedometric_modulus + solid * coupling / n, coupling], [coupling, n * bulk_modulus]])
    drag = n**2 * LIQUID * GRAVITY / conductivity * np.array([[1.0, -1.0], [-1.0, 1.0]])
    k = np.linalg.solve(mass, 4.0 / SPACING**2 * stiffness)
    c = np.linalg.solve(mass, drag)

    def growth(step):
        velocity = np.hstack([-step * k, np.eye(2) - step * c])
        position = np.hstack([np.eye(2), np.zeros((2, 2))]) + step * velocity
        return np.abs(np.linalg.eigvals(np.vstack([position, velocity]))).max()

    low, high = 1e-9, 1.0
    for _ in range(60):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if growth(middle) <= 1.0 + 1e-9 else (low, middle)
    return low


@pytest.mark.parametrize(
    ("n", "conductivity", "expected"),
    [(0.5, 1e-4, 2.944e-5), (0.5, 1e-2, 9.36e-4), (0.3, 1e-4, 5.829e-5), (0.3, 1e-3, 5.25e-4)],
)
def test_the_eigenvalues_are_those_of_the_equations_audit(n, conductivity, expected):
    """Limits found before, with E = 2 MPa and K_L = 30 MPa at 0.2 m: they keep this reference honest."""
    assert true_limit(n, conductivity, 2.4e6, 3e7) == pytest.approx(expected, rel=2e-2)


@pytest.mark.parametrize("n", [0.3, 0.45, 0.6])
@pytest.mark.parametrize("conductivity", [1e-5, 1e-3, 1e-1])
@pytest.mark.parametrize("bulk_modulus", [3e7, 2.2e9])
def test_the_explicit_bound_is_safe_and_close(n, conductivity, bulk_modulus):
    bound = explicit_drag_step(
        spacing=SPACING,
        oedometric_modulus=2.4e6,
        liquid_bulk_modulus=bulk_modulus,
        porosity=n,
        solid_density=GRAIN,
        liquid_density=LIQUID,
        conductivity=conductivity,
    )
    # 1.252 is the widest gap found in a scan of porosity, stiffness and conductivity.
    assert 1.0 - 1e-6 <= true_limit(n, conductivity, 2.4e6, bulk_modulus) / bound <= 1.26


@pytest.mark.parametrize(("n", "expected"), [(0.5, 1.078e-3), (0.3, 9.12e-4)])
def test_undrained_wave_as_in_the_audit(n, expected):
    density = (1.0 - n) * GRAIN + n * LIQUID
    assert SPACING / undrained_wave_speed(2e6, 3e7 / n, density) == pytest.approx(expected, rel=1e-3)


def test_biots_two_waves():
    """Their product and sum are determinant and trace; the fast one is that of the free update without drag."""
    fast, slow = biot_wave_speeds(2.4e6, 3e7, 0.5, GRAIN, LIQUID)
    n, solid = 0.5, 0.5
    determinant = 2.4e6 * n * 3e7 / (solid * GRAIN * n * LIQUID)
    assert (fast * slow) ** 2 == pytest.approx(determinant, rel=1e-12)
    assert fast > slow > 0.0
    # Without drag the mode of the element is stable up to d / c_fast.
    assert true_limit(0.5, 1e9, 2.4e6, 3e7) == pytest.approx(SPACING / fast, rel=1e-4)


def test_limits_of_the_scenes(load_scene):
    """Case 1 with drag explicit: 2.942e-5 s; semi-implicit, no drag limit; artificial viscosity costs its share."""
    limits = step_limits(load_scene("case_1", **{"numerics.drag": "explicit"}))
    assert limits.drag_step == pytest.approx(2.942e-5, rel=1e-3)
    implicit = step_limits(load_scene("case_1"))
    assert implicit.drag_step == math.inf
    plain = step_limits(load_scene("case_1", **{"numerics.bulk_viscosity": 0.0}))
    assert plain.wave_speed == plain.sound_speed == implicit.sound_speed
    b = 0.2
    assert implicit.wave_speed == pytest.approx(implicit.sound_speed * (b + math.sqrt(1.0 + b * b)), rel=1e-12)
    # Linear viscosity on the mode of omega = 2 c / d, lagged by one step: s dt^2 omega^2 + 2 b dt omega = 4 at most.
    reached = SPACING / implicit.wave_speed * implicit.sound_speed / SPACING
    assert reached**2 + 2.0 * b * reached == pytest.approx(1.0, rel=1e-12)


def growth_of_a_lone_point(load_scene, transfer, place, step):
    """By what factor the stress of one elastic point grows in 200 steps of c dt / d = `step`, from 1 Pa, or
    until it has grown enough."""
    corners = [[-2.0, 2.0], [-1.75, 2.0], [-1.75, 2.25], [-2.0, 2.25]]
    data = load_scene("case_1_dry").resolved()
    data |= {"barrier": None, "ground": None, "gravity": {"acceleration_m_per_s2": 0.0}}
    data["flow"] |= {
        "shape": {"kind": "polygon", "vertices_m": corners},
        "velocity_m_per_s": [0.0, 0.0],
        "initial_stress": "zero",
    }
    data["numerics"] |= {"spacing_m": 0.25, "points_per_cell": 1, "transfer": transfer, "bulk_viscosity": 0.0}
    data["numerics"]["courant_number"] = step
    scenario = Scenario.model_validate(data)
    scenario = scenario.replaced(with_law(scenario, "elastic"))
    simulation = Simulation(scenario)
    sound = step_limits(scenario).sound_speed
    simulation._parameters.wave_speed = sound  # the step of a full grid
    simulation._point_arrays["position"].assign(np.array([[-2.0 + 0.25 * place, 2.0 + 0.25 * place]]))
    simulation.set_points(effective_stress=np.array([[1.0, 1.0, 0.0, 0.0]]))
    greatest = 0.0
    for steps in range(10, 201, 10):
        simulation.advance(steps * step * 0.25 / sound)
        greatest = np.abs(simulation.points()["effective_stress"]).max()
        if greatest > 1e4:  # and soon no number
            break
    return greatest


@pytest.mark.parametrize(
    "transfer", ["aflip", *(pytest.param(transfer, marks=pytest.mark.slow) for transfer in ("apic", "flip"))]
)
@pytest.mark.parametrize("place", [0.5, 0.7, 0.95])
def test_limit_of_a_lone_point(load_scene, transfer, place):
    """Just below the limit that its place in the cell gives it does not grow, just above it does."""
    slopes = 4.0 + (1.0 - 2.0 * place) ** 2 / (0.5 + place - place**2)
    scheme = SCHEMES.named(transfer)
    limit = lone_point_courant_number(0.25, scheme, slopes)
    assert growth_of_a_lone_point(load_scene, transfer, place, 0.97 * limit) < 10.0
    assert growth_of_a_lone_point(load_scene, transfer, place, 1.05 * limit) > 1e3
    assert limit >= lone_point_courant_number(0.25, scheme)


def test_lone_points_count_where_there_is_tension(load_scene):
    """An elastic flow takes the step that a lone point bears; one without tension is not slowed by it."""
    plain = step_limits(load_scene("case_1_dry"))
    elastic = step_limits(load_scene("case_1_dry", **with_law(load_scene("case_1_dry"), "elastic")))
    cohesive = {"flow.material.cohesion_Pa": 1e4, "flow.material.tension_cutoff_Pa": 5e3}
    alone = lone_point_courant_number(0.25, SCHEMES.named("aflip"))
    assert elastic.wave_speed == pytest.approx(plain.wave_speed / alone, rel=1e-12)
    assert step_limits(load_scene("case_1_dry", **cohesive)) == elastic
    wet = step_limits(load_scene("case_1", **{"flow.material.cavitation_pressure_Pa": 1e5}))
    assert wet.wave_speed == pytest.approx(2.0 * step_limits(load_scene("case_1")).wave_speed, rel=1e-12)


def test_voids_that_shrink_stiffen_the_liquid_in_them(load_scene):
    """Where the porosity is followed, waves gain speed as it falls: at the step of the start an impact at 45 m/s made a
    tenth more energy than there had been."""
    changes = {"flow.velocity_m_per_s": [45.0, 0.0], "flow.material.porosity": 0.24}
    changes |= {"flow.material.young_modulus_Pa": 1e5, "flow.material.liquid_bulk_modulus_Pa": 2e6}
    changes |= {"numerics.spacing_m": 0.6, "numerics.courant_number": 0.8, "flow.lateral_stress_coefficient": None}
    output = {"end_time_s": 1.0, "time_series_interval_s": 0.01, "snapshot_interval_s": 0.05}
    assert measure(load_scene("case_1_loose", **changes | {"output": output})).figures["energy_error"] < 0.01
