"""Explicit SIMD vectors in compiled code: several candidates of a particle per instruction.

A vector (`Vec`) holds several numbers, one in each lane; a mask (`Mask`) holds as many truth
values. Compiled code uses vectors like numbers: + - * / ** and comparisons, the NumPy functions in
`sph.vector_functions`, and `larger` and `smaller` of `sph.compiled`. In an operation of a vector
and a number, the number applies to every lane, in the precision of the vector. The methods of
models, such as kernels, therefore take vectors as they take NumPy arrays.

The arithmetic of a pass (`lanes`) decides the width and the precision when the pass is compiled:
`DOUBLE`, `SINGLE`, or `SCALAR`, which computes one number at a time from the same source. LLVM
divides vectors that are wider than the registers of a processor, so the width is the same on every
processor, and no function needs an instruction of one processor alone.
"""

import operator
from typing import NamedTuple

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, config
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_cast,
    models,
    overload,
    register_model,
)

from sph.compiled import FASTMATH, INLINED, larger, smaller
from sph.vector_functions import BINARY, UNARY

FAST = tuple(sorted(FASTMATH))
FASTEST = ("fast",)  # for a minimum and maximum, see `sph.compiled`
EXACT = ("contract",)  # for formulas whose order of operations matters

CACHE_LINE = 64  # bytes

I1, I32, I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)


class Double(NamedTuple):
    """8 lanes in double precision."""

    width = 8  # type: ignore[misc]
    block_width = 8  # type: ignore[misc]  # for loops over the particles of a block
    kind = types.float64  # type: ignore[misc]


class Single(NamedTuple):
    """16 lanes in single precision."""

    width = 16  # type: ignore[misc]
    block_width = 8  # type: ignore[misc]
    kind = types.float32  # type: ignore[misc]


class Scalar(NamedTuple):
    """One lane in double precision."""

    width = 1  # type: ignore[misc]
    block_width = 1  # type: ignore[misc]
    kind = types.float64  # type: ignore[misc]


DOUBLE, SINGLE, SCALAR = Double(), Single(), Scalar()


# --- types ---


class Vec(types.Type):
    """`width` numbers of type `kind`."""

    def __init__(self, kind, width):
        self.kind, self.width = kind, width
        super().__init__(f"Vec({kind}, {width})")

    def unify(self, typingctx, other):
        """A variable that is a vector or a number, depending on a condition, is a vector."""
        return self if _is_number(other) else None

    def can_convert_from(self, typingctx, other):
        return Conversion.safe if _is_number(other) else None


class Mask(types.Type):
    """The truth values of a comparison of vectors of type `compared`."""

    def __init__(self, compared):
        self.compared, self.width = compared, compared.width
        super().__init__(f"Mask({compared})")


_KINDS = {
    types.float32: ir.FloatType(), types.float64: ir.DoubleType(), types.int32: I32,
    types.int64: I64,
}  # fmt: skip
_SHORT = {types.float32: "f32", types.float64: "f64", types.int32: "i32", types.int64: "i64"}


@register_model(Vec)
class _VecModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(_KINDS[kind.kind], kind.width))


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(I1, kind.width))


def _vector(kind, width):
    """Return the type of `width` lanes: a number if there is one lane."""
    return Vec(kind, width) if width > 1 else kind


def _llvm(kind):
    return ir.VectorType(_KINDS[kind.kind], kind.width) if isinstance(kind, Vec) else _KINDS[kind]


def _filled(builder, value, kind: Vec):
    """Return a vector with `value` in every lane."""
    undefined = ir.Constant(_llvm(kind), ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(I32, 0))
    return builder.shuffle_vector(first, undefined, _indices([0] * kind.width))


def _indices(values, kind=I32):
    values = list(values)
    return ir.Constant(ir.VectorType(kind, len(values)), values)


def _all(kind, value):
    """Return a constant of an LLVM type, number or vector."""
    if isinstance(kind, ir.VectorType):
        return ir.Constant(kind, [value] * kind.count)
    return ir.Constant(kind, value)


def _call(builder, name, kind, result, arguments, flags=FAST):
    """Call the LLVM intrinsic `name` for vectors of a type, or for numbers."""
    suffix = f"v{kind.width}{_SHORT[kind.kind]}" if isinstance(kind, Vec) else _SHORT[kind]
    full = f"{name}.{suffix}"
    function_type = ir.FunctionType(result, [argument.type for argument in arguments])
    function = cgutils.get_or_insert_function(builder.module, function_type, full)
    return builder.call(function, arguments, fastmath=flags)


