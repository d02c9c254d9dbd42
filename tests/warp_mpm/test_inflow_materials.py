"""What arrives with a material of its own: in one surge or several, and with a density that changes over time."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from warp_mpm.arrival_figures import arrival_figures
from warp_mpm.description import described
from warp_mpm.discretization import material_points
from warp_mpm.effect_rules import derive_effects, with_law
from warp_mpm.scenario import Scenario
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.simulation import Simulation

CASE_1 = Path(__file__).parents[2] / "scenarios" / "case_1.json"
STREAM = {"x_m": -6.0, "times_s": [0.0, 1.0, 2.0], "depths_m": [2.0, 2.0, 2.0], "velocity_m_per_s": 8.0}
HEAP = {"shape": {"kind": "polygon", "vertices_m": [[-2.9, 0], [0, 0], [0, 1], [-1.9, 1]]}}
DENSE = {"grain_density_kg_per_m3": 3000.0, "porosity": 0.4}
DRY = {"formulation": "dry", "material": {"law": "mu_i", "static_friction": 0.38, "dynamic_friction": 0.64}}
DRY["material"]["grain_diameter_m"] = 0.01


def scene(inflow, deposits=(), **changes):
    """Case 1 with a flow that arrives in place of its block, 2 m deep for 2 s."""
    data = json.loads(CASE_1.read_text())
    del data["flow"]["shape"], data["flow"]["velocity_m_per_s"]
    data["flow"] |= {"inflow": STREAM | inflow, "deposits": list(deposits)}
    return Scenario.model_validate(data).replaced({"numerics.spacing_m": 0.5} | changes)


def ledger(simulation):
    """A sample, whose mass and momentum are those of what lay there and has arrived."""
    sample = simulation.sample()
    held = sample["solid_mass"] + sample["liquid_mass"] + sample["left_mass"]
    mass = simulation.scenario.flow.deposited_mass + sample["inflow_mass"]
    assert held == pytest.approx(mass, rel=1e-12)
    for axis in "xy":
        assert abs(sample[f"momentum_residual_{axis}"]) < 1e-12 * mass * 8.0
    return sample


def test_surges_of_one_material_by_the_last_digit_are_one_flow(largest_difference):
    """Two spans of points in place of one; of both some arrive."""
    flow = scene({}).flow.material
    other = {"friction_angle_deg": math.nextafter(flow.friction_angle_deg, 90.0)}
    later = {"from_s": 0.25, "material": other, "lateral_stress_coefficient": 0.66}
    plain, own = (scene(inflow, [HEAP]) for inflow in ({}, {"surges": [later]}))
    assert derive_effects(own) == derive_effects(plain)
    assert len(own.flow.materials) == 2
    assert [span.material for span in material_points(own).spans] == [0, 1]
    simulations = [Simulation(one) for one in (plain, own)]
    for time in (0.1, 0.5):
        for simulation in simulations:
            simulation.advance(time)
    assert simulations[1].points()["material"].any()
    assert largest_difference(*simulations) < 1e-12
    samples = [simulation.sample() for simulation in simulations]
    assert samples[1]["inflow_mass"] == pytest.approx(samples[0]["inflow_mass"], rel=1e-12)
    state = simulations[1].save_state()
    again = Simulation(own)
    again.restore_state(state)
    for simulation in (again, simulations[1]):
        simulation.advance(0.6)
    assert again.save_state() == simulations[1].save_state()


def test_what_says_what_the_flow_says_is_of_its_material():
    plain = scene({})
    said = scene({"material": {"porosity": 0.5}, "surges": [{"from_s": 1.0, "formulation": "two_phase"}]})
    assert said.flow.materials == plain.flow.materials
    ours, theirs = material_points(said), material_points(plain)
    assert len(ours.spans) == 1
    for name in ("position", "entry", "solid_mass", "pore_pressure"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    steady = scene({"densities_kg_per_m3": [1800.0] * 3})
    assert steady.flow.materials == plain.flow.materials


def test_a_denser_surge_and_a_dry_one_onto_a_wet_heap_close_the_ledger():
    """Each of its own density, law and stress; mass and momentum of both phases to rounding."""
    scenario = scene({"material": DENSE, "surges": [{"from_s": 0.3, **DRY}]}, [HEAP], **{"numerics.spacing_m": 0.5})
    assert [part.material.density for part in scenario.flow.arriving] == pytest.approx([2200.0, 1300.0])
    assert [kind.wet for kind in derive_effects(scenario).kinds] == [True, False]
    words = "".join(described(scenario))
    assert "two-phase, mohr_coulomb, 2,200 kg/m³; from t = 0.3 s on dry, mu_i, 1,300 kg/m³" in words
    points = material_points(scenario)
    dense, dry = (points.material == place for place in (1, 2))
    coming = points.position[:, 1] < 0.26
    for chosen, density, liquid in ((dense, 2200.0, 1000.0), (dry, 1300.0, 0.0)):
        low = chosen & coming
        depth = 2.0 - points.position[low, 1]
        np.testing.assert_allclose(points.pore_pressure[low], liquid * 9.81 * depth, rtol=1e-12)
        total = points.effective_stress[low, 1] - points.pore_pressure[low]
        np.testing.assert_allclose(total, -density * 9.81 * depth, rtol=1e-12)
        mass = points.solid_mass[chosen] + points.liquid_mass[chosen]
        np.testing.assert_allclose(mass, density * points.volume[chosen], rtol=1e-12)
    simulation = Simulation(scenario)
    for time in (0.0, 0.2, 0.5, 0.8):
        simulation.advance(time)
        sample = ledger(simulation)
    # 2 m at 8 m/s: 2,200 kg/m³ until 0.3 s, 1,300 since; to a column of points.
    expected = 16.0 * (2200.0 * 0.3 + 1300.0 * 0.5)
    assert sample["inflow_mass"] == pytest.approx(expected, abs=0.26 * 2.0 * 2200.0)
    assert sample["impact_force_x"] > 1e4
    now = simulation.points()
    assert (now["liquid_mass"][now["material"] == 2.0] == 0.0).all()
    figures = arrival_figures(scenario, {"inflow_mass": np.array([sample["inflow_mass"]])}, {})
    assert figures["inflow_volume"] == pytest.approx(now["material"].astype(bool) @ now["volume"], rel=0.02)


RISING = {"depths_m": [0.0, 2.0, 0.0], "densities_kg_per_m3": [0.0, 2000.0, 1600.0]}


def test_a_density_that_changes_over_time_is_one_of_the_porosity():
    """From 2,000 kg/m³ when the flow is deepest to 1,600 at its end; before, where the table has no depth, 2,000."""
    scenario = scene({"times_s": [0.0, 1.0, 2.0]} | RISING)
    flow = scenario.flow
    parts = flow.arriving
    assert len(parts) == 8
    for part in parts:
        assert part.material.density == pytest.approx(part.density, abs=0.5 * 400.0 / 8.0)
        assert part.material.hydraulic_conductivity == flow.material.hydraulic_conductivity
    points = material_points(scenario)
    mass = points.solid_mass + points.liquid_mass
    time = np.linspace(0.0, 2.0, 200_001)
    depth = np.interp(time, [0.0, 1.0, 2.0], RISING["depths_m"])
    density = np.interp(time, [0.0, 1.0, 2.0], [2000.0, 2000.0, 1600.0])
    exact = float((8.0 * depth * density).mean() * 2.0)
    assert flow.arriving_mass == pytest.approx(exact, rel=1e-4)
    assert flow.mass == flow.arriving_mass
    # A column of points belongs to one step.
    assert mass.sum() == pytest.approx(exact, rel=2e-3)
    passing = (STREAM["x_m"] - points.position[:, 0]) / 8.0
    np.testing.assert_allclose(mass / points.volume, np.interp(passing, time, density), atol=400.0 / 8.0)
    assert flow.arrived_volume(exact) == pytest.approx(16.0, rel=1e-4)
    assert flow.arrived_volume(2000.0 * 4.0) == pytest.approx(4.0, rel=0.02)
    # Each step's points come in their order.
    for part in points.spans:
        assert (np.diff(points.entry[part.begin : part.end]) >= 0.0).all()


def test_a_column_of_the_density_is_read(tmp_path):
    path = tmp_path / "flood.csv"
    path.write_text("t,h,v,Density (kg/m3)\n0,0,4,0\n1,2,4,2000\n2,0,4,1600\n")
    data = scene({}).resolved()
    data["flow"]["inflow"] = {"x_m": -10.0, "hydrograph_csv": str(path)}
    assert Scenario.model_validate(data).flow.inflow.densities_kg_per_m3 == (0.0, 2000.0, 1600.0)


def test_another_law_for_all_leaves_each_material_its_other_figures():
    scenario = scene({"material": DENSE, "surges": [{"from_s": 0.3, **DRY}]}, [HEAP | DRY])
    stiff = scenario.replaced(with_law(scenario, "elastic"))
    assert {material.law for material in stiff.flow.materials} == {"elastic"}
    assert [part.material.density for part in stiff.flow.arriving] == pytest.approx([2200.0, 1300.0])
    assert stiff.flow.inflow.surges[0].lateral_stress_coefficient == pytest.approx(
        1.0 - math.sin(math.atan(0.38)), rel=0.2
    )


@pytest.mark.slow
def test_a_density_that_changes_closes_the_ledger():
    scenario = scene({"times_s": [0.0, 0.5, 1.0]} | RISING, [HEAP], **{"ground.friction": 0.3})
    simulation = Simulation(scenario)
    for time in np.linspace(0.1, 1.5, 15):
        simulation.advance(float(time))
        sample = ledger(simulation)
    assert sample["inflow_mass"] == pytest.approx(scenario.flow.arriving_mass, rel=5e-3)
    assert sample["impact_force_x"] > 1e4


@pytest.mark.parametrize(
    ("inflow", "sentence"),
    [
        ({"material": {"porosity": 2.0}}, r"flow: inflow.material: porosity = 2.0 is not allowed"),
        ({"material": {"colour": 2.0}}, r"flow: inflow.material.colour is not allowed; a material with"),
        (
            {"formulation": "undrained"},
            'flow: inflow.formulation = "undrained" is not allowed, as what is wet in a scene has one formulation; it '
            'must be "two_phase" or "dry"',
        ),
        (
            {"surges": {"from_s": 1.0}},
            "surges = .* is not allowed; it must be a list of 0 to 20 groups of the fields lateral_stress_coefficient, "
            "formulation, material, from_s",
        ),
        ({"surges": [{"from_s": 2.0}]}, r"surges\[0\].from_s = 2 is not allowed; it must be above 0 and below 2"),
        (
            {"surges": [{"from_s": 1.0, "material": {"law": "fog"}}]},
            r'flow: inflow.surges\[0\].material.law = "fog" is not known; it must be one of',
        ),
        (
            {"densities_kg_per_m3": [1800, 2600, 1800]},
            r"inflow.densities_kg_per_m3\[1\] = 2600 is not allowed; it must be above 1000 and below 2600",
        ),
        (
            {"densities_kg_per_m3": [1800, 900, 1800]},
            r"inflow.densities_kg_per_m3\[1\] = 900 is not allowed; it must be above 1000 and below 2600",
        ),
        (
            {"formulation": "dry", "densities_kg_per_m3": [1300, 0, 1300]},
            r"inflow.densities_kg_per_m3\[1\] = 0 is not allowed; it must be above 0 and below 2600",
        ),
        ({"densities_kg_per_m3": [1800, 1800]}, "densities_kg_per_m3 has 2 entries and times_s 3; they must be"),
        (
            {"formulation": "dry", "pore_pressure_ratios": [0.5, 0.5, 0.5]},
            "inflow.pore_pressure_ratios are not allowed, as all that arrives is dry",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_gets_one_sentence(inflow, sentence):
    with pytest.raises(ScenarioError, match=sentence) as refused:
        scene(inflow)
    assert len(refused.value.problems) == 1
