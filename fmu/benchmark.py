"""What the units cost: a step through fmpy, and the simulator's unit over the plain simulation."""

from __future__ import annotations

import statistics
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from fmu.instance import Unit, instance

STEP = 0.01
"""Communication step of the simulator's unit [s]."""
TURN = 0.25
"""Simulated time [s] that the unit and the plain simulation take in turns."""
ROUNDS, STEPS = 20, 500
"""Of the closed form: the best of so many rounds of so many steps, for other work may hold the processor."""


@dataclass(frozen=True)
class Cost:
    """One line of the table."""

    what: str
    value: float
    """[s], or a share where `unit` is %."""
    unit: str


def closed_form_costs(archives: list[Path]) -> list[Cost]:
    """Wall time [s] of a step and of reading all outputs that are numbers, for each archive."""
    costs = []
    with tempfile.TemporaryDirectory(prefix="fmu_benchmark_") as folder:
        for path in archives:
            with instance(path, Path(folder)) as unit:
                unit.initialize()
                costs.append(Cost(f"{path.name}, one step through fmpy, outputs read", _step_time(unit), "s"))
    return costs


def _step_time(unit: Unit) -> float:
    references = [v.valueReference for v in unit.variables.values() if v.causality == "output" and v.type == "Real"]
    best = float("inf")
    for _ in range(ROUNDS):
        start = time.perf_counter()
        for _ in range(STEPS):
            unit.step(1e-4)
            unit.fmu.getReal(references)
        best = min(best, (time.perf_counter() - start) / STEPS)
    return best


def simulator_costs(archive: Path, scenario_file: Path, spacing: float | None) -> list[Cost]:
    """Start of the simulator's unit [s] with its kernels compiled before, and what it adds to the plain simulation.

    Both are asked for all outputs at each communication step, the way fmpy asks. They go on in turns, so that other
    work on the machine meets both; wall time, for the unit's simulator is another process. Told is the turns' median.
    """
    from warp_mpm import Scenario, Simulation

    scenario = Scenario.load(scenario_file)
    settings = {}
    if spacing is not None:
        scenario, settings = scenario.replaced({"numerics.spacing_m": spacing}), {"spacing": spacing}
    simulation = Simulation(scenario)
    simulation.prepare()
    with tempfile.TemporaryDirectory(prefix="fmu_benchmark_") as folder:
        with instance(archive, Path(folder), settings) as unit:
            unit.initialize()
        with instance(archive, Path(folder), settings) as unit:
            start = time.perf_counter()
            unit.initialize()
            begun = time.perf_counter() - start
            excesses = []
            for turn in range(1, int(scenario.output.end_time_s / TURN) + 1):
                start = time.perf_counter()
                for _ in range(round(TURN / STEP)):
                    unit.step(STEP)
                    unit.real_outputs()
                between = time.perf_counter()
                for step in range(round(TURN / STEP)):
                    simulation.advance(until=(turn - 1) * TURN + (step + 1) * STEP)
                    simulation.sample()
                excesses.append((between - start) / (time.perf_counter() - between) - 1.0)
    return [
        Cost(f"{archive.name}, start with its kernels compiled before", begun, "s"),
        Cost(
            f"{archive.name}, {scenario_file.stem}, {STEP:g} s: over a plain simulation sampled as often",
            statistics.median(excesses),
            "%",
        ),
    ]
