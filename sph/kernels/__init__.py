"""Smoothing kernels: W(r, H) = H^-D w(r/H), zero for r >= H, the support radius (eq 9).

A kernel is a file with a NamedTuple that has these methods, all without branches so that the pair
loop vectorises. `dim` is any tuple of length D, `q` = r/H >= 0. The methods w and dw_over_q omit
the normalisation C, which a loop applies once per particle.

    normalisation(dim)      C, such that the integral of C w over space is 1
    w(dim, q)               w(q) / C, zero for q >= 1
    dw_over_q(dim, q)       (dw/dq) / (q C): finite at q = 0 for smooth kernels
    force_over_q(dim, q)    like dw_over_q, for the pair force (eqs 22-23)

A kernel with the pairing instability also has the attribute `pairs_above`: for each dimension, the
largest eta without pairing in uniform gas (docs/measurements.md, section "Pairing").
"""

import numpy as np

from sph import registry
from sph.compiled import verb


@verb
def normalisation(self, dim):
    return self.normalisation(dim)


@verb
def w(self, dim, q):
    return self.w(dim, q)


@verb
def dw_over_q(self, dim, q):
    return self.dw_over_q(dim, q)


@verb
def force_over_q(self, dim, q):
    return self.force_over_q(dim, q)


def support_ratio(kernel, dimension: int) -> float:
    """Return H/h = 1/(2 sigma), with sigma the kernel's standard deviation (Dehnen & Aly 2012)."""
    dim = (0,) * dimension
    # Gauss-Legendre quadrature is exact, since kernels are polynomials between multiples of 1/6.
    node, weight = np.polynomial.legendre.leggauss(20)
    q = ((node + 1) / 2 + np.arange(6)[:, None]).ravel() / 6
    shell = np.tile(weight, 6) * q ** (dimension - 1) * kernel.w(dim, q)
    variance = np.sum(shell * q**2) / np.sum(shell) / dimension
    return float(1 / (2 * np.sqrt(variance)))


def make(name: str, **parameters):
    """Return the kernel of that name, e.g. make("cubic_spline", flattened=True)."""
    return registry.model_class("sph.kernels", name)(**parameters)
