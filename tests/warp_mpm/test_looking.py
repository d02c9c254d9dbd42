"""Looking changes nothing: a sample is a question, and whoever asks keeps the time since which forces are means."""

import numpy as np
import pytest

from warp_mpm.recording import TimeSeriesRecorder, record_until
from warp_mpm.recording.schedule import Schedule
from warp_mpm.results import read_time_series
from warp_mpm.simulation import Simulation

COARSE = {"numerics.spacing_m": 0.5, "output.end_time_s": 0.4}
INTERVAL = 0.02


class Onlooker:
    """A second recorder that samples at times of its own."""

    def __init__(self, interval):
        self.schedule = Schedule(interval)

    def record(self, simulation):
        simulation.sample()
        simulation.sample(since=simulation.window())

    def close(self):
        pass


def series(scenario, path, others=()):
    simulation = Simulation(scenario)
    recorder = TimeSeriesRecorder(path, INTERVAL)
    # Both land on the same times, so that the steps are the same.
    record_until(simulation, [*others, recorder, Onlooker(INTERVAL / 4)], 0.4)
    recorder.close()
    return read_time_series(path)


def test_a_second_recorder_takes_nothing_from_the_first(load_scene, tmp_path):
    scenario = load_scene("case_1", **COARSE)
    alone = series(scenario, tmp_path / "alone.csv")
    watched = series(scenario, tmp_path / "watched.csv", [Onlooker(INTERVAL / 4), Onlooker(INTERVAL)])
    assert set(alone) == set(watched)
    for name in alone:
        np.testing.assert_array_equal(alone[name], watched[name], err_msg=name)


def test_forces_are_means_since_the_caller_s_window(load_scene):
    """Four intervals' impulses add up to that of the whole, whoever else looked in between."""
    simulation = Simulation(load_scene("case_1", **COARSE))
    simulation.advance(0.2)
    whole, parts = simulation.window(), []
    for part in range(1, 5):
        simulation.advance(0.2 + 0.05 * part)
        parts.append(simulation.sample()["impact_force_x"])  # since this `advance` began
        assert simulation.sample()["impact_force_x"] == parts[-1]
    assert min(parts) > 0.0
    assert simulation.sample(since=whole)["impact_force_x"] == pytest.approx(np.mean(parts), rel=1e-12)


def test_where_no_step_was_made_the_forces_are_those_of_the_last_ones(load_scene):
    simulation = Simulation(load_scene("case_1", **COARSE))
    simulation.advance(0.3)
    before = simulation.sample()
    simulation.advance(0.3)
    assert simulation.sample() == before
    assert before["impact_force_x"] > 0.0


def test_seepage_does_not_hang_on_who_looks(load_scene):
    """Gravity's work on liquid that moves through the skeleton is summed up in every step, looked at or not."""
    scenario = load_scene("case_1", **COARSE | {"flow.material.hydraulic_conductivity_m_per_s": 0.1})
    rarely, often = Simulation(scenario), Simulation(scenario)
    for record in range(1, 21):
        for simulation in (rarely, often):
            simulation.advance(0.02 * record)
        often.sample()
    assert rarely.sample()["seepage_work"] == often.sample()["seepage_work"] != 0.0
