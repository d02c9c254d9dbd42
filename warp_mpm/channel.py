"""Three dimensions, as far as they go: a scene is the section of a channel, along which it is drawn.

A scenario describes a section, x and y. A `Channel` gives it a width: the ground and the walls of the section go on
along z, smooth walls stand at z = 0 and at z = width, and the flow fills the section's outline from one z to another.

>>> simulation = Simulation(Scenario.load("block.json"), channel=Channel(width=4.0, flow=(1.0, 3.0)))

From there on the kernels move points in space, whatever lies on whichever side of what. Quantities are those of the
whole, no longer per metre of width: newtons, kilograms, joules.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .discretization import MaterialPoints
from .grid import MARGIN, GridLayout
from .scenario import Scenario
from .simulator.bodies import Body
from .simulator.bodies.side import Side
from .simulator.laws import LAWS
from .simulator.schemes import SCHEMES

ON_GRID = 1e-6
"""Share of a cell by which a place may miss the grid."""


@dataclass(frozen=True)
class Channel:
    """A channel with smooth upright walls at z = 0 and z = `width`."""

    width: float
    """A multiple of the spacing [m]."""
    flow: tuple[float, float] | None = None
    """z from which and to which it is filled at the start [m]; None: all of it."""

    def check(self, scenario: Scenario, bodies: Sequence[Body]) -> None:
        """Refuse what is not there in space.

        Args:
            scenario: the section.
            bodies: beside those of the scenario.

        Raises:
            ValueError: one sentence.
        """
        spacing = scenario.numerics.spacing_m
        if not (math.isfinite(self.width) and self.width > 0.0 and _on_grid(self.width, spacing)):
            raise ValueError(f"channel.width = {self.width:g} must be a multiple of numerics.spacing_m = {spacing:g}")
        low, high = self.filled
        if not 0.0 <= low < high <= self.width:
            raise ValueError(f"channel.flow = {self.flow} must be two places from 0 to channel.width = {self.width:g}")
        missing = _missing(scenario, bodies)
        if missing:
            raise ValueError(f"{missing} is not there in three dimensions yet; see docs/limits.md for what is")

    @property
    def filled(self) -> tuple[float, float]:
        """z from which and to which it is filled at the start [m]."""
        return self.flow if self.flow is not None else (0.0, self.width)

    def stacked(self, grid: GridLayout) -> GridLayout:
        """The section's grid as the layers of one in space, with a margin on either side."""
        layers = round(self.width / grid.spacing) + 2 * MARGIN
        return replace(grid, layers=layers, front=-MARGIN * grid.spacing)

    def walls(self) -> list[Body]:
        """The side walls."""
        return [
            Body("front_wall", Side(0.0, 1), edge=True),
            Body("back_wall", Side(self.width, -1), edge=True),
        ]

    def drawn(self, section: MaterialPoints, scenario: Scenario) -> MaterialPoints:
        """The section's points, one behind the other, about as far apart as in the section."""
        numerics = scenario.numerics
        low, high = self.filled
        side = numerics.spacing_m / math.isqrt(numerics.points_per_cell)
        count = max(1, round((high - low) / side))
        width = (high - low) / count
        z = np.repeat(low + (np.arange(count) + 0.5) * width, len(section.volume))

        def along(values: np.ndarray) -> np.ndarray:
            return np.concatenate([values] * count)

        nil = np.zeros((len(z), 2))
        return MaterialPoints(
            position=np.column_stack([along(section.position), z]),
            volume=width * along(section.volume),
            solid_mass=width * along(section.solid_mass),
            liquid_mass=width * along(section.liquid_mass),
            effective_stress=np.concatenate([along(section.effective_stress), nil], axis=1),
            pore_pressure=along(section.pore_pressure),
            velocity=np.concatenate([along(section.velocity), nil[:, :1]], axis=1),
            entry=along(section.entry),
            pace=along(section.pace),
            material=along(section.material),
        )


def _on_grid(place: float, spacing: float) -> bool:
    return abs(place / spacing - round(place / spacing)) < ON_GRID


def _missing(scenario: Scenario, bodies: Sequence[Body]) -> str:
    """The first thing of a scene that is not there in space; empty: all is."""
    law, transfer = scenario.flow.material.law, scenario.numerics.transfer
    if scenario.barrier is not None or scenario.barriers:
        return "a barrier"
    if bodies:
        return f"the body {bodies[0].name!r} of a script"
    if scenario.ground is not None and (not scenario.ground.level or scenario.ground.stretches):
        return "a ground that is not level and all alike (ground.profile_m, ground.stretches)"
    if scenario.flow.inflow is not None:
        return "flow.inflow"
    if scenario.flow.sheared:
        return "a velocity that varies over the depth (flow.base_velocity_share, flow.velocity_profile)"
    if len(scenario.flow.materials) > 1:
        return "a deposit with a material of its own (flow.deposits)"
    if 3 not in LAWS.named(law).dimensions:
        return f"flow.material.law = {law}"
    if 3 not in SCHEMES.named(transfer).dimensions:
        return f"numerics.transfer = {transfer}"
    domain, spacing = scenario.domain, scenario.numerics.spacing_m
    for edge, place in (("left", domain.left_m), ("right", domain.right_m), ("top", domain.top_m)):
        if getattr(domain, f"{edge}_edge") == "wall" and place is not None and not _on_grid(place, spacing):
            return f"a wall beside the cells' edges (domain.{edge}_m = {place:g}, numerics.spacing_m = {spacing:g})"
    return ""
