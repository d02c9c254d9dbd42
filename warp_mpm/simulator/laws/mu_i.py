"""Friction that grows with the rate of shearing: the inertial number of dry grains, the viscous one of wet ones."""

# ruff: noqa: N815 - a unit at the end of a field's name keeps its own spelling (Pa)

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from warp_mpm.schema import Model, NonNegative

from .dilatancy import STEEPEST, make_dilatancy
from .law import Array, Law
from .radial import TINY, lateral_range, make_radial, mean_and_shear

SWEEPS = 3
"""Newton's steps of the wet law: what is left is 1e-9 of the stress, 3e-6 in the worst corner of twenty decades."""

VISCOUS_SHARE = 0.635
"""α of J + α I² (Trulsson, Andreotti and Claudin 2012), which tells how viscous and inertial number add up."""

WATER_VISCOSITY = 1e-3
"""Of the liquid of an undrained flow [Pa s], which has no other viscosity."""


class Settings(Model):
    static_friction: Annotated[float, Field(ge=0.0, le=2.0)]
    """μ_s = τ / p' below which it does not flow: the tangent of the angle at which a layer stops."""
    dynamic_friction: Annotated[float, Field(ge=0.0, le=2.0)]
    """μ_2, to which the friction grows as it is sheared ever faster."""
    inertial_constant: Annotated[float, Field(ge=0.0, le=100.0)] = 0.279
    """I_0 of μ(I) = μ_s + (μ_2 - μ_s) / (1 + I_0 / I), I = γ̇ d √(ρ_grain / p')."""
    grain_diameter_m: Annotated[float, Field(ge=1e-7, le=10.0)]
    """Diameter d of the grains."""
    fluid_viscosity_Pa_s: NonNegative | None = None
    """Viscosity η_f of what is between the grains, for the viscous number J = η_f γ̇ / p'; null: the liquid's, 1e-3
    where the flow is undrained, none where it is dry."""

    @model_validator(mode="after")
    def _grows(self) -> Self:
        if self.dynamic_friction < self.static_friction:
            raise ValueError(
                f"dynamic_friction = {self.dynamic_friction:g} must be at least "
                f"static_friction = {self.static_friction:g}"
            )
        return self


