"""Operations between lanes: filling, sums, extremes and counts."""

from llvmlite import ir
from numba import types

from sph.compiled import instruction
from sph.simd.types import (
    FASTEST,
    I64,
    KINDS,
    Mask,
    Vec,
    call,
    in_every_lane,
    integers,
    llvm_type,
    vector_type,
)


@instruction
def width(typing_context, lanes):
    """Return the number of lanes, a constant for the compiler."""
    number = lanes.instance_class.width
    return types.intp(lanes), lambda context, builder, sig, arguments: ir.Constant(I64, number)


@instruction
def block_width(typing_context, lanes):
    """Return the number of lanes in loops over the particles of a block."""
    number = lanes.instance_class.block_width
    return types.intp(lanes), lambda context, builder, sig, arguments: ir.Constant(I64, number)


def _filler(of_width):
    """A function that returns a vector with a number in every lane; it returns vectors as given."""

    @instruction
    def fill(typing_context, lanes, value):
        if isinstance(value, Vec):
            return value(lanes, value), lambda context, builder, sig, arguments: arguments[1]
        kind = vector_type(lanes.instance_class.kind, of_width(lanes.instance_class))

        def generate(context, builder, sig, arguments):
            base = lanes.instance_class.kind
            number = context.cast(builder, arguments[1], sig.args[1], base)
            return in_every_lane(builder, number, kind) if isinstance(kind, Vec) else number

        return kind(lanes, value), generate

    return fill


filled = _filler(lambda lanes: lanes.width)
filled_block = _filler(lambda lanes: lanes.block_width)


@instruction
def numbers_from(typing_context, lanes, first):
    """Return first, first + 1, … as integers, one in each lane of a block."""
    kind = vector_type(types.int32, lanes.instance_class.block_width)

    def generate(context, builder, sig, arguments):
        number = context.cast(builder, arguments[1], sig.args[1], types.int32)
        if not isinstance(kind, Vec):
            return number
        return builder.add(in_every_lane(builder, number, kind), integers(range(kind.width)))

    return kind(lanes, first), generate


def summed(context, builder, kind, value):
    """Return LLVM code for the sum of all lanes, in double precision."""
    if not isinstance(kind, Vec):
        return context.cast(builder, value, kind, types.float64)
    wide = Vec(types.float64, kind.width)
    if kind != wide:
        value = builder.fpext(value, llvm_type(wide))
    zero = ir.Constant(ir.DoubleType(), -0.0)
    return call(builder, "llvm.vector.reduce.fadd", wide, zero.type, (zero, value))


@instruction
def lane_sum(typing_context, x):
    """Return the sum of all lanes, in double precision."""
    return types.float64(x), lambda context, builder, sig, arguments: summed(
        context, builder, sig.args[0], arguments[0]
    )


@instruction
def lane_max(typing_context, x):
    """Return the largest lane, in double precision (undefined for NaN)."""

    def generate(context, builder, sig, arguments):
        kind, value = sig.args[0], arguments[0]
        base = kind
        if isinstance(kind, Vec):
            base = kind.kind
            value = call(builder, "llvm.vector.reduce.fmax", kind, KINDS[base], (value,), FASTEST)
        return context.cast(builder, value, base, types.float64)

    return types.float64(x), generate


@instruction
def count(typing_context, mask):
    """Return the number of true lanes."""

    def generate(context, builder, sig, arguments):
        if not isinstance(sig.args[0], Mask):
            return builder.zext(arguments[0], I64)
        bits = builder.bitcast(arguments[0], ir.IntType(sig.args[0].width))
        return builder.zext(builder.ctpop(bits), I64)

    return types.int64(mask), generate


@instruction
def any_lane(typing_context, mask):
    """Return 1 if a lane is true, otherwise 0."""

    def generate(context, builder, sig, arguments):
        value = arguments[0]
        if isinstance(sig.args[0], Mask):
            whole = ir.IntType(sig.args[0].width)
            bits = builder.bitcast(value, whole)
            value = builder.icmp_unsigned("!=", bits, ir.Constant(whole, 0))
        return builder.zext(value, I64)

    return types.int64(mask), generate
