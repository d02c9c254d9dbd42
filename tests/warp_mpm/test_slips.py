"""Values that are allowed and absurd are told, with the one that was probably meant, wherever a scene is read."""

import json

import pytest
from typer.testing import CliRunner

import analytic.cli
from warp_mpm.cli import app
from warp_mpm.description import described, described_material
from warp_mpm.slips import slips

SLIDING = {"kind": "sliding", "base_friction": 0.29}
FLAT = {"kind": "trapezoid", "base_width_m": 11.0, "crest_width_m": 4.0, "height_m": 0.5}
RADIANS = {"kind": "trapezoid", "crest_width_m": 4.0, "height_m": 6.0, "face_angle_deg": 1.1}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"flow.material.grain_density_kg_per_m3": 2.65}, "lighter than water; rock has about 2650: 2650 was probably"),
        ({"flow.material.liquid_density_kg_per_m3": 1.0}, "water has 1000: 1000 was probably meant, the value is in t"),
        ({"flow.material.grain_density_kg_per_m3": 800.0}, "= 800 is lighter than water; rock has about 2650."),
        ({"flow.material.friction_angle_deg": 0.36}, "friction_angle_deg = 0.36° is next to nothing; 19.8° was"),
        ({"barrier.motion": {"kind": "sliding", "density_kg_per_m3": 2000.0, "base_soil_friction_angle_deg": 0.6}},
         "base_soil_friction_angle_deg = 0.6° is next to nothing; 31° was probably meant"),
        ({"flow.material.young_modulus_Pa": 2.0}, "young_modulus_Pa = 2 Pa is softer than any soil; 2e+06 was"),
        ({"flow.material.young_modulus_Pa": 2000.0}, "2e+06 was probably meant, the value is in kPa"),
        ({"flow.material.liquid_bulk_modulus_Pa": 2200.0}, "2.2e+09 was probably meant, the value is in MPa"),
        ({"barrier.motion": SLIDING | {"mass_kg_per_m": 168.0}},
         "mass_kg_per_m = 168 kg/m makes 3.73 kg/m³ over the barrier's 45 m²; 168,000 was probably meant, the value is "
         "in t/m"),
        ({"barrier.motion": SLIDING | {"mass_kg_per_m": 900.0}}, "91,743.1 was probably meant, the value is in kN/m"),
        ({"barrier.motion": SLIDING | {"density_kg_per_m3": 1.95}}, "lighter than snow; 1950 was probably meant"),
        ({"barrier.motion": SLIDING | {"density_kg_per_m3": 20000.0}}, "= 20000 kg/m³ lies outside 500 to 4500"),
        ({"barrier.shape": {"kind": "wall"}, "barrier.motion": SLIDING | {"mass_kg_per_m": 100.0}},
         "less than a hundredth of the flow's 8.1e+04 kg/m; 100,000 was probably meant"),
        ({"barrier.shape": RADIANS}, "face_angle_deg = 1.1° is next to nothing; 63° was probably meant"),
        ({"barrier.shape": FLAT}, "rises at 8.1°, as a ramp"),
        ({"flow.velocity_m_per_s": [-12.0, 0.0]}, "runs away from the barrier, which lies downstream of x = 0"),
        ({"flow.velocity_m_per_s": [-12.0, 0.0]}, "velocity_m_per_s[0] = -12; 12 was probably meant"),
        ({"flow.velocity_m_per_s": [43.0, 0.0]}, "where km/h were meant, 11.9 m/s"),
        ({"gravity.tilt_deg": 8.0}, "The ground is smooth (ground.friction = 0) and falls by gravity.tilt_deg = 8°: "
         "nothing holds the flow, nor a deposit; a rough bed has about tan φ' = 0.36"),
    ],
)  # fmt: skip
def test_a_slip_is_told_with_what_was_meant(load_scene, changes, words):
    found = slips(load_scene("case_1", **changes))
    assert [words in sentence for sentence in found].count(True) == 1, found


