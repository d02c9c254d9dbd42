"""Herschel and Bulkley's fluid, of which Bingham's is one: a yield stress, and a stress that grows with the rate."""

# ruff: noqa: N815 - a unit at the end of a field's name keeps its own spelling (Pa)

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Annotated, Any

from pydantic import Field

from warp_mpm.schema import Model, NonNegative

from .law import Array, Law
from .radial import TINY, lateral_range, make_radial, mean_and_shear, slow_stress

SWEEPS = 2
"""Halley's steps in the logarithm of the rate: of the viscous stress 1e-12 is left for exponents from 0.5 to 2, 4e-8 at
0.2."""


class Settings(Model):
    yield_stress_Pa: NonNegative
    """Shear stress τ_y below which it does not flow."""
    consistency_Pa_s: Annotated[float, Field(ge=0.0, le=1e9)]
    """Consistency K of τ = τ_y + K γ̇^m, in Pa s^m; with m = 1 the viscosity of a Bingham fluid."""
    flow_exponent: Annotated[float, Field(ge=0.2, le=2.0)] = 1.0
    """Exponent m; 1 is Bingham's fluid, less thins as it is sheared."""
    tension_cutoff_Pa: NonNegative = 0.0
    """Largest tensile mean stress, beyond which it opens."""


class HerschelBulkley(Law):
    """Mud: elastic up to a yield stress, beyond it τ = τ_y + K γ̇^m; τ = √(s : s / 2), γ̇ = √(2 e : e).

    The way back is implicit: the rate of the flow is that at which the stress which it needs is the one that is left at
    the end of the step, τ_y + K γ̇^m = τ_trial - G γ̇ Δt. So no viscosity bounds the time step, and what does not yield
    is elastic and does not creep.
    """

    name = "herschel_bulkley"
    title = "Herschel–Bulkley: yield stress, consistency and exponent (Bingham with exponent 1)"
    Settings = Settings
    opens = True
    constants = ("yield_stress", "log_consistency", "flow_exponent", "tension_limit")

    def numbers(self, material: Any) -> dict[str, float]:
        consistency = material.consistency_Pa_s
        return {
            "yield_stress": material.yield_stress_Pa,
            "log_consistency": math.log(consistency) if consistency > 1e-30 else -600.0,
            "flow_exponent": material.flow_exponent,
            "tension_limit": material.tension_cutoff_Pa,
        }

    def bears_tension(self, material: Any) -> bool:
        return material.tension_cutoff_Pa > 0.0

    def lateral_stress_ratio(self, material: Any) -> float:
        """1: a fluid at rest."""
        return 1.0

    def lateral_stress_range(self, material: Any, vertical: float) -> tuple[float, float]:
        return lateral_range(vertical, material.yield_stress_Pa, 0.0)

    def caveats(self, material: Any) -> list[str]:
        return slow_stress(material.consistency_Pa_s, material, "consistency_Pa_s")

    def dimensionless(self, material: Any, *, rate: float, pressure: float) -> dict[str, float]:
        """The Bingham number: yield stress over viscous stress."""
        viscous = material.consistency_Pa_s * rate**material.flow_exponent
        if viscous == 0.0:
            return {}
        return {"Bingham": material.yield_stress_Pa / viscous}

    def says(self, numbers: Mapping[str, float]) -> str:
        number = numbers.get("Bingham", 1.0)
        if number > 10.0:
            return "the yield stress rules, most of the flow is a plug: herschel_bulkley"
        return (
            "yield stress and viscosity both count: herschel_bulkley"
            if number > 0.1
            else "viscosity rules: herschel_bulkley"
        )

    def strength(self, material: Any) -> float:
        return material.yield_stress_Pa if material.consistency_Pa_s == 0.0 else math.inf

    def yield_excess(self, material: Any, stress: Array) -> Array:
        mean, shear = mean_and_shear(stress)
        beyond = mean - material.tension_cutoff_Pa
        if material.consistency_Pa_s > 0.0:
            return beyond
        return beyond.clip(min=shear - material.yield_stress_Pa)

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        import warp as wp

        F, V4, Points, Parameters = types.scalar, types.V4, types.Points, types.Parameters
        larger, smaller = tools.larger, tools.smaller
        logarithm, exponential = tools.logarithm, tools.exponential
        radial = make_radial(types)
        parted, joined = radial.parted, radial.joined
        zero, half, one = wp.constant(wp.float64(0.0)), wp.constant(wp.float64(0.5)), wp.constant(wp.float64(1.0))

        @wp.func
        def flow_stress(excess: wp.float64, stiffness: wp.float64, parameters: Parameters) -> wp.float64:
            """K γ̇^m of the γ̇ for which K γ̇^m + stiffness γ̇ = excess [Pa].

            With y = γ̇ stiffness / excess and Λ = K (excess / stiffness)^m / excess it is Λ y^m + y = 1. The logarithm
            of the left side is convex in z = ln y, of a slope between m and 1 and a curvature of at most (1 - m)² / 4.
            """
            m = wp.float64(parameters.flow_exponent)
            load = logarithm(excess)
            size = wp.float64(parameters.log_consistency) - load + m * (load - logarithm(stiffness))
            z = smaller(-size / m, zero)
            viscous = exponential(size + m * z)
            for _sweep in range(wp.static(SWEEPS)):
                both = viscous + exponential(z)
                share = viscous / both
                slope = one - (one - m) * share
                bend = half * (one - m) * (one - m) * share * (one - share)
                gap = logarithm(both)
                z -= gap * slope / (slope * slope - gap * bend)
                viscous = exponential(size + m * z)
            return excess * viscous

        @wp.func
        def back(
            points: Points, p: wp.int32, stress: V4, gradient: V4, volume: F, time_step: F, parameters: Parameters
        ):
            mean, shear = parted(stress)
            borne = smaller(mean, parameters.tension_limit)
            excess = shear - parameters.yield_stress
            flowing = F(
                flow_stress(
                    wp.float64(larger(excess, F(wp.static(TINY)))),
                    wp.float64(parameters.shear_modulus) * wp.float64(time_step),
                    parameters,
                )
            )
            allowed = wp.where(excess > F(0.0), parameters.yield_stress + flowing, shear)
            share = allowed / larger(shear, F(wp.static(TINY)))
            return joined(stress, mean, borne, share), (mean - borne) / parameters.bulk_modulus

        return {"back": back}
