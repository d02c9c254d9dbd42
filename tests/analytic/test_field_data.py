"""Pressure formulas and field events: known limits, published slopes on the generated set, and errors by line."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analytic.empirical import MODELS, Confidence, froude_number, reflected_depth_ratio, select
from analytic.field_data import (
    PUBLISHED_RANGES,
    FieldDataError,
    agreement,
    read_events,
    synthetic_events,
    write_events,
)
from analytic.scene import Scene

SHIPPED = Path(__file__).parents[2] / "docs" / "data" / "synthetic_events.csv"

DENSITY, SPEED, HEIGHT = 1800.0, 10.0, 3.0
HYDRODYNAMIC = DENSITY * SPEED**2


@given(st.floats(0.05, 100))
def test_reflected_bore_keeps_mass_and_momentum(froude: float) -> None:
    """A bore of celerity c leaves a wall: (v + c) h = c x h and g (x^2 - 1) h^2 / 2 = (v + c) h v, with h = g = 1."""
    x = float(reflected_depth_ratio(froude))
    celerity = froude / (x - 1)
    assert celerity * x == pytest.approx(froude + celerity, rel=1e-9)
    assert (x**2 - 1) / 2 == pytest.approx((froude + celerity) * froude, rel=1e-9)


def test_formulas_in_their_dimensionless_form() -> None:
    fr = float(froude_number(SPEED, HEIGHT))
    over_hydrodynamic = {
        name: float(m.pressure(DENSITY, SPEED, HEIGHT)) / HYDRODYNAMIC for name, m in _usable().items()
    }
    assert over_hydrodynamic["closed_form"] == pytest.approx(0.75 / 0.72)
    assert over_hydrodynamic["huebl_holzinger_2003"] == pytest.approx(4.5 * fr**-1.2)
    assert over_hydrodynamic["armanini_2011"] == pytest.approx((1 + 1 / (np.sqrt(2) * fr)) ** 2)
    assert over_hydrodynamic["cui_2015"] == pytest.approx(5.3 * fr**-1.5)
    assert over_hydrodynamic["momentum_jet"] == pytest.approx(1 + 0.5 / fr**2)
    assert over_hydrodynamic["shallow_water_bore"] == pytest.approx(float(reflected_depth_ratio(fr)) ** 2 / (2 * fr**2))


def _usable() -> dict[str, Any]:
    return {name: model for name, model in MODELS.items() if model.usable}


@given(st.floats(1, 1e3), st.floats(0.1, 10), st.floats(0.5, 30))
def test_the_fixed_closed_form_is_a_hydrodynamic_formula(length: float, height: float, speed: float) -> None:
    """Length, volume and depth cancel: F_peak / h = (0.75 / lambda) rho v^2."""
    scene = Scene(flow_mass=1800 * length * height, flow_length=length, flow_height=height, speed=speed)
    assert scene.impact().peak_pressure == pytest.approx(float(MODELS["closed_form"].pressure(1800, speed, height)))


def test_what_could_not_be_verified_is_off_and_takes_the_user_s_coefficients() -> None:
    unverified = [name for name, model in MODELS.items() if model.confidence is Confidence.UNVERIFIED]
    assert set(unverified) == {"hungr_1984", "vagnon_2020", "di_perna_2022"}
    assert not set(unverified) & {model.name for model in select()}
    assert all(value is None for name in unverified for value in MODELS[name].coefficients.values())
    with pytest.raises(ValueError, match=r"vagnon_2020 could not be verified and needs your coefficient a"):
        select(["vagnon_2020"])
    with pytest.raises(ValueError, match=r"vagnon_2020 could not be verified and needs your coefficient b"):
        select(coefficients={"vagnon_2020": {"a": 1.0}})
    chosen = {m.name: m for m in select(coefficients={"vagnon_2020": {"a": 0.5, "b": 2.0}})}
    expected = 0.5 * DENSITY * 9.81 * HEIGHT + 2 * HYDRODYNAMIC
    assert float(chosen["vagnon_2020"].pressure(DENSITY, SPEED, HEIGHT)) == pytest.approx(expected)


def test_bad_choices_are_named() -> None:
    with pytest.raises(ValueError, match=r"model is 'vagnon', it must be one of closed_form, huebl"):
        select(["vagnon"])
    with pytest.raises(ValueError, match=r"armanini_2011 has no coefficient 'k', it has none"):
        select(coefficients={"armanini_2011": {"k": 1.0}})
    with pytest.raises(ValueError, match=r"cui_2015: k is nan"):
        select(coefficients={"cui_2015": {"k": np.nan}})
    with pytest.raises(ValueError, match=r"speed is -1, it must be a number in \(0, inf\)"):
        MODELS["cui_2015"].pressure(1800, -1.0, 3)


# Slope of computed over measured pressures and three times its standard deviation over 400 seeds, from the audit.
SLOPES = {"armanini_2011": (1.613, 0.053), "cui_2015": (0.932, 0.13), "huebl_holzinger_2003": (1.131, 0.13)}


@pytest.mark.parametrize("seed", range(5))
def test_the_generated_set_gives_the_published_slopes(seed: int) -> None:
    events = synthetic_events(seed=seed)
    assert len(events) == 139
    for name, (slope, spread) in SLOPES.items():
        assert agreement(MODELS[name], events).slope == pytest.approx(slope, abs=spread)
    closed_form = agreement(MODELS["closed_form"], events)
    assert closed_form.slope == pytest.approx(0.75 / 0.72 / 0.90, rel=1e-12)
    assert closed_form.scatter == pytest.approx(0, abs=1e-12)
    for name, (low, high) in PUBLISHED_RANGES.items():
        values = getattr(events, name)
        assert low <= values.min()
        assert values.max() <= high
    assert events.peak_pressure.min() >= 14e3
    assert events.peak_pressure.max() <= 435e3


def test_relative_error_is_divided_by_the_computed_value() -> None:
    events = synthetic_events()
    found = agreement(MODELS["armanini_2011"], events)
    assert found.relative_error == pytest.approx(1 - events.peak_pressure / found.pressure)
    assert found.relative_error.max() < 1


def test_the_shipped_set_is_the_generated_one_and_says_so(tmp_path: Path) -> None:
    shipped = read_events(SHIPPED)
    assert shipped.synthetic
    assert SHIPPED.read_text().startswith("# SYNTHETIC")
    write_events(synthetic_events(), tmp_path / "again.csv")
    again = read_events(tmp_path / "again.csv")
    assert again.synthetic
    for name in ("density", "speed", "height", "peak_pressure"):
        assert np.array_equal(getattr(shipped, name), getattr(again, name))


def test_units_separators_and_other_columns(tmp_path: Path) -> None:
    path = tmp_path / "events.csv"
    path.write_text(
        "# measured by us\nevent;speed [km/h];height [cm];density [t/m³];peak_pressure [MPa];note\n"
        "a;36;150;1.9;0.19;dry\nb;18;80;2.1;0.05;\n"
    )
    events = read_events(path)
    assert not events.synthetic
    assert events.speed == pytest.approx([10, 5])
    assert events.height == pytest.approx([1.5, 0.8])
    assert events.density == pytest.approx([1900, 2100])
    assert events.peak_pressure == pytest.approx([190e3, 50e3])


HEADER = "density [kg/m3],speed [m/s],height [m],peak_pressure [kPa]\n"


@pytest.mark.parametrize(
    ("text", "sentences"),
    [
        ("", [r"holds no event"]),
        (HEADER, [r"holds no event"]),
        (HEADER.replace("[kPa]", "[bar]") + "1800,5,1,40\n", [r"column peak_pressure has the unit .bar., .*\[kPa\]"]),
        (HEADER.replace(" [m/s]", "") + "1800,5,1,40\n", [r"column speed has no unit, it must be one of \[m/s\]"]),
        (HEADER.replace("height [m],", "") + "1800,5,40\n", [r"column height \[m\] is missing"]),
        (
            HEADER.strip() + ",peak_pressure [Pa]\n1800,5,1,40,40000\n",
            [r"column peak_pressure is given twice, in kPa and in Pa"],
        ),
        (HEADER + "1800,5,1,40\n1800,5,1,40 kPa\n", [r"line 3: peak_pressure is .40 kPa., it must be a plain number"]),
        (HEADER + "1800,5,1\n", [r"line 2 has 3 cells, the header has 4"]),
        (HEADER + "1.8,5,1,40\n1800,-5,1,40\n1800,nan,1,40\n", [
            r"line 2: density is 1\.8 kg/m3, it must be in \[500, 4000\] kg/m3",
            r"line 3: speed is -5 m/s, it must be in \[0\.01, 100\] m/s",
            r"line 4: speed is nan m/s",
        ]),
        (HEADER + "1800,5,1,40\n1800,5,1,40000\n", [r"line 3: peak_pressure is 638 times density .* is it in kPa\?"]),
    ],
)  # fmt: skip
def test_every_bad_line_is_named(tmp_path: Path, text: str, sentences: list[str]) -> None:
    path = tmp_path / "events.csv"
    path.write_text(text)
    with pytest.raises(FieldDataError) as error:
        read_events(path)
    assert len(error.value.problems) == len(sentences)
    for line, sentence in zip(str(error.value).splitlines(), sentences, strict=True):
        assert line.startswith(f"{path}: ")
        assert re.search(sentence, line)


def test_many_bad_lines_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "events.csv"
    path.write_text(HEADER + "0,5,1,40\n" * 30)
    with pytest.raises(FieldDataError, match=r"\.\.\. and 20 more\."):
        read_events(path)
    with pytest.raises(FieldDataError, match="cannot be read"):
        read_events(tmp_path / "none.csv")


EVENT = "2000,5.0,0.5,45.0\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (HEADER + '"2000\n",5,1,45\n' + EVENT, "line 2 opens a quote that is not closed in the line"),
        (HEADER + EVENT + '"2000,5,1,45\n', "line 3 opens a quote that is not closed in the line"),
        ('"' + HEADER + EVENT, "line 1 opens a quote that is not closed in the line"),
        (HEADER + '"2000"x,5,1,45\n', "line 2 cannot be split into cells"),
        (HEADER + EVENT + "x" * 140_000 + ",5,1,45\n", "line 3 has a cell of more than 131,072 characters"),
        ("d" * 140_000 + "," + HEADER + EVENT, "line 1 has a cell of more than 131,072 characters"),
    ],
)
def test_lines_that_are_no_cells_are_named_with_the_reason(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "events.csv"
    path.write_text(text)
    with pytest.raises(FieldDataError, match=re.escape(sentence)):
        read_events(path)


def test_quoted_cells_are_read(tmp_path: Path) -> None:
    path = tmp_path / "events.csv"
    path.write_text('"place, time",' + HEADER + '"Jiangjia, 1999",' + EVENT)
    assert read_events(path).speed.tolist() == [5.0]
