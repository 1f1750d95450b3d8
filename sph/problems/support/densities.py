"""Densities of particles before a run, for initial states that depend on them."""

import numpy as np

from sph import kernels

PASSES = 20  # fixed-point iteration; the error falls by 2 to 3 each time
CHUNK = 4000  # particles at a time, for a small memory


def summed(position: np.ndarray, mass: float, kernel, eta: float) -> np.ndarray:
    """Return the SPH densities (N,) of particles of one mass at (3, N) positions (eqs 7 and 15).

    Support radii follow the densities, as in a run.
    """
    from scipy.spatial import cKDTree  # costs 0.1 s to import

    dim = (0,) * 3
    weight = mass * kernels.normalisation(kernel, dim)
    ratio = eta * kernels.support_ratio(kernel, 3)
    within = int(4.0 * ratio**3) + 1  # particles in a support of uniform gas
    tree = cKDTree(position.T)
    found = np.empty(position.shape[1])
    for first in range(0, found.size, CHUNK):
        part = slice(first, first + CHUNK)
        count = min(2 * within, found.size)
        distance = np.atleast_2d(tree.query(position.T[part], k=count)[0])
        support = distance[:, min(within, count) - 1]
        for _ in range(PASSES):
            q = np.minimum(distance / support[:, None], 1.0)
            density = weight * kernels.w(kernel, dim, q).sum(axis=1) / support**3
            support = np.sqrt(support * ratio * (mass / density) ** (1.0 / 3.0))
        found[part] = density
    return found
