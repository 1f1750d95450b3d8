"""Velocities of gas that rotates."""

import numpy as np


def rotation(offset: np.ndarray, rate) -> np.ndarray:
    """Velocity (2, N) of a rotation at `rate` (N,), anticlockwise, at `offset` (2, N)."""
    return rate * np.stack([-offset[1], offset[0]])
