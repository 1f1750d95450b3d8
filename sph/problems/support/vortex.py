"""Rotation about the centre of a periodic box."""

import numpy as np


def from_centre(box, position, velocity, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Offset (D, N) from the centre of a periodic box, carried along, and its length (N,)."""
    length = (box[:, 1] - box[:, 0])[:, None]
    centre = box.mean(axis=1)[:, None] + np.array(velocity)[:, None] * time
    offset = position - centre
    offset -= length * np.round(offset / length)
    return offset, np.hypot(*offset)


def rotation(offset: np.ndarray, rate) -> np.ndarray:
    """Velocity (2, N) of a rotation at `rate` (N,), anticlockwise, at `offset` (2, N)."""
    return rate * np.stack([-offset[1], offset[0]])
