"""Vectors of space in compiled code: tuples with a component for each dimension.

A component is a number or a `Vec` of `sph.simd`, and operations apply to each component. The number
of dimensions is the length of `dim`, a constant for the compiler; no loop remains.
"""

from numba import types
from numba.core import cgutils

from sph.compiled import instruction
from sph.simd.compaction import picked
from sph.simd.lanes import summed
from sph.simd.memory import address, lanes_at, put_lanes
from sph.simd.types import (
    FAST,
    FASTEST,
    Vec,
    as_vector,
    call,
    llvm_type,
    vector_type,
)


def components(context, builder, kind, value, wanted):
    """Return the components of a tuple as values of the type `wanted`."""
    found = cgutils.unpack_tuple(builder, value)
    kinds = list(kind)
    if isinstance(wanted, Vec):
        return [
            as_vector(context, builder, one, each, wanted)
            for one, each in zip(found, kinds, strict=True)
        ]
    return [
        context.cast(builder, one, each, wanted) for one, each in zip(found, kinds, strict=True)
    ]


def common(*kinds):
    """Return the type of the components of a result: vectors if one operand has vectors."""
    parts = [one.dtype if isinstance(one, types.UniTuple) else one for one in kinds]
    return next((one for one in parts if isinstance(one, Vec)), types.float64)


def element(context, builder, array_type, array, *index):
    """Return the address of an element; index: numbers or LLVM integers."""
    pair = types.UniTuple(types.intp, len(index))
    parts = [
        context.get_constant(types.intp, one) if isinstance(one, int) else one for one in index
    ]
    return address(
        context, builder, array_type, array, pair, context.make_tuple(builder, pair, parts)
    )


def integer_plus(context, builder, value, kind, more=0):
    """Return a number as an LLVM integer, plus a constant."""
    number = context.cast(builder, value, kind, types.intp)
    return builder.add(number, context.get_constant(types.intp, more))


@instruction
def at(typing_context, dim, field, i):
    """Return field[:, i] of an array (D, N)."""
    result = types.UniTuple(field.dtype, len(dim))

    def generate(context, builder, sig, arguments):
        _, array, i = arguments
        i = integer_plus(context, builder, i, sig.args[2])
        parts = [
            builder.load(element(context, builder, sig.args[1], array, d, i))
            for d in range(len(dim))
        ]
        return context.make_tuple(builder, result, parts)

    return result(dim, field, i), generate


def _row_reader(of_width):
    """A function that reads lanes of a vector from the rows row, row + 1, … of an array."""

    @instruction
    def read(typing_context, lanes, dim, array, row, k):
        kind = vector_type(lanes.instance_class.kind, of_width(lanes.instance_class))
        result = types.UniTuple(kind, len(dim))

        def generate(context, builder, sig, arguments):
            _, _, array, row, k = arguments
            k = integer_plus(context, builder, k, sig.args[4])
            parts = []
            for d in range(len(dim)):
                one = integer_plus(context, builder, row, sig.args[3], d)
                place = element(context, builder, sig.args[2], array, one, k)
                parts.append(lanes_at(builder, place, kind))
            return context.make_tuple(builder, result, parts)

        return result(lanes, dim, array, row, k), generate

    return read


load_spatial = _row_reader(lambda lanes: lanes.width)
load_rows = _row_reader(lambda lanes: lanes.block_width)


@instruction
def corner(typing_context, dim, corners, block, first):
    """Return corners[block, first:first + D] of an array."""
    result = types.UniTuple(types.float64, len(dim))

    def generate(context, builder, sig, arguments):
        _, array, block, first = arguments
        block = integer_plus(context, builder, block, sig.args[2])
        parts = []
        for d in range(len(dim)):
            column = integer_plus(context, builder, first, sig.args[3], d)
            place = element(context, builder, sig.args[1], array, block, column)
            parts.append(builder.load(place))
        return context.make_tuple(builder, result, parts)

    return result(dim, corners, block, first), generate


@instruction
def zeros(typing_context, lanes, dim):
    """Return a vector of space whose components are zero in every lane."""
    kind = vector_type(lanes.instance_class.kind, lanes.instance_class.width)
    result = types.UniTuple(kind, len(dim))

    def generate(context, builder, sig, arguments):
        zero = cgutils.get_null_value(llvm_type(kind))
        return context.make_tuple(builder, result, [zero] * len(dim))

    return result(lanes, dim), generate


