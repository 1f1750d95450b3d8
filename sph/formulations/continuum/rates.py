"""The rate pass: acceleration, du/dt and signal speed (eqs 408-413)."""

import numpy as np
from numba import njit

from sph.compiled import COMPILED, larger, smaller
from sph.formulations.continuum.matter import (
    H_INV,
    NEXT,
    VOLUME,
    H,
    copy_matter,
    of_pair,
    power,
)
from sph.formulations.continuum.pair_terms import (
    copy_gradients,
    corrected_gradient,
    corrected_gradient_of,
    traction,
    traction_of,
)
from sph.kernels import dw_over_q, normalisation, w
from sph.neighbours.order import BLOCK
from sph.passes.gather import (
    also,
    copy_tensors,
    copy_values,
    largest_of,
    longest_list,
    middle,
    near_blocks,
    near_particles,
    own_box,
    scratch,
    unit,
    unpacked,
)
from sph.simd import (
    at,
    dot,
    filled,
    lane_max,
    lane_sum,
    lane_sums,
    load,
    load_spatial,
    minus,
    plus,
    put,
    select,
    symmetric_at,
    symmetric_dim,
    symmetric_times,
    times,
    width,
    zeros,
)

# Quantities of candidates after those of `matter`.
RHO, C_S = NEXT, NEXT + 1


