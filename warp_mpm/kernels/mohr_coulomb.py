"""Mohr-Coulomb plasticity with tension cut-off: return mapping in principal stress, sigma_zz included."""

from types import SimpleNamespace
from typing import Any

import warp as wp


def make_return_mapping(types: SimpleNamespace) -> Any:
    """Build the Warp function that maps a trial stress back onto the yield surface.

    Perfect plasticity with linear elasticity, so every region of the surface has a closed form (Clausen et al. 2007,
    for linear criteria in principal stress): with s1 >= s2 >= s3, tension positive,

        Mohr-Coulomb  (1 + sin phi) s1 - (1 - sin phi) s3 <= 2 c cos phi,  flow with psi in place of phi,
        cut-off       s1 <= T,                                             associated flow,

    where T is at most the apex c cot phi, so that the apex of the cone is the apex of the cut-off. Regions: plane, two
    edges, one, two or three tension planes, cone and cut-off together with their two corners.

    The function takes the trial stress (xx, yy, zz, xy) [Pa], the Lame constant and shear modulus [Pa], sin phi,
    sin psi, 2 c cos phi and T [Pa]; it returns the stress on or inside the surface and the opening, the plastic volume
    strain due to the cut-off alone [-].
    """
    F = types.scalar
    V3 = types.V3
    V4 = types.V4

    @wp.func
    def cone(s: V3, lame: F, shear: F, sin_friction: F, sin_dilatancy: F, cohesion: F) -> V3:
        one = F(1.0)
        coupled = F(4.0) * lame * sin_friction * sin_dilatancy
        f = (one + sin_friction) * s[0] - (one - sin_friction) * s[2] - cohesion
        plane = coupled + F(4.0) * shear * (one + sin_friction * sin_dilatancy)
        dilation = F(2.0) * lame * sin_dilatancy
        up = dilation + F(2.0) * shear * (one + sin_dilatancy)
        down = dilation - F(2.0) * shear * (one - sin_dilatancy)
        multiplier = wp.max(f, F(0.0)) / plane
        r = V3(s[0] - multiplier * up, s[1] - multiplier * dilation, s[2] - multiplier * down)
        if r[1] > r[0]:
            # Edge s1 = s2: planes (1, 3) and (2, 3).
            g = (one + sin_friction) * s[1] - (one - sin_friction) * s[2] - cohesion
            cross = coupled + F(2.0) * shear * (one - sin_friction) * (one - sin_dilatancy)
            scale = one / (plane * plane - cross * cross)
            a = (plane * f - cross * g) * scale
            b = (plane * g - cross * f) * scale
            top = F(0.5) * (s[0] + s[1] - (a + b) * (up + dilation))
            r = V3(top, top, s[2] - (a + b) * down)
        elif r[2] > r[1]:
            # Edge s2 = s3: planes (1, 3) and (1, 2).
            g = (one + sin_friction) * s[0] - (one - sin_friction) * s[1] - cohesion
            cross = coupled + F(2.0) * shear * (one + sin_friction) * (one + sin_dilatancy)
            scale = one / (plane * plane - cross * cross)
            a = (plane * f - cross * g) * scale
            b = (plane * g - cross * f) * scale
            low = F(0.5) * (s[1] + s[2] - (a + b) * (down + dilation))
            r = V3(s[0] - (a + b) * up, low, low)
        return r

    @wp.func
    def cut_off(
        s: V3, lame: F, shear: F, sin_friction: F, sin_dilatancy: F, cohesion: F, limit: F
    ) -> V3:
        one = F(1.0)
        stiff = lame + F(2.0) * shear
        excess = (s[0] - limit) / stiff
        r = V3(limit, s[1] - lame * excess, s[2] - lame * excess)
        if r[1] > limit:
            both = (s[0] + s[1] - F(2.0) * limit) / (F(2.0) * (lame + shear))
            r = V3(limit, limit, wp.min(s[2] - lame * both, limit))
        if (one + sin_friction) * limit - (one - sin_friction) * r[2] > cohesion:
            # Cut-off and cone together: s1 and s3 are known, s2 follows from elasticity, unless it meets a corner.
            low = ((one + sin_friction) * limit - cohesion) / (one - sin_friction)
            dilation = F(2.0) * lame * sin_dilatancy
            up = dilation + F(2.0) * shear * (one + sin_dilatancy)
            down = dilation - F(2.0) * shear * (one - sin_dilatancy)
            inverse = one / (stiff * down - lame * up)
            a = ((s[0] - limit) * down - (s[2] - low) * up) * inverse
            m = (stiff * (s[2] - low) - lame * (s[0] - limit)) * inverse
            r = V3(limit, wp.clamp(s[1] - lame * a - dilation * m, low, limit), low)
        return r

    @wp.func
    def return_mapping(
        stress: V4, lame: F, shear: F, sin_friction: F, sin_dilatancy: F, cohesion: F, limit: F
    ):
        half = F(0.5)
        mean = half * (stress[0] + stress[1])
        difference = half * (stress[0] - stress[1])
        radius = wp.sqrt(difference * difference + stress[3] * stress[3])
        a = mean + radius
        b = mean - radius
        z = stress[2]
        first = wp.max(a, z)
        last = wp.min(b, z)
        result = stress
        opening = F(0.0)
        outside = (F(1.0) + sin_friction) * first - (F(1.0) - sin_friction) * last > cohesion
        if outside or first > limit:
            s = V3(first, a + b + z - first - last, last)
            r = cone(s, lame, shear, sin_friction, sin_dilatancy, cohesion)
            if r[0] > limit:
                r = cut_off(s, lame, shear, sin_friction, sin_dilatancy, cohesion, limit)
                opening = (s[0] + s[1] + s[2] - r[0] - r[1] - r[2]) / (F(3.0) * lame + F(2.0) * shear)
            # z keeps its rank among the principal stresses.
            new_a = r[0]
            new_b = r[1]
            new_z = r[2]
            if z > a:
                new_z = r[0]
                new_a = r[1]
                new_b = r[2]
            elif z > b:
                new_z = r[1]
                new_b = r[2]
            cosine = F(1.0)
            sine = F(0.0)
            if radius > F(0.0):
                cosine = difference / radius
                sine = stress[3] / radius
            mean = half * (new_a + new_b)
            radius = half * (new_a - new_b)
            result = V4(mean + radius * cosine, mean - radius * cosine, new_z, radius * sine)
        return result, opening

    return return_mapping
