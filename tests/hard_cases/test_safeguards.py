"""Each safeguard switched off, and the scene that then fails. One that nothing needs would be removed.

Off is next to nothing of it, where that does: kernels are compiled for each set of effects, and an effect of next to
nothing leaves the set as it is. Those that take longest are run with `slow`; test_collection.py holds the scenes with
all safeguards on by default.
"""

import numpy as np
import pytest

from warp_mpm.effect_rules import with_law
from warp_mpm.hard_cases.collection import hard_cases
from warp_mpm.hard_cases.measure import measure
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.time_step import step_limits
from warp_mpm.validation.jets import jet_forces

NEXT_TO_NOTHING = 1e-9


def scene(name, changes=None):
    (case,) = hard_cases([name])
    return case.scenario.replaced(changes or {})


@pytest.mark.slow
def test_volumetric_smoothing():
    """Without it the stiffest liquid locks: pressures differ within a cell by nearly half of what they are."""
    with_it = measure(scene("bulk_modulus_2e9")).figures["pressure_noise"]
    without = measure(scene("bulk_modulus_2e9", {"numerics.volumetric_smoothing": False})).figures["pressure_noise"]
    assert with_it < 0.32
    assert without > 0.45


def test_pressure_relaxation():
    with_it = measure(scene("face_90")).figures["pressure_noise"]
    without = measure(scene("face_90", {"numerics.pressure_relaxation": NEXT_TO_NOTHING})).figures["pressure_noise"]
    assert with_it < 0.08
    assert without > 1.5 * with_it


def landed(without_bound):
    """Mean pore pressure [Pa] of Set IIb after the jet has landed, and share of the points whose liquid has a gap.

    The relaxation, which asks for the same room, is off in both, so that the bound alone tells.
    """
    simulation = Simulation(scene("set_iib", {"numerics.pressure_relaxation": NEXT_TO_NOTHING}))
    if without_bound:
        for name in ("corner_room", "corner_space"):
            simulation._grid_arrays[name].zero_()  # as if no neighbour took any room
    simulation.advance(6.0)
    gaps = simulation._point_arrays["liquid_strain"].numpy() > 0.0
    return simulation.points()["pore_pressure"].mean(), gaps.mean()


@pytest.mark.slow
def test_bound_on_gaps():
    """Without it points that have flown remember more void than there is, and the deposit bears no pore pressure."""
    pressure, gaps = landed(without_bound=False)
    pressure_without, gaps_without = landed(without_bound=True)
    assert gaps < 0.7
    assert gaps_without > 0.8
    assert pressure > 1.5 * pressure_without


def momentum_missing(density_correction):
    """Share of a jet's vertical momentum that is missing where an upright wall turns it."""
    time, _, upward = jet_forces(90.0, 0.2, density_correction=density_correction)
    return 1.0 - upward[(time > 6.0) & (time <= 12.0)].mean()


def test_density_correction():
    """Without it points crowd in the corner, and the layer along the wall leaves more slowly than the jet."""
    assert momentum_missing(NEXT_TO_NOTHING) > 0.07
    assert momentum_missing(1.0) < 0.05


class SoftGrains(Simulation):
    """Grains of no volume: the law of the skeleton acts on whatever is left of a point."""

    def __init__(self, scenario):
        super().__init__(scenario)
        self._parameters.grain_share = 0.0


def test_grains_keep_their_volume():
    """Without it a soft skeleton collapses under an impact to a millionth of its volume, at 1e11 Pa."""
    case = scene("dry_soft_45")
    assert measure(case).failures(case) == []
    without = measure(case, make_simulation=SoftGrains)
    assert "stress_ratio" in [criterion.figure for criterion, _ in without.failures(case)]
    assert without.figures["stress_ratio"] > 1e3


