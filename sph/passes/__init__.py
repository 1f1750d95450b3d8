"""Passes over the blocks' candidates: the sums over neighbours that the schemes share.

`density` needs sums over each particle's own support only (H, rho, Omega, div v, curl v), and what
follows from them particle by particle; `rates` is the pair force and heating. Each copies a block's
candidates into contiguous scratch, images applied, and runs branch-free loops over it for every
particle of the block: gather only, one writer a particle, in a fixed order, so results do not
depend on the number of threads.

Arguments that are None leave their part out of the compiled code: div_v (nothing needs the
divergence), curl_v (1-D, or no Balsara factor), f (no Balsara factor), alpha (one constant),
conducted (no conductivity), shares (no switch for it), summed (the scheme takes its pressure from
the equation of state).
"""

from typing import NamedTuple

import numpy as np

TINY = 1e-300  # keeps 1/r finite where r_ij = 0 and what it multiplies is zero too


class Models(NamedTuple):
    """What the formulas are made of; the types decide what is compiled, the values do not."""

    scheme: tuple
    kernel: tuple
    smoothing: tuple
    weighting: tuple
    eos: tuple
    viscosity: tuple
    conductivity: tuple | None
    balsara: tuple | None
    support_ratio: float  # H/h of the kernel
    eta: float
    max_support: float  # H is held there where it has no root within; inf: nowhere


class Neighbours(NamedTuple):
    """Candidates of every block, complete within reach_factor list_support of its particles."""

    lists: tuple
    images: tuple
    list_support: np.ndarray  # (N,) H when the lists were built
    reach_factor: float


class Gas(NamedTuple):
    """The predicted state (eqs 1, 4, 5) that the sums run over."""

    position: np.ndarray  # (D, N)
    velocity: np.ndarray  # (D, N)
    mass: np.ndarray  # (N,)
    internal_energy: np.ndarray  # (N,)
    support: np.ndarray  # (N,) H to begin with


class Fields(NamedTuple):
    """What the density pass finds, each (N,)."""

    support: np.ndarray  # H
    density: np.ndarray
    omega: np.ndarray
    pressure_term: np.ndarray  # the scheme's, e.g. P/(Omega rho^2)
    sound_speed: np.ndarray


class SummedPressure(NamedTuple):
    """What a scheme has that sums its pressure over neighbours, each (N,)."""

    pressure: np.ndarray
    energy_shift: np.ndarray  # what a pair takes off its partner's u
