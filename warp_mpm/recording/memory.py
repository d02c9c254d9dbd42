"""What a run leaves in memory: the same samples and snapshots as in a folder, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mpm.quantities import TIME_SERIES
from warp_mpm.recording.loads import mean_on_slots, pressures, stretches_of
from warp_mpm.recording.schedule import Schedule
from warp_mpm.simulator.bodies.loads import Stretch
from warp_mpm.snapshot import Snapshot, snapshot_of

Array = NDArray[np.float64]


class Watcher:
    """A recorder that calls a function at its times, and writes nothing."""

    def __init__(self, schedule: Schedule, look: Callable[[Any], None]):
        """Args: schedule; look: called with the simulation at each of its times, at the start and at the end."""
        self.schedule = schedule
        self.record = look

    def close(self) -> None:
        """There is nothing to close."""


class SeriesInMemory:
    """Keeps the simulation's samples; forces are means since the sample before, as in `timeseries.csv`."""

    def __init__(self, schedule: Schedule, *, quantities: Collection[str] | None = None):
        """Args: schedule; quantities: keys of those that are sampled, None for all that the simulation has."""
        self.schedule = schedule
        self.samples: list[dict[str, float]] = []
        """One after the other, by the keys of `warp_mpm.quantities.TIME_SERIES`."""
        self._quantities = quantities
        self._window: Any = None

    @property
    def latest(self) -> dict[str, float]:
        """The last sample; empty before the first."""
        return self.samples[-1] if self.samples else {}

    def record(self, simulation: Any) -> None:
        """Keep one sample."""
        self.samples.append(simulation.sample(self._quantities, since=self._window))
        self._window = simulation.window().after(self._window)

    def series(self) -> dict[str, Array]:
        """Columns by name, each [samples] in SI units, as of `Results.time_series`."""
        keys = self.samples[0] if self.samples else {}
        known = {key: TIME_SERIES[key].name if key in TIME_SERIES else key for key in keys}
        return {name: np.array([sample[key] for sample in self.samples]) for key, name in known.items()}

    def close(self) -> None:
        """There is nothing to close."""


class LoadsInMemory:
    """Keeps mean pressures on the slots of the barriers, as in `loads.h5`."""

    def __init__(self, schedule: Schedule):
        self.schedule = schedule
        self.times: list[float] = []
        self.stretches: tuple[Stretch, ...] = ()
        """Of the slots, as of the simulation."""
        self._rows: list[dict[str, dict[str, Array]]] = []
        self._before: tuple[float, Array] | None = None

    def record(self, simulation: Any) -> None:
        """Keep one row."""
        window = simulation.window()
        mean, self._before = mean_on_slots(window, self._before)
        self.stretches = tuple(stretches_of(simulation))
        self.times.append(simulation.time)
        self._rows.append(
            {
                stretch.surface: pressures(mean[stretch.slots], stretch, simulation.scenario)
                for stretch in self.stretches
            }
        )

    def pressures(self, surface: str) -> dict[str, Array]:
        """Arrays [times, slots] of a surface in Pa, by their names."""
        rows = [row[surface] for row in self._rows]
        return {name: np.array([row[name] for row in rows]) for name in (rows[0] if rows else ())}

    def close(self) -> None:
        """There is nothing to close."""


class SnapshotsInMemory:
    """Keeps the material points, in double precision."""

    def __init__(self, schedule: Schedule):
        self.schedule = schedule
        self.snapshots: list[Snapshot] = []

    def record(self, simulation: Any) -> None:
        """Keep one snapshot."""
        self.snapshots.append(snapshot_of(simulation))

    def close(self) -> None:
        """There is nothing to close."""
