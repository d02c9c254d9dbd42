"""Material points carry the flow's exact volume, centre and weight."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warp_mpm import geometry
from warp_mpm.discretization import SMALLEST_POINT, fill_polygon, material_points
from warp_mpm.scenario import Scenario
from warp_mpm.scenario_errors import ScenarioError

SCENES = Path(__file__).parents[2] / "scenarios"


def test_whole_cells_hold_a_regular_lattice_aligned_with_the_origin():
    block = np.array([[-1.0, 0.0], [0.0, 0.0], [0.0, 0.5], [-1.0, 0.5]])
    position, volume = fill_polygon(block, spacing=0.25, points_per_cell=4)
    assert len(volume) == 4 * 4 * 2
    assert volume == pytest.approx(0.125**2)
    in_cell = np.mod(position, 0.25) / 0.25
    assert np.abs(np.abs(in_cell - 0.5) - 0.25).max() < 1e-12


@pytest.mark.parametrize("spacing", [0.2, 0.237, 1.0])
@pytest.mark.parametrize("points_per_cell", [1, 4, 9, 16])
def test_volume_and_centre_are_exact(spacing, points_per_cell):
    polygon = geometry.front_and_tail(3.0, 3, 3.1)
    position, volume = fill_polygon(polygon, spacing, points_per_cell)
    assert volume.sum() == pytest.approx(45.0, rel=1e-13)
    assert volume @ position / volume.sum() == pytest.approx(geometry.centroid(polygon), rel=1e-12)
    whole = spacing**2 / points_per_cell
    assert volume.min() >= SMALLEST_POINT * whole * (1 - 1e-9)
    assert geometry.contains(polygon, position).all()


@settings(max_examples=60, deadline=None)
@given(
    angles=st.lists(st.floats(0.0, 6.28), min_size=4, max_size=9, unique_by=lambda a: round(a, 2)),
    radii=st.lists(st.floats(0.3, 2.0), min_size=9, max_size=9),
    spacing=st.floats(0.11, 0.9),
)
def test_volume_of_any_star(angles, radii, spacing):
    angles = np.sort(angles)
    polygon = np.stack([np.cos(angles), np.sin(angles)], axis=1) * np.array(radii[: len(angles)])[:, None]
    if geometry.crossing_edges(polygon) is not None or geometry.area(polygon) < 1e-3:
        return
    position, volume = fill_polygon(polygon, spacing, 4)
    assert (volume > 0).all()
    assert volume.sum() == pytest.approx(geometry.area(polygon), rel=1e-10)
    assert volume @ position / volume.sum() == pytest.approx(geometry.centroid(polygon), abs=1e-9)


def test_a_flow_thinner_than_a_square_keeps_its_mass():
    ribbon = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 0.01], [0.0, 0.01]])
    position, volume = fill_polygon(ribbon, spacing=0.2, points_per_cell=4)
    assert volume.sum() == pytest.approx(0.03, rel=1e-12)
    assert geometry.contains(ribbon, position).all()


@pytest.mark.parametrize(("spacing", "points_per_cell"), [(0.2, 5), (0.2, 0), (0.0, 4), (float("nan"), 4)])
def test_impossible_request(spacing, points_per_cell):
    with pytest.raises(ValueError, match="must be"):
        fill_polygon(geometry.front_and_tail(1.0, 1, 0.0), spacing, points_per_cell)


@pytest.mark.parametrize(
    ("name", "solid", "liquid"),
    [("case_1", 58_500, 22_500), ("case_1_dry", 58_500, 0), ("set_i", 81_900, 13_500), ("set_v", 62_400, 24_000)],
)
def test_masses_of_the_phases(name, solid, liquid):
    # (1 - n) 2600 V and n 1000 V of Tables 1, 2 and 4.
    points = material_points(Scenario.load(SCENES / f"{name}.json"))
    assert points.solid_mass.sum() == pytest.approx(solid, rel=1e-13)
    assert points.liquid_mass.sum() == pytest.approx(liquid, rel=1e-13)


def test_geostatic_start():
    scenario = Scenario.load(SCENES / "case_1.json")
    points = material_points(scenario)
    x, y = points.position.T
    plateau = (x > -14.9) & (x < -6.1)
    pressure = 1000 * 9.81 * (3.0 - y[plateau])
    assert points.pore_pressure[plateau] == pytest.approx(pressure)
    assert points.effective_stress[plateau, 1] == pytest.approx(-0.8 * pressure)  # (1800 - 1000) / 1000
    assert points.effective_stress[plateau, 0] == pytest.approx(-0.66 * 0.8 * pressure)
    assert (points.effective_stress[:, 3] == 0).all()
    # The paper: initial liquid pressure below 30 kPa.
    assert 28e3 < points.pore_pressure.max() < 30e3
    # In the 45° front the depth is measured straight up.
    front = (x > -5.8) & (x < -3.2) & (y < 2.0)
    assert points.pore_pressure[front] == pytest.approx(np.maximum(9810 * (-3.0 - x - y)[front], 0), abs=1e-6)


def test_no_stress_without_gravity_or_on_request():
    scenario = Scenario.load(SCENES / "case_1.json")
    for change in ({"gravity.acceleration_m_per_s2": 0}, {"flow.initial_stress": "zero"}):
        points = material_points(scenario.replaced(change))
        assert not points.pore_pressure.any()
        assert not points.effective_stress.any()


def test_slope_reduces_the_pressure():
    scenario = Scenario.load(SCENES / "case_1.json")
    flat, tilted = (material_points(scenario.replaced({"gravity.tilt_deg": tilt})) for tilt in (0, 30))
    assert tilted.pore_pressure == pytest.approx(flat.pore_pressure * np.cos(np.radians(30)))


@pytest.mark.parametrize("name", ["case_1", "case_1_undrained"])
@pytest.mark.parametrize("ratio", [0.0, 0.6, 1.0])
def test_a_pore_pressure_ratio_shares_the_weight(load_scene, name, ratio):
    tilt = {"gravity.tilt_deg": 20.0, "flow.initial_pore_pressure_ratio": ratio}
    points = material_points(load_scene(name, **tilt))
    hydrostatic = material_points(load_scene(name, **tilt | {"flow.initial_pore_pressure_ratio": None}))
    total = points.pore_pressure - points.effective_stress[:, 1]
    np.testing.assert_allclose(total, hydrostatic.pore_pressure - hydrostatic.effective_stress[:, 1], rtol=1e-12)
    np.testing.assert_allclose(points.pore_pressure, ratio * total, atol=1e-9)
    np.testing.assert_allclose(points.effective_stress[:, 0], 0.66 * points.effective_stress[:, 1], atol=1e-9)
    np.testing.assert_allclose(hydrostatic.pore_pressure, total / 1.8, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("case_1_dry", {}, "is not allowed in a dry flow"),
        ("case_1", {"flow.initial_stress": "zero"}, 'is not allowed with flow.initial_stress = "zero"'),
    ],
)
def test_a_pore_pressure_ratio_needs_a_liquid_and_a_weight(load_scene, name, changes, words):
    with pytest.raises(ScenarioError, match=words):
        load_scene(name, **changes | {"flow.initial_pore_pressure_ratio": 0.5})
