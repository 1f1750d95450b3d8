"""Calls of compiled functions by address, with arguments held in memory.

If a compiled function calls another by name, Numba links the code of the callee into that of the
caller and optimises it again. A call by address needs no second compilation, and the caller's own
code depends neither on the callee nor on the types of its arguments.

Numba's native functions take their arguments flattened: an array is a sequence of integers (address
of the data, shape, strides), a tuple is the sequence of its entries. A `Table` holds such arguments
as 64-bit words. A thunk, a few instructions made here for each native signature, loads the words of
a call and calls the function:

    words of a call: address of the function, RESULTS words for its result, its arguments
"""

import struct
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import types
from numba.core.errors import NumbaError
from numba.core.typing.typeof import Purpose, typeof
from numba.extending import intrinsic

RESULTS = 12  # words for the result of a function

WORD = ir.IntType(64)
STATUS = ir.IntType(32)  # of a call: 0 if the function raised no exception

WORDS = str(WORD.as_pointer())

Signature = tuple[str, ...]  # LLVM's types of the arguments of a function
_TYPES = {str(one): one for one in (WORD, STATUS, ir.DoubleType(), ir.IntType(8), ir.IntType(1))}

_thunks: dict[Signature, int] = {}  # addresses by native signature
_engines: list[llvm.ExecutionEngine] = []  # which own the code of the thunks


class Unsuitable(Exception):
    """A call cannot be held in a table."""


class Held(NamedTuple):
    """An argument, or an entry of a tuple, whose words a table finds again by name."""

    name: str
    value: Any


class Table:
    """Calls with their arguments in memory."""

    def __init__(self):
        self._words: list[int] = []
        self._begins: list[int] = []
        self._signatures: list[Signature] = []
        self.places: dict[str, list[int]] = {}  # of `Held` arguments: indices of their first words

    def add(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Add a call of a function that Numba compiled, with arguments or `Held` arguments.

        Raises Unsuitable.
        """
        signature = tuple(typeof(_plain(one), Purpose.argument) for one in arguments)
        try:
            function.compile(signature)  # type: ignore[attr-defined]
        except (NumbaError, TypeError) as error:  # other arguments, such as those with defaults
            raise Unsuitable(f"{function}: {error}") from error
        found = function.overloads[signature]  # type: ignore[attr-defined]
        described = found.fndesc
        _check_result(described.restype)
        native = found.target_context.call_conv.get_function_type(
            described.restype, described.argtypes
        )
        begin = len(self._words)
        self._begins.append(begin)
        # two addresses come first: those of the result and of the exception
        self._signatures.append(tuple(map(_native, native.args[2:])))
        self._words.append(found.library.get_pointer_to_function(described.llvm_func_name))
        self._words += [0] * RESULTS
        for one in arguments:
            for name, word in _flat(one):
                if name is None:
                    self._words.append(word)
                else:
                    self.places.setdefault(name, []).append(len(self._words))
        if len(self._words) - begin - 1 - RESULTS != len(self._signatures[-1]):
            raise Unsuitable(f"{function}: expected {len(self._signatures[-1])} words")

    def finished(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the words, and for each call (K, 2) the address of its thunk and its first word.

        int64; the words must not be moved in memory.
        """
        words = np.array(self._words, np.int64)
        thunks = _thunks_of(self._signatures)
        return words, np.array(list(zip(thunks, self._begins, strict=True)), np.int64)


def words_of(argument: Any) -> list[int]:
    """Return the words of an argument, as signed integers."""
    return [word for name, word in _flat(argument) if name is None]


def _plain(argument: Any) -> Any:
    """Return an argument without `Held`."""
    if isinstance(argument, Held):
        return _plain(argument.value)
    if isinstance(argument, tuple):
        plain = [_plain(one) for one in argument]
        return type(argument)(*plain) if hasattr(argument, "_fields") else tuple(plain)
    return argument


def _flat(argument: Any) -> Iterator[tuple[str | None, int]]:
    """Yield (None, word) for each word of an argument, and (name, 0) before those of a `Held`."""
    if isinstance(argument, Held):
        # the address of an array comes after two words of its owner, which stay 0, and its size
        ahead = 4 if isinstance(argument.value, np.ndarray) else 0
        for index, one in enumerate(_flat(argument.value)):
            if index == ahead:
                yield argument.name, 0
            yield one
    elif argument is None:
        yield None, 0
    elif isinstance(argument, tuple):
        for one in argument:
            yield from _flat(one)
    elif isinstance(argument, np.ndarray):
        shape = argument.shape, argument.strides
        owners = 0, 0
        for word in (*owners, argument.size, argument.itemsize, address(argument), *shape[0],
                     *shape[1]):  # fmt: skip
            yield None, word
    elif isinstance(argument, float):
        yield None, struct.unpack("q", struct.pack("d", argument))[0]
    elif isinstance(argument, int | np.integer | np.bool_):
        yield None, int(argument)
    else:
        raise Unsuitable(f"expected numbers, arrays and tuples of these, not {argument!r:.60}")


def address(array: np.ndarray) -> int:
    """Return the address of the first entry."""
    return array.__array_interface__["data"][0]


def _check_result(kind: Any) -> None:
    """Check that a result is words in order: a number, or a tuple of numbers."""
    entries = [*kind] if isinstance(kind, types.BaseTuple) else [kind]  # type: ignore[misc]
    known = types.float64, types.int64, types.none
    if len(entries) > RESULTS or any(one not in known for one in entries):
        raise Unsuitable(f"expected up to {RESULTS} numbers as result, not {kind}")


def _thunks_of(signatures: list[Signature]) -> list[int]:
    """Return the addresses of the thunks for native signatures."""
    new = [one for one in dict.fromkeys(signatures) if one not in _thunks]
    if new:
        text = "".join(_thunk(number, one) for number, one in enumerate(new))
        # loads and a call: there is nothing to optimise
        machine = llvm.Target.from_default_triple().create_target_machine(opt=0)
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(text), machine)
        engine.finalize_object()
        _engines.append(engine)
        _thunks.update((one, engine.get_function_address(f"thunk{k}")) for k, one in enumerate(new))
    return [_thunks[one] for one in signatures]


