"""Sums over the nodes around a point, as vectors of the processor.

What a node keeps of both phases fills one of its vectors. Left to itself the compiler cuts them into single numbers as
soon as these go different ways afterwards, and holds all nodes at a time, for which there are too few registers: so
sums are formed here, column by column, in a type that it cannot cut.
"""

from types import SimpleNamespace
from typing import Any

import warp as wp


def lanes_of(vector: Any, scalar: Any) -> str:
    """C++ of a type `lanes` with the entries of a vector: sums of them, and products with a number that stands right.

    On a processor two or four are one vector of its own: left to itself the compiler cuts them into single numbers."""
    count = vector._length_
    number = "double" if scalar == wp.float64 else "float"
    sums = "".join(
        f"CUDA_CALLABLE lanes operator{sign}(const lanes& other) const {{ lanes result; "
        f"for (int k = 0; k < {count}; ++k) result.c[k] = c[k] {sign} other.c[k]; return result; }}\n"
        for sign in "+-"
    )
    struct = (
        f"lanes {{ {number} c[{count}];\n{sums}"
        f"CUDA_CALLABLE lanes operator*({number} by) const {{ lanes result; "
        f"for (int k = 0; k < {count}; ++k) result.c[k] = c[k] * by; return result; }} }};\n"
    )
    of_processor = f"struct __attribute__((may_alias)) {struct}"
    if count in (2, 4):
        size = f"vector_size({count} * sizeof({number})), aligned(sizeof({number}))"
        of_processor = f"typedef {number} lanes __attribute__(({size}, may_alias));\n"
    return f"\n#if defined(__CUDA_ARCH__)\nstruct {struct}#else\n{of_processor}#endif\n"


def make_around(types: SimpleNamespace) -> SimpleNamespace:
    """Build `nine(array, first, rows, x, y, x0, x1, x2, y0, y1, y2)` and `part(all, which)`.

    Of a field at the 3 x 3 nodes from `first` on, for a point at (x, y) in its cell and with the weights x0 ... along x
    and y0 ... along y: 0, its weighted mean; 1 and 2, its first moments about the middle node along x and y; 3 and 4,
    its slopes along them; moments and slopes in cells. What nobody takes a part of is not formed.
    """
    F, V = types.scalar, types.V
    lanes = lanes_of(V, F)
    number = "wp::float64" if F == wp.float64 else "wp::float32"
    count = V._length_
    All, field = wp.types.vector(5 * count, F), wp.array(dtype=V, ndim=2)

    @wp.func_native(f"""assert(first >= 0 && first + 2 * rows + 2 < array.shape[0] * array.shape[1]);{lanes}
        const lanes* at = (const lanes*)(array.data + first);
        lanes mean, lean_x, lean_y, slope_x, slope_y, before;
        for (int column = 0; column < 3; ++column, at += rows) {{
            lanes low = at[0], middle = at[1], high = at[2];
            lanes outer = high * y2;
            lanes of_column = low * y0 + middle * y1 + outer;
            lanes lean = outer - low * y0;
            lanes slope = (middle - low) * (1 - y) + (high - middle) * y;
            if (column == 0) {{
                mean = of_column * x0; lean_x = of_column * (-x0); lean_y = lean * x0; slope_y = slope * x0;
            }} else if (column == 1) {{
                mean = mean + of_column * x1; lean_y = lean_y + lean * x1; slope_y = slope_y + slope * x1;
                slope_x = (of_column - before) * (1 - x);
            }} else {{
                mean = mean + of_column * x2; lean_y = lean_y + lean * x2; slope_y = slope_y + slope * x2;
                lean_x = lean_x + of_column * x2; slope_x = slope_x + (of_column - before) * x;
            }}
            before = of_column;
        }}
        wp::vec_t<{5 * count}, {number}> result;
        lanes* of = (lanes*)&result;
        of[0] = mean; of[1] = lean_x; of[2] = lean_y; of[3] = slope_x; of[4] = slope_y;
        return result;
    """)
    def nine(
        array: field,
        first: wp.int32,
        rows: wp.int32,
        x: F,
        y: F,
        x0: F,
        x1: F,
        x2: F,
        y0: F,
        y1: F,
        y2: F,
    ) -> All: ...

    @wp.func_native(f"""{lanes}
        wp::vec_t<{count}, {number}> result;
        *(lanes*)&result = ((const lanes*)&all)[which];
        return result;
    """)
    def part(all: All, which: wp.int32) -> V: ...

    return SimpleNamespace(nine=nine, part=part)


