"""The density pass: seed eqs 7-8, 15-21 and 27-28."""

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.eos import pressure, sound_speed
from sph.kernels import dw_over_q, normalisation, w
from sph.neighbours.lists import IMAGE_SHIFT
from sph.neighbours.order import BLOCK
from sph.passes.smoothing import find_support
from sph.passes.weighting import mass_per_weight, weight
from sph.schemes import summed_terms
from sph.viscosity import alpha_rate, balsara_factor


@njit(**COMPILED)
def density(
    first_block, last_block, dim, models, neighbours, gas, alpha, fields, summed, div_v, curl_v, f,
    alpha_rates, wanted,
):  # fmt: skip
    """Density pass over blocks [first_block, last_block).

    wanted (blocks,): blocks where it is 0 are passed over. It becomes 0, or the multiple of
    list_support to which the block must be listed before the pass is run again for it. A particle
    whose support was not found gets a density of -1.
    """
    D = len(dim)
    scheme, kernel, smoothing, weighting, eos, viscosity = models[:6]
    balsara, support_ratio, eta, largest = models[7:]
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
    mu = np.empty(size if summed is not None else 0)
    for block in range(first_block, last_block):
        if wanted[block] == 0.0:
            continue
        nc = count[block]
        for k in range(nc):
            packed = candidates[start[block] + k]
            j = packed & ((1 << IMAGE_SHIFT) - 1)
            image = packed >> IMAGE_SHIFT
            m[k] = weight(weighting, mass[j])
            for d in range(D):
                x[d, k] = sign[image, d] * position[d, j] + offset[image, d]
                if div_v is not None:
                    v[d, k] = sign[image, d] * velocity[d, j]
            if summed is not None:
                mu[k] = mass[j] * energy[j]
        wanted[block] = 0.0
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            for k in range(nc):
                squared = 0.0
                for d in range(D):
                    squared += (position[d, i] - x[d, k]) ** 2
                r[k] = np.sqrt(squared)
            H, rho_i, Omega_i, needed = find_support(
                smoothing, kernel, dim, r, m, nc, weight(weighting, mass[i]), support_before[i],
                support_ratio * eta, reach_factor * list_support[i], largest,
            )  # fmt: skip
            rho_i *= mass_per_weight(weighting, mass[i])
            support[i], rho[i], Omega[i] = H, rho_i, Omega_i
            if needed > 0.0:
                wanted[block] = max(wanted[block], needed / list_support[i])
                continue
            P = pressure(eos, rho_i, energy[i])
            c_i = sound_speed(eos, rho_i, P)
            pressure_term[i] = P / (Omega_i * rho_i * rho_i)
            c_s[i] = c_i
            if summed is not None:
                H_inv = 1.0 / H
                sum_w = sum_dw = 0.0
                for k in range(nc):
                    q = r[k] * H_inv
                    sum_w += mu[k] * w(kernel, dim, q)
                    sum_dw += mu[k] * (q * q) * dw_over_q(kernel, dim, q)
                scale = C * H_inv**D
                change = -scale * (sum_w + sum_dw / D)  # H/D d/dH of the sum, by eq 10
                summed.pressure[i], pressure_term[i], summed.energy_shift[i] = summed_terms(
                    scheme, eos, energy[i], scale * sum_w, change / (Omega_i * rho_i)
                )
            if div_v is not None:
                H_inv = 1.0 / H
                scale = -C * H_inv ** (D + 2) / (Omega_i * rho_i)
                scale *= mass_per_weight(weighting, mass[i])  # over n_i, that is
                total = curl_x = curl_y = curl_z = 0.0
                for k in range(nc):
                    m_dw = m[k] * dw_over_q(kernel, dim, r[k] * H_inv)
                    v_dot_r = 0.0
                    for d in range(D):
                        v_dot_r += (velocity[d, i] - v[d, k]) * (position[d, i] - x[d, k])
                    total += m_dw * v_dot_r
                    if curl_v is not None:
                        r_x, r_y = position[0, i] - x[0, k], position[1, i] - x[1, k]
                        v_x, v_y = velocity[0, i] - v[0, k], velocity[1, i] - v[1, k]
                        curl_z += m_dw * (v_x * r_y - v_y * r_x)
                        if D == 3:
                            r_z, v_z = position[2, i] - x[2, k], velocity[2, i] - v[2, k]
                            curl_x += m_dw * (v_y * r_z - v_z * r_y)
                            curl_y += m_dw * (v_z * r_x - v_x * r_z)
                div = scale * total  # eq 16, whose sign is a misprint: with v_ij = v_i - v_j, minus
                div_v[i] = div
                curl = 0.0
                if curl_v is not None:
                    curl = abs(scale) * np.sqrt(curl_x**2 + curl_y**2 + curl_z**2)  # eq 17
                    curl_v[i] = curl
                if f is not None:
                    f[i] = balsara_factor(balsara, div, curl, c_i, H)  # eq 21
                if alpha is not None:
                    alpha_rates[i] = alpha_rate(viscosity, alpha[i], H / support_ratio, c_i, div)
