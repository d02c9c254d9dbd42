"""Sweeps: the cases of each method, resume, a case that fails, and a worker that is killed."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.scenario import Scenario
from warp_mpm.sweep import Sweep, SweepError, run_sweep
from warp_mpm.sweep.engine import TABLE, run_case

SET_IIB = Path(__file__).parents[2] / "scenarios/set_iib.json"
MASS = "barrier.motion.density_kg_per_m3"
SPEED = "flow.velocity_m_per_s.0"


def sweep_of(method, vary, **more):
    content = {"title": "a sweep", "scenario": str(SET_IIB), "method": method, "vary": vary, **more}
    content["fixed"] = {"numerics.spacing_m": 1.0, "output.end_time_s": 1.0}
    return content


@pytest.fixture
def load(tmp_path):
    def read(content):
        (tmp_path / "sweep.json").write_text(json.dumps(content))
        return Sweep.load(tmp_path / "sweep.json")

    return read


def test_grid_and_list(load):
    grid = load(sweep_of("grid", {MASS: {"values": [1600, 2000]}, SPEED: {"range": [10, 20, 3]}}))
    cases = grid.cases(Scenario.load(SET_IIB))
    assert [tuple(case.values.values()) for case in cases] == [
        (mass, speed) for mass in (1600, 2000) for speed in (10.0, 15.0, 20.0)
    ]
    assert cases[4].scenario.barrier.motion.density_kg_per_m3 == 2000
    assert cases[4].scenario.flow.velocity_m_per_s == (15.0, 0.0)
    assert cases[4].scenario.numerics.spacing_m == 1.0
    listed = load(sweep_of("list", {MASS: {"values": [1600, 2000]}, SPEED: {"values": [10, 20]}}))
    assert [tuple(case.values()) for case in listed.values()] == [(1600, 10), (2000, 20)]


def test_whole_numbers(load):
    squares = "flow.shape.squares"
    cases = load(sweep_of("grid", {squares: {"range": [1, 3, 3]}})).cases(Scenario.load(SET_IIB))
    assert [case.scenario.flow.shape.squares for case in cases] == [1, 2, 3]
    assert [case.values[squares] for case in cases] == [1, 2, 3]
    assert all(type(case.values[squares]) is int for case in cases)
    assert load(sweep_of("grid", {squares: {"values": [2.0, 4]}})).cases(Scenario.load(SET_IIB))[0].values[squares] == 2
    for between in ({"range": [1, 2, 3]}, {"values": [1, 1.5]}):
        with pytest.raises(SweepError, match=rf"^Case 1 .*: {squares} = 1.5 is not allowed; it must be a whole number"):
            load(sweep_of("grid", {squares: between})).cases(Scenario.load(SET_IIB))
    with pytest.raises(SweepError, match="must be a whole number"):
        load(sweep_of("random", {SPEED: {"uniform": [1, 2]}}, samples=2.5))


def test_a_title_that_would_command_a_terminal(load):
    with pytest.raises(SweepError, match=r"title: holds U\+001B, a control character"):
        load(sweep_of("grid", {SPEED: {"values": [1]}}) | {"title": "\x1b[31mred"})


def test_latin_hypercube_has_one_sample_in_each_stratum(load):
    count = 50
    plan = load(sweep_of("latin_hypercube", {SPEED: {"uniform": [5, 25]}, MASS: {"uniform": [0, 1]}}, samples=count))
    for path, low, high in ((SPEED, 5, 25), (MASS, 0, 1)):
        share = (np.array([values[path] for values in plan.values()]) - low) / (high - low)
        assert sorted(np.floor(share * count)) == list(range(count))
    assert plan.values() == plan.values()
    assert load({**plan.model_dump(exclude_unset=True), "seed": 1}).values() != plan.values()


@pytest.mark.parametrize(
    ("distribution", "mean", "deviation"),
    [
        ({"normal": [12, 2]}, 12.0, 2.0),
        ({"lognormal": [12, 0.25]}, 12.0, 3.0),
        ({"triangular": [6, 12, 18]}, 12.0, 6 / 6**0.5),
        ({"log_uniform": [5, 20]}, 15 / np.log(4), (375 / (2 * np.log(4)) - (15 / np.log(4)) ** 2) ** 0.5),
    ],
)
def test_distributions_have_their_moments(load, distribution, mean, deviation):
    plan = load(sweep_of("latin_hypercube", {SPEED: distribution}, samples=4000))
    drawn = np.array([values[SPEED] for values in plan.values()])
    # A stratified sample of N has its mean right to 1/N of the spread; its tails leave more of the deviation out.
    assert drawn.mean() == pytest.approx(mean, abs=0.002 * deviation)
    assert drawn.std() == pytest.approx(deviation, rel=0.01)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (sweep_of("grid", {SPEED: {"uniform": [1, 2]}}), "is a distribution; method = 'grid' needs values or range"),
        (sweep_of("random", {SPEED: {"uniform": [1, 2]}}), "samples is missing"),
        (sweep_of("random", {SPEED: {"values": [1]}}, samples=3), "lists values; method = 'random' needs distrib"),
        (sweep_of("random", {SPEED: {"uniform": [2, 1]}}, samples=3), r"uniform = \[2.0, 1.0\] must increase"),
        (sweep_of("random", {SPEED: {"lognormal": [2, -1]}}, samples=3), "two numbers greater than 0"),
        (sweep_of("list", {SPEED: {"values": [1]}, MASS: {"values": [1, 2]}}), "as many values of each field"),
        (sweep_of("grid", {SPEED: {"values": [1], "uniform": [1, 2]}}), "needs exactly one of values, range"),
        (sweep_of("grid", {}), "vary"),
        (sweep_of("grid", {SPEED: {"values": [1]}}) | {"vari": {}}, "vari is not a field of a sweep; did you mean"),
        (json.loads(SET_IIB.read_text()), "This is a scenario; a sweep is a file that names one and"),
        (
            sweep_of("grid", {SPEED: {"range": [0.3, 0.6]}}),
            r"range = \[0.3, 0.6\] is not allowed; it must be a list of 3 numbers: first, last and number of evenly",
        ),
        (sweep_of("grid", {SPEED: {"range": [1, 2, 3, 4]}}), r"list of 3 numbers: first, last and number of evenly"),
        (
            sweep_of("grid", {SPEED: {"values": []}}),
            r"values = \[\] is not allowed; it must be a list with at least one",
        ),
        (
            sweep_of("grid", {SPEED: {"values": "abc"}}),
            r'values = "abc" is not allowed; it must be a list with at least',
        ),
        (sweep_of("grid", {}), r"vary = \{\} is not allowed; it must be a group of fields with at least one entry\."),
        (sweep_of("grid", [1]), r"vary = \[1\] is not allowed; it must be a group of fields with at least one entry\."),
        (sweep_of("grid", {SPEED: {"range": [1, "x", 3]}}), r'range\[1\] = "x" is not allowed; it must be a finite'),
    ],
)
def test_impossible_sweeps(load, content, words):
    with pytest.raises(SweepError, match=words):
        load(content)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("numerics.spacing_m", r"Case 0 \(numerics.spacing_m = -1\): numerics.spacing_m = -1"),
        ("nonsense.field", "nonsense.field leads nowhere"),
        ("flow.velocity_m_per_s.7", "no list 'flow.velocity_m_per_s' of more than 7 entries"),
    ],
)
def test_impossible_cases_are_found_before_anything_runs(load, path, words):
    with pytest.raises(SweepError, match=words):
        load(sweep_of("grid", {path: {"values": [-1]}})).cases(Scenario.load(SET_IIB))


@pytest.fixture
def by_value(flying_points):
    """Workers cannot import the tests, so what is defined here goes to them whole."""
    cloudpickle = pytest.importorskip("cloudpickle")
    modules = [sys.modules[flying_points.__module__], sys.modules[__name__]]
    for module in modules:
        cloudpickle.register_pickle_by_value(module)
    yield flying_points
    for module in modules:
        cloudpickle.unregister_pickle_by_value(module)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A scheduler and two workers, processes of their own on the loopback. The test that kills a worker is the last."""
    pytest.importorskip("distributed")
    address = tmp_path_factory.mktemp("cluster") / "scheduler.json"
    options = ["--no-dashboard", "--scheduler-file", str(address)]
    start = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": SET_IIB.parents[1]}
    processes = [
        subprocess.Popen([*start, "scheduler", "--host", "127.0.0.1", "--port", "0", *options], **quiet),
        *(
            subprocess.Popen(
                [*start, "worker", "--no-nanny", "--nthreads", "1", "--host", "127.0.0.1", *options], **quiet
            )
            for _ in range(2)
        ),
    ]
    deadline = time.monotonic() + 60
    while not address.exists() and time.monotonic() < deadline:
        time.sleep(0.1)
    yield json.loads(address.read_text())["address"], processes[1:]
    for process in processes:
        process.kill()
        process.wait()


