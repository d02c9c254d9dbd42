"""`init`: a scenario from what an engineer knows of a site, in his units."""

import json

import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.report.content import flattened
from warp_mpm.scenario import Scenario
from warp_mpm.site import KILONEWTON, NOTED, QUESTIONS, asked, new_scenario, notes_still_true

SITE = ["--depth", "2.2", "--length", "15", "--speed", "43.2 km/h", "--slope", "8", "--height", "5", "--crest", "4"]


def call(*words):
    return CliRunner().invoke(app, ["init", *map(str, words)], env={"COLUMNS": "200"})


def refusal(*words):
    result = call(*words)
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    return result.stderr.rstrip("\n").split("\n")


def test_a_site_in_an_engineers_units(tmp_path):
    file = tmp_path / "site.json"
    result = call(file, *SITE, "--bulk-density", "1.95t/m3", "--mass", "600 kN/m", "--limit", "displacement <= 0.5 m")
    assert result.exit_code == 0, result.output
    scenario = Scenario.load(file)
    flow, barrier = scenario.flow, scenario.barrier
    assert flow.material.density == pytest.approx(1950.0)
    assert flow.volume == pytest.approx(15.0 * 2.2)
    assert (flow.equivalent_length, flow.velocity_m_per_s) == (pytest.approx(15.0), (12.0, 0.0))
    assert barrier.mass == pytest.approx(600.0 * KILONEWTON)
    assert barrier.shape.base_crest_height[1:] == (4.0, 5.0)
    assert scenario.design.displacement_m == 0.5
    assert scenario.gravity.tilt_deg == 8.0
    # The crest on a line of the grid, and enough cells that nothing is remarked.
    assert 5.0 / scenario.numerics.spacing_m == pytest.approx(14.0, rel=1e-5)
    assert "612" not in result.stdout
    assert "600 kN/m" in result.stdout
    assert "1.95 t/m3" in result.stdout
    assert "Note:" not in result.stdout
    checked = CliRunner().invoke(app, ["check", str(file), "--json"])
    (card,) = json.loads(checked.stdout)
    assert card["valid"]
    assert card["notes"] == []
    assert card["numbers"]["bulk_density_kg_per_m3"] == pytest.approx(1950.0)
    # What was not given is in the file.
    assert any("friction angle of the grains: 30 deg (assumed)" in note for note in scenario.notes)
    assert not any("speed" in note for note in scenario.notes)
    # What follows from the rest would not change with it.
    assert not any("mass of the barrier" in note or "computed" in note for note in scenario.notes)


def test_a_note_goes_with_what_it_says(tmp_path):
    file = tmp_path / "site.json"
    assert call(file, *SITE).exit_code == 0
    scenario = Scenario.load(file)
    there = [path for path, _ in flattened(scenario.resolved())]
    for path in NOTED:
        assert any(one.startswith(path.removesuffix(".0")) for one in there), path
    kept = notes_still_true(scenario.notes, ["numerics.spacing_m", "barrier.motion.base_friction", "barrier.shape.toe"])
    gone = set(scenario.notes) - set(kept)
    assert sorted(note.partition(":")[0] for note in gone) == [
        "friction coefficient under the barrier",
        "spacing of the grid",
    ]


@pytest.mark.parametrize(
    ("given", "porosity"),
    [
        ({"water_content": "30 %"}, 0.3 * 2650.0 / (1000.0 + 0.3 * 2650.0)),
        ({"porosity": "0.4"}, 0.4),
        ({"bulk_density": "1.95 t/m³", "liquid_density": "1100", "grain_density": "2700"}, 750.0 / 1600.0),
        ({}, 0.45),
    ],
)
def test_porosity_from_what_is_known(given, porosity):
    content, _ = new_scenario({"depth": "2", "length": "10", "speed": "8", "height": "4"} | given)
    assert Scenario.model_validate(content).flow.material.porosity == pytest.approx(porosity, abs=1e-8)


