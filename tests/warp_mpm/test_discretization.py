"""Material points carry the flow's exact volume, centre and weight."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warp_mpm import discretization, geometry
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
    for at_rest in (False, True):
        position, volume = fill_polygon(polygon, spacing, 4, at_rest=at_rest)
        assert (volume > 0).all()
        assert volume.sum() == pytest.approx(geometry.area(polygon), rel=1e-10)
        assert volume @ position / volume.sum() == pytest.approx(geometry.centroid(polygon), abs=1e-9)


BASIN = np.array([[-2.0, 1.5], [-1.3, 0.2], [-0.6, 0.1], [0.4, 0.65], [1.1, 0.3], [1.9, 1.5]])
"""An underside with corners of both kinds, off the cells' corners; level on top."""


def to_nodes(position, volume, spacing, at_top):
    """Mass, and force of a pressure that grows from the surface down, of points [N] at the nodes [N, N, 3]."""
    nodes = np.arange(-3.5, 20.5) * spacing - 3.0

    def spline(x):
        away = (x[:, None] - nodes) / spacing
        near, slope = np.abs(away) < 0.5, np.clip(1.5 - np.abs(away), 0.0, None)
        return (np.where(near, 0.75 - away**2, 0.5 * slope**2), np.where(near, -2.0 * away, -np.sign(away) * slope))

    (wx, dx), (wy, dy) = map(spline, position.T)
    force = volume * (at_top - position[:, 1])
    along = ((wx, wy, volume), (dx, wy, force / spacing), (wx, dy, force / spacing))
    return np.stack([np.einsum("pi,pj,p->ij", a, b, c) for a, b, c in along], axis=-1)


@pytest.mark.parametrize("points_per_cell", [4, 9, 16])
def test_what_lies_at_rest_on_a_slope_is_in_balance_at_every_node(points_per_cell, monkeypatch):
    spacing = 0.25
    with monkeypatch.context() as patch:
        patch.setattr(discretization, "SMALLEST_PART", 0.0)
        exact = to_nodes(*fill_polygon(BASIN, spacing / 4, 16, at_rest=True), spacing, 1.5)
    position, volume = fill_polygon(BASIN, spacing, points_per_cell, at_rest=True)
    assert geometry.contains(BASIN, position).all()
    np.testing.assert_allclose(to_nodes(position, volume, spacing, 1.5), exact, atol=1e-12)
    moving = to_nodes(*fill_polygon(BASIN, spacing, points_per_cell), spacing, 1.5)
    assert np.abs(moving - exact).max() > 1e-4


def test_next_to_nothing_of_a_cell_has_no_points_of_its_own():
    """0.03 % of a cell in the basin's corner, which the cell above takes in, with volume and centre."""
    spacing, corner = 0.5, np.array([[-1.0, 1.0], [-0.5, -0.01], [0.9, 1.0]])
    position, volume = fill_polygon(corner, spacing, 4, at_rest=True)
    assert position[:, 1].min() > 0.0
    assert volume.min() > 1e-4 * spacing**2
    assert volume.sum() == pytest.approx(geometry.area(corner), rel=1e-12)
    assert volume @ position / volume.sum() == pytest.approx(geometry.centroid(corner), rel=1e-12)


@pytest.mark.parametrize("shape", ["front_and_tail", "block"])
def test_what_lies_on_level_ground_is_filled_as_what_moves_there(shape):
    outline = {
        "front_and_tail": geometry.front_and_tail(3.0, 3, 3.1),
        "block": np.array([[0.1, 0.0], [2.3, 1e-15], [2.3, 1.1], [0.1, 1.1]]),
    }[shape]
    for ours, theirs in zip(fill_polygon(outline, 0.2, 4, at_rest=True), fill_polygon(outline, 0.2, 4), strict=True):
        np.testing.assert_array_equal(ours, theirs)


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


PROFILES = {
    "linear, at rest on the bed": ({"base_velocity_share": 0.0}, lambda s: 2.0 * s),
    "Bagnold's power": ({"base_velocity_share": 0.4, "velocity_exponent": 1.5}, lambda s: 0.4 + 0.6 * 2.5 * s**1.5),
    "a plug": ({"velocity_profile": [[0, 0], [0.5, 3], [1, 3]]}, lambda s: np.minimum(s / 0.5, 1.0) / 0.75),
}


