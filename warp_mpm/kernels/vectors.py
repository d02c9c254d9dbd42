"""Vectors and tensors in the plane and in space: of the kernels' code, what knows the components that there are.

All kernels name a place, or the velocity of one phase, `X`, a symmetric tensor `T`, a velocity gradient `G` and all
velocities at a place `V`, and take them apart by these functions alone:

    plane strain: X = (x, y), T = (xx, yy, zz, xy), G = (dvx/dx, dvx/dy, dvy/dx, dvy/dy),
    space: X = (x, y, z), T = (xx, yy, zz, xy, yz, xz), G = (dvx/dx, dvx/dy, dvx/dz, dvy/dx, ..., dvz/dz);
    V = X of the solid, then X of the liquid where there are two phases.
"""

from types import SimpleNamespace

import warp as wp

LEAST_HALF = 0.25
"""Least volume, as a share, to which half a step takes a point: beyond, a step would turn it inside out."""


def make_vectors(types: SimpleNamespace) -> SimpleNamespace:
    """Build the functions for the dimensions and phases of `types`.

    - `per_phase(solid, liquid) -> V`: a number of each phase, for all its components; `of_phases(solid: X, liquid: X)
      -> V`. With one phase the liquid's is passed over. `solid_of(V) -> X` and `liquid_of(V) -> X` take them apart.
    - `speed_squared(V)`: of the faster phase.
    - `on_x`, `on_y` (`on_z`): a vector along an axis.
    - `face_x(stress: T, pressure, push)`, `face_y` (`face_z`): force on the face across an axis, (p I - stress) push.
    - `squares(T)`: sum of all components' squares; `trace(G)`; `shear_rate(G)`: √(2 e' : e') of the deviatoric rate of
      strain e' (in the plane: of its own deviator).
    - `midway(along_x: V, along_y: V, (along_z: V,) time_step) -> G, scalar`: from the slopes of the velocities at the
      places where the step began, the solid's gradient at the places in its middle, and the liquid's divergence there.
    - `slip_along(v: X, n: X) -> R`: velocity along a surface; `limited(R, limit)`; `along(R, n: X) -> X`.
    - `wide(X)`: in double precision; `section(X)`: (x, y); `across(v)`: of a vector of the section one of the flow;
      `sound(X)`: whether all are numbers.
    """
    return SimpleNamespace(**(_of_space(types) if types.dimensions == 3 else _of_plane(types)))


