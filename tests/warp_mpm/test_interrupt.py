"""A simulation that is asked to stop does so between two steps, and no step changes by it."""

import os
import signal

import numpy as np
import pytest

from warp_mpm import simulation as stepping
from warp_mpm.results import Results
from warp_mpm.run import resume_run, run_scenario
from warp_mpm.simulation import Simulation


@pytest.fixture(params=["sliding", "prescribed"])
def scenario(request, load_scene):
    motion = {"kind": "prescribed", "times_s": [0.0, 0.1, 0.2], "velocities_m_per_s": [0.0, -1.0, 2.0]}
    changes = {"barrier.motion": motion} if request.param == "prescribed" else {}
    return load_scene("case_1", **{"numerics.spacing_m": 1.0}, **changes)


@pytest.mark.parametrize("steps_at_once", [1, 3])
def test_looking_up_changes_no_step(scenario, monkeypatch, steps_at_once):
    whole = Simulation(scenario)
    for time in (0.1, 0.2):
        whole.advance(time)
    monkeypatch.setattr(stepping, "MOST_STEPS_AT_ONCE", steps_at_once)
    pieces, looks = Simulation(scenario), []
    pieces._steps_at_once = steps_at_once
    for time in (0.1, 0.2):
        pieces.advance(time, stop=lambda: bool(looks.append(pieces.steps)))
    assert looks[:3] == [steps_at_once, 2 * steps_at_once, 3 * steps_at_once]
    assert pieces.save_state() == whole.save_state()


def test_a_stop_within_an_interval_loses_nothing(scenario, monkeypatch):
    whole = Simulation(scenario)
    for time in (0.1, 0.2):
        whole.advance(time)
    monkeypatch.setattr(stepping, "MOST_STEPS_AT_ONCE", 1)
    stopped = Simulation(scenario)
    stopped._steps_at_once = 1
    stopped.advance(0.1, stop=lambda: stopped.steps == 4)
    assert (stopped.steps, stopped.time < 0.1) == (4, True)
    again = Simulation(scenario)
    again.restore_state(stopped.save_state())
    for time in (0.1, 0.2):
        again.advance(time)
    assert again.save_state() == whole.save_state()


def test_ctrl_c_is_heard_within_an_interval(scenario, monkeypatch):
    """Python's own handler, as in a notebook: the signal comes while the device is at work."""
    monkeypatch.setattr(stepping, "MOST_STEPS_AT_ONCE", 1)
    simulation = Simulation(scenario)
    simulation._steps_at_once = 1
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            simulation.advance(0.2, stop=lambda: simulation.steps == 3 and bool(os.kill(os.getpid(), signal.SIGINT)))
    finally:
        signal.signal(signal.SIGINT, before)
    assert simulation.steps == 3
    simulation.advance(0.2)
    assert simulation.time == 0.2


def test_a_run_that_was_stopped_within_an_interval_goes_on_bit_for_bit(scenario, tmp_path, monkeypatch):
    scenario = scenario.replaced(
        {"output.end_time_s": 0.3, "output.time_series_interval_s": 0.1, "output.snapshot_interval_s": 0.1}
    )
    run_scenario(scenario, tmp_path / "whole", make_simulation=Simulation)
    monkeypatch.setattr(stepping, "MOST_STEPS_AT_ONCE", 1)
    made = []

    def simulation(scene):
        made.append(Simulation(scene))
        made[-1]._steps_at_once = 1
        return made[-1]

    outcome = run_scenario(scenario, tmp_path / "cut", make_simulation=simulation, stop=lambda: made[-1].time > 0.13)
    assert not outcome.finished
    assert 0.13 < Results.open(tmp_path / "cut").time_series["time"][-1] < 0.2
    assert resume_run(tmp_path / "cut", make_simulation=Simulation).finished
    one, other = (Results.open(tmp_path / name) for name in ("whole", "cut"))
    for name, values in one.time_series.items():
        np.testing.assert_array_equal(values, other.time_series[name])
    for name, values in one.snapshots[-1].fields.items():
        np.testing.assert_array_equal(values, other.snapshots[-1][name])
