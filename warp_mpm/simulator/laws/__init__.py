"""Laws of the skeleton: how its effective stress follows from its strain, one a file."""

from __future__ import annotations

from ..room import Room
from .coulomb_viscous import CoulombViscous
from .elastic import Elastic
from .herschel_bulkley import HerschelBulkley
from .law import Law
from .mohr_coulomb import MohrCoulomb
from .mu_i import MuI

__all__ = ["DEFAULT", "LAWS", "Law"]

LAWS: Room[Law] = Room("law", [MohrCoulomb(), Elastic(), HerschelBulkley(), CoulombViscous(), MuI()])

DEFAULT = "mohr_coulomb"
"""The law of a material that names none."""
