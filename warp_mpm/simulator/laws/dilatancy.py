"""Dilatancy: a skeleton that is sheared swells or shrinks toward the solid fraction at which it would go on so."""

import math
from types import SimpleNamespace
from typing import Annotated, Any

from pydantic import Field

from warp_mpm.schema import Model

from .law import Law
from .radial import TINY

ROUNDS, SWEEPS = 2, 3
"""Newton's steps to the pressure at the end of a step, each kept between bounds that close in: what is left is 1e-6 of
the pressure, or of a pascal."""

STEEPEST = 1.0
"""Greatest tan ψ: no packing of grains swells by more than it is sheared."""

GREATEST_SINE = 0.999
"""Of the angle of friction and dilatancy together, 87°."""

WATER_VISCOSITY = 1e-3
"""Of the liquid of an undrained flow [Pa s], which has no other viscosity."""


class Dilatancy(Model):
    """Sheared, the skeleton swells by tan ψ = coefficient · (m - m_eq), m its solid fraction (1 - porosity at the
    start), m_eq = critical_solid_fraction / (1 + √S), S = η_f γ̇ / (ρ_grain (γ̇ δ)² + σ') (Iverson and George 2014)."""

    critical_solid_fraction: Annotated[float, Field(gt=0.0, lt=1.0)]
    """Solid fraction m_crit at which slow shearing changes no volume: looser soil shrinks, denser soil swells."""
    coefficient: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    """tan ψ per difference of the solid fraction; 0 is none."""
    grain_diameter_m: Annotated[float, Field(ge=1e-7, le=10.0)] = 1e-3
    """Diameter δ of the grains, in S alone."""


CONSTANTS = ("friction_sine", "dilatancy_coefficient", "critical_solid_fraction", "shear_inertia", "fluid_viscosity")
"""Numbers that the function below reads from the parameters, and the sine of φ at rest."""


def numbers(material: Any, law: Law) -> dict[str, float]:
    """Values of `CONSTANTS`, of a material with a dilatancy."""
    own = material.dilatancy
    return {
        "friction_sine": math.sin(math.atan(law.friction(material))),
        "dilatancy_coefficient": own.coefficient,
        "critical_solid_fraction": own.critical_solid_fraction,
        "shear_inertia": material.grain_density_kg_per_m3 * own.grain_diameter_m**2,
        "fluid_viscosity": fluid_viscosity(material),
    }


def fluid_viscosity(material: Any) -> float:
    """Of what is in the voids [Pa s]: the law's own, or the liquid's; 0 of air."""
    own = getattr(material, "fluid_viscosity_Pa_s", None)
    if own is not None:
        return float(own)
    if not hasattr(material, "liquid_density_kg_per_m3"):
        return 0.0
    return float(getattr(material, "liquid_viscosity_Pa_s", WATER_VISCOSITY))


def equilibrium(material: Any, *, rate: float, pressure: float) -> float:
    """m_eq [-] at a rate of shearing [1/s] and an effective pressure [Pa]."""
    own = material.dilatancy
    inertia = material.grain_density_kg_per_m3 * (own.grain_diameter_m * rate) ** 2
    state = fluid_viscosity(material) * rate / max(inertia + pressure, TINY)
    return float(own.critical_solid_fraction / (1.0 + math.sqrt(state)))


def angle_at_rest(material: Any, angle: float) -> float:
    """Angle of friction [rad] of the soil as it lies, at least 0: `angle` and, with a dilatancy, ψ of slow shearing."""
    own = material.dilatancy
    if own is None:
        return angle
    free = own.coefficient * (1.0 - material.porosity - own.critical_solid_fraction)
    return max(angle + math.atan(min(max(free, -STEEPEST), STEEPEST)), 0.0)


def range_of_angles(material: Any, angle: float) -> tuple[float, float]:
    """The same at the least and at the most, of any density [rad]."""
    own = material.dilatancy
    if own is None:
        return angle, angle
    steepest = math.atan(min(own.coefficient, STEEPEST))
    return max(angle - steepest, 0.0), min(angle + steepest, 0.5 * math.pi)