def test_fixed_dry_and_by_volume():
    given = {"depth": "2", "volume": "30", "speed": "8", "height": "4", "bulk_density": "16 kN/m3", "mass": "20 t"}
    content, told = new_scenario(given, sliding=False, dry=True)
    scenario = Scenario.model_validate(content)
    assert (scenario.flow.formulation, scenario.barrier.motion.kind) == ("dry", "fixed")
    assert scenario.flow.volume == pytest.approx(30.0)
    assert scenario.flow.material.density == pytest.approx(16.0 * KILONEWTON)
    # Its weight is known to the verdict.
    base, crest, height = scenario.barrier.shape.base_crest_height
    assert scenario.design.density_kg_per_m3 == pytest.approx(20e3 / (0.5 * (base + crest) * height))
    assert {one.origin for one in told if one.words == "length of the flow, of the box of its volume and depth"} == {
        "volume over depth"
    }


@pytest.mark.parametrize(
    ("words", "sentences"),
    [
        (
            [],
            [
                "--depth is missing; it must be given: depth of the flow, a number in m.",
                "--length or --volume is missing; it must be given: length of the flow, of the box of its volume and "
                "depth, a number in m.",
                "--speed is missing; it must be given: speed of the flow at the barrier, a number in m/s.",
                "--height is missing; it must be given: height of the barrier, a number in m.",
            ],
        ),
        (
            [*SITE, "--bulk-density", "1.95"],
            [
                "--bulk-density = 1.95 is not allowed; it must be at least 500 and at most 5000 kg/m3; 1.95 t/m3 was "
                "probably meant."
            ],
        ),
        (
            [*SITE, "--bulk-density", "2.8t/m3"],
            ["--bulk-density = 2800 is not allowed; it must be above that of the liquid, 1000, and below that of the "
             "grains, 2650 kg/m3."],
        ),
        (
            [*SITE, "--mass", "12 m"],
            ["--mass = 12 m is not allowed; it must be a number in kg/m, t/m, kN/m, kg, t, kN."],
        ),
        (
            [*SITE, "--porosity", "0.4", "--water-content", "0.2"],
            ["--water-content and --porosity are both given; give only one."],
        ),
        (
            [*SITE[:2], "--length", "4", *SITE[4:]],
            ["--length = 4 is not allowed; it must be at least 4.4 m: front and tail of the flow alone have as much."],
        ),
        (
            [*SITE, "--limit", "peak_force <= 100 kN/m"],
            ["--limit peak_force: the design group of a scenario has no limit on it; it has displacement, "
             "sliding_factor, overturning_factor, eccentricity_of_base, base_pressure, overtopped_share, "
             "overtopped_volume, freeboard."],
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_a_site(tmp_path, words, sentences):
    file = tmp_path / "site.json"
    assert refusal(file, *words) == sentences
    assert not file.exists()


def test_a_file_is_not_replaced_unasked(tmp_path):
    file = tmp_path / "site.json"
    file.write_text("mine")
    assert refusal(file, *SITE) == [f"{file} is there already; choose another name, or add --force."]
    assert file.read_text() == "mine"
    assert call(file, *SITE, "--force").exit_code == 0
    assert Scenario.load(file).flow.depth == 2.2


def test_what_is_missing_is_asked_for():
    """Every question once, in order; an answer that is not allowed again, with the reason."""
    answers = iter(["2", "0", "14", "10", "", "1.9 t/m3", "4", "", "", "", ""])
    seen, complaints = [], []

    def prompt(words, default):
        seen.append((words, default))
        return next(answers) or default

    given = asked(dict.fromkeys(QUESTIONS), sliding=True, prompt=prompt, complain=complaints.append)
    assert next(answers, None) is None
    assert [words for words, _ in seen][:4] == [
        "depth of the flow [m]",
        *["length of the flow, of the box of its volume and depth [m]"] * 2,
        "speed of the flow at the barrier [m/s]",
    ]
    assert complaints == ["--length = 0 is not allowed; it must be at least 0.1 and at most 10000 m."]
    content, _ = new_scenario(given)
    assert Scenario.model_validate(content).flow.material.density == pytest.approx(1900.0)
    # What was given is not asked for.
    seen.clear()
    asked({"depth": "2", "volume": "30", "speed": "9", "slope": "0", "porosity": "0.4", "height": "4", "crest": "1",
           "face_angle": "70", "mass": "20 t", "base_friction": "0.4"},
          sliding=True, prompt=prompt, complain=complaints.append)  # fmt: skip
    assert seen == []
