"""The laws' way back against slow solvers, and that neither viscosity nor yield stress costs time steps."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from scipy.optimize import brentq

from warp_mpm import ScenarioError, Simulation
from warp_mpm.caveats import scene_caveats
from warp_mpm.effect_rules import derive_effects, with_law
from warp_mpm.effects import Effects
from warp_mpm.kernels.elementary import make_elementary
from warp_mpm.kernels.layout import layout
from warp_mpm.simulator.laws.law import all_functions
from warp_mpm.simulator.laws.mu_i import VISCOUS_SHARE, MuI
from warp_mpm.simulator.laws.radial import mean_and_shear
from warp_mpm.time_step import step_limits

MUD = {"yield_stress_Pa": 300.0, "consistency_Pa_s": 50.0}
MIXED = {"friction_angle_deg": 20.0, "mixture_viscosity_Pa_s": 100.0}
GRAINS = {"static_friction": 0.38, "dynamic_friction": 0.64, "grain_diameter_m": 0.01}
TIME_STEP = 1e-3


@pytest.fixture(scope="module")
def element():
    """Function of a scene that gives its law's functions: `back` of trial stresses [N, 4], `drive` along a path."""

    def build(scenario):
        effects, material = derive_effects(scenario), scenario.flow.material
        types = layout(effects)
        V4, F, Points, Parameters = types.V4, types.scalar, types.Points, types.Parameters
        functions = all_functions(effects.skeleton, types, make_elementary(types))
        trial, back = functions["trial"], functions["back"]
        parameters = Parameters()
        elastic = {
            "lame": material.lame_modulus,
            "shear_modulus": material.shear_modulus,
            "bulk_modulus": material.bulk_modulus,
        }
        for name, value in (effects.skeleton.numbers(material) | elastic).items():
            setattr(parameters, name, value)

        @wp.kernel(module="unique", enable_backward=False)
        def bring_back(
            points: Points,
            stress: wp.array(dtype=V4),
            gradient: wp.array(dtype=V4),
            steps: wp.int32,
            time_step: F,
            parameters: Parameters,
            gap: wp.array(dtype=F),
        ):
            p = wp.tid()
            s = stress[p]
            g = gradient[p]
            opened = F(0.0)
            for _step in range(wp.max(steps, 1)):
                if steps > 0:
                    s, _ = trial(points, p, s, g, (g[0] + g[3]) * time_step, time_step, parameters)
                s, opening = back(points, p, s, g, F(1.0), time_step, parameters)
                opened += opening
            stress[p] = s
            gap[p] = opened

        def run(stress, gradient=None, steps=0, time_step=TIME_STEP):
            stress = np.atleast_2d(np.asarray(stress, dtype=float))
            rates = np.zeros_like(stress) if gradient is None else np.tile(gradient, (len(stress), 1))
            state, path = (wp.array(each, dtype=V4, device="cpu") for each in (stress, rates))
            gap = wp.zeros(len(stress), dtype=F, device="cpu")
            wp.launch(bring_back, len(stress), [Points(), state, path, steps, time_step, parameters, gap], device="cpu")
            return SimpleNamespace(stress=state.numpy().astype(float), opening=gap.numpy())

        return SimpleNamespace(back=run, material=material)

    return build


def scene(load_scene, law, name="case_1_dry", **own):
    base = load_scene(name)
    return base.replaced(with_law(base, law, **own))


def trials(number=300, scale=3e4):
    generator = np.random.default_rng(11)
    stress = generator.normal(size=(number, 4)) * scale * 10.0 ** generator.uniform(-3.0, 1.0, (number, 1))
    stress[:, :3] -= 10.0 ** generator.uniform(0.0, 5.0, (number, 1))
    stress[:3] = [[0.0, 0.0, 0.0, 0.0], [-1e4, -1e4, -1e4, 0.0], [2e3, 2e3, 2e3, 0.0]]
    return stress


def assert_radial(trial, stress):
    """The deviator keeps its direction."""
    parts = []
    for each in (trial, stress):
        mean, shear = mean_and_shear(each)
        parts.append((each - mean[:, None] * [1.0, 1.0, 1.0, 0.0], shear))
    (before, size), (after, left) = parts
    np.testing.assert_allclose(after, before * (left / np.maximum(size, 1e-30))[:, None], atol=1e-9 * size.max())


def flowing_stress(solve, trial_shear, static, viscous, stiffness):
    """Shear stress by bisection: static + viscous(rate) = trial - stiffness rate."""
    result = np.minimum(trial_shear, static)
    for number in np.flatnonzero(trial_shear > static):
        excess = trial_shear[number] - static[number]
        most = excess / stiffness * (1.0 + 1e-12)
        rate = solve(
            lambda x, n=number, e=excess: viscous(x, n) + stiffness * x - e, 0.0, most, xtol=1e-300, rtol=1e-14
        )
        result[number] = trial_shear[number] - stiffness * rate
    return result