@pytest.mark.slow
def test_cavitation():
    """A liquid that bears any tension holds spray together by its noise."""
    held = scene("speed_50", {"flow.material.cavitation_pressure_Pa": 1e12})
    let_go = measure(scene("speed_50")).figures["pressure_noise"]
    assert let_go < 0.05
    assert measure(held).figures["pressure_noise"] > 3.0 * let_go


def test_the_tension_cut_off_is_no_safeguard():
    """It is a property of the material: without it, cohesive flows are as stable."""
    for name in ("cohesion_100kPa", "cohesion_friction_0"):
        case = scene(name, {"flow.material.tension_cutoff_Pa": 1e12})
        assert measure(case).failures(case) == []


def overshoot(bulk_viscosity):
    """Greatest pressure behind the front of sound in a column stopped at its base, over the pressure on the plateau.

    Undrained and elastic between smooth walls: wave theory has one step of pressure that travels up the column.
    """
    data = scene("undrained_20").resolved()
    height, speed = 8.0, 0.1
    outline = [[-0.4, 0.0], [0.0, 0.0], [0.0, height], [-0.4, height]]
    data["flow"] |= {
        "shape": {"kind": "polygon", "vertices_m": outline},
        "velocity_m_per_s": [0.0, -speed],
        "initial_stress": "zero",
        "lateral_stress_coefficient": None,
    }
    data |= {
        "barrier": None,
        "gravity": {"acceleration_m_per_s2": 0.0},
        "domain": {"left_edge": "wall", "right_edge": "wall", "left_m": -0.4, "right_m": 0.0},
    }
    data["numerics"] |= {"spacing_m": 0.1, "bulk_viscosity": bulk_viscosity}
    scenario = Scenario.model_validate(data)
    scenario = scenario.replaced(with_law(scenario, "elastic"))
    simulation = Simulation(scenario)
    simulation.advance(0.6 * height / step_limits(scenario).sound_speed)
    points = simulation.points()
    # The plateau near the base, where the front passed long ago.
    plateau = points["pore_pressure"][points["position"][:, 1] < 0.2 * height].mean()
    return points["pore_pressure"].max() / plateau - 1.0


@pytest.mark.slow
def test_bulk_viscosity():
    assert overshoot(0.2) < 0.10
    assert overshoot(NEXT_TO_NOTHING) > 0.15


class ExplicitDrag(Simulation):
    """Explicit drag at the time step of the implicit one."""

    def __init__(self, scenario):
        super().__init__(scenario)
        self._parameters.largest_stable_step = np.inf


def test_implicit_drag():
    assert measure(scene("conductivity_1e-9")).problem is None
    explicit = scene("conductivity_1e-9", {"numerics.drag": "explicit", "barrier": None, "ground": None})
    assert "diverged" in measure(explicit, make_simulation=ExplicitDrag).problem
    limits = step_limits(explicit)
    assert explicit.numerics.spacing_m / limits.wave_speed > 1e4 * limits.drag_step


def test_implicit_barrier():
    """A light barrier in front of a flow at rest: moved by the force of a step in which it stood, it is shot off."""
    interval = 0.001  # one step
    motion = {"kind": "sliding", "mass_kg_per_m": 1.0, "base_friction": 0.0}
    together = Simulation(scene("resting", {"barrier.motion": motion}))
    together.advance(interval)
    still = Simulation(scene("resting", {"barrier.motion": {"kind": "fixed"}}))
    still.advance(interval)
    forces = still.sample()
    pushed = (forces["impact_force_x"] + forces["top_force_x"] + forces["back_force_x"]) * interval / 1.0
    assert 0.0 < together.barrier_velocity < 0.5
    assert pushed > 50.0


def test_a_lone_barrier_mass_of_any_size_converges():
    """The iteration that finds the barrier's velocity never ends without its answer."""
    for name in ("barrier_light", "barrier_heavy", "friction_1"):
        simulation = Simulation(scene(name))
        simulation.advance(1.0)
        assert simulation.record["barrier_unconverged"] == 0
