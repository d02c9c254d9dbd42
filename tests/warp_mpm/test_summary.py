"""Key figures against series and scenes whose answers are known in closed form."""

import numpy as np
import pytest

from analytic.force_record import FILTER_WINDOW, moving_mean
from warp_mpm import mechanism
from warp_mpm.results import Snapshot
from warp_mpm.summary import (
    DEFINITIONS,
    energy_error,
    impact_figures,
    mass_error,
    momentum_error,
)


def interval_means(time, impulse):
    return np.concatenate([[0.0], np.diff(impulse) / np.diff(time)])


def triangle(time, start, peak_time, end, peak):
    """Impulse of a triangular force at each time."""
    rise = 0.5 * peak * np.clip(time - start, 0, peak_time - start) ** 2 / (peak_time - start)
    fall = 0.5 * peak * ((end - peak_time) - np.clip(end - time, 0, end - peak_time) ** 2 / (end - peak_time))
    return rise + np.where(time > peak_time, fall, 0.0)


def test_triangular_impact():
    time = np.arange(0, 6.0001, 0.005)
    force = interval_means(time, triangle(time, 0.5, 0.8, 2.0, 4e5))
    figures = impact_figures(time, force)
    # The impulse is exact; the peak's means lose half an interval's share of the steeper and gentler side.
    assert figures["impulse"] == pytest.approx(0.5 * 4e5 * 1.5, rel=1e-12)
    assert figures["peak_force"] == pytest.approx(4e5, rel=0.01)
    assert figures["peak_force_time"] == pytest.approx(0.805)  # the end of the interval from 0.8 s, on the gentler side
    # The best window over a tip with slopes a and b ends at equal forces: it loses a b / (a + b) · window / 2.
    rise, fall = 4e5 / 0.3, 4e5 / 1.2
    drop = rise * fall / (rise + fall) * FILTER_WINDOW / 2
    assert figures["peak_force_filtered"] == pytest.approx(4e5 - drop, rel=1e-9)
    assert figures["impact_start_time"] == pytest.approx(0.5, abs=0.01)
    assert figures["residual_force"] == 0.0
    # 10 % of the filtered peak is left 10 % of the decay before its end.
    assert figures["impact_end_time"] == pytest.approx(2.0 - 0.1 * 1.2, abs=0.01)
    assert figures["impact_duration"] == figures["impact_end_time"] - figures["impact_start_time"]
    assert figures["impact_impulse"] == pytest.approx(figures["impulse"], rel=0.01)


def test_a_deposit_that_stays_does_not_make_the_impact_endless():
    time = np.arange(0, 6.0001, 0.005)
    static = 1e5 * np.clip(time - 0.8, 0, None)
    figures = impact_figures(time, interval_means(time, triangle(time, 0.5, 0.8, 2.0, 4e5) + static))
    assert figures["residual_force"] == pytest.approx(1e5)
    assert figures["impact_end_time"] == pytest.approx(2.0 - 0.1 * 1.2, abs=0.02)


def test_an_impact_that_is_not_over_has_no_end():
    time = np.arange(0, 1.5, 0.005)
    figures = impact_figures(time, interval_means(time, triangle(time, 0.5, 0.8, 2.0, 4e5)))
    assert figures["impact_end_time"] is None
    assert figures["impact_duration"] is None
    assert figures["impulse"] > 0


@pytest.mark.parametrize("until", [1.5, 2.0, 3.0, 4.0, 5.0])
def test_a_force_that_still_falls_has_no_end(until):
    """A slow decay, as of a deposit that settles: cut anywhere, its tail looks like a residual force."""
    time = np.arange(0, until + 1e-9, 0.005)
    force = 4e5 * np.where(time < 0.8, np.clip((time - 0.5) / 0.3, 0, 1), np.exp(-(time - 0.8) / 1.8))
    assert impact_figures(time, force)["impact_end_time"] is None


def test_the_end_does_not_depend_on_how_long_the_run_is():
    ends = []
    for until in (8.0, 10.0, 14.0):
        time = np.arange(0, until + 1e-9, 0.005)
        force = 4e5 * np.where(time < 0.8, np.clip((time - 0.5) / 0.3, 0, 1), np.exp(-(time - 0.8) / 1.8))
        ends.append(impact_figures(time, force)["impact_end_time"])
    # A tenth is left after 1.8 ln 10 s; a residual of up to 5 % counted off it brings that forward by up to 0.7 s.
    assert ends[-1] == pytest.approx(0.8 + 1.8 * np.log(10), abs=0.05)
    assert ends == sorted(ends)
    assert ends[-1] - ends[0] < 0.7


def test_no_impact():
    time = np.linspace(0, 1, 11)
    assert impact_figures(time, np.zeros(11))["peak_force"] == 0.0
    assert impact_figures(time, None)["peak_force"] is None


def test_filtered_peak_does_not_depend_on_the_output_interval():
    peaks = []
    for interval in (0.001, 0.005, 0.01):
        time = np.arange(0, 4.0001, interval)
        peaks.append(
            impact_figures(time, interval_means(time, triangle(time, 0.5, 0.8, 2.0, 4e5)))["peak_force_filtered"]
        )
    # With 0.01 s the window's ends lie inside intervals, where only the mean is known: up to slope · 0.01² / 8 / 0.05 s
    # at each end, on the steep side 333 N/m, and a shift of the tip by half an interval as much again.
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-9)
    assert peaks[2] == pytest.approx(peaks[0], abs=1000)


def test_moving_mean_keeps_a_constant_to_both_ends():
    time = np.linspace(0, 1, 101)
    assert moving_mean(time, np.full(101, 7.0)) == pytest.approx(7.0)


