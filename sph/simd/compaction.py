"""Moving some lanes to the front of a vector: `front` numbers them and `pick` moves them.

AVX-512 has an instruction for the numbers. AVX2 reads them from a table, and permutes vectors of
512 bits as two halves. LLVM's own code for other processors goes through memory.
"""

from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core import cgutils, config

from sph.compiled import instruction
from sph.simd.types import (
    I32,
    I64,
    KINDS,
    SHORT,
    Mask,
    Vec,
    call,
    in_every_lane,
    integers,
    llvm_type,
)


def _instructions() -> str:
    """Return which instructions that move lanes compiled code may use: avx512, avx2 or none."""
    settings: Any = config
    if settings.CPU_FEATURES is not None:
        listed = settings.CPU_FEATURES.split(",")
        found = {one[1:]: True for one in listed if one[:1] == "+"}
    else:
        found = llvm.get_host_cpu_features()
    names = {"avx512": ("avx512f", "avx512vl"), "avx2": ("avx2",)}
    for name, needed in names.items():
        if all(found.get(one, False) for one in needed):
            return name
    return ""


INSTRUCTIONS = _instructions()
AVX512 = INSTRUCTIONS == "avx512"

HALF = 8  # lanes in a 256-bit register of 32-bit numbers


def _packed(mask: int) -> int:
    """Return the numbers of the bits of `mask` that are set, in order, one in each byte."""
    there = [lane for lane in range(HALF) if mask >> lane & 1]
    return sum(lane << 8 * place for place, lane in enumerate(there))


def _table_entry(builder, bits):
    """Return the numbers of the set bits of an 8-bit integer, in order, as 8 32-bit lanes."""
    name, masks = "lanes_of_masks", range(1 << HALF)
    table = builder.module.globals.get(name)
    if table is None:
        values = ir.Constant(ir.ArrayType(I64, len(masks)), [_packed(mask) for mask in masks])
        table = cgutils.global_constant(builder, name, values)
    place = builder.gep(table, [ir.Constant(I32, 0), builder.zext(bits, I32)], inbounds=True)
    each = builder.bitcast(builder.load(place), ir.VectorType(ir.IntType(8), HALF))
    return builder.zext(each, ir.VectorType(I32, HALF))


def _permuted(builder, value, numbers):
    """Return lanes of a vector of 8 32-bit numbers; only the last 3 bits of `numbers` count."""
    floats = value.type.element == ir.FloatType()
    name = "llvm.x86.avx2.permps" if floats else "llvm.x86.avx2.permd"
    function_type = ir.FunctionType(value.type, [value.type, numbers.type])
    function = cgutils.get_or_insert_function(builder.module, function_type, name)
    return builder.call(function, (value, numbers))


def _halves(builder, value):
    """Return the first and the second half of a vector of 16 lanes."""
    return [
        builder.shuffle_vector(value, value, integers(range(first, first + HALF)))
        for first in (0, HALF)
    ]


def _front_of_both(builder, mask):
    """Return the numbers of the true lanes of 16, in order, as two vectors of 8 lanes."""
    first, second = (builder.bitcast(half, ir.IntType(HALF)) for half in _halves(builder, mask))
    # the numbers in the second half are moved back by as many lanes as are free in the first
    kind = ir.VectorType(I32, HALF)
    lane = integers(range(HALF))
    used = in_every_lane(builder, builder.zext(builder.ctpop(first), I32), Vec(types.int32, HALF))
    moved = _permuted(builder, _table_entry(builder, second), builder.sub(lane, used))
    moved = builder.or_(moved, ir.Constant(kind, [HALF] * HALF))
    is_first = builder.icmp_signed("<", lane, used)
    return builder.select(is_first, _table_entry(builder, first), moved), moved


