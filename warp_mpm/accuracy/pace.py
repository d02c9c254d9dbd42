"""How long a run takes on this machine at any spacing, from a few short ones."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from warp_mpm.accuracy.measure import measure
from warp_mpm.accuracy.runner import Result
from warp_mpm.performance.plan import Ahead, growth, predicted_steps
from warp_mpm.performance.probe import Stepper, clock_of
from warp_mpm.scenario import Scenario

AROUND = 105.0
"""Time of a command before its first step (imports, kernels from the cache, the scene) and after its last one (summary,
figures), over that of the `_gauge`; measured, 95 to 124, much the same for all runs but those of very many points."""

PREPARED = 1.0
"""Time [s] of setting up a coarse scene above which its kernels were compiled and not found compiled."""

RECORDED = 1.1
"""Time of a step in a run that records, over that of one that only steps and meets warmer caches; measured."""

LINE = 5e-5
"""Time [s] of a line of the time series beside the sample."""

SNAPSHOT, SNAPSHOT_POINT = 2e-3, 4e-7
"""Time [s] of a snapshot, and of each material point in it: written, and read again for the figures."""

LEAST_COST, LEAST_COST_ELSEWHERE = 1e-8, 1e-11
"""Time [s] per point and step that no processor core falls below, and no other device."""

LONG_ENOUGH = 0.2
"""Time [s] of stepping that can be timed on a machine that does other things too."""

TIMED_POINTS = 20_000
"""Most material points of a run that is only timed: beyond, the cost of each point is the same within 15 %."""


class Bench(Protocol):
    """What probes are run on: this machine, or a made-up one in a test."""

    least_cost: float
    """Time [s] per point and step that it does not fall below."""

    around: float
    """Time [s] of a command before its first step and after its last one."""

    def clock(self) -> float:
        """Time [s]."""

    def prepare(self, scenario: Scenario) -> float:
        """Set up and compile; time [s] that compiling took, 0 where the kernels were found compiled."""

    def measure(self, scenario: Scenario, limit: float) -> Result:
        """A whole run, given up after `limit` seconds; see `measure`."""

    def step_cost(self, scenario: Scenario, seconds: float) -> tuple[float, float]:
        """Time [s] of a step, from about that many seconds of steps that no record cuts short, and the simulated time
        [s] until which they went."""


class Machine:
    """The bench that is this machine."""

    def __init__(self, device: str = "cpu"):
        self._device, self.clock = device, clock_of(device)
        self.around = AROUND * min(_gauge() for _ in range(5))
        self.least_cost = LEAST_COST if device == "cpu" else LEAST_COST_ELSEWHERE

    def prepare(self, scenario: Scenario) -> float:
        """Set up and compile, so that the probes' times are theirs alone."""
        from warp_mpm.simulation import Simulation

        begin = self.clock()
        Simulation(scenario, device=self._device).prepare()
        spent = self.clock() - begin
        return spent if spent > PREPARED else 0.0

    def measure(self, scenario: Scenario, limit: float) -> Result:
        """A whole run."""
        return measure(scenario, device=self._device, limit=limit)

    def step_cost(self, scenario: Scenario, seconds: float) -> tuple[float, float]:
        """Mean over stretches from the start; a run that is over sooner begins anew."""
        stepper, spent, steps = Stepper(scenario, device=self._device, clock=self.clock), 0.0, 0
        for _ in range(3):
            time_of_stretch, made = stepper.stretch(max(seconds - spent, 0.1 * seconds))
            spent, steps = spent + time_of_stretch, steps + made
            if spent >= 0.9 * seconds:
                break
        return spent / steps, stepper.furthest


def _gauge() -> float:
    """Time [s] of some work in Python, which tells how fast this machine is at what surrounds the steps."""
    begin = time.process_time()
    words = [f"{7919 * number % 10007:05d}" for number in range(20_000)]
    counts: dict[str, int] = {}
    for word in words:
        counts[word[:3]] = counts.get(word[:3], 0) + 1
    json.loads(json.dumps({word: [1.5, word] for word in words}))
    words.sort()
    return time.process_time() - begin