def test_errors_of_the_ledger():
    time = np.linspace(0, 1, 3)
    series = {
        "time": time,
        "solid_mass": np.array([100.0, 100.0, 80.0]),
        "left_mass": np.array([0.0, 0.0, 17.0]),
        "liquid_mass": np.array([50.0, 50.0, 50.0]),
        "momentum_x": np.array([1000.0, 900.0, 0.0]),
        "momentum_y": np.zeros(3),
        "momentum_residual_x": np.array([0.0, 3.0, 0.0]),
        "momentum_residual_y": np.array([0.0, 4.0, 0.0]),
        "flow_kinetic_energy": np.array([900.0, 500.0, 100.0]),
        "flow_gravitational_energy": np.array([100.0, 100.0, 100.0]),
        "flow_elastic_energy": np.array([0.0, 10.0, 0.0]),
        "barrier_work": np.array([0.0, 400.0, 700.0]),
    }
    assert mass_error(series) == pytest.approx(3 / 150)
    still = {name: 1e-60 * values if name.startswith("momentum_") else values for name, values in series.items()}
    assert momentum_error(still, gravity=0.0) is None
    assert momentum_error(series, gravity=0.0) == pytest.approx(5 / 1000)
    assert momentum_error(series, gravity=9.81) == pytest.approx(5 / (150 * 9.81))
    assert energy_error(series) == pytest.approx(10 / 1000)  # 1010 J at the second time, from 1000 J
    assert energy_error({**series, "barrier_work": np.zeros(3)}) == 0.0  # only lost
    assert mass_error({"time": time}) is None


def frame(time, position, displacement=0.0, mass=None):
    position = np.asarray(position, dtype=float)
    mass = np.full(len(position), 58_500 / len(position)) if mass is None else mass
    return Snapshot(time, displacement, position, {"solid_mass": mass})


def test_deposit_is_counted_from_the_crest_where_it_stands(load_scene):
    scenario = load_scene("case_1")  # crest from x = 3.5 to 7.5 before it moves
    where = [[-5, 1], [5.4, 1], [5.6, 6], [9.4, 6], [9.6, 2]]
    at_rest = mechanism.deposit(scenario, frame(6, where, displacement=2.0))
    share = 45 / 5
    assert at_rest["retained_volume"] == pytest.approx(2 * share)
    assert at_rest["on_crest_volume"] == pytest.approx(2 * share)
    assert at_rest["overtopped_volume"] == pytest.approx(share)
    assert at_rest["left_volume"] == 0.0
    half = frame(6, where, mass=np.full(5, 58_500 / 10))
    assert mechanism.deposit(scenario, half)["left_volume"] == pytest.approx(22.5)


def test_nothing_passes_a_wall_without_end(load_scene):
    scenario = load_scene("case_5")
    figures = mechanism.deposit(scenario, frame(1, [[-1, 1], [0.5, 3]]))
    assert figures["retained_volume"] == pytest.approx(45)
    assert figures["overtopped_volume"] == 0.0


def column(x_low, x_high, height, side=20):
    """An even lattice of points."""
    middles = (np.arange(side) + 0.5) / side
    return np.stack(np.meshgrid(x_low + (x_high - x_low) * middles, height * middles), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize(
    ("name", "frames"),
    [
        # 45 m³ of flow, 3 m deep; crest from x = 3.5 to 7.5 at y = 6.
        ("none", [frame(0, column(-18, -3, 3))]),
        ("bore", [frame(1, np.r_[column(-7.5, 0, 6), [[0, 1]]])]),
        ("dead zone", [frame(1, np.r_[column(-15, 0, 3), [[0, 1]]])]),
        ("dead zone", [frame(1, np.r_[column(-15, 0, 3), [[8, 2]] * 40])]),
        ("standing jump", [frame(1, np.r_[column(-7.5, 0, 6), [[8, 2]] * 40])]),
        ("standing jump", [frame(1, np.r_[column(-7.5, 0, 6), [[8, 2]] * 40]), frame(2, column(-15, 0, 3))]),
        ("bore", [frame(1, np.r_[column(-7.5, 0, 6), [[8, 2]] * 15])]),
        ("airborne jet", [frame(1, np.r_[column(-7.5, 0, 6), [[8, 9.5]] * 110])]),
        ("standing jump", [frame(1, np.r_[column(-7.5, 0, 6), [[8, 8.5]] * 110])]),
    ],
)
def test_mechanism(load_scene, name, frames):
    found, measures = mechanism.impact_mechanism(load_scene("case_1"), frames)
    assert found == name, measures


def test_measures_of_the_mechanism(load_scene):
    still = np.r_[column(-7.5, 0, 6), [[3, 8]], [[8, 9.5]] * 110, [[8, 2]] * 39]
    _, measures = mechanism.impact_mechanism(load_scene("case_1"), [frame(1, still)])
    assert measures["airborne_share"] == pytest.approx(110 / 550)
    assert measures["overtopped_share"] == pytest.approx(149 / 550)
    # 400 of 550 points make 32.7 m³ on 7.5 m, evenly.
    assert measures["jump_depth_ratio"] == pytest.approx(45 * 400 / 550 / 7.5 / 3)
    assert measures["run_up"] == 8.0
    moved = still + np.array([2.0, 0.0])
    assert mechanism.impact_mechanism(load_scene("case_1"), [frame(1, moved, displacement=2.0)])[1] == measures


def test_no_barrier_no_mechanism(load_scene):
    assert mechanism.impact_mechanism(load_scene("case_1", barrier=None), []) == (None, {})


def test_every_ambiguous_figure_is_defined():
    assert (
        set(impact_figures(np.zeros(1), None))
        - {
            "peak_force_time",
            "peak_force_filtered_time",
        }
        <= DEFINITIONS.keys()
    )