def _of_plane(types: SimpleNamespace) -> dict[str, object]:
    F, V2, V, G, T, X64 = types.scalar, types.V2, types.V, types.G, types.T, types.X64
    TWO_PHASE = types.effects.two_phase

    @wp.func
    def solid_of(v: V) -> V2:
        return V2(v[0], v[1])

    @wp.func
    def liquid_of(v: V) -> V2:
        result = V2()
        if TWO_PHASE:
            result = V2(v[2], v[3])
        return result

    @wp.func
    def of_phases(first: V2, second: V2) -> V:
        result = V()
        if TWO_PHASE:
            result = V(first[0], first[1], second[0], second[1])
        else:
            result = first
        return result

    @wp.func
    def per_phase(first: F, second: F) -> V:
        return of_phases(V2(first, first), V2(second, second))

    @wp.func
    def speed_squared(v: V) -> F:
        result = v[0] * v[0] + v[1] * v[1]
        if TWO_PHASE:
            liquid = v[2] * v[2] + v[3] * v[3]
            result = wp.where(result > liquid, result, liquid)
        return result

    @wp.func
    def on_x(value: F) -> V2:
        return V2(value, F(0.0))

    @wp.func
    def on_y(value: F) -> V2:
        return V2(F(0.0), value)

    @wp.func
    def face_x(stress: T, pressure: F, push: F) -> V2:
        return V2((pressure - stress[0]) * push, -stress[3] * push)

    @wp.func
    def face_y(stress: T, pressure: F, push: F) -> V2:
        return V2(-stress[3] * push, (pressure - stress[1]) * push)

    @wp.func
    def squares(s: T) -> F:
        return s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + F(2.0) * s[3] * s[3]

    @wp.func
    def trace(gradient: G) -> F:
        return gradient[0] + gradient[3]

    @wp.func
    def shear_rate(gradient: G) -> F:
        stretch = gradient[0] - gradient[3]
        shear = gradient[1] + gradient[2]
        return wp.sqrt(stretch * stretch + shear * shear)

    @wp.func
    def midway(along_x: V, along_y: V, time_step: F):
        # The points move by v dt with the velocity that they have now, which is that of the middle of the step. Its
        # gradient there is L (I + dt L / 2)^-1 of the gradient L at the places where the step began (Hughes and
        # Winget 1980): volume and rotation are then those of the points' own motion, to second order.
        half = F(0.5) * time_step
        determinant = along_x[0] * along_y[1] - along_y[0] * along_x[1]
        trace = along_x[0] + along_y[1]
        growth = F(1.0) + half * (trace + half * determinant)
        ratio = F(1.0) / wp.where(growth > F(wp.static(LEAST_HALF)), growth, F(wp.static(LEAST_HALF)))
        xx = ratio * (along_x[0] + half * determinant)
        yy = ratio * (along_y[1] + half * determinant)
        xy = ratio * along_y[0]
        yx = ratio * along_x[1]
        liquid_divergence = F(0.0)
        if TWO_PHASE:
            # The liquid's own gradient, in the places to which the solid takes the points.
            liquid_trace = along_x[2] + along_y[3]
            product = along_x[0] * along_x[2] + along_y[0] * along_x[3] + along_x[1] * along_y[2]
            product += along_y[1] * along_y[3]
            liquid_divergence = ratio * (liquid_trace + half * (trace * liquid_trace - product))
        return G(xx, xy, yx, yy), liquid_divergence

    @wp.func
    def slip_along(v: V2, n: V2) -> F:
        return wp.dot(v, V2(-n[1], n[0]))

    @wp.func
    def limited(given: F, limit: F) -> F:
        return wp.clamp(given, -limit, limit)

    @wp.func
    def along(given: F, n: V2) -> V2:
        return given * V2(-n[1], n[0])

    @wp.func
    def wide(v: V2) -> X64:
        return X64(wp.float64(v[0]), wp.float64(v[1]))

    @wp.func
    def section(x: V2) -> V2:
        return x

    @wp.func
    def across(v: V2) -> V2:
        return v

    @wp.func
    def sound(x: V2) -> wp.bool:
        return wp.isfinite(x[0]) and wp.isfinite(x[1])

    return {
        "solid_of": solid_of,
        "liquid_of": liquid_of,
        "of_phases": of_phases,
        "per_phase": per_phase,
        "speed_squared": speed_squared,
        "on_x": on_x,
        "on_y": on_y,
        "on_z": None,
        "face_x": face_x,
        "face_y": face_y,
        "face_z": None,
        "squares": squares,
        "trace": trace,
        "shear_rate": shear_rate,
        "midway": midway,
        "slip_along": slip_along,
        "limited": limited,
        "along": along,
        "wide": wide,
        "section": section,
        "across": across,
        "sound": sound,
    }


