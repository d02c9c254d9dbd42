"""The variant `calibrated`: the closed form's numbers as functions of the scene, fitted to simulations.

The paper takes lambda for a constant, 0.72 fixed and 0.41 sliding, and leaves the vertical load out. A sweep of
simulations (`analytic.sweep`) says instead

    F_peak = (a (1 - cos beta) + b / Fr^2) M^c rho h v^2,     M = m2 / (m1 + m2), 1 where the barrier is fixed
    T1     = t (L/h)^p (1 - cos beta)^q h / v
    kappa  = cot(beta)

The bracket is a jet that the face turns by beta, and the weight of the flow; a smooth face passes on its normal force
alone, hence kappa. With the impulse J of the variant `momentum_closed`, lambda and tau follow: T2 = 2 J / F_peak,
lambda = 3 v T2 / (8 L), tau = T1 / T2. `docs/closed_form.md` tells how well this does on scenes that were not fitted.
Standard library only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from analytic.impact import Impact, friction_deceleration
from analytic.scene import ASSUMED_RISE_RATIO, FITTED_FORMULATION, FITTED_LAW, PAPER_GEOMETRY_CHANGE, Scene

CALIBRATED = "calibrated"
"""Name of the variant."""

BASE_VARIANT = "momentum_closed"
"""Variant of `Impact` for which the constants are fitted."""


@dataclass(frozen=True, kw_only=True)
class Coefficients:
    """The closed form's numbers for one scene."""

    geometry_change: float = PAPER_GEOMETRY_CHANGE["sliding"]
    """lambda [-]."""
    rise_ratio: float = ASSUMED_RISE_RATIO
    """tau [-]."""
    vertical_load_ratio: float = 0.0
    """kappa [-]."""
    variant: str = "stick_slip"
    """Variant of `Impact`."""

    @property
    def model(self) -> dict[str, Any]:
        """As arguments of `Scene.impact`."""
        return dict(self.__dict__)


@dataclass(frozen=True, kw_only=True)
class Constants:
    """Fitted constants, dimensionless; see the formulas above."""

    jet: float
    """a."""
    weight: float
    """b."""
    mass_exponent: float
    """c; of no effect where the barrier is fixed."""
    rise: float
    """t."""
    rise_length_exponent: float
    """p."""
    rise_angle_exponent: float
    """q."""


CONSTANTS = {
    "sliding": Constants(
        jet=1.275, weight=1.109, mass_exponent=0.324, rise=0.167, rise_length_exponent=0.732, rise_angle_exponent=-1.398
    ),
    "fixed": Constants(
        jet=1.211, weight=0.850, mass_exponent=0.000, rise=0.125, rise_length_exponent=0.865, rise_angle_exponent=-1.718
    ),
}
"""Fitted by `python -m analytic sweep fit docs/data/sweep.csv`."""

FITTED_RANGES = {
    "froude_number": ("Fr", 1.0, 5.0),
    "length_ratio": ("L/h", 3.0, 10.0),
    "height_ratio": ("H/h", 1.25, 4.0),
    "face_angle": ("beta", 50.0, 90.0),
    "mass_ratio": ("m2/m1", 0.5, 3.0),
    "base_friction": ("tan(delta_b)", 0.2, 0.5),
}
"""Ranges of the fitted scenes: symbol, least and greatest value."""

GREATEST_FRICTION_SHARE = 0.95
"""Bound of kappa tan(delta_b), beyond which the flow's own weight would hold the barrier."""


