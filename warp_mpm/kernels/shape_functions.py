"""Quadratic B-splines on the nodes of the grid and bilinear hats on its corners.

A point at reduced coordinate s = (x - origin) / d lies in the cell around node `int(s)`; with f = s - int(s) in [0, 1),
its three nodes per direction are int(s) - 1, int(s), int(s) + 1 and its two corners are int(s) - 1, int(s).
"""

from types import SimpleNamespace

import warp as wp


def make_shape_functions(types: SimpleNamespace) -> SimpleNamespace:
    """Build `cell_of(x, shift, parameters)`, the cell that a point lies in and its place there, for space
    `layer_of(x, parameters)`, its layer and the place in that, and of such a place `weights(f)`, `slopes(f)`
    (derivative times d) and `hats(f)`; each sums to one (slopes to zero)."""
    F = types.scalar
    Parameters = types.Parameters
    V2 = types.V2
    V3 = types.V3
    X = types.X
    SPATIAL = types.dimensions == 3

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

    @wp.func
    def cell_of(x: X, shift: F, parameters: Parameters):
        """Column and row of the cell's node and the place in the cell, both in [0, 1); the grid is displaced by `shift`
        [m]."""
        sx = (x[0] - parameters.left - shift) * parameters.inverse_spacing
        sy = (x[1] - parameters.bottom) * parameters.inverse_spacing
        i = wp.int32(sx)
        j = wp.int32(sy)
        return i, j, sx - F(i), sy - F(j)

    @wp.func
    def layer_of(x: X, parameters: Parameters):
        """Layer of the cell's node and the place in it, in [0, 1)."""
        s = F(0.0)
        if SPATIAL:
            s = (x[2] - parameters.front) * parameters.inverse_spacing
        layer = wp.int32(s)
        return layer, s - F(layer)

    return SimpleNamespace(cell_of=cell_of, layer_of=layer_of, weights=weights, slopes=slopes, hats=hats)
