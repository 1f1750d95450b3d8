"""Instructions on copied blocks: for each quantity BLOCK numbers, one after another."""

from numba import types

from sph.compiled import instruction
from sph.neighbours.order import BLOCK
from sph.simd.compaction import picked
from sph.simd.memory import lanes_at, put_lanes
from sph.simd.spatial import element, integer_plus
from sph.simd.types import vector_type


@instruction
def load_column(typing_context, lanes, dim, array, begin):
    """Return lanes of a vector whose components are BLOCK numbers apart, from array[begin]."""
    kind = vector_type(lanes.instance_class.kind, lanes.instance_class.block_width)
    result = types.UniTuple(kind, len(dim))

    def generate(context, builder, sig, arguments):
        _, _, array, begin = arguments
        parts = []
        for d in range(len(dim)):
            one = integer_plus(context, builder, begin, sig.args[3], d * BLOCK)
            place = element(context, builder, sig.args[2], array, one)
            parts.append(lanes_at(builder, place, kind))
        return context.make_tuple(builder, result, parts)

    return result(lanes, dim, array, begin), generate


@instruction
def move(typing_context, lanes, fields, copied, begin, chosen, near, k):
    """Write the `chosen` lanes of all quantities of a block to the columns of `near` from k.

    Quantity f of the block begins at copied[begin + f BLOCK], and has row f of `near`.
    """
    kind = vector_type(lanes.instance_class.kind, lanes.instance_class.block_width)

    def generate(context, builder, sig, arguments):
        _, _, copied, begin, chosen, near, k = arguments
        kinds = sig.args
        k = integer_plus(context, builder, k, kinds[6])
        for f in range(len(fields)):
            one = integer_plus(context, builder, begin, kinds[3], f * BLOCK)
            value = lanes_at(builder, element(context, builder, kinds[2], copied, one), kind)
            value = picked(builder, kind, value, kinds[4], chosen)
            place = element(context, builder, kinds[5], near, f, k)
            put_lanes(builder, value, place, kind)
        return context.get_dummy_value()

    return types.void(lanes, fields, copied, begin, chosen, near, k), generate
