"""Linear elasticity in the rate of Eq. (A3): the law of a skeleton that never yields, and a part of all others."""

from types import SimpleNamespace
from typing import Any

from .law import Law


class Elastic(Law):
    """A skeleton that is elastic, whatever it bears."""

    name = "elastic"
    dimensions = (2, 3)
    title = "linear elastic, without a bound on the stress"


def make_elasticity(types: SimpleNamespace) -> SimpleNamespace:
    """Build the functions `trial_stress`, the elastic part of the constitutive law, and `volume_ratio`."""
    import warp as wp

    F = types.scalar
    V4 = types.V4
    Parameters = types.Parameters

    @wp.func
    def volume_ratio(strain: F):
        """exp(strain), the ratio of the volumes, as a quotient that is positive for every strain."""
        even = F(12.0) + strain * strain
        return (even + F(6.0) * strain) / (even - F(6.0) * strain)

    if types.dimensions == 3:
        return SimpleNamespace(trial_stress=_trial_stress_in_space(types, volume_ratio), volume_ratio=volume_ratio)

    @wp.func
    def trial_stress(stress: V4, gradient: V4, volume_strain: F, time_step: F, parameters: Parameters):
        """Jaumann rate of the Kirchhoff stress, Eq. (A3), for an elastic step.

        `gradient` is (dvx/dx, dvx/dy, dvy/dx, dvy/dy) [1/s]; `volume_strain` the increment that the skeleton bears [-],
        which replaces the trace. Returns the stress and the deviatoric strain increment [-]. The rotation is the exact
        one of the spin over the step (half-angle formula), so that it leaves invariants alone.
        """
        half = F(0.5)
        third = volume_strain / F(3.0)
        mean = half * volume_strain
        stretch = half * time_step * (gradient[0] - gradient[3])
        xx = mean + stretch
        yy = mean - stretch
        xy = half * time_step * (gradient[1] + gradient[2])
        tangent = F(0.25) * time_step * (gradient[2] - gradient[1])
        scale = F(1.0) / (F(1.0) + tangent * tangent)
        c = (F(1.0) - tangent * tangent) * scale
        s = F(2.0) * tangent * scale
        cosine = c * c - s * s
        sine = F(2.0) * c * s
        centre = half * (stress[0] + stress[1])
        difference = half * (stress[0] - stress[1])
        turned_difference = difference * cosine - sine * stress[3]
        turned_shear = sine * difference + cosine * stress[3]
        # The rate integrated over the step, as for the volume: a strain and its reverse leave nothing behind.
        keep = F(1.0) / volume_ratio(volume_strain)
        over_step = F(12.0) / (F(12.0) + F(6.0) * volume_strain + volume_strain * volume_strain)
        lame = parameters.lame * volume_strain * over_step
        double = F(2.0) * parameters.shear_modulus * over_step
        trial = V4(
            keep * (centre + turned_difference) + lame + double * xx,
            keep * (centre - turned_difference) + lame + double * yy,
            keep * stress[2] + lame,
            keep * turned_shear + double * xy,
        )
        squares = (xx - third) * (xx - third) + (yy - third) * (yy - third) + third * third + F(2.0) * xy * xy
        return trial, wp.sqrt(F(wp.static(2.0 / 3.0)) * squares)

    return SimpleNamespace(trial_stress=trial_stress, volume_ratio=volume_ratio)


