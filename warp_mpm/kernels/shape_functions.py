"""Quadratic B-splines on the nodes of the grid and bilinear hats on its corners.

A point at reduced coordinate s = (x - origin) / d lies in the cell around node `int(s)`; with f = s - int(s) in [0, 1),
its three nodes per direction are int(s) - 1, int(s), int(s) + 1 and its two corners are int(s) - 1, int(s).
"""

from types import SimpleNamespace

import warp as wp


def make_shape_functions(types: SimpleNamespace) -> SimpleNamespace:
    """Build `weights(f)`, `slopes(f)` (derivative times d) and `hats(f)`; each sums to one (slopes to zero)."""
    F = types.scalar
    V2 = types.V2
    V3 = types.V3

    @wp.func
    def weights(f: F) -> V3:
        g = F(1.0) - f
        return V3(F(0.5) * g * g, F(0.5) + f * g, F(0.5) * f * f)

    @wp.func
    def slopes(f: F) -> V3:
        return V3(f - F(1.0), F(1.0) - F(2.0) * f, f)

    @wp.func
    def hats(f: F) -> V2:
        return V2(F(1.0) - f, f)

    return SimpleNamespace(weights=weights, slopes=slopes, hats=hats)
