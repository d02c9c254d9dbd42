"""What a snapshot shows: quantities of the material points in the units in which people read them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mpm.results import Snapshot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Field:
    """A quantity by which points can be coloured."""

    name: str
    label: str
    unit: str
    signed: bool = False
    """Whether nil is the middle of the colours."""

    @property
    def title(self) -> str:
        """Label with unit."""
        return f"{self.label} [{self.unit}]"


FIELDS = (
    Field("pore_pressure", "pore pressure", "kPa"),
    Field("speed", "speed of the solid", "m/s"),
    Field("slip", "speed of the liquid relative to the solid", "m/s"),
    Field("volumetric_strain", "volumetric strain, expansion +", "%", signed=True),
    Field("mean_effective_stress", "mean effective stress, compression +", "kPa"),
    Field("deviatoric_strain", "cumulative deviatoric strain", "-"),
)


def field_named(name: str) -> Field:
    """The field of that name.

    Raises:
        ValueError: there is none.
    """
    for field in FIELDS:
        if field.name == name:
            return field
    raise ValueError(f"field = {name!r} is not known; it must be one of {', '.join(one.name for one in FIELDS)}.")


def field_values(snapshot: Snapshot, name: str, solid_density: float) -> Array | None:
    """Values [N] of a field, in its unit; None where the run has no such field.

    Args:
        snapshot: of N points.
        name: of a field.
        solid_density: initial mass of solid per volume of the whole [kg/m³]. The volumetric strain is V / V_0 - 1, with
            V_0 from the point's solid mass, which it keeps.
    """
    if name == "pore_pressure":
        return snapshot[name] / 1e3 if name in snapshot else None
    if name == "speed":
        return np.hypot(*snapshot["solid_velocity"].T)
    if name == "slip":
        if "liquid_velocity" not in snapshot:
            return None
        return np.hypot(*(snapshot["liquid_velocity"] - snapshot["solid_velocity"]).T)
    if name == "volumetric_strain":
        return 100.0 * (snapshot["volume"] * solid_density / snapshot["solid_mass"] - 1.0)
    if name == "mean_effective_stress":
        return -snapshot["effective_stress"][:, :3].mean(axis=1) / 1e3
    return snapshot[name]


def colour_limits(values: Array, signed: bool) -> tuple[float, float]:
    """Limits of a colour scale: a few points of a jet that lands must not take the whole scale for themselves."""
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return (-1.0, 1.0) if signed else (0.0, 1.0)
    if signed:
        reach = float(np.quantile(np.abs(values), 0.98)) or 1.0
        return -reach, reach
    return 0.0, float(np.quantile(values, 0.99)) or 1.0
