"""Work of gravity on the liquid that moves through the skeleton, which is in no potential energy: see `theory.md`."""

from types import SimpleNamespace

import warp as wp

from .layout import BLOCK, SEEPAGE_POWER
from .told import make_told


def make_seepage(types: SimpleNamespace, vectors: SimpleNamespace, module: str) -> SimpleNamespace:
    """Build the kernel `seep` (workers on the blocks in use), for two phases."""
    F = types.scalar
    Grid = types.Grid
    Parameters = types.Parameters
    Book = types.Book
    X64 = types.X64
    MATERIALS = "liquid" in types.told
    ratio_of_liquid = make_told(types).ratio_of_liquid
    solid_of, liquid_of, wide = vectors.solid_of, vectors.liquid_of, vectors.wide

    @wp.kernel(module=module)
    def seep(grid: Grid, parameters: Parameters, book: Book):
        """Its rate at the end of the step [W/m]: g . sum m_L (v_L - v_S), over the nodes, which have all momentum."""
        worker = wp.tid()
        slip = X64()
        for s in range(worker, grid.active_count[0] * wp.static(BLOCK), parameters.workers):
            block = grid.active[s / wp.static(BLOCK)]
            bi = block / parameters.block_rows
            bj = block - bi * parameters.block_rows
            i = bi * wp.static(BLOCK) + s % wp.static(BLOCK)
            if MATERIALS:
                telling = grid.telling[bi, bj]
            for b in range(wp.static(BLOCK)):
                j = bj * wp.static(BLOCK) + b
                mass = grid.mass[i, j]
                if mass > F(0.0):
                    v = grid.velocity[i, j]
                    liquid = mass * parameters.liquid_ratio
                    if MATERIALS:
                        if telling == 1:
                            liquid = mass * ratio_of_liquid(grid.told[i, j] / mass, parameters)
                    slip += wide(liquid * (liquid_of(v) - solid_of(v)))
        wp.atomic_add(book.balance, wp.static(SEEPAGE_POWER), wp.dot(wide(parameters.gravity), slip))

    return SimpleNamespace(seep=seep)
