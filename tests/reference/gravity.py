"""Self-gravity written out densely in double precision: what the tree code is measured against.

Every particle meets every particle. Nothing is imported from the program: mass and potential of a
kernel are integrals of its shape in `dense`. Equation numbers are those of docs/equations.md.
G = 1; vectors are (3, N), scalars (N,).
"""

import dense
import numpy as np
from numpy.polynomial import Chebyshev

PIECES = 6  # kernels are polynomials between multiples of 1/6
DEGREE = 13  # of w q^2, at most


class Kernel:
    """Mass and potential of a kernel, integrated exactly from its shape w(q)."""

    def __init__(self, name):
        self.shape = dense.KERNELS[name]
        self.mass, self.work = self._integral(2), self._integral(1)

    def _integral(self, power):
        """Pieces of the integral of 4 pi w q^power from 0 to q."""
        found, so_far = [], 0.0
        for k in range(PIECES):
            ends = k / PIECES, (k + 1) / PIECES
            node = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
            q = ends[0] + (node + 1) / 2 / PIECES
            values = 4 * np.pi * self.shape(q, 3)[0] * q**power
            integral = Chebyshev.fit(q, values, DEGREE, domain=ends).integ(lbnd=ends[0])
            found.append(integral + so_far)
            so_far = found[-1](ends[1])
        return found

    def _at(self, pieces, q):
        piece = np.clip((q * PIECES).astype(int), 0, PIECES - 1)
        return np.select([piece == k for k in range(PIECES)], [one(q) for one in pieces])

    def enclosed(self, q):
        """M(q), the fraction of the mass within q; q an array, 0 to 1."""
        return self._at(self.mass, q)

    def depth(self, q):
        """-phi H/(G m) (eq 300), q > 0."""
        whole = self.work[-1](1.0)
        return self.enclosed(q) / q + whole - self._at(self.work, q)


def potentials(kernel, r, support):
    """(phi, dphi/dr, dphi/dH) of a unit mass, eqs 300-302; arrays of one shape, r > 0."""
    q = np.minimum(r / support, 1.0)
    inside = r < support
    enclosed, depth = np.where(inside, kernel.enclosed(q), 1.0), kernel.depth(q)
    phi = np.where(inside, -depth / support, -1 / r)
    return phi, enclosed / r**2, np.where(inside, (depth - enclosed / q) / support**2, 0.0)


class Pairs:
    """All pairs (i, j), i itself included, at a distance so small that its force is none."""

    def __init__(self, position):
        self.x = position[:, :, None] - position[:, None, :]
        self.r = np.sqrt((self.x**2).sum(axis=0))
        self.r[np.diag_indices(len(self.r))] = 1e-8 * self.r.max()


def energy(kernel, position, mass, support):
    """W, eq 303."""
    phi = potentials(kernel, Pairs(position).r, support[:, None])[0]
    return 0.5 * mass @ phi @ mass


def attraction(kernel, position, mass, support):
    """(acceleration, potential) with both kernels' mean and constant supports, eqs 303 and 305."""
    pairs = Pairs(position)
    own, other = (potentials(kernel, pairs.r, H) for H in (support[:, None], support[None, :]))
    pull = 0.5 * (own[1] + other[1]) / pairs.r
    return -(pairs.x * pull) @ mass, 0.5 * (own[0] + other[0]) @ mass


def zeta_over_omega(scene, kernel, position, mass, rates):
    """(N,), eq 304; rates: those of `dense.rates`."""
    by_support = potentials(kernel, Pairs(position).r, rates.support[:, None])[2] @ mass
    n = rates.density * scene.weight(mass) / mass
    return -rates.support / (3 * n) * by_support / rates.omega


def correction(scene, position, mass, support, zeta):
    """Acceleration of supports that follow the density, in eq 305; zeta: zeta/Omega."""
    pairs, weight = Pairs(position), scene.weight(mass)
    own = scene.kernel_at(pairs.r, support[:, None])[1] * zeta[:, None] * weight[None, :]
    other = scene.kernel_at(pairs.r, support[None, :])[1] * (zeta * mass)[None, :]
    other *= (weight / mass)[:, None]
    return -0.5 * (pairs.x * (own + other) / pairs.r).sum(axis=2)
