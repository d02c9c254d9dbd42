"""Calibration on records made by the closed form itself, with and without noise, and on records that hold no impact."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analytic import calibration
from analytic.arrays import trajectory
from analytic.calibration import WIDEST_WINDOW, CalibrationError, calibrate, measure, misfit, window_of
from analytic.force_record import FILTER_WINDOW, SETTLED_SHARE
from analytic.impact import Impact
from analytic.scene import Scene
from analytic.time_series import TimeSeriesError, read_time_series
from warp_mpm.summary import impact_figures

SLIDING = Scene(
    flow_mass=81000.0, flow_length=15.0, flow_height=3.0, speed=10.0, barrier_mass=90000.0, base_friction=0.29
)
FIXED = Scene(flow_mass=81000.0, flow_length=15.0, flow_height=3.0, speed=10.0)


def record(impact: Impact, interval: float = 0.005, end: float = 5.0, noise: float = 0.0) -> dict[str, np.ndarray]:
    """What the simulator would write of this impact: forces as means over intervals, the rest at their ends."""
    time = np.arange(round(end / interval) + 1) * interval
    curves = trajectory(impact, time)
    force = np.concatenate([[0.0], np.diff(curves.impulse) / interval])
    draw = np.random.default_rng(7)
    acting = force > 0
    force = force + noise * impact.peak_force * draw.standard_normal(len(force)) * acting
    return {
        "time": time,
        "impact_force_x": force,
        "flow_kinetic_energy": curves.flow_kinetic_energy,
        "barrier_velocity": curves.barrier_velocity,
        "barrier_displacement": curves.barrier_displacement,
        "barrier_kinetic_energy": curves.barrier_kinetic_energy,
    }


@pytest.mark.parametrize("scene", [SLIDING, FIXED], ids=["sliding", "fixed"])
@pytest.mark.parametrize(("geometry_change", "rise_ratio"), [(0.41, 0.35), (0.72, 0.2), (0.3, 0.6)])
def test_both_rules_find_the_numbers_that_made_the_record(
    scene: Scene, geometry_change: float, rise_ratio: float
) -> None:
    impact = scene.impact(geometry_change=geometry_change, rise_ratio=rise_ratio, arrival_time=0.3)
    series = record(impact)
    peak = calibrate(series["time"], series["impact_force_x"], scene)
    # A moving mean of width w takes w / 4 times the mean slope off a triangle's tip, and blurs its time by w / 2.
    window = FILTER_WINDOW
    cut = window / 4 * (1 / rise_ratio + 1 / (1 - rise_ratio)) / impact.duration / 2
    assert peak.geometry_change == pytest.approx(geometry_change, rel=1.2 * cut)
    assert peak.geometry_change > geometry_change
    assert peak.rise_ratio == pytest.approx(rise_ratio, abs=window / impact.duration)
    fit = calibrate(series["time"], series["impact_force_x"], scene, rule="least_squares")
    # The arrival is seen when the force has reached 1 % of its peak, and to one interval.
    late = (0.01 * rise_ratio * impact.duration + 0.005) / impact.duration
    assert fit.geometry_change == pytest.approx(geometry_change, rel=late)
    assert fit.rise_ratio == pytest.approx(rise_ratio, abs=late)
    assert fit.within_range
    assert peak.within_range


def test_least_squares_is_steady_under_noise_where_the_peak_is_not() -> None:
    impact = SLIDING.impact(geometry_change=0.41, rise_ratio=0.35, arrival_time=0.3)
    series = record(impact, noise=0.2)
    fit = calibrate(series["time"], series["impact_force_x"], SLIDING, rule="least_squares")
    # 330 samples with a noise of 20 % of the peak leave about 0.2 / sqrt(330) = 1 % in each number; three of them.
    assert fit.geometry_change == pytest.approx(0.41, rel=0.03)
    assert fit.rise_ratio == pytest.approx(0.35, abs=0.03)
    peak = calibrate(series["time"], series["impact_force_x"], SLIDING)
    assert peak.geometry_change < fit.geometry_change  # the highest of many noisy values is too high a peak
    assert abs(peak.rise_ratio - 0.35) > 2 * abs(fit.rise_ratio - 0.35)


def test_a_shorter_filter_finds_a_higher_peak_and_the_rule_is_stated() -> None:
    series = record(SLIDING.impact(geometry_change=0.41, rise_ratio=0.35), noise=0.1)
    found = [calibrate(series["time"], series["impact_force_x"], SLIDING, filter_window=w) for w in (0.0, 0.05, 0.2)]
    assert found[0].geometry_change < found[1].geometry_change < found[2].geometry_change
    assert "moving mean over 0.2 s" in found[2].measured.filter_rule


@pytest.mark.parametrize("window", [0.02, 0.1, 0.3])
def test_the_window_that_a_lambda_needs_is_the_one_that_gives_it(window: float) -> None:
    series = record(FIXED.impact(geometry_change=0.5, rise_ratio=0.3, arrival_time=0.3))
    time, force = series["time"], series["impact_force_x"]
    asked = calibrate(time, force, FIXED, filter_window=window).geometry_change
    found = window_of(asked, time, force, FIXED)
    # Windows are looked at in steps of 2 %, and samples of 5 ms make the peak's fall one of steps.
    assert found.window == pytest.approx(window, rel=0.05, abs=0.005)
    assert f"a moving mean over {found.window:.2g} s" in found.words
    again = calibrate(time, force, FIXED, filter_window=found.window)
    assert again.measured.peak_force == pytest.approx(found.peak_force, rel=0.005)


def test_a_lambda_that_no_window_gives_is_said() -> None:
    series = record(FIXED.impact(geometry_change=0.9, rise_ratio=0.3, arrival_time=0.3))
    time, force = series["time"], series["impact_force_x"]
    none = window_of(0.72, time, force, FIXED)
    assert none.window is None
    assert "needs a peak of 562 kN/m, and no moving mean reaches that" in none.words
    wide = window_of(5.0, time, force, FIXED)
    assert wide.window == pytest.approx(WIDEST_WINDOW)
    assert wide.words.endswith("over 0.5 s or more")


def test_misfit_of_the_right_model_is_nil_and_of_a_wrong_one_is_not() -> None:
    right = SLIDING.impact(geometry_change=0.41, rise_ratio=0.35, arrival_time=0.3)
    series = record(right)
    measured = measure(series["time"], series["impact_force_x"])
    good, bad = misfit(right, series, measured), misfit(SLIDING.impact(geometry_change=0.6), series, measured)
    # A force that is the mean over an interval of 0.005 s lags its end by a slope times half the interval.
    assert good.force < 0.005
    for name in ("flow_kinetic_energy", "barrier_velocity", "barrier_displacement"):
        assert getattr(good, name) < 1e-12
        assert getattr(bad, name) > 0.02
    assert misfit(right, {name: series[name] for name in ("time", "impact_force_x")}, measured).barrier_velocity is None


def test_key_figures_of_record_and_model_agree() -> None:
    impact = SLIDING.impact(geometry_change=0.41, rise_ratio=0.35, arrival_time=0.3)
    series = record(impact)
    measured = measure(series["time"], series["impact_force_x"])
    found, expected = calibration.measured_key_figures(series, measured), calibration.key_figures(impact)
    assert found.barrier_displacement_final == pytest.approx(expected.barrier_displacement_final)
    assert found.barrier_kinetic_energy_max == pytest.approx(expected.barrier_kinetic_energy_max, rel=1e-4)
    assert found.barrier_velocity_max == pytest.approx(expected.barrier_velocity_max, rel=1e-4)
    assert found.peak_force == pytest.approx(expected.peak_force, rel=0.03)
    assert found.rise_time == pytest.approx(expected.rise_time, abs=0.03)
    # The end of the impact is where a tenth of the peak is left: 1 % of the impulse of the falling side is cut off.
    assert found.impulse == pytest.approx(expected.impulse, rel=0.011)
    assert found.duration == pytest.approx(expected.duration * (1 - 0.1 * 0.65), abs=0.03)


@pytest.mark.parametrize("share", [0.4, 0.6, 0.9])
def test_a_record_that_ends_before_the_impact_is_told(share: float) -> None:
    """Of a force that falls evenly, the last tenth looks like a residual force, over which the rest is soon over."""
    impact = SLIDING.impact(geometry_change=0.72, rise_ratio=0.2, arrival_time=0.3)
    whole = measure(*(record(impact)[name] for name in ("time", "impact_force_x")))
    assert whole.over
    assert whole.warning is None
    assert whole.at_least == ()
    series = record(impact, end=0.3 + share * impact.duration)
    found = measure(series["time"], series["impact_force_x"])
    assert not found.over
    assert found.at_least == ("duration", "impulse")
    assert f"the force is {found.residual_force / found.peak_force:.0%} of its peak" in (found.warning or "")
    assert found.duration < whole.duration
    assert found.impulse < whole.impulse
    assert found.peak_force == whole.peak_force


def test_a_surge_at_the_end_of_the_record_is_not_the_end_of_the_impact() -> None:
    series = record(SLIDING.impact(geometry_change=0.41, rise_ratio=0.35))
    force = series["impact_force_x"] + 1e5 * (series["time"] > 4.9)
    found = measure(series["time"], force)
    assert found.residual_force < SETTLED_SHARE * found.peak_force
    assert not found.over


def test_the_steady_thrust_of_a_flow_at_rest_is_no_impact() -> None:
    series = record(SLIDING.impact(geometry_change=0.41, rise_ratio=0.35))
    force = np.maximum(series["impact_force_x"], 1.5e5 * (series["time"] > 0.5))
    found = measure(series["time"], force)
    assert found.residual_force > 0.25 * found.peak_force
    assert found.over


@pytest.mark.parametrize("end", [1.0, 1.5, 2.0, 2.5, 3.0, 4.0])
def test_the_simulator_s_summary_judges_alike(end: float) -> None:
    series = record(SLIDING.impact(geometry_change=0.72, rise_ratio=0.2), end=end)
    theirs = impact_figures(series["time"], series["impact_force_x"])
    found = measure(series["time"], series["impact_force_x"])
    assert found.over is (theirs["impact_end_time"] is not None)
    if found.over:
        assert found.duration == pytest.approx(theirs["impact_duration"], rel=1e-12)


def test_a_barrier_that_still_moves_is_told() -> None:
    impact = SLIDING.impact(geometry_change=0.41, rise_ratio=0.35)
    for end, moving in ((1.6, True), (5.0, False)):
        series = record(impact, end=end)
        measured = measure(series["time"], series["impact_force_x"])
        bound = calibration.measured_key_figures(series, measured).at_least
        assert ("barrier_displacement_final" in bound) is moving
        assert any("the barrier still moves" in warning for warning in calibration.warnings(series, measured)) is moving
        assert "barrier_velocity_max" not in bound


def test_vertical_load_ratio_is_read_from_the_base_normal_force() -> None:
    impact = SLIDING.impact(geometry_change=0.41, rise_ratio=0.35, arrival_time=0.3)
    series = record(impact)
    weight = 90000 * 9.81
    normal = weight + 0.6 * series["impact_force_x"]
    measured = measure(series["time"], series["impact_force_x"])
    found = calibration.measured_vertical_load_ratio(series["time"], series["impact_force_x"], normal, weight, measured)
    assert found == pytest.approx(0.6)


def test_a_peak_too_low_for_the_model_is_flagged_and_clipped() -> None:
    impact = FIXED.impact(geometry_change=1.0, rise_ratio=0.35, arrival_time=0.3)
    series = record(impact)
    found = calibrate(series["time"], 0.8 * series["impact_force_x"], FIXED)
    assert found.geometry_change > 1.2
    assert not found.within_range
    assert found.impact.geometry_change_length == 15.0
    fitted = calibrate(series["time"], 0.8 * series["impact_force_x"], FIXED, rule="least_squares")
    assert not fitted.within_range


TIME = np.linspace(0, 1, 101)


@pytest.mark.parametrize(
    ("time", "force", "options", "sentence"),
    [
        (TIME, np.zeros(101), {}, "never above nil"),
        (TIME, TIME, {}, "still rises when the record ends"),
        (TIME, np.ones(100), {}, "must be alike"),
        (TIME, np.full(101, np.nan), {}, "must be finite"),
        (TIME[::-1], np.ones(101), {}, "time must increase"),
        (TIME, np.sin(3 * TIME), {"filter_window": -1.0}, "filter_window is -1"),
        (
            TIME,
            np.sin(3 * TIME),
            {"filter_window": 5.0},
            "filter_window is 5, it must be at most 1 s, the record's length",
        ),
        (TIME, np.sin(3 * TIME), {"rule": "best"}, "rule is 'best', it must be one of peak, least_squares"),
    ],
)
def test_records_without_an_impact_are_refused(
    time: np.ndarray, force: np.ndarray, options: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(CalibrationError, match=sentence):
        calibrate(time, force, SLIDING, **options)


def test_reads_units_and_leaves_an_unfinished_line(tmp_path: Path) -> None:
    path = tmp_path / "timeseries.csv"
    path.write_text("time [s],impact_force_x [kN/m],speed_max [m/s]\n0,0,1\n0.1,2,1\n0.2,3,1\n0.3,1,1\n0.4,")
    series = read_time_series(tmp_path)
    assert series["impact_force_x"].tolist() == [0, 2000, 3000, 1000]
    assert series.keys() == {"time", "impact_force_x"}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("time [s],force\n0,0\n1,1\n2,2\n", r"column impact_force_x \[N/m\] is missing"),
        ("time [h],impact_force_x [N/m]\n0,0\n1,1\n2,2\n", r"column time has the unit 'h', .* \[s\], \[ms\]"),
        ("time,impact_force_x [N/m]\n0,0\n1,1\n2,2\n", r"column time has the unit ''"),
        ("time [s];impact_force_x [N/m]\n0;0\n1;1\n2;2\n", r"there are semicolons between its columns, .* commas"),
        ("time [s],impact_force_x [N/m]\n0,0\n1,1\n", r"fewer than three samples"),
        ("time [s],impact_force_x [N/m]\n0,0\n1,x\n2,2\n", r"something else than rows of numbers"),
        ("time [s],impact_force_x [N/m]\n0,0\n1,1\n1,2\n", r"line 4: time does not increase"),
        ("time [s],impact_force_x [N/m]\n0,0\n1,nan\n2,2\n", r"line 3: impact_force_x is nan"),
        ("time [s],impact_force_x [N/m]\n0,0,1\n1,1,1\n2,2,1\n", r"2 columns in its header, 3 in its rows"),
        ("time [s],time [s],impact_force_x [N/m]\n0,0,1\n", r"column time is given twice"),
    ],
)
def test_a_file_that_cannot_be_used_is_explained_in_a_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "series.csv"
    path.write_text(text)
    with pytest.raises(TimeSeriesError, match=sentence) as error:
        read_time_series(path)
    assert "\n" not in str(error.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(TimeSeriesError, match=r"timeseries\.csv cannot be read: No such file"):
        read_time_series(tmp_path)


@pytest.mark.parametrize("force", ["1e308", "-1e16", "inf", "nan"])
def test_a_force_beyond_all_measure_is_named(tmp_path: Path, force: str) -> None:
    path = tmp_path / "series.csv"
    path.write_text("time [s],impact_force_x [N/m]\n0,0\n1," + force + "\n2,0\n3,0\n")
    with pytest.raises(TimeSeriesError, match=r"line 3: impact_force_x is .*, it must be a finite number of at most"):
        read_time_series(path)
