"""Laws and transfer schemes that a script brings along, and what the package does with what they declare."""

import importlib.util
import json
import math
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
import warp as wp
from pydantic import Field

from warp_mpm import Scenario, ScenarioError, Simulation, laws, schemes
from warp_mpm.caveats import scene_caveats
from warp_mpm.effect_rules import derive_effects, effect_rules, with_law
from warp_mpm.effects import Effects
from warp_mpm.kernels.build import build_kernels
from warp_mpm.laws import Law, Model, PointField
from warp_mpm.scenario import Numerics, json_schema
from warp_mpm.scenario.scene import offer_anew
from warp_mpm.schemes import Apic, Launch
from warp_mpm.simulator.laws import LAWS
from warp_mpm.simulator.laws.mohr_coulomb import MohrCoulomb
from warp_mpm.simulator.room import content
from warp_mpm.simulator.schemes import SCHEMES
from warp_mpm.simulator.step import launches

DOCS = Path(__file__).parents[2] / "docs" / "develop"


@pytest.fixture(autouse=True)
def only_here():
    """What a test registers is gone after it."""
    kept = [(room, dict(room._by_name), dict(room._keys)) for room in (LAWS, SCHEMES)]
    fields = set(Numerics.model_fields)
    yield
    for room, by_name, keys in kept:
        room._by_name, room._keys = by_name, keys
    for name in set(Numerics.model_fields) - fields:
        del Numerics.model_fields[name], Numerics.__annotations__[name]
    offer_anew()


