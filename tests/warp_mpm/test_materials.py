"""Several materials in one scene: bodies that differ in densities, porosity, conductivity, liquid and law."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from warp_mpm.description import described
from warp_mpm.discretization import material_points
from warp_mpm.effect_rules import derive_effects, effect_rules, with_law, without_liquid
from warp_mpm.fields import field_values, solid_density_of
from warp_mpm.kernels.layout import layout
from warp_mpm.performance.plan import described as effect_value
from warp_mpm.scenario import Scenario
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.simulation import Simulation
from warp_mpm.snapshot import snapshot_of
from warp_mpm.stepping import Stepping
from warp_mpm.time_step import step_limits

CASE_1 = Path(__file__).parents[2] / "scenarios" / "case_1.json"
G = 9.81
FLOW = json.loads(CASE_1.read_text())["flow"]["material"]
LIQUID = {name: value for name, value in FLOW.items() if name.startswith(("liquid", "hydraulic", "cavitation"))}
SOLID, WET = 0.5 * 2600.0, 0.5 * 2600.0 + 0.5 * 1000.0
"""Densities of case 1, dry and wet [kg/m³]."""
LATERAL = {"lateral_stress_coefficient": 0.5}
MU_I = {"law": "mu_i", "static_friction": 0.38, "dynamic_friction": 0.64, "grain_diameter_m": 0.01}


def box(left, right, low, high):
    return {"kind": "polygon", "vertices_m": [[left, low], [right, low], [right, high], [left, high]]}


def layers(lower, *, upper=None, formulation="two_phase", **changes):
    """A layer of 1 m on another, between two walls."""
    data = json.loads(CASE_1.read_text())
    flow = data["flow"]
    flow["shape"], flow["velocity_m_per_s"], flow["formulation"] = box(-2, 0, 1, 2), [0, 0], formulation
    flow["material"] |= upper or {}
    if formulation == "dry":
        flow["material"] = {name: value for name, value in flow["material"].items() if name not in LIQUID}
    flow["deposits"] = [{"shape": box(-2, 0, 0, 1)} | LATERAL | lower]
    flow |= LATERAL
    data["barrier"] = {"shape": {"kind": "wall"}, "friction": 0.0, "motion": {"kind": "fixed"}}
    data["domain"] = {"left_m": -2.0, "left_edge": "wall"}
    data["ground"] = {"friction": 0.3}
    data["numerics"]["spacing_m"] = 0.25
    return Scenario.model_validate(data).replaced(changes)


LAYERS = {
    "denser below": ({"material": {"grain_density_kg_per_m3": 3500.0, "porosity": 0.3}}, "two_phase"),
    "another liquid below": ({"material": {"liquid_density_kg_per_m3": 1300.0}}, "two_phase"),
    "dry below": ({"formulation": "dry"}, "two_phase"),
    "dry above": ({"formulation": "two_phase", "material": LIQUID}, "dry"),
}


@pytest.mark.parametrize(
    ("lower", "formulation", "density", "liquid", "load", "pressure"),
    [
        (*LAYERS["denser below"], 0.7 * 3500.0 + 300.0, 1000.0, WET, 1000.0),
        (*LAYERS["another liquid below"], SOLID + 650.0, 1300.0, WET, 1000.0),
        (*LAYERS["dry below"], SOLID, 0.0, WET, 0.0),
        (*LAYERS["dry above"], WET, 1000.0, SOLID, 0.0),
    ],
    ids=LAYERS,
)
def test_a_body_bears_what_stands_on_it(lower, formulation, density, liquid, load, pressure):
    """Total stress and pressure of the liquid from the top down, with those of the upper layer's underside (over g)."""
    points = material_points(layers(lower, formulation=formulation))
    below = points.position[:, 1] < 1.0
    depth = 1.0 - points.position[below, 1]
    pore, vertical = points.pore_pressure[below], points.effective_stress[below, 1]
    np.testing.assert_allclose(pore, G * (pressure + liquid * depth) * (liquid > 0.0), rtol=1e-12)
    np.testing.assert_allclose(vertical - pore, -G * (load + density * depth), rtol=1e-12)
    np.testing.assert_allclose(points.effective_stress[below, 0], 0.5 * vertical, rtol=1e-12)
    assert set(points.material[below]) == {1}
    assert set(points.material[~below]) == {0}
    assert (points.solid_mass + points.liquid_mass)[below].sum() == pytest.approx(2.0 * density, rel=1e-12)


