"""Voellmy's ground: what a scene may ask of it, and that nothing of it is there where none does."""

import numpy as np
import pytest

from warp_mpm import ScenarioError, Simulation
from warp_mpm.effect_rules import derive_effects, effect_rules
from warp_mpm.simulator.bodies.of_scene import GROUND, ground_body

COARSE = {"numerics.spacing_m": 1.0, "output.end_time_s": 0.1}
PROFILE = {"ground.profile_m": [[-80.0, 8.0], [-30.0, 0.0], [40.0, 0.0]]}


def test_a_scene_without_it_has_nothing_of_it(load_scene):
    plain = Simulation(load_scene("case_1", **COARSE))
    assert not [name for name in plain.arrays if name in ("bodies.turbulence", "contact.length")]
    assert "turbulence" not in plain.effects.module_name


def test_it_is_an_effect_that_can_be_switched(load_scene):
    for xi in (None, 200.0):
        scenario = load_scene("case_1", **COARSE | {"ground.turbulence_m_per_s2": xi})
        rules = {rule.effect: rule for rule in effect_rules(scenario)}
        assert rules["turbulence"].on is (xi is not None)
        assert rules["friction"].on
        switched = derive_effects(scenario.replaced(rules["turbulence"].switched))
        assert switched.turbulence is (xi is None)
    smooth = {"barrier.friction": 0.0, "ground.turbulence_m_per_s2": 200.0}
    rules = {rule.effect: rule for rule in effect_rules(load_scene("case_1", **smooth))}
    assert rules["friction"].on
    assert not derive_effects(load_scene("case_1", **smooth).replaced(rules["friction"].switched)).friction


def test_each_stretch_has_its_own(load_scene):
    """ρ g / ξ, of the ground where a stretch names none."""
    stretches = [{"from_m": -20.0, "friction": 0.1, "turbulence_m_per_s2": 500.0}, {"from_m": 0.0, "friction": 0.2}]
    scenario = load_scene(
        "case_1", **COARSE | PROFILE | {"ground.turbulence_m_per_s2": 200.0, "ground.stretches": stretches}
    )
    weight = scenario.flow.material.density * 9.81
    found = [surface.turbulence for surface in ground_body(scenario.ground, weight).surfaces]
    assert found == pytest.approx([weight / 200.0, weight / 500.0, weight / 200.0])


@pytest.mark.parametrize("changes", [{}, PROFILE])
def test_the_places_stand_for_all_of_the_ground(load_scene, changes):
    """Along the grid and across it: as long as the ground is between the first and the last of them."""
    simulation = Simulation(load_scene("case_1", **COARSE | changes | {"ground.turbulence_m_per_s2": 200.0}))
    (number,) = [k for k, body in enumerate(simulation.bodies) if body.name == GROUND]
    contact = simulation._contact_arrays
    own = contact["body"].numpy() == number
    length, place = contact["length"].numpy()[own], contact["position"].numpy()[own]
    there = length > 0.0
    ends = np.array([place[there, 0].min(), place[there, 0].max()])
    profile = np.array(changes.get("ground.profile_m", [[-1e3, 0.0], [1e3, 0.0]]))
    x = np.unique(np.concatenate([ends, profile[(profile[:, 0] > ends[0]) & (profile[:, 0] < ends[1]), 0]]))
    way = np.hypot(np.diff(x), np.diff(np.interp(x, *profile.T))).sum()
    # The two at the ends reach half of their own beyond.
    assert length.sum() == pytest.approx(way, abs=1.1)


@pytest.mark.parametrize("xi", [0.0, -200.0, 1e9])
def test_its_fields_are_checked(load_scene, xi):
    with pytest.raises(ScenarioError, match=r"ground\.turbulence_m_per_s2"):
        load_scene("case_1", **{"ground.turbulence_m_per_s2": xi})