# --- operators ---


def _is_number(kind):
    return isinstance(kind, types.Number | types.Boolean)


def _as(context, builder, value, kind, wanted: Vec):
    """Return a value of type `kind` as a vector of type `wanted`; a mask is 1 where true."""
    if isinstance(kind, Vec):
        return value
    if isinstance(kind, Mask):
        return builder.uitofp(value, _llvm(wanted))
    return _filled(builder, context.cast(builder, value, kind, wanted.kind), wanted)


def _vector_of(kinds):
    """Return the type of the vectors among the operands; None if they cannot be combined."""
    found = [one for one in kinds if isinstance(one, Vec)]
    kind = found[0] if found else None
    if kind is None or not isinstance(kind.kind, types.Float):
        return None
    matches = all(one in (kind, Mask(kind)) or _is_number(one) for one in kinds)
    return kind if matches else None


@lower_cast(types.Number, Vec)
def _cast(context, builder, kind, wanted, value):
    return _as(context, builder, value, kind, wanted)


def _of_two(function, emit, result=lambda kind: kind):
    """Define function(a, b) for two vectors, or for a vector and a number or mask."""

    @infer_global(function)
    class Typed(AbstractTemplate):
        def generic(self, arguments, keywords):
            kind = _vector_of(arguments) if len(arguments) == 2 and not keywords else None
            return kind and signature(result(kind), *arguments)

    def lower(context, builder, sig, arguments):
        kind = _vector_of(sig.args)
        a, b = (
            _as(context, builder, value, given, kind)
            for value, given in zip(arguments, sig.args, strict=True)
        )
        return emit(builder, kind, a, b)

    for pair in ((Vec, Vec), (Vec, types.Any), (types.Any, Vec)):
        lower_builtin(function, *pair)(lower)


def _of_one(function, emit):
    """Define function(x) of a vector."""

    @infer_global(function)
    class Typed(AbstractTemplate):
        def generic(self, arguments, keywords):
            kind = _vector_of(arguments) if len(arguments) == 1 and not keywords else None
            return kind and signature(kind, *arguments)

    @lower_builtin(function, Vec)
    def lower(context, builder, sig, arguments):
        return emit(builder, sig.args[0], arguments[0])


def _instruction(name):
    return lambda builder, kind, *values: getattr(builder, name)(*values, flags=FAST)


def _intrinsic(name, flags=FAST):
    return lambda builder, kind, *values: _call(builder, name, kind, values[0].type, values, flags)


def _comparison(sign):
    # as in IEEE 754: with NaN, only != is true
    compare = "fcmp_unordered" if sign == "!=" else "fcmp_ordered"
    return lambda builder, kind, a, b: getattr(builder, compare)(sign, a, b)


for _name, _functions in (
    ("fadd", (operator.add, operator.iadd)),
    ("fsub", (operator.sub, operator.isub)),
    ("fmul", (operator.mul, operator.imul)),
    ("fdiv", (operator.truediv, operator.itruediv)),
):
    for _function in _functions:
        _of_two(_function, _instruction(_name))
for _sign, _function in (
    ("<", operator.lt), ("<=", operator.le), (">", operator.gt), (">=", operator.ge),
    ("==", operator.eq), ("!=", operator.ne),
):  # fmt: skip
    _of_two(_function, _comparison(_sign), Mask)
_of_two(operator.pow, _intrinsic("llvm.pow"))
_of_two(larger, _intrinsic("llvm.maxnum", FASTEST))
_of_two(smaller, _intrinsic("llvm.minnum", FASTEST))
for _function, _name in BINARY.items():
    _of_two(_function, _intrinsic(_name, FASTEST if _name.endswith("num") else FAST))
for _function, _name in {abs: "llvm.fabs", **UNARY}.items():
    _of_one(_function, _intrinsic(_name))
_of_one(operator.neg, _instruction("fneg"))
_of_one(operator.pos, lambda builder, kind, x: x)


def _chosen_type(mask, a, b):
    """Return the type of a where the mask is true, otherwise b; None without vectors."""
    return _vector_of([a, b, mask.compared] if isinstance(mask, Mask) else [a, b])


def _chosen(context, builder, sig, arguments):
    kind = sig.return_type
    a, b = (
        _as(context, builder, value, given, kind)
        if isinstance(kind, Vec)
        else context.cast(builder, value, given, kind)
        for value, given in zip(arguments[1:], sig.args[1:], strict=True)
    )
    return builder.select(arguments[0], a, b)


