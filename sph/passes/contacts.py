"""The pass over the Laplacian of the energy, for conductivity that acts at contacts only.

lap u = 2 sum m_j/rho_j (u_i - u_j) (dW/dr)/r, as in Price & Monaghan (2005) after Brookshaw (1985).
"""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, larger, smaller
from sph.conductivity import share
from sph.kernels import dw_over_q, normalisation
from sph.neighbours.lists import IMAGE_SHIFT
from sph.neighbours.order import BLOCK
from sph.passes import TINY


@njit(**COMPILED)
def contacts(first_block, last_block, dim, models, neighbours, gas, shares, fields):
    """Shares (N,) of the conductivity over blocks [first_block, last_block).

    v_sig is the largest (c_i + c_j)/2 - w_ij of the particle's support.
    """
    D = len(dim)
    kernel, support_ratio = models.kernel, models.support_ratio
    lists, images, _, _ = neighbours
    start, count, candidates = lists
    sign, offset = images
    position, velocity, mass, energy, _ = gas
    support, density, _, _, sound_speed = fields
    C = normalisation(kernel, dim)
    size = 0
    for block in range(first_block, last_block):
        size = max(size, count[block])
    x = np.empty((D, size))
    v = np.empty((D, size))
    u = np.empty(size)
    volume = np.empty(size)
    c_half = np.empty(size)
    for block in range(first_block, last_block):
        nc = count[block]
        for k in range(nc):
            packed = candidates[start[block] + k]
            j = packed & ((1 << IMAGE_SHIFT) - 1)
            image = packed >> IMAGE_SHIFT
            for d in range(D):
                x[d, k] = sign[image, d] * position[d, j] + offset[image, d]
                v[d, k] = sign[image, d] * velocity[d, j]
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
