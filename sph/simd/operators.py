"""Operators and functions of vectors: arithmetic, comparisons, roots, minimum and maximum."""

import math
import operator

import numpy as np
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from sph.compiled import larger, smaller
from sph.simd.types import FAST, FASTEST, Mask, Vec, as_vector, call, instruction


def _is_number(kind):
    return isinstance(kind, types.Number | types.Boolean)


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
            lambda builder, kind, a, b, name=_name: call(
                builder, name, kind, a.type, (a, b), FASTEST
            ),
        )
_of_two(operator.pow, lambda builder, kind, a, b: call(builder, "llvm.pow", kind, a.type, (a, b)))
for _name, _alike in (
    ("llvm.fabs", (abs, np.abs)),
    ("llvm.sqrt", (np.sqrt, math.sqrt)),
    ("llvm.exp", (np.exp, math.exp)),
    ("llvm.log", (np.log, math.log)),
):
    for _same in _alike:
        _of_one(
            _same,
            lambda builder, kind, x, name=_name: call(builder, name, kind, x.type, (x,)),
        )
_of_one(operator.neg, lambda builder, kind, x: builder.fneg(x, flags=FAST))


for _name, _function in (("and_", operator.and_), ("or_", operator.or_)):

    @infer_global(_function)
    class _OfMasks(AbstractTemplate):
        def generic(self, arguments, keywords):
            masks = len(arguments) == 2 and isinstance(arguments[0], Mask)
            if masks and arguments[0] == arguments[1]:
                return signature(arguments[0], *arguments)
            return None

    @lower_builtin(_function, Mask, Mask)
    def _combine(context, builder, sig, arguments, name=_name):
        return getattr(builder, name)(*arguments)


@instruction
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
                as_vector(context, builder, value, given, kind)
                for value, given in zip(arguments[1:], sig.args[1:], strict=True)
            )
        return builder.select(arguments[0], a, b)

    return kind(mask, a, b), generate
