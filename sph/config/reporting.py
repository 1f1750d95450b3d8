"""Faults in the code of a user's problem, as errors that name file, line and source line."""

import functools
import inspect
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any

from pydantic import ValidationError

from sph.errors import DeclarationError, SphError
from sph.problems.support import returned

NEWLINE = "\n"


@contextmanager
def reported(origin: str, method: str = "") -> Iterator[None]:
    """Raise DeclarationError for exceptions in the file `origin` of a problem.

    The message has file, line and source line. The cause is the exception, with a traceback that
    begins in that file. Errors with a meaning stay: those of sph, those of validation outside
    methods, ValueError of `under`, and MemoryError.
    """
    try:
        yield
    except (SphError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        if isinstance(error, ValidationError) and not method:
            raise
        if isinstance(error, ValueError) and method == "under":
            raise
        words = _words(error, origin, method)
        raise DeclarationError(words) from error.with_traceback(_inside(error, origin))


def reporting(method: Callable, origin: str) -> Callable:
    """Return a method that raises DeclarationError for exceptions and wrong returned values."""
    fault_of = returned.CHECKS.get(method.__name__)

    @functools.wraps(method)
    def reporting(self, *arguments, **named):
        with reported(origin, method.__name__):
            found = method(self, *arguments, **named)
            fault = fault_of(self, found, *arguments, **named) if fault_of else ""
        if fault:
            raise DeclarationError(
                f"{definition(method, origin)}: {method.__name__} returned {fault}"
            )
        return found

    return reporting


def check_signature(method: Callable, ours: Callable, origin: str) -> None:
    """Raise DeclarationError for a method that cannot be called as `ours`, that of the base."""
    names = list(inspect.signature(ours).parameters)
    own = inspect.signature(method)
    try:
        own.bind(*names)
    except TypeError:
        raise DeclarationError(
            f"{definition(method, origin)}: {method.__name__} has the arguments "
            f"({', '.join(own.parameters)}); expected def {method.__name__}({', '.join(names)})"
        ) from None


def definition(method: Any, origin: str) -> str:
    """Return the file, with the line where the method or property begins if it is in that file."""
    function = getattr(method, "__func__", None) or getattr(method, "fget", None) or method
    code = inspect.unwrap(function).__code__
    return f"{origin}, line {code.co_firstlineno}" if code.co_filename == origin else origin


def _words(error: BaseException, origin: str, method: str) -> str:
    text = f"{type(error).__name__}: {str(error).partition(NEWLINE)[0]}".rstrip(": ")
    if isinstance(error, ValidationError) and error.errors()[0]["type"] == "frozen_instance":
        name = error.errors()[0]["loc"][0]
        text = f"self.{name} is set: keys of a problem do not change. Try: a local variable"
    if isinstance(error, SyntaxError) and error.lineno:
        where, line = f"{error.filename}, line {error.lineno}", error.text
        text = f"SyntaxError: {error.msg}"
    else:
        frames = traceback.extract_tb(error.__traceback__)
        inside = [one for one in frames if one.filename == origin]
        where = f"{origin}, line {inside[-1].lineno}" if inside else origin
        where += f", in {method}" if method else ""
        line = inside[-1].line if inside else None
    return f"{where}: {text}" + (f"\n    {line.strip()}" if line and line.strip() else "")


def _inside(error: BaseException, origin: str) -> TracebackType | None:
    """Return the traceback from its first entry in the file on, None if it has none there."""
    found = error.__traceback__
    while found is not None and found.tb_frame.f_code.co_filename != origin:
        found = found.tb_next
    return found