@njit(**COMPILED)
def rates(
    first, last, dim, models, neighbours, position, velocity, mass, density, support, sound_speed,
    balsara, pressure, stress, kernel_factor, kernel_gradient, kernel_matrix, tension,
    initial_support, acceleration, energy_rate, signal_speed,
):  # fmt: skip
    """Rate pass over superblocks [first, last): eqs 408-413.

    Reads the predicted velocity (D, N) and density (N,). Writes acceleration (D, N), energy_rate
    (N,) and signal_speed (N,). Arrays that the scene does not need are None: balsara (N,); pressure
    (N,) where particles have a stress (D, D, N), otherwise the stress; the correction of the kernel
    (`gradients`); tension (D, D, N) and initial_support (N,), for the tensile correction.
    """
    D, lanes, lists = len(dim), neighbours.lanes, neighbours.lists
    kernel, sym = models.kernel, symmetric_dim(dim)
    C = normalisation(kernel, dim)
    # w/H^D where particles are one spacing apart, as in the initial lattice (eq 412)
    w_lattice = w(kernel, dim, 1.0 / (models.support_ratio * models.eta))
    rest = 2 * D
    fields = dim + dim + (0, 0, 0, 0, 0)
    p_row = len(fields)
    with_p = also(fields, pressure, (0,))
    s_row = len(with_p)
    with_s = also(with_p, stress, sym)
    f_row = len(with_s)
    with_f = also(with_s, balsara, (0,))
    factor_row = len(with_f)
    with_factor = also(with_f, kernel_factor, (0,))
    gradient_row = len(with_factor)
    with_gradient = also(with_factor, kernel_gradient, dim)
    matrix_row = len(with_gradient)
    with_matrix = also(with_gradient, kernel_matrix, sym)
    tension_row = len(with_matrix)
    with_tension = also(with_matrix, tension, sym)
    initial_row = len(with_tension)
    every = also(with_tension, initial_support, (0,))
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(every))
    still = times(at(dim, position, 0), 0.0)
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        x_0, v_0 = middle(dim, neighbours, begin, end), at(dim, velocity, i_0)
        per_length = unit(largest_of(support, i_0, i_end))
        per_velocity = unit(largest_of(sound_speed, i_0, i_end))
        per_density = unit(largest_of(density, i_0, i_end))
        per_stress = per_density * per_velocity * per_velocity
        number = lists.count[superblock]
        for t in range(number):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            to = t * len(every) * BLOCK
            to = copy_matter(
                lanes, dim, copied, to, boxes, t, block, neighbours, image, position, velocity,
                mass, density, support, x_0, v_0, per_length, per_velocity, C,
            )  # fmt: skip
            to = copy_values(lanes, copied, to, density, block, per_density)
            to = copy_values(lanes, copied, to, sound_speed, block, 0.5 * per_velocity)
            to = copy_values(lanes, copied, to, pressure, block, per_stress)
            to = copy_tensors(lanes, dim, copied, to, stress, block, neighbours, image, per_stress)
            to = copy_values(lanes, copied, to, balsara, block, 0.5)
            to = copy_values(lanes, copied, to, kernel_factor, block, 1.0)
            to = copy_gradients(
                lanes, dim, copied, to, kernel_gradient, block, neighbours, image, still,
                1.0 / per_length,
            )  # fmt: skip
            to = copy_tensors(lanes, dim, copied, to, kernel_matrix, block, neighbours, image, 1.0)
            to = copy_tensors(lanes, dim, copied, to, tension, block, neighbours, image, per_stress)
            copy_values(lanes, copied, to, initial_support, block, per_length)
        for block in range(begin, end):
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, mass.size)
            reach = largest_of(support, i_first, i_last) * per_length
            blocks = near_blocks(lanes, dim, boxes, number, low, high, reach, chosen)
            nc = near_particles(
                lanes, dim, copied, every, rest + H_INV, chosen, blocks, low, high, reach, near
            )
            for i in range(i_first, i_last):
                x_i = times(minus(at(dim, position, i), x_0), per_length)
                v_i = times(minus(at(dim, velocity, i), v_0), per_velocity)
                H_i = support[i] * per_length
                rho_i, c_half_i = density[i] * per_density, 0.5 * sound_speed[i] * per_velocity
                rho_inv_i = 1.0 / rho_i
                total = zeros(lanes, dim)
                gained = filled(lanes, 0.0)
                fastest = filled(lanes, 0.0)
                for k in range(0, nc, width(lanes)):
                    r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
                    v_ij = minus(v_i, load_spatial(lanes, dim, near, D, k))
                    H_j = load(lanes, near, (rest + H, k))
                    q, H_inv = of_pair(lanes, r_ij, H_i, H_j)
                    per_volume = power(dim, H_inv)
                    V_j = load(lanes, near, (rest + VOLUME, k)) * per_volume
                    rho_j = load(lanes, near, (rest + RHO, k))
                    W = w(kernel, dim, q)
                    F_r = times(r_ij, H_inv * H_inv * dw_over_q(kernel, dim, q))
                    # grad W_j(i) and grad W_i(j), eq 402
                    grad_i = corrected_gradient(
                        dim, sym, i, F_r, W, kernel_factor, kernel_gradient, kernel_matrix,
                        per_length,
                    )  # fmt: skip
                    grad_j = corrected_gradient_of(
                        lanes, dim, sym, near, k, times(F_r, -1.0), W, kernel_factor,
                        kernel_gradient, kernel_matrix, factor_row, gradient_row, matrix_row,
                    )  # fmt: skip
                    # eq 408
                    own_pull = traction(dim, pressure, stress, i, grad_i, per_stress)
                    pull = minus(
                        own_pull,
                        traction_of(
                            lanes, dim, sym, pressure, stress, near, p_row, s_row, k, grad_j
                        ),
                    )
                    gained -= V_j * rho_inv_i * dot(v_ij, own_pull)  # eq 411
                    # eqs 409-410
                    squared = dot(r_ij, r_ij)
                    h_ij = 0.5 / H_inv
                    v_dot_r = smaller(dot(v_ij, r_ij), 0.0)
                    mu = h_ij * v_dot_r / (squared + 0.01 * h_ij * h_ij)
                    fastest = larger(fastest, select(q < 1.0, -mu, 0.0))
                    if balsara is not None:
                        mu = mu * (0.5 * balsara[i] + load(lanes, near, (f_row, k)))
                    c_ij = c_half_i + load(lanes, near, (rest + C_S, k))
                    Pi = (models.q_a * mu - models.q_b * c_ij) * mu * (2.0 / (rho_i + rho_j))
                    between = times(minus(grad_i, grad_j), 0.5)
                    push = rho_j * Pi
                    gained += V_j * push * 0.5 * dot(v_ij, between)  # eq 411
                    if tension is not None:  # eqs 412-413
                        H_0 = initial_support[i] * per_length + load(lanes, near, (initial_row, k))
                        compared = W * power(dim, 0.5 * H_0 * H_inv) / w_lattice
                        repel = power((0, 0, 0, 0), compared)
                        own = symmetric_times(
                            times(symmetric_at(dim, tension, i), per_stress), grad_i
                        )
                        other = symmetric_times(
                            load_spatial(lanes, sym, near, tension_row, k), grad_j
                        )
                        pull = plus(pull, times(minus(own, other), repel))
                        gained -= V_j * repel * rho_inv_i * dot(v_ij, own)
                    total = plus(
                        total, times(minus(times(pull, rho_inv_i), times(between, push)), V_j)
                    )
                put(
                    acceleration, i,
                    times(lane_sums(total), per_length / (per_velocity * per_velocity)),
                )  # fmt: skip
                energy_rate[i] = lane_sum(gained) * (
                    per_length / (per_velocity * per_velocity * per_velocity)
                )
                c_i = sound_speed[i]
                Q = models.q_b * c_i + models.q_a * (lane_max(fastest) / per_velocity)
                signal_speed[i] = 2.0 * (Q + np.sqrt(Q * Q + c_i * c_i))  # eq 414