class MuI(Law):
    """τ ≤ μ p', μ = μ_s + (μ_2 - μ_s) / (1 + I_0 / I), with τ = √(s : s / 2), p' the mean effective pressure and
    γ̇ = √(2 e : e) (Jop, Forterre and Pouliquen 2006); elastic below μ_s p'.

    In a liquid I² becomes I² + J / α (Trulsson et al. 2012): inertia rules at a Stokes number
    ρ_grain d² γ̇ / η_f = I² / J far above 1 / α, the liquid far below. The way back is implicit. With a dilatancy the
    friction is μ + tan ψ (Pailha and Pouliquen 2009).
    """

    name = "mu_i"
    title = "friction μ(I) that grows with the inertial number, in a liquid with the viscous one too"
    Settings = Settings
    opens = True
    dilates = True
    constants = ("static_friction", "friction_growth", "inertial_rate", "viscous_rate")

    def numbers(self, material: Any) -> dict[str, float]:
        density, diameter = material.grain_density_kg_per_m3, material.grain_diameter_m
        return {
            "static_friction": material.static_friction,
            "friction_growth": material.dynamic_friction - material.static_friction,
            # γ̇ = I √p' / (d √ρ) at I = I_0, per √p'.
            "inertial_rate": material.inertial_constant / (diameter * math.sqrt(density)),
            # J / (α I²) = viscous_rate / γ̇.
            "viscous_rate": self.fluid_viscosity(material) / (VISCOUS_SHARE * density * diameter**2),
        }

    def bears_tension(self, material: Any) -> bool:
        return False

    def friction(self, material: Any) -> float:
        return material.static_friction

    def lateral_stress_ratio(self, material: Any) -> float:
        """Jaky's 1 - sin φ' with tan φ' = μ_s, or what the law allows."""
        jaky = 1.0 - math.sin(math.atan(_at_rest(material)))
        return max(jaky, lateral_range(1.0, 0.0, _at_rest(material))[0])

    def lateral_stress_range(self, material: Any, vertical: float) -> tuple[float, float]:
        return lateral_range(vertical, 0.0, _at_rest(material))

    def grain_diameter(self, material: Any) -> float | None:
        return material.grain_diameter_m

    def fluid_viscosity(self, material: Any) -> float:
        if material.fluid_viscosity_Pa_s is not None:
            return material.fluid_viscosity_Pa_s
        if not hasattr(material, "liquid_density_kg_per_m3"):
            return 0.0
        return getattr(material, "liquid_viscosity_Pa_s", WATER_VISCOSITY)

    def dimensionless(self, material: Any, *, rate: float, pressure: float) -> dict[str, float]:
        """Inertial number, the viscous one where there is a fluid, and the friction at them."""
        if pressure <= 0.0:
            return {}
        inertial = rate * material.grain_diameter_m * math.sqrt(material.grain_density_kg_per_m3 / pressure)
        viscous = self.fluid_viscosity(material) * rate / pressure
        both = math.sqrt(inertial**2 + viscous / VISCOUS_SHARE)
        share = both / (both + material.inertial_constant)
        friction = material.static_friction + share * (material.dynamic_friction - material.static_friction)
        return {"I": inertial} | ({"J": viscous} if viscous > 0.0 else {}) | {"μ": friction}

    def says(self, numbers: Mapping[str, float]) -> str:
        inertial, viscous = numbers.get("I", 0.0), numbers.get("J", 0.0)
        if not viscous:
            return "dry, inertial: mu_i by I"
        stokes = inertial**2 / viscous * VISCOUS_SHARE  # over 1 / α, where both are alike
        if stokes > 10.0:
            return "inertia of the grains rules: mu_i by I"
        return "the fluid rules: mu_i by J" if stokes < 0.1 else "inertia and fluid both count: mu_i by I and J"

    def strength(self, material: Any) -> float:
        return 0.0

    def yield_excess(self, material: Any, stress: Array) -> Array:
        mean, shear = mean_and_shear(stress)
        most = material.dynamic_friction
        if material.dilatancy is not None:
            most += min(material.dilatancy.coefficient, STEEPEST)
        return mean.clip(min=shear + most * mean)

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        import warp as wp

        F, V4, Points, Parameters = types.scalar, types.V4, types.Points, types.Parameters
        larger, smaller = tools.larger, tools.smaller
        radial = make_radial(types)
        parted, joined = radial.parted, radial.joined
        tiny = wp.constant(F(TINY))
        WET, DILATANCY = types.effects.liquid, types.effects.dilatancy
        of_density = make_dilatancy(types, tools, added=True) if DILATANCY else SimpleNamespace()
        swollen, tangent_at = getattr(of_density, "dilated", None), getattr(of_density, "tangent_at", None)

        @wp.func
        def root(excess: F, stiffness: F, growth: F, half: F) -> F:
            """The N >= 0 of stiffness N + growth N / (N + half) = excess, of which the last is at least 0."""
            b = stiffness * half + growth - excess
            c = excess * half
            width = wp.sqrt(b * b + F(4.0) * stiffness * c)
            # Either form loses its digits where the other keeps them.
            over = wp.where(b > F(0.0), F(2.0) * c, width - b)
            return over / larger(wp.where(b > F(0.0), b + width, F(2.0) * stiffness), tiny)

        @wp.func
        def of_rate(rate: F, a: F) -> F:
            """N² = γ̇² + 2 a γ̇."""
            return wp.sqrt(rate * (rate + F(2.0) * a))

        @wp.func
        def flow_rate(excess: F, stiffness: F, growth: F, half: F, parameters: Parameters) -> F:
            """The γ̇ of stiffness γ̇ + growth N / (N + half) = excess, N² = γ̇² + viscous_rate γ̇.

            γ̇ is convex in N and the friction concave: with a tangent in place of the first, the root lies above, and
            each next one nearer. Begun from below, at the greater of two bounds: a chord in place of the first, and the
            friction of an N that is too great.
            """
            rate = F(0.0)
            if WET:
                a = F(0.5) * parameters.viscous_rate
                soft = F(1.0) / larger(stiffness, tiny)
                slip = growth - excess
                rubbed = wp.where(slip > F(0.0), excess * half / larger(slip, tiny), F(1.0e30))
                most = smaller(of_rate(excess * soft, a), rubbed)
                left = larger(excess - growth * most / larger(most + half, tiny), F(0.0))
                chord = stiffness * most / larger(wp.sqrt(most * most + a * a) + a, tiny)
                n = smaller(larger(root(excess, chord, growth, half), of_rate(left * soft, a)), most)
                for _sweep in range(wp.static(SWEEPS)):
                    width = wp.sqrt(n * n + a * a)
                    inverse = F(1.0) / larger(width * (width + a), tiny)
                    # γ̇ = slope n - apart on the tangent.
                    slope = n * (width + a) * inverse
                    apart = a * n * n * inverse
                    n = root(excess + stiffness * apart, stiffness * slope, growth, half)
                rate = n * n / larger(wp.sqrt(n * n + a * a) + a, tiny)
            else:
                rate = root(excess, stiffness, growth, half)
            return rate

        @wp.func
        def bounded(shear: F, borne: F, friction: F, time_step: F, parameters: Parameters) -> F:
            """Shear stress at the end of a step at a mean stress, at most 0, with a friction at rest."""
            static = smaller(shear, -friction * borne)
            growth = -parameters.friction_growth * borne
            stiffness = parameters.shear_modulus * time_step
            half = parameters.inertial_rate * wp.sqrt(-borne)
            rate = flow_rate(shear - static, stiffness, growth, half, parameters)
            # What rounds is kept between the bounds of the friction.
            return larger(static, smaller(shear - stiffness * rate, static + growth))

        @wp.func
        def back(
            points: Points, p: wp.int32, stress: V4, gradient: V4, volume: F, time_step: F, parameters: Parameters
        ):
            mean, shear = parted(stress)
            dilated = mean
            friction = parameters.static_friction
            if DILATANCY:
                # What grows with the rate is a viscosity to the pressure: that of the rate at the trial stress.
                held = smaller(mean, F(0.0))
                psi = tangent_at(points, p, -held, gradient, volume, parameters)
                slow = larger(friction + psi, F(0.0))
                reached = bounded(shear, held, slow, time_step, parameters)
                stiffness = parameters.shear_modulus * time_step
                rate = (shear - reached) / stiffness
                stiffness += larger(reached - smaller(shear, -slow * held), F(0.0)) / larger(rate, tiny)
                pressure, inclined = swollen(
                    points,
                    p,
                    -mean,
                    shear,
                    F(0.0),
                    friction,
                    stiffness,
                    gradient,
                    volume,
                    time_step,
                    parameters,
                )
                dilated = -pressure
                friction = inclined
            borne = smaller(dilated, F(0.0))
            allowed = bounded(shear, borne, friction, time_step, parameters)
            opened = (dilated - borne) / parameters.bulk_modulus
            return joined(stress, mean, borne, allowed / larger(shear, tiny)), opened

        return {"back": back}


def _at_rest(material: Any) -> float:
    """Friction at rest [-], with what dilatancy adds to it."""
    if material.dilatancy is None:
        return material.static_friction
    own = material.dilatancy
    free = own.coefficient * (1.0 - material.porosity - own.critical_solid_fraction)
    return max(material.static_friction + min(max(free, -STEEPEST), STEEPEST), 0.0)
