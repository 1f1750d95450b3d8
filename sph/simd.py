"""Explicit SIMD vectors in compiled code: several candidates of a particle per instruction.

A vector (`Vec`) holds several numbers, one in each lane; a mask (`Mask`) holds as many truth
values. Compiled code uses vectors like numbers: + - * / and comparisons, abs, np.sqrt, and `larger`
and `smaller` of `sph.compiled`. In an operation of a vector and a number, the number applies to
every lane, in the precision of the vector. The methods of models, such as kernels, therefore take
vectors as they take numbers and NumPy arrays.

The arithmetic of a pass (`lanes`) decides the width and the precision when the pass is compiled:
`DOUBLE`, `SINGLE`, or `SCALAR`, which computes one number at a time from the same source. LLVM
divides vectors that are wider than the registers of a processor, so the width is the same on every
processor, and no function needs an instruction of one processor alone.
"""

import math
import operator
from typing import NamedTuple

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, config
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, overload, register_model

from sph.compiled import FASTMATH, INLINED, larger, smaller

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


class Mask(types.Type):
    """`width` truth values."""

    def __init__(self, width):
        self.width = width
        super().__init__(f"Mask({width})")


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


def _call(builder, name, kind: Vec, result, arguments, flags=FAST):
    """Call the LLVM intrinsic `name` for vectors of a type."""
    full = f"{name}.v{kind.width}{_SHORT[kind.kind]}"
    function_type = ir.FunctionType(result, [argument.type for argument in arguments])
    function = cgutils.get_or_insert_function(builder.module, function_type, full)
    return builder.call(function, arguments, fastmath=flags)


# --- operators ---


def _is_number(kind):
    return isinstance(kind, types.Number | types.Boolean)


def _as(context, builder, value, kind, wanted: Vec):
    """Return a value of type `kind` as a vector of type `wanted`."""
    if isinstance(kind, Vec):
        return value
    return _filled(builder, context.cast(builder, value, kind, wanted.kind), wanted)


def _of_two(function, emit, result=lambda kind: kind):
    """Define function(a, b) for two vectors, or a vector and a number."""

    @infer_global(function)
    class Typed(AbstractTemplate):
        def generic(self, arguments, keywords):
            vectors = [one for one in arguments if isinstance(one, Vec)]
            if len(arguments) == 2 and vectors and not keywords:
                kind = vectors[0]
                if all(one == kind or _is_number(one) for one in arguments):
                    return signature(result(kind), *arguments)
            return None

    def lower(context, builder, sig, arguments):
        kind = next(one for one in sig.args if isinstance(one, Vec))
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
            if len(arguments) == 1 and isinstance(arguments[0], Vec) and not keywords:
                return signature(arguments[0], *arguments)
            return None

    @lower_builtin(function, Vec)
    def lower(context, builder, sig, arguments):
        return emit(builder, sig.args[0], arguments[0])


for _name, _functions in (
    ("fadd", (operator.add, operator.iadd)),
    ("fsub", (operator.sub, operator.isub)),
    ("fmul", (operator.mul, operator.imul)),
    ("fdiv", (operator.truediv, operator.itruediv)),
):
    for _function in _functions:
        _of_two(
            _function,
            lambda builder, kind, a, b, name=_name: getattr(builder, name)(a, b, flags=FAST),
        )
for _sign, _function in (
    ("<", operator.lt), ("<=", operator.le), (">", operator.gt), (">=", operator.ge),
):  # fmt: skip
    _of_two(
        _function,
        lambda builder, kind, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b),
        lambda kind: Mask(kind.width),
    )
for _name, _functions in (
    ("llvm.maxnum", (larger, np.maximum)),
    ("llvm.minnum", (smaller, np.minimum)),
):
    for _function in _functions:
        _of_two(
            _function,
            lambda builder, kind, a, b, name=_name: _call(
                builder, name, kind, a.type, (a, b), FASTEST
            ),
        )
