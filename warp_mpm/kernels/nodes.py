"""What nodes and corners do by themselves around the transfer: they are emptied, and sums become means."""

from types import SimpleNamespace

import warp as wp

from .elementary import make_elementary
from .layout import BLOCK
from .told import next_to_nil


def make_nodes(types: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build the kernels `clear` and `average` (workers on the blocks in use) and `forget`."""
    effects = types.effects
    F, V, X, S = types.scalar, types.V, types.X, types.S
    Grid, Parameters = types.Grid, types.Parameters
    elementary = make_elementary(types)
    read, write, larger, smaller = elementary.read, elementary.write, elementary.larger, elementary.smaller
    empty = types.scheme.clear
    CORNERS = effects.smoothing_grid
    DENSITY = effects.density_correction
    LIQUID_ALONE = effects.liquid_alone
    DRAG, BEYOND, TOLD, PARTLY_DRY = (
        name in types.grid_fields for name in ("drag", "drag_beyond", "told", "corner_wet")
    )
    UNLIKE, GAIN = "pore_impulse" in types.grid_fields, "filling_gain" in types.grid_fields
    NEXT_TO_NIL = next_to_nil(types)
    M = types.M

    @wp.kernel(module=module)
    def clear(grid: Grid, parameters: Parameters):
        """Empty the nodes of the blocks that were in use. A block's mark is its place in the list of active blocks,
        counted from one; zero when it is not in use."""
        worker = wp.tid()
        for s in range(worker, grid.active_count[0] * wp.static(BLOCK), parameters.workers):
            block = grid.active[s / wp.static(BLOCK)]
            bi = block / parameters.block_rows
            bj = block - bi * parameters.block_rows
            i = bi * wp.static(BLOCK) + s % wp.static(BLOCK)
            grid.block[bi, bj] = 0
            if TOLD:
                if grid.telling[bi, bj] == 1:
                    for b in range(wp.static(BLOCK)):
                        grid.told[i, bj * wp.static(BLOCK) + b] = M()
            if PARTLY_DRY:  # for itself: of more arrays at a time the compiler makes no vector instructions
                for b in range(wp.static(BLOCK)):
                    grid.corner_wet[i, bj * wp.static(BLOCK) + b] = F(0.0)
            for b in range(wp.static(BLOCK)):
                j = bj * wp.static(BLOCK) + b
                if UNLIKE:
                    grid.pore_impulse[i, j] = V()
                if GAIN:
                    grid.filling_gain[i, j] = X()
                grid.mass[i, j] = F(0.0)
                grid.velocity[i, j] = V()
                empty(grid, i, j)
                if LIQUID_ALONE:
                    grid.liquid_alone[i, j] = X()
                if DRAG:
                    grid.drag[i, j] = F(0.0)
                if BEYOND:
                    grid.drag_beyond[i, j] = F(0.0)
                if CORNERS:
                    grid.corner[i, j] = S()

    @wp.kernel(module=module)
    def forget(grid: Grid):
        """Forget the list of active blocks, once they are empty."""
        grid.active_count[0] = 0

    kernels = SimpleNamespace(clear=clear, forget=forget)

    if CORNERS:

        @wp.kernel(module=module)
        def average(grid: Grid, parameters: Parameters):
            """Turn the corners' sums into means, and their volume into the filling: its share of the room there."""
            worker = wp.tid()
            for s in range(worker, grid.active_count[0] * wp.static(BLOCK), parameters.workers):
                block = grid.active[s / wp.static(BLOCK)]
                bi = block / parameters.block_rows
                bj = block - bi * parameters.block_rows
                i = bi * wp.static(BLOCK) + s % wp.static(BLOCK)
                for b in range(wp.static(BLOCK)):
                    place = i * parameters.rows + bj * wp.static(BLOCK) + b
                    corner = read(grid.corner, place)
                    if corner[0] > F(0.0):
                        mean = (F(1.0) / corner[0]) * corner
                        filling = corner[0] * read(grid.corner_room, place)
                        if DENSITY:
                            # Up to one as everywhere; beyond one, crowding, which needs the room behind inclined faces.
                            filling = larger(smaller(filling, F(1.0)), corner[0] * read(grid.corner_space, place))
                        mean[0] = filling
                        if PARTLY_DRY:
                            # Means of the liquid over the points that have any.
                            wet = larger(corner[0] - read(grid.corner_wet, place), F(0.0))
                            if wet > F(wp.static(NEXT_TO_NIL)) * corner[0]:
                                for k in range(2, wp.static(S._length_)):
                                    mean[k] = corner[k] / wet
                            write(grid.corner_wet, place, wet * read(grid.corner_room, place))
                        write(grid.corner, place, mean)

        kernels.average = average

    return kernels
