"""Affine particle-in-cell (Jiang et al. 2015) for quadratic splines."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from ..point_field import PointField
from .scheme import Array, Scheme

ROUNDS = 12
"""Of points to nodes and back, until an affine field is that of the velocities: each leaves a third of the error."""


def affine_field(places: Array, spacing: float, masses: Array, velocities: Array) -> dict[str, Array]:
    """Affine field of points with given velocities, by going to the nodes and back: arguments of `Scheme.fitted`."""
    cell = np.floor(places)
    within = places - cell
    weights = np.stack([0.5 * (1.0 - within) ** 2, 0.75 - (within - 0.5) ** 2, 0.5 * within**2], axis=1)  # [N, 3, 2]
    ways = np.array([-0.5, 0.5, 1.5])[:, None] - within[:, None, :]
    weight = weights[:, :, None, 0] * weights[:, None, :, 1]  # [N, 3, 3]
    lean_x, lean_y = weight * ways[:, :, None, 0], weight * ways[:, None, :, 1]
    first = cell.astype(int) - cell.min(axis=0).astype(int)
    steps = np.arange(3)
    rows = int(first[:, 1].max()) + 3
    node = (first[:, 0, None, None] + steps[:, None]) * rows + first[:, 1, None, None] + steps
    count = int(node.max()) + 1
    mass = np.bincount(node.ravel(), (weight * masses[:, None, None]).ravel(), count)
    inverse = np.divide(1.0, mass, out=np.zeros(count), where=mass > 0.0)
    x, y = np.zeros_like(velocities), np.zeros_like(velocities)
    for component in range(velocities.shape[1]):
        for _ in range(ROUNDS):
            spread = weight * velocities[:, None, None, component] + spacing * (
                lean_x * x[:, None, None, component] + lean_y * y[:, None, None, component]
            )
            at = (np.bincount(node.ravel(), (masses[:, None, None] * spread).ravel(), count) * inverse)[node]
            x[:, component] = 4.0 / spacing * (lean_x * at).sum(axis=(1, 2))
            y[:, component] = 4.0 / spacing * (lean_y * at).sum(axis=(1, 2))
    return {"affine_x": x, "affine_y": y}


class Apic(Scheme):
    """A point takes the nodes' velocity, and of what that leaves out the part that is linear in the place.

    Nodes receive the momentum at the end of the step: the share of internal force and gravity rides along with it.
    """

    name = "apic"
    title = "affine particle-in-cell (Jiang et al. 2015)"
    dimensions = (2, 3)
    point_fields = {"affine_x": PointField("V"), "affine_y": PointField("V")}  # noqa: RUF012
    point_fields_in_space = {"affine_z": PointField("V")}  # noqa: RUF012
    keeps_affine_field = True

    def fitted(self, places: Array, spacing: float, masses: Array, velocities: Array) -> dict[str, Array]:
        return affine_field(places, spacing, masses, velocities)

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        import warp as wp

        F, V3, V = types.scalar, types.V3, types.V
        Points, Grid, Parameters = types.Points, types.Grid, types.Parameters
        read, write, add = tools.read, tools.write, tools.add
        SPATIAL = types.dimensions == 3

        @wp.func
        def start(points: Points, p: wp.int32, masses: V, gravity: V, time_step: F, parameters: Parameters):
            momentum = wp.cw_mul(masses, read(points.velocity, p)) + time_step * wp.cw_mul(masses, gravity)
            change_x = parameters.spacing * wp.cw_mul(masses, read(points.affine_x, p))
            change_y = parameters.spacing * wp.cw_mul(masses, read(points.affine_y, p))
            return momentum, change_x, change_y

        @wp.func
        def start_across(points: Points, p: wp.int32, masses: V, parameters: Parameters) -> V:
            return parameters.spacing * wp.cw_mul(masses, read(points.affine_z, p))

        @wp.func
        def force_share(time_step: F) -> F:
            return time_step

        @wp.func
        def impulse_share(time_step: F) -> F:
            return F(1.0)

        @wp.func
        def column(w: F, d: F, to: F, momentum: V, force_x: V, change_x: V) -> V:
            return w * momentum + (w * to) * change_x + d * force_x

        @wp.func
        def deposit(grid: Grid, node: wp.int32, w: F, d: F, to: F, column: V, change: V, force: V, slope: V):
            add(grid.velocity, node, w * (column + to * change) + d * slope)

        @wp.func
        def collect(
            points: Points,
            p: wp.int32,
            grid: Grid,
            first: wp.int32,
            wx: V3,
            wy: V3,
            smooth: V,
            lean_x: V,
            lean_y: V,
            time_step: F,
            parameters: Parameters,
        ) -> V:
            write(points.velocity, p, smooth)
            write(points.affine_x, p, lean_x * (F(4.0) * parameters.inverse_spacing))
            write(points.affine_y, p, lean_y * (F(4.0) * parameters.inverse_spacing))
            return smooth

        @wp.func
        def collect_in_space(
            points: Points,
            p: wp.int32,
            grid: Grid,
            first: wp.int32,
            wx: V3,
            wy: V3,
            wz: V3,
            smooth: V,
            lean_x: V,
            lean_y: V,
            lean_z: V,
            time_step: F,
            parameters: Parameters,
        ) -> V:
            write(points.affine_z, p, lean_z * (F(4.0) * parameters.inverse_spacing))
            return collect(points, p, grid, first, wx, wy, smooth, lean_x, lean_y, time_step, parameters)

        @wp.func
        def halt(points: Points, p: wp.int32):
            write(points.affine_x, p, V())
            write(points.affine_y, p, V())
            if SPATIAL:
                write(points.affine_z, p, V())

        return {
            "start": start,
            "start_across": start_across,
            "force_share": force_share,
            "impulse_share": impulse_share,
            "column": column,
            "deposit": deposit,
            "collect": collect,
            "collect_in_space": collect_in_space,
            "halt": halt,
        }
