"""Short tracebacks for errors that are a user's to mend."""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from sph.errors import DeclarationError, SphError

Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")


def concise(function: Callable[Parameters, Returned]) -> Callable[Parameters, Returned]:
    """Let errors of sph leave `function` without the frames inside sph.

    The message says what was wrong. Exceptions in a problem file stay as the cause, with frames in
    that file; errors of sph that caused others do not.
    """

    @functools.wraps(function)
    def concisely(*arguments: Parameters.args, **named: Parameters.kwargs) -> Returned:
        try:
            return function(*arguments, **named)
        except SphError as error:
            cause = error.__cause__ if isinstance(error, DeclarationError) else None
            raise error.with_traceback(None) from cause

    return concisely
