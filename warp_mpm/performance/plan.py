"""A run card: what a run will compute, hold and cost, before it is started."""

from __future__ import annotations

import math
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from warp_mpm.effect_rules import Rule, effect_rules, with_law
from warp_mpm.effects import Kind
from warp_mpm.performance.probe import Stepper, clock_of, in_turns
from warp_mpm.recording import Recorder, Schedule, SnapshotRecorder, TimeSeriesRecorder, Watcher, record_until
from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.time_step import step_limits

PROBE_SECONDS, PROBE_TURNS = 0.5, 5
"""Wall time [s] spent on stepping the scene itself, and in how many turns."""

TWIN_POINTS = 700
"""Material points of the coarse twin that is run ahead to see how fast the flow gets."""

TWIN_SECONDS = 2.0
"""Time after which the twin is stopped; its last speed and cost then hold for the rest."""

TIMED_RECORDS = 5
"""Samples, and snapshots, of which the time is taken."""

TWIN_STRETCHES = 200
"""Stretches of the twin's run."""


OWN_FIELDS: dict[str, dict[str, Any]] = {
    "mohr_coulomb": {"friction_angle_deg": 20.0},
    "elastic": {},
    "herschel_bulkley": {"yield_stress_Pa": 500.0, "consistency_Pa_s": 20.0, "flow_exponent": 0.5},
    "coulomb_viscous": {"friction_angle_deg": 20.0, "mixture_viscosity_Pa_s": 200.0},
    "mu_i": {"static_friction": 0.38, "dynamic_friction": 0.64, "grain_diameter_m": 0.01},
}
"""Fields of each law where its cost is measured; their values change none of it."""


@dataclass(frozen=True)
class Ahead:
    """What the coarse twin saw in one stretch of its run."""

    begin: float
    """Simulated time [s] at which it began."""
    speed: float
    """Greatest speed of the flow [m/s] at its begin."""
    step_cost: float
    """Cost of one of its steps [s]; it grows as the flow spreads over more of the grid and loses its order."""


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
    law_step: float
    """Largest stable step of the skeleton's law [s]; infinite where it does not limit it."""
    steps: int
    """Predicted number of time steps."""
    step_cost: float
    """[ns] per point and step, mean over the run: measured, times what it grows as the flow spreads."""
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
        steps = {"wave": self.wave_step, "drag": self.drag_step, "law": self.law_step}
        return min(steps, key=lambda name: steps[name])

    @property
    def largest_step(self) -> float:
        """Largest stable step [s] at the flow's initial speed, before the Courant number."""
        return min(self.wave_step, self.drag_step, self.law_step)


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
    blocks = stepper.simulation.blocks_in_use
    begun = _probed(stepper)
    simulation = stepper.simulation
    ahead = run_ahead(scenario, device=device)
    step_cost = begun * growth(scenario, ahead, stepper.furthest)
    return Plan(
        rules=effect_rules(scenario),
        kernels=_kernel_costs(simulation, step_cost),
        arrays=simulation.arrays,
        material_points=simulation.material_points,
        cells=(simulation.grid.columns, simulation.grid.rows),
        blocks_in_use=blocks,
        wave_step=scenario.numerics.spacing_m / (step_limits(scenario).wave_speed + scenario.flow.greatest_speed),
        drag_step=step_limits(scenario).drag_step,
        law_step=step_limits(scenario).law_step,
        steps=predicted_steps(scenario, ahead),
        step_cost=step_cost,
        recording_time=_recording_time(scenario, simulation, clock),
    )


def what_if(
    scenario: Scenario, *, device: str = "cpu", on_progress: Callable[[str], None] | None = None
) -> list[Switch]:
    """The run as it is, and with each effect switched, one at a time; the law to each other one. New effects are
    compiled first, seconds each.

    Args:
        on_progress: called with the name of each effect before it is compiled.
    """
    ahead = run_ahead(scenario, device=device)
    scenes, names, changes = [scenario], ["as it is"], [""]
    for rule in effect_rules(scenario):
        others = [rule.switched] if rule.switched else []
        if rule.effect == "law":
            here = scenario.flow.material.law
            others = [with_law(scenario, law, **own) for law, own in OWN_FIELDS.items() if law != here]
        for other in others:
            switched = scenario.replaced(other)
            after = {then.effect: then.value for then in effect_rules(switched)}[rule.effect]
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
        steps = predicted_steps(scene, ahead)
        seconds = 1e-9 * cost * stepper.simulation.material_points * steps
        switches.append(Switch(name, change, cost, steps, seconds))
    return switches


def described(value: str | bool | tuple[Kind, ...]) -> str:
    """An effect's value in words."""
    if isinstance(value, tuple):
        return ", ".join(str(kind) for kind in value).replace("_", "-") or "off"
    return {True: "on", False: "off"}.get(value, str(value)) if isinstance(value, bool) else value.replace("_", "-")


