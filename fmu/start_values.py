"""Start values of the closed-form unit for a scenario of the simulator, without a simulation.

`paper`
    The paper's lambda, 0.72 for a fixed and 0.41 for a sliding barrier; tau, which it does not print, as assumed in
    `analytic.scene`; the variant `stick_slip`.
`calibrated`
    lambda, tau and the vertical load ratio of the scene from the fit to simulations in `analytic.fitted`; the variant
    `momentum_closed`, for which they were fitted.
"""

from __future__ import annotations

from typing import Any

from analytic.fitted import CALIBRATED, beyond_fit, coefficients
from analytic.scene import ASSUMED_RISE_RATIO, Scene

from .units.barrier_sliding import INTERFACE, VARIANT

PAPER = "paper"

WAYS = (PAPER, CALIBRATED)
"""Names of the ways to choose lambda and tau."""


def scene_parameters(scene: Scene) -> dict[str, Any]:
    """The unit's parameters for a scene, all but the force."""
    parameters: dict[str, Any] = {
        "flow_mass": scene.flow_mass,
        "flow_length": scene.flow_length,
        "flow_height": scene.flow_height,
        "speed": scene.speed,
        "gravity": scene.gravity,
        "slope": scene.slope,
    }
    if scene.barrier_mass is None:
        return parameters | {"barrier_fixed": True}
    return parameters | {"barrier_mass": scene.barrier_mass, "base_friction": scene.base_friction}


def force_parameters(scene: Scene, way: str) -> dict[str, Any]:
    """The unit's parameters that rule the force, and the variant of the model.

    Raises:
        ValueError: the fit needs to know the face's angle, and does not.
    """
    if way == PAPER:
        return {"geometry_change": scene.paper_geometry_change, "rise_ratio": ASSUMED_RISE_RATIO}
    chosen = coefficients(scene)
    return {
        "geometry_change": chosen.geometry_change,
        "rise_ratio": chosen.rise_ratio,
        "vertical_load_ratio": chosen.vertical_load_ratio,
        "variant": VARIANT.number_of(chosen.variant),
    }


def start_values(scene: Scene, way: str) -> dict[str, Any]:
    """All start values that the scene says something about, in the order of the unit's table.

    The arrival is that of a front which goes on at the flow's speed.
    """
    values = scene_parameters(scene) | {"arrival_time": scene.sets_out + max(scene.distance, 0.0) / scene.speed}
    values |= force_parameters(scene, way)
    return {variable.name: values[variable.name] for variable in INTERFACE.variables if variable.name in values}


def notes(scene: Scene, way: str) -> tuple[str, ...]:
    """What these values do not see, in sentences."""
    beyond = [f"Calibrated: {sentence}" for sentence in beyond_fit(scene)] if way == CALIBRATED else []
    return (*scene.notes, *beyond)
