"""One launch of a kernel, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Launch:
    """One launch of a kernel."""

    kernel: str
    over: Literal["one", "workers", "points", "flow", "groups", "lanes"]
    """What its threads count: workers share the blocks of the grid in use; points have one each, and in the flow they
    take them in turn; groups are of places of contact, and lanes share those that are joined."""
    takes: tuple[str, ...]
    """Its arguments, by the names under which the simulation knows them."""
    does: str
    """What it does, in a clause."""
