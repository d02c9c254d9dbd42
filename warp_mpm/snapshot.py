"""The material points at one time, of a simulation or of a run folder."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Snapshot:
    """The material points at one time."""

    time: float
    """[s]."""
    barrier_displacement: float | None
    """[m]; None without a barrier."""
    position: Array
    """[N, 2] m."""
    fields: dict[str, Array] = field(repr=False)
    """Arrays with N rows in SI units: velocities [N, 2], effective_stress [N, 4] (xx, yy, zz, xy), others [N]."""

    def __getitem__(self, name: str) -> Array:
        return self.fields[name]

    def __contains__(self, name: object) -> bool:
        return name in self.fields


def snapshot_of(simulation: Any) -> Snapshot:
    """The material points of a simulation now, in double precision."""
    points = dict(simulation.points())
    return Snapshot(simulation.time, simulation.barrier_displacement, points.pop("position"), points)