@dataclass(frozen=True)
class Pace:
    """What decides the time of a run at any spacing."""

    step: float
    """Time of a step beside its points [s]."""
    point: float
    """Time of each point in a step [s]."""
    sample_point: float
    """Time of each point in a sample of the time series [s]."""
    setup_point: float
    """Time of each point as the scene is set up [s]."""
    ahead: tuple[Ahead, ...]
    """What a probe saw of speed and of steps that become dearer."""

    def time(self, scenario: Scenario) -> float:
        """Expected time of a run [s], without start and finish."""
        output, points = scenario.output, points_of(scenario)
        steps = predicted_steps(scenario, self.ahead)
        stepping = RECORDED * steps * (self.step + points * self.point)
        samples = output.end_time_s / output.time_series_interval_s
        snapshots = max(output.end_time_s / output.snapshot_interval_s, 1.0)
        recording = samples * (LINE + points * self.sample_point) + snapshots * (SNAPSHOT + points * SNAPSHOT_POINT)
        return stepping + recording + points * self.setup_point


def points_of(scenario: Scenario) -> float:
    """About how many material points a scene has."""
    numerics = scenario.numerics
    return max(scenario.flow.volume * numerics.points_per_cell / numerics.spacing_m**2, 1.0)


def steps_and_points(scenario: Scenario) -> float:
    """Number of steps times number of points, told without running anything; the flow gets no slower than it begins."""
    return predicted_steps(scenario, (Ahead(0.0, scenario.flow.greatest_speed, 1.0),)) * points_of(scenario)


def pace_of(runs: Sequence[tuple[Scenario, Result]], timed: tuple[Scenario, float, float] | None = None) -> Pace:
    """The pace that whole runs of a scene show.

    Args:
        runs: scenarios that differ in spacing alone, coarse first, with their results; at least one.
        timed: a finer one with the time of its step [s] and the simulated time [s] until which that was seen, where the
            runs were too short to be timed.
    """
    finest, result = runs[-1]
    ahead = tuple(Ahead(*stretch) for stretch in result["paces"])
    costs = [(points_of(scenario), one["cpu_time"] / max(one["steps"], 1)) for scenario, one in runs]
    if timed is not None:
        scene, cost, until = timed
        costs.append((points_of(scene), cost * max(growth(scene, ahead, until), 1.0)))
    (few, cheap), (many, dear) = costs[0], costs[-1]
    # Half of the finest run's cost is its points' at least, and all of it at most, whatever noise makes of the coarse.
    point = min(max((dear - cheap) / (many - few) if many > few else 0.0, 0.5 * dear / many), dear / many)
    number = points_of(finest)
    return Pace(
        step=dear - many * point,
        point=point,
        sample_point=result["recording_time"] / max(result["samples"], 1) / number,
        setup_point=result["preparation_time"] / number,
        ahead=ahead,
    )


def timing_scene(runs: Sequence[tuple[Scenario, Result]], fit: Callable[[float], float]) -> Scenario | None:
    """A finer scene whose steps can be timed, where those of the finest run were over too soon; None where not.

    Args:
        runs: as for `pace_of`.
        fit: the nearest spacing that is sold.
    """
    finest, result = runs[-1]
    if result["cpu_time"] >= LONG_ENOUGH:
        return None
    spacing = finest.numerics.spacing_m
    # Time goes with the cube of the spacing.
    wanted = spacing * max(result["cpu_time"] / (2.0 * LONG_ENOUGH), 1e-6) ** (1.0 / 3.0)
    allowed = spacing * math.sqrt(points_of(finest) / TIMED_POINTS)
    finer = fit(max(wanted, allowed))
    return finest.replaced({"numerics.spacing_m": finer}) if finer < 0.9 * spacing else None