def _trial_stress_in_space(types: SimpleNamespace, volume_ratio: Any) -> Any:
    """Build `trial_stress` in space; of a plane rotation it is that of the plane."""
    import warp as wp

    from warp_mpm.kernels.vectors import make_vectors

    F, X, T, G, Parameters = types.scalar, types.X, types.T, types.G, types.Parameters
    M: Any = wp.types.matrix((3, 3), F)
    trace, squares = make_vectors(types).trace, make_vectors(types).squares

    @wp.func
    def trial_stress(stress: T, gradient: G, volume_strain: F, time_step: F, parameters: Parameters):
        third = volume_strain / F(3.0)
        even = third - time_step * trace(gradient) / F(3.0)
        half = F(0.5) * time_step
        strain = T(
            even + time_step * gradient[0],
            even + time_step * gradient[4],
            even + time_step * gradient[8],
            half * (gradient[1] + gradient[3]),
            half * (gradient[5] + gradient[7]),
            half * (gradient[2] + gradient[6]),
        )
        # Rotation about a, by 2 atan |a|: I + 2 (A + A²) / (1 + a²), A b = a x b.
        a = F(0.5) * half * X(gradient[7] - gradient[5], gradient[2] - gradient[6], gradient[3] - gradient[1])
        skew = M(F(0.0), -a[2], a[1], a[2], F(0.0), -a[0], -a[1], a[0], F(0.0))
        turn = wp.identity(n=3, dtype=F) + (F(2.0) / (F(1.0) + wp.dot(a, a))) * (skew + skew * skew)
        before = M(
            stress[0], stress[3], stress[5],
            stress[3], stress[1], stress[4],
            stress[5], stress[4], stress[2],
        )  # fmt: skip
        turned = turn * before * wp.transpose(turn)
        keep = F(1.0) / volume_ratio(volume_strain)
        over_step = F(12.0) / (F(12.0) + F(6.0) * volume_strain + volume_strain * volume_strain)
        lame = parameters.lame * volume_strain * over_step
        double = F(2.0) * parameters.shear_modulus * over_step
        trial = keep * T(turned[0, 0], turned[1, 1], turned[2, 2], turned[0, 1], turned[1, 2], turned[0, 2])
        trial += T(lame, lame, lame, F(0.0), F(0.0), F(0.0)) + double * strain
        deviator = strain - T(third, third, third, F(0.0), F(0.0), F(0.0))
        return trial, wp.sqrt(F(wp.static(2.0 / 3.0)) * squares(deviator))

    return trial_stress


def make_stored_energy(types: SimpleNamespace, tools: SimpleNamespace) -> Any:
    """Build the function `stored`, the energy that an elastic skeleton gives back."""
    import warp as wp

    from warp_mpm.kernels.vectors import make_vectors

    F = types.scalar
    T = types.T
    Parameters = types.Parameters
    larger = tools.larger
    squares = make_vectors(types).squares
    one = wp.constant(wp.float64(1.0))

    @wp.func
    def work_of_stretch(x: wp.float64):
        """(1 + x) ln(1 + x) - x, of second order: near 0 the difference loses all digits, so there by its series."""
        result = wp.float64(0.0)
        if wp.abs(x) < wp.float64(0.15):
            # ln(1 + x) = 2 artanh t, of which the first seven terms leave 1e-15.
            t = x / (wp.float64(2.0) + x)
            q = t * t
            tail = wp.float64(wp.static(1.0 / 11.0)) + q * wp.float64(wp.static(1.0 / 13.0))
            tail = wp.float64(wp.static(1.0 / 7.0)) + q * (wp.float64(wp.static(1.0 / 9.0)) + q * tail)
            tail = wp.float64(wp.static(1.0 / 3.0)) + q * (wp.float64(wp.static(1.0 / 5.0)) + q * tail)
            result = (wp.float64(2.0) + x) * q * (one + (one + t) * t * tail)
        else:
            stretch = larger(one + x, wp.float64(1.0e-6))
            result = stretch * wp.log(stretch) - x
        return result

    @wp.func
    def stored_in_skeleton(strain: wp.float64, volume: wp.float64, grains: wp.float64, modulus: wp.float64):
        """Energy [J/m] of a mean stress, given as p / K. The rate of Eq. (A3) makes it p = K (V_0 / V - 1), so the work
        done on the way there is V ((K + p) ln(1 + p / K) - p), and p^2 / 2 K per volume only while p is far below K.
        Beyond closed voids the volume that works is that of the grains."""
        result = volume * modulus * work_of_stretch(strain)
        if volume < grains:
            # At closure V_0 / V was less by the ratio of the volumes.
            stretch = larger(one + strain, wp.float64(1.0e-6))
            closed = stretch * volume / grains
            result = grains * modulus * (closed * wp.log(closed) - closed + one)
            result += grains * modulus * (stretch - closed - wp.log(stretch / closed))
        return result

    @wp.func
    def stored(stress: T, volume: F, grains: F, parameters: Parameters) -> wp.float64:
        trace = stress[0] + stress[1] + stress[2]
        deviatoric = squares(stress) - trace * trace * F(wp.static(1.0 / 3.0))
        bulk = wp.float64(parameters.bulk_modulus)
        strain = wp.float64(-trace * F(wp.static(1.0 / 3.0))) / bulk
        # Shear stress s at the volume V was s V / V_0 before the volume changed, which does no work on it.
        distortion = wp.float64(volume * deviatoric) / larger(one + strain, wp.float64(1.0e-6))
        distortion = distortion / (wp.float64(4.0) * wp.float64(parameters.shear_modulus))
        # In double precision always: the work is a small difference of the terms.
        return distortion + stored_in_skeleton(strain, wp.float64(volume), wp.float64(grains), bulk)

    return stored
