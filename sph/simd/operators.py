"""Operators and functions of vectors: arithmetic, comparisons, NumPy functions, choices."""

import operator

import numpy as np
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from sph.compiled import instruction, larger, smaller
from sph.simd.functions import BINARY, UNARY
from sph.simd.types import FAST, FASTEST, Mask, Vec, as_vector, call, is_number


def _vector_of(kinds):
    """Return the type of the vectors among the operands; None if they cannot be combined."""
    found = [one for one in kinds if isinstance(one, Vec)]
    kind = found[0] if found else None
    if kind is None or not isinstance(kind.kind, types.Float):
        return None
    matches = all(one in (kind, Mask(kind)) or is_number(one) for one in kinds)
    return kind if matches else None


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
            as_vector(context, builder, value, given, kind)
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
    return lambda builder, kind, *values: call(builder, name, kind, values[0].type, values, flags)


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
for _one, _name in [(abs, "llvm.fabs"), *UNARY.items()]:
    _of_one(_one, _intrinsic(_name))
_of_one(operator.neg, _instruction("fneg"))
_of_one(operator.pos, lambda builder, kind, x: x)


def _chosen_type(mask, a, b):
    """Return the type of a where the mask is true, otherwise b; None without vectors."""
    return _vector_of([a, b, mask.compared] if isinstance(mask, Mask) else [a, b])


def _chosen(context, builder, sig, arguments):
    kind = sig.return_type
    a, b = (
        as_vector(context, builder, value, given, kind)
        if isinstance(kind, Vec)
        else context.cast(builder, value, given, kind)
        for value, given in zip(arguments[1:], sig.args[1:], strict=True)
    )
    return builder.select(arguments[0], a, b)


@instruction
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
