"""The scenario format: what it accepts, what it refuses and in which words."""

import json
import math
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warp_mpm.scenario import Fixed, Scenario, Trapezoid, json_schema
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.time_step import step_limits

SCENES = Path(__file__).parents[2] / "scenarios"
NAMES = sorted(path.stem for path in SCENES.glob("*.json"))


def scene(name):
    return Scenario.load(SCENES / f"{name}.json")


@pytest.fixture
def case_1():
    return scene("case_1")


def test_a_scenario_is_refused_in_one_way_however_it_is_made(tmp_path, case_1):
    content = case_1.resolved()
    content["gravity"]["tilt_degg"] = 5.0
    content["flow"]["material"]["porosity"] = 1.4
    (tmp_path / "scene.json").write_text(json.dumps(content))
    makers = {
        "": [
            lambda: Scenario(**content),
            lambda: Scenario.model_validate(content),
            lambda: Scenario.model_validate_json(json.dumps(content)),
        ],
        f"{tmp_path / 'scene.json'}: ": [lambda: Scenario.load(tmp_path / "scene.json")],
    }
    for prefix, ways in makers.items():
        for make in ways:
            with pytest.raises(ScenarioError) as refusal:
                make()
            assert str(refusal.value).splitlines() == [
                f"{prefix}gravity.tilt_degg is not a field of a scenario; did you mean tilt_deg?",
                f"{prefix}flow.material.porosity = 1.4 is not allowed; it must be a finite number greater than 0 and "
                "less than 1.",
            ]
    with pytest.raises(ScenarioError, match="at least three of base_width_m"):
        Trapezoid(kind="trapezoid", height_m=3.0)
    assert Scenario(**case_1.resolved()) == case_1
    assert Scenario(**{name: getattr(case_1, name) for name in Scenario.model_fields}) == case_1


def test_all_scenes_of_the_paper_are_there():
    cases = {f"case_{i}" for i in range(1, 7)} | {"case_1_fixed", "case_1_dry", "case_1_undrained"}
    sets = {f"set_{name}" for name in ("i", "iia", "iib", "iii", "iv", "v")}
    assert cases | sets | {f"{name}_fixed" for name in sets} <= set(NAMES)


@pytest.fixture(scope="module")
def satisfies_the_schema():
    schema = json.loads(json_schema())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema).validate


@pytest.mark.parametrize("name", NAMES)
def test_scene_resolves_to_itself_and_satisfies_the_schema(name, satisfies_the_schema):
    scenario = scene(name)
    assert Scenario.model_validate(json.loads(json.dumps(scenario.resolved()))) == scenario
    satisfies_the_schema(json.loads((SCENES / f"{name}.json").read_text()))
    satisfies_the_schema(scenario.resolved())
    assert scenario.title
    assert ("Synthetic" if name.startswith("site_") else "Table") in scenario.source


# Table 2: L_m, i, h, V_1, v_0, β, d, L_2, B, b, H. The wall of case 5 has no measures.
TABLE_2 = {
    "case_1": (15, 3, 3, 45, 10, 60, 3, 6.95, 11, 4, 6),
    "case_2": (15, 3, 3, 45, 20, 60, 3, 6.95, 11, 4, 6),
    "case_3": (15, 3, 3, 45, 10, 80, 3, 6.08, 8.5, 6.5, 6),
    "case_4": (15, 3, 3, 45, 10, 72, 3, 7.87, 8.38, 3.63, 7.5),
    "case_5": (15, 3, 3, 45, 10, 90, 3, None, None, None, None),
    "case_6": (45, 43, 1, 45, 10, 60, 3, 6.95, 11, 4, 6),
}


