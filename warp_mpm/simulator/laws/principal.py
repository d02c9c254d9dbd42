"""Principal stresses in space, for laws that are written in them. In the plane they have a closed form of their own."""

from types import SimpleNamespace
from typing import Any

SWEEPS = 6
"""Of Jacobi's rotations: each squares what is left beside the diagonal, and four leave nothing in double precision."""


def make_principal(types: SimpleNamespace) -> SimpleNamespace:
    """Build `principal(stress: T) -> s1, s2, s3, n1, n2, n3`, s1 >= s2 >= s3 with unit vectors of their directions, and
    `composed(s1, s2, s3, n1, n2, n3) -> T`."""
    import warp as wp

    F, X, T = types.scalar, types.X, types.T
    M: Any = wp.types.matrix((3, 3), F)

    @wp.func
    def turn(a: M, p: wp.int32, q: wp.int32) -> M:
        """Jacobi's rotation, which makes the entry (p, q) of a symmetric tensor nil."""
        off = a[p, q]
        result = wp.identity(n=3, dtype=F)
        if off != F(0.0):
            half = F(0.5) * (a[q, q] - a[p, p])
            size = wp.abs(half) + wp.sqrt(half * half + off * off)
            t = wp.where(half < F(0.0), -off, off) / size
            c = F(1.0) / wp.sqrt(F(1.0) + t * t)
            result[p, p] = c
            result[q, q] = c
            result[p, q] = t * c
            result[q, p] = -t * c
        return result

    @wp.func
    def ordered(a: F, b: F, of_a: X, of_b: X):
        """The two, the greater one first."""
        high = a
        low = b
        first = of_a
        second = of_b
        if b > a:
            high = b
            low = a
            first = of_b
            second = of_a
        return high, low, first, second

    @wp.func
    def principal(s: T):
        a = M(s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2])
        n = wp.identity(n=3, dtype=F)
        for _sweep in range(wp.static(SWEEPS)):
            for k in range(3):
                # (0, 1), (0, 2), (1, 2)
                r = turn(a, k / 2, (k + 3) / 2)
                a = wp.transpose(r) * a * r
                n = n * r
        s1, s2, n1, n2 = ordered(a[0, 0], a[1, 1], X(n[0, 0], n[1, 0], n[2, 0]), X(n[0, 1], n[1, 1], n[2, 1]))
        s2, s3, n2, n3 = ordered(s2, a[2, 2], n2, X(n[0, 2], n[1, 2], n[2, 2]))
        s1, s2, n1, n2 = ordered(s1, s2, n1, n2)
        return s1, s2, s3, n1, n2, n3

    @wp.func
    def composed(s1: F, s2: F, s3: F, n1: X, n2: X, n3: X) -> T:
        a = s1 * wp.outer(n1, n1) + s2 * wp.outer(n2, n2) + s3 * wp.outer(n3, n3)
        return T(a[0, 0], a[1, 1], a[2, 2], a[0, 1], a[1, 2], a[0, 2])

    return SimpleNamespace(principal=principal, composed=composed)
