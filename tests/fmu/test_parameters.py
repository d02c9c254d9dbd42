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
    ("arguments", "says"),
    [
        (
            [SCENARIOS / "set_iib.json", "--variant", "mine"],
            "--variant = mine is not allowed; it must be one of paper,",
        ),
        ([SCENARIOS / "set_iib.json", "--ssv", "--json"], "--ssv and --json are two forms of one output"),
        (["nowhere.json"], "nowhere.json: Cannot read the scenario"),
    ],
)
def test_bad_input_is_one_sentence(arguments: list[object], says: str) -> None:
    done = CliRunner().invoke(app, ["parameters", *map(str, arguments)])
    assert done.exit_code == 2
    assert says in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stdout == ""
