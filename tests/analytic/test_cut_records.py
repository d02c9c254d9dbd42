"""Force records of any shape, cut anywhere: what can be told of them is told, the rest is bounded or refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analytic.calibration import (
    RULES,
    Calibration,
    CalibrationError,
    NoImpactError,
    calibrate,
    measure,
    measured_key_figures,
    misfit,
    warnings,
)
from analytic.force_record import cumulative_impulse, impact_end, moving_mean, still_rises
from analytic.scene import Scene
from warp_mpm.summary import impact_figures

SLIDING = Scene(
    flow_mass=81000.0, flow_length=15.0, flow_height=3.0, speed=10.0, barrier_mass=90000.0, base_friction=0.29
)
INTERVAL = 0.005
LONGEST = 160


def shape(kind: str, number: int, seed: int) -> np.ndarray:
    """Forces [N/m] of a kind at so many times."""
    draw = np.random.default_rng(seed)
    at = np.arange(number) * INTERVAL
    start, peak, end = np.sort(draw.uniform(0.0, LONGEST * INTERVAL, 3))
    impact = 4e5 * np.interp(at, [start, peak, end], [0.0, 1.0, draw.uniform(0.0, 0.5)], left=0.0)
    spikes = np.where(draw.uniform(size=number) < 0.1, draw.uniform(-1e6, 1e7, number), 0.0)
    kinds = {
        "impact": impact,
        "noisy impact": impact * (1.0 + draw.normal(0.0, 0.5, number)),
        "rising": 1e5 * at,
        "falling": 1e5 * (LONGEST * INTERVAL - at),
        "flat": np.full(number, 1e5),
        "nil": np.zeros(number),
        "negative": -impact,
        "spikes": spikes,
        "spike in a pull": spikes - 1e5,
        "of all sizes": draw.normal(size=number) * 10.0 ** draw.uniform(-12.0, 12.0, number),
    }
    return kinds[kind]


KINDS = ["impact", "noisy impact", "rising", "falling", "flat", "nil", "negative", "spikes", "spike in a pull"]
KINDS += ["of all sizes"]


@st.composite
def records(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Times and forces, of even or uneven intervals."""
    number = draw(st.integers(0, LONGEST))
    force = shape(draw(st.sampled_from(KINDS)), number, draw(st.integers(0, 10_000)))
    time = np.arange(number) * INTERVAL
    if draw(st.booleans()) and number > 2:
        time[-1] = time[-2] + INTERVAL * draw(st.floats(1e-3, 1.0))
    return time, force


@given(records())
def test_the_figures_of_any_record_are_numbers_or_not_there(record: tuple[np.ndarray, np.ndarray]) -> None:
    time, force = record
    figures = impact_figures(time, force)
    told = [value for value in figures.values() if value is not None]
    assert np.isfinite(told).all()
    if len(time) < 2:
        assert told == []
        return
    assert figures["impulse"] == pytest.approx(float(force[1:] @ np.diff(time)), rel=1e-9, abs=1e-6)
    assert figures["peak_force"] == max(force.max(), 0.0)
    if figures["peak_force_filtered"] is None:
        assert moving_mean(time, force).max() <= 0.0
        return
    assert (figures["rise_time"] is None) is figures["force_still_rises"]
    if figures["force_still_rises"]:
        assert figures["peak_force_filtered_time"] == time[-1]
        assert figures["impact_end_time"] is None
    if figures["impact_end_time"] is not None:
        assert figures["impact_start_time"] < figures["impact_end_time"] <= time[-1]


def calibrated(time: np.ndarray, force: np.ndarray, rule: str) -> Calibration | str:
    """The fit, or why there is none."""
    try:
        return calibrate(time, force, SLIDING, rule=rule)
    except CalibrationError as error:
        return str(error)


