"""Tensors in compiled code: tuples with a number or a `Vec` for each component.

A symmetric tensor has the D(D + 1)/2 components of its upper triangle, row by row. A full tensor
has D^2 components, row by row. Functions of `sph.simd.spatial` that work on each component (plus,
minus, times, lane_sums, load_spatial) work on tensors too.
"""

from numba import types

from sph.compiled import instruction
from sph.simd.spatial import common, components, element, integer_plus
from sph.simd.types import FAST


def upper(dimension: int) -> list[tuple[int, int]]:
    """Return the indices (a, b) of the components of a symmetric tensor, in order."""
    return [(a, b) for a in range(dimension) for b in range(a, dimension)]


def _sizes(of):
    """An instruction that returns a tuple of zeros with of(D) entries."""

    @instruction
    def sized(typing_context, dim):
        result = types.UniTuple(types.intp, of(len(dim)))

        def generate(context, builder, sig, arguments):
            zero = context.get_constant(types.intp, 0)
            return context.make_tuple(builder, result, [zero] * len(result))

        return result(dim), generate

    return sized


# tuples as long as a symmetric and a full tensor, to be passed in place of `dim`
symmetric_dim = _sizes(lambda dimension: dimension * (dimension + 1) // 2)
full_dim = _sizes(lambda dimension: dimension * dimension)


@instruction
def symmetric_at(typing_context, dim, field, i):
    """Return the upper triangle of field[:, :, i] of an array (D, D, N)."""
    places = upper(len(dim))
    result = types.UniTuple(field.dtype, len(places))

    def generate(context, builder, sig, arguments):
        _, array, i = arguments
        i = integer_plus(context, builder, i, sig.args[2])
        parts = [
            builder.load(element(context, builder, sig.args[1], array, a, b, i)) for a, b in places
        ]
        return context.make_tuple(builder, result, parts)

    return result(dim, field, i), generate


def _product(builder, x, y):
    return builder.fmul(x, y, flags=FAST)


def _total(builder, parts):
    total = parts[0]
    for one in parts[1:]:
        total = builder.fadd(total, one, flags=FAST)
    return total


@instruction
def symmetric_times(typing_context, tensor, a):
    """Return the product of a symmetric tensor and a vector of space."""
    kind, size = common(tensor, a), len(a)
    result = types.UniTuple(kind, size)
    row = {place: k for k, place in enumerate(upper(size))}

    def generate(context, builder, sig, arguments):
        s = components(context, builder, sig.args[0], arguments[0], kind)
        x = components(context, builder, sig.args[1], arguments[1], kind)
        parts = [
            _total(
                builder,
                [_product(builder, s[row[min(p, q), max(p, q)]], x[q]) for q in range(size)],
            )
            for p in range(size)
        ]
        return context.make_tuple(builder, result, parts)

    return result(tensor, a), generate


def _outer(places_of):
    """An instruction that returns components a_p b_q for the places (p, q)."""

    @instruction
    def products(typing_context, a, b):
        kind, places = common(a, b), places_of(len(a))
        result = types.UniTuple(kind, len(places))

        def generate(context, builder, sig, arguments):
            x = components(context, builder, sig.args[0], arguments[0], kind)
            y = components(context, builder, sig.args[1], arguments[1], kind)
            return context.make_tuple(
                builder, result, [_product(builder, x[p], y[q]) for p, q in places]
            )

        return result(a, b), generate

    return products


outer = _outer(lambda size: [(p, q) for p in range(size) for q in range(size)])
symmetric_outer = _outer(upper)
