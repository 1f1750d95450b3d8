"""JSON text of results, including NumPy values, infinities and NaN."""

import json
import math
from collections.abc import Callable, Mapping

import numpy as np


def json_text(content, endless: Callable[[float], str | None] = str) -> str:
    """Return `content` as JSON text. `endless` converts NaN and infinities.

    The default gives the strings "nan", "inf" and "-inf", which `float` reads back. Raises
    TypeError for values that JSON cannot express.
    """
    plain = _plain(content, endless)
    return json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def null(_: float) -> None:
    """Pass as `endless` to write NaN and infinities as null."""


def _plain(value, endless):
    """Return `value` converted to types of JSON."""
    if isinstance(value, Mapping):
        return {str(name): _plain(inner, endless) for name, inner in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist(), endless)
    if isinstance(value, list | tuple):
        return [_plain(inner, endless) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return endless(value)
    return value
