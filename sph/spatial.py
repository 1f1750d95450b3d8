"""Vectors of space in compiled code: tuples with a component for each dimension.

A component is a number or a `Vec` of `sph.simd`, and operations apply to each component. The number
of dimensions is the length of `dim`, a constant for the compiler; no loop remains.
"""

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from sph.neighbours.order import BLOCK
from sph.simd import FAST, FASTEST, Vec, _as, _call, _llvm, _place, _vector, picked, summed


def _parts(context, builder, kind, value, wanted):
    """Return the components of a tuple as values of the type `wanted`."""
    found = cgutils.unpack_tuple(builder, value)
    kinds = list(kind)
    if isinstance(wanted, Vec):
        return [
            _as(context, builder, one, each, wanted) for one, each in zip(found, kinds, strict=True)
        ]
    return [
        context.cast(builder, one, each, wanted) for one, each in zip(found, kinds, strict=True)
    ]


def _common(*kinds):
    """Return the type of the components of a result: vectors if one operand has vectors."""
    parts = [one.dtype if isinstance(one, types.UniTuple) else one for one in kinds]
    return next((one for one in parts if isinstance(one, Vec)), types.float64)


def _tuple(context, builder, kind, parts):
    return context.make_tuple(builder, kind, parts)


@intrinsic
def at(typing_context, dim, field, i):
    """Return field[:, i] of an array (D, N)."""
    result = types.UniTuple(field.dtype, len(dim))

    def generate(context, builder, sig, arguments):
        _, array, index = arguments
        parts = []
        for d in range(len(dim)):
            pair = types.UniTuple(types.intp, 2)
            where = context.cast(builder, index, sig.args[2], types.intp)
            index_pair = context.make_tuple(
                builder, pair, [context.get_constant(types.intp, d), where]
            )
            parts.append(
                builder.load(_place(context, builder, sig.args[1], array, pair, index_pair))
            )
        return _tuple(context, builder, result, parts)

    return result(dim, field, i), generate


def _read(builder, place, kind, array):
    loaded = builder.load(builder.bitcast(place, _llvm(kind).as_pointer()))
    loaded.align = array.dtype.bitwidth // 8
    return loaded


def _row_reader(of_width):
    """A function that reads lanes of a vector from the rows row, row + 1, … of an array."""

    @intrinsic
    def read(typing_context, lanes, dim, array, row, k):
        kind = _vector(lanes.instance_class.kind, of_width(lanes.instance_class))
        result = types.UniTuple(kind, len(dim))

        def generate(context, builder, sig, arguments):
            _, _, array, row, k = arguments
            pair = types.UniTuple(types.intp, 2)
            row = context.cast(builder, row, sig.args[3], types.intp)
            k = context.cast(builder, k, sig.args[4], types.intp)
            parts = []
            for d in range(len(dim)):
                index = context.make_tuple(
                    builder, pair, [builder.add(row, context.get_constant(types.intp, d)), k]
                )
                place = _place(context, builder, sig.args[2], array, pair, index)
                parts.append(_read(builder, place, kind, sig.args[2]))
            return _tuple(context, builder, result, parts)

        return result(lanes, dim, array, row, k), generate

    return read


load_spatial = _row_reader(lambda lanes: lanes.width)
load_rows = _row_reader(lambda lanes: lanes.block_width)


@intrinsic
def load_column(typing_context, lanes, dim, array, begin):
    """Return lanes of a vector whose components are BLOCK numbers apart, from array[begin]."""
    kind = _vector(lanes.instance_class.kind, lanes.instance_class.block_width)
    result = types.UniTuple(kind, len(dim))

    def generate(context, builder, sig, arguments):
        _, _, array, begin = arguments
        parts = []
        for d in range(len(dim)):
            index = builder.add(
                context.cast(builder, begin, sig.args[3], types.intp),
                context.get_constant(types.intp, d * BLOCK),
            )
            place = _place(context, builder, sig.args[2], array, types.intp, index)
            parts.append(_read(builder, place, kind, sig.args[2]))
        return _tuple(context, builder, result, parts)

    return result(lanes, dim, array, begin), generate


