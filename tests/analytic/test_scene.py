"""Scenes read from scenario files: what the simulator itself makes of every shipped one, and clear errors."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from analytic.cli import app as closed_form
from analytic.scene import SceneError, read_scene, scene_of
from fmu.cli import app as fmu
from warp_mpm.scenario import Scenario, Trapezoid
from warp_mpm.scenario_errors import ScenarioError

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("*.json"))


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_shipped_scenario_reads_as_in_the_simulator(path: Path) -> None:
    scenario = Scenario.load(path)
    if scenario.barrier is None:
        with pytest.raises(SceneError, match=r"barrier is null, the closed form needs one"):
            read_scene(path)
        return
    scene = read_scene(path)
    assert scene.flow_mass == pytest.approx(scenario.flow.volume * scenario.flow.material.density)
    assert scene.flow_length == pytest.approx(scenario.flow.equivalent_length)
    assert scene.flow_height == pytest.approx(scenario.flow.depth)
    arriving = scenario.flow.inflow.greatest_speed if scenario.flow.inflow is not None else 0.0
    assert scene.speed == max(scenario.flow.velocity_m_per_s[0], arriving)
    assert scene.barrier_mass == scenario.barrier.mass
    assert scene.gravity == scenario.gravity.acceleration_m_per_s2
    if isinstance(scenario.barrier.shape, Trapezoid):
        assert scene.face_angle == pytest.approx(scenario.barrier.shape.built_face_angle_deg)
        assert scene.barrier_height == scenario.barrier.shape.base_crest_height[2]
    else:
        assert scene.barrier_height == math.inf
    assert scene.impact().peak_force > 0


def test_the_resolved_scenario_of_a_run_folder_is_read(tmp_path: Path) -> None:
    source = next(path for path in SCENARIOS if path.stem == "set_iib")
    resolved = Scenario.load(source).model_dump(mode="json")
    (tmp_path / "scenario.json").write_text(json.dumps(resolved))
    assert read_scene(tmp_path) == read_scene(source)


def content(**changes: Any) -> dict[str, Any]:
    """Content of a scenario file with the fields at the paths replaced; ``None`` removes one."""
    found = json.loads(next(path for path in SCENARIOS if path.stem == "set_iib").read_text())
    for path, value in changes.items():
        *groups, last = path.split("/")
        at = found
        for group in groups:
            at = at[group]
        if value is None:
            del at[last]
        else:
            at[last] = value
    return found


def scenario(**changes: Any) -> Scenario:
    return Scenario.model_validate(content(**changes))


def test_a_polygon_is_measured() -> None:
    corners = [[-3, 0], [-6, 3], [-15, 3], [-24, 0]]  # the paper's flow of case 1, V = 45 m3/m, h = 3 m
    flow = scene_of(scenario(**{"flow/shape": {"kind": "polygon", "vertices_m": corners}}))
    assert (flow.flow_length, flow.flow_height, flow.distance) == pytest.approx((15, 3, 3))
    block = [[0, 0], [-4, 0], [-4, 2], [0, 2]]
    assert scene_of(scenario(**{"flow/shape": {"kind": "polygon", "vertices_m": block}})).flow_length == 4


@pytest.mark.parametrize("missing", ["base_width_m", "crest_width_m", "height_m", "face_angle_deg"])
def test_three_measures_make_the_trapezoid(missing: str) -> None:
    shape = {
        "kind": "trapezoid",
        "base_width_m": 4 + 12 / math.sqrt(3),
        "crest_width_m": 4.0,
        "height_m": 6.0,
        "face_angle_deg": 60.0,
    }
    del shape[missing]
    found = scene_of(scenario(**{"barrier/shape": shape}))
    assert found.barrier_mass == pytest.approx(2000 * 6 * (4 + 6 / math.sqrt(3)))
    assert found.face_angle == pytest.approx(60)
    assert found.barrier_height == pytest.approx(6)


def test_what_the_closed_form_leaves_out_is_said() -> None:
    changes: dict[str, Any] = {
        "gravity/tilt_deg": 5,
        "flow/velocity_m_per_s": [10, -1],
        "ground/friction": 0.2,
    }
    said = scene_of(scenario(**changes))
    assert len(said.notes) == 3
    assert said.slope == 5
    # The flow's weight along the slope is what the closed form leaves out, in kN/m.
    assert f"{81 * 9.81 * math.sin(math.radians(5)):.3g} kN/m" in said.notes[-1]
    assert "too small" in said.notes[-1]
    uphill = scene_of(scenario(**{"gravity/tilt_deg": -5}))
    assert "too small" not in uphill.notes[0]
    assert scene_of(scenario()).notes == ()


def test_what_it_does_not_know_of_the_law_is_said() -> None:
    folder = Path(__file__).parents[2] / "scenarios"
    assert not [one for one in read_scene(folder / "case_1.json").remarks if "law" in one or "dilatancy" in one]
    assert any("law, herschel_bulkley, is left out" in one for one in read_scene(folder / "case_1_mud.json").remarks)
    assert any("dilatancy is left out" in one for one in read_scene(folder / "case_1_loose.json").remarks)
    case_1 = Scenario.load(folder / "case_1.json")
    liquefied = case_1.replaced({"flow.initial_pore_pressure_ratio": 1.0})
    assert any("pore pressure at the start is left out" in one for one in scene_of(liquefied).remarks)
    front = case_1.replaced({"flow.initial_pore_pressure_ratios": [[-9.0, 0.6], [-3.0, 1.0]]})
    assert any("pore pressure at the start is left out" in one for one in scene_of(front).remarks)
    sheared = case_1.replaced({"flow.base_velocity_share": 0.0})
    assert any("varies over its depth is left out" in one for one in scene_of(sheared).remarks)
    assert scene_of(sheared).speed == 10.0
    voellmy = case_1.replaced({"ground.turbulence_m_per_s2": 200.0})
    assert any("friction between flow and ground is left out" in one for one in scene_of(voellmy).remarks)
    for command, runner in (("predict", closed_form), ("parameters", fmu)):
        told = CliRunner().invoke(runner, [command, str(folder / "case_1_loose.json")])
        assert told.exit_code == 0, told.output
        assert "dilatancy is left out" in " ".join(told.output.split()), command


def test_the_base_soil_s_friction_angle_counts_by_four_fifths() -> None:
    motion = {"kind": "sliding", "mass_kg_per_m": 5e4, "base_soil_friction_angle_deg": 30.0}
    found = scene_of(scenario(**{"barrier/motion": motion}))
    assert found.base_friction == pytest.approx(0.8 / math.sqrt(3))
    assert found.barrier_mass == 5e4
    assert found.barrier_density == pytest.approx(2000 * 5e4 / scene_of(scenario()).barrier_mass)


PRESCRIBED = {"kind": "prescribed", "times_s": [0.0], "velocities_m_per_s": [1.0]}


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"flow/velocity_m_per_s": [-1, 0]}, r"velocity_m_per_s\[0\] is -1, the flow must move towards"),
        ({"barrier": None}, r"barrier is null, the closed form needs one"),
        ({"barrier/motion": PRESCRIBED}, r"barrier\.motion\.kind is 'prescribed', the closed form knows"),
    ],
)
def test_a_scene_without_an_answer_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(SceneError, match=sentence) as error:
        scene_of(scenario(**changes))
    assert "\n" not in str(error.value)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"none\.json: Cannot read the scenario: No such file"):
        read_scene(tmp_path / "none.json")
    broken = tmp_path / "broken.json"
    broken.write_text("{")
    with pytest.raises(ScenarioError, match=r"broken\.json: The file is no valid JSON"):
        read_scene(broken)
    broken.write_text("[1, 2]")
    with pytest.raises(ScenarioError, match=r"broken\.json: The scenario = \[1, 2\] is not allowed"):
        read_scene(broken)


TYPOS = {
    "gravity/tilt_degg": 5.0,
    "flow/material/porosity": 1.4,
    "flow/material/grain_density_kg_per_m3": -1000.0,
    "barrier/shape/crest_width_m": 50.0,
    "flow/shape/depth_m": "3",
    "output": None,
}


@pytest.mark.parametrize("path", TYPOS)
def test_every_command_refuses_a_file_as_the_simulator_does(path: str, tmp_path: Path) -> None:
    file = tmp_path / "typo.json"
    file.write_text(json.dumps(content(**{path: TYPOS[path]})))
    with pytest.raises(ScenarioError) as refusal:
        Scenario.load(file)
    analytic = [
        ["predict", str(file)],
        ["compare", str(file)],
        ["design", str(file), "--limit", "1"],
        ["sweep", "plan", str(file), str(tmp_path / "sweep")],
    ]
    units = [["build", "--scenario", str(file), "--out", str(tmp_path)], ["check", str(file), "--out", str(tmp_path)]]
    for app, commands in ((closed_form, analytic), (fmu, units)):
        for command in commands:
            result = CliRunner().invoke(app, command)
            assert (result.exit_code, result.stdout) == (2, ""), command
            assert result.stderr.strip() == str(refusal.value), command
    assert list(tmp_path.iterdir()) == [file]
