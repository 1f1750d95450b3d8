"""Compiled functions that run expressions on vectors, for the tests of these."""

import numpy as np
import pytest
from numba import njit

from sph import simd
from sph.compiled import FLAGS, larger, smaller

LANES = {"double": simd.DOUBLE, "single": simd.SINGLE, "scalar": simd.SCALAR}
every_lanes = pytest.mark.parametrize("lanes", LANES.values(), ids=LANES)


def precision(lanes):
    """The type of NumPy with the precision of `lanes`."""
    return np.float32 if lanes is simd.SINGLE else np.float64


def compiled(source, **names):
    """The function `run` that `source` defines, compiled; names: what it uses."""
    space = {**vars(simd), "larger": larger, "smaller": smaller, "np": np, **names}
    exec(source, space)
    return njit(**FLAGS)(space["run"])
