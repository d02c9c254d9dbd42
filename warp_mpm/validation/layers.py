"""A layer that shears on a slope which holds it, and what layers of one phase are of."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from warp_mpm.simulation import Simulation
from warp_mpm.validation.case import Array
from warp_mpm.validation.scenes import box, scene

G = 9.81
DENSITY = 1800.0
MIXTURE: dict[str, Any] = {
    "grain_density_kg_per_m3": 2400.0,
    "porosity": 0.25,
    "young_modulus_Pa": 2e6,
    "poisson_ratio": 0.3,
}
"""A single phase of 1800 kg/m³."""

NO_SLIP = 10.0
"""Friction of a bed on which nothing slips that is deeper than a tenth of its yield stress over its weight."""


def sheared(
    slope: float, cells: int, end: float, soil: dict[str, Any], *, length: float, start: Any = None
) -> tuple[Array, Array, Simulation]:
    """Heights [N] above the ground and speeds [N] along it, in the middle of a layer 1 m deep, at its end.

    Args:
        slope: of the ground [°].
        cells: over the depth.
        end: time [s].
        soil: fields of the material.
        length: of the layer [m]; what happens at its ends must not reach the middle.
        start: speed [m/s] at t = 0 as a function of the height, with the shear stress of a steady flow; if left out, it
            starts at rest without shear.
    """
    simulation = Simulation(
        scene(
            "layer on a slope",
            box(-length, 0.0, 1.0),
            "dry",
            end_time=end,
            tilt=slope,
            ground=NO_SLIP,
            soil=MIXTURE | soil,
            spacing_m=1.0 / cells,
            domain={"left_m": -length - 1.0, "right_m": 0.75 * length, "top_m": 2.0},
        )
    )
    if start is not None:
        points = simulation.points()
        height = points["position"][:, 1]
        velocity, stress = np.zeros((len(height), 2)), points["effective_stress"].copy()
        velocity[:, 0] = start(height)
        stress[:, 3] = DENSITY * G * math.sin(math.radians(slope)) * (1.0 - height)
        simulation.set_points(solid_velocity=velocity, effective_stress=stress)
    simulation.advance(end)
    points = simulation.points()
    x, y = points["position"].T
    middle = np.abs(x - x.mean()) < 1.0
    return y[middle], points["solid_velocity"][middle, 0], simulation