@intrinsic
def move(typing_context, lanes, fields, copied, begin, chosen, near, k):
    """Write the `chosen` lanes of all quantities of a block to the columns of `near` from k.

    Quantity f of the block begins at copied[begin + f BLOCK], and has row f of `near`.
    """
    kind = _vector(lanes.instance_class.kind, lanes.instance_class.block_width)

    def generate(context, builder, sig, arguments):
        _, _, copied, begin, chosen, near, k = arguments
        kinds = sig.args
        begin = context.cast(builder, begin, kinds[3], types.intp)
        k = context.cast(builder, k, kinds[6], types.intp)
        pair = types.UniTuple(types.intp, 2)
        for f in range(len(fields)):
            index = builder.add(begin, context.get_constant(types.intp, f * BLOCK))
            place = _place(context, builder, kinds[2], copied, types.intp, index)
            value = picked(builder, kind, _read(builder, place, kind, kinds[2]), kinds[4], chosen)
            index = context.make_tuple(builder, pair, [context.get_constant(types.intp, f), k])
            place = _place(context, builder, kinds[5], near, pair, index)
            stored = builder.store(value, builder.bitcast(place, value.type.as_pointer()))
            stored.align = kinds[5].dtype.bitwidth // 8
        return context.get_dummy_value()

    return types.void(lanes, fields, copied, begin, chosen, near, k), generate


@intrinsic
def corner(typing_context, dim, corners, block, first):
    """Return corners[block, first:first + D] of an array."""
    result = types.UniTuple(types.float64, len(dim))

    def generate(context, builder, sig, arguments):
        _, array, block, first = arguments
        pair = types.UniTuple(types.intp, 2)
        block = context.cast(builder, block, sig.args[2], types.intp)
        first = context.cast(builder, first, sig.args[3], types.intp)
        parts = []
        for d in range(len(dim)):
            column = builder.add(first, context.get_constant(types.intp, d))
            index = context.make_tuple(builder, pair, [block, column])
            parts.append(builder.load(_place(context, builder, sig.args[1], array, pair, index)))
        return _tuple(context, builder, result, parts)

    return result(dim, corners, block, first), generate


@intrinsic
def zeros(typing_context, lanes, dim):
    """Return a vector of space whose components are zero in every lane."""
    kind = _vector(lanes.instance_class.kind, lanes.instance_class.width)
    result = types.UniTuple(kind, len(dim))

    def generate(context, builder, sig, arguments):
        zero = cgutils.get_null_value(_llvm(kind))
        return _tuple(context, builder, result, [zero] * len(dim))

    return result(lanes, dim), generate


def _componentwise(emit):
    """Define f(a, b) for two vectors of space, or one and a factor."""

    @intrinsic
    def operation(typing_context, a, b):
        kind = _common(a, b)
        size = len(a) if isinstance(a, types.BaseTuple) else len(b)
        result = types.UniTuple(kind, size)

        def generate(context, builder, sig, arguments):
            pairs = []
            for one, value in zip(sig.args, arguments, strict=True):
                if isinstance(one, types.BaseTuple):
                    pairs.append(_parts(context, builder, one, value, kind))
                else:
                    same = (
                        _as(context, builder, value, one, kind)
                        if isinstance(kind, Vec)
                        else context.cast(builder, value, one, kind)
                    )
                    pairs.append([same] * size)
            parts = [emit(builder, kind, x, y) for x, y in zip(*pairs, strict=True)]
            return _tuple(context, builder, result, parts)

        return result(a, b), generate

    return operation


plus = _componentwise(lambda builder, kind, a, b: builder.fadd(a, b, flags=FAST))
minus = _componentwise(lambda builder, kind, a, b: builder.fsub(a, b, flags=FAST))
times = _componentwise(lambda builder, kind, a, b: builder.fmul(a, b, flags=FAST))


larger_each = _componentwise(
    lambda builder, kind, a, b: _call(builder, "llvm.maxnum", kind, a.type, (a, b), FASTEST)
)


