"""Only what a scene calls for: kernels launched, arrays held and code generated, seen from outside, in every shipped
scene; and an effect without influence is the same as none."""

import re
import tempfile
from functools import cache
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import warp as wp

from warp_mpm.effect_rules import effect_rules, with_law
from warp_mpm.kernels.build import build_kernels
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation, derive_effects
from warp_mpm.time_step import step_limits

SCENES = Path(__file__).parents[2] / "scenarios"
SHIPPED = sorted(path.stem for path in SCENES.glob("*.json") if not path.stem.startswith("site_"))

LIKE = ("case_1", "set_iib", "set_iib_fixed")
"""Shipped scenes of these names alone, and the variants of case 1: the others have the effects of one of them, which
`test_every_rule_names_an_effect_and_gives_a_reason` looks at in all."""

LAW_ALONE = "case_1_mu_i"
"""Has but for its law the effects of case 1; a run by that law is in tests/hard_cases/test_collection.py."""

TRANSPORT = ["clear", "forget", "scatter", "move"]
CONTACT = ["press", "join"]

POINT_NUMBERS = {
    "dry": {"position": 2, "velocity": 2, "stress": 4, "reference_volume": 1, "volume": 1, "deviatoric_strain": 1,
            "gradient": 4, "affine_x": 2, "affine_y": 2, "advection": 2, "solid_gap": 1, "viscous_pressure": 1,
            "crowding": 1, "smooth": 2},
}  # fmt: skip
POINT_NUMBERS["undrained"] = POINT_NUMBERS["dry"] | {"liquid_strain": 1, "pressure_residual": 1, "smooth": 4}
POINT_NUMBERS["two_phase"] = POINT_NUMBERS["undrained"] | {
    "velocity": 4, "affine_x": 4, "affine_y": 4, "smooth": 5,
}  # fmt: skip
"""Floating-point numbers that a material point holds, by formulation."""

NODE_NUMBERS = {"dry": 1 + 6 + 2 + 2, "undrained": 1 + 6 + 4 + 2 + 2, "two_phase": 1 + 12 + 5 + 2 + 2}
"""And a node: mass, velocity, force and gain, corner sums, corner room (twice); friction needs to know what a liquid
would do alone."""

LIQUID_WORDS = ("liquid", "pore", "pressure_residual", "drag", "surrounded", "cavitation", "relaxation")


@pytest.fixture
def watched(monkeypatch):
    """Names of the kernels launched, and the arrays allocated, noted at Warp's own door."""
    noted = {"launched": [], "allocated": []}
    launch, zeros = wp.launch, wp.zeros

    def noting_launch(kernel, *arguments, **named):
        noted["launched"].append(kernel.key.split("__")[-1])
        return launch(kernel, *arguments, **named)

    def noting(make):
        def made(*arguments, **named):
            result = make(*arguments, **named)
            if getattr(result, "ptr", None):
                noted["allocated"].append(result)
            return result

        return made

    monkeypatch.setattr(wp, "launch", noting_launch)
    monkeypatch.setattr(wp, "zeros", noting(zeros))
    return noted


@pytest.mark.parametrize(
    "name",
    [
        name
        if name in LIKE or (name.startswith("case_1_") and name != LAW_ALONE)
        else pytest.param(name, marks=pytest.mark.slow)
        for name in SHIPPED
    ],
)
def test_kernels_and_arrays_of_every_shipped_scene(load_scene, watched, name):
    noted = watched
    scenario = load_scene(name, **{"numerics.spacing_m": 0.5, "output.end_time_s": 0.01})
    flow = scenario.flow
    simulation = Simulation(scenario)
    simulation.advance(1e-4)
    # The shipped scenes are plastic, on smooth ground, with smoothing; they differ in flow and barrier.
    points = ["gather", "average", "advect", "update", "bound", "tick"]
    if flow.formulation == "two_phase":
        points = ["seep", *points]
    assert noted["launched"] == ["start", *TRANSPORT, *CONTACT, *points]
    assert simulation.launched_kernels == (*TRANSPORT, *CONTACT, *points)

    arrays, number = simulation.arrays, simulation.material_points
    for field, count in POINT_NUMBERS[flow.formulation].items():
        assert arrays[f"points.{field}"] == 8 * count * number
    # Beside numbers a point holds only whole ones: whether it is inside, and with liquid whether it is surrounded.
    others = {name for name in arrays if name.startswith("points.")}
    others -= {f"points.{field}" for field in POINT_NUMBERS[flow.formulation]}
    assert others <= {"points.inside", "points.surrounded"}
    assert all(arrays[name] == 4 * number for name in others)
    nodes = simulation.grid.columns * simulation.grid.rows
    doubles = sum(size for name, size in arrays.items() if name.startswith("grid.") and size >= 8 * nodes)
    # The drag of each node, where it follows the porosity.
    assert doubles == 8 * nodes * (NODE_NUMBERS[flow.formulation] + simulation.effects.porosity_update)
    # Nothing is allocated that is not listed.
    assert {array.capacity for array in noted["allocated"]} <= set(arrays.values())
    if flow.formulation == "dry":
        assert not [name for name in arrays if any(word in name for word in LIQUID_WORDS)]


