"""Compiler flags, calls of model methods (verbs), and vectorisable minimum and maximum."""

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, overload

from sph import compile_cache, lean_compiler
from sph.lean_compiler import Lean

compile_cache.install()
lean_compiler.install()

# Without "nnan" and "ninf": those would let the compiler remove every test for a non-finite number.
FASTMATH = {"nsz", "arcp", "contract", "afn", "reassoc"}

# NumPy's error model: with Python's check for division by zero no loop would vectorise.
FLAGS: dict[str, Any] = {"fastmath": FASTMATH, "error_model": "numpy"}

# Numba adds to each function a wrapper for callers from C. There are none.
LEAN: dict[str, Any] = {"no_cfunc_wrapper": True, "pipeline_class": Lean}

# Options of every compiled function: @njit(**COMPILED). None is compiled with parallel=True: passes
# release the interpreter's lock and run over ranges of blocks on Python threads (sph/threads.py),
# which costs no second compilation and takes nested models.
COMPILED: dict[str, Any] = {"cache": True, "nogil": True, **FLAGS, **LEAN}


# For functions with floating-point sums that other compiled functions call. A function that is not
# inlined exists in two compiled copies, which may round differently: the process that compiles the
# caller uses one copy, and a process that finds the caller in the cache uses the other. Python
# cannot call them: the wrapper for that would hold the code a second time.
INLINED: dict[str, Any] = {**FLAGS, **LEAN, "forceinline": True, "no_cpython_wrapper": True}


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


def instruction(emit) -> Any:
    """Make a function that returns (signature, LLVM code) one that compiled code can call."""
    return intrinsic(emit)


def larger(a, b):
    """The larger of two numbers (undefined for NaN), or elementwise in NumPy."""
    return np.maximum(a, b)


def smaller(a, b):
    """The smaller of two numbers (undefined for NaN), or elementwise in NumPy."""
    return np.minimum(a, b)


def _extremum(function, llvm_name):
    """Define function(a, b) of two numbers by llvm.maxnum or llvm.minnum, with all fast flags.

    Python's max() carries rules for NaN that stop LLVM from vectorising a reduction over it.
    """

    @infer_global(function)
    class Typed(AbstractTemplate):
        def generic(self, arguments, keywords):
            numbers = [one for one in arguments if isinstance(one, types.Number | types.Boolean)]
            if len(arguments) == len(numbers) == 2 and not keywords:
                kind = self.context.unify_types(*numbers)
                return signature(kind, kind, kind) if isinstance(kind, types.Float) else None
            return None

    @lower_builtin(function, types.Float, types.Float)
    def lower(context, builder, sig, arguments):
        kind = arguments[0].type
        of_two = builder.module.declare_intrinsic(
            llvm_name, [kind], ir.FunctionType(kind, [kind, kind])
        )
        return builder.call(of_two, arguments, fastmath=("fast",))


_extremum(larger, "llvm.maxnum")
_extremum(smaller, "llvm.minnum")
