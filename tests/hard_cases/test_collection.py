"""The collection of hard scenes: a dozen of the worst by default, all of them, at half the time step too, when slow."""

import math
from pathlib import Path

import numpy as np
import pytest

from warp_mpm.hard_cases.collection import LARGE, hard_cases
from warp_mpm.hard_cases.criteria import CRITERIA
from warp_mpm.hard_cases.measure import energy_within_cells, measure
from warp_mpm.hard_cases.safeguards import KNOWN_FAILURES
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.snapshot import snapshot_of

SCENARIOS = Path(__file__).parents[2] / "scenarios"

WORST = (
    "barrier_leaves",
    "barrier_light",
    "bulk_modulus_2e9",
    "conductivity_1e-9",
    "courant_0.99",
    "friction_angle_0",
    "mu_i_constant_0",
    "mud_exponent_0.2",
    "odd_spacing",
    "one_point",
    "porosity_0.05",
    "speed_50",
    "thin_flow",
    "young_modulus_1e5",
)


def failed(case, measured):
    """What a case does not meet; no known shortfall is much worse than it was."""
    assert measured.problem is None, measured.problem
    unmet = {criterion.figure: value for criterion, value in measured.failures(case.scenario)}
    known = KNOWN_FAILURES.get(case.name, {})
    assert all(value <= 1.5 * known.get(figure, math.inf) for figure, value in unmet.items()), unmet
    return unmet


@pytest.mark.parametrize("name", WORST)
def test_the_worst(name):
    (case,) = hard_cases([name])
    unmet = failed(case, measure(case.scenario))
    assert unmet.keys() <= KNOWN_FAILURES.get(name, {}).keys(), unmet


@pytest.mark.slow
@pytest.mark.parametrize("case", hard_cases(), ids=lambda case: case.name)
def test_all_at_half_the_time_step_too(case):
    unmet = failed(case, measure(case.scenario, halve=case.name not in LARGE))
    assert unmet.keys() == KNOWN_FAILURES.get(case.name, {}).keys(), unmet


def test_every_case_says_why_it_is_hard():
    cases = hard_cases()
    assert len(cases) > 50
    assert all(20 < len(case.reason) < 140 and case.reason.endswith(".") for case in cases)
    assert len({case.scenario.title for case in cases}) == len(cases)
    assert KNOWN_FAILURES.keys() <= {case.name for case in cases}


def test_criteria_catch_what_they_name():
    """A run that is spoilt on purpose fails by the figure that belongs to it."""
    (case,) = hard_cases(["one_point"])
    good = measure(case.scenario)
    for criterion in CRITERIA:
        if criterion.figure in good.figures:
            for bad in (criterion.limit_for(case.scenario) * 1.01 + 1e-6, float("nan"), float("inf")):
                spoilt = type(good)(good.figures | {criterion.figure: bad})
                assert [found.figure for found, _ in spoilt.failures(case.scenario)] == [criterion.figure]


def test_energy_of_what_moves_within_a_cell_is_there_at_the_start():
    """A block sheared alike all over: M γ̇² d² / 8 beside that of its points' velocities, which comes to them as they
    part, and is no energy that the code has made."""
    block = {"kind": "polygon", "vertices_m": [[-20, 0], [-10, 0], [-10, 3], [-20, 3]]}
    changes = {"flow.shape": block, "flow.base_velocity_share": 0.1, "flow.velocity_exponent": 1.0}
    simulation = Simulation(Scenario.load(SCENARIOS / "case_1_dry.json").replaced(changes))
    begin, spacing = snapshot_of(simulation), simulation.grid.spacing
    rate, _ = np.polyfit(begin.position[:, 1], begin["solid_velocity"][:, 0], 1)
    all_over = begin["solid_mass"].sum() * rate**2 * spacing**2 / 8.0
    # Points at its edges see less.
    assert 0.9 * all_over < energy_within_cells(simulation, begin) < all_over