def test_memory_is_at_most_600_bytes_a_point(load_scene):
    """At the paper's spacing; the grid, most of which is empty, is another matter and told apart by `plan`."""
    simulation = Simulation(load_scene("case_1"))
    per_point = sum(size for name, size in simulation.arrays.items() if name.startswith("points."))
    assert per_point / simulation.material_points < 600.0


def generated_code(scenario):
    """What Warp generates for the scene's kernels, without the comments that repeat the Python source. It goes no
    further: what a compiler makes of it takes ten seconds for each set of effects, and nobody looks at that here."""
    return _generated_code(derive_effects(scenario))


@cache
def _generated_code(effects):
    build_kernels(effects)
    with tempfile.TemporaryDirectory() as folder, patch("warp._src.build.build_cpu", lambda *given, **options: None):
        wp.compile_aot_module(wp.get_module(effects.module_name), device="cpu", module_dir=folder)
        (source,) = Path(folder).glob("*.cpp")
        text = source.read_text()
    return re.sub(r"^\s*//.*$", "", text, flags=re.MULTILINE)


def test_generated_code_of_a_dry_scene_holds_no_liquid(load_scene):
    changes = {"numerics.spacing_m": 0.5, "output.end_time_s": 0.01}
    dry = generated_code(load_scene("case_1_dry", **changes))
    words = set(re.findall(r"[A-Za-z_]\w*", dry))
    found = {word for word in words if any(part in word for part in LIQUID_WORDS)}
    assert found == set()
    # The same search does find them where there is a liquid.
    wet = generated_code(load_scene("case_1", **changes))
    assert {"liquid_strain", "var_drag", "liquid_bulk_modulus"} & set(re.findall(r"[A-Za-z_]\w*", wet))


def test_generated_code_of_a_fixed_barrier_does_not_slide(load_scene):
    changes = {"numerics.spacing_m": 0.5, "output.end_time_s": 0.01}
    fixed = generated_code(load_scene("case_1_fixed", **changes))
    sliding = generated_code(load_scene("case_1", **changes))
    for field in ("base_friction", "old_velocity", "base_impulse"):
        assert field not in fixed
        assert field in sliding


FRICTION_WORDS = ("friction", "liquid_alone", "rubbed")


def friction_in(scenario):
    """Arrays with their bytes, and kernel parameters, that have to do with the friction of surfaces."""
    simulation = Simulation(scenario)
    fields = simulation._types.Parameters.vars
    arrays = {name: size for name, size in simulation.arrays.items() if any(word in name for word in FRICTION_WORDS)}
    return arrays, {name for name in fields if any(word in name for word in FRICTION_WORDS)}


BASE = {"bodies.base_friction"}
"""That of the barrier's own base on the soil is another."""


@pytest.mark.parametrize(
    "name",
    ["case_1", *(pytest.param(f"case_1_{of}", marks=pytest.mark.slow) for of in ("fixed", "dry", "undrained"))],
)
def test_without_friction_nothing_of_it_is_there(load_scene, name):
    changes = {"numerics.spacing_m": 0.5, "output.end_time_s": 0.01, "barrier.friction": 0.0}
    smooth = load_scene(name, **changes)
    arrays, parameters = friction_in(smooth)
    assert set(arrays) == (BASE if smooth.barrier.motion.kind == "sliding" else set())
    assert parameters == set()
    words = set(re.findall(r"[A-Za-z_]\w*", generated_code(smooth)))
    found = {word.replace("adj_", "var_") for word in words if any(part in word for part in FRICTION_WORDS)}
    # What the barrier's base does.
    assert found <= {"base_friction", "var_base_friction"}
    assert {"contact", "grid", "bodies"} <= {name.partition(".")[0] for name in friction_in(load_scene("case_1"))[0]}


def test_friction_of_the_ground_alone(load_scene):
    changes = {"numerics.spacing_m": 0.5, "ground.friction": 0.3, "barrier.friction": 0.0}
    arrays, _ = friction_in(load_scene("case_1_fixed", **changes))
    assert set(arrays) == {"grid.liquid_alone", "contact.rubbed", "bodies.friction"}
    dry, _ = friction_in(load_scene("case_1_dry", **changes))
    assert set(dry) == {"contact.rubbed", "bodies.friction"} | BASE


def test_next_to_no_friction_on_one_surface_is_none(load_scene):
    scenes = [
        load_scene("case_1", **COARSE | {"barrier.friction": {"face": face, "top": 0.3, "back": 0.3}})
        for face in (0.0, 1e-13)
    ]
    assert_equal_runs(forces_and_positions(scenes[1]), forces_and_positions(scenes[0]), 1e-9)


def test_a_domain_ten_times_as_large_holds_no_more_blocks_in_use(load_scene):
    counts = []
    for scale in (1.0, 10.0):
        changes = {
            "numerics.spacing_m": 0.5, "domain.left_m": -30.0 * scale, "domain.right_m": 30.0 * scale,
            "domain.top_m": 10.0,
        }  # fmt: skip
        simulation = Simulation(load_scene("case_1", **changes))
        simulation.advance(0.2)
        counts.append(int(simulation._grid_arrays["active_count"].numpy()[0]))
    # One column of blocks more where the blocks of the two grids start at different places.
    assert abs(counts[1] - counts[0]) <= 2
    assert counts[0] > 10