@given(records())
def test_any_record_is_measured_or_refused_in_a_sentence(record: tuple[np.ndarray, np.ndarray]) -> None:
    time, force = record
    series = {"time": time, "impact_force_x": force}
    if len(time) < 3:
        with pytest.raises(CalibrationError, match="samples, it must have three at least"):
            measure(time, force)
        return
    if not (force.max() > 0 and moving_mean(time, force).max() > 0):
        with pytest.raises(NoImpactError, match="never above nil"):
            measure(time, force)
        assert measured_key_figures(series, None).at_least == ("peak_force", "impulse")
        assert warnings(series, None)
        return
    measured = measure(time, force)
    theirs = impact_figures(time, force)
    assert measured.over is (theirs["impact_end_time"] is not None)
    assert measured.rises is theirs["force_still_rises"]
    assert measured.peak_force == theirs["peak_force_filtered"]
    found = measured_key_figures(series, measured)
    numbers = [value for value in vars(found).values() if isinstance(value, float)]
    assert np.isfinite(numbers).all()
    assert ("peak_force" in found.at_least) is measured.rises
    assert bool(warnings(series, measured)) is not measured.over


@pytest.mark.filterwarnings("error")
@given(records())
def test_any_record_is_calibrated_on_or_refused_in_a_sentence(record: tuple[np.ndarray, np.ndarray]) -> None:
    time, force = record
    for rule in RULES:
        fit = calibrated(time, force, rule)
        if isinstance(fit, str):
            assert fit.endswith(".")
            assert "\n" not in fit
            continue
        assert np.isfinite([fit.s1max, fit.geometry_change, fit.rise_ratio]).all()
        assert np.isfinite(misfit(fit.impact, {"time": time, "impact_force_x": force}, fit.measured).force)


@pytest.mark.parametrize("number", range(2, LONGEST, 7))
def test_an_impact_cut_before_its_peak_still_rises(number: int) -> None:
    time = np.arange(number) * INTERVAL
    figures = impact_figures(time, 1e6 * time**2)
    assert figures["force_still_rises"] is True
    assert figures["rise_time"] is None
    assert figures["impact_end_time"] is None
    assert figures["peak_force"] == 1e6 * time[-1] ** 2


def test_a_steady_force_is_never_over() -> None:
    """Rounding makes one of its moving means the greatest; the impact has not ended there."""
    for number in range(2, 200):
        time = np.arange(number) * INTERVAL
        assert impact_figures(time, np.full(number, 0.1))["impact_end_time"] is None


def test_the_end_of_a_record_that_rises_to_its_end_is_the_record_s() -> None:
    """Over a record shorter than ten filter windows the residual force is above the filtered peak."""
    time = np.arange(41) * INTERVAL
    force = np.where(time > 0.17, 1e6 * (time - 0.17), 0.0)
    filtered = moving_mean(time, force)
    end = impact_end(time, force, filtered, 0.17)
    assert end.residual_force > filtered.max()
    assert (end.time, end.over) == (time[-1], False)


def test_a_record_of_nothing() -> None:
    nothing = np.zeros(0)
    assert cumulative_impulse(nothing, nothing).shape == (0,)
    assert moving_mean(nothing, nothing).shape == (0,)
    assert not still_rises(nothing)
    assert set(impact_figures(nothing, nothing).values()) == {None}


def test_a_force_that_is_no_number_is_an_error() -> None:
    """The greatest of numbers and NaN is none, which is not above nil either: it would pass for no impact."""
    time = np.arange(10) * INTERVAL
    with pytest.raises(ValueError, match=r"impact force at t = 0\.015 s is not a finite number"):
        impact_figures(time, np.where(time == 3 * INTERVAL, np.nan, 1.0))


@pytest.mark.parametrize("record", ["rising", "nil"])
def test_what_is_to_come_bounds_the_barrier_s_motion_too(record: str) -> None:
    time = np.arange(40) * INTERVAL
    still = np.zeros(40)
    series = {"time": time, "impact_force_x": shape(record, 40, 0), "barrier_velocity": still}
    series |= {"barrier_displacement": still, "barrier_kinetic_energy": still}
    measured = None if record == "nil" else measure(time, series["impact_force_x"])
    bound = measured_key_figures(series, measured).at_least
    assert {"peak_force", "barrier_displacement_final", "barrier_velocity_max", "barrier_kinetic_energy_max"} <= set(
        bound
    )