@pytest.mark.parametrize("name", TABLE_2)
def test_table_2(name):
    length, squares, depth, volume, speed, angle, distance, face, base, crest, height = TABLE_2[name]
    scenario = scene(name)
    flow, barrier = scenario.flow, scenario.barrier
    assert flow.volume == pytest.approx(volume, rel=1e-12)
    assert flow.equivalent_length == pytest.approx(length, rel=1e-12)
    assert (flow.shape.squares, flow.depth, flow.velocity_m_per_s, flow.shape.distance_m) == (
        squares,
        depth,
        (speed, 0),
        distance,
    )
    x = flow.polygon[:, 0]
    assert x.max() == -distance
    assert x.max() - x.min() == pytest.approx((4 + squares) * depth, rel=1e-12)  # L_1
    if base is None:
        assert isinstance(barrier.motion, Fixed)
        return
    assert barrier.shape.base_crest_height == (base, crest, height)
    assert barrier.shape.built_face_angle_deg == pytest.approx(angle, abs=1.0)
    toe, upstream_crest = barrier.shape.polygon[:2]
    assert math.dist(toe, upstream_crest) == pytest.approx(face, abs=0.006)  # printed with two decimals
    # 45 m² of embankment at 2000 kg/m³; the widths of case 4, printed with two decimals, make 45.04 m².
    assert barrier.mass == pytest.approx(90_000, rel=1e-12 if name != "case_4" else 1e-3)


@pytest.mark.parametrize(
    ("name", "density"),
    [("case_1", 1800.0), ("case_1_undrained", 1800.0), ("case_1_dry", 1300.0), ("set_i", 0.7 * 2600 + 300)],
)
def test_table_1_densities(name, density):
    material = scene(name).flow.material
    assert material.density == pytest.approx(density, rel=1e-14)
    assert (
        material.solid_partial_density == (1 - material.porosity) * 2600
    )  # Table 1's 1300 is this partial density at n = 0.5


def test_table_1_material(case_1):
    material = case_1.flow.material
    assert (material.young_modulus_Pa, material.poisson_ratio) == (2e6, 0.25)
    assert (material.friction_angle_deg, material.cohesion_Pa, material.dilatancy_angle_deg) == (20, 0, 0)
    assert (material.liquid_bulk_modulus_Pa, material.hydraulic_conductivity) == (3e7, 1e-4)
    assert case_1.flow.lateral_stress_ratio == 0.66
    assert case_1.barrier.friction.face == 0.29
    assert case_1.barrier.motion.base_friction_coefficient == 0.29
    assert material.oedometric_modulus == pytest.approx(1.2 * 2e6, rel=1e-14)


# Table 3 (Froude numbers), with case 6 as corrected in its file's notes: 10 m/s at 1 m depth.
@pytest.mark.parametrize(
    ("name", "froude"), [("case_1", 1.84), ("case_2", 3.69), ("case_3", 1.84), ("case_4", 1.84), ("case_6", 3.19)]
)
def test_table_3(name, froude):
    flow = scene(name).flow
    assert flow.speed / math.sqrt(9.81 * flow.depth) == pytest.approx(froude, abs=0.006)


# Table 4: n, h, V_1, v_0, m2/m1, β. Set V's ratio is the one of its own volume (see the file's notes).
TABLE_4 = {
    "set_i": (0.3, 3, 45, 10, 0.94, 60),
    "set_iia": (0.5, 3, 45, 15, 1.11, 60),
    "set_iib": (0.5, 3, 45, 20, 1.11, 60),
    "set_iii": (0.5, 3, 63, 10, 0.79, 60),
    "set_iv": (0.5, 3, 45, 10, 1.11, 80),
    "set_v": (0.5, 4, 48, 10, 1.04, 60),
}


@pytest.mark.parametrize("name", TABLE_4)
def test_table_4(name):
    porosity, depth, volume, speed, ratio, angle = TABLE_4[name]
    scenario, fixed = scene(name), scene(f"{name}_fixed")
    flow = scenario.flow
    assert fixed.flow == flow
    assert isinstance(fixed.barrier.motion, Fixed)
    assert fixed.barrier.shape == scenario.barrier.shape
    assert (flow.material.porosity, flow.depth, flow.speed) == (porosity, depth, speed)
    assert flow.volume == pytest.approx(volume, rel=1e-12)
    assert scenario.barrier.mass / (flow.volume * flow.material.density) == pytest.approx(ratio, abs=0.006)
    assert scenario.barrier.shape.face_angle_deg == angle


