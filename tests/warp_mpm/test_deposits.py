"""What lies there at the start: of the flow's material, or with a skeleton of its own."""

import json
from pathlib import Path

import numpy as np
import pytest

from warp_mpm.discretization import material_points
from warp_mpm.effect_rules import derive_effects
from warp_mpm.scenario import Scenario
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.simulation import Simulation
from warp_mpm.time_step import step_limits

CASE_1 = Path(__file__).parents[2] / "scenarios" / "case_1.json"

HEAP = {"shape": {"kind": "on_ground", "from_m": -30, "to_m": -26, "depth_m": 2}}
OTHER = {"shape": {"kind": "on_ground", "from_m": -16, "to_m": -12, "depth_m": 2}}
LATE = {"x_m": -60.0, "times_s": [0.9, 1.9], "depths_m": [2.0, 2.0], "velocity_m_per_s": 30.0}
"""An inflow of which nothing gets to either, so fast that it alone rules the time step."""


def scene(inflow, **changes):
    """Case 1 with a flow that arrives in place of its block."""
    data = json.loads(CASE_1.read_text())
    del data["flow"]["shape"], data["flow"]["velocity_m_per_s"]
    data["flow"]["inflow"] = inflow
    return Scenario.model_validate(data).replaced({"numerics.spacing_m": 0.5} | changes)


def test_deposits_lie_still_under_their_own_weight():
    points = material_points(scene(LATE, **{"flow.deposits": [HEAP, OTHER]}))
    there = slice(None, points.there)
    assert points.volume[there].sum() == pytest.approx(16.0, rel=1e-12)
    assert not points.velocity.any()
    depth = 2.0 - points.position[there, 1]
    np.testing.assert_allclose(points.pore_pressure[there], 1000.0 * 9.81 * depth, rtol=1e-12)
    np.testing.assert_allclose(points.effective_stress[there, 0], 0.66 * points.effective_stress[there, 1], rtol=1e-12)


def test_volumes_tell_the_flow_from_its_deposits():
    flow = scene(LATE, **{"flow.deposits": [HEAP, OTHER]}).flow
    assert flow.volume == pytest.approx(60.0)
    assert flow.deposited_volume == pytest.approx(16.0)
    assert flow.depth == 2.0


@pytest.mark.parametrize(
    ("deposits", "sentence"),
    [
        (
            [{"shape": HEAP["shape"] | {"depth_m": 0}}],
            r"depth_m = 0 is not allowed; it must be a finite number greater",
        ),
        ([{"shape": HEAP["shape"] | {"to_m": -30}}], "to_m = -30 must be at least 1e-06 m, .* beyond from_m = -30"),
        ([{"shape": {"kind": "polygon", "vertices_m": [[-9, 0], [-8, 0], [-7, 0]]}}], "must enclose an area greater"),
        (
            [{"shape": HEAP["shape"] | {"depth_m": 1e-3}}],
            r"leaves less than one material point for flow.deposits\[0\]",
        ),
        ([{"shape": HEAP["shape"] | {"to_m": 2}}], r"flow.deposits\[0\] lies inside the barrier by"),
        ([HEAP, HEAP], r"flow.deposits\[0\] and flow.deposits\[1\] lie in one place; they must not overlap"),
        (
            [HEAP | {"material": {"porosty": 0.3}}],
            r'deposits\[0\].material.porosty is not allowed; a material with the formulation "two_phase" and the law',
        ),
        (
            [HEAP | {"formulation": "dry", "material": {"liquid_density_kg_per_m3": 900}}],
            r'deposits\[0\].material.liquid_density_kg_per_m3 is not allowed; a material with the formulation "dry"',
        ),
        (
            [HEAP | {"formulation": "undrained"}],
            r'deposits\[0\].formulation = "undrained" is not allowed, .* it must be "two_phase" or "dry"',
        ),
        (
            [HEAP | {"material": {"porosity_update": True}}],
            r"deposits\[0\].material.porosity_update = true is not allowed, .* it must be false",
        ),
        ([HEAP | {"material": {"law": "mud"}}], r'deposits\[0\].material.law = "mud" is not known; it must be one of'),
        ([HEAP | {"material": {"law": "mu_i"}}], r"deposits\[0\].material: .*is missing"),
        ([HEAP | {"material": {"porosity": 1.4}}], r"deposits\[0\].material: porosity = 1.4 is not allowed"),
        ([HEAP | {"material": {"poisson_ratio": 0.6}}], r"deposits\[0\].material: poisson_ratio = 0.6 is not allowed"),
        ([HEAP | {"material": {"dilatancy_angle_deg": 30}}], r"deposits\[0\].material: .*must not exceed"),
    ],
)
def test_what_is_no_deposit_gets_one_sentence(deposits, sentence):
    with pytest.raises(ScenarioError, match=sentence) as refused:
        scene(LATE, **{"flow.deposits": deposits})
    assert len(refused.value.problems) == 1


def test_a_deposit_of_its_own_skeleton_calls_for_no_other_kernels():
    plain, own = (scene(LATE, **{"flow.deposits": [HEAP | more]}) for more in ({}, {"material": {"cohesion_Pa": 1e3}}))
    assert derive_effects(own) == derive_effects(plain)
    assert [material.cohesion_Pa for material in own.flow.materials] == [0.0, 1e3]
    # The stiffest bounds the step; K0 is that of the deposit's own law.
    stiff = scene(LATE, **{"flow.deposits": [HEAP | {"material": {"young_modulus_Pa": 2e8, "friction_angle_deg": 40}}]})
    assert step_limits(stiff).wave_speed > 1.5 * step_limits(plain).wave_speed
    points = material_points(stiff)
    ratio = points.effective_stress[: points.there, 0] / points.effective_stress[: points.there, 1]
    np.testing.assert_allclose(ratio, 1.0 - np.sin(np.radians(40.0)), rtol=1e-12)


@pytest.mark.slow
def test_each_deposit_slumps_as_its_own_material_does():
    """Two heaps in one scene, of 40° and of 20°, and each where all of the scene has its angle."""
    lateral = {"lateral_stress_coefficient": 0.66}
    heaps = [HEAP | lateral | {"material": {"friction_angle_deg": 40}}, OTHER | lateral]
    both = Simulation(scene(LATE, **{"flow.deposits": heaps}))
    alike = [HEAP | lateral, OTHER | lateral]
    strong = Simulation(scene(LATE, **{"flow.deposits": alike, "flow.material.friction_angle_deg": 40}))
    weak = Simulation(scene(LATE, **{"flow.deposits": alike}))
    for simulation in (both, strong, weak):
        simulation.advance(0.8)
    there, first = material_points(both.scenario).there, slice(0, 128)
    assert there == 256
    for other, part in ((strong, first), (weak, slice(128, 256))):
        for name in ("position", "effective_stress", "pore_pressure"):
            expected = other.points()[name][part]
            scale = np.abs(expected).max()
            np.testing.assert_allclose(both.points()[name][part], expected, atol=1e-9 * scale)
    spread = [np.ptp(both.points()["position"][part, 0]) for part in (first, slice(128, 256))]
    assert spread[1] > spread[0] + 0.2
    # Its elastic energy is that of each material.
    energy = both.sample()["flow_elastic_energy"]
    assert energy != pytest.approx(weak.sample()["flow_elastic_energy"], rel=1e-3)
    state = both.save_state()
    both.advance(1.2)
    again = Simulation(both.scenario)
    again.restore_state(state)
    again.advance(1.2)
    assert again.save_state() == both.save_state()
