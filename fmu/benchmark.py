"""What the units cost: a step through fmpy, and the simulator's units over the plain simulation, measured in turns."""

from __future__ import annotations

import contextlib
import json
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mpm.performance.table import Progress, Table

from .archive import ROOT
from .instance import Unit, instance

if TYPE_CHECKING:
    from warp_mpm import Scenario, Simulation

STEP = 0.01
"""Communication step of the simulator's units [s]."""
STEPS_A_TURN = 5
"""Communication steps that each takes before the next has its turn."""
STARTS = 3
"""Starts of each, in turn."""
ROUNDS, STEPS = 20, 500
"""Of the closed form: the fastest of so many rounds of so many steps, for other work may hold the processor."""

PLAIN = "plain simulation"
CHILDREN = Path("/proc/thread-self/children")
"""File in which Linux tells the numbers of the processes that were begun here."""

_PLAIN_START = (
    "import sys; sys.path.insert(0, sys.argv[1])\n"
    "from warp_mpm import Scenario, Simulation\n"
    "simulation = Simulation(Scenario.load(sys.argv[2])); simulation.prepare(); simulation.sample()\n"
    "print(flush=True)\n"
)

Timed = Callable[[], float]
"""Does something and tells its wall time [s]."""


def closed_form_costs(archives: Sequence[Path], *, progress: Progress = lambda what: None) -> Table:
    """Wall time of a step through fmpy, after which all outputs that are numbers are read."""
    progress("closed form")
    with contextlib.ExitStack() as open_units:
        folder = Path(open_units.enter_context(tempfile.TemporaryDirectory(prefix="fmu_benchmark_")))
        units = [open_units.enter_context(instance(path, folder)) for path in archives]
        spent = _in_turns({unit.name: _stepper(unit.initialize(), 1e-4, STEPS) for unit in units}, ROUNDS)
    fastest = {name: min(times) / STEPS for name, times in spent.items()}
    least = min(fastest.values())
    rows = [(name, f"{1e6 * each:.1f}", f"{each / least:.1f}") for name, each in fastest.items()]
    return Table("closed form", "A step of the closed form through fmpy", ("unit", "a step [µs]", "ratio"), rows)


def simulator_costs(
    archives: Sequence[Path], scenario: Scenario, *, end_time: float, progress: Progress = lambda what: None
) -> Table:
    """Start and communication step of the simulator's units beside those of the plain simulation.

    All start with their kernels compiled before, the plain simulation in a process of its own. Each communication step
    ends with all outputs, the plain simulation's with a sample of all its quantities. They take turns, and nobody
    always follows the same one. Wall time, and what the processes have computed: other work on the machine makes a unit
    wait twice, for its simulator is another process. Told are medians.

    Parameters
    ----------
    archives: units that have the scenario inside.
    scenario: what is simulated; the units are given its spacing.
    end_time: [s] to which all run.
    progress: called with what is being measured.
    """
    from warp_mpm import Simulation

    spacing = scenario.numerics.spacing_m
    simulation = Simulation(scenario)
    simulation.prepare()
    simulation.sample()
    with contextlib.ExitStack() as open_units:
        folder = Path(open_units.enter_context(tempfile.TemporaryDirectory(prefix="fmu_benchmark_")))
        file = folder / "scenario.json"
        file.write_text(json.dumps(scenario.resolved()), encoding="utf-8")
        units = [open_units.enter_context(instance(path, folder, {"spacing": spacing})) for path in archives]
        progress("start")
        starts: dict[str, Timed] = {PLAIN: partial(_start_plain, file)}
        starts |= {unit.name: partial(_start, unit) for unit in units}
        begun = _in_turns(starts, STARTS)
        progress("communication steps")
        steps: dict[str, Timed] = {PLAIN: partial(_step_plain, simulation)}
        steps |= {unit.name: _stepper(unit, STEP, STEPS_A_TURN) for unit in units}
        computed: dict[str, list[float]] = {name: [] for name in steps}
        noted = {name: _noting_processor_time(step, computed[name]) for name, step in steps.items()}
        taken = _in_turns(noted, max(1, round(end_time / (STEP * STEPS_A_TURN))))
    rows = []
    each = 1e3 / STEPS_A_TURN  # of the steps of a turn [ms]
    for name in steps:
        row = [name]
        for spent, scale, digits, over_digits in ((begun, 1.0, 2, 0), (taken, each, 1, 1), (computed, each, 1, 1)):
            over = f"{_over(spent[name], spent[PLAIN]):+.{over_digits}%}" if name != PLAIN else ""
            row += [f"{scale * statistics.median(spent[name]):.{digits}f}", over]
        rows.append(row)
    title = f"The simulator, {scenario.title}, {spacing:g} m, communication step {STEP:g} s"
    columns = ("", "start [s]", "over plain", "a step [ms]", "over plain", "of processors [ms]", "over plain")
    told = columns if CHILDREN.exists() else columns[:5]  # elsewhere what a unit's simulator computes is not known
    return Table("simulator", title, told, [tuple(row[: len(told)]) for row in rows])


