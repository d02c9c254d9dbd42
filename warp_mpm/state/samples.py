"""What a sample of the time series is taken from: the sums that the kernels keep, at one time.

What each quantity is and how it is read from here stands in `warp_mpm/quantities/time_series.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels import layout as at
from ..quantities import TIME_SERIES, Sampled, force_of_surface, further_quantities, quantities_of
from ..quantities.time_series import IN_SPACE, OWN
from ..scenario import Scenario
from ..simulator.bodies import Body


def _entries(prefix: str) -> dict[str, int]:
    """Places in an array of the device by name: `LEDGER_SOLID_MASS` as `solid_mass`."""
    return {name.removeprefix(prefix).lower(): place for name, place in vars(at).items() if name.startswith(prefix)}


_LEDGER, _LEFT, _INFLOW = _entries("LEDGER_"), _entries("LEFT_"), _entries("INFLOW_")
_BALANCE = {name.lower(): place for name, place in vars(at).items() if name.startswith(("GRAVITY_", "SEEPAGE_"))}


CLOSE = 1.0 / 16.0
"""Share of a window's reach within which it keeps one mark."""


@dataclass(frozen=True)
class Window:
    """Sums since t = 0 at some time: forces since then are differences to them."""

    time: float
    """[s]."""
    reactions: list[float]
    """Impulse of the flow on each surface along x and y, one after the other [N s/m]."""
    base_impulse: float = 0.0
    """Of friction at the barrier's base [N s/m]."""
    turned: Sequence[float] = ()
    """Sums of F_x y and F_y x on each surface of a barrier, from its toe, one after the other [N s]; nil on other
    bodies."""
    taken: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    """Of each slot of the barriers (`simulator.bodies.loads`), one after the other, as in `layout.SLOT_...` [N s/m]."""
    trail: Sequence[tuple[float, NDArray[np.float64]]] = ()
    """Times [s] before this one and what `taken` was then, the latest last."""
    reach: float = 0.0
    """How long before this time the trail is to begin [s]."""

    def after(self, before: Window | None) -> Window:
        """The same mark, which knows what an earlier one tells of the time within its reach."""
        if before is None or not len(self.taken):
            return self
        trail = list(before.trail)
        # Close marks add nothing that a mean over the reach would show.
        if not trail or before.time - trail[-1][0] >= CLOSE * self.reach:
            trail.append((before.time, before.taken))
        while len(trail) > 1 and trail[1][0] <= self.time - self.reach:
            trail.pop(0)
        return replace(self, trail=trail)

    def plain(self) -> list[Any]:
        """As lists of numbers, for `of`."""
        trail = [[time, taken.tolist()] for time, taken in self.trail]
        sums = [list(self.reactions), self.base_impulse, list(self.turned), self.taken.tolist()]
        return [self.time, *sums, trail, self.reach]

    @classmethod
    def of(cls, plain: Sequence[Any]) -> Window:
        """From `plain`, to the last digit."""
        time, reactions, base_impulse, turned, taken, trail, reach = plain
        before = [(then, np.array(sums)) for then, sums in trail]
        return cls(time, reactions, base_impulse, turned, np.array(taken), before, reach)


@dataclass(frozen=True)
class BarrierNow:
    """The barrier's motion at the time of a sample."""

    displacement: float = 0.0
    """[m]."""
    velocity: float = 0.0
    """[m/s]."""
    work: float = 0.0
    """Of the flow on it since t = 0 [J/m]."""
    base_work: float = 0.0
    """That friction at its base has taken [J/m]."""
    mass: float = 0.0
    """[kg/m]; nil where it does not slide."""

    @property
    def kinetic_energy(self) -> float:
        """[J/m]."""
        return 0.5 * self.mass * self.velocity**2


