"""SPH as in Monaghan (1992), without a correction for the gradient of the smoothing length.

The support keeps the size that it begins with. An ideal gas; artificial viscosity of one alpha.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph import kernels
from sph.compiled import COMPILED, larger, smaller
from sph.eos import pressure, sound_speed
from sph.formulations import Formulation
from sph.integrators.leapfrog import POSITIVE
from sph.kernels import dw_over_q, normalisation, w
from sph.neighbours.order import BLOCK
from sph.part import Evolved, Key, Pass
from sph.passes import TINY
from sph.passes.gather import copy_in, most_candidates, place_in, unpacked
from sph.state import COMMON, Field


class Models(NamedTuple):
    """What the passes take."""

    kernel: tuple
    eos: tuple
    viscosity: float
    support_ratio: float
    eta: float


@njit(**COMPILED)
def density(
    first_block, last_block, dim, models, neighbours, position, mass, energy, support, rho, P, c,
    support_before,
):  # fmt: skip
    """Density, pressure and sound speed."""
    start, count, candidates = neighbours.lists
    sign, offset = neighbours.images
    C, D = normalisation(models.kernel, dim), len(dim)
    size = most_candidates(first_block, last_block, count)
    x, m = np.empty((D, size)), np.empty(size)
    for block in range(first_block, last_block):
        nc = count[block]
        for k in range(nc):
            j, image = unpacked(candidates[start[block] + k])
            place_in(x, k, position, j, dim, sign, offset, image)
            copy_in(m, k, mass, j, dim, sign, image)
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            total = 0.0
            for k in range(nc):
                squared = 0.0
                for d in range(D):
                    squared += (position[d, i] - x[d, k]) ** 2
                total += m[k] * w(models.kernel, dim, np.sqrt(squared) / support[i])
            rho[i] = C * total / support[i] ** D
            P[i] = pressure(models.eos, rho[i], energy[i])
            c[i] = sound_speed(models.eos, rho[i], P[i])
            support_before[i] = support[i]


@njit(**COMPILED)
def rates(
    first_block, last_block, dim, models, neighbours, position, velocity, mass, support, rho, P, c,
    acceleration, energy_rate, signal_speed,
):  # fmt: skip
    """Symmetric pair force with the mean of the two kernels' gradients."""
    start, count, candidates = neighbours.lists
    sign, offset = neighbours.images
    C, D = normalisation(models.kernel, dim), len(dim)
    for block in range(first_block, last_block):
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            energy_rate[i] = signal_speed[i] = 0.0
            for d in range(D):
                acceleration[d, i] = 0.0
            for k in range(count[block]):
                j, image = unpacked(candidates[start[block] + k])
                squared, v_dot_r = TINY, 0.0
                for d in range(D):
                    r_d = position[d, i] - (sign[image, d] * position[d, j] + offset[image, d])
                    squared += r_d * r_d
                    v_dot_r += (velocity[d, i] - sign[image, d] * velocity[d, j]) * r_d
                r = np.sqrt(squared)
                slope = 0.0
                for H in (support[i], support[j]):
                    slope += 0.5 * C * dw_over_q(models.kernel, dim, r / H) / H ** (D + 2)
                w_ij = smaller(v_dot_r, 0.0) / r
                v_sig = c[i] + c[j] - 3.0 * w_ij
                Pi = -models.viscosity * v_sig * w_ij / (rho[i] + rho[j])
                own = P[i] / rho[i] ** 2
                force = mass[j] * slope * (own + P[j] / rho[j] ** 2 + Pi)
                energy_rate[i] += mass[j] * slope * (own + 0.5 * Pi) * v_dot_r
                signal_speed[i] = larger(signal_speed[i], v_sig if slope < 0.0 else 0.0)
                for d in range(D):
                    r_d = position[d, i] - (sign[image, d] * position[d, j] + offset[image, d])
                    acceleration[d, i] -= force * r_d


class Plain(Formulation):
    """Density by summation, supports of fixed size, and the classical pair force."""

    keys = (Key("plain_alpha", "artificial viscosity", kind=float, default=1.0, at_least=0.0),)
    evolved = (Evolved("internal_energy", "energy_rate", "predicted_energy", POSITIVE),)

    def __init__(self, scene):
        kernel = scene.physics.kernel_model()
        ratio = kernels.support_ratio(kernel, scene.dimension)
        self.fields = (*COMMON, Field("pressure", stored=False))
        self.eos = scene.eos
        self.models = Models(
            kernel, scene.eos, float(scene.physics.plain_alpha), ratio, float(scene.physics.eta)
        )
        gas = ("position", "mass", "predicted_energy", "support")
        self.passes = (
            Pass("density", "density", density, gas,
                 ("density", "pressure", "sound_speed", "support_before")),
            Pass("rates", "rates", rates,
                 ("position", "predicted_velocity", "mass", "support", "density", "pressure",
                  "sound_speed"),
                 ("acceleration", "energy_rate", "signal_speed")),
        )  # fmt: skip

    @classmethod
    def of(cls, scene):
        return cls(scene)

    def described(self):
        return [f"plain SPH, kernel {self.models.kernel.name}"], []

    def pressure(self, state):
        return self.eos.pressure(state.density, state.internal_energy)