@pytest.mark.parametrize(
    ("path", "value", "sentence"),
    [
        ("flow.material.porosity", 0, "flow.material.porosity = 0 is not allowed; it must be a finite number greater"),
        ("flow.material.porosity", 1, "greater than 0 and less than 1"),
        ("flow.material.porosity", "0.5", 'porosity = "0.5" is not allowed'),
        ("flow.material.porosity", True, "porosity = true is not allowed"),
        ("flow.material.porosity", float("nan"), "porosity = NaN is not allowed"),
        ("flow.material.young_modulus_Pa", float("inf"), "young_modulus_Pa = Infinity is not allowed"),
        ("flow.material.porosty", 0.5, "flow.material.porosty is not a field of a scenario"),
        ("flow.material.porosty", 0.5, "did you mean porosity?"),
        (
            "flow.formulation",
            "dry",
            'liquid_density_kg_per_m3 is not a field of a scenario, where formulation is "dry"',
        ),
        ("flow.formulation", "wet", 'flow.formulation = "wet" is not allowed; it must be one of "two_phase"'),
        ("flow.shape.kind", "box", 'flow.shape.kind = "box" is not allowed'),
        ("flow.shape.squares", -1, "flow.shape.squares = -1 is not allowed; it must be a whole number at least 0"),
        ("flow.shape.distance_m", -1, "flow.shape.distance_m = -1 is not allowed"),
        (
            "flow.velocity_m_per_s",
            [1],
            "flow.velocity_m_per_s = [1] is not allowed; it must be a list of 2 numbers: velocity [x, y]",
        ),
        ("flow.material.dilatancy_angle_deg", 30, "dilatancy_angle_deg = 30 must not exceed friction_angle_deg = 20"),
        ("flow.material.intrinsic_permeability_m2", 1e-11, "exactly one of hydraulic_conductivity_m_per_s"),
        ("barrier.shape.face_angle_deg", 91, "must be a finite number greater than 0 and at most 90"),
        ("barrier.shape.face_angle_deg", 0, "must be a finite number greater than 0 and at most 90"),
        ("barrier.shape.face_angle_deg", 50, "must agree to 1° with the angle"),
        ("barrier.shape.crest_width_m", 12, "make no barrier"),
        (
            "barrier.shape",
            {"kind": "trapezoid", "crest_width_m": 0, "height_m": 6, "face_angle_deg": 90},
            "base_width_m = 0, crest_width_m = 0 and height_m = 6 make no barrier",
        ),
        ("barrier.friction", "smooth", 'barrier.friction: "smooth" is not allowed; it must be a number'),
        ("barrier.motion.mass_kg_per_m", 1e5, "barrier.motion: needs exactly one of density_kg_per_m3 and mass"),
        ("barrier.motion", {"kind": "prescribed", "times_s": [0, -1], "velocities_m_per_s": [1, 1]}, "increase"),
        ("barrier.motion", {"kind": "prescribed", "times_s": [-1, 0], "velocities_m_per_s": [1, 1]}, "at or after 0"),
        ("barrier.motion", {"kind": "prescribed", "times_s": [0], "velocities_m_per_s": [1, 1]}, "as many"),
        ("numerics.points_per_cell", 5, "must be one of 1, 4, 9, 16"),
        ("numerics.spacing_m", 1e-5, "1.8e+12 material points"),
        ("numerics.spacing_m", 100, "less than one material point"),
        ("numerics.spacing_m", 10**400, "numerics.spacing_m = 1000"),
        ("output.end_time_s", -1, "output.end_time_s = -1 is not allowed; it must be a finite number at least 1e-09"),
        ("output.time_series_interval_s", 1e-8, "ten million records"),
        ("ground", None, "ground = null is not allowed with a sliding barrier"),
        ("domain.left_m", -20, "domain.left_m = -20 cuts the scene; it must be at most -24"),
        ("domain.right_m", 10, "it must be at least 11"),
        ("domain.top_m", 5, "it must be at least 6"),
        ("domain.bottom_m", -1, "domain.bottom_m is not allowed with a ground"),
        ("title", "", "a text of at least one character"),
        ("flow", 3, "flow = 3 is not allowed; it must be a group of fields"),
    ],
)
def test_refused_in_one_sentence(case_1, path, value, sentence):
    with pytest.raises(ScenarioError) as caught:
        case_1.replaced({path: value})
    fitting = [problem for problem in caught.value.problems if sentence in problem]
    assert fitting, caught.value.problems
    assert "\n" not in fitting[0]
    assert fitting[0].endswith((".", "?"))


