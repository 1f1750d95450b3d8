"""Smoothing kernels: W(r, H) = H^-D w(r/H), zero for r >= H, the support radius (eq 9)."""

import functools
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from sph import registry
from sph.compiled import verb
from sph.model import Model

Dim = tuple[int, ...]  # any tuple of length D: the number of dimensions


class Kernel(Protocol):
    """A kernel: a file with a NamedTuple that has these methods.

    The methods have no branches, so that the compiler can vectorise the pair loop. q = r/H >= 0 is
    a number in compiled code and an array of any shape elsewhere. w and its derivative do not
    contain the normalisation C, which a loop applies once per particle.
    """

    def normalisation(self, dim: Dim) -> float:
        """C, such that the integral of C w over space is 1."""

    def w(self, dim: Dim, q: Any) -> Any:
        """w(q) / C, zero for q >= 1."""

    def dw_over_q(self, dim: Dim, q: Any) -> Any:
        """(dw/dq) / (q C): finite at q = 0 where the kernel is smooth."""

    def force_over_q(self, dim: Dim, q: Any) -> Any:
        """The value that replaces dw_over_q in the pair force (eqs 22-23); usually equal to it."""

    # The two methods below are for self-gravity in 3-D (eqs 300 and 301), and for q <= 1 only. A
    # kernel may lack them: scenes with gravity then refuse the kernel.

    def enclosed_over_q3(self, q: Any) -> Any:
        """M(q)/q^3, with M the fraction of the kernel's mass within q: 1 at q = 1."""

    def potential_depth(self, q: Any) -> Any:
        """-phi H/(G m), with phi the potential of a mass m with the kernel's density: 1 at 1."""


class Defaults(Model):
    """Defaults of a kernel: attributes that its class need not define."""

    # whether the pair force uses a constant gradient near the centre
    flattened: bool = False
    # By dimension, the largest eta at which the particles of uniform gas do not form close pairs
    # (docs/measurements.md, section "Pairing").
    pairs_above: Mapping[int, float] = MappingProxyType({})

    @classmethod
    def required(cls) -> tuple[str, ...]:
        return "normalisation", "w", "dw_over_q", "force_over_q"


@verb
def normalisation(self: Kernel, dim: Dim) -> float:
    return self.normalisation(dim)


normalisation.takes_vectors = False  # type: ignore[attr-defined]


@verb
def w(self: Kernel, dim: Dim, q: Any) -> Any:
    return self.w(dim, q)


@verb
def dw_over_q(self: Kernel, dim: Dim, q: Any) -> Any:
    return self.dw_over_q(dim, q)


@verb
def force_over_q(self: Kernel, dim: Dim, q: Any) -> Any:
    return self.force_over_q(dim, q)


@verb
def enclosed_over_q3(self: Kernel, q: Any) -> Any:
    return self.enclosed_over_q3(q)


@verb
def potential_depth(self: Kernel, q: Any) -> Any:
    return self.potential_depth(q)


def softens(kernel: Kernel) -> bool:
    """Return whether a kernel has the methods that self-gravity needs."""
    return hasattr(kernel, "enclosed_over_q3") and hasattr(kernel, "potential_depth")


@functools.lru_cache(64, typed=True)  # typed: kernels of two classes may hold equal parameters
def support_ratio(kernel: Kernel, dimension: int) -> float:
    """Return H/h = 1/(2 sigma), with sigma the kernel's standard deviation (Dehnen & Aly 2012)."""
    dim = (0,) * dimension
    # Gauss-Legendre quadrature is exact, since kernels are polynomials between multiples of 1/6.
    node, weight = np.polynomial.legendre.leggauss(20)
    q = ((node + 1) / 2 + np.arange(6)[:, None]).ravel() / 6
    shell = np.tile(weight, 6) * q ** (dimension - 1) * kernel.w(dim, q)
    variance = np.sum(shell * q**2) / np.sum(shell) / dimension
    return float(1 / (2 * np.sqrt(variance)))


def make(name: str, **parameters: Any) -> Kernel:
    """Return the kernel of that name, e.g. make("cubic_spline", flattened=True)."""
    return registry.model_class("sph.kernels", name)(**parameters)