@intrinsic
def dot(typing_context, a, b):
    """Return the scalar product of two vectors of space."""
    kind = _common(a, b)

    def generate(context, builder, sig, arguments):
        x = _parts(context, builder, sig.args[0], arguments[0], kind)
        y = _parts(context, builder, sig.args[1], arguments[1], kind)
        total = None
        for one, other in zip(x, y, strict=True):
            product = builder.fmul(one, other, flags=FAST)
            total = product if total is None else builder.fadd(total, product, flags=FAST)
        return total

    return kind(a, b), generate


@intrinsic
def cross(typing_context, a, b):
    """Return the cross product: 3 components in 3-D, the component normal to the plane in 2-D."""
    kind = _common(a, b)
    result = types.UniTuple(kind, 3 if len(a) == 3 else 1)

    def generate(context, builder, sig, arguments):
        x = _parts(context, builder, sig.args[0], arguments[0], kind)
        y = _parts(context, builder, sig.args[1], arguments[1], kind)

        def minor(i, j):
            first = builder.fmul(x[i], y[j], flags=FAST)
            second = builder.fmul(x[j], y[i], flags=FAST)
            return builder.fsub(first, second, flags=FAST)

        axes = [(1, 2), (2, 0), (0, 1)] if len(x) == 3 else [(0, 1)]
        return _tuple(context, builder, result, [minor(i, j) for i, j in axes])

    return result(a, b), generate


@intrinsic
def lane_sums(typing_context, a):
    """Return the sums over all lanes of each component, in double precision."""
    result = types.UniTuple(types.float64, len(a))

    def generate(context, builder, sig, arguments):
        parts = cgutils.unpack_tuple(builder, arguments[0])
        return _tuple(
            context, builder, result, [summed(context, builder, a.dtype, one) for one in parts]
        )

    return result(a), generate


@intrinsic
def put(typing_context, field, i, a):
    """Set field[:, i] of an array (D, N)."""

    def generate(context, builder, sig, arguments):
        array, index, value = arguments
        pair = types.UniTuple(types.intp, 2)
        where = context.cast(builder, index, sig.args[1], types.intp)
        for d, one in enumerate(cgutils.unpack_tuple(builder, value)):
            index_pair = context.make_tuple(
                builder, pair, [context.get_constant(types.intp, d), where]
            )
            builder.store(one, _place(context, builder, sig.args[0], array, pair, index_pair))
        return context.get_dummy_value()

    return types.void(field, i, a), generate


@intrinsic
def curl_dim(typing_context, dim):
    """Return a tuple with as many entries as the cross product has components."""
    result = types.UniTuple(types.intp, 3 if len(dim) == 3 else 1)

    def generate(context, builder, sig, arguments):
        zero = context.get_constant(types.intp, 0)
        return _tuple(context, builder, result, [zero] * len(result))

    return result(dim), generate


@intrinsic
def pick_spatial(typing_context, a, lanes):
    """Apply `sph.simd.pick` to each component."""
    return a(a, lanes), lambda context, builder, sig, arguments: _tuple(
        context,
        builder,
        a,
        [
            picked(builder, a.dtype, one, lanes, arguments[1])
            for one in cgutils.unpack_tuple(builder, arguments[0])
        ],
    )


@intrinsic
def store_spatial(typing_context, array, row, k, a):
    """Write the lanes of each component to the rows row, row + 1, … of a scratch array."""

    def generate(context, builder, sig, arguments):
        array, row, k, value = arguments
        pair = types.UniTuple(types.intp, 2)
        row = context.cast(builder, row, sig.args[1], types.intp)
        k = context.cast(builder, k, sig.args[2], types.intp)
        for d, one in enumerate(cgutils.unpack_tuple(builder, value)):
            index = context.make_tuple(
                builder, pair, [builder.add(row, context.get_constant(types.intp, d)), k]
            )
            place = _place(context, builder, sig.args[0], array, pair, index)
            stored = builder.store(one, builder.bitcast(place, one.type.as_pointer()))
            stored.align = sig.args[0].dtype.bitwidth // 8
        return context.get_dummy_value()

    return types.void(array, row, k, a), generate
