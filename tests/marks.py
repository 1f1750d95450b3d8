"""Parameters of tests of which most have the mark `slow`, as each compiles code of its own."""

from collections.abc import Collection, Iterable

import pytest


def slow_except(fast: Collection[int], values: Iterable) -> list:
    """Return the values as parameters, with the mark `slow` but for those at indices `fast`."""
    return [
        pytest.param(value, marks=() if i in fast else pytest.mark.slow)
        for i, value in enumerate(values)
    ]
