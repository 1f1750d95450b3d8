"""A trial of the methods of models that pair loops call with vectors (`sph.simd`).

Compiled code refuses operations that vectors lack with a message that does not name the model. The
trial calls each method in Python first, with values that have the operations of vectors only.
"""

import inspect
from collections.abc import Iterable
from typing import Any

import numpy as np

from sph.compiled import VERBS
from sph.declarations.messages import wrong
from sph.simd.functions import BINARY, UNARY

_OF_VECTORS = {
    np.add, np.subtract, np.multiply, np.true_divide, np.power, np.negative, np.positive,
    np.absolute, *UNARY, *BINARY,
}  # fmt: skip
_COMPARISONS = {np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal}
_OF_MASKS = {np.bitwise_and, np.bitwise_or, np.bitwise_xor, np.invert}
_ALLOWED = (
    "+ - * / **, comparisons, & | ^ ~ of these, abs, larger and smaller of sph.compiled, np.where, "
    f"{', '.join(sorted(f'np.{one.__name__}' for one in {*UNARY, *BINARY}))}"
)


class _Refused(Exception):
    """The method uses what vectors lack."""


class Vector(np.lib.mixins.NDArrayOperatorsMixin):
    """Several numbers, or truth values (`is_mask`), in a trial: no values, only operations."""

    def __init__(self, is_mask: bool = False):
        self.is_mask = is_mask

    def __array_ufunc__(self, function, method, *inputs, **options):
        masks, numbers, arrays = _sorted(inputs)
        if method == "__call__" and not arrays:
            if function in _OF_MASKS and len(masks) == len(inputs):
                return Vector(is_mask=True)
            if function in _OF_VECTORS and len(masks) + len(numbers) < len(inputs):
                return Vector()
            if function in _COMPARISONS and not masks:
                return Vector(is_mask=True)
        of_what = " of a comparison" if masks else " with an array" if arrays else ""
        raise _Refused(f"np.{function.__name__}{of_what}")

    def __array_function__(self, function, kinds, arguments, options):
        if function is np.where and len(arguments) == 3:
            masks, numbers, arrays = _sorted(arguments)
            if not arrays and any(arguments[0] is one for one in (*masks, *numbers)):
                return Vector()
        raise _Refused(f"np.{function.__name__}")

    def __bool__(self):
        raise _Refused("a condition (if, and, or, not, max, min) on a value of several neighbours")


def _sorted(values):
    """Return those of the values that are masks, the numbers, and the arrays."""
    masks = [one for one in values if isinstance(one, Vector) and one.is_mask]
    others = [one for one in values if not isinstance(one, Vector)]
    numbers = [one for one in others if isinstance(one, bool | int | float | np.generic)]
    return masks, numbers, others[len(numbers) :]


def check_on_vectors(models: Iterable[Any]) -> None:
    """Check that the methods that pair loops call work on vectors. Raises DeclarationError."""
    for model in models:
        for name, verb in VERBS.items():
            method = getattr(model, name, None)
            if verb.takes_vectors and inspect.ismethod(method):
                _try(model, method, verb.verb_parameters[1:])


def _try(model, method, parameters) -> None:
    """Call a method in every number of dimensions that its arguments allow."""
    for dimension in (1, 2, 3) if "dim" in parameters else (1,):
        given = [(0,) * dimension if one == "dim" else Vector() for one in parameters]
        try:
            method(*given)
        except Exception as error:
            what = f"uses {error}" if isinstance(error, _Refused) else f"does not run ({error})"
            raise wrong(
                type(model), f"{method.__name__} {what}; pair loops call this method for several "
                f"neighbours at once. Expected only {_ALLOWED}"
            ) from error  # fmt: skip