def test_only_what_is_missing_is_run_again(tmp_path, load, cluster, by_value):
    address, _ = cluster
    plan = load(sweep_of("grid", {SPEED: {"values": [10, 11, 12]}}))
    base, out = Scenario.load(SET_IIB), tmp_path / "out"
    run_sweep(plan, base, out, scheduler=address, make_simulation=by_value)
    record = out / "cases/00001/run.json"
    record.write_text(record.read_text().replace('"finished"', '"running"'))  # as after a power cut
    again = []
    rows = run_sweep(plan, base, out, scheduler=address, on_case=again.append, make_simulation=by_value)
    assert [row["case"] for row in again] == [1]
    assert [row["status"] for row in rows] == ["finished"] * 3


def test_a_killed_worker_and_a_failing_case_lose_nothing(tmp_path, load, cluster, by_value):
    import pandas as pd

    address, workers = cluster

    def slow(scenario):
        simulation = by_value(scenario, fail_at=0.5 if scenario.flow.velocity_m_per_s[0] == 13.0 else None)
        advance = simulation.advance
        simulation.advance = lambda until, **stop: (time.sleep(0.004), advance(until, **stop))
        return simulation

    plan = load(sweep_of("grid", {SPEED: {"values": [10, 11, 13, 14]}}))
    base, out = Scenario.load(SET_IIB), tmp_path / "out"
    ended, killed = [], []

    def on_case(row):
        ended.append(row["case"])
        if not killed:
            # A worker is in the middle of its next case by now.
            time.sleep(0.3)
            os.kill(workers[0].pid, signal.SIGKILL)
            killed.append(workers[0].wait())

    rows = run_sweep(plan, base, out, scheduler=address, on_case=on_case, make_simulation=slow)
    assert killed == [-signal.SIGKILL]
    assert sorted(ended) == list(range(4))
    assert [row["status"] for row in rows] == ["finished", "finished", "failed", "finished"]
    assert "the run has diverged" in rows[2]["problem"]
    table = pd.read_parquet(out / TABLE)
    assert list(table[SPEED]) == [10, 11, 13, 14]
    # The stand-in's force is that of a triangle whatever the scene: 1/2 F (END - START), as far as the run went.
    whole = by_value(base).impulse(1.0)
    assert table["impulse"].drop(2).to_numpy() == pytest.approx(whole)

    # Once more: nothing is left to be done. And one case more is another sweep.
    again = []
    assert run_sweep(plan, base, out, scheduler=address, on_case=again.append) == rows
    assert again == []
    with pytest.raises(SweepError, match="holds another sweep"):
        run_sweep(load(sweep_of("grid", {SPEED: {"values": [10]}})), base, out, scheduler=address)


def test_a_case_asked_for_again_is_not_run_again(tmp_path, flying_points):
    # Dask asks once more for a result that was lost with its worker; the rows told before must stay true.
    scenario, folder = Scenario.load(SET_IIB).resolved(), tmp_path / "case"
    assert run_case(scenario, str(folder), make_simulation=lambda scene: flying_points(scene, fail_at=0.5))
    assert run_case(scenario, str(folder), make_simulation=flying_points) is None
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    assert run_case(scenario, str(folder), make_simulation=flying_points) is None
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_command_refuses_in_one_sentence(tmp_path):
    (tmp_path / "sweep.json").write_text(json.dumps(sweep_of("grid", {MASS: {"values": [-5]}})))
    answer = CliRunner().invoke(app, ["sweep", str(tmp_path / "sweep.json"), "--out", str(tmp_path / "out")])
    assert answer.exit_code == 2
    assert "density_kg_per_m3 = -5" in answer.stderr
    assert not (tmp_path / "out").exists()