@pytest.mark.parametrize(
    "changes",
    [
        {"gravity.tilt_deg": 8.0, "ground.friction": 0.3},
        {"gravity.tilt_deg": 0.5},
        {"flow.material.friction_angle_deg": 0.0},
        {"flow.material.young_modulus_Pa": 1e5},
        {"barrier.motion": SLIDING | {"mass_kg_per_m": 168e3}},
        {"barrier.motion": SLIDING | {"density_kg_per_m3": 600.0}},
        {"flow.velocity_m_per_s": [-2.0, 0.0], "gravity.tilt_deg": 30.0, "ground.friction": 0.1},
        {"barrier": None, "flow.velocity_m_per_s": [-10.0, 0.0]},
        {"gravity.tilt_deg": 8.0, "ground": None, "barrier": None},
    ],
)
def test_what_may_be_meant_is_left_alone(load_scene, changes):
    assert slips(load_scene("case_1", **changes)) == []


@pytest.fixture
def slipped(load_scene, tmp_path):
    """A scenario file with the speed in km/h."""
    path = tmp_path / "slipped.json"
    changes = {"flow.velocity_m_per_s": [43.0, 0.0], "numerics.spacing_m": 1.0, "output.end_time_s": 0.01}
    path.write_text(json.dumps(load_scene("case_1", **changes).resolved()))
    return path


SENTENCE = "where km/h were meant, 11.9 m/s"


@pytest.mark.parametrize(
    ("program", "command"),
    [
        (app, ["check"]),
        (app, ["run", "--out", "run"]),
        (app, ["plan"]),
        (analytic.cli.app, ["predict"]),
        (analytic.cli.app, ["design", "--limit", "0.5"]),
    ],
)
def test_every_reader_of_a_scene_tells_it_alike(slipped, tmp_path, monkeypatch, program, command):
    monkeypatch.chdir(tmp_path)
    verb, *options = command
    answer = CliRunner().invoke(program, [verb, str(slipped), *options], env={"COLUMNS": "2000"})
    assert answer.exit_code == 0, answer.output
    assert SENTENCE in answer.output


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--flow-mass", "50", "--barrier-mass", "100"], "in t it makes 1852 kg/m^3"),
        (["--flow-mass", "50000", "--barrier-mass", "168"], "168000 was probably meant, the value is in t/m"),
        (["--flow-mass", "50000", "--barrier-mass", "168000", "--base-friction", "16"], "were meant, 0.29"),
        (["--flow-mass", "50000", "--fixed", "--speed", "43"], "in km/h, 11.9 m/s"),
        (["--flow-mass", "50000", "--fixed", "--face-angle", "1.05"], "in radians, 60.2"),
    ],
)
def test_numbers_of_the_command_line_are_looked_at_too(options, words):
    given = ["--flow-length", "9", "--flow-height", "3", "--base-friction", "0.3"]
    given += [] if "--speed" in options else ["--speed", "10"]
    answer = CliRunner().invoke(analytic.cli.app, ["predict", *given, *options])
    assert answer.exit_code == 0, answer.output
    assert words in answer.output
    answer = CliRunner().invoke(
        analytic.cli.app, ["predict", *given, "--flow-mass", "50000", "--fixed", "--speed", "9"]
    )
    assert "meant" not in answer.output
    assert "km/h" not in answer.output


def test_design_looks_at_its_numbers(tmp_path):
    given = ["design", "--limit", "0.5", "--flow-length", "9", "--flow-height", "3", "--speed", "10"]
    given += ["--base-friction", "0.3", "--density"]
    assert "in t it makes 1950 kg/m^3" in CliRunner().invoke(analytic.cli.app, [*given, "1.95"]).output
    assert "in t it makes" not in CliRunner().invoke(analytic.cli.app, [*given, "1950"]).output


def test_the_card_has_what_an_engineer_asks_for(load_scene):
    assert described_material(load_scene("case_1")) == (
        "bulk density 1,800 kg/m³, n = 0.5, φ' = 20°, k = 0.0001 m/s, E = 2 MPa, K0 = 0.66 (given); "
        "L = 15 m, of the box of its volume and depth"
    )
    started = load_scene(
        "case_1", **{"flow.initial_pore_pressure_ratios": [[-9, 0.6], [-3, 1]], "flow.base_velocity_share": 0.5}
    )
    assert "λ_p = 0.6 to 1" in described_material(started)
    assert "v = 10 m/s (Fr 1.84), from 0.5 to 1.5 of it over the depth;" in described(started)[0]
    dry = described_material(load_scene("case_1_dry", **{"flow.lateral_stress_coefficient": None}))
    assert "k = " not in dry
    assert "K0 = 0.658 (by the law mohr_coulomb)" in dry
    answer = CliRunner().invoke(app, ["check", "scenarios/case_1.json"])
    assert "bulk density 1,800 kg/m³" in answer.output
