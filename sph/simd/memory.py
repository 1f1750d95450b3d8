"""Reading and writing of lanes, and scratch arrays."""

from llvmlite import ir
from numba import types
from numba.core import cgutils

from sph.arrays import allocate
from sph.compiled import instruction
from sph.simd.types import (
    I32,
    I64,
    Vec,
    in_every_lane,
    integers,
    llvm_type,
    vector_type,
)


def address(context, builder, array_type, array, index_type, index):
    """Return the address of array[index]; index: a number, or a tuple of numbers."""
    if isinstance(index_type, types.BaseTuple):
        parts = cgutils.unpack_tuple(builder, index)
        kinds = list(index_type)  # type: ignore[call-overload]
    else:
        parts, kinds = [index], [index_type]
    parts = [
        context.cast(builder, one, kind, types.intp) for one, kind in zip(parts, kinds, strict=True)
    ]
    if array_type.layout != "C":  # lanes would be read from other elements without any error
        raise TypeError(f"{array_type}: expected an array in C order")
    view = context.make_array(array_type)(context, builder, array)
    return cgutils.get_item_pointer(context, builder, array_type, view, parts, wraparound=False)


def lanes_at(builder, place, kind):
    """Return LLVM code that reads a value of type `kind` at an address."""
    loaded = builder.load(builder.bitcast(place, llvm_type(kind).as_pointer()))
    loaded.align = _bytes(kind)
    return loaded


def put_lanes(builder, value, place, kind):
    """Emit LLVM code that writes a value of type `kind` to an address."""
    stored = builder.store(value, builder.bitcast(place, value.type.as_pointer()))
    stored.align = _bytes(kind)


def _bytes(kind):
    """Return the size of a number of a type: vectors need not be aligned to more."""
    return (kind.kind if isinstance(kind, Vec) else kind).bitwidth // 8


def _reader(of_width):
    """A function that reads lanes from an array; of_width(lanes) is their number."""

    @instruction
    def read(typing_context, lanes, array, index):
        kind = vector_type(array.dtype, of_width(lanes.instance_class))

        def generate(context, builder, sig, arguments):
            _, array, index = arguments
            place = address(context, builder, sig.args[1], array, sig.args[2], index)
            return lanes_at(builder, place, kind)

        return kind(lanes, array, index), generate

    return read


load = _reader(lambda lanes: lanes.width)
load_block = _reader(lambda lanes: lanes.block_width)


@instruction
def store(typing_context, array, index, x):
    """Write the lanes of x to array[index], array[index + 1], …, in the array's precision."""

    def generate(context, builder, sig, arguments):
        array, index, value = arguments
        place = address(context, builder, sig.args[0], array, sig.args[1], index)
        kind, base = sig.args[2], sig.args[0].dtype
        if not isinstance(kind, Vec):
            value = context.cast(builder, value, kind, base)
        elif kind.kind == types.float64 and base == types.float32:
            value = builder.fptrunc(value, llvm_type(Vec(base, kind.width)))
        put_lanes(builder, value, place, base)
        return context.get_dummy_value()

    return types.void(array, index, x), generate


@instruction
def load_inside(typing_context, lanes, array, index, inside, fill):
    """Return as many lanes as in a block from a float64 array, in double precision.

    inside: number of lanes that are inside the array; `fill` in the others.
    """
    width = lanes.instance_class.block_width
    result = vector_type(types.float64, width)

    def generate(context, builder, sig, arguments):
        _, array, index, inside, fill = arguments
        kinds = sig.args
        place = address(context, builder, kinds[1], array, kinds[2], index)
        inside = context.cast(builder, inside, kinds[3], types.int64)
        fill = context.cast(builder, fill, kinds[4], types.float64)
        if width == 1:
            there = builder.icmp_signed(">", inside, ir.Constant(I64, 0))
            value = cgutils.alloca_once_value(builder, fill)
            with builder.if_then(there):
                builder.store(builder.load(place), value)
            return builder.load(value)
        mask = first_lanes(builder, inside, width)
        kind = llvm_type(result)
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(kind, [kind.as_pointer(), I32, mask.type, kind]),
            f"llvm.masked.load.v{width}f64.p0",
        )
        pointer = builder.bitcast(place, kind.as_pointer())
        return builder.call(
            function, (pointer, ir.Constant(I32, 8), mask, in_every_lane(builder, fill, result))
        )

    return result(lanes, array, index, inside, fill), generate


@instruction
def store_inside(typing_context, array, index, inside, x):
    """Write the first `inside` lanes of x to array[index], array[index + 1], …"""

    def generate(context, builder, sig, arguments):
        array, index, inside, value = arguments
        place = address(context, builder, sig.args[0], array, sig.args[1], index)
        inside = context.cast(builder, inside, sig.args[2], types.int64)
        kind = sig.args[3]
        if not isinstance(kind, Vec):
            with builder.if_then(builder.icmp_signed(">", inside, ir.Constant(I64, 0))):
                builder.store(context.cast(builder, value, kind, sig.args[0].dtype), place)
            return context.get_dummy_value()
        mask = first_lanes(builder, inside, kind.width)
        pointer = builder.bitcast(place, value.type.as_pointer())
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(ir.VoidType(), [value.type, pointer.type, I32, mask.type]),
            f"llvm.masked.store.v{kind.width}f64.p0",
        )
        builder.call(function, (value, pointer, ir.Constant(I32, 8), mask))
        return context.get_dummy_value()

    return types.void(array, index, inside, x), generate


def first_lanes(builder, number, width):
    """Return a mask whose first `number` lanes are true."""
    lanes = integers(range(width), I64)
    return builder.icmp_signed("<", lanes, in_every_lane(builder, number, Vec(types.int64, width)))


@instruction
def rows(typing_context, lanes, number, length):
    """Return an array (number, length) in the precision of `lanes`, aligned to cache lines.

    Raises MemoryError.
    """
    kind = types.Array(lanes.instance_class.kind, 2, "C")

    def generate(context, builder, sig, arguments):
        shape = [
            context.cast(builder, value, given, types.intp)
            for value, given in zip(arguments[1:], sig.args[1:], strict=True)
        ]
        return allocate(context, builder, kind, shape)

    return kind(lanes, number, length), generate
