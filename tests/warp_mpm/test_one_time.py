"""Times that lie closer than a small share of a step are one time: no step, no record and no force of a sliver."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu.worker import Worker
from warp_mpm.recording import Schedule, record_until
from warp_mpm.results import Results
from warp_mpm.run import resume_run, run_scenario
from warp_mpm.simulation import Simulation
from warp_mpm.time_step import ONE_TIME, SHORTEST_RECORD, nominal_step

STEP = 2e-3


class Clock:
    """A simulation that only keeps time."""

    nominal_step = STEP

    def __init__(self):
        self.time, self.visited = 0.0, [0.0]

    def advance(self, until, **stop):
        assert until > self.time
        self.time = until
        self.visited.append(until)


class Note:
    """A recorder of times."""

    def __init__(self, interval):
        self.schedule, self.times = Schedule(interval), []

    def record(self, simulation):
        self.times.append(simulation.time)

    def close(self):
        """There is nothing to close."""


def recorded(end_time, *intervals, clock=None):
    notes = [Note(interval) for interval in intervals]
    clock = clock or Clock()
    assert record_until(clock, notes, end_time)
    return [note.times for note in notes]


@pytest.mark.parametrize(
    ("end_time", "interval"),
    [(0.1 + 0.2, 0.005), (0.3000001, 0.005), (1.0, 0.0333333), (1.0, 1 / 3 + 1e-9), (0.7, 0.07 * (1 - 1e-8))],
)  # fmt: skip
def test_an_end_beside_a_record_makes_no_other(end_time, interval):
    (times,) = recorded(end_time, interval)
    assert times[-1] == end_time
    assert len(times) == round(end_time / interval) + 1
    assert np.diff(times).min() > 0.9 * interval


@given(
    st.floats(0.01, 2.0),
    st.floats(0.004, 0.5),
    st.floats(0.004, 0.5),
    st.sampled_from([0.0, 1e-16, 1e-12, 1e-9, 1e-7, 1e-5]),
    st.integers(1, 30),
)
def test_no_record_covers_a_sliver(end_time, first, second, off, count):
    """Of any intervals and ends, and of those that nearly fit."""
    for one, other, end in (
        (first, second, end_time),
        (first, count * first + off, end_time),
        (first, second, count * first + off),
        (first, second, count * second - off),
    ):
        clock = Clock()
        for times in recorded(end, one, other, clock=clock):
            assert times[0] == 0.0
            assert times[-1] == clock.time
            assert (np.diff(times) > SHORTEST_RECORD * STEP).all()
        assert abs(clock.time - end) <= SHORTEST_RECORD * STEP
        assert (np.diff(clock.visited) > SHORTEST_RECORD * STEP).all()


def test_records_are_where_they_were_asked_for():
    """Times that fit are multiples of the intervals, to the last digit."""
    series, snapshots = recorded(6.0, 0.005, 0.05)
    assert series == [number * 0.005 for number in range(1201)]
    assert snapshots == [number * 0.005 for number in range(0, 1201, 10)]


@pytest.fixture
def coarse(load_scene):
    return load_scene("case_1", **{"numerics.spacing_m": 0.75, "output.end_time_s": 0.5})


def test_the_nominal_step_is_one_that_is_made(coarse):
    simulation = Simulation(coarse.replaced({"output.time_series_interval_s": 0.1, "output.snapshot_interval_s": 0.1}))
    simulation.advance(0.1)
    assert simulation.record["time_step_max"] == pytest.approx(simulation.nominal_step, rel=0.1)
    # Where the intervals are shorter, they tell times apart.
    fine = coarse.replaced({"output.time_series_interval_s": 1e-5})
    assert nominal_step(fine) == 1e-5
    assert nominal_step(coarse.replaced({"numerics.drag": "explicit"})) < 0.5 * nominal_step(coarse)


def test_a_time_beside_the_present_one_is_the_present_one(coarse):
    simulation = Simulation(coarse)
    for number in range(1, 61):
        simulation.advance(number * 0.005)
        before = simulation.sample()
    steps = simulation.steps
    assert before["impact_force_x"] > 0.0
    for later in (1e-16, 1e-12, 0.5 * ONE_TIME * simulation.nominal_step):
        simulation.advance(0.3 + later)
        assert simulation.time == 0.3 + later
        assert simulation.steps == steps
        assert simulation.sample() == before | {"time": 0.3 + later}
    with pytest.raises(ValueError, match="at least the present time"):
        simulation.advance(0.3)
    simulation.advance(0.305)
    plain = Simulation(coarse)
    for number in range(1, 62):
        plain.advance(number * 0.005)
        at_the_end = plain.sample()
    assert simulation.sample() == at_the_end  # bit for bit


def test_many_times_beside_each_other_add_up(coarse):
    """A caller that goes on by less than is told apart arrives all the same, with the state of one that does not."""
    simulation = Simulation(coarse)
    stride = 0.4 * ONE_TIME * simulation.nominal_step
    for _ in range(30):
        simulation.advance(simulation.time + stride)
    assert simulation.steps == 10  # every third time is far enough from the last step's
    assert simulation.time == pytest.approx(30 * stride)
    reached = simulation.points()["position"][:, 0] - Simulation(coarse).points()["position"][:, 0]
    assert reached == pytest.approx(10.0 * simulation.time, rel=0.1)


def test_a_state_between_two_times_is_restored_with_its_forces(coarse):
    simulation = Simulation(coarse)
    simulation.advance(0.295)
    simulation.sample()
    simulation.advance(0.3)
    before = simulation.sample()
    simulation.advance(0.3 + 1e-12)
    other = Simulation(coarse)
    other.restore_state(simulation.save_state())
    assert other.time == 0.3 + 1e-12
    assert other.sample() == simulation.sample() == before | {"time": 0.3 + 1e-12}


def test_the_end_of_a_run_beside_a_record_has_no_force_of_its_own(coarse, tmp_path):
    """The last record covered 5.6e-17 s, with a force of 3e18 N/m."""
    peaks = {}
    for end_time in (0.3, 0.1 + 0.2, 0.3 + 1e-9, 0.3 + 1e-5):
        scenario = coarse.replaced({"output.end_time_s": end_time})
        outcome = run_scenario(scenario, tmp_path / str(end_time), make_simulation=Simulation)
        peaks[end_time] = outcome.summary["peak_force"]
        assert outcome.finished
        assert outcome.summary["end_time"] == end_time
        assert len(Results.open(outcome.path).time_series["time"]) == 61
    assert peaks[0.1 + 0.2] == pytest.approx(peaks[0.3], rel=1e-9)
    assert max(peaks.values()) < 1.01 * peaks[0.3]


def test_intervals_that_nearly_fit_go_on_bit_for_bit(coarse, tmp_path):
    changes = {"output.snapshot_interval_s": 0.0500001, "output.checkpoint_interval_s": 0.07}
    scenario = coarse.replaced(changes | {"output.end_time_s": 0.4 + 1e-7})
    run_scenario(scenario, tmp_path / "whole", make_simulation=Simulation)
    run_scenario(
        scenario, tmp_path / "cut", make_simulation=Simulation, stop=stops(9), on_progress=lambda progress: None
    )
    resume_run(tmp_path / "cut", make_simulation=Simulation)
    whole, cut = (Results.open(tmp_path / name) for name in ("whole", "cut"))
    assert cut.record["resumed"] != []
    assert {name: values.tolist() for name, values in cut.time_series.items()} == {
        name: values.tolist() for name, values in whole.time_series.items()
    }
    assert whole.record["time_step_min"] > 0.5 * nominal_step(scenario)


def stops(after):
    """True from the call on that has this number."""
    calls = []

    def stop():
        calls.append(None)
        return len(calls) > after

    return stop


def test_a_unit_s_step_beside_another_holds_its_outputs(coarse, tmp_path):
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(coarse.resolved()))
    worker = Worker()
    worker.open(scenario=str(path), device="cpu", spacing=None, driven=False)
    inputs = {"barrier_velocity": None, "external_force": 0.0, "gauge": None}
    for number in range(1, 61):
        before = worker.step(until=number * 0.005, **inputs)
    assert before["impact_force_x"] > 0.0
    assert worker.step(until=0.3 + 1e-12, **inputs) == before
    after = worker.step(until=0.305, **inputs)
    assert 0.5 * before["impact_force_x"] < after["impact_force_x"] < 2.0 * before["impact_force_x"]