@dataclass(frozen=True)
class Now:
    """The scene at the time of a sample, as the readers of quantities see it."""

    scenario: Scenario
    bodies: Sequence[Body]
    """All that the flow meets."""
    barrier: BarrierNow
    """Of no matter where there is none."""
    further: Mapping[str, BarrierNow]
    """The same of each further barrier, by its name."""
    time: float
    """[s]."""
    time_step: float
    """[s]."""
    elapsed: float
    """Time over which forces are means [s]."""
    forces: Mapping[str, tuple[float, ...]]
    """Mean force of the flow on each surface, and on each body of several, along the axes, by its name [N/m]."""
    base_force: float
    """Mean friction at the base of a sliding barrier, against its motion [N/m]."""
    loads: Any
    """Where the flow acts on the barrier (`state.loads.LoadsNow`); None without one."""
    loads_on: Mapping[str, Any]
    """The same of every barrier, by its name."""
    impulses: Sequence[float]
    """Of the flow on all surfaces since t = 0, along x and y in turn [N s/m]."""
    initial_momentum: Sequence[float]
    """Of the flow along x and y [N s/m]."""
    points: Callable[..., Mapping[str, Any]]
    """`Simulation.points`: arrays of the material points, all or what is named."""
    sums: Sequence[float]
    departed: Sequence[float]
    balanced: Sequence[float]
    arrived: Sequence[float] = (0.0,) * at.INFLOW_SIZE

    def ledger(self, entry: str) -> float:
        """Sum over the material points: `LEDGER_...` of `kernels/layout.py`, in small letters."""
        return self.sums[_LEDGER[entry]]

    def left(self, entry: str) -> float:
        """What has left the domain: `LEFT_...`."""
        return self.departed[_LEFT[entry]]

    def balance(self, entry: str) -> float:
        """What gravity gave to the flow: `GRAVITY_...`, `SEEPAGE_...`."""
        return self.balanced[_BALANCE[entry]]

    def inflow(self, entry: str) -> float:
        """What an inflow has brought: `INFLOW_...`."""
        return self.arrived[_INFLOW[entry]]

    @property
    def base_normal_force(self) -> float:
        """Mean force with which a sliding barrier presses on its base [N/m]."""
        barrier = next(body for body in self.bodies if body.name == "barrier")
        vertical = sum(self.forces[surface.name][1] for surface in barrier.surfaces)
        return max(-self.barrier.mass * self.scenario.gravity.vector[1] - vertical, 0.0)


def sampled_quantities(scenario: Scenario, bodies: Sequence[Body], dimensions: int) -> dict[str, Sampled]:
    """What a sample of a scene tells, by key: of the table, of a script, and forces on the surfaces of its bodies."""
    further = further_quantities(scenario)
    found = {key: TIME_SERIES.get(key) or further.get(key) or OWN[key] for key in quantities_of(scenario)}
    for body in bodies:
        for surface in body.surfaces:
            for axis in ("x", "y"):
                if not body.edge:
                    found.setdefault(f"{surface.name}_force_{axis}", force_of_surface(surface.name, axis))
    if dimensions == 2:
        return found
    there = {key: row for key, row in IN_SPACE.items() if not key.startswith("ground") or scenario.ground is not None}
    return {key: row.in_dimensions(dimensions) for key, row in (found | there).items()}


def wanted_quantities(known: Mapping[str, Sampled], names: Collection[str] | None) -> list[Sampled]:
    """Those that a sample reads: what is named, or all; and all that cost nothing, so that none of them is ever no
    number unseen."""
    return [one for key, one in known.items() if names is None or key in names or not (one.of_points or one.of_loads)]


def mean_forces(bodies: Sequence[Body], now: Window, since: Window) -> tuple[dict[str, tuple[float, ...]], float]:
    """Mean force [N/m] on each surface and on each body of several by name, and at the base, between two windows:
    impulse over time."""
    elapsed = now.time - since.time
    rate = 1.0 / elapsed if elapsed > 0.0 else 0.0
    means = [(after - before) * rate for after, before in zip(now.reactions, since.reactions, strict=True)]
    surfaces = [surface.name for body in bodies for surface in body.surfaces]
    each = zip(surfaces, np.reshape(means, (len(surfaces), -1)).tolist() if surfaces else (), strict=True)
    forces: dict[str, tuple[float, ...]] = {name: tuple(force) for name, force in each}
    for body in bodies:
        if len(body.surfaces) > 1:
            along = zip(*(forces[surface.name] for surface in body.surfaces), strict=True)
            forces.setdefault(body.name, tuple(map(sum, along)))
    return forces, -(now.base_impulse - since.base_impulse) * rate