def coefficients(scene: Scene, constants: Constants | None = None) -> Coefficients:
    """The fitted numbers of a scene; `constants` other than the fitted ones serve the fit itself.

    lambda and tau are cut off at 1.

    Raises:
        ValueError: the scene's face angle is not known.
    """
    if scene.face_angle is None or not 0 < scene.face_angle <= 90:
        raise ValueError(f"face_angle is {scene.face_angle}, the calibrated variant needs a number in (0, 90] degrees.")
    at = constants or CONSTANTS["fixed" if scene.fixed else "sliding"]
    beta = math.radians(scene.face_angle)
    turned = 1 - math.cos(beta)
    mass_share = 1.0 if scene.barrier_mass is None else scene.barrier_mass / (scene.flow_mass + scene.barrier_mass)
    peak_force = (at.jet * turned + at.weight / scene.froude_number**2) * mass_share**at.mass_exponent
    peak_force *= scene.density * scene.flow_height * scene.speed**2
    length_ratio = scene.flow_length / scene.flow_height
    rise_time = at.rise * length_ratio**at.rise_length_exponent * turned**at.rise_angle_exponent
    rise_time *= scene.flow_height / scene.speed
    kappa = 0.0
    if not scene.fixed:
        kappa = 1 / math.tan(beta) if scene.face_angle < 90 else 0.0
        if scene.base_friction:
            kappa = min(kappa, GREATEST_FRICTION_SHARE / scene.base_friction)
    duration = 2 * _impulse(scene, peak_force, rise_time, kappa) / peak_force
    geometry_change = min(3 * scene.speed * duration / (8 * scene.flow_length), 1.0)
    rise_ratio = min(rise_time * 3 * scene.speed / (8 * geometry_change * scene.flow_length), 1.0)
    return Coefficients(
        geometry_change=geometry_change, rise_ratio=rise_ratio, vertical_load_ratio=kappa, variant=BASE_VARIANT
    )


def _impulse(scene: Scene, peak_force: float, rise_time: float, kappa: float) -> float:
    """Impulse [N s/m] of `momentum_closed` for a given peak force and rise time, instead of a given duration.

    With T2 = 2 J / F its equation reads J (1/m1 + (1 - 2 R/F + tau R^2/F^2) / m) = v, where m is the driven mass and R
    the threshold force; and tau = T1 / T2 makes it linear in J again. tau is at most 1.
    """
    stopping = scene.flow_mass * scene.speed
    if scene.barrier_mass is None:
        return stopping
    friction = scene.base_friction or 0.0
    driven_mass = scene.barrier_mass / (1 - kappa * friction)
    threshold = driven_mass * friction_deceleration(scene.gravity, friction, scene.slope)
    r = threshold / peak_force
    if r >= 1:
        return stopping  # the barrier does not move
    rising_to_the_end = scene.speed / (1 / scene.flow_mass + (1 - r) ** 2 / driven_mass)
    if rising_to_the_end <= peak_force * rise_time / 2:
        return min(rising_to_the_end, stopping)
    inverse_mass = 1 / scene.flow_mass + (1 - 2 * r) / driven_mass
    momentum = scene.speed - r**2 * peak_force * rise_time / (2 * driven_mass)
    # Where the barrier would stop before T2, the flow comes to rest and no common velocity is left.
    return momentum / inverse_mass if 0 < momentum < inverse_mass * stopping else stopping


def calibrated_impact(scene: Scene, **model: Any) -> Impact:
    """The impact with the fitted numbers; `model` holds what else `Scene.impact` takes."""
    return scene.impact(**{**coefficients(scene).model, **model})


def beyond_fit(scene: Scene) -> list[str]:
    """One sentence for each figure of the scene that lies outside the range of the fitted ones."""
    values = {
        "froude_number": scene.froude_number,
        "length_ratio": scene.flow_length / scene.flow_height,
        "height_ratio": None if scene.barrier_height is None else scene.barrier_height / scene.flow_height,
        "face_angle": scene.face_angle,
        "mass_ratio": None if scene.barrier_mass is None else scene.barrier_mass / scene.flow_mass,
        "base_friction": None if scene.fixed else scene.base_friction,
    }
    found = []
    for name, value in values.items():
        symbol, low, high = FITTED_RANGES[name]
        if value is not None and not low * (1 - 1e-9) <= value <= high * (1 + 1e-9):
            found.append(f"{symbol} = {value:.3g} is outside the fitted range {low:g} to {high:g}.")
    if scene.formulation not in (None, FITTED_FORMULATION):
        found.append(f"The formulation {scene.formulation} is outside the fit, whose flows are {FITTED_FORMULATION}.")
    if scene.law not in (None, FITTED_LAW):
        found.append(f"The law {scene.law} is outside the fit, whose flows are {FITTED_LAW}.")
    if scene.slope != 0:
        found.append(f"The slope of {scene.slope:g} degrees is outside the fit, whose ground is level.")
    return found
