"""A run card: what a run will compute, hold and cost, before it is started."""

from __future__ import annotations

import math
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from warp_mpm.effect_rules import Rule, effect_rules
from warp_mpm.performance.probe import Stepper, clock_of, in_turns
from warp_mpm.recording import SnapshotRecorder, TimeSeriesRecorder
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.time_step import step_limits

PROBE_SECONDS = 0.5
"""Wall time spent on stepping the scene itself."""

TWIN_POINTS = 700
"""Material points of the coarse twin that is run ahead to see how fast the flow gets."""

TWIN_SECONDS = 2.0
"""Wall time after which the twin is stopped; its last speed then holds for the rest."""


@dataclass(frozen=True)
class Plan:
    """What a run will be."""

    rules: list[Rule]
    kernels: dict[str, float]
    """Kernels of a step in their order, with their part of its cost [ns per point and step]."""
    arrays: dict[str, int]
    """Arrays on the device with their bytes."""
    material_points: int
    cells: tuple[int, int]
    """Columns and rows of the grid."""
    blocks_in_use: float
    """Share of the grid that holds material at the start."""
    wave_step: float
    """Largest stable step at the flow's initial speed [s], before the Courant number."""
    drag_step: float
    """Largest stable step of explicit drag [s]; infinite where drag does not limit it."""
    steps: int
    """Predicted number of time steps."""
    step_cost: float
    """Measured [ns] per point and step."""
    recording_time: float
    """Predicted wall time of all records [s]."""

    @property
    def stepping_time(self) -> float:
        """Predicted wall time of the steps [s]."""
        return 1e-9 * self.step_cost * self.material_points * self.steps

    @property
    def wall_time(self) -> float:
        """Predicted wall time of the run [s], without compiling kernels and drawing figures."""
        return self.stepping_time + self.recording_time

    @property
    def limit(self) -> str:
        """Which limit sets the time step."""
        return "wave" if self.wave_step <= self.drag_step else "drag"


@dataclass(frozen=True)
class Switch:
    """What a run would cost with one effect switched."""

    effect: str
    change: str
    """From what to what."""
    step_cost: float
    """[ns] per point and step."""
    steps: int
    stepping_time: float
    """[s]"""


def make_plan(scenario: Scenario, *, device: str = "cpu", clock: Callable[[], float] = time.perf_counter) -> Plan:
    """Build the scene, step it for half a second and predict the rest.

    Args:
        scenario: the scene.
        device: a Warp device.
        clock: tells the time [s] in which costs are measured; the default is that on the wall.

    Raises:
        ValueError: the device does not exist.
    """
    interval = min(scenario.output.time_series_interval_s, scenario.output.snapshot_interval_s)
    stepper = Stepper(scenario, device=device, clock=clock, interval=interval)
    simulation = stepper.simulation
    blocks = simulation.blocks_in_use
    (step_cost,) = in_turns([stepper], rounds=5, seconds=PROBE_SECONDS / 5.0)
    return Plan(
        rules=effect_rules(scenario),
        kernels=_kernel_costs(simulation, step_cost),
        arrays=simulation.arrays,
        material_points=simulation.material_points,
        cells=(simulation.grid.columns, simulation.grid.rows),
        blocks_in_use=blocks,
        wave_step=scenario.numerics.spacing_m / (step_limits(scenario).wave_speed + scenario.flow.speed),
        drag_step=step_limits(scenario).drag_step,
        steps=predicted_steps(scenario, speeds(scenario, device=device)),
        step_cost=step_cost,
        recording_time=_recording_time(scenario, simulation, clock),
    )


def what_if(
    scenario: Scenario, *, device: str = "cpu", on_progress: Callable[[str], None] | None = None
) -> list[Switch]:
    """The run as it is, and with each effect switched, one at a time. New effects are compiled first, seconds each.

    Args:
        on_progress: called with the name of each effect before it is compiled.
    """
    known = speeds(scenario, device=device)
    scenes, names, changes = [scenario], ["as it is"], [""]
    for rule in effect_rules(scenario):
        if rule.switched:
            switched = scenario.replaced(rule.switched)
            after = {other.effect: other.value for other in effect_rules(switched)}[rule.effect]
            scenes.append(switched)
            names.append(rule.effect)
            changes.append(f"{described(rule.value)} → {described(after)}")
    steppers = []
    for name, scene in zip(names, scenes, strict=True):
        if on_progress is not None:
            on_progress(name)
        steppers.append(Stepper(scene, device=device, clock=clock_of(device)))
    costs = in_turns(steppers, rounds=7, seconds=0.08)
    switches = []
    for name, change, scene, stepper, cost in zip(names, changes, scenes, steppers, costs, strict=True):
        steps = predicted_steps(scene, known)
        seconds = 1e-9 * cost * stepper.simulation.material_points * steps
        switches.append(Switch(name, change, cost, steps, seconds))
    return switches


