"""What a body is: an outline, surfaces with names and friction, and a motion."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

from .outline import Outline


@dataclass(frozen=True)
class Surface:
    """A named stretch of an outline, on which the flow's force is recorded as `NAME_force_x` and `NAME_force_y`."""

    name: str
    friction: float = 0.0
    """Friction coefficient tan δ between the flow's solid and the surface; 0 is smooth."""
    pieces: tuple[int, ...] | None = None
    """Which pieces of the outline: piece k runs from vertex k of `Outline.vertices`. None: all of them."""
    turbulence: float = 0.0
    """Shear stress beside the friction, over the square of the slip [kg/m³]: ρ g / ξ of Voellmy's; 0 is none."""

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.name):
            raise ValueError(f"name = {self.name!r} is not allowed; it must be small letters, digits and _")
        if not 0.0 <= self.friction <= 10.0:
            raise ValueError(f"friction = {self.friction:g} of {self.name} must be from 0 to 10")
        if not 0.0 <= self.turbulence < math.inf:
            raise ValueError(f"turbulence = {self.turbulence:g} of {self.name} must be at least 0 and finite")


@dataclass(frozen=True)
class Fixed:
    """The body does not move."""


@dataclass(frozen=True)
class Driven:
    """The body follows a given velocity, whatever the flow does to it: linear between the times of a table, constant
    before the first and after the last."""

    times: tuple[float, ...]
    """[s], increasing."""
    velocities: tuple[tuple[float, float], ...]
    """Along x and y [m/s]."""

    def __post_init__(self) -> None:
        if not self.times or len(self.times) != len(self.velocities):
            raise ValueError(f"{len(self.times)} times and {len(self.velocities)} velocities; they must be as many")
        if any(not b > a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ValueError("times must increase")
        if not all(math.isfinite(v) for velocity in self.velocities for v in velocity):
            raise ValueError("velocities must be finite numbers")

    @classmethod
    def function(cls, velocity: Callable[[float], tuple[float, float]], times: Sequence[float]) -> Self:
        """A motion from a function of the time, looked up at `times` [s] and linear in between.

        Args:
            velocity: of the time [s], returns (v_x, v_y) [m/s].
            times: increasing.
        """
        looked_up = tuple((float(vx), float(vy)) for vx, vy in map(velocity, times))
        return cls(tuple(float(time) for time in times), looked_up)


@dataclass(frozen=True)
class Sliding:
    """The body slides along x on its base with Coulomb friction, and sticks when it comes to rest."""

    mass: float
    """[kg/m]."""
    base_friction: float
    """tan δ_b [-]."""

    def __post_init__(self) -> None:
        if not (self.mass > 0.0 and math.isfinite(self.mass)):
            raise ValueError(f"mass = {self.mass:g} must be greater than 0 and finite")
        if not 0.0 <= self.base_friction < math.inf:
            raise ValueError(f"base_friction = {self.base_friction:g} must be at least 0 and finite")


@dataclass(frozen=True)
class Body:
    """A rigid, impermeable body.

    `Simulation(scenario, bodies=[...])` takes any number of them beside those of the scenario.
    """

    name: str
    outline: Outline
    surfaces: tuple[Surface, ...] = ()
    """Each piece of the outline belongs to one of them. None given: one surface, smooth, of the body's name."""
    motion: Fixed | Driven | Sliding = Fixed()
    carries_grid: bool = False
    """The grid moves with the body along x, so that both stay as they lie to each other; at most one body's."""
    edge: bool = False
    """An edge of the domain: straight along the grid, and sets no point back. Its forces are in the balance of momentum
    but not recorded."""
    dense_corners: bool = False
    """Whether points of contact lie closer at the corners of the outline, so that what is at rest there stays so."""

    def __post_init__(self) -> None:
        if not self.surfaces:
            object.__setattr__(self, "surfaces", (Surface(self.name),))
        pieces = len(self.outline.segments)
        claimed = [piece for surface in self.surfaces for piece in _pieces(surface, pieces)]
        if sorted(claimed) != list(range(pieces)):
            raise ValueError(
                f"the surfaces of {self.name} claim the pieces {sorted(claimed)}; "
                f"each of 0 to {pieces - 1} must belong to one surface"
            )
        if self.carries_grid and isinstance(self.motion, Driven) and any(vy for _, vy in self.motion.velocities):
            raise ValueError(f"{self.name} moves along y, and the grid along x alone; carries_grid must be False")

    @property
    def surface_of_piece(self) -> list[int]:
        """Which of `surfaces` each piece of the outline belongs to."""
        count = len(self.outline.segments)
        of = {piece: number for number, surface in enumerate(self.surfaces) for piece in _pieces(surface, count)}
        return [of[piece] for piece in range(count)]

    @property
    def rubs(self) -> bool:
        """Whether any of its surfaces has friction."""
        return any(surface.friction > 0.0 for surface in self.surfaces) or self.turbulent

    @property
    def turbulent(self) -> bool:
        """Whether any of them has a friction that grows with the square of the slip."""
        return any(surface.turbulence > 0.0 for surface in self.surfaces)

    @property
    def moves(self) -> bool:
        return not isinstance(self.motion, Fixed)


def _pieces(surface: Surface, count: int) -> Sequence[int]:
    return range(count) if surface.pieces is None else surface.pieces