@pytest.mark.parametrize(
    "motion", [{"kind": "fixed"}, {"kind": "prescribed", "times_s": [0], "velocities_m_per_s": [1]}]
)
def test_a_trapezoid_needs_a_ground(case_1, motion):
    """Without, the flow got beneath it and was lifted: 8 % of its energy from nowhere at 0.5 m, 21 % at 0.25 m."""
    with pytest.raises(ScenarioError, match=r'null is not allowed with barrier\.shape of the kind "trapezoid"'):
        case_1.replaced({"ground": None, "barrier.motion": motion})
    assert case_1.replaced({"ground": None, "barrier.motion": motion, "barrier.shape": {"kind": "wall"}}).ground is None


@pytest.mark.parametrize(
    ("vertices", "sentence"),
    [
        ([[-4, 0], [-2, 1], [-2, 0], [-4, 1]], "must not cross or touch themselves"),
        ([[-4, 0], [-3, 0], [-2, 0]], "must not cross or touch|area greater than 0"),
        ([[-4, -1], [-2, 0], [-2, 1]], "reaches y = -1 m; it must stay on or above the ground"),
        ([[-1, 0], [3, 0], [3, 3], [-1, 3]], "lies inside the barrier"),
        ([[-4, 0], [-3, 0]], "a list of 3 to 2000 pairs of numbers"),
    ],
)
def test_impossible_outline(case_1, vertices, sentence):
    with pytest.raises(ScenarioError, match=sentence):
        case_1.replaced({"flow.shape": {"kind": "polygon", "vertices_m": vertices}})


def test_a_flow_may_rest_against_the_face(case_1):
    run, height = case_1.barrier.shape.polygon[1]
    resting = [[-5, 0], [0, 0], [run, height], [-5, height]]
    changed = case_1.replaced({"flow.shape": {"kind": "polygon", "vertices_m": resting}})
    assert changed.flow.volume == pytest.approx(0.5 * (5 + 5 + run) * height)
    assert changed.flow.depth == pytest.approx(height)


def test_wall_is_solid_behind_its_face():
    with pytest.raises(ScenarioError, match="lies inside the barrier"):
        scene("case_5").replaced({"flow.shape": {"kind": "polygon", "vertices_m": [[20, 0], [21, 0], [21, 1]]}})


@pytest.mark.parametrize(
    ("measures", "expected"),
    [
        ({"base_width_m": 11, "crest_width_m": 4, "height_m": 6}, (11, 4, 6)),
        ({"base_width_m": 10, "crest_width_m": 4, "face_angle_deg": 45}, (10, 4, 3)),
        ({"base_width_m": 10, "height_m": 3, "face_angle_deg": 45}, (10, 4, 3)),
        ({"crest_width_m": 4, "height_m": 3, "face_angle_deg": 45}, (10, 4, 3)),
        ({"crest_width_m": 4, "height_m": 3, "face_angle_deg": 90}, (4, 4, 3)),
    ],
)
def test_three_measures_fix_the_barrier(case_1, measures, expected):
    changed = case_1.replaced({"barrier.shape": {"kind": "trapezoid", **measures}})
    assert changed.barrier.shape.base_crest_height == pytest.approx(expected, rel=1e-14)


def test_two_measures_do_not(case_1):
    with pytest.raises(ScenarioError, match="at least three of"):
        case_1.replaced({"barrier.shape": {"kind": "trapezoid", "base_width_m": 11, "height_m": 6}})


def test_base_friction_from_the_soil(case_1):
    motion = {"kind": "sliding", "mass_kg_per_m": 5e4, "base_soil_friction_angle_deg": 20}
    changed = case_1.replaced({"barrier.motion": motion})
    assert changed.barrier.motion.base_friction_coefficient == pytest.approx(0.8 * math.tan(math.radians(20)))
    assert changed.barrier.mass == 5e4


def test_conductivity_from_permeability(case_1):
    # κ = k μ / (ρ_L g): 1e-4 m/s of water at 1e-3 Pa s is 1.01937e-11 m².
    data = case_1.resolved()
    data["flow"]["material"] |= {"hydraulic_conductivity_m_per_s": None, "intrinsic_permeability_m2": 1.01937e-11}
    material = Scenario.model_validate(data).flow.material
    assert material.hydraulic_conductivity == pytest.approx(1e-4, rel=1e-5)


