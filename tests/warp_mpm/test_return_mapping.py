"""The return mapping against a slow solver that knows nothing of regions: it tries every set of active planes."""

import math
from itertools import combinations, permutations
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from scipy.optimize import minimize

from warp_mpm.effects import Effects
from warp_mpm.kernels.elementary import make_elementary
from warp_mpm.kernels.layout import layout
from warp_mpm.simulator.laws.mohr_coulomb import make_return_mapping, yield_constants

YOUNG, POISSON = 2e6, 0.25
SHEAR = YOUNG / (2.0 * (1.0 + POISSON))
LAME = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
STIFFNESS = LAME * np.ones((3, 3)) + 2.0 * SHEAR * np.eye(3)

MATERIALS = {
    "cohesive with cut-off, associated": (30.0, 30.0, 5e3, 2e3),
    "cohesive with cut-off, dilatant": (30.0, 10.0, 5e3, 2e3),
    "cut-off at the apex": (25.0, 5.0, 4e3, math.inf),
    "the paper's: no cohesion, no tension, no dilatancy": (20.0, 0.0, 0.0, 0.0),
    "steep and dilatant": (45.0, 40.0, 1e3, 1e2),
    "no friction (Tresca)": (0.0, 0.0, 5e3, 3e3),
}
"""Friction angle, dilatancy angle [°], cohesion, tension cut-off [Pa]."""


@pytest.fixture(scope="module")
def mapped():
    """Function of material and trial stresses [N, 4] (xx, yy, zz, xy) that gives the kernel's stresses and openings."""
    types = layout(Effects("dry"))
    return_mapping = make_return_mapping(types, make_elementary(types))
    Parameters, V4 = types.Parameters, types.V4

    @wp.kernel(module="unique", enable_backward=False)
    def bring_back(
        parameters: Parameters, trial: wp.array(dtype=V4), out: wp.array(dtype=V4), gap: wp.array(dtype=wp.float64)
    ):
        p = wp.tid()
        stress, opening = return_mapping(trial[p], parameters)
        out[p] = stress
        gap[p] = opening

    def run(material, trial):
        friction, dilatancy, cohesion, cutoff = material
        parameters = Parameters()
        constants = yield_constants(
            lame=LAME,
            shear_modulus=SHEAR,
            friction_angle=math.radians(friction),
            dilatancy_angle=math.radians(dilatancy),
            cohesion=cohesion,
            tension_cutoff=cutoff,
        )
        elastic = {"lame": LAME, "shear_modulus": SHEAR, "bulk_modulus": LAME + 2.0 / 3.0 * SHEAR}
        for name, value in (constants | elastic).items():
            setattr(parameters, name, value)
        out, gap = wp.zeros(len(trial), dtype=V4, device="cpu"), wp.zeros(len(trial), dtype=wp.float64, device="cpu")
        wp.launch(bring_back, len(trial), [parameters, wp.array(trial, dtype=V4, device="cpu"), out, gap], device="cpu")
        return SimpleNamespace(stress=out.numpy(), opening=gap.numpy())

    return run


def planes(material):
    """Yield planes in principal stress: normals [9, 3], offsets [9], flow directions [9, 3]; f = n . s - offset."""
    friction, dilatancy, cohesion, cutoff = material
    sine, sine_flow = math.sin(math.radians(friction)), math.sin(math.radians(dilatancy))
    normals, flows, offsets = [], [], []
    for i, j in permutations(range(3), 2):
        normal, flow = np.zeros(3), np.zeros(3)
        normal[i], normal[j] = 1.0 + sine, -(1.0 - sine)
        flow[i], flow[j] = 1.0 + sine_flow, -(1.0 - sine_flow)
        normals.append(normal)
        flows.append(flow)
        offsets.append(2.0 * cohesion * math.cos(math.radians(friction)))
    apex = cohesion / math.tan(math.radians(friction)) if friction else math.inf
    for i in range(3):
        normals.append(np.eye(3)[i])
        flows.append(np.eye(3)[i])
        offsets.append(min(cutoff, apex))
    return np.array(normals), np.array(offsets), np.array(flows)


def principal(stress):
    """Principal stresses [N, 3]: the two in the plane (greater first), zz."""
    mean, half = 0.5 * (stress[:, 0] + stress[:, 1]), 0.5 * (stress[:, 0] - stress[:, 1])
    radius = np.hypot(half, stress[:, 3])
    return np.stack([mean + radius, mean - radius, stress[:, 2]], axis=1)