@intrinsic
def select(typing_context, mask, a, b):
    """Return a in lanes where the mask is true, b in the others; also of numbers."""
    return (_chosen_type(mask, a, b) or types.float64)(mask, a, b), _chosen


@infer_global(np.where)
class _Where(AbstractTemplate):
    def generic(self, arguments, keywords):
        kind = _chosen_type(*arguments) if len(arguments) == 3 and not keywords else None
        return kind and signature(kind, *arguments)


for _types in ((Mask, types.Any, types.Any), (types.Boolean, types.Any, types.Any)):
    lower_builtin(np.where, *_types)(_chosen)


for _name, _function in (
    ("and_", operator.and_), ("or_", operator.or_), ("xor", operator.xor),
):  # fmt: skip

    @infer_global(_function)
    class _OfMasks(AbstractTemplate):
        def generic(self, arguments, keywords):
            are_equal = len(arguments) == 2 and arguments[0] == arguments[1]
            if are_equal and isinstance(arguments[0], Mask):
                return signature(arguments[0], *arguments)
            return None

    @lower_builtin(_function, Mask, Mask)
    def _combine(context, builder, sig, arguments, name=_name):
        return getattr(builder, name)(*arguments)


@infer_global(operator.invert)
class _OfMask(AbstractTemplate):
    def generic(self, arguments, keywords):
        is_mask = len(arguments) == 1 and isinstance(arguments[0], Mask)
        return signature(arguments[0], *arguments) if is_mask else None


@lower_builtin(operator.invert, Mask)
def _invert(context, builder, sig, arguments):
    return builder.not_(arguments[0])


# --- memory ---


def _place(context, builder, array_type, array, index_type, index):
    """Return the address of array[index]; index: a number, or a tuple of numbers."""
    if isinstance(index_type, types.BaseTuple):
        parts = cgutils.unpack_tuple(builder, index)
        kinds = list(index_type)
    else:
        parts, kinds = [index], [index_type]
    parts = [
        context.cast(builder, one, kind, types.intp) for one, kind in zip(parts, kinds, strict=True)
    ]
    view = context.make_array(array_type)(context, builder, array)
    return cgutils.get_item_pointer(context, builder, array_type, view, parts, wraparound=False)


def _reader(of_width):
    """A function that reads lanes from an array; of_width(lanes) is their number."""

    @intrinsic
    def read(typing_context, lanes, array, index):
        kind = _vector(array.dtype, of_width(lanes.instance_class))

        def generate(context, builder, sig, arguments):
            _, array, index = arguments
            place = _place(context, builder, sig.args[1], array, sig.args[2], index)
            pointer = builder.bitcast(place, _llvm(kind).as_pointer())
            loaded = builder.load(pointer)
            loaded.align = array_bytes
            return loaded

        array_bytes = array.dtype.bitwidth // 8
        return kind(lanes, array, index), generate

    return read


load = _reader(lambda lanes: lanes.width)
load_block = _reader(lambda lanes: lanes.block_width)


@intrinsic
def store(typing_context, array, index, x):
    """Write the lanes of x to array[index], array[index + 1], …, in the array's precision."""

    def generate(context, builder, sig, arguments):
        array, index, value = arguments
        place = _place(context, builder, sig.args[0], array, sig.args[1], index)
        kind, base = sig.args[2], sig.args[0].dtype
        if not isinstance(kind, Vec):
            value = context.cast(builder, value, kind, base)
        elif kind.kind == types.float64 and base == types.float32:
            value = builder.fptrunc(value, _llvm(Vec(base, kind.width)))
        stored = builder.store(value, builder.bitcast(place, value.type.as_pointer()))
        stored.align = sig.args[0].dtype.bitwidth // 8
        return context.get_dummy_value()

    return types.void(array, index, x), generate