def test_what_lies_beside_or_apart_bears_nothing():
    scene = layers({"shape": box(-2, 0, 0, 0.9)})
    points = material_points(scene)
    below = points.position[:, 1] < 0.9
    np.testing.assert_allclose(points.pore_pressure[below], 1000.0 * G * (0.9 - points.position[below, 1]), rtol=1e-12)


def test_effects_are_those_of_what_differs():
    plain = derive_effects(layers({}))
    assert not plain.materials
    assert plain.kinds == ()
    skeleton = layers({"material": {"young_modulus_Pa": 5e6}})
    assert derive_effects(skeleton) == plain
    dense = derive_effects(layers({"material": {"grain_density_kg_per_m3": 3000.0}}))
    assert dense.materials
    assert dense.kinds == ()
    dry = derive_effects(layers({"formulation": "dry"}))
    assert dry.materials
    assert [kind.wet for kind in dry.kinds] == [True, False]
    other = derive_effects(layers({"material": MU_I}))
    assert not other.materials
    assert [kind.law for kind in other.kinds] == ["mohr_coulomb", "mu_i"]
    # A deposit that says what the flow says is of its material.
    assert len(layers({"material": {"porosity": 0.5}, "formulation": "two_phase"}).flow.materials) == 1
    # Without liquid nodes have nothing to tell apart.
    both = layers({"material": {"grain_density_kg_per_m3": 3000.0}}, formulation="dry")
    assert derive_effects(both) == derive_effects(layers({}, formulation="dry"))


def test_a_deposit_of_its_own_material_is_told_and_checked_as_the_flow():
    scene = layers({"formulation": "dry", "material": {"porosity": 0.4} | MU_I})
    assert "deposit 0 dry, mu_i, 1,560 kg/m³" in "".join(described(scene))
    inertial = {"material": {"inertial_drag_coefficient": 0.4}}
    with pytest.raises(ScenarioError, match=r"flow.deposits\[0\].material.inertial_drag_coefficient = 0.4 is not"):
        layers(inertial, **{"numerics.drag": "explicit"})
    kinds = {rule.effect: rule for rule in effect_rules(scene)}["kinds"]
    assert kinds.on
    assert effect_value(kinds.value) == "mohr-coulomb-wet, mu-i-dry"
    none = {rule.effect: rule for rule in effect_rules(layers({}))}["kinds"]
    assert not none.on
    assert effect_value(none.value) == "off"


def ledger(simulation, mass):
    """Mass and momentum, which close to rounding."""
    sample = simulation.sample()
    held = sample["solid_mass"] + sample.get("liquid_mass", 0.0) + sample["left_mass"]
    assert held == pytest.approx(mass, rel=1e-12)
    scale = mass * max(G * simulation.time, 1.0)
    assert abs(sample["momentum_residual_x"]) < 1e-12 * scale
    assert abs(sample["momentum_residual_y"]) < 1e-12 * scale
    return sample


def mass_of(scenario):
    return scenario.flow.volume * scenario.flow.material.density + scenario.flow.deposited_mass


@pytest.mark.slow
@pytest.mark.parametrize(("lower", "formulation"), LAYERS.values(), ids=LAYERS)
def test_layers_at_rest_stay_at_rest(lower, formulation):
    """As still as two layers of one material, whose corners settle by as much; but for what seeps out of the wet one
    where that lies on a dry one (5 cm of water in 0.1 s at most)."""
    scene = layers(lower, formulation=formulation)
    simulation = Simulation(scene)
    before = simulation.points()
    simulation.advance(0.1)
    after = simulation.points()
    ledger(simulation, mass_of(scene))
    assert np.abs(after["position"] - before["position"]).max() < 2e-4
    scale = np.abs(before["effective_stress"][:, 1] - before["pore_pressure"]).max()
    total = [points["effective_stress"][:, 1] - points["pore_pressure"] for points in (before, after)]
    assert np.abs(total[1] - total[0]).max() < 0.05 * scale
    if lower.get("formulation") == "dry":
        dry = after["material"] == 1.0
        assert (after["pore_pressure"][dry] == 0.0).all()
        assert (after["liquid_mass"][dry] == 0.0).all()
        np.testing.assert_array_equal(after["liquid_velocity"][dry], after["solid_velocity"][dry])
        assert after["pore_pressure"][~dry].max() > 0.8 * before["pore_pressure"].max()
    # What colours points by it knows each point's own density.
    snapshot = snapshot_of(simulation)
    strain = field_values(snapshot, "volumetric_strain", solid_density_of(scene, snapshot))
    assert np.abs(strain).max() < 0.2  # percent
    state = simulation.save_state()
    simulation.advance(0.12)
    again = Simulation(scene)
    again.restore_state(state)
    again.advance(0.12)
    assert again.save_state() == simulation.save_state()


