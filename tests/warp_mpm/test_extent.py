"""The fitted domain: it knows how far and how fast flow and barrier get, and says what it cannot hold."""

import pytest

from warp_mpm.caveats import scene_caveats
from warp_mpm.description import described_domain
from warp_mpm.extent import LARGEST_FITTED_GRID, barrier_travel, domain_extent, heaped_height
from warp_mpm.grid import fit_grid
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation

SOIL = {
    "grain_density_kg_per_m3": 2600, "porosity": 0.5, "liquid_density_kg_per_m3": 1000, "young_modulus_Pa": 2e6,
    "poisson_ratio": 0.25, "friction_angle_deg": 20, "hydraulic_conductivity_m_per_s": 1e-4,
    "liquid_bulk_modulus_Pa": 3e7,
}  # fmt: skip
TRAPEZOID = {"kind": "trapezoid", "base_width_m": 6, "crest_width_m": 2, "height_m": 3}


def block_and_barrier(motion, *, shape=None, block=(-8.0, -0.5, 0.0, 2.0), velocity=(0, 0), end=2.0, **rest):
    """A block of soil upstream of a barrier that is moved."""
    left, right, low, high = block
    outline = {"kind": "polygon", "vertices_m": [[left, low], [right, low], [right, high], [left, high]]}
    scene = {
        "title": "a block and a barrier",
        "flow": {"formulation": "two_phase", "shape": outline, "velocity_m_per_s": velocity, "material": SOIL},
        "barrier": {"shape": shape or {"kind": "wall"}, "motion": motion, "friction": 0.3},
        "numerics": {"spacing_m": 0.25},
        "output": {"end_time_s": end},
    }
    return Scenario.model_validate(scene | rest)


def driven(times, velocities):
    return {"kind": "prescribed", "times_s": times, "velocities_m_per_s": velocities}


NOTHING_LEAVES = {
    "wall rammed into the flow": block_and_barrier(
        driven([0, 0.3, 0.31], [-20, -20, 0]), domain={"left_edge": "wall", "left_m": -30}
    ),
    "embankment rammed into the flow": block_and_barrier(driven([0, 0.5, 0.51], [-15, -15, 0]), shape=TRAPEZOID),
    "embankment drawn away from a flow at rest": block_and_barrier(
        driven([0], [10]), shape=TRAPEZOID, end=5.0, ground={"friction": 0.6}
    ),
    "wall drawn away, a wall at the edge stays": block_and_barrier(
        driven([0], [10]), end=3.0, domain={"left_edge": "wall", "left_m": -9}
    ),
    "press that closes slowly": block_and_barrier(
        driven([0], [-1]), end=6.0, domain={"left_edge": "wall", "left_m": -8}
    ),
    "press without a ground": block_and_barrier(driven([0, 0.3, 0.31], [-5, -5, 0]), end=1.0, ground=None),
    "light barrier thrown ahead of a tail at rest": block_and_barrier(
        {"kind": "sliding", "mass_kg_per_m": 300, "base_friction": 0.01},
        shape=TRAPEZOID, velocity=(8, 0), end=6.0, ground={"friction": 0.8},
    ),
    "block that falls 18 m": block_and_barrier(
        {"kind": "fixed"}, shape=TRAPEZOID, block=(-6.0, -2.0, 18.0, 20.0), end=4.0
    ),
}  # fmt: skip


@pytest.mark.parametrize("scenario", NOTHING_LEAVES.values(), ids=NOTHING_LEAVES)
def test_nothing_leaves_a_fitted_domain(scenario):
    simulation = Simulation(scenario)
    simulation.advance(scenario.output.end_time_s)
    # A drop or two may be thrown higher than a flow without loss could rise.
    assert simulation.record["points_left"] <= 2
    assert not [note for note in scene_caveats(scenario) if "domain" in note]