@instruction
def front(typing_context, lanes, mask):
    """Return the numbers of the true lanes, in order, for `pick`."""
    if not (isinstance(mask, Mask) and INSTRUCTIONS):
        return mask(lanes, mask), lambda context, builder, sig, arguments: arguments[1]
    is_wide = AVX512 and lanes.instance_class.kind == types.float64
    integer = types.int64 if is_wide else types.int32
    kind = Vec(integer, mask.width)

    def compressed(context, builder, sig, arguments):
        numbers = integers(range(mask.width), KINDS[integer])
        return call(
            builder, "llvm.experimental.vector.compress", kind, llvm_type(kind),
            (numbers, arguments[1], ir.Constant(llvm_type(kind), ir.Undefined)), (),
        )  # fmt: skip

    def looked_up(context, builder, sig, arguments):
        if mask.width == HALF:
            return _table_entry(builder, builder.bitcast(arguments[1], ir.IntType(HALF)))
        first, second = _front_of_both(builder, arguments[1])
        return builder.shuffle_vector(first, second, integers(range(2 * HALF)))

    return kind(lanes, mask), compressed if AVX512 else looked_up


# Permutations of lanes by a vector of lane numbers.
_PERMUTATIONS = {
    ("f64", 8): "llvm.x86.avx512.permvar.df.512",
    ("f32", 16): "llvm.x86.avx512.permvar.sf.512",
    ("f32", 8): "llvm.x86.avx2.permps",
    ("i32", 8): "llvm.x86.avx2.permd",
}


def picked(builder, kind, value, lanes, chosen):
    """Return LLVM code for `pick`; kind, lanes: types of the value and of what `front` returned."""
    if not isinstance(kind, Vec):
        return value
    result = llvm_type(kind)
    if isinstance(lanes, Mask):  # through memory: 28 cycles for 8 lanes
        return call(
            builder, "llvm.experimental.vector.compress", kind, result,
            (value, chosen, ir.Constant(result, ir.Undefined)), (),
        )  # fmt: skip
    if not AVX512 and kind.width * kind.kind.bitwidth > 256:
        return _picked_from_halves(builder, result, value, chosen)
    if lanes.kind == types.int64 and kind.kind != types.float64:
        chosen = builder.trunc(chosen, ir.VectorType(I32, kind.width))
    function = cgutils.get_or_insert_function(
        builder.module,
        ir.FunctionType(result, [result, chosen.type]),
        _PERMUTATIONS[SHORT[kind.kind], kind.width],
    )
    return builder.call(function, (value, chosen))


def _picked_from_halves(builder, result, value, chosen):
    """Return LLVM code for `pick` of two 256-bit registers: of 8 float64 or 16 float32 numbers."""
    base = result.element
    if base == ir.DoubleType():  # permuted as pairs of 32-bit numbers
        base = I32
        twice = builder.shuffle_vector(
            chosen, chosen, integers(lane for lane in range(HALF) for _ in range(2))
        )
        twice = builder.shl(twice, ir.Constant(twice.type, [1] * 2 * HALF))
        chosen = builder.or_(twice, integers([0, 1] * HALF))
    whole = ir.VectorType(base, 2 * HALF)
    low, high = _halves(builder, builder.bitcast(value, whole))
    numbers, beyond = _halves(builder, chosen)
    from_high = builder.icmp_unsigned(">=", numbers, ir.Constant(numbers.type, [HALF] * HALF))
    first = builder.select(
        from_high, _permuted(builder, high, numbers), _permuted(builder, low, numbers)
    )
    # the second half of the result comes from the second half of the value: no lane moves back
    second = _permuted(builder, high, beyond)
    both = builder.shuffle_vector(first, second, integers(range(2 * HALF)))
    return builder.bitcast(both, result)


@instruction
def pick(typing_context, x, lanes):
    """Return the lanes of x that `front` numbers, at the front; the others are undefined."""
    return x(x, lanes), lambda context, builder, sig, arguments: picked(
        builder, sig.args[0], arguments[0], sig.args[1], arguments[1]
    )
