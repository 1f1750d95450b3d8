"""Smoothing kernels: W(r, H) = H^-D w(r/H) with compact support r < H (seed eq 9).

A kernel is a file that holds a NamedTuple with these methods, all free of branches so that
the pair loop vectorises. `dim` is any tuple of length D, `q` = r/H >= 0; w and its derivative come
without the normalisation C, which a loop applies once a particle.

    normalisation(dim)      C, such that the integral of C w over space is 1
    w(dim, q)               w(q) / C, zero for q >= 1
    dw_over_q(dim, q)       (dw/dq) / (q C): finite at q = 0 where the kernel is smooth
    force_over_q(dim, q)    the same, as it enters the pair force (eqs 22-23)

and, where its particles pair at large eta, the attribute `pairs_above`: by dimension, the largest
eta at which the particles of uniform gas stay apart (docs/measurements.md, section "Pairing").
"""

import functools
from types import MappingProxyType

import numpy as np

from sph import registry
from sph.compiled import verb
from sph.model import Model


class Kernel(Model):
    """What a kernel may leave out."""

    flattened = False  # whether the force keeps the gradient near the centre
    pairs_above = MappingProxyType({})


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


@functools.lru_cache(64, typed=True)  # typed: kernels of two classes may hold equal parameters
def support_ratio(kernel, dimension: int) -> float:
    """H/h = 1/(2 sigma), sigma the kernel's standard deviation per axis (Dehnen & Aly 2012)."""
    dim = (0,) * dimension
    # Gauss's rule is exact for the polynomials that a kernel is made of, joined at sixths.
    node, weight = np.polynomial.legendre.leggauss(20)
    q = ((node + 1) / 2 + np.arange(6)[:, None]).ravel() / 6
    shell = np.tile(weight, 6) * q ** (dimension - 1) * kernel.w(dim, q)
    variance = np.sum(shell * q**2) / np.sum(shell) / dimension
    return float(1 / (2 * np.sqrt(variance)))


def make(name: str, **parameters):
    """The kernel of that name, e.g. make("cubic_spline", flattened=True)."""
    return registry.model_class("sph.kernels", name)(**parameters)