def _of_space(types: SimpleNamespace) -> dict[str, object]:
    F, V2, V, G, T, X, X64 = types.scalar, types.V2, types.V, types.G, types.T, types.X, types.X64
    M = wp.types.matrix((3, 3), F)
    TWO_PHASE = types.effects.two_phase

    @wp.func
    def solid_of(v: V) -> X:
        return X(v[0], v[1], v[2])

    @wp.func
    def liquid_of(v: V) -> X:
        result = X()
        if TWO_PHASE:
            result = X(v[3], v[4], v[5])
        return result

    @wp.func
    def of_phases(first: X, second: X) -> V:
        result = V()
        if TWO_PHASE:
            result = V(first[0], first[1], first[2], second[0], second[1], second[2])
        else:
            result = first
        return result

    @wp.func
    def per_phase(first: F, second: F) -> V:
        return of_phases(X(first, first, first), X(second, second, second))

    @wp.func
    def speed_squared(v: V) -> F:
        result = wp.dot(solid_of(v), solid_of(v))
        if TWO_PHASE:
            liquid = wp.dot(liquid_of(v), liquid_of(v))
            result = wp.where(result > liquid, result, liquid)
        return result

    @wp.func
    def on_x(value: F) -> X:
        return X(value, F(0.0), F(0.0))

    @wp.func
    def on_y(value: F) -> X:
        return X(F(0.0), value, F(0.0))

    @wp.func
    def on_z(value: F) -> X:
        return X(F(0.0), F(0.0), value)

    @wp.func
    def face_x(stress: T, pressure: F, push: F) -> X:
        return X((pressure - stress[0]) * push, -stress[3] * push, -stress[5] * push)

    @wp.func
    def face_y(stress: T, pressure: F, push: F) -> X:
        return X(-stress[3] * push, (pressure - stress[1]) * push, -stress[4] * push)

    @wp.func
    def face_z(stress: T, pressure: F, push: F) -> X:
        return X(-stress[5] * push, -stress[4] * push, (pressure - stress[2]) * push)

    @wp.func
    def squares(s: T) -> F:
        normal = s[0] * s[0] + s[1] * s[1] + s[2] * s[2]
        return normal + F(2.0) * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5])

    @wp.func
    def trace(gradient: G) -> F:
        return gradient[0] + gradient[4] + gradient[8]

    @wp.func
    def shear_rate(gradient: G) -> F:
        mean = trace(gradient) / F(3.0)
        xx = gradient[0] - mean
        yy = gradient[4] - mean
        zz = gradient[8] - mean
        xy = gradient[1] + gradient[3]
        yz = gradient[5] + gradient[7]
        xz = gradient[2] + gradient[6]
        return wp.sqrt(F(2.0) * (xx * xx + yy * yy + zz * zz) + xy * xy + yz * yz + xz * xz)

    @wp.func
    def minors(m: M) -> F:
        """Sum of the principal minors of the second order."""
        result = m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0] + m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1]
        return result + m[0, 0] * m[2, 2] - m[0, 2] * m[2, 0]

    @wp.func
    def midway(along_x: V, along_y: V, along_z: V, time_step: F):
        # As in the plane; the inverse by Cayley and Hamilton, with h = dt / 2 and the invariants of L:
        # L (I + h L)^-1 = (L + h (tr L L - L²) + h² III I) / (1 + h tr L + h² II + h³ III).
        h = F(0.5) * time_step
        a = M(
            along_x[0], along_y[0], along_z[0],
            along_x[1], along_y[1], along_z[1],
            along_x[2], along_y[2], along_z[2],
        )  # fmt: skip
        first = wp.trace(a)
        second = minors(a)
        third = wp.determinant(a)
        growth = F(1.0) + h * (first + h * (second + h * third))
        ratio = F(1.0) / wp.where(growth > F(wp.static(LEAST_HALF)), growth, F(wp.static(LEAST_HALF)))
        square = a * a
        m = ratio * (a + h * (first * a - square))
        even = ratio * h * h * third
        liquid_divergence = F(0.0)
        if TWO_PHASE:
            k = M(
                along_x[3], along_y[3], along_z[3],
                along_x[4], along_y[4], along_z[4],
                along_x[5], along_y[5], along_z[5],
            )  # fmt: skip
            other = wp.trace(k)
            product = wp.trace(a * k)
            liquid_divergence = other + h * (first * other - product)
            liquid_divergence += h * h * (second * other - first * product + wp.trace(square * k))
            liquid_divergence *= ratio
        gradient = G(
            m[0, 0] + even, m[0, 1], m[0, 2], m[1, 0], m[1, 1] + even, m[1, 2], m[2, 0], m[2, 1], m[2, 2] + even
        )
        return gradient, liquid_divergence

    @wp.func
    def slip_along(v: X, n: X) -> X:
        return v - wp.dot(v, n) * n

    @wp.func
    def limited(given: X, limit: F) -> X:
        result = given
        size = wp.length(given)
        if size > limit:
            result = (limit / size) * given
        return result

    @wp.func
    def along(given: X, n: X) -> X:
        return given

    @wp.func
    def wide(v: X) -> X64:
        return X64(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]))

    @wp.func
    def section(x: X) -> V2:
        return V2(x[0], x[1])

    @wp.func
    def across(v: V2) -> X:
        return X(v[0], v[1], F(0.0))

    @wp.func
    def sound(x: X) -> wp.bool:
        return wp.isfinite(x[0]) and wp.isfinite(x[1]) and wp.isfinite(x[2])

    return {
        "solid_of": solid_of,
        "liquid_of": liquid_of,
        "of_phases": of_phases,
        "per_phase": per_phase,
        "speed_squared": speed_squared,
        "on_x": on_x,
        "on_y": on_y,
        "on_z": on_z,
        "face_x": face_x,
        "face_y": face_y,
        "face_z": face_z,
        "squares": squares,
        "trace": trace,
        "shear_rate": shear_rate,
        "midway": midway,
        "slip_along": slip_along,
        "limited": limited,
        "along": along,
        "wide": wide,
        "section": section,
        "across": across,
        "sound": sound,
    }