@intrinsic
def load_inside(typing_context, lanes, array, index, inside, fill):
    """Return as many lanes as in a block from a float64 array, in double precision.

    inside: number of lanes that are inside the array; `fill` in the others.
    """
    width = lanes.instance_class.block_width
    result = _vector(types.float64, width)

    def generate(context, builder, sig, arguments):
        _, array, index, inside, fill = arguments
        kinds = sig.args
        place = _place(context, builder, kinds[1], array, kinds[2], index)
        inside = context.cast(builder, inside, kinds[3], types.int64)
        fill = context.cast(builder, fill, kinds[4], types.float64)
        if width == 1:
            there = builder.icmp_signed(">", inside, ir.Constant(I64, 0))
            value = cgutils.alloca_once_value(builder, fill)
            with builder.if_then(there):
                builder.store(builder.load(place), value)
            return builder.load(value)
        mask = _first_lanes(builder, inside, width)
        kind = _llvm(result)
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(kind, [kind.as_pointer(), I32, mask.type, kind]),
            f"llvm.masked.load.v{width}f64.p0",
        )
        pointer = builder.bitcast(place, kind.as_pointer())
        return builder.call(
            function, (pointer, ir.Constant(I32, 8), mask, _filled(builder, fill, result))
        )

    return result(lanes, array, index, inside, fill), generate


@intrinsic
def width(typing_context, lanes):
    """Return the number of lanes, a constant for the compiler."""
    number = lanes.instance_class.width
    return types.intp(lanes), lambda context, builder, sig, arguments: ir.Constant(I64, number)


@intrinsic
def block_width(typing_context, lanes):
    """Return the number of lanes in loops over the particles of a block."""
    number = lanes.instance_class.block_width
    return types.intp(lanes), lambda context, builder, sig, arguments: ir.Constant(I64, number)


@intrinsic
def _address(typing_context, array):
    def generate(context, builder, sig, arguments):
        view = context.make_array(sig.args[0])(context, builder, arguments[0])
        return builder.ptrtoint(view.data, I64)

    return types.int64(array), generate


def rows(lanes, number, length):
    """Return an array (number, length) in the precision of `lanes`, aligned to cache lines."""


@overload(rows, jit_options=INLINED)
def _rows(lanes, number, length):
    kind = np.float32 if lanes.instance_class.kind == types.float32 else np.float64
    size = np.dtype(kind).itemsize
    line = CACHE_LINE // size

    def make(lanes, number, length):
        whole = np.empty(number * length + line, kind)
        begin = (-_address(whole) % CACHE_LINE) // size
        return whole[begin : begin + number * length].reshape(number, length)

    return make


# --- lanes ---


@intrinsic
def store_inside(typing_context, array, index, inside, x):
    """Write the first `inside` lanes of x to array[index], array[index + 1], …"""

    def generate(context, builder, sig, arguments):
        array, index, inside, value = arguments
        place = _place(context, builder, sig.args[0], array, sig.args[1], index)
        inside = context.cast(builder, inside, sig.args[2], types.int64)
        kind = sig.args[3]
        if not isinstance(kind, Vec):
            with builder.if_then(builder.icmp_signed(">", inside, ir.Constant(I64, 0))):
                builder.store(context.cast(builder, value, kind, sig.args[0].dtype), place)
            return context.get_dummy_value()
        mask = _first_lanes(builder, inside, kind.width)
        pointer = builder.bitcast(place, value.type.as_pointer())
        function = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(ir.VoidType(), [value.type, pointer.type, I32, mask.type]),
            f"llvm.masked.store.v{kind.width}f64.p0",
        )
        builder.call(function, (value, pointer, ir.Constant(I32, 8), mask))
        return context.get_dummy_value()

    return types.void(array, index, inside, x), generate


def _first_lanes(builder, number, width):
    """Return a mask whose first `number` lanes are true."""
    lanes = _indices(range(width), I64)
    return builder.icmp_signed("<", lanes, _filled(builder, number, Vec(types.int64, width)))


def _filler(of_width):
    """A function that returns a vector with a number in every lane; it returns vectors as given."""

    @intrinsic
    def fill(typing_context, lanes, value):
        if isinstance(value, Vec):
            return value(lanes, value), lambda context, builder, sig, arguments: arguments[1]
        kind = _vector(lanes.instance_class.kind, of_width(lanes.instance_class))

        def generate(context, builder, sig, arguments):
            base = lanes.instance_class.kind
            number = context.cast(builder, arguments[1], sig.args[1], base)
            return _filled(builder, number, kind) if isinstance(kind, Vec) else number

        return kind(lanes, value), generate

    return fill


filled = _filler(lambda lanes: lanes.width)
filled_block = _filler(lambda lanes: lanes.block_width)


@intrinsic
def numbers_from(typing_context, lanes, first):
    """Return first, first + 1, … as integers, one in each lane of a block."""
    kind = _vector(types.int32, lanes.instance_class.block_width)

    def generate(context, builder, sig, arguments):
        number = context.cast(builder, arguments[1], sig.args[1], types.int32)
        if not isinstance(kind, Vec):
            return number
        return builder.add(_filled(builder, number, kind), _indices(range(kind.width)))

    return kind(lanes, first), generate


