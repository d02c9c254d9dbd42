"""The lightest barrier that a flow moves no farther than a limit.

The closed form sees of a barrier its mass, the friction at its base and, where the vertical load counts, the angle of
its face. Height and crest are what the designer needs for other reasons (overtopping, construction); here they bound
the shape. Stability against overturning and inside the barrier is not looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.arrays import outcomes
from analytic.fitted import Coefficients
from analytic.scene import Scene

Array = NDArray[np.float64]

MASS_RATIOS = (1e-3, 1e4)
"""Mass ratios m2 / m1 between which a barrier is looked for."""


Rule = Callable[[Scene], Coefficients]
"""Gives the coefficients of a scene; constant ones or `analytic.fitted.coefficients`."""


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """What the barrier's shape has to keep."""

    height: float
    """H [m] > 0."""
    crest_width: float = 1.0
    """Least crest width b [m] >= 0."""
    face_angle: tuple[float, float] = (60.0, 80.0)
    """Least and greatest face angle beta [degrees], in (0, 90]."""
    density: float = 2000.0
    """Density of the barrier [kg/m^3] > 0."""

    def __post_init__(self) -> None:
        low, high = self.face_angle
        for name, value, inside, allowed in (
            ("height", self.height, self.height > 0, "(0, inf)"),
            ("crest_width", self.crest_width, self.crest_width >= 0, "[0, inf)"),
            ("density of the barrier", self.density, self.density > 0, "(0, inf)"),
            ("face_angle", low, 0 < low <= 90, "(0, 90]"),
            ("face_angle", high, low <= high <= 90, f"[{low:g}, 90]"),
        ):
            if not (inside and math.isfinite(value)):
                raise ValueError(f"{name} is {value:g}, it must be a number in {allowed}.")


@dataclass(frozen=True)
class Design:
    """A trapezoid and what the flow does to it."""

    base_width: float
    """B [m]."""
    crest_width: float
    """b [m]."""
    height: float
    """H [m]."""
    face_angle: float
    """beta [degrees]."""
    mass: float
    """m2 [kg/m]."""
    displacement: float
    """Final displacement [m]."""
    governed_by: str
    """`displacement`: a lighter barrier would slide too far; `shape`: it would be too narrow at the crest."""
    coefficients: Coefficients


class DesignError(ValueError):
    """No barrier keeps the limit; one sentence that says why."""


def displacement(scene: Scene, barrier_mass: ArrayLike, coefficients: Coefficients) -> Array:
    """Final displacement [m] of barriers of the masses `barrier_mass` [kg/m] in the flow of `scene`."""
    if scene.base_friction is None:
        raise DesignError("base_friction is missing, a barrier that may slide needs a number in [0, inf).")
    return outcomes(
        flow_mass=scene.flow_mass,
        barrier_mass=barrier_mass,
        flow_length=scene.flow_length,
        speed=scene.speed,
        base_friction=scene.base_friction,
        geometry_change=coefficients.geometry_change,
        rise_ratio=coefficients.rise_ratio,
        vertical_load_ratio=coefficients.vertical_load_ratio,
        variant=coefficients.variant,
        gravity=scene.gravity,
        slope=scene.slope,
    ).barrier_displacement_final


def lightest_barrier(scene: Scene, limit: float, bounds: Bounds, rule: Rule = lambda scene: Coefficients()) -> Design:
    """The lightest trapezoid within `bounds` that the flow of `scene` moves at most `limit` [m].

    Of equally light ones, the one with the flattest face. The scene's own barrier mass is not used.

    Raises:
        DesignError: the limit is no number of at least 0, or no barrier keeps it.
    """
    if not (math.isfinite(limit) and limit >= 0):
        raise DesignError(f"limit is {limit:g}, it must be a number in [0, inf).")
    best: Design | None = None
    for angle in np.linspace(*bounds.face_angle, 71 if bounds.face_angle[0] < bounds.face_angle[1] else 1):
        lighter_than = math.inf if best is None else best.mass * (1 - 1e-9)
        found = _lightest_at(float(angle), scene, limit, bounds, rule, lighter_than)
        if found is not None and found.mass < lighter_than:
            best = found
    if best is None:
        raise DesignError(f"No barrier up to {MASS_RATIOS[1]:g} times the flow's mass keeps {limit:g} m.")
    return best


def _lightest_at(
    angle: float, scene: Scene, limit: float, bounds: Bounds, rule: Rule, lighter_than: float
) -> Design | None:
    """The lightest one of a face angle [degrees]; none where it is not lighter than `lighter_than` [kg/m]."""
    narrowest = bounds.density * bounds.height * (bounds.crest_width + _run(angle, bounds))

    def moved(mass: float) -> tuple[float, Coefficients]:
        trial = replace(scene, barrier_mass=mass, face_angle=angle, barrier_height=bounds.height)
        coefficients = rule(trial)
        return float(displacement(trial, mass, coefficients)), coefficients

    low, high = MASS_RATIOS[0] * scene.flow_mass, MASS_RATIOS[1] * scene.flow_mass
    # Most angles are done with here: 1 trial in place of 40.
    if narrowest >= lighter_than or moved(min(high, lighter_than))[0] > limit:
        return None
    while high > low * (1 + 1e-10):  # bisection: the displacement falls as the mass grows, down to nil
        middle = math.sqrt(low * high)
        low, high = (low, middle) if moved(middle)[0] <= limit else (middle, high)
    mass = max(high, narrowest)
    distance, coefficients = moved(mass)
    governed_by = "displacement" if high >= narrowest else "shape"
    return Design(*_shape(mass, angle, bounds), mass, distance, governed_by, coefficients)


def _shape(mass: float, angle: float, bounds: Bounds) -> tuple[float, float, float, float]:
    """B, b, H [m] and beta [degrees] of a trapezoid."""
    mean_width, run = mass / (bounds.density * bounds.height), _run(angle, bounds)
    return mean_width + run, mean_width - run, bounds.height, angle


def _run(angle: float, bounds: Bounds) -> float:
    """Horizontal length of the face [m]."""
    return 0.0 if angle == 90 else bounds.height / math.tan(math.radians(angle))


def trapezoid(mass: float, bounds: Bounds) -> tuple[float, float, float, float]:
    """B, b, H [m] and beta [degrees] of a barrier of the mass `mass` [kg/m], with the flattest face that is possible.

    Where no shape within `bounds` is so light, the lightest one, which is heavier.
    """
    low, high = bounds.face_angle
    spare = mass / (bounds.density * bounds.height) - bounds.crest_width  # room for the face's horizontal length
    steepest_needed = math.degrees(math.atan2(bounds.height, spare)) if spare > 0 else 90.0
    angle = min(max(low, steepest_needed), high)
    narrowest = bounds.density * bounds.height * (bounds.crest_width + _run(angle, bounds))
    return _shape(max(mass, narrowest), angle, bounds)


def chart(scene: Scene, mass_ratio: Array, speed: Array, rule: Rule = lambda scene: Coefficients()) -> Array:
    """Final displacement [m] over mass ratio m2 / m1 [columns] and speed [m/s, rows], all else as in `scene`."""
    found = np.empty((len(speed), len(mass_ratio)))
    for i, v in enumerate(speed):
        for j, ratio in enumerate(mass_ratio):
            trial = replace(scene, speed=float(v), barrier_mass=float(ratio) * scene.flow_mass)
            found[i, j] = displacement(trial, trial.barrier_mass or math.inf, rule(trial))
    return found
