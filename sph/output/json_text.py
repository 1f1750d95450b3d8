"""JSON of what the program computes: NumPy's values too, and numbers that JSON has not."""

import json
import math
from collections.abc import Callable, Mapping

import numpy as np


def json_text(content, endless: Callable[[float], str | None] = str) -> str:
    """`content` as JSON text; NaN and infinities are what `endless` makes of them.

    As strings "nan", "inf" and "-inf" they come back by `float`. Raises TypeError for what has no
    place in JSON.
    """
    plain = _plain(content, endless)
    return json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def null(_: float) -> None:
    """For `endless`: null, where a reader needs to know no more than that there is no number."""


def _plain(value, endless):
    """`value` in JSON's own types."""
    if isinstance(value, Mapping):
        return {str(name): _plain(inner, endless) for name, inner in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist(), endless)
    if isinstance(value, list | tuple):
        return [_plain(inner, endless) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return endless(value)
    return value