def summed(context, builder, kind, value):
    """Return LLVM code for the sum of all lanes, in double precision."""
    if not isinstance(kind, Vec):
        return context.cast(builder, value, kind, types.float64)
    wide = Vec(types.float64, kind.width)
    if kind != wide:
        value = builder.fpext(value, _llvm(wide))
    zero = ir.Constant(ir.DoubleType(), -0.0)
    return _call(builder, "llvm.vector.reduce.fadd", wide, zero.type, (zero, value))


@intrinsic
def lane_sum(typing_context, x):
    """Return the sum of all lanes, in double precision."""
    return types.float64(x), lambda context, builder, sig, arguments: summed(
        context, builder, sig.args[0], arguments[0]
    )


@intrinsic
def lane_max(typing_context, x):
    """Return the largest lane, in double precision (undefined for NaN)."""

    def generate(context, builder, sig, arguments):
        kind, value = sig.args[0], arguments[0]
        base = kind
        if isinstance(kind, Vec):
            base = kind.kind
            value = _call(builder, "llvm.vector.reduce.fmax", kind, _KINDS[base], (value,), FASTEST)
        return context.cast(builder, value, base, types.float64)

    return types.float64(x), generate


@intrinsic
def count(typing_context, mask):
    """Return the number of true lanes."""

    def generate(context, builder, sig, arguments):
        if not isinstance(sig.args[0], Mask):
            return builder.zext(arguments[0], I64)
        bits = builder.bitcast(arguments[0], ir.IntType(sig.args[0].width))
        return builder.zext(builder.ctpop(bits), I64)

    return types.int64(mask), generate


@intrinsic
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


# --- compaction ---


def _instructions() -> str:
    """Return which instructions that move lanes compiled code may use: avx512, avx2 or none."""
    if config.CPU_FEATURES is not None:
        listed = config.CPU_FEATURES.split(",")
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
        builder.shuffle_vector(value, value, _indices(range(first, first + HALF)))
        for first in (0, HALF)
    ]


def _front_of_both(builder, mask):
    """Return the numbers of the true lanes of 16, in order, as two vectors of 8 lanes."""
    first, second = (builder.bitcast(half, ir.IntType(HALF)) for half in _halves(builder, mask))
    # the numbers in the second half are moved back by as many lanes as are free in the first
    kind = ir.VectorType(I32, HALF)
    lane = _indices(range(HALF))
    used = _filled(builder, builder.zext(builder.ctpop(first), I32), Vec(types.int32, HALF))
    moved = _permuted(builder, _table_entry(builder, second), builder.sub(lane, used))
    moved = builder.or_(moved, ir.Constant(kind, [HALF] * HALF))
    is_first = builder.icmp_signed("<", lane, used)
    return builder.select(is_first, _table_entry(builder, first), moved), moved


@intrinsic
def front(typing_context, lanes, mask):
    """Return the numbers of the true lanes, in order, for `pick`."""
    if not (isinstance(mask, Mask) and INSTRUCTIONS):
        return mask(lanes, mask), lambda context, builder, sig, arguments: arguments[1]
    is_wide = AVX512 and lanes.instance_class.kind == types.float64
    integer = types.int64 if is_wide else types.int32
    kind = Vec(integer, mask.width)

    def compressed(context, builder, sig, arguments):
        numbers = _indices(range(mask.width), _KINDS[integer])
        return _call(
            builder, "llvm.experimental.vector.compress", kind, _llvm(kind),
            (numbers, arguments[1], ir.Constant(_llvm(kind), ir.Undefined)), (),
        )  # fmt: skip

    def looked_up(context, builder, sig, arguments):
        if mask.width == HALF:
            return _table_entry(builder, builder.bitcast(arguments[1], ir.IntType(HALF)))
        first, second = _front_of_both(builder, arguments[1])
        return builder.shuffle_vector(first, second, _indices(range(2 * HALF)))

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
    result = _llvm(kind)
    if isinstance(lanes, Mask):  # through memory: 28 cycles for 8 lanes
        return _call(
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
        _PERMUTATIONS[_SHORT[kind.kind], kind.width],
    )
    return builder.call(function, (value, chosen))