@pytest.mark.parametrize("exponent", [0.2, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("consistency", [0.0, 1e-3, 50.0, 1e6])
def test_herschel_bulkley_agrees_with_bisection(load_scene, element, exponent, consistency):
    own = {"yield_stress_Pa": 2e3, "consistency_Pa_s": consistency, "flow_exponent": exponent}
    mud = element(scene(load_scene, "herschel_bulkley", **own))
    trial = trials()
    result = mud.back(trial)
    mean, shear = mean_and_shear(trial)
    found_mean, found = mean_and_shear(result.stress)
    assert_radial(trial, result.stress)
    np.testing.assert_allclose(found_mean, np.minimum(mean, 0.0), atol=1e-9)
    np.testing.assert_allclose(result.opening, np.maximum(mean, 0.0) / mud.material.bulk_modulus, atol=1e-15)
    stiffness = mud.material.shear_modulus * TIME_STEP
    static = np.full(len(trial), 2e3)
    expected = flowing_stress(brentq, shear, static, lambda x, _: consistency * x**exponent, stiffness)
    assert 0.2 < np.mean(shear > static) < 0.9
    # What two of Halley's steps leave at an exponent of 0.2; Bingham's and 0.5 are far closer.
    np.testing.assert_allclose(found, expected, rtol=1e-7 if exponent < 0.5 else 1e-11, atol=1e-9)


def test_bingham_is_the_closed_form(load_scene, element):
    mud = element(scene(load_scene, "herschel_bulkley", **MUD))
    trial = trials()
    _, shear = mean_and_shear(trial)
    stiffness = mud.material.shear_modulus * TIME_STEP
    rate = np.maximum(shear - 300.0, 0.0) / (50.0 + stiffness)
    _, found = mean_and_shear(mud.back(trial).stress)
    np.testing.assert_allclose(found, np.minimum(shear, 300.0) + 50.0 * rate, rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("viscosity", [0.0, 100.0, 1e6])
@pytest.mark.parametrize("dilatancy", [0.0, 10.0])
def test_coulomb_viscous_agrees_with_its_equations(load_scene, element, viscosity, dilatancy):
    own = {"friction_angle_deg": 25.0, "cohesion_Pa": 2e3, "tension_cutoff_Pa": 1e3, "dilatancy_angle_deg": dilatancy}
    law = element(scene(load_scene, "coulomb_viscous", mixture_viscosity_Pa_s=viscosity, **own))
    trial = trials()
    result = law.back(trial)
    mean, shear = mean_and_shear(trial)
    borne, found = mean_and_shear(result.stress)
    assert_radial(trial, result.stress)
    material, angle = law.material, math.radians(25.0)
    rate = (shear - found) / (material.shear_modulus * TIME_STEP)
    flows = rate > 1e-9
    assert 0.2 < flows.mean() < 0.95
    dilated = mean - material.bulk_modulus * math.sin(math.radians(dilatancy)) * rate * TIME_STEP
    cut = borne > 1e3 - 1e-6
    assert 0.02 < cut.mean() < 0.5
    np.testing.assert_allclose(borne[~cut], dilated[~cut], rtol=1e-9, atol=1e-6)
    if dilatancy == 0.0:
        np.testing.assert_allclose(result.opening[cut], (mean[cut] - 1e3) / material.bulk_modulus, atol=1e-12)
    assert (result.opening[cut] >= 0.0).all()
    assert (result.opening[~cut] == 0.0).all()
    strength = 2e3 * math.cos(angle) - math.sin(angle) * borne + viscosity * rate
    np.testing.assert_allclose(found[flows], strength[flows], rtol=1e-9, atol=1e-6)
    assert (found[~flows] <= strength[~flows] * (1.0 + 1e-12)).all()


def test_without_viscosity_the_cone_is_mohr_coulomb_in_plane_flow(load_scene, element):
    """Sheared far at constant volume, with the same start: the same stress, by another surface."""
    start = [-2e4, -2e4, -2e4, 0.0]
    stresses = []
    for law, own in (("mohr_coulomb", {}), ("coulomb_viscous", {"mixture_viscosity_Pa_s": 0.0})):
        driven = element(scene(load_scene, law, friction_angle_deg=20.0, **own))
        stresses.append(driven.back(start, gradient=[0.0, 1.0, 0.0, 0.0], steps=500).stress)
    np.testing.assert_allclose(stresses[1], stresses[0], atol=1e-8 * 2e4)
    assert stresses[0][0, 3] > 0.9 * 2e4 * math.sin(math.radians(20.0))


def test_viscosity_adds_its_stress_to_friction(load_scene, element):
    """Simple shear at 5 1/s of 20 kPa, 1000 Pa s, to the steady state."""
    law = element(scene(load_scene, "coulomb_viscous", friction_angle_deg=20.0, mixture_viscosity_Pa_s=1e3))
    result = law.back([-2e4, -2e4, -2e4, 0.0], gradient=[0.0, 5.0, 0.0, 0.0], steps=2000)
    _, shear = mean_and_shear(result.stress)
    assert shear[0] == pytest.approx(2e4 * math.sin(math.radians(20.0)) + 5e3, rel=1e-3)


@pytest.mark.parametrize("inertial_constant", [0.0, 0.279, 50.0])
@pytest.mark.parametrize(
    ("name", "viscosity"), [("case_1_dry", None), ("case_1", None), ("case_1_undrained", 1.0), ("case_1", 1e6)]
)
def test_mu_i_agrees_with_bisection(load_scene, element, name, viscosity, inertial_constant):
    own = GRAINS | {"inertial_constant": inertial_constant, "fluid_viscosity_Pa_s": viscosity}
    sand = element(scene(load_scene, "mu_i", name, **own))
    trial = trials()
    result = sand.back(trial)
    mean, shear = mean_and_shear(trial)
    found_mean, found = mean_and_shear(result.stress)
    assert_radial(trial, result.stress)
    np.testing.assert_allclose(found_mean, np.minimum(mean, 0.0), atol=1e-9)
    pressure, material = np.maximum(-mean, 0.0), sand.material

    def friction(rate, number):
        """Beyond the static one [Pa], from the numbers as they are published."""
        p = pressure[number]
        if p <= 0.0 or rate == 0.0:
            return 0.0
        inertial = rate * 0.01 * math.sqrt(2600.0 / p)
        viscous = MuI().fluid_viscosity(material) * rate / p
        number = math.sqrt(inertial**2 + viscous / VISCOUS_SHARE)
        return 0.26 * p * number / (number + inertial_constant)

    static = 0.38 * pressure
    stiffness = material.shear_modulus * TIME_STEP
    if inertial_constant == 0.0:  # the friction jumps at a rate of nil: static up to the dynamic one
        expected = np.minimum(shear, static + 0.26 * pressure)
    else:
        expected = flowing_stress(brentq, shear, static, friction, stiffness)
    assert 0.2 < np.mean(shear > static) < 0.95
    # Where next to no rate brings the friction up, as in 1e6 Pa s, the steps end sooner.
    np.testing.assert_allclose(found, expected, rtol=1e-6 if viscosity == 1e6 else 1e-9, atol=1e-12 * shear.max())


def test_viscosity_of_the_liquid_counts_where_the_liquid_rules(load_scene, element):
    """Grains of 0.1 mm in honey are in the viscous regime, those of 10 mm in air in the inertial one."""
    rate, pressure = 10.0, 2e4
    start = [-pressure, -pressure, -pressure, 0.0]
    for name, own in (("case_1_undrained", {"fluid_viscosity_Pa_s": 10.0}), ("case_1_dry", {})):
        diameter = 1e-4 if own else 0.01
        sand = element(scene(load_scene, "mu_i", name, **GRAINS | own | {"grain_diameter_m": diameter}))
        result = sand.back(start, gradient=[0.0, rate, 0.0, 0.0], steps=2000)
        mean, shear = mean_and_shear(result.stress)
        inertial = rate * diameter * math.sqrt(2600.0 / pressure)
        viscous = own.get("fluid_viscosity_Pa_s", 0.0) * rate / pressure
        number = math.sqrt(inertial**2 + viscous / VISCOUS_SHARE)
        assert shear[0] / -mean[0] == pytest.approx(0.38 + 0.26 * number / (number + 0.279), rel=2e-3)


LAWS = {"herschel_bulkley": MUD, "coulomb_viscous": MIXED, "mu_i": GRAINS}


@pytest.mark.parametrize("law", LAWS)
def test_single_precision_is_near(load_scene, element, law):
    trial = trials()
    results = [
        element(scene(load_scene, law, **LAWS[law]).replaced({"numerics.precision": precision})).back(trial).stress
        for precision in ("float64", "float32")
    ]
    np.testing.assert_allclose(results[1], results[0], atol=2e-6 * np.abs(trial).max())


@pytest.mark.parametrize("name", ["case_1", "case_1_dry"])
@pytest.mark.parametrize("law", LAWS)
def test_no_viscosity_bounds_the_time_step(load_scene, name, law):
    stiff = {
        "herschel_bulkley": {"yield_stress_Pa": 1e6, "consistency_Pa_s": 1e6},
        "coulomb_viscous": {"mixture_viscosity_Pa_s": 1e6},
        "mu_i": {"inertial_constant": 0.0},
    }[law]
    limits = step_limits(load_scene(name))
    for own in (LAWS[law], LAWS[law] | stiff):
        assert step_limits(scene(load_scene, law, name, **own)) == limits


# One law's run by default: the limits above are asked of each.
@pytest.mark.parametrize("law", [law if law == "mu_i" else pytest.param(law, marks=pytest.mark.slow) for law in LAWS])
def test_a_run_with_an_extreme_viscosity_takes_the_steps_of_one_without(load_scene, law):
    coarse = {"numerics.spacing_m": 0.5, "output.end_time_s": 0.5}
    # Each in the formulation in which a shipped scene has it, so that its kernels are compiled once.
    name = {"herschel_bulkley": "case_1_undrained", "coulomb_viscous": "case_1", "mu_i": "case_1_dry"}[law]
    fastest = {"herschel_bulkley": {"consistency_Pa_s": 1e6}, "coulomb_viscous": {"mixture_viscosity_Pa_s": 1e6}}
    base = load_scene(name, **coarse)
    longest = []
    for scenario in (base, base.replaced(with_law(base, law, **LAWS[law] | fastest.get(law, {})))):
        simulation = Simulation(scenario)
        simulation.advance(until=0.01)
        longest.append(simulation.record["time_step_max"])
        simulation.advance(until=0.5)
        assert np.isfinite(simulation.points()["position"]).all()
        assert simulation.record["steps_limited_by_law"] == 0
        assert "yielding" not in simulation.launched_kernels
    assert longest[1] == pytest.approx(longest[0], rel=1e-3)


@pytest.mark.parametrize(
    ("law", "own", "words"),
    [
        ("herschel_bulkley", {"consistency_Pa_s": -1.0}, "consistency_Pa_s = -1.0 is not allowed"),
        ("herschel_bulkley", {"flow_exponent": 0.1}, "flow_exponent = 0.1 is not allowed"),
        ("coulomb_viscous", {"dilatancy_angle_deg": 30.0}, "must not exceed friction_angle_deg = 20"),
        ("mu_i", {"dynamic_friction": 0.3}, "dynamic_friction = 0.3 must be at least static_friction = 0.38"),
        ("mu_i", {"grain_diameter_m": 0.0}, "grain_diameter_m = 0.0 is not allowed"),
    ],
)
def test_fields_are_checked(load_scene, law, own, words):
    with pytest.raises(ScenarioError, match=words):
        scene(load_scene, law, **LAWS[law] | own)


@pytest.mark.parametrize("law", LAWS)
def test_the_laws_own_lateral_stress_is_within_what_it_allows(load_scene, law):
    scenario = scene(load_scene, law, **LAWS[law]).replaced({"flow.lateral_stress_coefficient": None})
    assert not any("yield surface" in sentence for sentence in scene_caveats(scenario))
    beyond = scenario.replaced({"flow.lateral_stress_coefficient": 3.0})
    assert any("yield surface" in sentence for sentence in scene_caveats(beyond))


def test_a_viscous_stress_that_comes_too_late_is_told(load_scene):
    for law, field in (("herschel_bulkley", "consistency_Pa_s"), ("coulomb_viscous", "mixture_viscosity_Pa_s")):
        late, soon = (scene(load_scene, law, **LAWS[law] | {field: value}) for value in (1e6, 1e3))
        assert any(f"{field} = 1e+06: the viscous stress takes 1.2 s" in sentence for sentence in scene_caveats(late))
        assert not any("viscous stress takes" in sentence for sentence in scene_caveats(soon))


def test_logarithm_and_exponential_are_those_of_the_library():
    types = layout(Effects("dry"))
    tools = make_elementary(types)
    logarithm, exponential = tools.logarithm, tools.exponential

    @wp.kernel(module="unique", enable_backward=False)
    def both(x: wp.array(dtype=wp.float64), a: wp.array(dtype=wp.float64), b: wp.array(dtype=wp.float64)):
        i = wp.tid()
        a[i] = logarithm(x[i])
        b[i] = exponential(x[i])

    x = np.concatenate([np.geomspace(1e-300, 1e300, 5001), np.linspace(0.5, 2.0, 5001), [1.0, math.sqrt(2.0)]])
    y = np.linspace(-690.0, 690.0, 5001)
    for values, exact, out in ((x, np.log(x), 0), (y, np.exp(y), 1)):
        found = [wp.zeros(len(values), dtype=wp.float64, device="cpu") for _ in range(2)]
        wp.launch(both, len(values), [wp.array(values, dtype=wp.float64, device="cpu"), *found], device="cpu")
        np.testing.assert_allclose(found[out].numpy(), exact, rtol=1e-15, atol=1e-16)