def make_at_places(types: SimpleNamespace) -> SimpleNamespace:
    """Build the same of places that act on their nodes again and again in a step, with weights that are kept.

    - `weigh(masses, first, rows, layer, wx, wy, wz, weight, per_mass, e) -> V2`: sum N_i^2 / m_i and sum N_i over the
      nodes that have mass; keeps N_i in `weight`, and N_i / m_i in `per_mass`, 0 where there is no mass.
    - `rescale(weight, per_mass, e, by)`: both, times a number.
    - `seen(array, first, rows, layer, weight, e)`: sum of a field times the weights.
    - `give(array, first, rows, layer, per_mass, e, value)`: adds a value times N_i / m_i, at nodes with mass.

    Nodes are counted column by column, in space layer by layer; `layer` is how far those are apart.
    """
    F, V, X, V2, V3, W = types.scalar, types.V, types.X, types.V2, types.V3, types.W
    number = "double" if F == wp.float64 else "float"
    count = W._length_
    node = "(k / 9) * layer + (k / 3) % 3 * rows + k % 3"
    kept, scalars = wp.array(dtype=W), wp.array(dtype=F, ndim=2)
    across = " * wz.c[k / 9]" if count > 9 else ""

    @wp.func_native(f"""
        {number} inverse = 0, total = 0;
        {number}* ws = weight.data[e].c;
        {number}* shares = per_mass.data[e].c;
        for (int k = 0; k < {count}; ++k) {{
            {number} w = wx.c[(k / 3) % 3] * wy.c[k % 3]{across};
            {number} mass = masses.data[first + {node}];
            {number} share = mass > 0 ? w / mass : 0;
            ws[k] = w;
            shares[k] = share;
            inverse += w * share;
            total += share > 0 ? w : 0;
        }}
        return wp::vec_t<2, {number}>(inverse, total);
    """)
    def weigh(
        masses: scalars,
        first: wp.int32,
        rows: wp.int32,
        layer: wp.int32,
        wx: V3,
        wy: V3,
        wz: V3,
        weight: kept,
        per_mass: kept,
        e: wp.int32,
    ) -> V2: ...

    @wp.func_native(f"for (int k = 0; k < {count}; ++k) {{ weight.data[e].c[k] *= by; per_mass.data[e].c[k] *= by; }}")
    def rescale(weight: kept, per_mass: kept, e: wp.int32, by: F): ...

    # Each round adds an overload.
    for vector in dict.fromkeys((V, X)):
        field, lanes = wp.array(dtype=vector, ndim=2), lanes_of(vector, F)

        @wp.func_native(f"""{lanes}
            const lanes* at = (const lanes*)(array.data + first);
            const {number}* w = weight.data[e].c;
            lanes sum = at[0] * w[0] + at[1] * w[1] + at[2] * w[2];
            for (int k = 3; k < {count}; k += 3) {{
                const lanes* column = at + {node};
                sum = sum + (column[0] * w[k] + column[1] * w[k + 1] + column[2] * w[k + 2]);
            }}
            wp::vec_t<{vector._length_}, {number}> result;
            *(lanes*)&result = sum;
            return result;
        """)
        def seen(
            array: field, first: wp.int32, rows: wp.int32, layer: wp.int32, weight: kept, e: wp.int32
        ) -> vector: ...

        @wp.func_native(f"""{lanes}
            lanes* at = (lanes*)(array.data + first);
            const {number}* share = per_mass.data[e].c;
            const lanes given = *(const lanes*)&value;
            for (int k = 0; k < {count}; ++k) {{
                #if defined(__CUDA_ARCH__)
                if (share[k] == 0) continue;  // another thread may add to the node
                #endif
                at[{node}] = at[{node}] + given * share[k];
            }}
        """)
        def give(
            array: field,
            first: wp.int32,
            rows: wp.int32,
            layer: wp.int32,
            per_mass: kept,
            e: wp.int32,
            value: vector,
        ): ...

    return SimpleNamespace(weigh=weigh, rescale=rescale, seen=seen, give=give)
