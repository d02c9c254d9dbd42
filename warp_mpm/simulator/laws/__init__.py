"""Laws of the skeleton: how its effective stress follows from its strain, one a file."""

from __future__ import annotations

from ..room import Room
from .elastic import Elastic
from .law import Law
from .mohr_coulomb import MohrCoulomb

__all__ = ["DEFAULT", "LAWS", "Law"]

LAWS: Room[Law] = Room("law", [MohrCoulomb(), Elastic()])

DEFAULT = "mohr_coulomb"
"""The law of a material that names none."""
