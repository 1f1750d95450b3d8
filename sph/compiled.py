"""Compiler flags, calls of model methods (verbs), and vectorisable minimum and maximum."""

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from sph import compile_cache

compile_cache.install()

# Without "nnan" and "ninf": those would let the compiler remove every test for a non-finite number.
FASTMATH = {"nsz", "arcp", "contract", "afn", "reassoc"}

# NumPy's error model: with Python's check for division by zero no loop would vectorise.
FLAGS: dict[str, Any] = {"fastmath": FASTMATH, "error_model": "numpy"}

# Without this, Numba adds to each function a wrapper for callers from C. There are none.
_NO_C: dict[str, Any] = {"no_cfunc_wrapper": True}

# Options of every compiled function: @njit(**COMPILED). None is compiled with parallel=True: passes
# release the interpreter's lock and run over ranges of blocks on Python threads (sph/threads.py),
# which costs no second compilation and takes nested models.
COMPILED: dict[str, Any] = {"cache": True, "nogil": True, **FLAGS, **_NO_C}


# For functions with floating-point sums that other compiled functions call. A function that is not
# inlined exists in two compiled copies, which may round differently: the process that compiles the
# caller uses one copy, and a process that finds the caller in the cache uses the other. Python
# cannot call them: the wrapper for that would hold the code a second time.
INLINED: dict[str, Any] = {**FLAGS, **_NO_C, "forceinline": True, "no_cpython_wrapper": True}


Verb = TypeVar("Verb", bound=Callable[..., Any])

VERBS: dict[str, Any] = {}  # every verb, by name


def verb(stub: Verb) -> Verb:
    """Make `stub(model, ...)` resolve at compile time to that method of the model's class.

    A model (kernel, equation of state, viscosity) is a NamedTuple whose methods are its formulas:
    called from Python they work on NumPy arrays, called from compiled code they are inlined.
    The method's parameters must have the stub's names. A new model needs only a new class.

    Pair loops call the methods with vectors (`sph.simd`), unless `takes_vectors` of the verb is set
    to False.
    """
    name = stub.__name__
    parameters = list(inspect.signature(stub).parameters)

    def pick(self, *_):
        is_model = isinstance(self, types.BaseNamedTuple)
        return getattr(self.instance_class, name) if is_model else None

    # Numba compares the names of the parameters, so the function it gets must have the stub's own.
    source = f"lambda {', '.join(parameters)}: pick({', '.join(parameters)})"
    found = eval(source, {"pick": pick})
    overload(stub, jit_options=INLINED)(found)  # type: ignore[arg-type]
    stub.verb_parameters = parameters  # type: ignore[attr-defined]
    stub.takes_vectors = True  # type: ignore[attr-defined]
    VERBS[name] = stub
    return stub


def _fast_binary(llvm_name: str):
    """An intrinsic for llvm.maxnum or llvm.minnum with all fast flags.

    Python's max() carries rules for NaN that stop LLVM from vectorising a reduction over it.
    """

    @intrinsic
    def operation(typingctx, a, b):
        common = typingctx.unify_types(a, b)
        if not isinstance(common, types.Float):
            return None

        def generate(context, builder, signature, arguments):
            arguments = [
                context.cast(builder, value, given, common)
                for value, given in zip(arguments, signature.args, strict=True)
            ]
            kind = arguments[0].type
            function = builder.module.declare_intrinsic(
                llvm_name, [kind], ir.FunctionType(kind, [kind, kind])
            )
            return builder.call(function, arguments, fastmath=("fast",))

        return common(a, b), generate

    return operation


_maxnum = _fast_binary("llvm.maxnum")
_minnum = _fast_binary("llvm.minnum")


def larger(a, b):
    """The larger of two numbers (undefined for NaN), or elementwise in NumPy."""
    return np.maximum(a, b)


def smaller(a, b):
    """The smaller of two numbers (undefined for NaN), or elementwise in NumPy."""
    return np.minimum(a, b)


def _are_numbers(*kinds):
    return all(isinstance(one, types.Number | types.Boolean) for one in kinds)


@overload(larger, jit_options=FLAGS)  # type: ignore[arg-type]
def _larger(a, b):
    return (lambda a, b: _maxnum(a, b)) if _are_numbers(a, b) else None


@overload(smaller, jit_options=FLAGS)  # type: ignore[arg-type]
def _smaller(a, b):
    return (lambda a, b: _minnum(a, b)) if _are_numbers(a, b) else None
