"""Where the flow acts on a barrier at the time of a sample: resultant, moments, pressure on a patch of the face."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..kernels import layout as at
from ..scenario import Scenario
from ..simulator.bodies import Body
from ..simulator.bodies.loads import Patches, Slots
from .samples import Window

Array = NDArray[np.float64]

PRESSED = 0.1
"""Share of the flow's weight, as a pressure, from which on a slot counts as reached: spray does not."""


@dataclass(frozen=True)
class Patch:
    """The patch of the impacted face with the greatest mean pressure."""

    pressure: float = 0.0
    """[Pa]"""
    height: float = 0.0
    """Of its middle above the barrier's base [m]; 0 without pressure."""


@dataclass(frozen=True)
class LoadsNow:
    """Loads on a barrier between two marks."""

    scenario: Scenario
    bodies: Sequence[Body]
    slots: Slots
    patches: Patches
    """Of the impacted face."""
    now: Window
    since: Window

    @cached_property
    def _rate(self) -> float:
        elapsed = self.now.time - self.since.time
        return 1.0 / elapsed if elapsed > 0.0 else 0.0

    @cached_property
    def _turning(self) -> dict[str, tuple[float, float]]:
        """Means of F_x y and F_y x [N] of each surface of the barrier, by name."""
        names = [surface.name for body in self.bodies for surface in body.surfaces]
        own = [surface.name for surface in self.bodies[self.slots.body].surfaces]
        before = self.since.turned or [0.0] * len(self.now.turned)
        mean = [(b - a) * self._rate for a, b in zip(before, self.now.turned, strict=True)]
        return {name: (mean[2 * k], mean[2 * k + 1]) for k, name in enumerate(names) if name in own}

    def height_of(self, surface: str, force: float) -> float:
        """Height [m] above the base at which a surface's mean horizontal `force` [N/m] acts; 0 without force."""
        return self._turning[surface][0] / force if force != 0.0 else 0.0

    @cached_property
    def toe_moment(self) -> float:
        """Mean moment [N m/m] of all forces of the flow on the barrier about its toe; + turns it downstream."""
        return sum(across - up for across, up in self._turning.values())

    def heel_moment(self, force: tuple[float, ...]) -> float:
        """The same about its heel, of a barrier that has one, with the mean `force` on it along the axes [N/m]."""
        assert self.slots.heel is not None
        x, y = self.slots.heel
        return self.toe_moment + force[1] * x - force[0] * y

    @cached_property
    def _sums(self) -> Array:
        """Impulses [n, SLOT_SIZE] of the face's slots in the time over which a patch's mean is taken, over that time:
        the last `Window.reach`, or since the last mark where that is longer, or what is known of it."""
        start = min(self.since.time, self.now.time - self.now.reach)
        known = [*self.since.trail, (self.since.time, self.since.taken)]
        times = [time for time, _ in known]
        later = next((k for k, time in enumerate(times) if time >= start), len(times) - 1)
        begin, before = times[later], known[later][1]
        if later > 0 and begin > start:
            earlier, share = known[later - 1][1], (begin - start) / (begin - times[later - 1])
            before, begin = before - share * (before - earlier), start
        elapsed = self.now.time - begin
        face = self.slots.face.slots
        taken = (self.now.taken - before).reshape(-1, at.SLOT_SIZE)[face]
        return taken / elapsed if elapsed > 0.0 else np.zeros_like(taken)

    @cached_property
    def _pressed(self) -> Array:
        """Normal loads [n] of both phases on the face's slots [N/m]."""
        return self._sums[:, at.SLOT_NORMAL] + (self._sums[:, at.SLOT_LIQUID] if self._two_phase else 0.0)

    @cached_property
    def _two_phase(self) -> bool:
        return self.scenario.flow.wettest_formulation == "two_phase"

    @cached_property
    def pressure_patch(self) -> Patch:
        """Of the total normal pressure, of both phases."""
        return self._greatest(self._pressed)

    @property
    def run_up(self) -> float:
        """Height [m] above the base of the highest slot of the face with `PRESSED` of the pressure under the flow at
        the start; 0 where there is none."""
        flow, face = self.scenario.flow, self.slots.face
        least = PRESSED * flow.material.density * self.scenario.gravity.acceleration_m_per_s2 * flow.depth
        reached = np.flatnonzero(self._pressed > least * (face.edges[1] - face.edges[0]))
        return float(np.maximum(face.heights[reached], face.heights[reached + 1]).max()) if reached.size else 0.0

    @cached_property
    def pore_pressure_patch(self) -> Patch:
        """Of the liquid's pressure."""
        # With two phases the liquid gets its share of the surface, the porosity at the start.
        share = self.scenario.flow.wettest.porosity if self._two_phase else 1.0
        return self._greatest(self._sums[:, at.SLOT_LIQUID] / share)

    def _greatest(self, load: Array) -> Patch:
        """Of loads [n] of the face's slots [N/m]."""
        mean = self.patches.means(load)
        # Patches that overlap often have the same mean but for rounding: the lowest of them, always.
        greatest = int(np.argmax(mean >= mean.max() * (1.0 - 1e-9)))
        if not mean[greatest] > 0.0:
            return Patch()
        return Patch(float(mean[greatest]), float(self.patches.heights[greatest]))