@pytest.mark.parametrize(("fields", "pace"), PROFILES.values(), ids=PROFILES)
def test_a_velocity_over_the_depth_has_the_stated_mean(load_scene, fields, pace):
    changes = {f"flow.{name}": value for name, value in fields.items()}
    scenario = load_scene("case_1", **{"flow.velocity_m_per_s": [10.0, -1.0]} | changes)
    points, uniform = material_points(scenario), material_points(load_scene("case_1"))
    mass = points.solid_mass + points.liquid_mass
    np.testing.assert_allclose(mass @ points.velocity / mass.sum(), [10.0, -1.0], rtol=1e-13)
    np.testing.assert_allclose(points.velocity[:, 1], -0.1 * points.velocity[:, 0], rtol=1e-13)
    x, y = points.position.T
    plateau = (x > -14.9) & (x < -6.1)
    # The points' middles miss the mean over the depth by that of their rows, below 1 % with thirty.
    np.testing.assert_allclose(points.velocity[plateau, 0], 10.0 * pace(y[plateau] / 3.0), rtol=0.01)
    # In the 45° front the depth is that of the column.
    front = (x > -5.8) & (x < -3.6)
    np.testing.assert_allclose(points.velocity[front, 0], 10.0 * pace(y[front] / (-3.0 - x[front])), atol=0.7)
    assert scenario.flow.greatest_speed == pytest.approx(np.hypot(10.0, 1.0) * pace(1.0))
    assert points.velocity[:, 0].max() <= 10.0 * pace(1.0) * 1.01
    for name in ("position", "volume", "effective_stress", "pore_pressure"):
        assert (getattr(points, name) == getattr(uniform, name)).all()


def test_what_lies_there_has_no_velocity_over_the_depth(load_scene):
    deposit = {"shape": {"kind": "polygon", "vertices_m": [[-2, 0], [0, 0], [0, 1], [-2, 1]]}}
    points = material_points(load_scene("case_1", **{"flow.deposits": [deposit], "flow.base_velocity_share": 0.5}))
    lying = points.position[:, 0] > -3.0
    assert lying.any()
    assert not points.velocity[lying].any()
    mass = (points.solid_mass + points.liquid_mass)[~lying]
    assert mass @ points.velocity[~lying, 0] == pytest.approx(10.0 * mass.sum(), rel=1e-13)


def test_a_pore_pressure_ratio_may_change_along_the_flow(load_scene):
    given = [[-18.0, 0.5], [-8.0, 0.5], [-4.0, 1.0]]
    points = material_points(load_scene("case_1", **{"flow.initial_pore_pressure_ratios": given}))
    total = points.pore_pressure - points.effective_stress[:, 1]
    hydrostatic = material_points(load_scene("case_1"))
    np.testing.assert_allclose(total, hydrostatic.pore_pressure - hydrostatic.effective_stress[:, 1], rtol=1e-12)
    x = points.position[:, 0]
    expected = np.clip(0.5 + 0.5 * (x + 8.0) / 4.0, 0.5, 1.0)
    np.testing.assert_allclose(points.pore_pressure, expected * total, atol=1e-9)
    assert (x < -18.0).any()  # the tail goes on beyond the table
    one = material_points(load_scene("case_1", **{"flow.initial_pore_pressure_ratio": 0.7}))
    flat = material_points(load_scene("case_1", **{"flow.initial_pore_pressure_ratios": [[-9.0, 0.7], [0.0, 0.7]]}))
    assert (one.pore_pressure == flat.pore_pressure).all()


FRONT = {"initial_pore_pressure_ratios": [[-9, 0.5], [0, 1]]}

NO_START = {
    "beyond 1": (
        {"initial_pore_pressure_ratios": [[-9, 0.5], [-3, 1.2]]},
        r"ratios\[1\] has the ratio 1.2; it must be from 0 to 1",
    ),
    "back along x": (
        {"initial_pore_pressure_ratios": [[-9, 0.5], [-9, 1]]},
        r"ratios\[1\] is at x = -9, after -9; x must increase",
    ),
    "one place": ({"initial_pore_pressure_ratios": [[-9, 0.5]]}, "pressure_ratios = .* a list of 2 to 2000 pairs"),
    "two ways": (FRONT | {"initial_pore_pressure_ratio": 0.5}, "at most one of initial_pore_pressure_ratio and"),
    "no weight": (FRONT | {"initial_stress": "zero"}, 'ratios is not allowed with flow.initial_stress = "zero"'),
    "heights": (
        {"velocity_profile": [[0, 0], [0.5, 1], [2, 1]]},
        "velocity_profile has the heights 0, 0.5, 2; they must increase from 0 to 1",
    ),
    "backward": (
        {"velocity_profile": [[0, -0.5], [1, 1]]},
        r"velocity_profile\[0\] has the velocity -0.5; velocities must be at least 0",
    ),
    "nowhere": ({"velocity_profile": [[0, 0], [1, 0]]}, "velocity 0; velocities must be at least 0, and not all 0"),
    "both": (
        {"velocity_profile": [[0, 0], [1, 1]], "velocity_exponent": 2.0},
        "velocity_profile is not allowed with base_velocity_share or",
    ),
    "share": ({"base_velocity_share": 1.5}, "base_velocity_share = 1.5 is not allowed; .* at least 0 and at most 1"),
}


@pytest.mark.parametrize(("changes", "words"), NO_START.values(), ids=NO_START)
def test_what_is_no_start_gets_one_sentence(load_scene, changes, words):
    with pytest.raises(ScenarioError, match=words) as refused:
        load_scene("case_1", **{f"flow.{name}": value for name, value in changes.items()})
    assert len(refused.value.problems) == 1
