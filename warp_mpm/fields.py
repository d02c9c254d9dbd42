"""What a snapshot shows: quantities of the material points in the units in which people read them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mpm.quantities.points import DRAWN, Drawn
from warp_mpm.results import Snapshot
from warp_mpm.scenario import Scenario

Array = NDArray[np.float64]

FIELDS = tuple(DRAWN.values())
"""Quantities by which points can be coloured."""


def field_named(name: str) -> Drawn:
    """The field of that name.

    Raises:
        ValueError: there is none.
    """
    if name not in DRAWN:
        raise ValueError(f"field = {name!r} is not known; it must be one of {', '.join(DRAWN)}.")
    return DRAWN[name]


def solid_density_of(scenario: Scenario, snapshot: Snapshot) -> float | Array:
    """Initial mass of solid per volume of the whole [kg/m³]: of all, or of each point [N] where materials differ."""
    if "material" not in snapshot:
        return scenario.flow.material.solid_partial_density
    known = np.array([material.solid_partial_density for material in scenario.flow.materials])
    return known[snapshot["material"].astype(int)]


def field_values(snapshot: Snapshot, name: str, solid_density: float | Array) -> Array | None:
    """Values [N] of a field, in the unit in which it is shown; None where the run has no such field.

    Args:
        snapshot: of N points.
        name: of a field.
        solid_density: initial mass of solid per volume of the whole [kg/m³]; from `solid_density_of`.
    """
    field = DRAWN[name]
    if any(need not in snapshot for need in field.needs):
        return None
    return field.values(snapshot, solid_density) * field.factor


def colour_limits(values: Array, signed: bool) -> tuple[float, float]:
    """Limits of a colour scale: a few points of a jet that lands must not take the whole scale for themselves."""
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return (-1.0, 1.0) if signed else (0.0, 1.0)
    if signed:
        reach = float(np.quantile(np.abs(values), 0.98)) or 1.0
        return -reach, reach
    return 0.0, float(np.quantile(values, 0.99)) or 1.0