@pytest.mark.parametrize(
    ("name", "left", "cells"),
    [
        ("case_1", -108.8, (1360, 200)),
        ("case_5", -108.8, (1312, 192)),
        ("set_iib", -108.8, (1896, 512)),
        ("set_iii_fixed", -138.8, (1768, 200)),
    ],
)
def test_grids_of_the_papers_scenes(load_scene, name, left, cells):
    """Another grid rounds otherwise, which a flow that splashes amplifies: the shipped scenes keep theirs."""
    grid = fit_grid(load_scene(name))
    assert grid.left == pytest.approx(left)
    assert (grid.columns, grid.rows) == cells


def test_the_way_of_a_driven_barrier():
    # Up to 3 m/s at 1 s, back through rest at 2 s, -3 m/s at 3 s: 3 m downstream; at -3 m/s to the end: 4.5 m upstream.
    travel = barrier_travel(block_and_barrier(driven([0, 1, 3], [0, 3, -3]), end=5.0))
    assert travel.downstream == pytest.approx(3.0)
    assert travel.upstream == pytest.approx(4.5)
    assert travel.speed == pytest.approx(3.0)
    # What lies beyond the end of the run does not count.
    assert barrier_travel(block_and_barrier(driven([3, 3.1], [0, -50]), end=2.0)).speed == 0.0


def test_a_barrier_on_a_slope_that_falls_upstream():
    motion = {"kind": "sliding", "mass_kg_per_m": 5e4, "base_friction": 0.3}
    # g (sin 30° - 0.3 cos 30°) = 2.356 m/s²
    travel = barrier_travel(block_and_barrier(motion, shape=TRAPEZOID, end=2.0, gravity={"tilt_deg": -30}))
    assert travel.upstream == pytest.approx(0.5 * 2.3563 * 2.0**2, rel=1e-4)
    assert travel.speed == pytest.approx(2.3563 * 2.0, rel=1e-4)
    assert barrier_travel(block_and_barrier(motion, shape=TRAPEZOID, gravity={"tilt_deg": -10})).upstream == 0.0


def test_a_press_heaps_the_flow_up():
    # 15 m³/m between the wall at -8 m and the barrier's face at -7 m.
    scenario = block_and_barrier(driven([0], [-1]), end=7.0, domain={"left_edge": "wall", "left_m": -8})
    assert heaped_height(scenario) == pytest.approx(15.0)
    assert domain_extent(scenario).edges.top > 15.0


def test_notes_on_a_domain_that_cannot_hold_the_flow():
    closed = block_and_barrier(driven([0], [-1]), end=9.0, domain={"left_edge": "wall", "left_m": -8})
    assert any("no room left" in note for note in scene_caveats(closed))
    riding = block_and_barrier(driven([0], [10]), domain={"left_m": -12})
    assert any("rides with the barrier, by 20 m" in note and "x = 8 m" in note for note in scene_caveats(riding))
    low = block_and_barrier(driven([0], [-1]), end=7.0, domain={"left_edge": "wall", "left_m": -8, "top_m": 5})
    assert any("heaps the flow up to 15 m or higher" in note for note in scene_caveats(low))


@pytest.mark.parametrize("velocity", [-20.0, -1e4])
def test_a_grid_that_would_be_too_large(velocity):
    scenario = block_and_barrier(driven([0, 0.3, 0.31], [velocity, velocity, 0]), numerics={"spacing_m": 0.02})
    notes = [note for note in scene_caveats(scenario) if "nodes at numerics.spacing_m = 0.02" in note]
    assert len(notes) == 1
    grid, extent = fit_grid(scenario), domain_extent(scenario)
    assert f"ends at x = {extent.edges.left:.3g}" in notes[0]
    assert grid.columns * grid.rows < 4 * LARGEST_FITTED_GRID  # 121 MB each


def test_the_card_tells_the_domain():
    words = described_domain(NOTHING_LEAVES["wall rammed into the flow"])
    # 2 sqrt(20² + 2 g 2 m)
    assert "x = -30 to 2 m" in words
    assert "riding with the barrier; fitted to speeds up to 41.9 m/s" in words
    assert "fitted" not in described_domain(
        block_and_barrier({"kind": "fixed"}, domain={"left_m": -9, "right_m": 9, "top_m": 9})
    )
