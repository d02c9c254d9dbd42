"""Cost of a step, measured in turns so that a machine with other work to do tells ratios that hold."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from warp_mpm.scenario import Scenario
from warp_mpm.simulation import Simulation
from warp_mpm.time_step import step_limits


def clock_of(device: str) -> Callable[[], float]:
    """The clock for comparisons: on the CPU that of the process, which stands still while others have the processor."""
    return time.process_time if device == "cpu" else time.perf_counter


class Measured(Protocol):
    """Something whose cost per point and step can be taken again and again."""

    def chunk(self, seconds: float) -> float:
        """Work for about `seconds` and return the cost [ns] per point and step."""


class Stepper:
    """A simulation, begun and compiled, that is stepped on to see what a step costs; at its end it begins anew."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        device: str = "cpu",
        clock: Callable[[], float] = time.perf_counter,
        interval: float = math.inf,
    ) -> None:
        """Args: scenario; device: a Warp device; clock: tells time [s]; interval: between two records [s], at which a
        run comes back to Python, as it does here."""
        self._clock, self._interval = clock, interval
        self._scenario, self._device, self._end = scenario, device, scenario.output.end_time_s
        self.simulation = self._begun()
        self._points = self.simulation.material_points
        self.furthest = 0.0
        """Greatest simulated time that was reached [s]."""
        limits, numerics = step_limits(scenario), scenario.numerics
        wave = numerics.spacing_m / (limits.wave_speed + scenario.flow.greatest_speed)
        self._step = numerics.courant_number * min(wave, limits.largest_step)
        self._per_step = self._cost(2)[0] / 2.0

    def _begun(self) -> Simulation:
        simulation = Simulation(self._scenario, device=self._device)
        simulation.advance(1e-6 * min(self._scenario.output.time_series_interval_s, self._end))
        return simulation

    def _cost(self, steps: int) -> tuple[float, int]:
        """Time [s] of about that many steps, and their number."""
        if self.simulation.time + steps * self._step > self._end:
            self.simulation = self._begun()
        simulation, before = self.simulation, self.simulation.steps
        now, end = simulation.time, min(simulation.time + steps * self._step, self._end)
        begin = self._clock()
        while now < end:
            now = min(now + self._interval, end)
            simulation.advance(now)
        spent = self._clock() - begin
        self.furthest = max(self.furthest, end)
        return spent, simulation.steps - before

    def stretch(self, seconds: float) -> tuple[float, int]:
        """Step for about `seconds`; time [s] that it took, and number of steps."""
        spent, steps = self._cost(max(4, math.ceil(seconds / self._per_step)))
        self._per_step = max(spent / steps, 1e-7)
        return spent, steps

    def chunk(self, seconds: float) -> float:
        """Step for about `seconds` and return the cost [ns] per point and step."""
        spent, steps = self.stretch(seconds)
        return 1e9 * spent / (steps * self._points)


def in_turns(measured: Sequence[Measured], *, rounds: int, seconds: float) -> list[float]:
    """Cost [ns] per point and step of each, as the median over the rounds of its ratio to the first, times the first's
    own median: what slows the machine for a while slows all of a round.

    Args:
        measured: the first is what the others are set against.
        rounds: how often each has its turn.
        seconds: wall time of a turn [s].
    """
    for each in measured:
        each.chunk(0.2 * seconds)  # caches and the length of a turn
    costs = []
    for turn in range(rounds):
        row = [0.0] * len(measured)
        for place in range(len(measured)):
            k = (place + turn) % len(measured)  # nobody always follows the same one, whose data fill the caches
            row[k] = measured[k].chunk(seconds)
        costs.append(row)
    first = statistics.median(row[0] for row in costs)
    return [first * statistics.median(row[k] / row[0] for row in costs) for k in range(len(measured))]