def solved(material, trial):
    """Stress [N, 3] for principal trial stress [N, 3], and how many planes act: the conditions of Karush, Kuhn and
    Tucker, solved by trying every set of up to three planes."""
    normals, offsets, flows = planes(material)
    scale = np.abs(trial).max() + offsets[6]
    result, count = np.full_like(trial, np.nan), np.zeros(len(trial), dtype=int)
    open_ = np.ones(len(trial), dtype=bool)
    for number in range(4):
        for chosen in combinations(range(9), number):
            rows = list(chosen)
            stress, multipliers = trial, np.zeros((len(trial), 0))
            if rows:
                step = STIFFNESS @ flows[rows].T
                matrix = normals[rows] @ step
                if np.linalg.cond(matrix) > 1e10:
                    continue
                multipliers = np.linalg.solve(matrix, normals[rows] @ trial.T - offsets[rows][:, None]).T
                stress = trial - multipliers @ step.T
            admissible = (stress @ normals.T - offsets <= 1e-10 * scale).all(axis=1)
            found = open_ & admissible & (multipliers >= -1e-10 * scale / YOUNG).all(axis=1)
            result[found], count[found] = stress[found], number
            open_ &= ~found
    assert not open_.any()
    return result, count


def random_trials(number=4000):
    generator = np.random.default_rng(7)
    pressures = generator.choice([-40e3, -8e3, 0.0, 10e3], (number, 1))
    shares = generator.normal(size=(number, 4)) * generator.choice([1e3, 8e3, 40e3], (number, 1))
    shares[:, :3] += pressures
    # On the edges and at the apexes exactly: equal principal stresses, no shear.
    shares[:40, 3] = 0.0
    shares[:20, 1] = shares[:20, 0]
    shares[:10, 2] = shares[:10, 0]
    return shares


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
def test_agrees_with_the_slow_solver(mapped, material):
    trial = random_trials()
    expected, count = solved(material, principal(trial))
    result = mapped(material, trial)
    # Both round in the last digits of the largest trial stress, amplified by the edges' systems of equations.
    np.testing.assert_allclose(principal(result.stress), expected, atol=1e-9 * np.abs(trial).max())
    # Every kind of region was met: inside, one plane, an edge, a corner.
    assert set(count) == {0, 1, 2, 3}


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
def test_lands_on_or_inside_the_yield_surface(mapped, material):
    trial = random_trials()
    normals, offsets, _ = planes(material)
    violation = (principal(mapped(material, trial).stress) @ normals.T - offsets).max(axis=1)
    assert (violation / (np.abs(trial).max(axis=1) + offsets[6])).max() < 1e-9


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
def test_a_stress_inside_stays_and_principal_directions_are_kept(mapped, material):
    trial = random_trials()
    normals, offsets, _ = planes(material)
    result = mapped(material, trial).stress
    inside = (principal(trial) @ normals.T - offsets < 0.0).all(axis=1)
    assert inside.sum() > 20
    np.testing.assert_allclose(result[inside], trial[inside], rtol=1e-12, atol=1e-12 * np.abs(trial).max())
    # Coaxial: (xx - yy) : xy is that of the trial stress.
    twist = (result[:, 0] - result[:, 1]) * trial[:, 3] - result[:, 3] * (trial[:, 0] - trial[:, 1])
    assert np.abs(twist).max() < 1e-12 * np.abs(trial).max() ** 2


def test_associated_flow_is_the_nearest_stress_in_elastic_energy(mapped):
    material = MATERIALS["cohesive with cut-off, associated"]
    trial = random_trials()[40:80]
    normals, offsets, _ = planes(material)
    compliance = np.linalg.inv(STIFFNESS) * YOUNG
    result = principal(mapped(material, trial).stress)
    unit = 1e4
    for start, found in zip(principal(trial) / unit, result / unit, strict=True):
        nearest = minimize(
            lambda s, start=start: 0.5 * (s - start) @ compliance @ (s - start),
            np.full(3, -1.0),
            jac=lambda s, start=start: compliance @ (s - start),
            constraints={"type": "ineq", "fun": lambda s: offsets / unit - normals @ s, "jac": lambda _: -normals},
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 200},
        )
        # The minimiser's own accuracy: the square root of its tolerance on the energy.
        np.testing.assert_allclose(found, nearest.x, atol=1e-5 * max(1.0, np.abs(start).max()))


def test_opening_is_the_volume_strain_of_the_cut_off_alone(mapped):
    """Pulled apart evenly, all of the strain beyond the cut-off opens; sheared at no dilatancy, none does."""
    material = (20.0, 0.0, 0.0, 0.0)
    pulled = mapped(material, np.array([[3e3, 3e3, 3e3, 0.0]]))
    np.testing.assert_allclose(pulled.stress, 0.0, atol=1e-9)
    assert pulled.opening[0] == pytest.approx(3e3 / (LAME + 2.0 / 3.0 * SHEAR), rel=1e-12)
    sheared = mapped(material, np.array([[-10e3, -10e3, -10e3, 8e3]]))
    assert sheared.opening[0] == 0.0
    assert sheared.stress[0, :3].sum() == pytest.approx(-30e3, rel=1e-12)
