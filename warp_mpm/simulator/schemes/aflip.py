"""Affine-augmented FLIP (Fei et al. 2021) for quadratic splines, with a loss that is given as a rate."""

from types import SimpleNamespace
from typing import Annotated, Any

from pydantic import Field

from warp_mpm.schema import Model

from .apic import Apic
from .flip import Flip


class Settings(Model):
    transfer_damping: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    """With aflip: rate β at which a point's velocity is drawn to the nodes', per sound crossing of a cell [-]."""


class Aflip(Flip):
    """A point spreads its affine field, adds to its velocity what the nodes gained, and is drawn to the nodes' field.

    v ← v + Δv_grid + β (c / d) Δt (v_grid - v - Δv_grid). Fei et al. give the last as a share of a step; here it is a
    rate, with the speed of sound c and the spacing d: what is lost in a time does not depend on the steps in it.
    """

    name = "aflip"
    title = "affine-augmented FLIP (Fei et al. 2021), its loss a rate"
    settings = Settings
    point_fields = Flip.point_fields | Apic.point_fields
    keeps_affine_field = True

    def numbers(self, numerics: Any, *, sound_speed: float) -> dict[str, float]:
        return {"pic_rate": numerics.transfer_damping * (sound_speed / numerics.spacing_m)}

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        import warp as wp

        F, V3, V = types.scalar, types.V3, types.V
        Points, Grid, Parameters = types.Points, types.Grid, types.Parameters
        read, write, add = tools.read, tools.write, tools.add
        flip = super().functions(types, tools)
        flip_collect = flip["collect"]

        @wp.func
        def start(points: Points, p: wp.int32, masses: V, gravity: V, time_step: F, parameters: Parameters):
            momentum = wp.cw_mul(masses, read(points.velocity, p))
            change_x = parameters.spacing * wp.cw_mul(masses, read(points.affine_x, p))
            change_y = parameters.spacing * wp.cw_mul(masses, read(points.affine_y, p))
            return momentum, change_x, change_y

        @wp.func
        def column(w: F, d: F, to: F, momentum: V, force_x: V, change_x: V) -> V:
            return w * momentum + (w * to) * change_x

        @wp.func
        def deposit(grid: Grid, node: wp.int32, w: F, d: F, to: F, column: V, change: V, force: V, slope: V):
            add(grid.velocity, node, w * (column + to * change))
            add(grid.force, node, w * force + d * slope)

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
            write(points.affine_x, p, lean_x * (F(4.0) * parameters.inverse_spacing))
            write(points.affine_y, p, lean_y * (F(4.0) * parameters.inverse_spacing))
            return flip_collect(points, p, grid, first, wx, wy, smooth, lean_x, lean_y, time_step, parameters)

        return flip | {"start": start, "column": column, "deposit": deposit, "collect": collect}
