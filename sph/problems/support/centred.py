"""Positions and velocities about the centre of a problem, which may move.

The centre moves with the drift of the problem. Exact solutions of vortices, errors, figures and
exports take r, v_r and v_phi from here.
"""

import numpy as np


def offset(problem, time: float, position: np.ndarray) -> np.ndarray:
    """Return (D, N) offsets of positions from the centre at `time`, from its nearest image.

    Images are those of periodic axes.
    """
    centre = problem.centre + problem.drift * time
    found = position - centre[:, None]
    for axis, boundary in enumerate(problem.boundaries):
        if boundary == "periodic":
            length = problem.box[axis, 1] - problem.box[axis, 0]
            found[axis] -= length * np.round(found[axis] / length)
    return found


def radius(offset: np.ndarray) -> np.ndarray:
    """Return the length (N,) of offsets (D, N)."""
    return np.hypot(*offset) if len(offset) == 2 else np.linalg.norm(offset, axis=0)


def components(problem, offset: np.ndarray, velocity: np.ndarray) -> dict[str, np.ndarray]:
    """Return the components (N,) of velocities (D, N), less the drift, at offsets (D, N).

    v_r: along the radius; v_phi, in 2-D: across it, anticlockwise. Both are 0 at the centre itself.
    """
    length = radius(offset)
    along = offset * (1.0 / np.where(length > 0.0, length, 1.0))
    moving = velocity - problem.drift[:, None]
    found = {"v_r": (moving * along).sum(axis=0)}
    if len(offset) == 2:
        found["v_phi"] = along[0] * moving[1] - along[1] * moving[0]
    return found
