"""Grains on a slope: Bagnold's profile, and slopes on which they stop or gain speed without end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from warp_mpm.validation.case import (
    Array,
    Case,
    Check,
    Curve,
    Outcome,
    Panel,
    at_most,
    compared,
    holds,
    reference,
    reported,
)
from warp_mpm.validation.layers import DENSITY, MIXTURE, G, sheared

GRAINS: dict[str, Any] = {
    "law": "mu_i",
    "static_friction": math.tan(math.radians(20.9)),
    "dynamic_friction": math.tan(math.radians(32.76)),
    "inertial_constant": 0.279,
    "grain_diameter_m": 0.5,
    "young_modulus_Pa": 1e7,
}
"""Friction of glass beads. The law knows no size of its grains beside I; that large, a second brings the flow to its
speed. So stiff that the normal stresses differ by less than 0.2 %, as those of elastic shear do."""


def bagnold_profile(y: Array, slope: float) -> Array:
    """Speed [m/s] of a layer 1 m deep at the heights y: (2/3) (I_α / d) √(g h³ cos α ρ_m/ρ_g) (1 − (1 − y/h)^{3/2})."""
    tangent, cosine = math.tan(math.radians(slope)), math.cos(math.radians(slope))
    number = GRAINS["inertial_constant"] * (tangent - GRAINS["static_friction"])
    number /= GRAINS["dynamic_friction"] - tangent
    share = DENSITY / MIXTURE["grain_density_kg_per_m3"]
    surface = 2.0 / 3.0 * number / GRAINS["grain_diameter_m"] * math.sqrt(G * cosine * share)
    return surface * (1.0 - np.clip(1.0 - y, 0.0, None) ** 1.5)


SENSITIVE = (
    "so near to μ_s the speed tells of the friction: a percent of μ changes it by 12 % at 23° and by 8 % at 25° and "
    "27°, so that the three speeds are those of a stress that is 0.6, 0.1 and 0.4 % off"
)


def bagnold(quick: bool) -> Outcome:
    ladder = (4, 8) if quick else (5, 10, 20)
    checks: list[Check] = []
    panels: list[Panel] = []
    fine = np.linspace(0.0, 1.0, 201)
    for slope in (25.0,) if quick else (23.0, 25.0, 27.0):
        exact = bagnold_profile(fine, slope)
        errors, curves = [], [reference(exact, fine)]
        for cells in ladder:
            y, speed, _ = sheared(
                slope, cells, 2.5, GRAINS, length=36.0, start=lambda y, a=slope: 0.75 * bagnold_profile(y, a)
            )
            errors.append(float(np.abs(speed - bagnold_profile(y, slope)).max() / exact[-1]))
            order = np.argsort(y)
            curves.append(Curve(speed[order], y[order], f"{cells} cells deep", "."))
        top = y > 1.0 - 1.5 / cells
        checks += [
            compared(
                f"{slope:g}°: speed of the surface",
                "m/s",
                float(speed[top].mean()),
                float(exact[-1]),
                0.05,
                remark=SENSITIVE,
            ),
            at_most(
                f"{slope:g}°: profile, largest error",
                "of the surface's speed",
                errors[-1],
                0.05,
                percent=True,
                remark=SENSITIVE,
            ),
            reported(f"{slope:g}°: that error over the one of {ladder[0]} cells", "-", errors[-1] / errors[0]),
        ]
        panels.append(Panel(f"{slope:g}°", "speed [m/s]", "height [m]", curves))
    softer = GRAINS | {"young_modulus_Pa": 2e6}
    low = math.degrees(math.atan(GRAINS["static_friction"])) - 3.0
    _, speed, _ = sheared(low, ladder[0], 4.0, softer, length=24.0, start=lambda y: 1.0 + 0.0 * y)
    checks.append(
        at_most(f"{low:.3g}°, below μ_s: greatest speed 4 s after 1 m/s", "m/s", float(np.abs(speed).max()), 1e-2)
    )
    steep = math.degrees(math.atan(GRAINS["dynamic_friction"])) + 5.0
    angle = math.radians(steep)
    lasting = G * (math.sin(angle) - GRAINS["dynamic_friction"] * math.cos(angle))
    gained = []
    for end in (2.0, 3.0):
        _, speed, _ = sheared(steep, ladder[0], end, softer, length=40.0)
        gained.append(float(speed.mean()))
    checks.append(
        holds(
            f"{steep:.3g}°, above μ_2: gains at least g (sin α − μ_2 cos α) from 2 to 3 s",
            "m/s²",
            gained[1] - gained[0],
            gained[1] - gained[0] > 0.97 * lasting,
            reference=f"> {lasting:.3g}",
        )
    )
    return Outcome(checks=checks, panels=panels)


CASES = (
    Case(
        name="bagnold",
        title="Grains on a slope",
        tests="A dry layer of 1 m of μ(I) grains on slopes of 23°, 25° and 27° from three quarters of its speed; on "
        "one below μ_s it stops, on one above μ_2 it goes on gaining speed.",
        source="u = (2/3) (I_α/d) √(g h³ cos α ρ_m/ρ_grain) (1 − (1 − y/h)^{3/2}), "
        "I_α = I_0 (tan α − μ_s)/(μ_2 − tan α)",
        limit="surface 5 %, profile 5 % of its speed; stops within 4 s to 1 cm/s",
        run=bagnold,
    ),
)
