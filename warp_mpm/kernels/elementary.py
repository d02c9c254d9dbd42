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
    """Build `read(array, p)`, `write(array, p, value)`, `add(array, p, value)` (atomic on a GPU), `larger(a, b)`,
    `smaller(a, b)`, `logarithm(x)` and `exponential(x)`; of the same types once. In an array of two dimensions p counts
    through, row by row."""
    if not hasattr(types, "elementary"):
        types.elementary = _make(types)
    return types.elementary


def _make(types: SimpleNamespace) -> SimpleNamespace:
    F = types.scalar
    forms = {number: ("array.data[p] = value;", "wp::atomic_add(&array.data[p], value);") for number in (F, wp.int32)}
    vectors = (types.V2, types.V4, types.V, types.S, types.P, types.X, types.T, types.G)
    for vector in (*vectors, types.M) if types.told else vectors:
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

    # Those of the mathematical library are calls, and no loop with a call is vectorised. To 3e-16.
    @wp.func_native("""
        // x = 2^k m with m from sqrt(1/2) to sqrt(2); ln m = 2 artanh((m - 1) / (m + 1)). x must be normal, above zero.
        union { double number; unsigned long long bits; } whole, power, part;
        whole.number = x;
        power.bits = (whole.bits >> 52) | 0x4330000000000000ull;  // 2^52 + exponent
        part.bits = (whole.bits & 0x000fffffffffffffull) | 0x3ff0000000000000ull;
        double k = power.number - 4503599627371519.0;
        double m = part.number;
        bool high = m > 1.4142135623730951;
        k = high ? k + 1.0 : k;
        m = high ? 0.5 * m : m;
        double t = (m - 1.0) / (m + 1.0);
        double q = t * t;
        double tail = 1.0 / 17.0 + q * (1.0 / 19.0 + q * (1.0 / 21.0));
        tail = 1.0 / 11.0 + q * (1.0 / 13.0 + q * (1.0 / 15.0 + q * tail));
        tail = 1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q * tail)));
        return k * 0.69314718055994531 + 2.0 * (t + t * q * tail);
    """)
    def logarithm(x: wp.float64) -> wp.float64: ...

    @wp.func_native("""
        // 2^k times the series of the rest, which is at most ln 2 / 2. Beyond +-700: as there.
        x = x > 700.0 ? 700.0 : (x < -700.0 ? -700.0 : x);
        union { double number; unsigned long long bits; } power;
        double rounded = x * 1.4426950408889634 + 6755399441055744.0;  // the nearest whole number in its last bits
        double k = rounded - 6755399441055744.0;
        power.number = rounded;
        power.bits = (power.bits + 1023ull) << 52;
        double r = x - k * 0.693147180369123816490;
        r = r - k * 1.90821492927058770002e-10;
        double tail = 1.0 / 3628800.0 + r * (1.0 / 39916800.0 + r * (1.0 / 479001600.0 + r * (1.0 / 6227020800.0)));
        tail = 1.0 / 5040.0 + r * (1.0 / 40320.0 + r * (1.0 / 362880.0 + r * tail));
        tail = 1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * tail));
        return power.number * (1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * tail))));
    """)
    def exponential(x: wp.float64) -> wp.float64: ...

    return SimpleNamespace(
        read=read,
        write=write,
        add=add,
        larger=larger,
        smaller=smaller,
        logarithm=logarithm,
        exponential=exponential,
    )
