"""What a material point stores for a law or a scheme."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import ArrayLike


@dataclass(frozen=True)
class PointField:
    """One quantity, by the name under which the kernels find it in `points`."""

    kind: Literal["scalar", "X", "T", "V", "V2", "V4"] = "scalar"
    """A place (or a velocity), a symmetric tensor, all velocities at a place; V2 and V4 are two and four numbers in any
    dimensions."""
    start: float | Callable[[Any, Any], ArrayLike] = 0.0
    """At t = 0: one number for all, or a function of the scenario and of its material points (`MaterialPoints`)."""
    meaning: str = ""
    """What it is called in a sentence: "the plastic strain". With a meaning it is in `Simulation.points()`, and in the
    sentence on a run that diverged."""
