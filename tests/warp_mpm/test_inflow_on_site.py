"""Flows that arrive, and deposits, on a ground with a profile and beside several barriers."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from warp_mpm import plotting
from warp_mpm.arrival_figures import arrival_figures
from warp_mpm.barrier_figures import barrier_figures
from warp_mpm.design_checks import verdict
from warp_mpm.discretization import material_points
from warp_mpm.extent import domain_extent
from warp_mpm.scenario import Scenario
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.simulation import Simulation
from warp_mpm.snapshot import Snapshot
from warp_mpm.tables_beside import tables_beside

SCENARIOS = Path(__file__).parents[2] / "scenarios"

PROFILE = [[-60, 16], [-40, 10], [-20, 4], [0, 0], [30, 0], [50, -3]]
"""0.3 steep down to x = -20 m, 0.2 to the toe, level, and 0.15 beyond."""

INFLOW = {"x_m": -30.0, "times_s": [0.0, 4.0], "depths_m": [2.0, 2.0], "velocity_m_per_s": 6.0}
DAM = {
    "name": "second",
    "x_m": 20.0,
    "shape": {"kind": "trapezoid", "base_width_m": 4, "crest_width_m": 1, "height_m": 2},
    "motion": {"kind": "fixed"},
    "friction": 0.3,
}


def scene(**changes):
    """Case 1 without its block and barrier, on the profile, with an inflow."""
    data = json.loads((SCENARIOS / "case_1.json").read_text())
    del data["flow"]["shape"], data["flow"]["velocity_m_per_s"]
    data["flow"]["inflow"] = INFLOW
    data |= {"barrier": None, "ground": {"profile_m": PROFILE, "friction": 0.2}, "domain": {}}
    return Scenario.model_validate(data).replaced({"numerics.spacing_m": 0.5} | changes)


def test_the_section_stands_on_the_profile_wherever_it_is_moved():
    first = scene()
    assert (first.flow.inflow.base, first.flow.inflow.slope) == pytest.approx((7.0, -0.3))
    moved = first.replaced({"flow.inflow.x_m": -10.0})
    assert (moved.flow.inflow.base, moved.flow.inflow.slope) == pytest.approx((2.0, -0.2))
    assert Scenario.model_validate(first.resolved()) == first
    above = first.replaced({"flow.inflow.base_m": 8.0})
    assert (above.flow.inflow.base, above.flow.inflow.slope) == pytest.approx((8.0, -0.3))
    level = first.replaced({"ground": {}})
    assert (level.flow.inflow.base, level.flow.inflow.slope) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"flow.inflow.x_m": -19.0},
            r"flow.inflow.x_m = -19 needs straight ground before it, from x = -21 on \(4 cells\); the profile turns at "
            "x = -20",
        ),
        (
            {"flow.inflow.x_m": 30.0, "ground.profile_m": [[-60, 0], [30, 0], [30, 1], [50, 1]]},
            "flow.inflow.x_m = 30 needs straight ground before it, .* turns at x = 30",
        ),
        ({"flow.inflow.base_m": 6.5}, "flow.inflow.base_m = 6.5 lies below the ground; it must be at least 7, or null"),
        (
            {"flow.inflow.x_m": -61.0},
            "flow.inflow.x_m = -61 lies beyond the ground's profile; it must be from -60 to 50",
        ),
        ({"barriers": [DAM], "flow.inflow.x_m": 21.0}, r"flow.inflow lies inside barriers\[0\] by"),
        (
            {
                "barriers": [DAM],
                "flow.deposits": [{"shape": {"kind": "on_ground", "from_m": 18, "to_m": 21, "depth_m": 1}}],
            },
            r"flow.deposits\[0\] lies inside barriers\[0\] by",
        ),
        (
            {"flow.deposits": [{"shape": {"kind": "polygon", "vertices_m": [[-20, 2], [0, 0], [0, 2]]}}]},
            r"flow.deposits\[0\] reaches y = 2 m at x = -20; it must stay on or above the ground, there y >= 4",
        ),
    ],
)
def test_what_cannot_be_gets_one_sentence(changes, sentence):
    with pytest.raises(ScenarioError, match=sentence) as refused:
        scene(**changes)
    assert len(refused.value.problems) == 1


def test_a_section_may_stand_just_after_a_turn():
    assert scene(**{"flow.inflow.x_m": -18.0}).flow.inflow.slope == pytest.approx(-0.2)
    # A turn of a thousandth of a cell is none.
    bent = [[-60, 16], [-31, 7.3001], [-20, 4], [50, -17]]
    assert scene(**{"ground.profile_m": bent}).flow.inflow.base == pytest.approx(7.0, abs=1e-3)


def test_bodies_have_the_stress_of_their_own_slope():
    """What arrives that of the slope before the section, a deposit along the ground that of its place, and one
    with a level surface that of a pond."""
    scenario = scene(
        **{
            "flow.deposits": [
                {"shape": {"kind": "on_ground", "from_m": -15, "to_m": -5, "depth_m": 1}},
                {"shape": {"kind": "polygon", "vertices_m": [[5, 0], [12, 0], [12, 1.5], [5, 1.5]]}},
            ],
            "flow.lateral_stress_coefficient": 1.0,
        }
    )
    assert scenario.flow.deposits[0].shape.kind == "polygon"
    assert scenario.flow.deposited_volume == pytest.approx(10.0 + 10.5)
    points = material_points(scenario)
    total = points.effective_stress[:, 1] - points.pore_pressure
    weight = -scenario.flow.material.density * 9.81
    x, y = points.position.T
    for chosen, depth, slope in (
        (points.waits, 7.0 + 2.0 - y, 0.3),
        (~points.waits & (x < 0.0), 1.0 - 0.2 * x - y, 0.2),
        (~points.waits & (x > 0.0), 1.5 - y, 0.0),
    ):
        assert chosen.any()
        np.testing.assert_allclose(total[chosen], (weight * depth / (1.0 + slope**2))[chosen], rtol=1e-9)


def test_what_lay_behind_the_barrier_did_not_go_over_it():
    """Of what is beyond the crest in the end, what the figures, the verdict and the table of barriers count."""
    trapezoid = {"kind": "trapezoid", "base_width_m": 4, "crest_width_m": 1, "height_m": 2}
    barrier = {"shape": trapezoid, "motion": {"kind": "fixed"}, "friction": 0.3}
    deposit = {"shape": {"kind": "on_ground", "from_m": 4, "to_m": 10, "depth_m": 1}}
    behind = scene(barrier=barrier, barriers=[DAM | {"x_m": 14}], design={}, **{"flow.deposits": [deposit]})
    points = material_points(behind)
    x = points.position[:, 0]
    lies = ~points.waits & (x > 2.5)
    lain = float(points.volume @ lies)
    assert lain == pytest.approx(6.0)

    def counted(volume):
        figures = {"overtopped_volume": volume, "left_volume": 0.0, "end_time": 100.0}
        share = {check["name"]: check["value"] for check in verdict(behind, {"time": np.zeros(1)}, figures)["checks"]}
        return arrival_figures(behind, {}, figures)["overtopped_volume"], share

    there, share = counted(lain + 3.0)
    assert there == pytest.approx(3.0)
    left = share["overtopped_volume"] - there  # of the inflow, which is not in the figures above
    assert share["overtopped_share"] == pytest.approx((there + left) / behind.flow.volume)
    assert counted(lain)[0] == counted(float(np.float32(lain)))[0] == counted(0.9 * lain)[0] == 0.0
    assert share["overtopped_volume"] - counted(lain)[1]["overtopped_volume"] == pytest.approx(3.0)

    density = behind.flow.material.solid_partial_density
    start = Snapshot(0.0, 0.0, points.position[lies], {"solid_mass": density * points.volume[lies]})
    place = np.vstack([start.position, [[6.0, 3.0], [30.0, 0.5]]])
    ended = Snapshot(1.0, 0.0, place, {"solid_mass": density * np.append(points.volume[lies], [2.0, 1.0])})
    first, second = barrier_figures(behind, {"time": np.array([0.0, 1.0])}, [start, ended])["barriers"]
    assert (first["passed_volume"], second["passed_volume"]) == (pytest.approx(3.0), pytest.approx(1.0))
    assert second["held_volume"] == pytest.approx(lain + 2.0)

    before = scene(barrier=barrier, **{"flow.deposits": [{"shape": deposit["shape"] | {"from_m": -10, "to_m": -2}}]})
    assert arrival_figures(before, {}, {"overtopped_volume": 3.0})["overtopped_volume"] == 3.0


def test_a_fitted_domain_holds_the_approach():
    edges = domain_extent(scene()).edges
    assert (edges.left, edges.right) == pytest.approx((-32.0, 50.0))
    assert edges.top > 9.6 > 0.0 > edges.bottom  # 7 m, 0.6 m of slope and 2 m of depth
    assert domain_extent(scene(barriers=[DAM], ground={})).edges.left == pytest.approx(-32.0)


def test_both_tables_lie_beside_a_scene():
    content = json.loads((SCENARIOS / "site_channel.json").read_text())
    assert [table.name for table in tables_beside(content, SCENARIOS)] == ["site_channel.csv", "site_channel_surge.csv"]
    scenario = Scenario.load(SCENARIOS / "site_channel.json")
    assert scenario.ground.profile[0].tolist() == pytest.approx([-90.0, 1262.0 - 1238.63])
    assert scenario.flow.inflow.base == pytest.approx(1245.99 - 1238.63)


def test_a_scene_with_both_is_drawn():
    figure = plotting.scene(Scenario.load(SCENARIOS / "site_channel.json"), domain=True)
    words = " ".join(text.get_text() for text in figure.axes[0].texts)
    assert "arrives from t = 0 to 6.5 s" in words
    assert "deposit, 0.6 m" in words
    for panel in figure.axes:
        # Deposit, stream and barrier.
        assert len([patch for patch in panel.patches if len(patch.get_xy()) >= 4]) >= 3
        section = [line for line in panel.lines if set(line.get_xdata()) == {-50.0}]
        assert [list(line.get_ydata()) for line in section] == [pytest.approx([7.36, 9.56])]


@pytest.mark.slow
def test_a_dry_stream_comes_down_a_profile_as_under_tilted_gravity():
    """8°, with that much friction: the flow goes on as it comes. Found were 0.8 % less depth, 0.2 % more speed and a
    front 1.0 % behind, with four cells in the depth."""
    data = json.loads((SCENARIOS / "case_1_dry.json").read_text())
    del data["flow"]["shape"], data["flow"]["velocity_m_per_s"]
    data |= {"barrier": None, "domain": {}}
    data["numerics"]["spacing_m"], data["output"]["end_time_s"] = 0.5, 2.0
    angle = math.radians(8.0)
    c, s, fall = math.cos(angle), math.sin(angle), math.tan(angle)
    found = []
    for turned in (False, True):
        k = c if turned else 1.0
        inflow = {"x_m": -60.0 * k, "times_s": [0.0, 10.0], "depths_m": [2.0 / k] * 2, "velocity_m_per_s": 12.0 * k}
        ground = {"friction": fall}
        if turned:
            ground["profile_m"] = [[-80.0, 80.0 * fall], [20.0, -20.0 * fall]]
        whole = data | {"ground": ground, "gravity": {"tilt_deg": 0.0 if turned else 8.0}}
        whole["flow"] = data["flow"] | {"inflow": inflow}
        simulation = Simulation(Scenario.model_validate(whole))
        simulation.advance(2.0)
        points = simulation.points()
        (x, y), (u, v) = points["position"].T, points["solid_velocity"].T
        if turned:
            x, u = x * c - y * s, u * c - v * s
        inside = (x > -60.0) & (x < -44.0)
        front = float(np.quantile(x, 0.99)) + 60.0
        found.append((points["volume"][inside].sum() / 16.0, u[inside].mean(), front))
        sample = simulation.sample()
        arrived = sample["inflow_mass"] / (simulation.scenario.flow.material.density * 2.0 * 12.0 * 2.0)
        assert arrived == pytest.approx(1.0, abs=0.01)
        # The residual holds only if the ground's forces, the section's thrust and gravity are all accounted for.
        scale = abs(sample["momentum_x"])
        assert max(abs(sample["momentum_residual_x"]), abs(sample["momentum_residual_y"])) < 1e-12 * scale
    (depth, speed, front), (depth_p, speed_p, front_p) = found
    assert depth_p == pytest.approx(depth, rel=0.015)
    assert speed_p == pytest.approx(speed, rel=0.005)
    assert front_p == pytest.approx(front, rel=0.015)
