"""Outlines of several solid bodies on a map."""

import numpy as np

from sph.analysis.figures.sources import State
from sph.analysis.interpolate import Plane, with_cover

AT_SURFACE = 0.5  # sum of V W at a plane surface of matter that ends at its particles
MOST_BODIES = 12  # of which outlines are drawn


def shares(state: State, plane: Plane) -> np.ndarray:
    """(B, ny, nx) the part of each body in the matter of a pixel; B is 0 without several bodies."""
    body = state.particles.get("body")
    numbers = np.unique(body) if body is not None else np.zeros(0)
    if not 2 <= numbers.size <= MOST_BODIES:
        return np.zeros((0, *plane.shape[::-1]))
    is_of = np.stack([body == one for one in numbers])
    found, cover = with_cover(is_of, state.particles, state.domain, state.kernel, plane)
    return np.where(cover > AT_SURFACE, found, 0.0)


def draw(panel, plane: Plane, of_bodies: np.ndarray) -> None:
    """Draw the outlines of bodies, which may touch each other. of_bodies: see `shares`."""
    x, y = (plane.low[d] + plane.step[d] * (np.arange(plane.shape[d]) + 0.5) for d in range(2))
    for share in of_bodies:
        if share.size and share.min() < 0.5 < share.max():  # a part of the edge is on the map
            panel.contour(x, y, share, levels=[0.5], colors="white", linewidths=0.7)
