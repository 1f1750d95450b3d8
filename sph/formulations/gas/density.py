"""The density pass: eqs 7-8 and 15-17, and the pressure sum of schemes that need one."""

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.formulations.gas.smoothing import find_support
from sph.formulations.gas.thermodynamics import dissipation, equation_of_state, summed
from sph.formulations.gas.weighting import mass_per_weight, weight
from sph.kernels import dw_over_q, normalisation, w
from sph.neighbours.order import BLOCK
from sph.passes.gather import copy_in, most_candidates, place_in, unpacked


@njit(**COMPILED)
def density(
    first_block, last_block, dim, models, neighbours, position, velocity, mass, energy,
    support_before, alpha, support, rho, Omega, pressure, energy_shift, div_v, curl_v,
    pressure_term, sound_speed, balsara, alpha_rate, wanted,
):  # fmt: skip
    """Density pass over blocks [first_block, last_block), with the quantities that follow from it.

    wanted (blocks,): see `sph.passes.Sweep`. A particle whose support was not found gets a density
    of -1. An array is None if the scene does not need it: pressure, energy_shift (of schemes that
    sum the pressure), div_v, curl_v, balsara, alpha and alpha_rate.
    """
    D = len(dim)
    kernel, weighting = models.kernel, models.weighting
    support_ratio = models.support_ratio
    start, count, candidates = neighbours.lists
    sign, offset = neighbours.images
    C = normalisation(kernel, dim)
    size = most_candidates(first_block, last_block, count)
    x = np.empty((D, size))
    v = np.empty((D, size))
    m = np.empty(size)
    r = np.empty(size)
    mu = np.empty(size if energy_shift is not None else 0)
    for block in range(first_block, last_block):
        if wanted[block] == 0.0:
            continue
        nc = count[block]
        for k in range(nc):
            j, image = unpacked(candidates[start[block] + k])
            m[k] = weight(weighting, mass[j])
            place_in(x, k, position, j, dim, sign, offset, image)
            if div_v is not None:
                copy_in(v, k, velocity, j, dim, sign, image)
            if energy_shift is not None:
                mu[k] = mass[j] * energy[j]
        wanted[block] = 0.0
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            for k in range(nc):
                squared = 0.0
                for d in range(D):
                    squared += (position[d, i] - x[d, k]) ** 2
                r[k] = np.sqrt(squared)
            list_support = neighbours.list_support[i]
            H, rho_i, Omega_i, needed = find_support(
                models.smoothing, kernel, dim, r, m, nc, weight(weighting, mass[i]),
                support_before[i], support_ratio * models.eta,
                neighbours.reach_factor * list_support, models.max_support,
            )  # fmt: skip
            rho_i *= mass_per_weight(weighting, mass[i])
            support[i], rho[i], Omega[i] = H, rho_i, Omega_i
            if needed > 0.0:
                wanted[block] = max(wanted[block], needed / list_support)
                continue
            c = equation_of_state(
                i, models, rho_i, Omega_i, energy, pressure, pressure_term, sound_speed
            )
            if energy_shift is not None:
                H_inv = 1.0 / H
                sum_w = sum_dw = 0.0
                for k in range(nc):
                    q = r[k] * H_inv
                    sum_w += mu[k] * w(kernel, dim, q)
                    sum_dw += mu[k] * (q * q) * dw_over_q(kernel, dim, q)
                scale = C * H_inv**D
                change = -scale * (sum_w + sum_dw / D)  # H/D d/dH of the sum, by eq 10
                summed(
                    i, models, energy, scale * sum_w, change / (Omega_i * rho_i), pressure,
                    pressure_term, energy_shift,
                )  # fmt: skip
            if div_v is not None:
                H_inv = 1.0 / H
                scale = -C * H_inv ** (D + 2) / (Omega_i * rho_i)
                scale *= mass_per_weight(weighting, mass[i])  # 1/n_i instead of 1/rho_i
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
                div = scale * total  # eq 16, whose sign is a misprint: v_ij = v_i - v_j
                div_v[i] = div
                curl = 0.0
                if curl_v is not None:
                    curl = abs(scale) * np.sqrt(curl_x**2 + curl_y**2 + curl_z**2)  # eq 17
                    curl_v[i] = curl
                dissipation(i, models, H, c, div, curl, alpha, balsara, alpha_rate)
