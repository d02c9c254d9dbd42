"""What a transfer scheme is: everything that scatter, nodes and gather must be told of it, in one object."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from warp_mpm.schema import Model

from ..launch import Launch
from ..point_field import PointField

Array = NDArray[np.float64]


class Scheme:
    """A way of bringing velocities from the points to the nodes and back.

    `types` below holds the scalar type, the vectors X (a place; V2 in the plane) and V (all velocities at a place) and
    the structures Points, Grid and Parameters; `tools` the functions `read(array, p)`, `write(array, p, value)`,
    `add(array, p, value)`, `larger`, `smaller`, `weights(f)`, `slopes(f)` and `cell_of(x, shift, parameters)`, and
    those of `kernels.vectors`.
    """

    name: ClassVar[str]
    """In the scenario: `numerics.transfer`."""
    title: ClassVar[str]
    """What it is, in a clause, with its source."""
    settings: ClassVar[type[Model]] = Model
    """Its fields in `numerics`, each with a default, limits and a docstring."""
    point_fields: ClassVar[Mapping[str, PointField]] = {}
    """What a point stores for it."""
    dimensions: ClassVar[tuple[int, ...]] = (2,)
    """In how many it works: 3 too, where its functions do (`types.X` in place of `types.V2`)."""
    point_fields_in_space: ClassVar[Mapping[str, PointField]] = {}
    """What a point stores for it besides in space."""
    grid_fields: ClassVar[Mapping[str, str]] = {}
    """What a node stores for it: kinds as of a `PointField`."""
    constants: ClassVar[tuple[str, ...]] = ()
    """Numbers that its functions read from the parameters."""
    keeps_affine_field: ClassVar[bool] = False
    """Whether a point alone on its nodes keeps its rate of strain from step to step, which makes it more stable
    (`time_step.lone_point_courant_number`)."""

    def numbers(self, numerics: Any, *, sound_speed: float, flow_speed: float) -> dict[str, float]:
        """Values of `constants`.

        Args:
            numerics: of the scenario, with the fields of `settings`.
            sound_speed: in the material as a whole [m/s].
            flow_speed: at the start [m/s].
        """
        return {}

    def fitted(self, places: Array, spacing: float, masses: Array, velocities: Array) -> dict[str, Array]:
        """What its point fields must be where velocities of the points are given, by name (default: nothing).

        Args:
            places: of N points, in cells from the grid's lower left corner [N, 2].
            spacing: of the grid [m].
            masses: of the solid at the points [N] [kg/m].
            velocities: of each phase [N, 2] or [N, 4] [m/s].
        """
        return {}

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        """Its functions for the common kernels. Needed are

        - `start(points, p, masses: V, gravity: V, time_step, parameters) -> V, V, V`: momentum of a point, and by how
          much that changes from one node to the next along x and along y;
        - `force_share(time_step)`: what the force on the nodes is multiplied by before it is spread, and
          `impulse_share(time_step)`: what such a force must be multiplied by to be the impulse of the step;
        - `column(w, d, to, momentum, force_x, change_x) -> V`: the point's share in a column of nodes, with the weight
          and its slope along x and the way to the column in cells;
        - `deposit(grid, node, w, d, to, column, change, force, slope)`: the share of a node in that, with weight, slope
          and way along y; `change` and `force` of the column, `slope` the force along y, each times the column's weight
          or slope;
        - `collect(points, p, grid, first, wx, wy, smooth, lean_x, lean_y, time_step, parameters) -> V`: writes the
          point's velocity and returns it. `first` is the lowest of its nodes, `smooth` the nodes' velocity at the
          point, `lean_x` and `lean_y` its first moments about the point, in cells.

        and, unless the default does,

        - `clear(grid, i, j)`: empties the scheme's own fields at a node (default: it has none);
        - `free_velocity(grid, i, j, inverse: V, gravity: V, time_step) -> V`: velocity at the end of the step without
          drag and contact, `inverse` being 1 over each phase's mass (default: the momentum has it all);
        - `keep(grid, i, j, old: V, new: V, time_step, parameters)`: velocities before and after (default: forgotten);
        - `receive(grid, i, j, change: V)`: what contact changes (default: nothing beside the velocity);
        - `displacement(points, p, grid, x, shift, time_step, parameters) -> X`: of a point in the step (default: with
          the solid's velocity);
        - `halt(points, p)`: empties its point fields where the velocity is given anew (default: it has none to empty).

        In space, where `dimensions` has 3, the part along z comes first, by `column` again, and needed are

        - `start_across(points, p, masses: V, parameters) -> V`: by how much the momentum changes from one node to the
          next along z (default: not at all);
        - `collect_in_space(points, p, grid, first, wx, wy, wz, smooth, lean_x, lean_y, lean_z, time_step, parameters)
          -> V`: as `collect`.
        """
        raise NotImplementedError

    def kernels(self, types: SimpleNamespace, tools: SimpleNamespace, module: str) -> dict[str, Any]:
        """Kernels of its own, by name."""
        return {}

    def launches(self) -> tuple[tuple[str, Launch], ...]:
        """Launches of these, each with the name of the kernel after which it comes."""
        return ()


def all_functions(scheme: Scheme, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
    """The functions of a scheme, defaults filled in."""
    import warp as wp

    F, V, X = types.scalar, types.V, types.X
    Points, Grid, Parameters = types.Points, types.Grid, types.Parameters
    read, solid_of = tools.read, tools.solid_of

    @wp.func
    def clear(grid: Grid, i: wp.int32, j: wp.int32):
        pass

    @wp.func
    def free_velocity(grid: Grid, i: wp.int32, j: wp.int32, inverse: V, gravity: V, time_step: F) -> V:
        return wp.cw_mul(inverse, grid.velocity[i, j])

    @wp.func
    def keep(grid: Grid, i: wp.int32, j: wp.int32, old: V, new: V, time_step: F, parameters: Parameters):
        pass

    @wp.func
    def receive(grid: Grid, i: wp.int32, j: wp.int32, change: V):
        pass

    @wp.func
    def displacement(
        points: Points, p: wp.int32, grid: Grid, x: X, shift: F, time_step: F, parameters: Parameters
    ) -> X:
        return time_step * solid_of(read(points.velocity, p))

    @wp.func
    def start_across(points: Points, p: wp.int32, masses: V, parameters: Parameters) -> V:
        return V()

    @wp.func
    def halt(points: Points, p: wp.int32):
        pass

    defaults = {
        "clear": clear,
        "free_velocity": free_velocity,
        "keep": keep,
        "receive": receive,
        "displacement": displacement,
        "halt": halt,
        "start_across": start_across,
        "collect_in_space": None,
    }
    own = scheme.functions(types, tools)
    return defaults | own | {"receives": "receive" in own}