def _picked_from_halves(builder, result, value, chosen):
    """Return LLVM code for `pick` of two 256-bit registers: of 8 float64 or 16 float32 numbers."""
    base = result.element
    if base == ir.DoubleType():  # permuted as pairs of 32-bit numbers
        base = I32
        twice = builder.shuffle_vector(
            chosen, chosen, _indices(lane for lane in range(HALF) for _ in range(2))
        )
        twice = builder.shl(twice, ir.Constant(twice.type, [1] * 2 * HALF))
        chosen = builder.or_(twice, _indices([0, 1] * HALF))
    whole = ir.VectorType(base, 2 * HALF)
    low, high = _halves(builder, builder.bitcast(value, whole))
    numbers, beyond = _halves(builder, chosen)
    from_high = builder.icmp_unsigned(">=", numbers, ir.Constant(numbers.type, [HALF] * HALF))
    first = builder.select(
        from_high, _permuted(builder, high, numbers), _permuted(builder, low, numbers)
    )
    # the second half of the result comes from the second half of the value: no lane moves back
    second = _permuted(builder, high, beyond)
    both = builder.shuffle_vector(first, second, _indices(range(2 * HALF)))
    return builder.bitcast(both, result)


@intrinsic
def pick(typing_context, x, lanes):
    """Return the lanes of x that `front` numbers, at the front; the others are undefined."""
    return x(x, lanes), lambda context, builder, sig, arguments: picked(
        builder, sig.args[0], arguments[0], sig.args[1], arguments[1]
    )


# --- inverse roots ---

# First guesses by an integer operation on the exponent, with an error of 3.5 % at most (Lomont
# 2003), and for AVX-512 by an instruction, with an error of 2^-14. With e = 1 - x y^n,
# x^(-1/n) = y (1 + e/n + ...); a step with k terms multiplies the number of correct digits by k.
_SERIES = {2: (1.0, 1.0 / 2.0, 3.0 / 8.0, 5.0 / 16.0), 3: (1.0, 1.0 / 3.0, 2.0 / 9.0, 14.0 / 81.0)}
_GUESSES = {
    (2, types.float64): (0x5FE6EB50C7B537A9, I64),
    (2, types.float32): (0x5F375A86, I32),
    (3, types.float64): (0x553EF0FF289DD796, I64),
}
_STEPS = {(2, types.float64): (3, 4), (2, types.float32): (3, 2), (3, types.float64): (4, 4)}
_ESTIMATES = {
    (types.float64, 8): ("llvm.x86.avx512.rsqrt14.pd.512", (4,)),
    (types.float32, 16): ("llvm.x86.avx512.rsqrt14.ps.512", (2,)),
}


def _guess(builder, x, kind, value, n, base):
    """Return LLVM code for a guess of value^(-1/n), and the numbers of terms of the steps."""
    if n == 2 and AVX512 and isinstance(x, Vec) and (base, x.width) in _ESTIMATES:
        name, steps = _ESTIMATES[base, x.width]
        every = ir.IntType(max(8, x.width))
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(kind, [kind, kind, every]), name
        )
        arguments = (value, ir.Constant(kind, ir.Undefined), ir.Constant(every, -1))
        return builder.call(function, arguments), steps
    guess, integer = _GUESSES[n, base]
    whole = ir.VectorType(integer, x.width) if isinstance(x, Vec) else integer
    bits = builder.bitcast(value, whole)
    part = builder.lshr(bits, _all(whole, 1)) if n == 2 else builder.udiv(bits, _all(whole, n))
    return builder.bitcast(builder.sub(_all(whole, guess), part), kind), _STEPS[n, base]


def _inverse_root(n):
    """A function that returns x^(-1/n) for normal x > 0, to a few units in the last place."""

    @intrinsic
    def root(typing_context, x):
        base = x.kind if isinstance(x, Vec) else x

        def generate(context, builder, sig, arguments):
            (value,) = arguments
            kind = _llvm(x)
            y, steps = _guess(builder, x, kind, value, n, base)

            def times(a, b):
                return builder.fmul(a, b, flags=EXACT)

            for terms in steps:
                power = times(value, y)
                for _ in range(n - 1):
                    product, power = power, times(power, y)
                e = builder.fsub(_all(kind, 1.0), times(product, y), flags=EXACT)
                total = _all(kind, _SERIES[n][terms - 1])
                for factor in _SERIES[n][terms - 2 : 0 : -1]:
                    total = builder.fadd(times(total, e), _all(kind, factor), flags=EXACT)
                y = builder.fadd(times(times(total, e), y), y, flags=EXACT)
            return y

        return x(x), generate

    return root


inverse_sqrt = _inverse_root(2)
inverse_cbrt = _inverse_root(3)