def _probed(stepper: Stepper) -> float:
    """Mean cost [ns] per point of the steps from the start until the probe's time is up, or the run's."""
    time, steps = 0.0, 0
    for _ in range(PROBE_TURNS):
        reached = stepper.furthest
        spent, made = stepper.stretch(PROBE_SECONDS / PROBE_TURNS)
        if steps and stepper.furthest == reached:
            break  # the run has ended and begun anew
        time, steps = time + spent, steps + made
    return 1e9 * time / (steps * stepper.simulation.material_points)


def run_ahead(scenario: Scenario, *, device: str = "cpu") -> list[Ahead]:
    """How fast the flow gets and how much dearer its steps become, from a coarse twin of the scene."""
    flow, numerics, end_time = scenario.flow, scenario.numerics, scenario.output.end_time_s
    coarse = math.sqrt(flow.volume * numerics.points_per_cell / TWIN_POINTS)
    changes = {"numerics.spacing_m": max(coarse, numerics.spacing_m), "numerics.drag": "semi_implicit"}
    twin, clock = Simulation(scenario.replaced(changes), device=device), clock_of(device)
    twin.advance(1e-6 * end_time)
    ahead: list[Ahead] = []
    begin = clock()
    before = [twin.time, flow.greatest_speed, twin.steps, begin]

    def look(twin: Simulation) -> None:
        time, speed, steps, now = before
        if twin.steps > steps:
            ahead.append(Ahead(time, speed, (clock() - now) / (twin.steps - steps)))
        before[:] = [twin.time, twin.sample(["speed_max"])["speed_max"], twin.steps, clock()]

    stretches = Schedule(end_time / TWIN_STRETCHES, twin.time)
    record_until(twin, [Watcher(stretches, look)], end_time, stop=lambda: clock() - begin > TWIN_SECONDS)
    return ahead


def predicted_steps(scenario: Scenario, ahead: Sequence[Ahead]) -> int:
    """Number of steps, as the simulation chooses them: within the limits, and landing on every record.

    Args:
        scenario: the scene.
        ahead: of its twin, from `run_ahead`.
    """
    return math.ceil(sum(steps for steps, _ in _steps(scenario, ahead)))


def growth(scenario: Scenario, ahead: Sequence[Ahead], until: float) -> float:
    """Mean cost of the run's steps over that of its steps until a time [s], as the twin's steps became dearer [-]."""
    known = [stretch.step_cost for stretch in ahead if stretch.begin < until] or [ahead[0].step_cost]
    steps = _steps(scenario, ahead)
    mean = sum(number * stretch.step_cost for number, stretch in steps) / sum(number for number, _ in steps)
    return mean / statistics.mean(known)


def _steps(scenario: Scenario, ahead: Sequence[Ahead]) -> list[tuple[float, Ahead]]:
    """Numbers of steps, and what the twin saw at their time; at most some thousand stretches of the run."""
    limits, numerics, output = step_limits(scenario), scenario.numerics, scenario.output
    interval = min(output.time_series_interval_s, output.snapshot_interval_s, output.end_time_s)
    found, place = [], 0
    intervals = output.end_time_s / interval
    stretch = max(1, math.ceil(intervals / 5000.0))
    for number in range(0, math.ceil(intervals - 1e-9), stretch):
        while place + 1 < len(ahead) and ahead[place + 1].begin <= number * interval:
            place += 1
        wave = numerics.spacing_m / (limits.wave_speed + ahead[place].speed)
        largest = numerics.courant_number * min(wave, limits.largest_step)
        found.append((math.ceil(interval / largest - 1e-9) * min(stretch, intervals - number), ahead[place]))
    return found


def _kernel_costs(simulation: Simulation, step_cost: float) -> dict[str, float]:
    """Share the cost of a step among its kernels, from launches one by one without what a launch itself costs."""
    steps = max(10, math.ceil(0.2 / (1e-9 * step_cost * simulation.material_points)))
    spent = simulation.kernel_times(simulation.time + steps * simulation.sample()["time_step"])
    launch = min(spent[name] for name in simulation.launched_kernels)
    own = {name: spent[name] - launch for name in simulation.launched_kernels}
    whole = sum(own.values())
    return {name: step_cost * each / whole for name, each in own.items()}


def _recording_time(scenario: Scenario, simulation: Simulation, clock: Callable[[], float]) -> float:
    """Time [s] of all samples and snapshots of a run, from the first and a few more of each."""
    output, whole = scenario.output, 0.0
    with tempfile.TemporaryDirectory() as folder:
        begin = clock()
        series = TimeSeriesRecorder(Path(folder) / "series.csv", output.time_series_interval_s)
        # With room for all that are taken here, however few a run has.
        room = max(output.end_time_s, (TIMED_RECORDS + 1) * output.snapshot_interval_s)
        snapshots = SnapshotRecorder(Path(folder) / "snapshots.vtkhdf", output.snapshot_interval_s, room)
        recorders: list[Recorder] = [series, snapshots]
        for recorder in recorders:
            recorder.record(simulation)
            spent = []
            for _ in range(TIMED_RECORDS):
                now = clock()
                recorder.record(simulation)
                spent.append(clock() - now)
            recorder.close()
            begin += sum(spent)
            whole += output.end_time_s / recorder.schedule.interval * statistics.median(spent)
        return whole + clock() - begin
