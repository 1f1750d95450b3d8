"""Checks of what the methods of a problem return, in words for a user who wrote the problem."""

from collections.abc import Callable
from typing import Any

import numpy as np

# Shape of each array by name: "N", or "DN" for a vector.
STATE = {"position": "DN", "velocity": "DN", "mass": "N", "internal_energy": "N"}
EXACT = {"density": "N", "velocity": "DN", "pressure": "N", "internal_energy": "N"}


def fault_of_state(problem, state: Any, *_, **__) -> str:
    """Return what is wrong with an initial state, or ""; problem: for the number of dimensions."""
    missing = [name for name in STATE if not hasattr(state, name)]
    if missing:
        return f"a {type(state).__name__}; expected sph.problems.base.InitialState"
    arrays = {name: getattr(state, name) for name in STATE}
    shape = np.shape(state.position)
    is_position = len(shape) == 2 and shape[0] == problem.dimension
    number = shape[1] if is_position else np.size(state.mass)
    if not number:
        return f"position of the shape {shape}; expected (D, N), with N particles"
    fault = fault_of_arrays(arrays, STATE, problem.dimension, number)
    if not fault and not np.all(arrays["mass"] > 0):
        fault = "masses that are not above 0"
    return fault or _fault_outside(problem, np.asarray(arrays["position"]))


def _fault_outside(problem, position: np.ndarray) -> str:
    """Return the first particle outside the box along an axis that is not open, or ""."""
    for axis, ((low, high), boundary) in enumerate(
        zip(problem.box, problem.boundaries, strict=True)
    ):
        outside = np.flatnonzero((position[axis] < low) | (position[axis] > high))
        if outside.size and boundary != "open":
            i = outside[0]
            return (
                f"particle {i + 1} at {'xyz'[axis]} = {position[axis, i]:g}, outside the domain "
                f"[{low:g}, {high:g}], which is {boundary} along that axis"
            )
    return ""


def fault_of_arrays(arrays: dict, shapes: dict[str, str], dimension: int, number: int) -> str:
    """Return the first array that is not of numbers or of another shape, or ""."""
    for name, shape in shapes.items():
        array = np.asarray(arrays[name])
        if array.dtype.kind not in "fiu":
            return f"{name} of the type {array.dtype}; expected numbers"
        expected = (dimension, number) if shape == "DN" else (number,)
        if array.shape != expected:
            hint = ". Try: the transpose" if array.shape == expected[::-1] != expected else ""
            words = "(D, N)" if shape == "DN" else "(N,)"
            return f"{name} of the shape {array.shape}; expected {words} = {expected}{hint}"
        if not np.all(np.isfinite(array)):
            return f"{name} with values that are not finite"
    return ""


def _fault_of_exact(problem, found: Any, eos, time: float, position: np.ndarray) -> str:
    if found is None:
        return ""
    missing = EXACT.keys() - found.keys() if isinstance(found, dict) else ()
    if missing or not isinstance(found, dict):
        without = ", ".join(name for name in EXACT if name in missing)
        words = f"a dictionary without {without}" if without else _words(found)
        return f"{words}; expected a dictionary of {', '.join(EXACT)}"
    shapes = EXACT | ({"stress": "N"} if "stress" in found else {})
    arrays = {name: np.asarray(found[name]) for name in shapes}
    known = {  # NaN: not known
        name: np.nan_to_num(one) if one.dtype.kind == "f" else one for name, one in arrays.items()
    }
    fault = fault_of_arrays(known, shapes, problem.dimension, np.shape(position)[-1])
    return fault and f"{fault}; position has the shape {np.shape(position)}"


def _fault_of_ends(problem, found: Any, *_, **__) -> str:
    if isinstance(found, tuple) and len(found) == 2:
        time, reason = found
        if isinstance(time, (int, float, np.number)) and isinstance(reason, str):
            return ""
    return f"{_words(found)}; expected a time and a text, such as (math.inf, '')"


def _fault_of_range(problem, found: Any, *_, **__) -> str:
    expected = (problem.dimension, 2)
    if np.shape(found) == expected and np.asarray(found).dtype.kind in "fiu":
        return ""
    return (
        f"an array of the shape {np.shape(found)}; expected (D, 2) = {expected}, the range of each "
        "axis"
    )


def _fault_of_region(problem, found: Any, eos, time: float, position: np.ndarray) -> str:
    number = np.shape(position)[-1]
    if isinstance(found, tuple) and len(found) == 2:
        mask, name = np.asarray(found[0]), found[1]
        if mask.shape == (number,) and mask.dtype == bool and isinstance(name, str):
            return ""
    return f"{_words(found)}; expected a mask of the shape (N,) = ({number},) and a text"


def _fault_of_theory(problem, found: Any, eos, times: np.ndarray) -> str:
    if not isinstance(found, dict):
        return f"{_words(found)}; expected a dictionary of arrays by column of the history"
    for name, values in found.items():
        if np.shape(values) != np.shape(times) or np.asarray(values).dtype.kind not in "fiu":
            return (
                f"{name} of the shape {np.shape(values)}; expected numbers of the shape (M,) = "
                f"{np.shape(times)}, that of times"
            )
    return ""


def _fault_of_reason(problem, found: Any, *_, **__) -> str:
    return "" if found is None or isinstance(found, str) else f"{_words(found)}; expected a text"


def _fault_of_numbers(problem, found: Any, *_, **__) -> str:
    """Numbers by name: diagnostics, and numbers of the summary."""
    if not isinstance(found, dict) or not all(isinstance(name, str) for name in found):
        return f"{_words(found)}; expected a dictionary of numbers by name"
    for name, value in found.items():
        if np.ndim(value) or not isinstance(value, (int, float, np.number)):
            return f"{name} = {_words(value)}; expected a number"
    return ""


def _fault_of_texts(problem, found: Any, *_, **__) -> str:
    if isinstance(found, list) and all(isinstance(one, str) for one in found):
        return ""
    return f"{_words(found)}; expected a list of texts"


def _fault_of_columns(problem, found: Any, *_, **__) -> str:
    """Columns of the history, whose names are the first line of a CSV file."""
    fault = _fault_of_numbers(problem, found)
    wrong = [] if fault else [name for name in found if not name or set(name) & set(',"\n\r')]
    return fault or (f"the name {wrong[0]!r}; expected a name without commas" if wrong else "")


def _words(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 60 else f"a {type(value).__name__}"


CHECKS: dict[str, Callable[..., str]] = {
    "initial": fault_of_state,
    "exact": _fault_of_exact,
    "exact_ends": _fault_of_ends,
    "undisturbed": _fault_of_range,
    "error_region": _fault_of_region,
    "departs": _fault_of_reason,
    "remarks": _fault_of_texts,
    "theory": _fault_of_theory,
    "diagnostics": _fault_of_columns,
    "report": _fault_of_numbers,
    "compare": _fault_of_numbers,
    "over_time": _fault_of_numbers,
}