def script(name):
    """A script of docs/develop, loaded."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Settings(Model):
    viscosity_Pa_s: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0  # noqa: N815
    """Viscosity of the mixture."""


class Damped(MohrCoulomb):
    """Mohr-Coulomb with a viscous stress beside it, integrated explicitly, and the strain it has seen."""

    name = "damped"
    title = "Mohr-Coulomb and a viscosity"
    extra_stress = True
    constants = (*MohrCoulomb.constants, "viscosity")
    point_fields = {  # noqa: RUF012
        "seen": PointField(start=lambda scenario, points: 0.5 + 0.0 * points.volume, meaning="the strain seen"),
    }

    class Settings(Settings, MohrCoulomb.Settings):
        pass

    def numbers(self, material):
        return super().numbers(material) | {"viscosity": material.viscosity_Pa_s}

    def largest_step(self, material, *, spacing, density):
        if material.viscosity_Pa_s == 0.0:
            return math.inf
        return 0.05 * density * spacing**2 / material.viscosity_Pa_s

    def caveats(self, material):
        return ["The mixture is stiff."] if material.viscosity_Pa_s > 1e6 else []

    def functions(self, types, tools):
        F, V4, Points, Parameters = types.scalar, types.V4, types.Points, types.Parameters
        read, write = tools.read, tools.write

        @wp.func
        def extra(points: Points, p: wp.int32, stress: V4, gradient: V4, time_step: F, parameters: Parameters) -> V4:
            write(points.seen, p, read(points.seen, p) + time_step * wp.abs(gradient[1]))
            double = F(2.0) * parameters.viscosity
            shear = parameters.viscosity * (gradient[1] + gradient[2])
            return V4(double * gradient[0], double * gradient[3], F(0.0), shear)

        return super().functions(types, tools) | {"extra": extra}


class Stiff(Damped):
    """The same in a kernel of its own."""

    name = "stiff"
    vectorised = False


class Counting(Apic):
    name = "counting"
    title = "apic, with a count of its steps at each point"
    point_fields = Apic.point_fields | {"count": PointField(meaning="the count")}

    def kernels(self, types, tools, module):
        F, Points = types.scalar, types.Points
        read, write = tools.read, tools.write

        @wp.kernel(module=module)
        def counted(points: Points):
            p = wp.tid()
            write(points.count, p, read(points.count, p) + F(1.0))

        return {"counted": counted}

    def launches(self):
        return (("gather", Launch("counted", "points", ("points",), "counts steps")),)


COARSE = {"numerics.spacing_m": 0.5, "output.end_time_s": 1.0}
GROUND_ALONE = COARSE | {"barrier": None, "ground.friction": 0.3}
"""Kernels of a scene without barrier compile in two thirds of the time."""


def scene(load_scene, law, **own):
    base = load_scene("case_1_dry", **GROUND_ALONE)
    return base.replaced(with_law(base, law, friction_angle_deg=20.0, **own))


def test_a_law_of_a_script_flows_as_theory_says():
    mud = script("viscous_law")
    laws.register(mud.Mud())
    scenario = Scenario.model_validate(mud.SCENE)
    # 16 cells a side; the affine transfer adds a little of its own.
    assert mud.decay_rate(scenario) == pytest.approx(mud.exact_rate(scenario.flow.material.shear_modulus), rel=0.02)


class Newtonian(Law):
    """The stress in shear is beside the one that is remembered, and follows the rate of strain at once."""

    name = "newtonian"
    title = "Newtonian, explicit"
    extra_stress = True
    constants = ("viscosity",)
    Settings = Settings

    def numbers(self, material):
        return {"viscosity": material.viscosity_Pa_s}

    def largest_step(self, material, *, spacing, density):
        return 0.05 * density * spacing**2 / material.viscosity_Pa_s

    def functions(self, types, tools):
        F, V4, Points, Parameters = types.scalar, types.V4, types.Points, types.Parameters

        @wp.func
        def back(
            points: Points, p: wp.int32, stress: V4, gradient: V4, volume: F, time_step: F, parameters: Parameters
        ):
            mean = (stress[0] + stress[1] + stress[2]) / F(3.0)
            return V4(mean, mean, mean, F(0.0)), F(0.0)

        @wp.func
        def extra(points: Points, p: wp.int32, stress: V4, gradient: V4, time_step: F, parameters: Parameters) -> V4:
            double = F(2.0) * parameters.viscosity
            shear = parameters.viscosity * (gradient[1] + gradient[2])
            return V4(double * gradient[0], double * gradient[3], F(0.0), shear)

        return {"back": back, "extra": extra}


@pytest.mark.slow  # kernels of its own; the damped law below has such a stress, too
def test_a_stress_beside_the_remembered_one_acts_and_bounds_the_step():
    mud = script("viscous_law")
    laws.register(Newtonian())
    flow = mud.SCENE["flow"]
    material = flow["material"] | {"law": "newtonian"}
    scenario = Scenario.model_validate(mud.SCENE | {"flow": flow | {"material": material}})
    # The affine transfer adds the more of its own the more steps there are, here 2.1 %.
    assert mud.decay_rate(scenario) == pytest.approx(mud.NEWTONIAN_RATE, rel=0.03)
    limit = 0.95 * 0.05 * mud.DENSITY / 16.0**2 / mud.VISCOSITY
    simulation = Simulation(scenario)
    simulation.advance(until=0.1)
    assert simulation.record["steps_limited_by_law"] >= simulation.steps - 1
    assert simulation.record["time_step_max"] <= limit * (1.0 + 1e-12)


def test_a_scheme_of_a_script_runs():
    blended = script("blended_transfer")
    schemes.register(blended.Blend())
    assert blended.energy_kept("blend", 0.9) > 0.99


@pytest.mark.slow  # kernels of its own
def test_the_scheme_that_the_script_blends_in_keeps_less():
    assert script("blended_transfer").energy_kept("flip", 0.9) < 0.9


def test_fields_of_a_law_are_checked_and_in_the_schema(load_scene):
    base = load_scene("case_1_dry").resolved()
    base["flow"]["material"] |= {"law": "damped", "viscosity_Pa_s": 10.0}
    with pytest.raises(ScenarioError, match=r'law = "damped" is not allowed; it must be one of "mohr_coulomb"'):
        Scenario.model_validate(base)
    laws.register(Damped())
    scenario = Scenario.model_validate(base)
    assert scenario.flow.material.viscosity_Pa_s == 10.0
    assert Scenario.model_validate(scenario.resolved()) == scenario
    assert "viscosity_Pa_s" in json.loads(json_schema())["$defs"]["TwoPhaseMaterialDamped"]["properties"]
    base["flow"]["material"]["viscosity_Pa_s"] = -1.0
    with pytest.raises(ScenarioError, match=r"viscosity_Pa_s = -1.0 is not allowed; it must be a finite number at lea"):
        Scenario.model_validate(base)
    del base["flow"]["material"]["law"]
    with pytest.raises(ScenarioError, match=r'viscosity_Pa_s is not a field .* law is "mohr_coulomb"'):
        Scenario.model_validate(base)
    rule = next(rule for rule in effect_rules(scenario) if rule.effect == "law")
    assert rule.value.startswith("damped-")
    assert rule.reason == "flow.material.law = damped"
    assert scene_caveats(scene(load_scene, "damped", viscosity_Pa_s=2e6))[-1] == "The mixture is stiff."


@pytest.mark.parametrize(("old", "new"), [(False, '"law": "elastic"'), (True, '"law": "mohr_coulomb"')])
def test_the_field_that_the_law_replaced_says_what_to_write(load_scene, old, new):
    data = load_scene("case_1").resolved()
    data["flow"]["material"]["plasticity"] = old
    with pytest.raises(ScenarioError) as refused:
        Scenario.model_validate(data)
    (sentence,) = refused.value.problems
    assert sentence.startswith(f"flow.material: plasticity = {str(old).lower()} is no longer a field")
    assert new in sentence


def test_fields_of_a_scheme_are_checked_and_have_defaults(load_scene):
    blended = script("blended_transfer")
    schemes.register(blended.Blend())
    scenario = load_scene("case_1")
    assert scenario.numerics.blend_rate == 0.2
    with pytest.raises(ScenarioError, match=r"numerics.blend_rate = 11.0 is not allowed"):
        scenario.replaced({"numerics.blend_rate": 11.0})
    without_numerics = {name: group for name, group in scenario.resolved().items() if name != "numerics"}
    assert Scenario.model_validate(without_numerics).numerics.blend_rate == 0.2
    assert "blend_rate" in json.loads(json_schema())["$defs"]["Numerics"]["properties"]


def test_own_fields_begin_as_they_say_and_no_viscosity_is_none(load_scene):
    laws.register(Damped())
    plain, none = (Simulation(each) for each in (load_scene("case_1_dry", **GROUND_ALONE), scene(load_scene, "damped")))
    assert (none.points(["seen"])["seen"] == 0.5).all()
    for simulation in (plain, none):
        simulation.advance(until=0.6)
    positions = [simulation.points()["position"] for simulation in (plain, none)]
    np.testing.assert_allclose(positions[1], positions[0], atol=1e-9)
    assert none.points(["seen"])["seen"].min() > 0.5
    assert none.record["steps_limited_by_law"] == 0
    # With a viscosity its stress acts, and bounds the step.
    viscous = Simulation(scene(load_scene, "damped", viscosity_Pa_s=1e5))
    viscous.advance(until=0.6)
    assert viscous.record["steps_limited_by_law"] >= viscous.steps - 1
    assert np.abs(viscous.points()["position"] - positions[0]).max() > 0.01


def test_a_law_and_a_scheme_may_have_kernels_of_their_own(load_scene):
    """Both in one scene, whose kernels are compiled once."""
    laws.register(Damped())
    laws.register(Stiff())
    schemes.register(Counting())
    simulation = Simulation(scene(load_scene, "stiff").replaced({"numerics.transfer": "counting"}))
    simulation.advance(until=0.02)
    order = simulation.launched_kernels
    assert order.index("counted") == order.index("gather") + 1
    assert (simulation.points(["count"])["count"] == simulation.steps).all()
    assert "yielding" in order
    assert simulation.points(["seen"])["seen"].max() > 0.5
    assert not {"yielding", "counted"} & set(Simulation(scene(load_scene, "damped")).launched_kernels)


@pytest.mark.slow  # two sets of kernels
def test_a_law_in_a_kernel_of_its_own_gives_the_same(load_scene):
    laws.register(Damped())
    laws.register(Stiff())
    runs = [Simulation(scene(load_scene, name, viscosity_Pa_s=1e3)) for name in ("damped", "stiff")]
    for simulation in runs:
        simulation.advance(until=0.6)
    np.testing.assert_allclose(runs[1].points()["position"], runs[0].points()["position"], atol=1e-9)
    np.testing.assert_allclose(runs[1].points(["seen"])["seen"], runs[0].points(["seen"])["seen"], atol=1e-9)


def test_a_field_of_a_law_that_diverges_is_named(load_scene):
    laws.register(Damped())
    simulation = Simulation(scene(load_scene, "damped"))
    simulation._point_arrays["seen"].fill_(math.nan)
    assert "the strain seen of" in simulation._what_diverged()


def make_law(factor):
    class Again(Law):
        name = "again"
        title = "elastic times a factor"

        def functions(self, types, tools):
            F, V4, Points, Parameters = types.scalar, types.V4, types.Points, types.Parameters

            @wp.func
            def back(
                points: Points, p: wp.int32, stress: V4, gradient: V4, volume: F, time_step: F, parameters: Parameters
            ):
                return F(wp.static(factor)) * stress, F(0.0)

            return {"back": back}

    return Again()


def test_two_laws_of_one_name_are_two_modules(load_scene):
    base = load_scene("case_1_dry", **GROUND_ALONE)
    effects = []
    for factor in (1.0, 0.0, 1.0):
        laws.register(make_law(factor))
        effects.append(derive_effects(base.replaced(with_law(base, "again"))))
    modules = [each.module_name for each in effects]
    assert modules[0] == modules[2] != modules[1]
    # The first law is still found by those effects that were made of it, though the name was another's meanwhile.
    first, other = effects[0].skeleton, effects[1].skeleton
    assert content(first) == content(effects[2].skeleton) != content(other)
    assert build_kernels(effects[0]) is build_kernels(effects[2]) is not build_kernels(effects[1])


def test_content_follows_what_a_law_calls_and_not_its_comments():
    def built(body):
        space = {"Law": Law, "__name__": "a_script"}
        exec(
            f"def helper():\n    return {body}\n\nclass A(Law):\n    name = 'a'\n    def f(self): return helper()",
            space,
        )
        return content(space["A"]())

    assert built("1.0") == built("1.0  # one")
    assert built("1.0") != built("2.0")


def test_a_modules_name_fits_into_a_file_name():
    everything = dict.fromkeys(
        (
            "density_correction",
            "bulk_viscosity",
            "porosity_update",
            "bodies",
            "friction",
            "sliding",
            "driven",
            "passing",
        ),
        True,
    )
    names = {
        Effects(
            "two_phase", law=f"a_law_with_quite_a_long_name-{number}", drag="semi_implicit", **everything
        ).module_name
        for number in range(3)
    }
    assert len(names) == 3
    assert max(map(len, names)) <= 200


def test_what_cannot_be_registered():
    class Own(Law):
        name = "elastic"

    class Odd(Law):
        name = "Odd name"

    class Taken(Law):
        name = "taken"

        class Settings(Model):
            porosity: float = 0.1

    for law, words in ((Own(), "package's own"), (Odd(), "small letters"), (Taken(), "field porosity, which every")):
        with pytest.raises(ValueError, match=words):
            laws.register(law)
    assert laws.names() == ("mohr_coulomb", "elastic", "herschel_bulkley", "coulomb_viscous", "mu_i")

    class Needy(Apic):
        name = "needy"

        class settings(Model):  # noqa: N801
            needed: float

    class Doubled(Apic):
        name = "doubled"

        class settings(Model):  # noqa: N801
            courant_number: float = 0.5

    for scheme, words in ((Needy(), "must have a default"), (Doubled(), "courant_number, which numerics has")):
        with pytest.raises(ValueError, match=words):
            schemes.register(scheme)
    assert schemes.names() == ("flip", "apic", "aflip")


@pytest.mark.parametrize("name", ["case_1", "case_1_dry", pytest.param("hard/flip", marks=pytest.mark.slow)])
def test_the_order_of_launches_is_what_is_launched(load_scene, name):
    scenario = load_scene(name, **COARSE)
    simulation = Simulation(scenario)
    listed = launches(simulation.effects)
    assert simulation.launched_kernels == tuple(launch.kernel for launch in listed)
    assert all(launch.does for launch in listed)


def test_pages_list_every_law_scheme_and_launch(load_scene):
    material = (DOCS.parent / "how_to" / "material.md").read_text()
    for law in LAWS:
        assert f"| `{law.name}` | {law.title} |" in material
        assert all(f"`{field}`" in material for field in law.Settings.model_fields)
    house = (DOCS / "house.md").read_text()
    for scheme in SCHEMES:
        assert f"`{scheme.name}`: {scheme.title}" in house
    walls = dict.fromkeys(("domain.left_edge", "domain.right_edge", "domain.top_edge"), "wall")
    simulation = Simulation(load_scene("case_1", **COARSE, **walls, **{"ground.friction": 0.3}))
    listed = launches(simulation.effects)
    assert {"press", "join", "seep"} <= {launch.kernel for launch in listed}
    for launch in listed:
        assert f"| `{launch.kernel}` | {launch.over} | {launch.does} |" in house
