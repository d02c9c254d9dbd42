"""Coulomb's friction with a viscosity of the mixture beside it."""

# ruff: noqa: N815 - a unit at the end of a field's name keeps its own spelling (Pa)

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from .dilatancy import angle_at_rest, make_dilatancy, range_of_angles
from .law import Array, Law
from .mohr_coulomb import Settings as OfMohrCoulomb
from .radial import TINY, lateral_range, make_radial, mean_and_shear, slow_stress


class Settings(OfMohrCoulomb):
    mixture_viscosity_Pa_s: Annotated[float, Field(ge=0.0, le=1e9)]
    """Viscosity η of the mixture, beside the friction of its grains."""


class CoulombViscous(Law):
    """τ = c' cos φ' + p' sin φ' + η γ̇, with τ = √(s : s / 2), p' the mean effective pressure and γ̇ = √(2 e : e).

    A cone of Drucker and Prager, which in plane flow at constant volume is Mohr and Coulomb's. The viscous stress is
    the mixture's: it stays where the pore pressure has taken the load off the grains. The way back is implicit, so that
    no viscosity bounds the time step.
    """

    name = "coulomb_viscous"
    title = "Coulomb friction (a cone that is Mohr–Coulomb in plane flow) and a viscosity of the mixture"
    Settings = Settings
    opens = True
    dilates = True
    constants = ("cone_strength", "cone_slope", "dilation", "mixture_viscosity", "tension_limit")

    def numbers(self, material: Any) -> dict[str, float]:
        strength, slope = _cone(material)
        return {
            "cone_strength": strength,
            "cone_slope": slope,
            "dilation": math.sin(math.radians(material.dilatancy_angle_deg)),
            "mixture_viscosity": material.mixture_viscosity_Pa_s,
            "tension_limit": _largest_tension(material),
        }

    def bears_tension(self, material: Any) -> bool:
        return material.tension_cutoff_Pa > 0.0 and material.cohesion_Pa > 0.0

    def friction(self, material: Any) -> float:
        return math.tan(math.radians(material.friction_angle_deg))

    def lateral_stress_ratio(self, material: Any) -> float:
        """Jaky's 1 - sin φ', or what the cone allows."""
        slope = math.sin(angle_at_rest(material, math.radians(material.friction_angle_deg)))
        return max(1.0 - slope, lateral_range(1.0, 0.0, slope)[0])

    def lateral_stress_range(self, material: Any, vertical: float) -> tuple[float, float]:
        strength, _ = _cone(material)
        slope = math.sin(angle_at_rest(material, math.radians(material.friction_angle_deg)))
        return lateral_range(vertical, strength, slope)

    def caveats(self, material: Any) -> list[str]:
        return slow_stress(material.mixture_viscosity_Pa_s, material, "mixture_viscosity_Pa_s")

    def dimensionless(self, material: Any, *, rate: float, pressure: float) -> dict[str, float]:
        """Viscous stress over friction."""
        strength, slope = _cone(material)
        friction = strength + slope * pressure
        return {"viscosity/friction": material.mixture_viscosity_Pa_s * rate / friction if friction > 0.0 else math.inf}

    def says(self, numbers: Mapping[str, float]) -> str:
        ratio = numbers.get("viscosity/friction", 1.0)
        if ratio < 0.01:
            return "friction rules, the viscosity changes next to nothing: mohr_coulomb would do"
        return "viscosity rules: herschel_bulkley would do" if ratio > 100.0 else "both count: coulomb_viscous"

    def strength(self, material: Any) -> float:
        return material.cohesion_Pa if material.mixture_viscosity_Pa_s == 0.0 else math.inf

    def yield_excess(self, material: Any, stress: Array) -> Array:
        mean, shear = mean_and_shear(stress)
        beyond = mean - _largest_tension(material)
        if material.mixture_viscosity_Pa_s > 0.0:
            return beyond
        strength, _ = _cone(material)
        least, most = range_of_angles(material, math.radians(material.friction_angle_deg))
        slope = np.where(mean > 0.0, math.sin(least), math.sin(most))  # under tension, friction takes away
        return beyond.clip(min=shear - strength + slope * mean)

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        import warp as wp

        F, V4, Points, Parameters = types.scalar, types.V4, types.Points, types.Parameters
        larger, smaller = tools.larger, tools.smaller
        radial = make_radial(types)
        parted, joined = radial.parted, radial.joined
        DILATANCY = types.effects.dilatancy
        swollen = make_dilatancy(types, tools).dilated if DILATANCY else None

        @wp.func
        def back(
            points: Points, p: wp.int32, stress: V4, gradient: V4, volume: F, time_step: F, parameters: Parameters
        ):
            mean, shear = parted(stress)
            # Sheared at the rate γ̇ the pressure grows by K sin ψ γ̇ Δt, and with it the friction; then the cut-off.
            pushed = parameters.bulk_modulus * parameters.dilation * time_step
            stiffness = parameters.mixture_viscosity + parameters.shear_modulus * time_step
            slope = parameters.cone_slope
            limit = parameters.tension_limit
            if DILATANCY:
                strength, sine = parameters.cone_strength, parameters.friction_sine
                pressure, slope = swollen(
                    points, p, -mean, shear, strength, sine, stiffness, gradient, volume, time_step, parameters
                )
                dilated = -pressure
                limit = smaller(limit, strength / larger(slope, F(1.0e-6)))
            else:
                excess = larger(shear - parameters.cone_strength + slope * mean, F(0.0))
                dilated = mean - pushed * excess / (stiffness + slope * pushed)
            borne = smaller(dilated, limit)
            static = parameters.cone_strength - slope * borne
            rate = larger(shear - static, F(0.0)) / stiffness
            share = (smaller(shear, static) + parameters.mixture_viscosity * rate) / larger(shear, F(wp.static(TINY)))
            return joined(stress, mean, borne, share), (dilated - borne) / parameters.bulk_modulus

        return {"back": back}


def _cone(material: Any) -> tuple[float, float]:
    """Shear stress [Pa] without pressure, and its slope over the pressure [-]."""
    angle = math.radians(material.friction_angle_deg)
    return material.cohesion_Pa * math.cos(angle), math.sin(angle)


def _largest_tension(material: Any) -> float:
    """Of the mean stress [Pa]: the cut-off, at most the cone's apex."""
    strength, slope = _cone(material)
    return min(material.tension_cutoff_Pa, strength / slope if slope > 0.0 else math.inf)