def of_one_density(porosity, conductivity):
    """Two layers at rest that differ in porosity alone, and in what the grains weigh for it."""
    grains = (WET - porosity * 1000.0) / (1.0 - porosity)
    lower = {"porosity": porosity, "grain_density_kg_per_m3": grains, "hydraulic_conductivity_m_per_s": conductivity}
    upper = {"hydraulic_conductivity_m_per_s": conductivity}
    return layers({"material": lower}, upper=upper)


def test_liquid_rests_where_porosities_meet():
    """Hydrostatic, and no liquid runs from the one layer to the other. (Were its share of the pressure that of each
    point's own porosity, n p would become the same on both sides: a tenth of the pressure at the base in 0.3 s.)"""
    simulation = Simulation(of_one_density(0.3, 1e-2))
    assert simulation.effects.unlike_porosity
    simulation.advance(0.3)
    points = simulation.points()
    exact = 1000.0 * G * (2.0 - points["position"][:, 1])
    off = np.abs(points["pore_pressure"] - exact) / (1000.0 * G * 2.0)
    assert np.median(off) < 0.003
    assert off.max() < 0.03  # the corners settle
    slip = np.abs(points["liquid_velocity"] - points["solid_velocity"])[:, 1]
    assert slip.max() < 1e-3
    ledger(simulation, 4.0 * WET)


def test_only_wet_materials_of_two_phases_share_the_pressure_out():
    assert derive_effects(layers({"material": {"porosity": 0.3}})).unlike_porosity
    for lower in ({"formulation": "dry", "material": {"porosity": 0.3}}, {"material": {"young_modulus_Pa": 5e6}}):
        plain = derive_effects(layers(lower))
        assert not plain.unlike_porosity
        assert "pore_impulse" not in layout(plain).grid_fields
    both = layers({"material": {"porosity": 0.3}}, formulation="dry")
    assert not derive_effects(both).unlike_porosity


@pytest.mark.slow
@pytest.mark.parametrize(
    ("own", "formulation"),
    [
        ({"material": {"porosity": 0.3}}, "two_phase"),
        ({"material": {"porosity": 0.3}}, "undrained"),
        ({"formulation": "dry"}, "undrained"),
    ],
    ids=["two phases", "undrained", "dry by undrained"],
)
def test_friction_does_not_hang_on_the_step_where_materials_meet(own, formulation):
    """What liquid bears of a normal force, seen with other weights than the velocity that contact holds, counted what
    contact leaves as force: 0.47 and 0.53 m at a step and at a quarter of it, 0.65 and 0.58 m by a dry heap."""
    slid = []
    for courant in (0.95, 0.24):
        scene = case_with_heap({}, 0.4)
        while scene.flow.formulation != formulation:
            scene = scene.replaced(without_liquid(scene))
        heap = scene.resolved()["flow"]["deposits"][0] | own
        scene = scene.replaced({"flow.deposits": [heap], "numerics.courant_number": courant})
        simulation = Simulation(scene)
        simulation.advance(1.5)
        slid.append(simulation.barrier_displacement)
    assert slid[1] == pytest.approx(slid[0], rel=0.015)  # 1 % of it is the flow's own


def case_with_heap(own, spacing=0.5, **changes):
    """Case 1 with a heap at the barrier's foot."""
    heap = {"shape": {"kind": "polygon", "vertices_m": [[-2.9, 0], [0, 0], [0, 1], [-1.9, 1]]}, **own}
    lateral = {"lateral_stress_coefficient": 0.66}
    changes = {"numerics.spacing_m": spacing, "flow.deposits": [heap | lateral], **changes}
    return Scenario.load(CASE_1).replaced(changes)


