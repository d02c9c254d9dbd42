"""The barest step of material points that there can be: what a full step is set against, on whatever machine.

One phase, two dimensions, quadratic B-splines, float64: empty the nodes, scatter mass and momentum, divide, gather the
velocity and move. No stress, no gradient, no contact; compiled with Warp's own settings.
"""

# Kernels are Warp's dialect.
# mypy: disable-error-code="valid-type,misc"

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import cache
from types import SimpleNamespace

import numpy as np
import warp as wp

MARGIN = 4
"""Empty cells around the square block of points."""


class Yardstick:
    """So many points, four per cell, in a square block at next to no speed."""

    def __init__(self, points: int, *, device: str = "cpu", clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock, self._points = clock, points
        cells = math.ceil(math.sqrt(points / 4.0))
        place = MARGIN + 0.25 + 0.5 * np.arange(2 * cells)
        position = np.stack(np.meshgrid(place, place, indexing="ij"), axis=-1).reshape(-1, 2)[:points]
        velocity = 1e-3 * np.random.default_rng(1).normal(size=position.shape)
        side = (cells + 2 * MARGIN, cells + 2 * MARGIN)
        kernels = _kernels()
        x = wp.array(position, dtype=wp.vec2d, device=device)
        v = wp.array(velocity, dtype=wp.vec2d, device=device)
        grid = wp.zeros(side, dtype=wp.vec4d, device=device)
        self._held = (x, v, grid)
        wp.load_module(wp.get_module(kernels.module), device=device)
        with wp.ScopedCapture(device=device) as capture:
            wp.launch(kernels.empty, side, [grid], device=device)
            wp.launch(kernels.scatter, points, [x, v, grid, 1.0], device=device)
            wp.launch(kernels.divide, side, [grid], device=device)
            wp.launch(kernels.gather, points, [x, v, grid, 1.0, 1e-4], device=device)
        self._graph, self._device = capture.graph, device
        wp.capture_launch(self._graph)
        self._per_step = 1e-7 * points

    def chunk(self, seconds: float) -> float:
        """Step for about `seconds` and return the cost [ns] per point and step."""
        steps = max(4, math.ceil(seconds / self._per_step))
        begin = self._clock()
        for _ in range(steps):
            wp.capture_launch(self._graph)
        wp.synchronize_device(self._device)
        self._per_step = max((self._clock() - begin) / steps, 1e-7)
        return 1e9 * self._per_step / self._points


@cache
def _kernels() -> SimpleNamespace:
    module = "warp_mpm.yardstick"
    wp.set_module_options({"enable_backward": False}, module=wp.get_module(module))

    @wp.func
    def weights(f: wp.float64) -> wp.vec3d:
        # f is the distance to the first of three nodes, from 1/2 to 3/2, in the form of the textbooks.
        half = wp.float64(0.5)
        a = wp.float64(1.5) - f
        b = f - wp.float64(1.0)
        c = f - half
        return wp.vec3d(half * a * a, wp.float64(0.75) - b * b, half * c * c)

    @wp.kernel(module=module)
    def empty(grid: wp.array2d(dtype=wp.vec4d)):
        i, j = wp.tid()
        grid[i, j] = wp.vec4d()

    @wp.kernel(module=module)
    def scatter(
        x: wp.array(dtype=wp.vec2d),
        v: wp.array(dtype=wp.vec2d),
        grid: wp.array2d(dtype=wp.vec4d),
        inverse_spacing: wp.float64,
    ):
        p = wp.tid()
        place = x[p] * inverse_spacing
        i = wp.int32(place[0] - wp.float64(0.5))
        j = wp.int32(place[1] - wp.float64(0.5))
        wx = weights(place[0] - wp.float64(i))
        wy = weights(place[1] - wp.float64(j))
        u = v[p]
        for k in range(3):
            for m in range(3):
                w = wx[k] * wy[m]
                grid[i + k, j + m] += wp.vec4d(w, w * u[0], w * u[1], wp.float64(0.0))

    @wp.kernel(module=module)
    def divide(grid: wp.array2d(dtype=wp.vec4d)):
        i, j = wp.tid()
        g = grid[i, j]
        if g[0] > wp.float64(0.0):
            grid[i, j] = wp.vec4d(g[0], g[1] / g[0], g[2] / g[0], wp.float64(0.0))

    @wp.kernel(module=module)
    def gather(
        x: wp.array(dtype=wp.vec2d),
        v: wp.array(dtype=wp.vec2d),
        grid: wp.array2d(dtype=wp.vec4d),
        inverse_spacing: wp.float64,
        time_step: wp.float64,
    ):
        p = wp.tid()
        place = x[p] * inverse_spacing
        i = wp.int32(place[0] - wp.float64(0.5))
        j = wp.int32(place[1] - wp.float64(0.5))
        wx = weights(place[0] - wp.float64(i))
        wy = weights(place[1] - wp.float64(j))
        u = wp.vec2d()
        for k in range(3):
            for m in range(3):
                g = grid[i + k, j + m]
                u += wx[k] * wy[m] * wp.vec2d(g[1], g[2])
        v[p] = u
        x[p] += time_step * u

    return SimpleNamespace(module=module, empty=empty, scatter=scatter, divide=divide, gather=gather)
