"""Dilatancy at a point: its pressure against a slow solver, its paths against the ODE, and what a scene may ask."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from warp_mpm import ScenarioError, Simulation
from warp_mpm.effect_rules import derive_effects, effect_rules, with_law
from warp_mpm.kernels.elementary import make_elementary
from warp_mpm.kernels.layout import layout
from warp_mpm.scenario import Scenario
from warp_mpm.simulator.laws import LAWS, dilatancy
from warp_mpm.simulator.laws.law import all_functions

TIME_STEP, RATE, PRESSURE = 1e-4, 10.0, 5e3
GRAINS = {"static_friction": 0.35, "dynamic_friction": 0.7, "grain_diameter_m": 0.05}
OWN = {"critical_solid_fraction": 0.56, "coefficient": 1.5, "grain_diameter_m": 2e-3}


def scene(load_scene, *, law="mohr_coulomb", own=OWN, **material):
    """Case 1 with dilatancy; coefficient None is none."""
    base = load_scene("case_1")
    if law == "mu_i":
        base = base.replaced(with_law(base, law, **GRAINS))
    elif law != "mohr_coulomb":
        base = base.replaced(with_law(base, law, friction_angle_deg=20.0, mixture_viscosity_Pa_s=30.0))
    changes = {f"flow.material.{name}": value for name, value in material.items()}
    return base.replaced(changes | {"flow.material.dilatancy": own})


@pytest.fixture(scope="module")
def element():
    """Function of scenes with the same effects that gives `back` of one step, and `shear` along a path of many."""
    built = {}

    def functions_for(effects):
        if effects not in built:
            types = layout(effects)
            V4, F, Points, Parameters = types.V4, types.scalar, types.Points, types.Parameters
            functions = all_functions(effects.skeleton, types, make_elementary(types))
            trial, back, volume_ratio = functions["trial"], functions["back"], functions["volume_ratio"]

            @wp.kernel(module="unique", enable_backward=False)
            def walk(
                points: Points,
                stress: wp.array(dtype=V4),
                volume: wp.array(dtype=F),
                gradient: V4,
                steps: wp.int32,
                drained: wp.int32,
                time_step: F,
                parameters: Parameters,
            ):
                """`steps` = 0: the way back alone. Drained: the volume gives way so that the pressure stays."""
                p = wp.tid()
                s = stress[p]
                v = volume[p]
                start = s[0] + s[1]
                for _step in range(wp.max(steps, 1)):
                    if steps > 0:
                        strain = F(0.0)
                        if drained == 1:
                            strain = F(0.5) * (start - s[0] - s[1]) / (parameters.lame + parameters.shear_modulus)
                        s, _ = trial(points, p, s, gradient, strain, time_step, parameters)
                        v *= volume_ratio(strain)
                    s, _opened = back(points, p, s, gradient, v, time_step, parameters)
                stress[p] = s
                volume[p] = v

            built[effects] = (walk, types)
        return built[effects]

    def build(scenario):
        effects, material = derive_effects(scenario), scenario.flow.material
        walk, types = functions_for(effects)
        parameters = types.Parameters()
        values = {
            "lame": material.lame_modulus,
            "shear_modulus": material.shear_modulus,
            "bulk_modulus": material.bulk_modulus,
            "grain_share": 1.0 - material.porosity,
        } | effects.skeleton.numbers(material)
        if effects.dilatancy:
            values |= dilatancy.numbers(material, effects.skeleton)
        for name, value in values.items():
            setattr(parameters, name, value)

        def run(stress, solid_fraction, *, rate=RATE, steps=0, drained=False, time_step=TIME_STEP):
            stress = np.atleast_2d(np.asarray(stress, dtype=float))
            fraction = np.broadcast_to(solid_fraction, len(stress))
            points = types.Points()
            points.reference_volume = wp.array(np.ones(len(stress)), dtype=types.scalar, device="cpu")
            state = wp.array(stress, dtype=types.V4, device="cpu")
            volume = wp.array((1.0 - material.porosity) / fraction, dtype=types.scalar, device="cpu")
            path = types.V4(0.5 * rate, 0.0, 0.0, -0.5 * rate)
            inputs = [points, state, volume, path, steps, int(drained), time_step, parameters]
            wp.launch(walk, len(stress), inputs, device="cpu")
            return state.numpy(), (1.0 - material.porosity) / volume.numpy()

        return SimpleNamespace(run=run, material=material)

    return build


def tangent(material, m, pressure, rate=RATE):
    """tan ψ [-], by the published closure and its bound."""
    own = material.dilatancy
    viscous = dilatancy.fluid_viscosity(material) * rate
    inertia = material.grain_density_kg_per_m3 * (rate * own.grain_diameter_m) ** 2
    state = viscous / max(inertia + max(pressure, 0.0), 1e-30)
    found = own.coefficient * (m - own.critical_solid_fraction / (1.0 + math.sqrt(state)))
    return min(max(found, -1.0), 1.0)


def friction(material, m, pressure, rate=RATE):
    """Sine of φ + ψ, of no angle below none."""
    angle = math.radians(material.friction_angle_deg) + math.atan(tangent(material, m, pressure, rate))
    return min(max(math.sin(angle), 0.0), 0.999)


def in_plane(stress):
    """Mean pressure and half the difference of the extreme principal stresses, of diagonal stresses [N, 4]."""
    first, last = stress[:, :3].max(axis=1), stress[:, :3].min(axis=1)
    return -0.5 * (first + last), 0.5 * (first - last)


@pytest.mark.parametrize("law", ["mohr_coulomb", "coulomb_viscous"])
@pytest.mark.parametrize("viscosity", [1e-3, 10.0])
def test_the_pressure_after_a_step_is_the_one_that_a_slow_solver_finds(load_scene, element, law, viscosity):
    """p = p_trial + K tan ψ(p) Γ, Γ = (τ - sin(φ + ψ(p)) p) / (G + η/Δt), on trials from a pascal to 100 kPa, loose to
    dense, in a thin and a thick liquid."""
    soil = element(scene(load_scene, law=law, liquid_viscosity_Pa_s=viscosity))
    material, generator = soil.material, np.random.default_rng(3)
    number = 200
    pressure = 10.0 ** generator.uniform(0.0, 5.0, number)
    shear = pressure * generator.uniform(0.2, 1.2, number)
    fraction = generator.uniform(0.35, 0.75, number)
    # The intermediate principal stress is the mean, so that both laws see the same pressure and shear.
    stress = np.stack([shear - pressure, -shear - pressure, -pressure, 0.0 * shear], axis=1)
    found, _ = soil.run(stress, fraction)
    after, left = in_plane(found)
    g, k = material.shear_modulus, material.bulk_modulus
    stiff = g + getattr(material, "mixture_viscosity_Pa_s", 0.0) / TIME_STEP
    for trial, tau, m, p, t in zip(pressure, shear, fraction, after, left, strict=True):

        def gap(x, trial=trial, tau=tau, m=m):
            slip = max(tau - friction(material, m, x) * x, 0.0) / stiff
            return x - trial - k * tangent(material, m, x) * slip

        high = trial + k / stiff * tau
        if gap(0.0) >= 0.0:  # nothing holds it: liquefied, by halves
            assert 0.0 <= p < 0.01 * trial
            continue
        exact = brentq(gap, 0.0, high, xtol=1e-12, rtol=1e-14)
        assert p == pytest.approx(exact, rel=1e-6, abs=1e-4)
        slip = max(tau - friction(material, m, p) * p, 0.0) / stiff
        assert t == pytest.approx(tau - g * slip, rel=1e-6, abs=1e-4)


@pytest.mark.parametrize(("fraction", "falls"), [(0.50, True), (0.53, True), (0.60, False), (0.66, False)])
def test_sheared_at_its_volume_a_loose_soil_loses_its_pressure_and_a_dense_one_gains_it(
    load_scene, element, fraction, falls
):
    """dp/dγ = K tan ψ / (1 + (K/G) tan ψ d(p sin(φ + ψ))/dp), from the yield surface on."""
    soil = element(scene(load_scene, liquid_viscosity_Pa_s=0.1))
    material = soil.material
    g, k = material.shear_modulus, material.bulk_modulus
    steps, strain = 2000, 0.02

    def slope(_, state):
        p = max(state[0], 0.0)
        step = 1e-4 * p + 1e-6
        bearing = (
            (p + step) * friction(material, fraction, p + step) - (p - step) * friction(material, fraction, p - step)
        ) / (2.0 * step)
        psi = tangent(material, fraction, p)
        return [k * psi / (1.0 + k / g * psi * bearing)]

    exact = solve_ivp(slope, (0.0, strain), [PRESSURE], rtol=1e-9, atol=1e-9).y[0, -1]
    bears = PRESSURE * friction(material, fraction, PRESSURE)
    start = [bears - PRESSURE, -bears - PRESSURE, -PRESSURE, 0.0]
    found, _ = soil.run(start, fraction, steps=steps, time_step=strain / RATE / steps)
    pressure, _shear = in_plane(found)
    assert bool(pressure[0] < PRESSURE) is falls
    # First order in the step.
    assert pressure[0] == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("fraction", [0.46, 0.53, 0.60, 0.66])
@pytest.mark.parametrize("viscosity", [0.1, 20.0])
def test_friction_that_grows_with_the_rate_dilates_too(load_scene, element, fraction, viscosity):
    """dp/dt = K tan ψ γ̇_p, dτ/dt = G (γ̇ - γ̇_p), where γ̇_p is such that τ = p (μ(γ̇_p, p) + tan ψ)."""
    soil = element(scene(load_scene, law="mu_i", fluid_viscosity_Pa_s=viscosity))
    material = soil.material
    assert dilatancy.fluid_viscosity(material) == viscosity  # μ and m_eq go by one viscous number
    g, k = material.shear_modulus, material.bulk_modulus

    def ratio(rate, p):
        inertia = material.grain_density_kg_per_m3 * (rate * material.grain_diameter_m) ** 2 / p
        number = math.sqrt(inertia + viscosity * rate / (0.635 * p))
        mu = 0.35 + 0.35 * number / (number + material.inertial_constant)
        return max(mu + tangent(material, fraction, p), 0.0)

    def slope(_, state):
        p, tau = max(state[0], 1e-3), state[1]
        slip = 0.0
        if tau > ratio(0.0, p) * p:
            slip = brentq(lambda rate: ratio(rate, p) * p - tau, 0.0, 1e5) if tau < ratio(1e5, p) * p else 1e5
        return [k * tangent(material, fraction, p) * slip, g * (RATE - slip)]

    steps, strain = 4000, 0.01
    bears = PRESSURE * ratio(RATE, PRESSURE)
    exact = solve_ivp(slope, (0.0, strain / RATE), [PRESSURE, bears], method="LSODA", rtol=1e-8, atol=1e-6).y[:, -1]
    start = [bears - PRESSURE, -bears - PRESSURE, -PRESSURE, 0.0]
    found, _ = soil.run(start, fraction, steps=steps, time_step=strain / RATE / steps)
    pressure, shear = in_plane(found)
    assert abs(exact[0] - PRESSURE) > 0.01 * PRESSURE
    # First order in the step.
    np.testing.assert_allclose([pressure[0], shear[0]], exact, rtol=5e-3, atol=1.0)


@pytest.mark.parametrize("fraction", [0.48, 0.64])
def test_drained_it_goes_to_the_critical_solid_fraction(load_scene, element, fraction):
    """dm/dγ = -c m (m - m_crit) has m_crit / (1 - (1 - m_crit/m_0) e^(-c m_crit γ)); without viscosity."""
    soil = element(scene(load_scene, liquid_viscosity_Pa_s=1e-12))
    critical, coefficient = OWN["critical_solid_fraction"], OWN["coefficient"]
    bears = PRESSURE * friction(soil.material, fraction, PRESSURE)
    start = [bears - PRESSURE, -bears - PRESSURE, -PRESSURE, 0.0]
    for strain, steps in ((0.5, 5000), (8.0, 80_000)):
        _, m = soil.run(start, fraction, steps=steps, drained=True, time_step=strain / RATE / steps)
        exact = critical / (1.0 - (1.0 - critical / fraction) * math.exp(-coefficient * critical * strain))
        # Of the start: the elastic strain of the way to the edge where σ_zz yields too, and the step.
        assert m[0] - critical == pytest.approx(exact - critical, abs=0.01 * abs(fraction - critical))


def test_without_a_coefficient_it_is_the_law_alone(load_scene, element):
    generator = np.random.default_rng(5)
    stress = generator.normal(0.0, 2e4, (300, 4)) - [1e4, 1e4, 1e4, 0.0]
    for law in ("mohr_coulomb", "coulomb_viscous", "mu_i"):
        plain, none = (
            element(scene(load_scene, law=law, own=own)).run(stress, 0.5)[0] for own in (None, OWN | {"coefficient": 0})
        )
        np.testing.assert_allclose(none, plain, rtol=0.0, atol=1e-13 * np.abs(stress).max())


def test_a_scene_without_it_has_nothing_of_it(load_scene):
    coarse = {"numerics.spacing_m": 1.0, "output.end_time_s": 0.1}
    plain = Simulation(load_scene("case_1", **coarse))
    assert not set(dilatancy.CONSTANTS) & set(plain._types.Parameters.vars)
    assert "dilatancy" not in plain.effects.module_name
    (rule,) = [rule for rule in effect_rules(scene(load_scene)) if rule.effect == "dilatancy"]
    assert rule.on
    assert not derive_effects(scene(load_scene).replaced(rule.switched)).dilatancy


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"own": OWN | {"critical_solid_fraction": 1.2}}, "critical_solid_fraction = 1.2 is not allowed"),
        ({"own": OWN | {"coefficient": -1.0}}, "coefficient = -1.0 is not allowed"),
        ({"own": {"coefficient": 1.0}}, "critical_solid_fraction is missing"),
        ({"dilatancy_angle_deg": 5.0}, "dilatancy_angle_deg = 5 is not allowed with dilatancy"),
    ],
)
def test_its_fields_are_checked(load_scene, changes, words):
    with pytest.raises(ScenarioError, match=words):
        scene(load_scene, **changes)


def test_laws_that_know_no_density_refuse_it(load_scene):
    content = load_scene("case_1_mud").resolved()
    content["flow"]["material"]["dilatancy"] = OWN
    with pytest.raises(
        ScenarioError, match='dilatancy is not allowed with the law "herschel_bulkley"; it must be null'
    ):
        Scenario.model_validate(content)
    assert scene(load_scene).replaced(with_law(scene(load_scene), "elastic")).flow.material.dilatancy is None


# -- in a flow -------------------------------------------------------------------------------------------------------


def body_on_level_ground(*, scale=1.0, side=1.0, fraction=0.50, coefficient=1.0, speed=4.0, own=True, end=0.4):
    """A body of 6 m by 2 m that slides on a rough level bed, toward +x, or toward -x with a side of -1. By Froude's law
    lengths and stresses as `scale`, times and speeds as its root."""
    root = math.sqrt(scale)
    length, height = 6.0 * scale, 2.0 * scale
    left = -0.5 * length
    material = {
        "grain_density_kg_per_m3": 2600.0,
        "porosity": 1.0 - fraction,
        "liquid_density_kg_per_m3": 1000.0,
        "liquid_bulk_modulus_Pa": 3e7 * scale,
        "liquid_viscosity_Pa_s": 0.01 * scale * root,
        "young_modulus_Pa": 2e6 * scale,
        "poisson_ratio": 0.25,
        "friction_angle_deg": 30.0,
        "hydraulic_conductivity_m_per_s": 1e-3 * root,
    }
    if own:
        material["dilatancy"] = {
            "critical_solid_fraction": 0.56,
            "coefficient": coefficient,
            "grain_diameter_m": 1e-3 * scale,
        }
    vertices = [[left, 0.0], [left + length, 0.0], [left + length, height], [left, height]]
    return Scenario.model_validate(
        {
            "title": "body on level ground",
            "flow": {
                "formulation": "two_phase",
                "shape": {"kind": "polygon", "vertices_m": vertices},
                "velocity_m_per_s": [side * speed * root, 0.0],
                "material": material,
            },
            "barrier": None,
            "ground": {"friction": 0.5},
            "domain": {"left_m": -8.0 * scale, "right_m": 8.0 * scale, "top_m": 4.0 * scale},
            "numerics": {"spacing_m": 0.5 * scale},
            "output": {"end_time_s": end * root},
        }
    )


def run_of(scenario):
    simulation = Simulation(scenario)
    simulation.advance(scenario.output.end_time_s)
    return simulation.points()


@pytest.mark.parametrize(("mean", "sine"), [(-3e3, math.sin(math.radians(11.0) + math.pi / 4.0)), (6e2, 0.0)])
@pytest.mark.parametrize("law", ["mohr_coulomb", "coulomb_viscous"])
def test_the_most_that_soil_of_any_density_bears(load_scene, law, mean, sine):
    """Pressure makes strength of friction, and the densest soil has most; tension takes it away, and the loosest, which
    has none, bears most."""
    own, other = OWN | {"coefficient": 20.0}, {"mixture_viscosity_Pa_s": 0.0} if law != "mohr_coulomb" else {}
    strength = {"friction_angle_deg": 11.0, "cohesion_Pa": 550.0, "tension_cutoff_Pa": 2500.0}
    material = scene(load_scene, law=law, own=own, **strength, **other).flow.material
    shear = 550.0 * math.cos(math.radians(11.0)) - sine * mean
    stress = np.array([[mean + share * shear, mean - share * shear, mean, 0.0] for share in (0.999, 1.001)])
    within, beyond = LAWS.named(law).yield_excess(material, stress)
    assert within <= 0.0 < beyond


@pytest.mark.slow
class TestFlows:
    def test_a_loose_body_goes_on_where_a_dense_one_stops(self):
        reach = [
            run_of(body_on_level_ground(fraction=fraction, end=1.0))["position"][:, 0].mean()
            for fraction in (0.50, 0.56, 0.62)
        ]
        assert reach[0] - reach[1] > 0.1 * reach[1] < reach[1] - reach[2]

    @pytest.mark.parametrize("fraction", [0.50, 0.62])
    def test_its_mirror_image_does_the_same(self, fraction):
        there, back = (run_of(body_on_level_ground(fraction=fraction, side=side)) for side in (1.0, -1.0))
        # As the points of the one start where those of the other do, mirrored, sums over all of them are alike.
        assert there["position"][:, 0].mean() == pytest.approx(-back["position"][:, 0].mean(), rel=1e-6)
        assert there["position"][:, 1].mean() == pytest.approx(back["position"][:, 1].mean(), rel=1e-6)
        assert there["pore_pressure"].mean() == pytest.approx(back["pore_pressure"].mean(), rel=1e-6)
        assert there["porosity"].mean() == pytest.approx(back["porosity"].mean(), rel=1e-9)

    @pytest.mark.parametrize("fraction", [0.50, 0.62])
    def test_it_obeys_froudes_law(self, fraction):
        small, large = (run_of(body_on_level_ground(fraction=fraction, scale=scale)) for scale in (1.0, 4.0))
        np.testing.assert_allclose(large["position"], 4.0 * small["position"], atol=1e-7)
        np.testing.assert_allclose(large["porosity"], small["porosity"], atol=1e-9)
        np.testing.assert_allclose(
            large["pore_pressure"], 4.0 * small["pore_pressure"], atol=1e-6 * np.abs(large["pore_pressure"]).max()
        )

    def test_without_a_coefficient_it_is_as_without_it(self):
        plain, none = (run_of(body_on_level_ground(own=own, coefficient=0.0)) for own in (False, True))
        np.testing.assert_allclose(none["position"], plain["position"], atol=1e-9)
        np.testing.assert_allclose(none["effective_stress"], plain["effective_stress"], atol=1e-3)

    @pytest.mark.parametrize("fraction", [0.50, 0.62])
    def test_a_layer_at_rest_stays_at_rest(self, fraction):
        scenario = body_on_level_ground(fraction=fraction, speed=0.0).replaced(
            {"domain": {"left_edge": "wall", "right_edge": "wall", "left_m": -3.0, "right_m": 3.0, "top_m": 4.0}}
        )
        points = run_of(scenario)
        assert np.abs(points["solid_velocity"]).max() < 5e-3
        np.testing.assert_allclose(1.0 - points["porosity"], fraction, atol=1e-3)