def _native(kind: ir.Type) -> str:
    """Return the type in which a word is passed."""
    text = str(kind)
    if isinstance(kind, ir.PointerType) or text == "i64":
        return "i64"
    if text not in ("double", "i32", "i8", "i1"):
        raise Unsuitable(f"an argument of type {text}")
    return text


def _thunk(number: int, signature: Signature) -> str:
    """Return a thunk in LLVM's language, written here since llvmlite's builder takes longer."""
    given = ["i64", "i64", *signature]  # addresses of the results and of the unused exception
    function = ir.FunctionType(STATUS, [_TYPES[one] for one in given]).as_pointer()
    lines = [
        f"define i32 @thunk{number}({WORDS} %w) {{", "%unused = alloca i64",
        f"%r = getelementptr i64, {WORDS} %w, i64 1", f"%g0 = ptrtoint {WORDS} %r to i64",
        f"%g1 = ptrtoint {WORDS} %unused to i64", f"%a = load i64, {WORDS} %w",
        f"%f = inttoptr i64 %a to {function}",
    ]  # fmt: skip
    for k, kind in enumerate(signature, start=2):
        lines.append(f"%p{k} = getelementptr i64, {WORDS} %w, i64 {RESULTS + k - 1}")
        name = f"%g{k}" if kind == "i64" else f"%l{k}"
        lines.append(f"{name} = load i64, {WORDS} %p{k}")
        if kind != "i64":
            how = "bitcast" if kind == "double" else "trunc"
            lines.append(f"%g{k} = {how} i64 %l{k} to {kind}")
    arguments = ", ".join(f"{kind} %g{k}" for k, kind in enumerate(given))
    return "\n".join([*lines, f"%s = call i32 %f({arguments})", "ret i32 %s", "}", ""])


@intrinsic
def call(typingctx, thunk, words):
    """Call a thunk with the address of the first word of a call. Returns the status."""

    def generate(context, builder, signature, arguments):
        kind = ir.FunctionType(STATUS, [WORD.as_pointer()])
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        return builder.call(function, [builder.inttoptr(arguments[1], WORD.as_pointer())])

    return types.int32(types.int64, types.int64), generate


@intrinsic
def read_clock(typingctx, function, clock, time):
    """Call clock_gettime at an address; `time` is the address of two words, s and ns."""

    def generate(context, builder, signature, arguments):
        kind = ir.FunctionType(STATUS, [STATUS, WORD.as_pointer()])
        called = builder.inttoptr(arguments[0], kind.as_pointer())
        which = builder.trunc(arguments[1], STATUS)
        return builder.call(called, [which, builder.inttoptr(arguments[2], WORD.as_pointer())])

    return types.int32(types.int64, types.int64, types.int64), generate
