"""When recorders record: the simulation is stepped to land exactly on each recorder's times.

Times that lie closer than a tenth of a nominal step (`time_step.SHORTEST_RECORD`) are one time: the first of them, or
the end of the run where that is among them. No record therefore covers less.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any, Protocol

from warp_mpm.time_step import SHORTEST_RECORD


class Simulated(Protocol):
    """What recorders need of a simulation."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""

    @property
    def nominal_step(self) -> float:
        """The step [s] against which times are told apart."""

    def advance(self, until: float, *, stop: Callable[[], bool]) -> Any:
        """Step to exactly `until` [s]; `stop` is asked now and then, and true ends the stretch early."""

    def window(self) -> Any:
        """A mark of the present time."""

    def sample(self, names: Collection[str] | None = None, *, since: Any = None) -> dict[str, float]:
        """Quantities of the whole scene, all or what is named; forces are means since a mark from `window`."""

    def points(self) -> dict[str, Any]:
        """Arrays of the material points, one row each."""


class Schedule:
    """Multiples of an interval, counted, so that no rounding adds up."""

    def __init__(self, interval: float, start: float = 0.0):
        """Args: interval [s] between times; start: the first time is the first multiple at or after it [s]."""
        self.interval = interval
        self.count = math.ceil(start / interval - 1e-6)
        """Number of the time that comes next."""

    @property
    def next_time(self) -> float:
        """The time that comes next [s]."""
        return self.count * self.interval

    def due(self, time: float, slack: float = 0.0) -> bool:
        """Whether the next time has come, up to rounding and to `slack` [s]; if so, move on to the first time for which
        that does not hold."""
        slack = max(slack, 1e-6 * self.interval)
        if self.next_time - time > slack:
            return False
        while self.next_time - time <= slack:
            self.count += 1
        return True

    def passed(self, time: float) -> bool:
        """The same for one who is not asked at every time: those that were missed are passed over."""
        if not self.due(time):
            return False
        self.count = math.floor(time / self.interval + 1e-6) + 1
        return True


class Moments(Schedule):
    """Times that are listed, one after the other."""

    def __init__(self, times: Iterable[float]):
        """Args: times [s] in their order."""
        super().__init__(1.0)
        self.times = tuple(float(time) for time in times)

    @property
    def next_time(self) -> float:
        """The time that comes next [s]; infinite after the last."""
        return self.times[self.count] if self.count < len(self.times) else math.inf

    def due(self, time: float, slack: float = 0.0) -> bool:
        """As of any schedule; the times are told apart by `slack` [s] alone."""
        if self.next_time - time > slack:
            return False
        while self.next_time - time <= slack:
            self.count += 1
        return True


class Recorder(Protocol):
    """Writes something of the simulation at its own times: whatever has these three is a recorder.

    `docs/develop/add_a_recorder.md` goes through one of a script.
    """

    schedule: Schedule

    def record(self, simulation: Any) -> None:
        """Write the present state, so that it survives the end of the process."""

    def close(self) -> None:
        """Finish what was written; safe to call twice."""


def record_until(
    simulation: Simulated,
    recorders: Sequence[Recorder],
    end_time: float,
    *,
    on_step: Callable[[Any], None] | None = None,
    stop: Callable[[], bool] = lambda: False,
    after_records: Callable[..., None] | None = None,
) -> bool:
    """Advance to `end_time` and let every recorder record at its times, at the start and at the end.

    Args:
        simulation: at its present time, not after `end_time`.
        recorders: each is called with the simulation.
        end_time: [s].
        on_step: called after each stretch between records, for instance to show progress.
        stop: asked after each stretch, and by the simulation within it; true ends the run early, with a last record.
        after_records: called with the simulation and `stopping`, before the end, when the records that are due have
            been made and before those that only a stop calls for: a run that goes on from there knows of no stop.

    Returns:
        True when `end_time` was reached, False when stopped before.
    """
    slack = SHORTEST_RECORD * simulation.nominal_step

    def at_end() -> bool:
        return end_time - simulation.time <= slack

    for recorder in recorders:
        if recorder.schedule.due(simulation.time, slack):
            recorder.record(simulation)
    ended = at_end()
    if after_records is not None and not ended:
        after_records(simulation, stopping=False)
    while not ended:
        until = min([end_time, *(recorder.schedule.next_time for recorder in recorders)])
        simulation.advance(end_time if end_time - until <= slack else until, stop=stop)
        late = []
        for recorder in recorders:
            if recorder.schedule.due(simulation.time, slack):
                recorder.record(simulation)
            else:
                late.append(recorder)
        ended = at_end() or stop()
        if after_records is not None and not at_end():
            after_records(simulation, stopping=ended)
        if ended:
            # The end is recorded even where it is no multiple of the interval.
            for recorder in late:
                recorder.record(simulation)
        if on_step is not None:
            on_step(simulation)
    return at_end()
