"""Checks of what the methods of parts return, and of the arrays that passes leave."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from sph.declarations.messages import wrong
from sph.part import Part
from sph.state import State


def check_returned(parts: Iterable[Part], state: State) -> None:
    """Check names and shapes of the energies, sums and step limits of parts."""
    for part in parts:
        energies, sums = part.energies(state), part.sums(state)
        if {*energies, *sums} != {*part.columns} or energies.keys() & sums.keys():
            raise wrong(
                type(part), f"energies and sums return ({', '.join([*energies, *sums])}), expected "
                f"the names in `columns`: ({', '.join(part.columns)})"
            )  # fmt: skip
        limit = part.step_limit(state)
        arrays = {**energies, **({} if limit is None else {"step_limit": limit})}
        for name, array in arrays.items():
            if np.shape(array) != (state.number,):
                raise wrong(
                    type(part), f"{name} has the shape {np.shape(array)}, expected one number per "
                    f"particle ({state.number},)"
                )  # fmt: skip
        for name, value in sums.items():
            if not isinstance(value, int | float | np.number):
                raise wrong(type(part), f"{name} is {value!r:.60}, expected a number")


def check_issues(kind: type, found: Any, keys: Iterable[str]) -> None:
    """Check what `issues` returned: pairs of a key of [physics] and a message."""
    if not isinstance(found, list | tuple):
        raise wrong(kind, f"issues returned {found!r:.60}, expected a list")
    for one in found:
        if not isinstance(one, tuple) or len(one) != 2 or one[0] not in keys:
            raise wrong(kind, f"issues returned {one!r:.60}, expected (key of [physics], message)")


def check_arrays(parts: Iterable[Part], state: State) -> None:
    """Check types and shapes of the stored arrays, which passes may have replaced."""
    for part in parts:
        for field in part.fields:
            if not field.stored or field.integer:
                continue
            array = getattr(state, field.name)
            shape = field.shape(state.dimension, state.number)
            if np.shape(array) != shape or np.asarray(array).dtype != np.float64:
                raise wrong(
                    type(part), f"field {field.name!r} became {np.asarray(array).dtype} "
                    f"{np.shape(array)}, expected float64 {shape}"
                )  # fmt: skip
