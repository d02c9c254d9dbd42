"""The numbers by which `check` and `plan` tell what rules in a flow."""

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.effect_rules import with_law
from warp_mpm.regime import described_regime, regime, suggestion

SCENES = Path(__file__).parents[2] / "scenarios"


def test_numbers_of_case_1_by_hand(load_scene):
    rate, head = 10.0 / 3.0, 1600.0 * 9.81 * 3.0
    numbers = regime(load_scene("case_1"))
    assert numbers == pytest.approx(
        {
            "Fr": 10.0 / math.sqrt(9.81 * 3.0),
            "Savage": 2600.0 * (rate * 0.01) ** 2 / head,
            "Bagnold": 2600.0 * 1e-4 * rate / 1e-3,
            "friction": head * 0.6 / (rate * 1e-3),
            "Stokes": 2600.0 * 1e-4 * rate / 1e-3,
            # h v / c_v with c_v = k E_oed / (ρ_L g)
            "drainage": 30.0 / (1e-4 * 2.4e6 / 9810.0),
        }
    )


def test_numbers_of_the_laws_by_hand(load_scene):
    mud, grains = load_scene("case_1_mud"), load_scene("case_1_mu_i")
    rate, pressure = 10.0 / 3.0, 0.5 * 1600.0 * 9.81 * 3.0
    assert regime(mud)["Bingham"] == pytest.approx(500.0 / (20.0 * rate))
    numbers = regime(grains)
    assert numbers["I"] == pytest.approx(rate * 0.01 * math.sqrt(2600.0 / pressure))
    assert numbers["J"] == pytest.approx(1e-3 * rate / pressure)
    # As the Stokes number is the ratio of the two.
    assert numbers["I"] ** 2 / numbers["J"] == pytest.approx(numbers["Stokes"])
    assert 0.38 < numbers["μ"] < 0.64


@pytest.mark.parametrize(
    ("name", "law", "own", "words"),
    [
        ("case_1", None, {}, "friction of the grains rules: mohr_coulomb"),
        ("case_1_mud", None, {"yield_stress_Pa": 1e5}, "most of the flow is a plug"),
        ("case_1_mud", None, {"yield_stress_Pa": 1.0}, "viscosity rules"),
        ("case_1_mu_i", None, {}, "inertia of the grains rules: mu_i by I"),
        ("case_1_mu_i", None, {"fluid_viscosity_Pa_s": 100.0}, "the fluid rules: mu_i by J"),
        ("case_1_mu_i", None, {"fluid_viscosity_Pa_s": 1.0}, "both count"),
        ("case_1", "coulomb_viscous", {"mixture_viscosity_Pa_s": 1.0}, "mohr_coulomb would do"),
        ("case_1", "coulomb_viscous", {"mixture_viscosity_Pa_s": 500.0}, "both count: coulomb_viscous"),
        ("case_1", None, {"liquid_viscosity_Pa_s": 10.0}, "the liquid's viscosity counts"),
    ],
)
def test_what_the_numbers_suggest(load_scene, name, law, own, words):
    scenario = load_scene(name)
    if law is None:
        scenario = scenario.replaced({f"flow.material.{field}": value for field, value in own.items()})
    else:
        scenario = scenario.replaced(with_law(scenario, law, friction_angle_deg=20.0, **own))
    assert words in suggestion(scenario)
    assert described_regime(scenario).endswith(suggestion(scenario))


def test_fast_thin_coarse_flow_collides(load_scene):
    thin = load_scene("case_1_dry", **{"flow.shape.depth_m": 0.1, "numerics.spacing_m": 0.02})
    assert "grains collide: mu_i" in suggestion(thin)


def test_a_flow_at_rest_or_without_weight_has_less_to_say(load_scene):
    still = load_scene("case_1", **{"flow.velocity_m_per_s": [0.0, 0.0]})
    assert suggestion(still) == ""
    assert described_regime(still).startswith("regime: Fr 0")
    weightless = load_scene("case_1_dry", **{"gravity.acceleration_m_per_s2": 0.0})
    assert described_regime(weightless) == ""
    assert not {"Fr", "Savage"} & set(regime(load_scene("case_1", **{"gravity.acceleration_m_per_s2": 0.0})))


def test_check_and_plan_tell_it():
    told = CliRunner().invoke(app, ["check", str(SCENES / "case_1_mud.json")])
    assert "  regime: Fr 1.84, " in told.stdout
    assert "Bingham 7.50" in told.stdout
    card = CliRunner().invoke(app, ["plan", str(SCENES / "case_1_dry.json"), "--spacing", "0.5", "--json"])
    assert json.loads(card.stdout)["regime"]["Fr"] == pytest.approx(1.8433, abs=1e-4)