_of_two(operator.pow, lambda builder, kind, a, b: _call(builder, "llvm.pow", kind, a.type, (a, b)))
for _name, _functions in (
    ("llvm.fabs", (abs, np.abs)),
    ("llvm.sqrt", (np.sqrt, math.sqrt)),
    ("llvm.exp", (np.exp, math.exp)),
    ("llvm.log", (np.log, math.log)),
):
    for _function in _functions:
        _of_one(
            _function,
            lambda builder, kind, x, name=_name: _call(builder, name, kind, x.type, (x,)),
        )
_of_one(operator.neg, lambda builder, kind, x: builder.fneg(x, flags=FAST))


for _name, _function in (("and_", operator.and_), ("or_", operator.or_)):

    @infer_global(_function)
    class _OfMasks(AbstractTemplate):
        def generic(self, arguments, keywords):
            if len(arguments) == 2 and isinstance(arguments[0], Mask):
                if arguments[0] == arguments[1]:
                    return signature(arguments[0], *arguments)
            return None

    @lower_builtin(_function, Mask, Mask)
    def _combine(context, builder, sig, arguments, name=_name):
        return getattr(builder, name)(*arguments)


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


@intrinsic
def select(typing_context, mask, a, b):
    """Return a in lanes where the mask is true, b in the others."""
    kind = next((one for one in (a, b) if isinstance(one, Vec)), types.float64)
    if isinstance(mask, Mask) and not isinstance(kind, Vec):
        kind = Vec(types.float64, mask.width)

    def generate(context, builder, sig, arguments):
        if not isinstance(kind, Vec):
            a, b = (
                context.cast(builder, value, given, kind)
                for value, given in zip(arguments[1:], sig.args[1:], strict=True)
            )
        else:
            a, b = (
                _as(context, builder, value, given, kind)
                for value, given in zip(arguments[1:], sig.args[1:], strict=True)
            )
        return builder.select(arguments[0], a, b)

    return kind(mask, a, b), generate


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


def _has_avx512() -> bool:
    """Return whether compiled code may use AVX-512 with vectors of any width."""
    wanted = {"avx512f", "avx512vl"}
    if config.CPU_FEATURES is not None:
        return wanted <= {one[1:] for one in config.CPU_FEATURES.split(",") if one[:1] == "+"}
    if config.CPU_NAME not in (None, "host"):
        return False
    found = llvm.get_host_cpu_features()
    return all(found.get(one, False) for one in wanted)


PERMUTES = _has_avx512()


@intrinsic
def front(typing_context, lanes, mask):
    """Return the numbers of the true lanes, in order, for `pick`."""
    if not (isinstance(mask, Mask) and PERMUTES):
        return mask(lanes, mask), lambda context, builder, sig, arguments: arguments[1]
    integer = types.int64 if lanes.instance_class.kind == types.float64 else types.int32
    kind = Vec(integer, mask.width)

    def generate(context, builder, sig, arguments):
        numbers = _indices(range(mask.width), _KINDS[integer])
        return _call(
            builder, "llvm.experimental.vector.compress", kind, _llvm(kind),
            (numbers, arguments[1], ir.Constant(_llvm(kind), ir.Undefined)), (),
        )  # fmt: skip

    return kind(lanes, mask), generate


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
    if isinstance(lanes, Mask):  # 28 cycles for 8 lanes on processors without AVX-512
        return _call(
            builder, "llvm.experimental.vector.compress", kind, result,
            (value, chosen, ir.Constant(result, ir.Undefined)), (),
        )  # fmt: skip
    if lanes.kind == types.int64 and kind.kind != types.float64:
        chosen = builder.trunc(chosen, ir.VectorType(I32, kind.width))
    function = cgutils.get_or_insert_function(
        builder.module,
        ir.FunctionType(result, [result, chosen.type]),
        _PERMUTATIONS[_SHORT[kind.kind], kind.width],
    )
    return builder.call(function, (value, chosen))


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
    if n == 2 and PERMUTES and isinstance(x, Vec) and (base, x.width) in _ESTIMATES:
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