def make_dilatancy(types: SimpleNamespace, tools: SimpleNamespace, *, added: bool = False) -> SimpleNamespace:
    """Build the functions `dilated`, what dilatancy makes of the pressure and of the friction in a step, and
    `tangent_at`, tan ψ at a pressure.

    Args:
        types, tools: as `Law.functions` has them.
        added: the friction is sin φ + tan ψ, in place of sin(φ + ψ).
    """
    import warp as wp

    F, V4, Points, Parameters = types.scalar, types.V4, types.Points, types.Parameters
    read, larger, smaller = tools.read, tools.larger, tools.smaller
    tiny = wp.constant(F(TINY))
    least, most = wp.constant(F(-STEEPEST)), wp.constant(F(STEEPEST))

    @wp.func
    def tangent(m: F, pressure: F, inertia: F, viscous: F, parameters: Parameters):
        """tan ψ at an effective pressure, and its change with the pressure [1/Pa], which is not positive."""
        root = wp.sqrt(inertia + larger(pressure, F(0.0)) + tiny)
        share = root / (root + viscous)  # 1 / (1 + √S)
        free = parameters.dilatancy_coefficient * (m - parameters.critical_solid_fraction * share)
        slope = -parameters.dilatancy_coefficient * parameters.critical_solid_fraction
        slope *= F(0.5) * share * (F(1.0) - share) / (root * root)
        kept = larger(smaller(free, most), least)
        falls = wp.where(kept == free, slope, F(0.0))
        return kept, wp.where(pressure > F(0.0), falls, F(0.0))

    ADDED = added

    @wp.func
    def inclined(tangent_psi: F, sine: F, cosine: F):
        """Sine of φ + ψ, between none and a right angle; or both added, and none at the least."""
        if wp.static(ADDED):
            return larger(sine + tangent_psi, F(0.0))
        inverse = F(1.0) / wp.sqrt(F(1.0) + tangent_psi * tangent_psi)
        within = larger((sine + cosine * tangent_psi) * inverse, F(0.0))
        greatest = F(wp.static(GREATEST_SINE))
        return wp.where(cosine > sine * tangent_psi, smaller(within, greatest), greatest)

    @wp.func
    def sheared_state(points: Points, p: wp.int32, gradient: V4, volume: F, parameters: Parameters):
        """Solid fraction, ρ_grain (γ̇ δ)² [Pa] and √(η_f γ̇) [√Pa] of a point."""
        stretch = gradient[0] - gradient[3]
        sheared = gradient[1] + gradient[2]
        rate = wp.sqrt(stretch * stretch + sheared * sheared)
        m = parameters.grain_share * read(points.reference_volume, p) / volume
        return m, parameters.shear_inertia * rate * rate, wp.sqrt(parameters.fluid_viscosity * rate)

    @wp.func
    def tangent_at(points: Points, p: wp.int32, pressure: F, gradient: V4, volume: F, parameters: Parameters) -> F:
        m, inertia, viscous = sheared_state(points, p, gradient, volume, parameters)
        psi, _change = tangent(m, pressure, inertia, viscous, parameters)
        return psi

    @wp.func
    def dilated(
        points: Points,
        p: wp.int32,
        pressure: F,
        shear: F,
        cohesion: F,
        sine: F,
        stiffness: F,
        gradient: V4,
        volume: F,
        time_step: F,
        parameters: Parameters,
    ):
        """Effective pressure [Pa] at the end of a step, and the sine of φ + ψ there.

        Sheared plastically by Γ = (τ - c - sin(φ + ψ) p) / stiffness · Δt the pressure, held at its volume, becomes
        p_trial + K tan ψ Γ, as the grains part alike in all directions; tan ψ falls with it and the friction grows, so
        that there is one such p. Contraction takes the pressure away, and no more than there is.

        Args:
            points, p: the point.
            pressure: of the trial stress, compression positive.
            shear: of the trial stress.
            cohesion: shear that is borne without pressure.
            sine: of φ, the friction without dilatancy.
            stiffness: shear stress per rate of plastic shear: G Δt, and the viscosity of the law [Pa s].
            gradient: of the velocity [1/s].
            volume: of the point at the end of the step [m³/m].
            time_step: Δt.
            parameters: of the material.
        """
        cosine = wp.sqrt(larger(F(1.0) - sine * sine, F(0.0)))
        m, inertia, viscous = sheared_state(points, p, gradient, volume, parameters)
        gain = parameters.bulk_modulus * time_step / larger(stiffness, tiny)
        excess = shear - cohesion
        steepest, _none = tangent(m, F(0.0), inertia, viscous, parameters)
        low = smaller(pressure, F(0.0))
        high = larger(pressure, low) + gain * larger(steepest, F(0.0)) * larger(excess, F(0.0))
        at = smaller(larger(pressure, low), high)
        psi, change = tangent(m, at, inertia, viscous, parameters)
        friction = inclined(psi, sine, cosine)
        # Twice three, written out one after the other: a loop would keep the compiler from doing several points at a
        # time.
        for _round in range(wp.static(ROUNDS)):
            for _sweep in range(wp.static(SWEEPS)):
                slip = larger(excess - friction * larger(at, F(0.0)), F(0.0))
                gap = at - pressure - gain * psi * slip
                high = wp.where(gap > F(0.0), at, high)
                low = wp.where(gap > F(0.0), low, at)
                rubbed = wp.where(slip > F(0.0), gain * psi * friction, F(0.0))
                slope = F(1.0) + larger(rubbed, F(-0.5)) - gain * change * slip
                at -= gap / slope
                outside = larger(low - at, at - high)
                at = wp.where(outside > F(0.0), F(0.5) * (low + high), at)
                psi, change = tangent(m, at, inertia, viscous, parameters)
                friction = inclined(psi, sine, cosine)
        return at, friction

    return SimpleNamespace(dilated=dilated, tangent_at=tangent_at)
