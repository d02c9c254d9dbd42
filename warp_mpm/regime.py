"""What rules in a flow, by its dimensionless numbers, and which law that suggests: for `check` and `plan`."""

from __future__ import annotations

import math

from warp_mpm.scenario import STANDARD_GRAVITY, Scenario, TwoPhaseMaterial, UndrainedMaterial
from warp_mpm.simulator.laws import LAWS
from warp_mpm.simulator.laws.dilatancy import equilibrium

GRAIN_DIAMETER = 0.01
"""Of a material whose law asks for none [m]."""

COLLISIONS = 0.1
"""Savage number above which grains that collide bear a good part of the stress (Iverson 1997)."""

COLLISIONS_OVER_VISCOSITY = 200.0
"""Bagnold number above which collisions rule over the viscosity of the liquid (Iverson 1997)."""

FRICTION_OVER_VISCOSITY = 2000.0
"""Friction number above which friction rules over the viscosity of the liquid (Iverson 1997)."""

FRICTION = 0.6
"""tan φ of rock's grains."""

DENSITY = "m/m_eq"
"""Name of the solid fraction over that of equilibrium."""


def regime(scenario: Scenario) -> dict[str, float]:
    """Dimensionless numbers of a flow as it starts, by name; those that it does not have are left out.

    The rate of shearing is v / h. Where the law asks for no grain diameter d, it is 10 mm; its viscosity η_f too is the
    law's, or the liquid's. Iverson (1997, Reviews of Geophysics 35:245-296), with m the solid fraction:

    - Fr = v / √(g h);
    - Savage = ρ_s γ̇² d² / ((ρ_s - ρ_f) g h), stress by collisions over that by weight;
    - Bagnold = m ρ_s d² γ̇ / ((1 - m) η_f), stress by collisions over that by viscosity;
    - friction = m (ρ_s - ρ_f) g h tan φ / ((1 - m) γ̇ η_f), by weight over that by viscosity, tan φ = 0.6;
    - Stokes = ρ_s d² γ̇ / η_f, inertia of a grain over the liquid's drag on it;
    - drainage = (h² / c_v) / (h / v), time that pore pressure needs to leave over that in which the flow passes itself;
    - m/m_eq, solid fraction over that at which it would shear for ever, of a skeleton with a dilatancy;
    - and what the law adds, as Bingham = τ_y / (K γ̇^m).
    """
    flow, material = scenario.flow, scenario.flow.material
    law = LAWS.named(material.law)
    gravity, depth, speed = scenario.gravity.acceleration_m_per_s2, flow.depth, flow.speed
    diameter = law.grain_diameter(material) or GRAIN_DIAMETER
    rate = speed / depth
    liquid, viscosity = 0.0, 0.0
    if isinstance(material, UndrainedMaterial):
        liquid, viscosity = material.liquid_density_kg_per_m3, 1e-3
    if isinstance(material, TwoPhaseMaterial):
        viscosity = material.liquid_viscosity_Pa_s
    told = law.fluid_viscosity(material)
    viscosity = viscosity if told is None else told
    grains = material.grain_density_kg_per_m3
    ratio = (1.0 - material.porosity) / material.porosity
    weight = (grains - liquid) * gravity * depth
    found: dict[str, float] = {}
    if gravity > 0.0:
        found["Fr"] = speed / math.sqrt(gravity * depth)
    if weight > 0.0:
        found["Savage"] = grains * (rate * diameter) ** 2 / weight
    if viscosity > 0.0 and rate > 0.0:
        found["Bagnold"] = ratio * grains * diameter**2 * rate / viscosity
        found["friction"] = ratio * max(weight, 0.0) * FRICTION / (rate * viscosity)
        found["Stokes"] = grains * diameter**2 * rate / viscosity
    if isinstance(material, TwoPhaseMaterial) and speed > 0.0:
        weight_of_liquid = liquid * STANDARD_GRAVITY
        coefficient = material.hydraulic_conductivity * material.oedometric_modulus / weight_of_liquid
        found["drainage"] = depth * speed / coefficient
    if rate > 0.0:
        found |= law.dimensionless(material, rate=rate, pressure=max(0.5 * weight, 0.0))
        if material.dilatancy is not None:
            pressure = 0.5 * (1.0 - material.porosity) * max(weight, 0.0)
            found[DENSITY] = (1.0 - material.porosity) / equilibrium(material, rate=rate, pressure=pressure)
    return found


def suggestion(scenario: Scenario) -> str:
    """Which law the numbers suggest, in a clause with its reason; empty for a flow at rest."""
    numbers = regime(scenario)
    law = LAWS.named(scenario.flow.material.law)
    if scenario.flow.speed == 0.0 or "Savage" not in numbers:
        return ""
    said = law.says(numbers)
    if said:
        return said
    if numbers["Savage"] > COLLISIONS:
        return "grains collide: mu_i"
    if numbers.get("friction", math.inf) < FRICTION_OVER_VISCOSITY:
        collide = numbers["Bagnold"] > COLLISIONS_OVER_VISCOSITY
        return "the liquid's viscosity counts: " + (
            "mu_i" if collide else "coulomb_viscous, or herschel_bulkley for mud"
        )
    return "friction of the grains rules: mohr_coulomb"


def described_regime(scenario: Scenario) -> str:
    """The numbers and what they suggest, in one line; empty where there is nothing to say."""
    material = scenario.flow.material
    numbers = regime(scenario)
    if not numbers:
        return ""
    told = ", ".join(f"{name} {_short(value)}" for name, value in numbers.items())
    diameter = LAWS.named(material.law).grain_diameter(material)
    grains = "" if diameter else f", for grains of {1e3 * GRAIN_DIAMETER:g} mm"
    said = [suggestion(scenario), _density(numbers.get(DENSITY), isinstance(material, UndrainedMaterial))]
    return "; ".join([f"regime: {told}{grains}", *(one for one in said if one)])


def _density(ratio: float | None, wet: bool) -> str:
    """What m/m_eq says, in a clause."""
    if ratio is None:
        return ""
    loose = ratio < 1.0
    if not wet:
        return "loose: it shrinks as it is sheared" if loose else "dense: it swells as it is sheared"
    return "loose: sheared, its pore pressure rises" if loose else "dense: sheared, its pore pressure falls"


def _short(value: float) -> str:
    return f"{value:.2f}" if 0.1 <= value < 100.0 else f"{value:.2g}"
