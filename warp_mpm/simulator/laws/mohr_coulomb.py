"""Mohr-Coulomb plasticity with tension cut-off: return mapping in principal stress, sigma_zz included."""

# ruff: noqa: N815 - a unit at the end of a field's name keeps its own spelling (Pa)

import math
from types import SimpleNamespace
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from warp_mpm.schema import Model, NonNegative

from .dilatancy import angle_at_rest, make_dilatancy, range_of_angles
from .law import Array, Law
from .principal import make_principal


class Settings(Model):
    friction_angle_deg: Annotated[float, Field(ge=0.0, lt=90.0)]
    """Internal friction angle φ'."""
    cohesion_Pa: NonNegative = 0.0
    """Effective cohesion c'."""
    dilatancy_angle_deg: Annotated[float, Field(ge=0.0, lt=90.0)] = 0.0
    """Dilatancy angle ψ, at most the friction angle."""
    tension_cutoff_Pa: NonNegative = 0.0
    """Largest tensile principal effective stress."""

    @model_validator(mode="after")
    def _flow_rule(self) -> Self:
        if self.dilatancy_angle_deg > self.friction_angle_deg:
            raise ValueError(
                f"dilatancy_angle_deg = {self.dilatancy_angle_deg:g} must not exceed "
                f"friction_angle_deg = {self.friction_angle_deg:g}"
            )
        return self


class MohrCoulomb(Law):
    """Linear elastic, non-associative Mohr–Coulomb with a tension cut-off, beyond which the skeleton opens."""

    name = "mohr_coulomb"
    title = "non-associative Mohr–Coulomb with a tension cut-off (the paper's)"
    Settings = Settings
    dimensions = (2, 3)
    opens = True
    dilates = True
    constants = (
        "yield_plus",
        "yield_minus",
        "cohesion_term",
        "tension_limit",
        "plane_inverse",
        "upper_own",
        "upper_cross",
        "upper_ratio",
        "lower_own",
        "lower_cross",
        "lower_ratio",
        "flow_up",
        "flow_side",
        "flow_down",
    )

    def numbers(self, material: Any) -> dict[str, float]:
        return yield_constants(
            lame=material.lame_modulus,
            shear_modulus=material.shear_modulus,
            friction_angle=math.radians(material.friction_angle_deg),
            dilatancy_angle=math.radians(material.dilatancy_angle_deg),
            cohesion=material.cohesion_Pa,
            tension_cutoff=material.tension_cutoff_Pa,
        )

    def bears_tension(self, material: Any) -> bool:
        return material.tension_cutoff_Pa > 0.0 and material.cohesion_Pa > 0.0

    def friction(self, material: Any) -> float:
        return math.tan(math.radians(material.friction_angle_deg))

    def lateral_stress_ratio(self, material: Any) -> float:
        """Jaky's 1 - sin φ'."""
        return 1.0 - math.sin(angle_at_rest(material, math.radians(material.friction_angle_deg)))

    def lateral_stress_range(self, material: Any, vertical: float) -> tuple[float, float]:
        """Active and passive coefficients of Rankine, with cohesion."""
        if vertical == 0.0:
            return 0.0, math.inf
        sine = math.sin(angle_at_rest(material, math.radians(material.friction_angle_deg)))
        cohesion = 2.0 * material.cohesion_Pa * math.cos(math.radians(material.friction_angle_deg))
        least = max(((1.0 - sine) * vertical - cohesion) / ((1.0 + sine) * vertical), 0.0)
        return least, ((1.0 + sine) * vertical + cohesion) / ((1.0 - sine) * vertical)

    def strength(self, material: Any) -> float:
        return material.cohesion_Pa

    def yield_excess(self, material: Any, stress: Array) -> Array:
        xx, yy, zz, xy = stress.T
        mean, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
        principal = np.sort(np.stack([mean + radius, mean - radius, zz]), axis=0)
        first, last = principal[2], principal[0]
        angle = math.radians(material.friction_angle_deg)
        least, most = range_of_angles(material, angle)
        sine = np.where(first + last > 0.0, math.sin(least), math.sin(most))  # under tension, friction takes away
        cone = (1.0 + sine) * first - (1.0 - sine) * last - 2.0 * material.cohesion_Pa * math.cos(angle)
        apex = material.cohesion_Pa / math.tan(angle) if angle > 0.0 else math.inf
        return np.maximum(cone, first - min(material.tension_cutoff_Pa, apex))

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        import warp as wp

        F, T, G, Points, Parameters = types.scalar, types.T, types.G, types.Points, types.Parameters
        if types.effects.dilatancy:
            return {"back": _make_dilatant(types, tools)}
        return_mapping = make_return_mapping(types, tools)

        @wp.func
        def back(points: Points, p: wp.int32, stress: T, gradient: G, volume: F, time_step: F, parameters: Parameters):
            return return_mapping(stress, parameters)

        return {"back": back}


