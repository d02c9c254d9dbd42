"""Elementary operations in the form that a compiler can turn into vector instructions.

A loop over the points is vectorised when its addresses are plain multiples of the index and nothing that it writes
could change them. Warp's own `array[p]` lets a negative index count from the end, and writes a vector as one block of
bytes, which might be anything; both stand in the way. So nothing is checked here: arrays are contiguous, and an index
lies within them because `advect` keeps every point that is inside two cells away from the edges of the grid. The build
for debugging (`build.CHECKED`) checks it: `assert` is nothing in any other.

Tried with Warp 1.19, on whose C++ types (`array_t::data`, `vec_t::c`) the native lines rest.
"""

from types import SimpleNamespace

import warp as wp


def make_elementary(types: SimpleNamespace) -> SimpleNamespace:
    """Build `read(array, p)`, `write(array, p, value)`, `add(array, p, value)` (atomic on a GPU), `larger(a, b)` and
    `smaller(a, b)`. In an array of two dimensions p counts through, row by row."""
    F = types.scalar
    forms = {number: ("array.data[p] = value;", "wp::atomic_add(&array.data[p], value);") for number in (F, wp.int32)}
    for vector in (types.V2, types.V4, types.V, types.S, types.P):
        each = f"for (int k = 0; k < {vector._length_}; ++k) "
        forms[vector] = (
            each + "array.data[p].c[k] = value.c[k];",
            each + "wp::atomic_add(&array.data[p].c[k], value.c[k]);",
        )

    # In C++ an array of one dimension and one of two are of the same type.
    within = "assert(p >= 0 && p < array.shape[0] * (array.ndim == 2 ? array.shape[1] : 1)); "

    # Each round adds an overload.
    for element, (written, added) in forms.items():
        for dimensions in (1, 2):
            stored = wp.array(dtype=element, ndim=dimensions)

            @wp.func_native(within + "return array.data[p];")
            def read(array: stored, p: wp.int32) -> element: ...

            @wp.func_native(within + written)
            def write(array: stored, p: wp.int32, value: element): ...

            @wp.func_native(within + added)
            def add(array: stored, p: wp.int32, value: element): ...

    # One instruction each, where wp.max and wp.min take five to order NaN.
    for number in dict.fromkeys((F, wp.float64)):

        @wp.func
        def larger(a: number, b: number) -> number:
            return wp.where(a > b, a, b)

        @wp.func
        def smaller(a: number, b: number) -> number:
            return wp.where(a < b, a, b)

    return SimpleNamespace(read=read, write=write, add=add, larger=larger, smaller=smaller)
