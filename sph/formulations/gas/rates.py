"""The rate pass: acceleration and du/dt (eqs 22-26), with the pair force of the scheme."""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, larger, smaller
from sph.formulations.gas.schemes import pair
from sph.formulations.gas.terms import exchange_speed, pair_alpha
from sph.formulations.gas.weighting import by_share
from sph.kernels import force_over_q, normalisation
from sph.neighbours.order import BLOCK
from sph.passes import TINY
from sph.passes.gather import copy_in, most_candidates, place_in, unpacked


@njit(**COMPILED)
def rates(
    first_block, last_block, dim, models, neighbours, position, velocity, mass, energy, support,
    density, pressure_term, sound_speed, alpha, balsara, pressure, energy_shift, exchanged, shares,
    acceleration, energy_rate, signal_speed,
):  # fmt: skip
    """Rate pass over blocks [first_block, last_block): eqs 22-26.

    Writes acceleration (D, N), energy_rate (N,) and signal_speed (N,), the largest v_sig of each
    particle over its pairs and itself (eq 32). An array is None if the scene does not need it:
    alpha (if constant), balsara, pressure, energy_shift (of schemes that sum the pressure),
    exchanged (the internal energy, for conductivity), shares (for switched conductivity).
    """
    D = len(dim)
    kernel, weighting, viscosity = models.kernel, models.weighting, models.viscosity
    start, count, candidates = neighbours.lists
    sign, offset = neighbours.images
    C = normalisation(kernel, dim)
    size = most_candidates(first_block, last_block, count)
    x = np.empty((D, size))
    v = np.empty((D, size))
    rho = np.empty(size)
    P_term = np.empty(size)
    c_s = np.empty(size)
    H_inv = np.empty(size)
    m_half = np.empty(size)
    gradient = np.empty(size)
    alphas = np.empty(size if alpha is not None else 0)
    fs = np.empty(size if balsara is not None else 0)
    us = np.empty(size if pressure is not None else 0)
    Ps = np.empty(size if pressure is not None else 0)
    half_shares = np.empty(size if shares is not None else 0)
    shifts = np.empty(size if energy_shift is not None else 0)
    force = np.empty(size)
    for block in range(first_block, last_block):
        nc = count[block]
        for k in range(nc):
            j, image = unpacked(candidates[start[block] + k])
            place_in(x, k, position, j, dim, sign, offset, image)
            copy_in(v, k, velocity, j, dim, sign, image)
            copy_in(rho, k, density, j, dim, sign, image)
            copy_in(P_term, k, pressure_term, j, dim, sign, image)
            copy_in(c_s, k, sound_speed, j, dim, sign, image)
            H_inv[k] = 1.0 / support[j]
            gradient[k] = 1.0 / support[j] ** (D + 2)
            m_half[k] = 0.5 * C * mass[j]
            copy_in(alphas, k, alpha, j, dim, sign, image)
            if balsara is not None:
                fs[k] = 0.5 * balsara[j]
            if pressure is not None:
                copy_in(us, k, energy, j, dim, sign, image)
                copy_in(Ps, k, pressure, j, dim, sign, image)
            if shares is not None:
                half_shares[k] = 0.5 * shares[j]
            copy_in(shifts, k, energy_shift, j, dim, sign, image)
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            rho_i, P_term_i, c_i = density[i], pressure_term[i], sound_speed[i]
            H_inv_i = 1.0 / support[i]
            gradient_i = 1.0 / support[i] ** (D + 2)
            m_half_i = 0.5 * C * mass[i]
            gained = 0.0
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
                slope_i = m_half[k] * gradient_i * force_over_q(kernel, dim, r * H_inv_i)
                slope_j = m_half[k] * gradient[k] * force_over_q(kernel, dim, r * H_inv[k])
                # eq 24: alpha/2 v_sig w_ij/rho_ij with rho_ij = (rho_i + rho_j)/2
                if alpha is not None:
                    Pi = -pair_alpha(viscosity, alpha[i], alphas[k])
                else:
                    Pi = -pair_alpha(viscosity, 0.0, 0.0)
                Pi *= v_sig * w_ij * (inverse * r)
                if balsara is not None:
                    Pi *= 0.5 * balsara[i] + fs[k]
                term_i, term_j = P_term_i, P_term[k]
                if energy_shift is not None:
                    shift_i, shift_j = by_share(
                        weighting, energy_shift[i], shifts[k], m_half_i, m_half[k]
                    )
                    term_i *= us[k] - shift_i
                    term_j *= energy[i] - shift_j
                else:
                    term_i, term_j = by_share(weighting, term_i, term_j, m_half_i, m_half[k])
                force[k], work = pair(models.scheme, term_i, term_j, slope_i, slope_j, Pi)
                gained += work * v_dot_r
                if exchanged is not None:
                    speed = exchange_speed(models.exchange, pressure[i], Ps[k], rho_i, rho[k], w_ij)
                    # Price (2008) eq 27: over rho_ij = (rho_i + rho_j)/2; slope r is m_j dW/dr
                    exchange = speed * (exchanged[i] - us[k]) * 2.0 * (inverse * r)
                    if shares is not None:
                        exchange *= 0.5 * shares[i] + half_shares[k]
                    gained += (slope_i + slope_j) * r * exchange
                fastest = larger(fastest, v_sig if slope_i + slope_j < 0.0 else 0.0)
            energy_rate[i] = gained
            signal_speed[i] = fastest
            for d in range(D):
                total = 0.0
                for k in range(nc):
                    total -= force[k] * (position[d, i] - x[d, k])
                acceleration[d, i] = total