def test_tilted_gravity_pulls_downstream(case_1):
    x, y = case_1.replaced({"gravity.tilt_deg": 30}).gravity.vector
    assert (x, y) == pytest.approx((9.81 / 2, -9.81 * math.sqrt(3) / 2))
    assert case_1.gravity.vector == (0, -9.81)


def test_several_problems_are_told_at_once(case_1):
    with pytest.raises(ScenarioError) as caught:
        case_1.replaced({"flow.material.porosity": 2, "output.end_time_s": 0, "numerics.spacng_m": 0.1})
    assert len(caught.value.problems) == 3


def test_path_that_leads_nowhere(case_1):
    with pytest.raises(ScenarioError, match=r"numrics\.spacing_m leads nowhere"):
        case_1.replaced({"numrics.spacing_m": 0.1})


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"{", "no valid JSON: .* line 1, column 2"),
        (b"\xff\xfe{}", "not UTF-8"),
        (b'{"title": "a", "title": "b"}', "'title' is given twice"),
        (b"[" * 100_000, "nested too deeply|no valid JSON"),
        (b'{"title": ' + b"9" * 5000 + b"}", "number that cannot be read"),
        (b"[]", "The scenario = .* a group of the fields title"),
        (b"", "no valid JSON"),
    ],
)
def test_broken_file(tmp_path, content, sentence):
    path = tmp_path / "scene.json"
    path.write_bytes(content)
    with pytest.raises(ScenarioError, match=sentence) as caught:
        Scenario.load(path)
    assert str(caught.value).startswith(str(path))


def test_a_sweep_is_no_scenario(tmp_path):
    path = tmp_path / "sweep.json"
    path.write_text('{"scenario": "case_1.json", "method": "list", "vary": {"gravity.tilt_deg": {"values": [1, 2]}}}')
    with pytest.raises(ScenarioError, match=r"sweep\.json: This is a sweep; python -m warp_mpm sweep runs it\.$"):
        Scenario.load(path)


def test_missing_file(tmp_path):
    with pytest.raises(ScenarioError, match="Cannot read the scenario: No such file"):
        Scenario.load(tmp_path / "none.json")
    with pytest.raises(ScenarioError, match="Cannot read the scenario: Is a directory"):
        Scenario.load(tmp_path)


def test_editor_pointer_is_accepted(case_1):
    assert Scenario.model_validate({"$schema": "scenario.schema.json", **case_1.resolved()}) == case_1


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.lists(st.floats(), max_size=4),
    st.lists(st.lists(st.floats(-30, 30), min_size=2, max_size=2), max_size=7),
    st.dictionaries(st.sampled_from(["kind", "formulation", "x"]), st.sampled_from(["dry", "wall", "sliding", 3])),
)


def places(data, path=()):
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        yield (*path, key)
        if isinstance(value, (dict, list)):
            yield from places(value, (*path, key))


@settings(max_examples=300, deadline=None)
@given(name=st.sampled_from(NAMES), changes=st.lists(st.tuples(st.integers(0, 10**6), JUNK), min_size=1, max_size=3))
def test_whatever_a_file_holds_it_is_a_scene_or_one_clear_error(name, changes):
    data = scene(name).resolved()
    for number, junk in changes:
        *parents, leaf = list(places(data))[number % len(list(places(data)))]
        place = data
        for key in parents:
            place = place[key]
        place[leaf] = junk
    scenario, problems = None, []
    try:
        scenario = Scenario.model_validate(data)
    except ScenarioError as error:
        problems = error.problems
    assert (scenario is None) == bool(problems)
    assert all(problem and "\n" not in problem and problem[-1] in ".?" for problem in problems)
    assert scenario is None or Scenario.model_validate(scenario.resolved()) == scenario


def test_scenario_cannot_be_changed(case_1):
    with pytest.raises(ValueError, match="frozen"):
        case_1.title = "other"


def test_a_field_that_is_given_twice(tmp_path):
    path = tmp_path / "scene.json"
    path.write_text('{"title": "one", "title": "two"}')
    with pytest.raises(ScenarioError) as refused:
        Scenario.load(path)
    assert refused.value.problems == ["The field 'title' is given twice in one group."]


