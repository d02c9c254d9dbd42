"""One launch of a kernel, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Launch:
    """One launch of a kernel."""

    kernel: str
    over: Literal["one", "workers", "points", "places", "groups"]
    """What its threads count: workers share the blocks of the grid in use; places and groups are a body's."""
    takes: tuple[str, ...]
    """Its arguments, by the names under which the simulation knows them."""
    does: str
    """What it does, in a clause."""
    of: str = ""
    """The body that it acts for."""
