"""The rate pass: seed eqs 22-26, with the pair force of the scheme."""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, larger, smaller
from sph.conductivity import exchange_speed
from sph.eos import pressure
from sph.kernels import force_over_q, normalisation
from sph.neighbours.lists import IMAGE_SHIFT
from sph.neighbours.order import BLOCK
from sph.passes import TINY
from sph.passes.weighting import by_share
from sph.schemes import pair
from sph.viscosity import pair_alpha


@njit(**COMPILED)
def rates(
    first_block, last_block, dim, models, neighbours, gas, alpha, fields, summed, f, conducted,
    shares, acceleration, energy_rate, signal_speed,
):  # fmt: skip
    """Rate pass over blocks [first_block, last_block): eqs 22-26.

    Writes acceleration (D, N), energy_rate (N,) and signal_speed (N,), the largest v_sig of each
    particle over its pairs and itself (eq 32).
    """
    D = len(dim)
    scheme, kernel, _, weighting, eos, viscosity, conductivity, _, _, _, _ = models
    lists, images, _, _ = neighbours
    start, count, candidates = lists
    sign, offset = images
    position, velocity, mass, energy, _ = gas
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
    us = np.empty(size if conducted is not None or summed is not None else 0)
    Ps = np.empty(size if conducted is not None or summed is not None else 0)
    half_shares = np.empty(size if shares is not None else 0)
    shifts = np.empty(size if summed is not None else 0)
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
            if conducted is not None:
                us[k] = conducted[j]
                Ps[k] = pressure(eos, density[j], conducted[j])
            if shares is not None:
                half_shares[k] = 0.5 * shares[j]
            if summed is not None:
                us[k] = energy[j]
                Ps[k] = summed.pressure[j]
                shifts[k] = summed.energy_shift[j]
        for i in range(block * BLOCK, min((block + 1) * BLOCK, mass.size)):
            rho_i, P_term_i, c_i = density[i], pressure_term[i], sound_speeds[i]
            H_inv_i = 1.0 / support[i]
            gradient_i = 1.0 / support[i] ** (D + 2)
            m_half_i = 0.5 * C * mass[i]
            if conducted is not None:
                P_i = pressure(eos, rho_i, conducted[i])
            if summed is not None:
                P_i = summed.pressure[i]
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
                slope_i = m_half[k] * gradient_i * force_over_q(kernel, dim, r * H_inv_i)
                slope_j = m_half[k] * gradient[k] * force_over_q(kernel, dim, r * H_inv[k])
                # eq 24: alpha/2 v_sig w_ij/rho_ij with rho_ij = (rho_i + rho_j)/2
                if alpha is not None:
                    Pi = -pair_alpha(viscosity, alpha[i], alphas[k])
                else:
                    Pi = -pair_alpha(viscosity, 0.0, 0.0)
                Pi *= v_sig * w_ij * (inverse * r)
                if f is not None:
                    Pi *= 0.5 * f[i] + fs[k]
                term_i, term_j = P_term_i, P_term[k]
                if summed is not None:
                    shift_i, shift_j = by_share(
                        weighting, summed.energy_shift[i], shifts[k], m_half_i, m_half[k]
                    )
                    term_i *= us[k] - shift_i
                    term_j *= energy[i] - shift_j
                else:
                    term_i, term_j = by_share(weighting, term_i, term_j, m_half_i, m_half[k])
                force[k], work = pair(scheme, term_i, term_j, slope_i, slope_j, Pi)
                heating += work * v_dot_r
                if conducted is not None:
                    speed = exchange_speed(conductivity, P_i, Ps[k], rho_i, rho[k], w_ij)
                    # Price (2008) eq 27: over rho_ij = (rho_i + rho_j)/2; slope r is m_j dW/dr
                    exchange = speed * (conducted[i] - us[k]) * 2.0 * (inverse * r)
                    if shares is not None:
                        exchange *= 0.5 * shares[i] + half_shares[k]
                    heating += (slope_i + slope_j) * r * exchange
                fastest = larger(fastest, v_sig if slope_i + slope_j < 0.0 else 0.0)
            energy_rate[i] = heating
            signal_speed[i] = fastest
            for d in range(D):
                total = 0.0
                for k in range(nc):
                    total -= force[k] * (position[d, i] - x[d, k])
                acceleration[d, i] = total
