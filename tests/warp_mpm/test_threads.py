"""Several threads, each with simulations of its own, in a process that has made none before."""

import json
import subprocess
import sys
from pathlib import Path

import warp as wp

from warp_mpm import Scenario, Simulation

SCENES = Path(__file__).parents[2] / "scenarios"

PROGRAM = """
import json, sys, threading
from warp_mpm import Scenario, Simulation

THREADS, ROUNDS = 8, 3
NAMES = ["case_1", "case_1_dry", "case_5", "case_1_fixed"]

def run(name):
    scenario = Scenario.load(f"{sys.argv[1]}/{name}.json").replaced({"numerics.spacing_m": 0.75})
    simulation = Simulation(scenario)
    told = []
    for count in range(1, 4):
        simulation.advance(0.02 * count)
        told.append(simulation.sample())
    state = simulation.save_state()
    simulation.advance(0.08)
    simulation.restore_state(state)
    simulation.advance(0.08)
    return [told, simulation.points()["position"].sum()]

ran, failed = [], []

def work(number):
    for count in range(ROUNDS):
        name = NAMES[(number + count) % len(NAMES)]
        try:
            ran.append([name, run(name)])
        except BaseException as error:
            failed.append(repr(error))

threads = [threading.Thread(target=work, args=(number,)) for number in range(THREADS)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
print(json.dumps({"failed": failed, "ran": ran, "alone": {name: run(name) for name in NAMES}}))
"""


def test_threads_make_and_run_simulations_of_their_own():
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(SCENES)], capture_output=True, text=True, timeout=300, check=False
    )
    assert ended.returncode == 0, ended.stderr
    told = json.loads(ended.stdout)
    assert told["failed"] == []
    assert len(told["ran"]) == 24
    assert all(numbers == told["alone"][name] for name, numbers in told["ran"])


def test_a_prepared_simulation_calls_nothing_of_warp_that_another_threads_capture_would_trip(monkeypatch):
    """Warp asks whether anyone captures, and then whoever does: between the two, the capture can have ended."""
    scenario = Scenario.load(SCENES / "case_1.json").replaced({"numerics.spacing_m": 0.75})
    simulation = Simulation(scenario)
    simulation.prepare()
    simulation.restore_state(simulation.save_state())

    def refuse(*_, **__):
        raise AssertionError("through Warp, without its lock")

    for name in ("assign", "fill_", "zero_"):
        monkeypatch.setattr(wp.array, name, refuse)
    for name in ("copy", "launch", "empty", "zeros", "capture_begin"):
        monkeypatch.setattr(wp, name, refuse)
    for count in range(1, 4):
        simulation.advance(0.02 * count)
        assert simulation.sample(["time"])["time"] == 0.02 * count
    simulation.save_state()