def described(value: str | bool) -> str:
    """An effect's value in words."""
    return {True: "on", False: "off"}.get(value, str(value)) if isinstance(value, bool) else value.replace("_", "-")


def speeds(scenario: Scenario, *, device: str = "cpu") -> list[tuple[float, float]]:
    """Times [s] and the greatest speed of the flow until then [m/s], from a coarse twin of the scene run ahead."""
    flow, numerics, end_time = scenario.flow, scenario.numerics, scenario.output.end_time_s
    coarse = math.sqrt(flow.volume * numerics.points_per_cell / TWIN_POINTS)
    changes = {"numerics.spacing_m": max(coarse, numerics.spacing_m), "numerics.drag": "semi_implicit"}
    twin = Simulation(scenario.replaced(changes), device=device)
    twin.advance(1e-6 * end_time)
    known = [(0.0, flow.speed)]
    begin = time.perf_counter()
    for count in range(1, 201):
        if time.perf_counter() - begin > TWIN_SECONDS:
            break
        twin.advance(end_time * count / 200.0)
        known.append((twin.time, twin.sample()["speed_max"]))
    return known


def predicted_steps(scenario: Scenario, known: list[tuple[float, float]]) -> int:
    """Number of steps, as the simulation chooses them: within the limits, and landing on every record.

    Args:
        scenario: the scene.
        known: times and greatest speeds, from `speeds`.
    """
    limits, numerics, output = step_limits(scenario), scenario.numerics, scenario.output
    interval = min(output.time_series_interval_s, output.snapshot_interval_s, output.end_time_s)
    total, place = 0.0, 0
    intervals = output.end_time_s / interval
    # Steps are counted over at most some thousand stretches, each of one or more intervals.
    stretch = max(1, math.ceil(intervals / 5000.0))
    for number in range(0, math.ceil(intervals - 1e-9), stretch):
        while place + 1 < len(known) and known[place + 1][0] <= number * interval:
            place += 1
        wave = numerics.spacing_m / (limits.wave_speed + known[place][1])
        largest = numerics.courant_number * min(wave, limits.drag_step)
        total += math.ceil(interval / largest - 1e-9) * min(stretch, intervals - number)
    return math.ceil(total)


def _kernel_costs(simulation: Simulation, step_cost: float) -> dict[str, float]:
    """Share the cost of a step among its kernels, from launches one by one without what a launch itself costs."""
    steps = max(10, math.ceil(0.2 / (1e-9 * step_cost * simulation.material_points)))
    spent = simulation.kernel_times(simulation.time + steps * simulation.sample()["time_step"])
    launch = min(spent[name] for name in simulation.launched_kernels)
    own = {name: spent[name] - launch for name in simulation.launched_kernels}
    whole = sum(own.values())
    return {name: step_cost * each / whole for name, each in own.items()}


def _recording_time(scenario: Scenario, simulation: Simulation, clock: Callable[[], float]) -> float:
    """Time [s] of all samples and snapshots of a run, from a few of each."""
    output = scenario.output
    with tempfile.TemporaryDirectory() as folder:
        series = TimeSeriesRecorder(Path(folder) / "series.csv", output.time_series_interval_s)
        snapshots = SnapshotRecorder(Path(folder) / "snapshots.vtkhdf", output.snapshot_interval_s, output.end_time_s)
        each = []
        for recorder in (series, snapshots):
            spent = []
            for _ in range(6):
                begin = clock()
                recorder.record(simulation)
                spent.append(clock() - begin)
            each.append(statistics.median(spent[1:]))
            recorder.close()
    samples = output.end_time_s / output.time_series_interval_s
    return samples * each[0] + output.end_time_s / output.snapshot_interval_s * each[1]
