"""Transfer schemes: how velocities go from the points to the nodes and back, one a file."""

from __future__ import annotations

from ..room import Room
from .aflip import Aflip
from .apic import Apic
from .flip import Flip
from .scheme import Scheme

__all__ = ["SCHEMES", "Scheme"]

SCHEMES: Room[Scheme] = Room("scheme", [Flip(), Apic(), Aflip()])