@pytest.mark.parametrize(
    ("field", "value", "sentence"),
    [
        ("title", "a\x1b[31mred", "title: holds U+001B, a control character, where only text is allowed."),
        ("source", "a\x9b", "source: holds U+009B, a control character, where only text is allowed."),
        ("notes", ["", "\udfff"], "notes[1]: holds U+DFFF, half of a character, where only text is allowed."),
    ],
)
def test_text_that_no_file_or_terminal_takes(case_1, field, value, sentence):
    with pytest.raises(ScenarioError) as refused:
        case_1.replaced({field: value})
    assert refused.value.problems == [sentence]


def test_whole_numbers_may_be_written_with_a_point(case_1):
    assert case_1.replaced({"flow.shape.squares": 3.0}).flow.shape.squares == 3
    with pytest.raises(ScenarioError, match=r"squares = 2.5 is not allowed; it must be a whole number at least 0"):
        case_1.replaced({"flow.shape.squares": 2.5})
    squares, _ = json.loads(json_schema())["$defs"]["FrontAndTail"]["properties"]["squares"]["anyOf"]
    assert (squares["type"], squares["minimum"], squares["maximum"]) == ("integer", 0, 100_000)


def test_a_flow_may_be_given_by_its_length(load_scene):
    case_1 = load_scene("case_1")
    metres = case_1.replaced({"flow.shape.squares": None, "flow.shape.length_m": 15.0})
    np.testing.assert_allclose(metres.flow.polygon, case_1.flow.polygon, rtol=0.0, atol=1e-12)
    odd = case_1.replaced({"flow.shape.squares": None, "flow.shape.length_m": 13.7}).flow
    assert (odd.volume, odd.depth) == (pytest.approx(13.7 * 3.0), 3.0)
    shortest = case_1.replaced({"flow.shape.squares": None, "flow.shape.length_m": 6.0}).flow
    assert (shortest.volume, len(shortest.polygon)) == (pytest.approx(18.0), 3)
    for changes, words in (
        ({"flow.shape.length_m": 15.0}, "needs exactly one of squares and length_m"),
        ({"flow.shape.squares": None}, "needs exactly one of squares and length_m"),
        ({"flow.shape.squares": None, "flow.shape.length_m": 5.0}, "length_m = 5 must be at least twice depth_m, 6"),
    ):
        with pytest.raises(ScenarioError, match=words):
            case_1.replaced(changes)


@pytest.mark.parametrize(
    "vertices",
    [
        [[-5, 0], [-5 + 1e-12, 0], [-5 + 1e-12, 2], [-5, 2]],
        [[-5, 0], [-3, 0], [-4, 1e-13]],
        [[-5, 0], [-4, 1], [-4, 1 + 1e-13], [-5, 1e-13]],
    ],
)
def test_an_outline_too_thin_to_have_an_inside(case_1, vertices):
    with pytest.raises(ScenarioError, match=r"^flow.shape: vertices_m (enclose|must)"):
        case_1.replaced({"flow.shape": {"kind": "polygon", "vertices_m": vertices}, "numerics.spacing_m": 1e-6})


def test_a_phase_without_weight(case_1):
    with pytest.raises(ValueError, match=r"flow.material: sound would run through it at .* m/s; porosity, densities"):
        step_limits(case_1.replaced({"flow.material.porosity": 5e-324}))


def test_the_schema_says_what_each_field_means():
    """In the words of its docstring, wherever the field was declared: in a base, by a law, by a transfer scheme."""
    parts = json.loads(json_schema())["$defs"]
    assert parts["Gravity"]["properties"]["tilt_deg"]["description"].startswith("Slope of the ground. Positive: ")
    assert parts["Numerics"]["properties"]["transfer_damping"]["description"].startswith("With aflip: rate β at which ")
    for name in ("DryFlow", "TwoPhaseFlow"):
        assert parts[name]["properties"]["velocity_m_per_s"]["description"]
    for name in ("SkeletonHerschelBulkley", "UndrainedMaterialHerschelBulkley"):
        fields = parts[name]["properties"]
        assert fields["yield_stress_Pa"]["description"] == "Shear stress τ_y below which it does not flow."
        assert fields["young_modulus_Pa"]["description"]