def _componentwise(emit):
    """Define f(a, b) for two vectors of space, or one and a factor."""

    @instruction
    def operation(typing_context, a, b):
        kind = common(a, b)
        size = len(a) if isinstance(a, types.BaseTuple) else len(b)
        result = types.UniTuple(kind, size)

        def generate(context, builder, sig, arguments):
            pairs = []
            for one, value in zip(sig.args, arguments, strict=True):
                if isinstance(one, types.BaseTuple):
                    pairs.append(components(context, builder, one, value, kind))
                else:
                    same = (
                        as_vector(context, builder, value, one, kind)
                        if isinstance(kind, Vec)
                        else context.cast(builder, value, one, kind)
                    )
                    pairs.append([same] * size)
            parts = [emit(builder, kind, x, y) for x, y in zip(*pairs, strict=True)]
            return context.make_tuple(builder, result, parts)

        return result(a, b), generate

    return operation


plus = _componentwise(lambda builder, kind, a, b: builder.fadd(a, b, flags=FAST))
minus = _componentwise(lambda builder, kind, a, b: builder.fsub(a, b, flags=FAST))
times = _componentwise(lambda builder, kind, a, b: builder.fmul(a, b, flags=FAST))


larger_each = _componentwise(
    lambda builder, kind, a, b: call(builder, "llvm.maxnum", kind, a.type, (a, b), FASTEST)
)


@instruction
def dot(typing_context, a, b):
    """Return the scalar product of two vectors of space."""
    kind = common(a, b)

    def generate(context, builder, sig, arguments):
        x = components(context, builder, sig.args[0], arguments[0], kind)
        y = components(context, builder, sig.args[1], arguments[1], kind)
        total = None
        for one, other in zip(x, y, strict=True):
            product = builder.fmul(one, other, flags=FAST)
            total = product if total is None else builder.fadd(total, product, flags=FAST)
        return total

    return kind(a, b), generate


@instruction
def cross(typing_context, a, b):
    """Return the cross product: 3 components in 3-D, the component normal to the plane in 2-D."""
    kind = common(a, b)
    result = types.UniTuple(kind, 3 if len(a) == 3 else 1)

    def generate(context, builder, sig, arguments):
        x = components(context, builder, sig.args[0], arguments[0], kind)
        y = components(context, builder, sig.args[1], arguments[1], kind)

        def minor(i, j):
            first = builder.fmul(x[i], y[j], flags=FAST)
            second = builder.fmul(x[j], y[i], flags=FAST)
            return builder.fsub(first, second, flags=FAST)

        axes = [(1, 2), (2, 0), (0, 1)] if len(x) == 3 else [(0, 1)]
        return context.make_tuple(builder, result, [minor(i, j) for i, j in axes])

    return result(a, b), generate


@instruction
def lane_sums(typing_context, a):
    """Return the sums over all lanes of each component, in double precision."""
    result = types.UniTuple(types.float64, len(a))

    def generate(context, builder, sig, arguments):
        parts = cgutils.unpack_tuple(builder, arguments[0])
        return context.make_tuple(
            builder, result, [summed(context, builder, a.dtype, one) for one in parts]
        )

    return result(a), generate


@instruction
def put(typing_context, field, i, a):
    """Set field[:, i] of an array (D, N)."""

    def generate(context, builder, sig, arguments):
        array, i, value = arguments
        i = integer_plus(context, builder, i, sig.args[1])
        for d, one in enumerate(cgutils.unpack_tuple(builder, value)):
            builder.store(one, element(context, builder, sig.args[0], array, d, i))
        return context.get_dummy_value()

    return types.void(field, i, a), generate


@instruction
def curl_dim(typing_context, dim):
    """Return a tuple with as many entries as the cross product has components."""
    result = types.UniTuple(types.intp, 3 if len(dim) == 3 else 1)

    def generate(context, builder, sig, arguments):
        zero = context.get_constant(types.intp, 0)
        return context.make_tuple(builder, result, [zero] * len(result))

    return result(dim), generate


@instruction
def pick_spatial(typing_context, a, lanes):
    """Apply `sph.simd.pick` to each component."""
    return a(a, lanes), lambda context, builder, sig, arguments: context.make_tuple(
        builder,
        a,
        [
            picked(builder, a.dtype, one, lanes, arguments[1])
            for one in cgutils.unpack_tuple(builder, arguments[0])
        ],
    )


@instruction
def store_spatial(typing_context, array, row, k, a):
    """Write the lanes of each component to the rows row, row + 1, … of a scratch array."""

    def generate(context, builder, sig, arguments):
        array, row, k, value = arguments
        k = integer_plus(context, builder, k, sig.args[2])
        for d, part in enumerate(cgutils.unpack_tuple(builder, value)):
            one = integer_plus(context, builder, row, sig.args[1], d)
            put_lanes(builder, part, element(context, builder, sig.args[0], array, one, k), a.dtype)
        return context.get_dummy_value()

    return types.void(array, row, k, a), generate
