"""Grad-h SPH with the averaged kernel gradient: the seed's equations 7-8 and 15-28.

Two passes over the blocks' candidates. `density` needs sums over each particle's own support
only (H, rho, Omega, div v, curl v), and what follows from them particle by particle; `rates` is
the pair force and heating. Each copies a block's candidates into contiguous scratch, images
applied, and runs branch-free loops over it for every particle of the block: gather only, one
writer a particle, in a fixed order, so results do not depend on the number of threads.

Arguments that are None leave their part out of the compiled code: div_v (nothing needs the
divergence), curl_v (1-D, or no Balsara factor), f (no Balsara factor), alpha (one constant).
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED, larger, smaller
from sph.eos import pressure, sound_speed
from sph.kernels import dw_over_q, force_over_q, normalisation
from sph.neighbours.lists import IMAGE_SHIFT
from sph.neighbours.order import BLOCK
from sph.schemes.smoothing import find_support
from sph.viscosity import alpha_rate, balsara_factor, pair_alpha

TINY = 1e-300  # keeps 1/r finite where r_ij = 0 and the vector it multiplies is zero too


class Models(NamedTuple):
    """What the formulas are made of; the types decide what is compiled, the values do not."""

    kernel: tuple
    smoothing: tuple
    eos: tuple
    viscosity: tuple
    balsara: tuple | None
    support_ratio: float  # H/h of the kernel
    eta: float


class Neighbours(NamedTuple):
    """Candidates of every block and how far they can be trusted: within reach_factor list_support."""

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
    pressure_term: np.ndarray  # P/(Omega rho^2)
    sound_speed: np.ndarray


@njit(**COMPILED)
def density(
    first_block, last_block, dim, models, neighbours, gas, alpha, fields, div_v, curl_v, f,
    alpha_rates, wanted,
):  # fmt: skip
    """Density pass over blocks [first_block, last_block).

    wanted (blocks,): 0, or the multiple of list_support to which a block must be listed before
    the pass is run again. A particle whose support was not found gets a density of -1.
    """
    D = len(dim)
    kernel, smoothing, eos, viscosity, balsara, support_ratio, eta = models
    lists, images, list_support, reach_factor = neighbours
    start, count, candidates = lists
    sign, offset = images
    position, velocity, mass, energy, support_before = gas
    support, rho, Omega, pressure_term, c_s = fields
    C = normalisation(kernel, dim)
    size = 0
    for block in range(first_block, last_block):
        size = max(size, count[block])
    x = np.empty((D, size))
    v = np.empty((D, size))
    m = np.empty(size)
    r = np.empty(size)
    weight = np.empty(size)
    for block in range(first_block, last_block):
        nc = count[block]
        for k in range(nc):
            packed = candidates[start[block] + k]
            j = packed & ((1 << IMAGE_SHIFT) - 1)
            image = packed >> IMAGE_SHIFT
            m[k] = mass[j]
            for d in range(D):
                x[d, k] = sign[image, d] * position[d, j] + offset[image, d]
                if div_v is not None:
                    v[d, k] = sign[image, d] * velocity[d, j]
        wanted[block] = 0.0
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            for k in range(nc):
                squared = 0.0
                for d in range(D):
                    squared += (position[d, i] - x[d, k]) ** 2
                r[k] = np.sqrt(squared)
            H, rho_i, Omega_i, needed = find_support(
                smoothing, kernel, dim, r, m, nc, mass[i], support_before[i],
                support_ratio * eta, reach_factor * list_support[i],
            )  # fmt: skip
            support[i], rho[i], Omega[i] = H, rho_i, Omega_i
            if needed > 0.0:
                wanted[block] = max(wanted[block], needed / list_support[i])
                continue
            P = pressure(eos, rho_i, energy[i])
            c_i = sound_speed(eos, rho_i, P)
            pressure_term[i] = P / (Omega_i * rho_i * rho_i)
            c_s[i] = c_i
            if div_v is not None:
                H_inv = 1.0 / H
                scale = -C * H_inv ** (D + 2) / (Omega_i * rho_i)
                total = 0.0
                for k in range(nc):
                    v_dot_r = 0.0
                    for d in range(D):
                        v_dot_r += (velocity[d, i] - v[d, k]) * (position[d, i] - x[d, k])
                    weight[k] = m[k] * dw_over_q(kernel, dim, r[k] * H_inv)
                    total += weight[k] * v_dot_r
                div = scale * total  # eq 16, whose sign is a misprint: with v_ij = v_i - v_j, minus
                div_v[i] = div
                curl = 0.0
                if curl_v is not None:
                    squared = 0.0
                    for a in range(0 if D == 3 else 2, 3):  # components of the curl; z alone in 2-D
                        d, e = (a + 1) % 3, (a + 2) % 3
                        total = 0.0
                        for k in range(nc):
                            cross = (velocity[d, i] - v[d, k]) * (position[e, i] - x[e, k])
                            cross -= (velocity[e, i] - v[e, k]) * (position[d, i] - x[d, k])
                            total += weight[k] * cross
                        squared += (scale * total) ** 2  # eq 17
                    curl = np.sqrt(squared)
                    curl_v[i] = curl
                if f is not None:
                    f[i] = balsara_factor(balsara, div, curl, c_i, H)  # eq 21
                if alpha is not None:
                    alpha_rates[i] = alpha_rate(viscosity, alpha[i], H / support_ratio, c_i, div)


@njit(**COMPILED)
def rates(
    first_block, last_block, dim, models, neighbours, gas, alpha, fields, f, acceleration,
    energy_rate, signal_speed,
):  # fmt: skip
    """Rate pass over blocks [first_block, last_block): eqs 22-26.

    Writes acceleration (D, N), energy_rate (N,) and signal_speed (N,), the largest v_sig of each
    particle over its pairs and itself (eq 32).
    """
    D = len(dim)
    kernel, _, _, viscosity, _, _, _ = models
    lists, images, _, _ = neighbours
    start, count, candidates = lists
    sign, offset = images
    position, velocity, mass, _, _ = gas
    support, density, _, pressure_term, sound_speeds = fields
    C = normalisation(kernel, dim)
    size = 0
    for block in range(first_block, last_block):
        size = max(size, count[block])
    x = np.empty((D, size))
    v = np.empty((D, size))
    rho = np.empty(size)
    P_term = np.empty(size)
    c_s = np.empty(size)
    H_inv = np.empty(size)
    m_half = np.empty(size)
    gradient = np.empty(size)
    alphas = np.empty(size if alpha is not None else 0)
    fs = np.empty(size if f is not None else 0)
    force = np.empty(size)
    for block in range(first_block, last_block):
        nc = count[block]
        for k in range(nc):
            packed = candidates[start[block] + k]
            j = packed & ((1 << IMAGE_SHIFT) - 1)
            image = packed >> IMAGE_SHIFT
            for d in range(D):
                x[d, k] = sign[image, d] * position[d, j] + offset[image, d]
                v[d, k] = sign[image, d] * velocity[d, j]
            rho[k] = density[j]
            P_term[k] = pressure_term[j]
            c_s[k] = sound_speeds[j]
            H_inv[k] = 1.0 / support[j]
            gradient[k] = 1.0 / support[j] ** (D + 2)
            m_half[k] = 0.5 * C * mass[j]
            if alpha is not None:
                alphas[k] = alpha[j]
            if f is not None:
                fs[k] = 0.5 * f[j]
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            rho_i, P_term_i, c_i = density[i], pressure_term[i], sound_speeds[i]
            H_inv_i = 1.0 / support[i]
            gradient_i = 1.0 / support[i] ** (D + 2)
            heating = 0.0
            fastest = 0.0
            for k in range(nc):
                squared = TINY
                v_dot_r = 0.0
                for d in range(D):
                    r_d = position[d, i] - x[d, k]
                    squared += r_d * r_d
                    v_dot_r += (velocity[d, i] - v[d, k]) * r_d
                r = np.sqrt(squared)
                rho_sum = rho_i + rho[k]
                inverse = 1.0 / (r * rho_sum)  # one division serves 1/r and 1/(rho_i + rho_j)
                w_ij = smaller(v_dot_r, 0.0) * (inverse * rho_sum)  # eq 26
                v_sig = c_i + c_s[k] - 3.0 * w_ij  # eq 25
                slope = gradient_i * force_over_q(kernel, dim, r * H_inv_i)
                slope += gradient[k] * force_over_q(kernel, dim, r * H_inv[k])
                # eq 24: alpha/2 v_sig w_ij/rho_ij with rho_ij = (rho_i + rho_j)/2
                if alpha is not None:
                    Pi = -pair_alpha(viscosity, alpha[i], alphas[k])
                else:
                    Pi = -pair_alpha(viscosity, 0.0, 0.0)
                Pi *= v_sig * w_ij * (inverse * r)
                if f is not None:
                    Pi *= 0.5 * f[i] + fs[k]
                slope *= m_half[k]
                heating += slope * (P_term_i + 0.5 * Pi) * v_dot_r  # eq 23
                force[k] = slope * (P_term_i + P_term[k] + Pi)  # eq 22
                fastest = larger(fastest, v_sig if slope < 0.0 else 0.0)
            energy_rate[i] = heating
            signal_speed[i] = fastest
            for d in range(D):
                total = 0.0
                for k in range(nc):
                    total -= force[k] * (position[d, i] - x[d, k])
                acceleration[d, i] = total
