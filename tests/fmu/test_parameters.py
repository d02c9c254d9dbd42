"""From a scenario to the start values of the closed-form unit, which must then be the closed form of that scenario."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import pytest
from lxml import etree
from typer.testing import CliRunner

from analytic.fitted import calibrated_impact
from analytic.scene import read_scene
from fmu.cli import app
from fmu.system import NAMESPACES

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def told(*arguments: object) -> str:
    done = CliRunner().invoke(app, ["parameters", *map(str, arguments)])
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.mark.parametrize("name", ["set_iib", "set_iv", "case_1_fixed"])
def test_values_make_the_closed_form_of_the_scenario(name: str, open_unit: Callable[[str], Any]) -> None:
    scene = read_scene(SCENARIOS / f"{name}.json")
    content = json.loads(told(SCENARIOS / f"{name}.json", "--json"))
    host = open_unit("BarrierSlidingC").initialize()
    for way, impact in (("paper", scene.impact()), ("calibrated", calibrated_impact(scene))):
        host.again(**content[way])
        assert host["peak_force"] == pytest.approx(impact.peak_force, rel=1e-12)
        host.run(6.0 + content[way]["arrival_time"])
        assert host["barrier_displacement"] == pytest.approx(impact.barrier_displacement(6.0), rel=1e-9)
    assert content["calibrated"]["geometry_change"] != content["paper"]["geometry_change"]
    assert content["paper"]["arrival_time"] == pytest.approx(scene.distance / scene.speed)


@pytest.mark.parametrize("way", ["paper", "calibrated"])
def test_parameter_file_says_the_same(way: str) -> None:
    scenario = SCENARIOS / "set_iib.json"
    text = told(scenario, "--ssv", "--variant", way)
    schemas = Path(fmpy.__file__).parent / "ssp" / "schema"
    etree.XMLSchema(etree.parse(str(schemas / "SystemStructureParameterValues.xsd"))).assertValid(
        etree.fromstring(text.encode())
    )
    root = ElementTree.fromstring(text)
    found = {p.attrib["name"]: float(p[0].attrib["value"]) for p in root.iterfind(".//ssv:Parameter", NAMESPACES)}
    assert found == json.loads(told(scenario, "--json"))[way]


def test_table_has_both() -> None:
    lines = told(SCENARIOS / "set_iib.json").splitlines()
    (row,) = [line.split() for line in lines if line.startswith("geometry_change")]
    assert row[1] == "0.41"
    assert float(row[2]) > 0.5
    (row,) = [line.split() for line in lines if line.startswith("barrier_mass")]
    assert row[1:] == ["90000", "90000", "kg/m"]


@pytest.mark.parametrize(
    ("name", "notes"),
    [
        (
            "case_1_mud",
            [
                "The material's law, herschel_bulkley, is left out: the closed form knows no strength.",
                "Calibrated: The formulation undrained is outside the fit, whose flows are two_phase.",
                "Calibrated: The law herschel_bulkley is outside the fit, whose flows are mohr_coulomb.",
            ],
        ),
        ("case_1_dry", ["Calibrated: The formulation dry is outside the fit, whose flows are two_phase."]),
        (
            "site_two_surges",
            [
                "Of a flow that arrives the greatest depth and velocity are taken, and all of its volume; several "
                "surges are taken as one.",
                "Slope of 6 degrees: the flow's weight along it is left out, 152 kN/m, which pushes on: forces and "
                "displacements come out too small.",
            ],
        ),
        ("site_two_barriers", ["Further barriers are left out."]),
        ("hard/overhanging_face", ["No calibrated values: face_angle is 123.69"]),
    ],
)
def test_what_the_closed_form_does_not_see_is_said(name: str, notes: list[str]) -> None:
    found = json.loads(told(SCENARIOS / f"{name}.json", "--json"))
    for note in notes:
        assert any(each.startswith(note) for each in found["notes"]["calibrated"]), found["notes"]
    text = " ".join(told(SCENARIOS / f"{name}.json").split())
    assert notes[-1] in text
    assert ("calibrated" in found) is (name != "hard/overhanging_face")


def test_a_parameter_file_comes_with_its_notes() -> None:
    done = CliRunner().invoke(app, ["parameters", str(SCENARIOS / "case_1_mud.json"), "--ssv"])
    assert done.exit_code == 0
    ElementTree.fromstring(done.stdout)
    assert "The material's law, herschel_bulkley, is left out" in done.stderr


def test_a_flow_that_arrives_later(tmp_path: Path) -> None:
    """Its front is at the section when the table says that something arrives, not at once."""
    scenario = json.loads((SCENARIOS / "case_1.json").read_text())
    scenario["flow"].pop("shape", None)
    scenario["flow"].pop("velocity_m_per_s", None)
    scenario["flow"]["inflow"] = {
        "x_m": -20.0, "times_s": [0.0, 3.0, 4.0, 6.0], "depths_m": [0.0, 0.0, 2.0, 1.0], "velocity_m_per_s": 8.0,
    }  # fmt: skip
    path = tmp_path / "late.json"
    path.write_text(json.dumps(scenario))
    found = json.loads(told(path, "--json"))["paper"]
    assert found["arrival_time"] == pytest.approx(3.0 + 20.0 / 8.0)
    assert found["flow_mass"] == pytest.approx(4.0 * 8.0 * found["flow_mass"] / (found["flow_length"] * 2.0))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            [SCENARIOS / "set_iib.json", "--variant", "mine"],
            "--variant = mine is not allowed; it must be one of paper,",
        ),
        ([SCENARIOS / "set_iib.json", "--ssv", "--json"], "--ssv and --json are two forms of one output"),
        (
            [SCENARIOS / "hard" / "gravity_0.json"],
            "gravity_0.json: gravity.acceleration_m_per_s2 is 0, the closed form",
        ),
        ([SCENARIOS / "hard" / "overhanging_face.json", "--ssv"], "face_angle is 123.69"),
        (["nowhere.json"], "nowhere.json: Cannot read the scenario"),
    ],
)
def test_bad_input_is_one_sentence(arguments: list[object], says: str) -> None:
    done = CliRunner().invoke(app, ["parameters", *map(str, arguments)])
    assert done.exit_code == 2
    assert says in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stdout == ""
