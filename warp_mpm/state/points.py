"""The material points as they are now: arrays in SI units, of those that are still in the domain."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import Effects
from ..kernels import layout as at
from ..kernels.pore_pressure import LEAST_POROSITY
from ..scenario import Scenario


def of_each(scenario: Scenario, material: NDArray[np.int32], name: str) -> NDArray[np.float64]:
    """A field of each point's material [N]; 0 where that has none."""
    return np.array([getattr(own, name, 0.0) for own in scenario.flow.materials])[material]


def stiffness_of_liquid(scenario: Scenario, material: NDArray[np.int32]) -> NDArray[np.float64]:
    """Bulk modulus of each point's liquid [N] [Pa]; infinite where there is none, which bears no pressure."""
    modulus = of_each(scenario, material, "liquid_bulk_modulus_Pa")
    return np.where(modulus > 0.0, modulus, math.inf)


@dataclass(frozen=True)
class PointsNow:
    """What `Simulation.points` tells."""

    scenario: Scenario
    effects: Effects
    arrays: Mapping[str, Any]
    """On the device, by name."""
    solid_mass: NDArray[np.float64]
    """Of each point [N] [kg/m]."""
    liquid_mass: NDArray[np.float64]
    """Of each point [N] [kg/m]."""
    material: NDArray[np.int32]
    """Of each point [N]: place among the scene's materials."""

    def read(self, names: Collection[str] | None) -> dict[str, NDArray[np.float64]]:
        """All, or what is named; see `Simulation.points`."""
        inside = self.arrays["inside"].numpy() == at.INSIDE
        rows = slice(None) if inside.all() else inside

        @cache
        def stored(name: str) -> NDArray[np.float64]:
            return self.arrays[name].numpy()[rows].astype(np.float64)

        def grains() -> NDArray[np.float64]:
            return (1.0 - own("porosity")) * stored("reference_volume")

        def own(name: str) -> NDArray[np.float64]:
            return of_each(self.scenario, self.material, name)[rows]

        def porosity() -> NDArray[np.float64]:
            if self.effects.porosity_update or self.effects.dilatancy:
                return np.maximum(1.0 - grains() / stored("volume"), LEAST_POROSITY)
            return own("porosity")

        quantities: dict[str, Callable[[], NDArray[np.float64]]] = {
            "position": lambda: stored("position"),
            "solid_velocity": lambda: stored("velocity")[:, : self.effects.dimensions],
            "effective_stress": lambda: stored("stress"),
            "deviatoric_strain": lambda: stored("deviatoric_strain"),
            "volume": lambda: np.maximum(stored("volume"), grains()),
            "solid_mass": lambda: self.solid_mass[inside],
            "liquid_mass": lambda: self.liquid_mass[inside],
            "porosity": porosity,
        }
        if len(self.scenario.flow.materials) > 1:
            quantities["material"] = lambda: self.material[inside].astype(np.float64)
        if self.effects.two_phase:
            quantities["liquid_velocity"] = lambda: stored("velocity")[:, self.effects.dimensions :]
        if self.effects.liquid:
            quantities["pore_pressure"] = lambda: np.maximum(
                -own("liquid_bulk_modulus_Pa") * stored("liquid_strain"), -own("cavitation_pressure_Pa")
            )
        shown = quantities if names is None else names
        kept = self.effects.point_fields
        return {name: stored(name) if name in kept else quantities[name]() for name in shown}