def _make_dilatant(types: SimpleNamespace, tools: SimpleNamespace) -> Any:
    """Build `back` with an angle of friction that is each point's own: first the pressure, with what dilatancy adds to
    it, then the way back at that pressure, without a change of volume."""
    import warp as wp

    F, V4, Points, Parameters = types.scalar, types.V4, types.Points, types.Parameters
    larger, smaller = tools.larger, tools.smaller
    fields = ("lame", "shear_modulus", "bulk_modulus", *MohrCoulomb.constants)
    Cone = wp.struct(type("Cone", (), {"__annotations__": dict.fromkeys(fields, F), "__module__": __name__}))
    dilated = make_dilatancy(types, tools).dilated
    return_mapping = make_return_mapping(types, tools, Cone)

    @wp.func
    def back(points: Points, p: wp.int32, stress: V4, gradient: V4, volume: F, time_step: F, parameters: Parameters):
        centre = F(0.5) * (stress[0] + stress[1])
        difference = F(0.5) * (stress[0] - stress[1])
        radius = wp.sqrt(difference * difference + stress[3] * stress[3])
        first = larger(centre + radius, stress[2])
        last = smaller(centre - radius, stress[2])
        pressure = F(-0.5) * (first + last)
        g = parameters.shear_modulus
        after, sine = dilated(
            points,
            p,
            pressure,
            F(0.5) * (first - last),
            F(0.5) * parameters.cohesion_term,
            parameters.friction_sine,
            g * time_step,
            gradient,
            volume,
            time_step,
            parameters,
        )
        push = pressure - after
        # As `yield_constants` has them, with ψ = 0.
        y = Cone()
        y.lame = parameters.lame
        y.shear_modulus = g
        y.bulk_modulus = parameters.bulk_modulus
        y.yield_plus = F(1.0) + sine
        y.yield_minus = F(1.0) - sine
        y.cohesion_term = parameters.cohesion_term
        apex = F(0.5) * parameters.cohesion_term / larger(sine, F(1.0e-6))
        y.tension_limit = smaller(parameters.tension_limit, apex)
        y.plane_inverse = F(0.25) / g
        upper = F(1.0) / (g * (F(1.0) + sine) * (F(3.0) - sine))
        lower = F(1.0) / (g * (F(1.0) - sine) * (F(3.0) + sine))
        y.upper_own = upper
        y.upper_ratio = F(0.5) * (F(1.0) - sine)
        y.upper_cross = upper * y.upper_ratio
        y.lower_own = lower
        y.lower_ratio = F(0.5) * (F(1.0) + sine)
        y.lower_cross = lower * y.lower_ratio
        y.flow_up = F(2.0) * g
        y.flow_side = F(0.0)
        y.flow_down = F(-2.0) * g
        return return_mapping(V4(stress[0] + push, stress[1] + push, stress[2] + push, stress[3]), y)

    return back


