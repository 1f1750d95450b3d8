"""New arrays in compiled code, in a few instructions.

np.empty is a function of its own for each kind of array, compiled anew in each process that
compiles a caller: 0.3 CPU seconds in a first run.
"""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.np.arrayobj import make_array, populate_array

from sph.compiled import instruction

CACHE_LINE = 64  # bytes


def allocate(context, builder, kind: types.Array, shape):
    """Return LLVM code for a new array, aligned to cache lines; shape: integers.

    The code raises MemoryError.
    """
    number: Any = kind.dtype
    item = context.get_constant(types.intp, number.bitwidth // 8)
    strides = [item]
    for length in reversed(shape):
        strides.insert(0, builder.mul(length, strides[0]))
    size, *strides = strides
    block = context.nrt.meminfo_alloc_aligned(builder, size, CACHE_LINE)
    pointer = context.get_data_type(kind.dtype).as_pointer()
    array = make_array(kind)(context, builder)
    populate_array(
        array, data=builder.bitcast(context.nrt.meminfo_data(builder, block), pointer),
        shape=list(shape), strides=strides, itemsize=item, meminfo=block,
    )  # fmt: skip
    return array._getvalue()


@instruction
def empty(typing_context, shape, kind):
    """Return an array with undefined entries, as np.empty(shape, kind) does.

    shape: an integer or a tuple of integers; kind: np.float64, np.int64 or another number.
    """
    lengths: Any = list(shape) if isinstance(shape, types.BaseTuple) else [shape]  # type: ignore[call-overload]
    array = types.Array(kind.dtype, len(lengths), "C")

    def generate(context, builder, sig, arguments):
        values = [arguments[0]]
        if isinstance(shape, types.BaseTuple):
            values = cgutils.unpack_tuple(builder, arguments[0])
        return allocate(context, builder, array, [
            context.cast(builder, value, given, types.intp)
            for value, given in zip(values, lengths, strict=True)
        ])  # fmt: skip

    return array(shape, kind), generate