def test_points_of_a_material_are_launched_together(monkeypatch, largest_difference):
    """One launch over the points of each, so that its numbers are the same for all of them and `update` stays a loop
    of vector instructions; a material that differs by next to nothing changes as much."""
    plain, own = (Simulation(case_with_heap(material)) for material in ({}, {"material": {"cohesion_Pa": 1e-9}}))
    assert own.effects == plain.effects
    spans = []
    launch = Stepping.launch

    def noting(stepping, one, dim, *rest):
        spans.append((one.kernel, dim))
        launch(stepping, one, dim, *rest)

    monkeypatch.setattr(Stepping, "launch", noting)
    own.prepare()
    heap = int((own.points()["material"] == 1.0).sum())
    assert [dim for kernel, dim in spans if kernel == "update"] == [own.material_points - heap, heap]
    assert own.launched_kernels == plain.launched_kernels
    # But for how far each has arrived, for each of them.
    assert {**own.arrays, "flow": 0} == {**plain.arrays, "flow": 0}
    assert "material" not in plain.points()
    for simulation in (plain, own):
        simulation.advance(0.05)
    assert largest_difference(plain, own) < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["two_phase", "undrained"])
def test_sums_at_the_nodes_are_the_constants_of_equal_materials(formulation, largest_difference):
    """Grains that are heavier by the last digit: liquid, drag and filling are summed up at the nodes, and all comes out
    as without. (apic: aflip damps what the nodes do not see in another way where materials differ.)"""
    changes = {"ground.friction": 0.3, "numerics.transfer": "apic"}
    plain = case_with_heap({}, **changes)
    if formulation == "undrained":
        plain = plain.replaced(without_liquid(plain))
    heavier = {"grain_density_kg_per_m3": math.nextafter(plain.flow.material.grain_density_kg_per_m3, 1e9)}
    heap = plain.resolved()["flow"]["deposits"][0] | {"material": heavier}
    own = plain.replaced({"flow.deposits": [heap]})
    assert derive_effects(own).materials
    simulations = [Simulation(scene) for scene in (plain, own)]
    for simulation in simulations:
        simulation.advance(0.3)
    assert largest_difference(*simulations) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("other", ["dry", "mu_i"])
def test_each_body_does_what_it_does_in_a_scene_of_its_own_kind(other):
    """Two heaps far apart, one wet and one dry or of another law, for 0.3 s of equal steps; what is set as a share of
    the speed of sound is scaled to be the same."""
    first, second = ({"shape": box(left, left + 2, 0, 2)} | LATERAL for left in (-30, -20))
    base = Scenario.load(CASE_1).replaced(
        {
            "numerics.spacing_m": 0.5,
            "numerics.transfer": "apic",  # as above
            "ground.friction": 0.3,
            "flow.shape": second["shape"],
            "flow.velocity_m_per_s": [0, 0],
            "flow.lateral_stress_coefficient": 0.5,
            "flow.deposits": [first],
        }
    )
    if other == "dry":
        alone = base
        while alone.flow.formulation != "dry":
            alone = alone.replaced(without_liquid(alone))
        own = {"formulation": "dry"}
    else:
        own = {"material": MU_I}
        alone = base.replaced(with_law(base, **MU_I)).replaced({"flow.deposits": [first]})
    both = base.replaced({"flow.deposits": [first | own]})
    ratio = step_limits(both).sound_speed / step_limits(alone).sound_speed
    names = ("bulk_viscosity", "pressure_relaxation")
    alone = alone.replaced({f"numerics.{name}": getattr(base.numerics, name) * ratio for name in names})
    simulations = [Simulation(scene) for scene in (both, base, alone)]
    for count in range(1, 601):
        for simulation in simulations:
            simulation.advance(count * 5e-4)
    assert [simulation.steps for simulation in simulations] == [600] * 3
    mixed, wet, dry = (simulation.points() for simulation in simulations)
    heap = mixed["material"] == 1.0
    for others, part in ((wet, ~heap), (dry, heap)):
        for name in set(others) & set(mixed):
            scale = np.abs(others[name][part]).max() or 1.0
            np.testing.assert_allclose(mixed[name][part], others[name][part], atol=1e-10 * scale, err_msg=name)