def test_every_rule_names_an_effect_and_gives_a_reason():
    for name in SHIPPED:
        scenario = Scenario.load(SCENES / f"{name}.json")
        rules = effect_rules(scenario)
        effects = derive_effects(scenario)
        # A scenario is of the plane; what makes it one of space stands beside it.
        assert {rule.effect for rule in rules} == set(effects.__dataclass_fields__) - {"dimensions"}
        assert all(rule.reason and getattr(effects, rule.effect) == rule.value for rule in rules)
        for rule in rules:
            if rule.switched:
                switched = derive_effects(scenario.replaced(rule.switched))
                assert getattr(switched, rule.effect) != rule.value


def forces_and_positions(scenario, until=1.0):
    simulation = Simulation(scenario)
    forces = []
    for time in 0.05 * np.arange(1, round(until / 0.05) + 1):
        simulation.advance(time)
        forces.append(simulation.sample()["impact_force_x"])
    return np.array(forces), simulation.points()["position"]


def assert_equal_runs(first, second, tolerance):
    peak = np.abs(first[0]).max()
    assert peak > 1e5  # the flow did meet the barrier
    np.testing.assert_allclose(second[0], first[0], atol=tolerance * peak)
    np.testing.assert_allclose(second[1], first[1], atol=tolerance)


COARSE = {"numerics.spacing_m": 0.5, "output.end_time_s": 1.0}
WITHOUT_INFLUENCE = {
    "yield stress far beyond reach": (
        "case_1_fixed",
        {"flow.material.cohesion_Pa": 1e12, "flow.material.tension_cutoff_Pa": 1e12, "barrier.friction": 0.0},
        with_law(Scenario.load(SCENES / "case_1_fixed.json"), "elastic") | {"barrier.friction": 0.0},
        1e-9,
        1.0,
    ),
    "walls and ceiling far away": (
        "case_1",
        {"domain.left_edge": "wall", "domain.right_edge": "wall", "domain.top_edge": "wall"},
        {},
        # Seen from the grid that rides with the barrier they move: all places of contact are then joined, and taken in
        # another order. So differs what the sweeps of a step leave to the next: 0.0015 of the peak.
        3e-3,
        0.35,
    ),
    "ground friction of next to nothing": (
        "case_1_fixed",
        {"barrier.friction": 0.0, "ground.friction": 1e-13},
        {"barrier.friction": 0.0},
        1e-9,
        1.0,
    ),
}


@pytest.mark.parametrize(
    ("name", "present", "absent", "tolerance", "until"),
    [
        # Two sets of kernels that no other test needs; what happens below yield, test_return_mapping.py has too.
        pytest.param(*case, id=name, marks=[pytest.mark.slow] * name.startswith("yield"))
        for name, case in WITHOUT_INFLUENCE.items()
    ],
)
def test_an_effect_without_influence_is_the_same_as_none(load_scene, name, present, absent, tolerance, until):
    scenes = [load_scene(name, **COARSE | changes) for changes in (present, absent)]
    assert derive_effects(scenes[0]) != derive_effects(scenes[1])
    # Other kernels round otherwise; a flow that splashes amplifies that, over a second by some thousand times.
    assert_equal_runs(*(forces_and_positions(scene, until) for scene in scenes), tolerance)


def test_endless_drag_is_undrained(load_scene):
    """Two phases that cannot part are one: the same material, drag some 1e11 times the scene's.

    Of two phases sound runs faster as long as drag is left out of account. What is set as a share of its speed is
    scaled to be the same, and so is the step, by advancing one at a time. The barrier is too heavy to slide: one that
    slides gives way to one phase after the other, and what the sweeps of a step leave to the next differs.
    """
    heavy = COARSE | {"barrier.motion": {"kind": "sliding", "mass_kg_per_m": 1e12, "base_friction": 0.29}}
    one = load_scene("case_1_undrained", **heavy)
    two = load_scene("case_1", **heavy | {"flow.material.hydraulic_conductivity_m_per_s": 1e-15})
    ratio = step_limits(one).sound_speed / step_limits(two).sound_speed
    names = ("bulk_viscosity", "pressure_relaxation")
    scaled = {f"numerics.{name}": getattr(one.numerics, name) * ratio for name in names}
    sound = [step_limits(scenario).sound_speed + one.flow.speed for scenario in (one, two)]
    scaled["numerics.transfer_damping"] = one.numerics.transfer_damping * sound[0] / sound[1]
    runs = []
    for scenario in (one, two.replaced(scaled)):
        simulation, forces, step = Simulation(scenario), [], 1e-3
        for count in range(1, 801):
            simulation.advance(count * step)
            if count % 10 == 0:
                forces.append(simulation.sample()["impact_force_x"])
        assert simulation.steps == 800
        runs.append((np.array(forces), simulation.points()["position"]))
    assert_equal_runs(*runs, 1e-9)
