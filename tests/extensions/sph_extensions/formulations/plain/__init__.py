"""SPH as in Monaghan (1992), without a correction for the gradient of the smoothing length.

The support keeps the size that it begins with. An ideal gas; artificial viscosity of one alpha.
"""

from typing import NamedTuple

from numba import njit

from sph import kernels
from sph.compiled import COMPILED, INLINED, larger, smaller
from sph.eos import pressure, sound_speed
from sph.formulations import Formulation
from sph.integrators.leapfrog import POSITIVE
from sph.kernels import dw_over_q, normalisation, w
from sph.neighbours.order import BLOCK
from sph.part import Evolved, Key, Pass
from sph.passes.gather import (
    TINY,
    copy_box,
    copy_values,
    copy_vectors,
    largest_of,
    longest_list,
    near_blocks,
    near_particles,
    own_box,
    place_block,
    scratch,
    unit,
    unpacked,
)
from sph.simd import (
    at,
    dot,
    filled,
    inverse_sqrt,
    lane_max,
    lane_sum,
    lane_sums,
    load,
    load_spatial,
    minus,
    plus,
    put,
    select,
    times,
    width,
    zeros,
)
from sph.state import COMMON, Field

# Quantities of candidates of the rate pass after position and velocity.
MASS, RHO, P_TERM, C_S, H_INV = 0, 1, 2, 3, 4


class Models(NamedTuple):
    """What the passes take."""

    kernel: tuple
    eos: tuple
    viscosity: float
    support_ratio: float
    eta: float


@njit(**COMPILED)
def density(
    first, last, dim, models, neighbours, position, mass, energy, support, rho, P, c, P_term,
    support_inverse, support_before,
):  # fmt: skip
    """Density, and what follows from it, of the particles of superblocks [first, last)."""
    D, lanes, lists = len(dim), neighbours.lanes, neighbours.lists
    C = normalisation(models.kernel, dim)
    fields = dim + (0,)  # noqa: RUF005  # position, mass
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(fields))
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        x_0 = at(dim, position, i_0)
        per_length = unit(largest_of(support, i_0, i_end))
        per_mass = unit(largest_of(mass, i_0, i_end))
        number = lists.count[superblock]
        for t in range(number):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            to = t * len(fields) * BLOCK
            copy_box(dim, boxes, t, neighbours, block, image, x_0, per_length, 0.0)
            place_block(lanes, dim, copied, to, position, block, neighbours, image, x_0, per_length)
            copy_values(lanes, copied, to + D * BLOCK, mass, block, per_mass)
        for block in range(begin, end):
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, mass.size)
            reach = largest_of(support, i_first, i_last) * per_length
            blocks = near_blocks(lanes, dim, boxes, number, low, high, reach, chosen)
            nc = near_particles(
                lanes, dim, copied, fields, 0, chosen, blocks, low, high, reach, near
            )
            for i in range(i_first, i_last):
                x_i = times(minus(at(dim, position, i), x_0), per_length)
                H_inv = 1.0 / (support[i] * per_length)
                total = filled(lanes, 0.0)
                for k in range(0, nc, width(lanes)):
                    r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
                    squared = dot(r_ij, r_ij) + TINY
                    q = squared * inverse_sqrt(squared) * H_inv
                    total += load(lanes, near, (D, k)) * w(models.kernel, dim, q)
                rho[i] = C * lane_sum(total) / (per_mass * support[i] ** D)
                P[i] = pressure(models.eos, rho[i], energy[i])
                c[i] = sound_speed(models.eos, rho[i], P[i])
                P_term[i] = P[i] / rho[i] ** 2
                support_inverse[i] = 1.0 / support[i]
                support_before[i] = support[i]


