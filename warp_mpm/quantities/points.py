"""Quantities of the material points: those of a snapshot, and those that pictures take from it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .quantity import MASS, VOLUME, Quantity

Array = NDArray[np.float64]

POSITION = Quantity("position", "m", "position")

POINT_FIELDS: Mapping[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        Quantity("solid_velocity", "m/s", "velocity of the solid, v_S"),
        Quantity("liquid_velocity", "m/s", "velocity of the liquid, v_L"),
        Quantity("effective_stress", "Pa", "effective stress σ', tension positive; components xx, yy, zz, xy, yz, xz"),
        Quantity("pore_pressure", "Pa", "pore pressure p_L, compression positive"),
        Quantity("porosity", "-", "volume of the voids over the total volume, n"),
        Quantity("deviatoric_strain", "-", "cumulative deviatoric strain, ε_d", "cumulative deviatoric strain"),
        Quantity("volume", VOLUME, "volume of the material point"),
        Quantity("solid_mass", MASS, "mass of solid of the material point"),
        Quantity("liquid_mass", MASS, "mass of liquid of the material point"),
        Quantity(
            "material",
            "-",
            "place of its material, where a scene has several: 0 the flow's, then deposits', then what arrives",
        ),
    )
}
"""Point arrays of a snapshot, beside the positions."""


@dataclass(frozen=True)
class Drawn(Quantity):
    """A quantity by which points can be coloured, [N] of a snapshot."""

    values: Callable[[Any, Any], Array] = lambda snapshot, solid_density: np.empty(0)
    """From a snapshot and the initial mass of solid per volume of the whole [kg/m³], one number or [N]."""
    needs: tuple[str, ...] = ()
    """Point arrays without which it is not there."""
    signed: bool = False
    """Whether nil is the middle of the colours."""


def _as_it_is(name: str) -> dict[str, Any]:
    known = POINT_FIELDS[name]
    return {"name": name, "unit": known.unit, "meaning": known.meaning, "label": known.words, "needs": (name,)}


DRAWN: Mapping[str, Drawn] = {
    one.name: one
    for one in (
        Drawn(**_as_it_is("pore_pressure"), values=lambda snapshot, _: snapshot["pore_pressure"]),
        Drawn(
            "speed",
            "m/s",
            "speed of the solid, |v_S|",
            "speed of the solid",
            values=lambda snapshot, _: np.hypot(*snapshot["solid_velocity"].T),
            needs=("solid_velocity",),
        ),
        Drawn(
            "slip",
            "m/s",
            "speed of the liquid relative to the solid, |v_L - v_S|",
            "speed of the liquid relative to the solid",
            values=lambda snapshot, _: np.hypot(*(snapshot["liquid_velocity"] - snapshot["solid_velocity"]).T),
            needs=("liquid_velocity", "solid_velocity"),
        ),
        Drawn(
            "volumetric_strain",
            "-",
            "V / V_0 - 1, with V_0 from the point's solid mass, which it keeps",
            "volumetric strain, expansion +",
            shown=("%", 100.0),
            values=lambda snapshot, density: snapshot["volume"] * density / snapshot["solid_mass"] - 1.0,
            needs=("volume", "solid_mass"),
            signed=True,
        ),
        Drawn(
            "mean_effective_stress",
            "Pa",
            "-(σ'_xx + σ'_yy + σ'_zz) / 3",
            "mean effective stress, compression +",
            values=lambda snapshot, _: -snapshot["effective_stress"][:, :3].mean(axis=1),
            needs=("effective_stress",),
        ),
        Drawn(**_as_it_is("deviatoric_strain"), values=lambda snapshot, _: snapshot["deviatoric_strain"]),
    )
}
"""What colours points, by name, in the order in which it is offered."""