def _stepper(unit: Unit, size: float, steps: int) -> Timed:
    """Takes steps [s] and reads all outputs that are numbers after each, as fmpy does."""
    kinds = ("Real", "Float64")
    references = [v.valueReference for v in unit.variables.values() if v.causality == "output" and v.type in kinds]
    read = unit.fmu.getFloat64 if unit.fmi3 else unit.fmu.getReal

    def take() -> float:
        start = time.perf_counter()
        for _ in range(steps):
            unit.step(size)
            read(references)
        return time.perf_counter() - start

    return take


def _noting_processor_time(timed: Timed, into: list[float]) -> Timed:
    def noted() -> float:
        begin = processor_time()
        spent = timed()
        into.append(processor_time() - begin)
        return spent

    return noted


def processor_time() -> float:
    """What this process has computed so far [s] and, where Linux tells, those that it began and that still live."""
    return time.process_time() + sum(map(clock_of, children()))


def children() -> list[int]:
    """Numbers of the processes that this one began and that still live."""
    return [int(child) for child in CHILDREN.read_text().split()] if CHILDREN.exists() else []


def clock_of(process: int) -> float:
    """What another process has computed so far [s]; nil of one that has ended meanwhile."""
    try:
        # Its clock is told by its number: clock_getcpuclockid(3), which Python lacks.
        return time.clock_gettime(~process << 3 | 2)
    except OSError:
        return 0.0


def _step_plain(simulation: Simulation) -> float:
    begun, start = simulation.time, time.perf_counter()
    for step in range(1, STEPS_A_TURN + 1):
        simulation.advance(until=begun + step * STEP)
        simulation.sample()
    return time.perf_counter() - start


def _start(unit: Unit) -> float:
    unit.fmu.reset()
    start = time.perf_counter()
    unit.initialize()
    return time.perf_counter() - start


def _start_plain(scenario_file: Path) -> float:
    start = time.perf_counter()
    command = [sys.executable, "-P", "-c", _PLAIN_START, str(ROOT), str(scenario_file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        begun = time.perf_counter() - start
    if process.returncode:
        raise ValueError(f"The plain simulation of {scenario_file} did not start.")
    return begun


def _in_turns(calls: Mapping[str, Timed], rounds: int) -> dict[str, list[float]]:
    """Wall times [s] of each call, which take turns, each turn in an order of its own."""
    spent: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(rounds):
        for name in random.Random(turn).sample(list(calls), len(calls)):
            spent[name].append(calls[name]())
    return spent


def _over(times: Sequence[float], plain: Sequence[float]) -> float:
    """What one takes over the other, as the median over the turns: what slows the machine slows all of a turn."""
    return statistics.median(mine / others for mine, others in zip(times, plain, strict=True)) - 1.0