@njit(**COMPILED)
def rates(
    first, last, dim, models, neighbours, position, velocity, mass, support, rho, c, P_term,
    support_inverse, acceleration, energy_rate, signal_speed,
):  # fmt: skip
    """Symmetric pair force with the mean of the two kernels' gradients."""
    D, lanes, lists = len(dim), neighbours.lanes, neighbours.lists
    C, kernel = normalisation(models.kernel, dim), models.kernel
    rest = 2 * D
    fields = dim + dim + (0, 0, 0, 0, 0)
    copied, near, boxes, chosen = scratch(lanes, dim, longest_list(first, last, lists), len(fields))
    for superblock in range(first, last):
        begin, end = lists.first[superblock], lists.first[superblock + 1]
        i_0, i_end = begin * BLOCK, min(end * BLOCK, mass.size)
        x_0, v_0 = at(dim, position, i_0), at(dim, velocity, i_0)
        per_length = unit(largest_of(support, i_0, i_end))
        per_velocity = unit(largest_of(c, i_0, i_end))
        per_mass = unit(largest_of(mass, i_0, i_end))
        per_density = per_mass / per_length**D
        per_term = per_velocity**2 / per_density
        number = lists.count[superblock]
        for t in range(number):
            block, image = unpacked(lists.entries[lists.start[superblock] + t])
            reach = largest_of(support, block * BLOCK, min((block + 1) * BLOCK, mass.size))
            copy_box(dim, boxes, t, neighbours, block, image, x_0, per_length, reach * per_length)
            to = t * len(fields) * BLOCK
            place_block(lanes, dim, copied, to, position, block, neighbours, image, x_0, per_length)
            to += D * BLOCK
            copy_vectors(
                lanes, dim, copied, to, velocity, block, neighbours, image, v_0, per_velocity
            )
            to += D * BLOCK
            copy_values(lanes, copied, to + MASS * BLOCK, mass, block, per_mass)
            copy_values(lanes, copied, to + RHO * BLOCK, rho, block, per_density)
            copy_values(lanes, copied, to + P_TERM * BLOCK, P_term, block, per_term)
            copy_values(lanes, copied, to + C_S * BLOCK, c, block, per_velocity)
            copy_values(lanes, copied, to + H_INV * BLOCK, support_inverse, block, 1.0 / per_length)
        for block in range(begin, end):
            low, high = own_box(dim, neighbours, block, x_0, per_length)
            i_first, i_last = block * BLOCK, min((block + 1) * BLOCK, mass.size)
            reach = largest_of(support, i_first, i_last) * per_length
            blocks = near_blocks(lanes, dim, boxes, number, low, high, reach, chosen)
            nc = near_particles(
                lanes, dim, copied, fields, rest + H_INV, chosen, blocks, low, high, reach, near
            )
            for i in range(i_first, i_last):
                x_i = times(minus(at(dim, position, i), x_0), per_length)
                v_i = times(minus(at(dim, velocity, i), v_0), per_velocity)
                rho_i, c_i = rho[i] * per_density, c[i] * per_velocity
                term_i, H_inv_i = P_term[i] * per_term, support_inverse[i] / per_length
                total = zeros(lanes, dim)
                gained = filled(lanes, 0.0)
                fastest = filled(lanes, 0.0)
                for k in range(0, nc, width(lanes)):
                    r_ij = minus(x_i, load_spatial(lanes, dim, near, 0, k))
                    v_ij = minus(v_i, load_spatial(lanes, dim, near, D, k))
                    squared, v_dot_r = dot(r_ij, r_ij) + TINY, dot(v_ij, r_ij)
                    r_inv = inverse_sqrt(squared)
                    r = squared * r_inv
                    H_inv_j = load(lanes, near, (rest + H_INV, k))
                    slope = _gradient(kernel, dim, r, H_inv_i) + _gradient(kernel, dim, r, H_inv_j)
                    slope *= 0.5 * C * load(lanes, near, (rest + MASS, k))
                    w_ij = smaller(v_dot_r, 0.0) * r_inv
                    v_sig = c_i + load(lanes, near, (rest + C_S, k)) - 3.0 * w_ij
                    rho_j = load(lanes, near, (rest + RHO, k))
                    Pi = -models.viscosity * v_sig * w_ij / (rho_i + rho_j)
                    term_j = load(lanes, near, (rest + P_TERM, k))
                    total = plus(total, times(r_ij, slope * (term_i + term_j + Pi)))
                    gained += slope * (term_i + 0.5 * Pi) * v_dot_r
                    fastest = larger(fastest, select(slope < 0.0, v_sig, 0.0))
                put(acceleration, i, times(lane_sums(total), -per_length / per_velocity**2))
                energy_rate[i] = lane_sum(gained) * (per_length / per_velocity**3)
                signal_speed[i] = lane_max(fastest) / per_velocity


@njit(**INLINED)
def _gradient(kernel, dim, r, H_inv):
    """Return (dW/dr)/r without the normalisation, of numbers or vectors."""
    found = dw_over_q(kernel, dim, r * H_inv) * H_inv * H_inv
    for _ in range(len(dim)):
        found = found * H_inv
    return found


class Plain(Formulation):
    """Density by summation, supports of fixed size, and the classical pair force."""

    keys = (
        Key("eta", "smoothing length in particle spacings", kind=float, default=1.6, above=0.0),
        Key("plain_alpha", "artificial viscosity", kind=float, default=1.0, at_least=0.0),
    )
    neighbours_key = "physics.eta"
    evolved = (Evolved("internal_energy", "energy_rate", "predicted_energy", POSITIVE),)

    def __init__(self, scene):
        kernel = scene.physics.kernel_model()
        ratio = kernels.support_ratio(kernel, scene.dimension)
        self.fields = (
            *COMMON,
            Field("pressure", stored=False),
            Field("pressure_term", stored=False),
            Field("support_inverse", stored=False),
        )
        self.eos = scene.eos
        self.models = Models(
            kernel, scene.eos, float(scene.physics.plain_alpha), ratio, float(scene.physics.eta)
        )
        gas = ("position", "mass", "predicted_energy", "support")
        derived = ("density", "sound_speed", "pressure_term", "support_inverse")
        self.passes = (
            Pass("density", "density", density, gas,
                 ("density", "pressure", *derived[1:], "support_before")),
            Pass("rates", "rates", rates,
                 ("position", "predicted_velocity", "mass", "support", *derived),
                 ("acceleration", "energy_rate", "signal_speed")),
        )  # fmt: skip

    @classmethod
    def of(cls, scene):
        return cls(scene)

    def described(self):
        return [f"plain SPH, kernel {self.models.kernel.name}"], []

    def pressure(self, state):
        return self.eos.pressure(state.density, state.internal_energy)
