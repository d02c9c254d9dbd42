"""FLIP (Sulsky et al. 1995), with a share of the grid's own velocity that is given as a rate."""

from types import SimpleNamespace
from typing import Annotated, Any

from pydantic import Field

from warp_mpm.schema import Model

from ..point_field import PointField
from .scheme import Scheme


class Settings(Model):
    pic_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01
    """With flip: share of the grid's own velocity in the update during the time in which sound crosses a cell."""


def make_kept(types: SimpleNamespace, tools: SimpleNamespace) -> tuple[Any, Any]:
    """Build `kept(time_step, parameters)`, the share of its own velocity that a point keeps in a step, and `gain`,
    which gives it its velocity afterwards."""
    import warp as wp

    F, V, Points, Parameters = types.scalar, types.V, types.Points, types.Parameters
    TWO_PHASE = types.effects.two_phase
    MATERIALS = types.effects.materials
    of_phases, solid_of, liquid_of = tools.of_phases, tools.solid_of, tools.liquid_of
    read, write = tools.read, tools.write

    @wp.func
    def kept(time_step: F, parameters: Parameters) -> F:
        return F(1.0) - wp.min(parameters.pic_rate * time_step, F(1.0))

    @wp.func
    def gained(old: V, increment: V, smooth: V, share: F, time_step: F, parameters: Parameters) -> V:
        """`increment` and `smooth` are the nodes' own, both at the point; `share` is what the point keeps."""
        own = share * old
        new = own + increment
        if TWO_PHASE:
            # What the grid does not see of v_L - v_S is damped by the drag like what it does see.
            decay = F(1.0) / (F(1.0) + parameters.drag_rate * time_step)
            unseen = own + increment - smooth
            if MATERIALS:
                # The sum over the points of what the grid does not see is nil for each phase. Where the shares of the
                # phases differ between points, each must therefore keep its own momentum.
                lost = (F(1.0) - decay) * (liquid_of(unseen) - solid_of(unseen))
                new += of_phases((F(1.0) - parameters.solid_share) * lost, -parameters.solid_share * lost)
            else:
                solid = solid_of(new)
                liquid = solid + liquid_of(smooth) - solid_of(smooth) + decay * (liquid_of(unseen) - solid_of(unseen))
                new = of_phases(solid, liquid)
        return new

    @wp.func
    def gain(points: Points, p: wp.int32, increment: V, smooth: V, share: F, time_step: F, parameters: Parameters) -> V:
        new = gained(read(points.velocity, p), increment, smooth, share, time_step, parameters)
        write(points.velocity, p, new)
        write(points.advection, p, solid_of(smooth))
        return new

    return kept, gain


class Flip(Scheme):
    """A point adds to its velocity what the nodes gained in the step, and moves with the nodes' velocity."""

    name = "flip"
    dimensions = (2, 3)
    title = "flip (Sulsky et al. 1995, the paper's)"
    settings = Settings
    point_fields = {"advection": PointField("X")}  # noqa: RUF012
    grid_fields = {"force": "V", "increment": "V"}  # noqa: RUF012
    constants = ("pic_rate",)

    def numbers(self, numerics: Any, *, sound_speed: float, flow_speed: float) -> dict[str, float]:
        return {"pic_rate": numerics.pic_share * (sound_speed / numerics.spacing_m)}

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        import warp as wp

        F, V3, V, X = types.scalar, types.V3, types.V, types.X
        Points, Grid, Parameters = types.Points, types.Grid, types.Parameters
        read, write, add = tools.read, tools.write, tools.add
        kept, gain = make_kept(types, tools)

        @wp.func
        def start(points: Points, p: wp.int32, masses: V, gravity: V, time_step: F, parameters: Parameters):
            return wp.cw_mul(masses, read(points.velocity, p)), V(), V()

        @wp.func
        def force_share(time_step: F) -> F:
            return F(1.0)

        @wp.func
        def impulse_share(time_step: F) -> F:
            return time_step

        @wp.func
        def column(w: F, d: F, to: F, momentum: V, force_x: V, change_x: V) -> V:
            return w * momentum

        @wp.func
        def deposit(grid: Grid, node: wp.int32, w: F, d: F, to: F, column: V, change: V, force: V, slope: V):
            add(grid.velocity, node, w * column)
            add(grid.force, node, w * force + d * slope)

        @wp.func
        def clear(grid: Grid, i: wp.int32, j: wp.int32):
            grid.force[i, j] = V()

        @wp.func
        def free_velocity(grid: Grid, i: wp.int32, j: wp.int32, inverse: V, gravity: V, time_step: F) -> V:
            return wp.cw_mul(inverse, grid.velocity[i, j]) + time_step * (
                wp.cw_mul(inverse, grid.force[i, j]) + gravity
            )

        @wp.func
        def keep(grid: Grid, i: wp.int32, j: wp.int32, old: V, new: V, time_step: F, parameters: Parameters):
            # So that the points need not read the nodes' velocity too: v + dv + s (v_g - v - dv) is
            # (1 - s) v + (v_g - (1 - s) (v_g - dv)).
            grid.increment[i, j] = new - kept(time_step, parameters) * old

        @wp.func
        def receive(grid: Grid, i: wp.int32, j: wp.int32, change: V):
            node = i * grid.increment.shape[1] + j
            write(grid.increment, node, read(grid.increment, node) + change)

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
            increment = V()
            for k in range(3):
                for m in range(3):
                    increment += (wx[k] * wy[m]) * read(grid.increment, first + k * parameters.rows + m)
            share = kept(time_step, parameters)
            return gain(points, p, increment, smooth, share, time_step, parameters)

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
            increment = V()
            for q in range(3):
                for k in range(3):
                    for m in range(3):
                        node = first + q * parameters.layer + k * parameters.rows + m
                        increment += (wz[q] * wx[k] * wy[m]) * read(grid.increment, node)
            share = kept(time_step, parameters)
            return gain(points, p, increment, smooth, share, time_step, parameters)

        @wp.func
        def displacement(
            points: Points, p: wp.int32, grid: Grid, x: X, shift: F, time_step: F, parameters: Parameters
        ) -> X:
            return time_step * read(points.advection, p)

        return {
            "start": start,
            "force_share": force_share,
            "impulse_share": impulse_share,
            "column": column,
            "deposit": deposit,
            "clear": clear,
            "free_velocity": free_velocity,
            "keep": keep,
            "receive": receive,
            "collect": collect,
            "collect_in_space": collect_in_space,
            "displacement": displacement,
        }
