"""The pass for the Laplacian of u, for conductivity that is limited to contacts.

lap u = 2 sum m_j/rho_j (u_i - u_j) (dW/dr)/r, as in Price & Monaghan (2005) after Brookshaw (1985).
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, INLINED, larger, smaller
from sph.kernels import dw_over_q, normalisation
from sph.neighbours.order import BLOCK
from sph.passes import TINY
from sph.passes.gather import copy_in, most_candidates, place_in, unpacked

COLD = 1e-300  # gives 0 instead of 0/0 in uniform cold gas


@njit(**INLINED)
def share(h, laplacian, energy, signal_speed):
    """Return the fraction of the conductivity that acts on a particle, 0 to 1.

    The coefficient of Price (2008; Price & Monaghan 2005) grows at 0.1 h |lap u| / sqrt(u) and
    decays in the time h/(0.1 v_sig), with h the smoothing length. Here it is the balance of growth
    and decay, which needs no evolved quantity and acts at once on new contacts, while a jump of
    pressure still drives the exchange.
    """
    return smaller(h * h * abs(laplacian) / (signal_speed * np.sqrt(energy) + COLD), 1.0)


@njit(**COMPILED)
def contacts(
    first_block, last_block, dim, models, neighbours, position, velocity, mass, energy, support,
    density, sound_speed, shares,
):  # fmt: skip
    """Write the fractions (N,) of conductivity that act, for blocks [first_block, last_block).

    v_sig is the largest (c_i + c_j)/2 - w_ij within the particle's support. `velocity` and `energy`
    are the predicted values.
    """
    D = len(dim)
    kernel, support_ratio = models.kernel, models.support_ratio
    start, count, candidates = neighbours.lists
    sign, offset = neighbours.images
    C = normalisation(kernel, dim)
    size = most_candidates(first_block, last_block, count)
    x = np.empty((D, size))
    v = np.empty((D, size))
    u = np.empty(size)
    volume = np.empty(size)
    c_half = np.empty(size)
    for block in range(first_block, last_block):
        nc = count[block]
        for k in range(nc):
            j, image = unpacked(candidates[start[block] + k])
            place_in(x, k, position, j, dim, sign, offset, image)
            copy_in(v, k, velocity, j, dim, sign, image)
            u[k] = energy[j]
            volume[k] = mass[j] / density[j]
            c_half[k] = 0.5 * sound_speed[j]
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            H_inv = 1.0 / support[i]
            c_half_i = 0.5 * sound_speed[i]
            fastest = 0.0
            total = 0.0
            for k in range(nc):
                squared = TINY
                v_dot_r = 0.0
                for d in range(D):
                    r_d = position[d, i] - x[d, k]
                    squared += r_d * r_d
                    v_dot_r += (velocity[d, i] - v[d, k]) * r_d
                r = np.sqrt(squared)
                v_sig = c_half_i + c_half[k] - smaller(v_dot_r, 0.0) / r
                fastest = larger(fastest, v_sig if r * H_inv < 1.0 else 0.0)
                total += volume[k] * (energy[i] - u[k]) * dw_over_q(kernel, dim, r * H_inv)
            laplacian = 2.0 * C * H_inv ** (D + 2) * total
            shares[i] = share(support[i] / support_ratio, laplacian, energy[i], fastest)