def make_return_mapping(types: SimpleNamespace, tools: SimpleNamespace, constants: Any = None) -> Any:
    """Build the Warp function that maps a trial stress back onto the yield surface.

    Perfect plasticity with linear elasticity, so every region of the surface has a closed form (Clausen et al. 2007,
    for linear criteria in principal stress): with s1 >= s2 >= s3, tension positive,

        Mohr-Coulomb  (1 + sin phi) s1 - (1 - sin phi) s3 <= 2 c cos phi,  flow with psi in place of phi,
        cut-off       s1 <= T,                                             associated flow,

    where T is at most the apex c cot phi, so that the apex of the cone is the apex of the cut-off. Regions: plane, two
    edges, one, two or three tension planes, cone and cut-off together with their two corners.

    The function takes the trial stress (xx, yy, zz, xy; in space yz and xz too) [Pa] and the parameters, or another
    structure `constants`, whose fields `yield_constants` makes; it returns the stress on or inside the surface and the
    opening, the plastic volume strain due to the cut-off alone, over the volume after it [-].
    Where most points yield, branches cost more than arithmetic: the cone is free of them.
    """
    import warp as wp

    F = types.scalar
    V3 = types.V3
    V4 = types.V4
    Constants = constants or types.Parameters
    larger, smaller = tools.larger, tools.smaller

    @wp.func
    def cone(s: V3, y: Constants) -> V3:
        f = larger(y.yield_plus * s[0] - y.yield_minus * s[2] - y.cohesion_term, F(0.0))
        upper = y.yield_plus * s[1] - y.yield_minus * s[2] - y.cohesion_term
        lower = y.yield_plus * s[0] - y.yield_minus * s[1] - y.cohesion_term
        # Plastic multipliers of the planes (2, 3) and (1, 2), positive on the edges s1 = s2 and s2 = s3, and of (1, 3).
        m23 = larger(upper * y.upper_own - f * y.upper_cross, F(0.0))
        m12 = larger(lower * y.lower_own - f * y.lower_cross, F(0.0))
        m13 = f * y.plane_inverse - m23 * y.upper_ratio - m12 * y.lower_ratio
        return V3(
            s[0] - (m13 + m12) * y.flow_up - m23 * y.flow_side,
            s[1] - m13 * y.flow_side - m23 * y.flow_up - m12 * y.flow_down,
            s[2] - (m13 + m23) * y.flow_down - m12 * y.flow_side,
        )

    @wp.func
    def cut_off(s: V3, y: Constants) -> V3:
        stiff = y.lame + F(2.0) * y.shear_modulus
        limit = y.tension_limit
        excess = (s[0] - limit) / stiff
        r = V3(limit, s[1] - y.lame * excess, s[2] - y.lame * excess)
        if r[1] > limit:
            both = (s[0] + s[1] - F(2.0) * limit) / (F(2.0) * (y.lame + y.shear_modulus))
            r = V3(limit, limit, smaller(s[2] - y.lame * both, limit))
        if y.yield_plus * limit - y.yield_minus * r[2] > y.cohesion_term:
            # Cut-off and cone together: s1 and s3 are known, s2 follows from elasticity, unless it meets a corner.
            low = (y.yield_plus * limit - y.cohesion_term) / y.yield_minus
            inverse = F(1.0) / (stiff * y.flow_down - y.lame * y.flow_up)
            a = ((s[0] - limit) * y.flow_down - (s[2] - low) * y.flow_up) * inverse
            m = (stiff * (s[2] - low) - y.lame * (s[0] - limit)) * inverse
            r = V3(limit, larger(smaller(s[1] - y.lame * a - y.flow_side * m, limit), low), low)
        return r

    if types.dimensions == 3:
        T = types.T
        of_space = make_principal(types)
        principal, composed = of_space.principal, of_space.composed

        @wp.func
        def return_mapping_in_space(stress: T, y: Constants):
            s1, s2, s3, n1, n2, n3 = principal(stress)
            s = V3(s1, s2, s3)
            r = cone(s, y)
            opening = F(0.0)
            if r[0] > y.tension_limit:
                r = cut_off(s, y)
                opening = (s1 + s2 + s3 - r[0] - r[1] - r[2]) / (F(3.0) * y.bulk_modulus)
            return composed(r[0], r[1], r[2], n1, n2, n3), opening

        return return_mapping_in_space

    @wp.func
    def return_mapping(stress: V4, y: Constants):
        half = F(0.5)
        mean = half * (stress[0] + stress[1])
        difference = half * (stress[0] - stress[1])
        radius = wp.sqrt(difference * difference + stress[3] * stress[3])
        a = mean + radius
        b = mean - radius
        z = stress[2]
        first = larger(a, z)
        last = -larger(-b, -z)
        s = V3(first, a + b + z - first - last, last)
        r = cone(s, y)
        opening = F(0.0)
        if r[0] > y.tension_limit:
            r = cut_off(s, y)
            opening = (s[0] + s[1] + s[2] - r[0] - r[1] - r[2]) / (F(3.0) * y.bulk_modulus)
        # z keeps its rank among the principal stresses.
        new_z = wp.where(z > a, r[0], wp.where(z > b, r[1], r[2]))
        new_a = wp.where(z > a, r[1], r[0])
        new_b = wp.where(z > b, r[2], r[1])
        inverse = F(1.0) / larger(radius, F(1.0e-30))
        centre = half * (new_a + new_b)
        scale = half * (new_a - new_b) * inverse
        return V4(centre + scale * difference, centre - scale * difference, new_z, scale * stress[3]), opening

    return return_mapping


def yield_constants(
    *,
    lame: float,
    shear_modulus: float,
    friction_angle: float,
    dilatancy_angle: float,
    cohesion: float,
    tension_cutoff: float,
) -> dict[str, float]:
    """Fields of the parameters that the return mapping reads. Moduli, cohesion, cut-off in Pa, angles in rad."""
    sine, sine_flow = math.sin(friction_angle), math.sin(dilatancy_angle)
    coupled = 4.0 * lame * sine * sine_flow
    plane = coupled + 4.0 * shear_modulus * (1.0 + sine * sine_flow)
    upper = coupled + 2.0 * shear_modulus * (1.0 - sine) * (1.0 - sine_flow)
    lower = coupled + 2.0 * shear_modulus * (1.0 + sine) * (1.0 + sine_flow)
    side = 2.0 * lame * sine_flow
    apex = cohesion / math.tan(friction_angle) if friction_angle > 0.0 else math.inf
    return {
        "yield_plus": 1.0 + sine,
        "yield_minus": 1.0 - sine,
        "cohesion_term": 2.0 * cohesion * math.cos(friction_angle),
        "tension_limit": min(tension_cutoff, apex),
        "plane_inverse": 1.0 / plane,
        "upper_own": plane / (plane**2 - upper**2),
        "upper_cross": upper / (plane**2 - upper**2),
        "upper_ratio": upper / plane,
        "lower_own": plane / (plane**2 - lower**2),
        "lower_cross": lower / (plane**2 - lower**2),
        "lower_ratio": lower / plane,
        "flow_up": side + 2.0 * shear_modulus * (1.0 + sine_flow),
        "flow_side": side,
        "flow_down": side - 2.0 * shear_modulus * (1.0 - sine_flow),
    }