@pytest.mark.slow
def test_each_layer_settles_by_its_own_conductivity():
    """Two layers whose weight rests on the liquid at first: v_S = k (1 - n)(rho_S / rho_L - 1) in the middle of each,
    until consolidation comes there from base and border."""
    scene = layers({"material": {"hydraulic_conductivity_m_per_s": 3e-4}}, **{"numerics.spacing_m": 0.05})
    scene = scene.replaced(with_law(scene, "elastic"))
    # As stiff as real water: else its own expansion takes some of the speed.
    scene = scene.replaced({"flow.material.liquid_bulk_modulus_Pa": 2.2e9, "ground.friction": 0.0})
    simulation = Simulation(scene)
    points = simulation.points()
    height = points["position"][:, 1]
    simulation.set_points(
        effective_stress=np.zeros_like(points["effective_stress"]), pore_pressure=WET * G * (2.0 - height)
    )
    middles = [(np.abs(height - middle) < 0.1) for middle in (0.5, 1.5)]
    speeds = []
    for time in np.linspace(0.04, 0.1, 201):
        simulation.advance(float(time))
        speed = -simulation.points()["solid_velocity"][:, 1]
        speeds.append([float(speed[middle].mean()) for middle in middles])
    exact = [conductivity * 0.5 * (2600.0 / 1000.0 - 1.0) for conductivity in (3e-4, 1e-4)]
    np.testing.assert_allclose(np.mean(speeds, axis=0), exact, rtol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("own", "formulation"),
    [
        ({"formulation": "dry"}, "two_phase"),
        ({"formulation": "dry", "material": MU_I}, "two_phase"),
        ({"formulation": "two_phase", "material": LIQUID}, "dry"),
        ({"formulation": "dry"}, "undrained"),
        ({"material": {"porosity": 0.3}}, "two_phase"),
    ],
    ids=["dry by wet", "dry of another law by wet", "wet by dry", "dry by undrained", "denser by wet"],
)
def test_a_deposit_that_is_hit_at_15_m_per_s(own, formulation):
    scene = case_with_heap({}, **{"flow.velocity_m_per_s": [15, 0], "ground.friction": 0.3})
    while scene.flow.formulation != formulation:
        scene = scene.replaced(without_liquid(scene))
    heap = scene.resolved()["flow"]["deposits"][0] | own
    scene = scene.replaced({"flow.deposits": [heap]})
    simulation, energies, peak = Simulation(scene), [], 0.0
    for time in (0.1, 0.5, 1.0, 1.5, 2.0):
        simulation.advance(time)
        sample = ledger(simulation, mass_of(scene))
        names = ("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy", "left_energy")
        energies.append(sum(sample[name] for name in names) + sample["barrier_work"])
        peak = max(peak, sample["impact_force_x"])
        assert sample["speed_max"] < 30.0
    assert (np.diff(energies) < 0.0).all()
    assert peak > 1e5
    assert simulation.record["points_left"] == 0


@pytest.mark.slow
def test_heavy_on_light_turns_over():
    """Of twice the density, without friction: it sinks, and no energy comes of it but its own."""
    scene = layers(
        {"material": {"grain_density_kg_per_m3": 2000.0}},
        upper={"grain_density_kg_per_m3": 5000.0, "friction_angle_deg": 0.0},
        **{"ground.friction": 0.0},
    )
    upper, lower = (material.density for material in scene.flow.materials)
    assert upper == pytest.approx(2.0 * lower)
    simulation, energies = Simulation(scene), []

    def heights():
        points = simulation.points()
        return [points["position"][points["material"] == place, 1].mean() for place in (0.0, 1.0)]

    before = heights()
    assert before == pytest.approx([1.5, 0.5])
    for time in (1.0, 4.0, 7.0, 10.0):
        simulation.advance(time)
        sample = ledger(simulation, mass_of(scene))
        names = ("flow_kinetic_energy", "flow_gravitational_energy", "flow_elastic_energy")
        energies.append(sum(sample[name] for name in names))
    assert (np.diff(energies) < 0.0).all()
    after = heights()
    assert after[0] < after[1]
    assert simulation.record["points_left"] == 0
