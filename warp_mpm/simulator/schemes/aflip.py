"""Affine-augmented FLIP (Fei et al. 2021) for quadratic splines, with a loss that is given as a rate."""

from types import SimpleNamespace
from typing import Annotated, Any

from pydantic import Field

from warp_mpm.schema import Model

from .apic import Apic, affine_field
from .flip import Flip, make_kept
from .scheme import Array


class Settings(Model):
    transfer_damping: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    """With aflip: rate β at which points are drawn to the nodes' velocity, while sound crosses a cell [-]. The less,
    the more noise is left: below 0.1 it may grow."""


class Aflip(Flip):
    """A point spreads its affine field, takes part in what the nodes gain, and is drawn to what they have.

    With the nodes' velocity v_g and gain Δv_g, both at the point, and their first moments C_g and ΔC_g,

        v ← v + Δv_g + s (v_g - v - Δv_g),  C ← C + ΔC_g + s (C_g - C - ΔC_g),  s = β (c + v_0) Δt / d.

    Fei et al. set C to C_g in every step, and give s as a number. Here all that is lost is lost at the rate
    β (c + v_0) / d, with the speed of sound c, that of the flow at the start v_0 and the spacing d: without it,
    velocity and affine field keep their energy, as both gain by the transpose of what they give.
    """

    name = "aflip"
    title = "affine-augmented FLIP (Fei et al. 2021), its loss a rate"
    settings = Settings
    point_fields = Flip.point_fields | Apic.point_fields
    point_fields_in_space = Apic.point_fields_in_space
    keeps_affine_field = True

    def numbers(self, numerics: Any, *, sound_speed: float, flow_speed: float) -> dict[str, float]:
        return {"pic_rate": numerics.transfer_damping * ((sound_speed + flow_speed) / numerics.spacing_m)}

    def fitted(self, places: Array, spacing: float, masses: Array, velocities: Array) -> dict[str, Array]:
        return affine_field(places, spacing, masses, velocities)

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        import warp as wp

        F, V2, V3, V, X = types.scalar, types.V2, types.V3, types.V, types.X
        Points, Grid, Parameters = types.Points, types.Grid, types.Parameters
        read, write, add, larger = tools.read, tools.write, tools.add, tools.larger
        nine, part = tools.nine, tools.part
        TWO_PHASE = types.effects.two_phase
        kept, gain = make_kept(types, tools)
        affine = Apic().functions(types, tools)
        solid_of, liquid_of, of_phases = tools.solid_of, tools.liquid_of, tools.of_phases
        M: Any = wp.types.matrix((3, 3), F)

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
        def line(w: V3, low: V, middle: V, high: V):
            """Of a field at three nodes in a row: its weighted mean, and its first moment about the middle one."""
            first = w[0] * low
            last = w[2] * high
            return first + w[1] * middle + last, last - first

        @wp.func
        def turning(xx: F, xy: F, yx: F, yy: F, time_step: F) -> V2:
            """What a moved point's affine field C is multiplied by, and what is then added to xx and yy.

            A field that rides along is C (I + Δt C)^-1 after the step: C rotating about the point turns the velocities
            of the points around. So done for rotation and spreading; what squeezes is left to the nodes, as a point
            that flies alone would steepen its own without bound.
            """
            rotation = time_step * larger(xx * yy - xy * yx, F(0.0))
            divided = F(1.0) / (F(1.0) + time_step * (larger(xx + yy, F(0.0)) + rotation))
            return V2(divided, divided * rotation)

        @wp.func
        def gained_around(grid: Grid, first: wp.int32, wx: V3, wy: V3, parameters: Parameters):
            """Of the gain at the nine nodes of a layer: mean, and first moments about the middle node."""
            zero = F(0.0)
            all = nine(grid.increment, first, parameters.rows, zero, zero, wx[0], wx[1], wx[2], wy[0], wy[1], wy[2])
            return part(all, 0), part(all, 1), part(all, 2)

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
            increment, gain_x, gain_y = gained_around(grid, first, wx, wy, parameters)
            gain_x -= (wx[2] - wx[0]) * increment
            gain_y -= (wy[2] - wy[0]) * increment

            per_moment = F(4.0) * parameters.inverse_spacing
            share = kept(time_step, parameters)
            x = share * read(points.affine_x, p) + per_moment * gain_x
            y = share * read(points.affine_y, p) + per_moment * gain_y
            solid = turning(x[0], y[0], x[1], y[1], time_step)
            if TWO_PHASE:
                liquid = turning(x[2], y[2], x[3], y[3], time_step)
                both = V(solid[0], solid[0], liquid[0], liquid[0])
                x = wp.cw_mul(both, x) + V(solid[1], F(0.0), liquid[1], F(0.0))
                y = wp.cw_mul(both, y) + V(F(0.0), solid[1], F(0.0), liquid[1])
            else:
                x = solid[0] * x + V(solid[1], F(0.0))
                y = solid[0] * y + V(F(0.0), solid[1])
            write(points.affine_x, p, x)
            write(points.affine_y, p, y)

            return gain(points, p, increment, smooth, share, time_step, parameters)

        @wp.func
        def turned(x: X, y: X, z: X, time_step: F) -> M:
            """The affine field C (columns: along x, y, z) of a moved point, one phase: as `turning` of the plane, with
            C (tr C - C) in place of its determinant, and without what is of third order."""
            c = M(x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])
            square = c * c
            trace = wp.trace(c)
            minors = F(0.5) * (trace * trace - wp.trace(square))
            divided = F(1.0) / (F(1.0) + time_step * (larger(trace, F(0.0)) + time_step * larger(minors, F(0.0))))
            result = divided * c
            if minors > F(0.0):
                result += (divided * time_step) * (trace * c - square)
            return result

        @wp.func
        def column_of(c: M, k: wp.int32) -> X:
            return X(c[0, k], c[1, k], c[2, k])

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
            second = first + parameters.layer
            third = second + parameters.layer
            front, front_x, front_y = gained_around(grid, first, wx, wy, parameters)
            middle, middle_x, middle_y = gained_around(grid, second, wx, wy, parameters)
            back, back_x, back_y = gained_around(grid, third, wx, wy, parameters)
            increment, gain_z = line(wz, front, middle, back)
            gain_x = wz[0] * front_x + wz[1] * middle_x + wz[2] * back_x - (wx[2] - wx[0]) * increment
            gain_y = wz[0] * front_y + wz[1] * middle_y + wz[2] * back_y - (wy[2] - wy[0]) * increment
            gain_z -= (wz[2] - wz[0]) * increment

            per_moment = F(4.0) * parameters.inverse_spacing
            share = kept(time_step, parameters)
            x = share * read(points.affine_x, p) + per_moment * gain_x
            y = share * read(points.affine_y, p) + per_moment * gain_y
            z = share * read(points.affine_z, p) + per_moment * gain_z
            solid = turned(solid_of(x), solid_of(y), solid_of(z), time_step)
            liquid = solid
            if TWO_PHASE:
                liquid = turned(liquid_of(x), liquid_of(y), liquid_of(z), time_step)
            write(points.affine_x, p, of_phases(column_of(solid, 0), column_of(liquid, 0)))
            write(points.affine_y, p, of_phases(column_of(solid, 1), column_of(liquid, 1)))
            write(points.affine_z, p, of_phases(column_of(solid, 2), column_of(liquid, 2)))

            return gain(points, p, increment, smooth, share, time_step, parameters)

        return super().functions(types, tools) | {
            "start": start,
            "start_across": affine["start_across"],
            "column": column,
            "deposit": deposit,
            "collect": collect,
            "collect_in_space": collect_in_space,
            "halt": affine["halt"],
        }
