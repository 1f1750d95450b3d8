"""The schemes written out densely in double precision: what the engine is measured against.

Every particle meets every particle and every image of it; nothing here knows of trees, blocks or
lists, and nothing is imported from the program. Equation numbers are those of
docs/equations.md unless another publication is named.
Code units throughout; vectors are (D, N), scalars (N,).
"""

import itertools
import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

ELEMENTS_PER_BLOCK = 1_000_000  # of the distance matrix held at once: 8 MB an array


def wendland_c2(q, dimension):
    """(w, dw/dq) of eqs 11-14 at q = r/H, an array; zero from q = 1 on."""
    p = np.maximum(1.0 - q, 0.0)
    if dimension == 1:
        return 5 / 4 * p**3 * (1 + 3 * q), 15 / 4 * (p**3 - p**2 * (1 + 3 * q))
    c_w = 7 / np.pi if dimension == 2 else 21 / (2 * np.pi)
    return c_w * p**4 * (1 + 4 * q), 4 * c_w * (p**4 - p**3 * (1 + 4 * q))


def cubic_spline(q, dimension):
    """(w, dw/dq) of eqs 115 and 116 at q = r/H, an array; zero from q = 1 on."""
    p = np.maximum(1.0 - q, 0.0)
    norm = 2**dimension * (2 / 3, 10 / (7 * np.pi), 1 / np.pi)[dimension - 1]
    value = np.where(q < 0.5, 1 - 6 * q**2 + 6 * q**3, 2 * p**3)
    return norm * value, -6 * norm * np.where(q < 0.5, 2 * q - 3 * q**2, p**2)


def _wendland(q, norm, power, polynomial):
    """(w, dw/dq) of norm (1 - q)^power times a polynomial, lowest coefficient first."""
    p, factor = np.maximum(1.0 - q, 0.0), np.polynomial.Polynomial(polynomial)
    w = norm * p**power * factor(q)
    return w, norm * (p**power * factor.deriv()(q) - power * p ** (power - 1) * factor(q))


def wendland_c4(q, dimension):
    """(w, dw/dq) of Dehnen & Aly (2012), table 1, at q = r/H, an array; zero from q = 1 on."""
    norm = (3 / 2, 9 / np.pi, 495 / (32 * np.pi))[dimension - 1]
    power, polynomial = (5, (1, 5, 8)) if dimension == 1 else (6, (1, 6, 35 / 3))
    return _wendland(q, norm, power, polynomial)


def wendland_c6(q, dimension):
    """(w, dw/dq) of Dehnen & Aly (2012), table 1, at q = r/H, an array; zero from q = 1 on."""
    norm = (55 / 32, 78 / (7 * np.pi), 1365 / (64 * np.pi))[dimension - 1]
    power, polynomial = (7, (1, 7, 19, 21)) if dimension == 1 else (8, (1, 8, 25, 32))
    return _wendland(q, norm, power, polynomial)


def quintic_spline(q, dimension):
    """(w, dw/dq) of Dehnen & Aly (2012), table 1, at q = r/H, an array; zero from q = 1 on."""
    norm = (3**5 / 40, 3**7 * 7 / (478 * np.pi), 3**7 / (40 * np.pi))[dimension - 1]
    knots = [(1, 1), (-6, 2 / 3), (15, 1 / 3)]
    w = sum(factor * np.maximum(knot - q, 0.0) ** 5 for factor, knot in knots)
    slope = sum(-5 * factor * np.maximum(knot - q, 0.0) ** 4 for factor, knot in knots)
    return norm * w, norm * slope


KERNELS = {
    "wendland_c2": wendland_c2,
    "wendland_c4": wendland_c4,
    "wendland_c6": wendland_c6,
    "cubic_spline": cubic_spline,
    "quintic_spline": quintic_spline,
}
# H/h = 1/(2 sigma), sigma the standard deviation per axis at H = 1 (eq 110).
H_PER_h = {
    "wendland_c2": np.sqrt([21 / 2, 72 / 5, 15]) / 2,
    "wendland_c4": np.sqrt([15, 132 / 7, 39 / 2]) / 2,
    "wendland_c6": np.sqrt([39 / 2, 70 / 3, 24]) / 2,
    "cubic_spline": np.sqrt([12, 392 / 31, 40 / 3]) / 2,
    "quintic_spline": np.sqrt([18, 51624 / 2771, 135 / 7]) / 2,
}


@dataclass(frozen=True)
class Scene:
    """Parameters of the scheme; `box` (D, 2), one of `boundaries` per axis."""

    box: np.ndarray
    boundaries: tuple[str, ...]  # "periodic", "mirror" or "open"
    gamma: float = 1.4
    eta: float = 1.6
    C: float = 0.15
    # or {"min": …, "max": …}, where there is "ell" too the switch of Cullen & Dehnen (2010)
    alpha: float | dict[str, float] = 1.0
    scheme: str = "grad_h"  # or "variational" or "pressure_energy"
    conductivity: tuple[str, float] | None = None  # ("pressure_jump" or "approach", strength)
    switched_conductivity: bool = False  # where u is not linear, after Price & Monaghan (2005)
    kernel: str = "wendland_c2"
    flattened: bool = False  # the cubic spline's flattened gradient, in eqs 22-23 only
    density: str = "mass"  # or "number"
    balsara: bool = True
    density_passes: int | str = 2  # or "converged"
    unsettled: float = 0.05  # change of H in the last counted pass beyond which it is solved for
    energy_limit: bool = True

    @property
    def dimension(self):
        return len(self.box)

    @property
    def finds_shocks(self):
        return isinstance(self.alpha, dict) and "ell" in self.alpha

    def weight(self, mass):
        """What rho_i and H_i count: (N,) masses, or ones."""
        return mass if self.density == "mass" else np.ones_like(mass)

    @property
    def h_ratio(self):
        """H/h of eq 15."""
        return H_PER_h[self.kernel][self.dimension - 1]

    def kernel_at(self, r, support):
        """(W, dW/dr, dW/dH) of eqs 9, 18 and 10."""
        q, d = r / support, self.dimension
        w, slope = KERNELS[self.kernel](q, d)
        by_support = -(d * w + q * slope) * support ** -(d + 1.0)
        return w * support**-d, slope * support ** -(d + 1.0), by_support

    def force_slope(self, r, support):
        """dW/dr as eqs 22-23 take it: flat within q = 1/3 where the scene says so."""
        slope = self.kernel_at(r, support)[1]
        if not self.flattened:
            return slope
        if self.kernel != "cubic_spline":
            raise ValueError("only the cubic spline has a flattened gradient")
        flat = self.kernel_at(support / 3, support)[1]
        return np.where(r < support / 3, flat, slope)


class Pairs(NamedTuple):
    """P pairs (i, j), j a particle or an image of it, i itself included."""

    i: np.ndarray  # (P,)
    j: np.ndarray  # (P,) the particle whose image it is
    sign: np.ndarray  # (D, P) by which the image's velocity is multiplied
    r: np.ndarray  # (P,)
    unit: np.ndarray  # (D, P) r_ij / |r_ij|, zero where r = 0

    def sum(self, term, count):
        """Sum over j of (P,) or (D, P) terms for each of `count` particles i."""
        if term.ndim == 1:
            return np.bincount(self.i, term, count)
        return np.array([np.bincount(self.i, component, count) for component in term])

    def difference(self, velocity):
        """(D, P): v_i - v_j with the image's sign."""
        return velocity[:, self.i] - self.sign * velocity[:, self.j]


@dataclass
class Rates:
    """Steps 2-6 for all particles; `x_scale` is what round-off in x is measured by.

    Where x is a sum its scale is the sum of the absolute values of its pair terms (for vectors, of
    their moduli), with the factor before the sum; where it follows from such sums, their scales
    put through the formula; else its own modulus.
    """

    support: np.ndarray
    density: np.ndarray
    omega: np.ndarray
    divergence: np.ndarray
    curl: np.ndarray  # its modulus
    pressure: np.ndarray
    sound_speed: np.ndarray
    balsara: np.ndarray
    alpha: np.ndarray  # that the pairs were given
    acceleration: np.ndarray
    energy_rate: np.ndarray
    alpha_rate: np.ndarray
    signal_speed: np.ndarray  # largest of the particle's pairs
    support_scale: np.ndarray
    density_scale: np.ndarray
    omega_scale: np.ndarray
    divergence_scale: np.ndarray
    curl_scale: np.ndarray
    pressure_scale: np.ndarray
    sound_speed_scale: np.ndarray
    balsara_scale: np.ndarray
    alpha_scale: np.ndarray  # 1, or the condition of the system its gradients come from
    acceleration_scale: np.ndarray  # (N,)
    energy_rate_scale: np.ndarray
    alpha_rate_scale: np.ndarray
    signal_speed_scale: np.ndarray


def _axis_images(low, high, boundary, reach):
    """(sign, offset) of the images within reach along one axis: x' = sign x + offset."""
    if boundary == "open":
        return [(1.0, 0.0)]
    if boundary not in ("periodic", "mirror"):
        raise ValueError(f"unknown boundary {boundary!r}")
    found = [(1.0, 0.0)]
    cells = max(1, math.ceil(reach / (high - low)))
    for cell in itertools.chain(range(-cells, 0), range(1, cells + 1)):
        if boundary == "periodic" or cell % 2 == 0:
            found.append((1.0, cell * (high - low)))
        else:  # the wall nearest to this copy of the box is at low + (cell + 1)/2 lengths
            wall = low + (cell + 1) / 2 * (high - low)
            found.append((-1.0, 2 * wall))
    return found


def _images(scene, reach=0.0):
    """(sign, offset), each (D, 1), of every combination of the axes' images within reach."""
    axes = [
        _axis_images(low, high, boundary, reach)
        for (low, high), boundary in zip(scene.box, scene.boundaries, strict=True)
    ]
    for combination in itertools.product(*axes):
        sign, offset = np.array(combination).T
        yield sign[:, None], offset[:, None]


def _pairs(scene, position, reach_i, reach_j):
    """All pairs with r_ij < max(reach_i, reach_j), both (N,), found by trying every one."""
    d, n = position.shape
    rows = max(1, ELEMENTS_PER_BLOCK // n)
    found = []
    for sign, offset in _images(scene, max(reach_i.max(), reach_j.max())):
        image = sign * position + offset
        for first in range(0, n, rows):
            block = slice(first, first + rows)
            r_ij = position[:, block, None] - image[:, None, :]
            r = np.abs(r_ij[0]) if d == 1 else np.sqrt((r_ij**2).sum(axis=0))
            i, j = np.nonzero(r < np.maximum(reach_i[block, None], reach_j))
            unit = r_ij[:, i, j] / np.where(r[i, j] > 0, r[i, j], 1.0)
            found.append((i + first, j, np.broadcast_to(sign, unit.shape), r[i, j], unit))
    return Pairs(*(np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True)))


def _density(scene, position, mass, support):
    """(rho, Omega, scale of Omega) of eqs 7 and 8 at the given H."""
    n, weight = len(mass), scene.weight(mass)
    pairs = _pairs(scene, position, support, np.zeros(n))
    w, _, by_support = scene.kernel_at(pairs.r, support[pairs.i])
    w_j = weight[pairs.j]
    total = pairs.sum(w_j * w, n)
    factor = support / (scene.dimension * total)
    omega = 1 + factor * pairs.sum(w_j * by_support, n)
    omega_scale = 1 + factor * pairs.sum(w_j * abs(by_support), n)
    return mass / weight * total, omega, omega_scale


def _kernel_weight(scene, position, weight, support):
    """Sum_j w_j w(r_ij/H_i): it grows with H, and eq 15 asks it to be (H/h eta)^D w_i."""
    pairs = _pairs(scene, position, support, np.zeros(len(weight)))
    w = scene.kernel_at(pairs.r, support[pairs.i])[0]
    return pairs.sum(weight[pairs.j] * w, len(weight)) * support**scene.dimension


def _bracket(scene, position, weight, guess, target):
    """(low, high) around the H at which the kernel's weight reaches its target."""
    high = np.array(guess, dtype=float)
    low = high.copy()
    for _ in range(100):
        short = _kernel_weight(scene, position, weight, high) < target
        over = _kernel_weight(scene, position, weight, low) >= target
        if not (short.any() or over.any()):
            return low, high
        high[short] *= 2
        low[over] /= 2
    raise ValueError(f"eq 15 has no solution for particles {np.flatnonzero(short | over)}")


def _converged_support(scene, position, mass, guess):
    """H solving eqs 7 and 15 together, by bisection until no number lies between the ends."""
    weight = scene.weight(mass)
    target = (scene.h_ratio * scene.eta) ** scene.dimension * weight
    low, high = _bracket(scene, position, weight, guess, target)
    n = len(mass)
    pairs = _pairs(scene, position, high, np.zeros(n))
    w_j = weight[pairs.j]
    for _ in range(1100):  # more than the bits of any interval of doubles
        middle = 0.5 * (low + high)
        if np.all((middle == low) | (middle == high)):
            break
        w, _ = KERNELS[scene.kernel](pairs.r / middle[pairs.i], scene.dimension)
        over = pairs.sum(w_j * w, n) >= target
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    return high


def _smoothing(scene, position, mass, guess):
    """Steps 2a-2c. After counted passes H is newer by eq 15 than the rho and Omega beside it."""
    if scene.density_passes == "converged":
        support = _converged_support(scene, position, mass, guess)
        rho, omega, omega_scale = _density(scene, position, mass, support)
    else:
        support = guess
        for _ in range(scene.density_passes):
            before = support
            rho, omega, omega_scale = _density(scene, position, mass, before)
            support = scene.h_ratio * scene.eta * (mass / rho) ** (1 / scene.dimension)  # eq 15
        # where the passes do not settle, eqs 7 and 15 are solved together (eq 47)
        unsettled = abs(support / before - 1) > scene.unsettled
        if unsettled.any():
            solved = _converged_support(scene, position, mass, guess)
            at_root = _density(scene, position, mass, solved)
            support = np.where(unsettled, solved, support)
            rho, omega, omega_scale = (
                np.where(unsettled, *pair)
                for pair in zip(at_root, (rho, omega, omega_scale), strict=True)
            )
    return {
        "support": support,
        "density": rho,
        "omega": omega,
        "support_scale": support,
        "density_scale": rho,  # all its terms are positive
        "omega_scale": omega_scale,
    }


def _cross(a, b):
    """(1 or 3, P) cross product of (D, P) vectors: in 2-D the z component, in 1-D zero."""
    if len(a) == 1:
        return np.zeros_like(a)
    if len(a) == 2:
        return (a[0] * b[1] - a[1] * b[0])[None]
    return np.cross(a, b, axis=0)


def _flow(scene, pairs, mass, velocity, state):
    """Divergence and curl, eqs 16 and 17."""
    n = len(mass)
    # dn_i/dt, n_i the density or the number density, whose eq 7 is differentiated
    weight = scene.weight(mass)
    w_dW = weight[pairs.j] * scene.kernel_at(pairs.r, state["support"][pairs.i])[1]
    v_ij = pairs.difference(velocity)
    per_volume = 1 / (state["omega"] * state["density"] * weight / mass)
    # eq 16: without this minus the divergence of an expansion would be negative
    approach = -w_dW * (v_ij * pairs.unit).sum(axis=0)
    turn = w_dW * _cross(v_ij, pairs.unit)
    return {
        "divergence": per_volume * pairs.sum(approach, n),
        "curl": np.linalg.norm(per_volume * pairs.sum(turn, n), axis=0),
        "divergence_scale": abs(per_volume) * pairs.sum(abs(approach), n),
        "curl_scale": abs(per_volume) * pairs.sum(np.linalg.norm(turn, axis=0), n),
    }


def _thermodynamics(scene, pairs, mass, internal_energy, state):
    """Pressure, sound speed and Balsara's factor, eqs 19-21."""
    pressure = (scene.gamma - 1) * state["density"] * internal_energy
    sound = np.sqrt(scene.gamma * pressure / state["density"])
    if scene.scheme == "pressure_energy":  # Hopkins (2013): P_i = (gamma - 1) sum m_j u_j W_ij
        w = scene.kernel_at(pairs.r, state["support"][pairs.i])[0]
        weight = mass[pairs.j] * internal_energy[pairs.j]
        pressure = (scene.gamma - 1) * pairs.sum(weight * w, len(mass))
    compression = abs(state["divergence"])
    denominator = compression + state["curl"] + 1e-4 * sound / state["support"]
    factor = np.ones_like(sound)
    if scene.balsara:  # 0/0, cold gas without any shear, counts as no compression
        factor = compression / np.where(denominator > 0, denominator, 1.0)
    return {
        "pressure": pressure,
        "sound_speed": sound,
        "balsara": factor,
        "pressure_scale": pressure,
        "sound_speed_scale": sound,
        "balsara_scale": np.ones_like(factor),
    }


class PairForce(NamedTuple):
    """What a scheme's pressures do to particle i of each pair, moduli of what it is summed from."""

    push: np.ndarray  # (P,) acceleration along the unit vector
    work: np.ndarray  # (P,) rate of energy
    push_scale: np.ndarray  # (P,)
    work_scale: np.ndarray  # (P,)


def _pressure_grad_h(scene, pairs, mass, energy, state, along, radial):
    """The pressures of eqs 22 and 23: `along` is dW/dr at H_i and at H_j."""
    own, other = (
        term * (along[0] + along[1]) / 2 for term in _pressure_terms(scene, pairs, mass, state)
    )
    return PairForce(-(own + other), own * radial, abs(own) + abs(other), abs(own * radial))


def _pressure_terms(scene, pairs, mass, state):
    """(P,) what dW_i and dW_j are multiplied by in the acceleration of i.

    By mass m_j P/(Omega rho^2) of either. By number, with volumes V = m/rho = 1/n, the energy
    changes by -P dV = P V^2 dn: V_i^2 P_i/Omega_i and V_j^2 P_j/Omega_j, over m_i.
    """
    i, j = pairs.i, pairs.j
    if scene.density == "number":
        squared = (mass / state["density"]) ** 2 * state["pressure"] / state["omega"]
        return squared[i] / mass[i], squared[j] / mass[i]
    term = state["pressure"] / (state["omega"] * state["density"] ** 2)
    return mass[j] * term[i], mass[j] * term[j]


def _pressure_variational(scene, pairs, mass, energy, state, along, radial):
    """Springel & Hernquist (2002), eqs 7 and 8, and the energy that follows from their entropy."""
    own, other = (
        term * dW
        for term, dW in zip(_pressure_terms(scene, pairs, mass, state), along, strict=True)
    )
    return PairForce(-(own + other), own * radial, abs(own) + abs(other), abs(own * radial))


def _pressure_energy(scene, pairs, mass, energy, state, along, radial):
    """Hopkins (2013), eqs 21 and 22, also for supports that hold a mass as eqs 7 and 15 ask.

    f_ij = 1 - [H_i/(D n_i) dP_i/dH_i] / [(gamma - 1) m_j u_j Omega_i] is his eq 12. With m_j for
    the quantity that is summed to find H, where he sums 1, it is rho_i and no m_j.
    """
    i, j, n, P = pairs.i, pairs.j, len(mass), state["pressure"]
    by_support = scene.kernel_at(pairs.r, state["support"][i])[2]
    terms = (scene.gamma - 1) * mass[j] * energy[j] * by_support
    by_number = scene.density == "number"
    n_i = state["density"] / mass if by_number else state["density"]
    m_j = mass if by_number else np.ones(n)
    per_sum = state["support"] / (scene.dimension * n_i * state["omega"])
    change, change_scale = per_sum * pairs.sum(terms, n), per_sum * pairs.sum(abs(terms), n)

    def term(side, opposite, dW):
        factor = (scene.gamma - 1) ** 2 * mass[j] * energy[i] * energy[j] / P[side] * dW
        in_f = 1 / ((scene.gamma - 1) * m_j[opposite] * energy[opposite])
        f, f_scale = 1 - change[side] * in_f, 1 + change_scale[side] * in_f
        return factor * f, abs(factor) * f_scale

    own, own_scale = term(i, j, along[0])
    other, other_scale = term(j, i, along[1])
    return PairForce(-(own + other), own * radial, own_scale + other_scale, own_scale * abs(radial))


PRESSURES = {
    "grad_h": _pressure_grad_h,
    "variational": _pressure_variational,
    "pressure_energy": _pressure_energy,
}


def _viscosity(pairs, alpha, state, w_ij, v_sig):
    """(P,) the viscous term f_ij Pi_ij of eq 24."""
    i, j, rho, f = pairs.i, pairs.j, state["density"], state["balsara"]
    # eq 24: the pair takes the mean of its coefficients
    term = -0.5 * 0.5 * (alpha[i] + alpha[j]) * v_sig * w_ij / (0.5 * (rho[i] + rho[j]))
    return term * 0.5 * (f[i] + f[j])


def conducting_share(scene, pairs, mass, velocity, energy, state):
    """(N,) h^2 |lap u| / (v_sig sqrt(u)), at most 1: the balance of Price & Monaghan's (2005)
    source S = 0.1 h |lap u| / sqrt(u) with decay in h / (0.1 v_sig); and its scale."""
    n, i, j, H = len(mass), pairs.i, pairs.j, state["support"]
    # where particles meet (dW/dr)/r is the slope's own: every kernel is a polynomial below q = 0.3
    slope = np.polynomial.Chebyshev.interpolate(
        lambda q: KERNELS[scene.kernel](q, scene.dimension)[1], 12, domain=[0, 0.3]
    )
    meeting = slope.deriv()(0.0) * H[i] ** -(scene.dimension + 2.0)
    apart = pairs.r > 0
    F = np.where(apart, scene.kernel_at(pairs.r, H[i])[1] / np.where(apart, pairs.r, 1.0), meeting)
    terms = 2 * mass[j] / state["density"][j] * (energy[i] - energy[j]) * F
    factor = (H / scene.h_ratio) ** 2 / (
        _fastest_approach(pairs, velocity, state) * np.sqrt(energy)
    )
    scale = factor * pairs.sum(abs(terms), n)
    return np.minimum(factor * abs(pairs.sum(terms, n)), 1.0), scale


def _fastest_approach(pairs, velocity, state):
    """(N,) largest (c_i + c_j)/2 - min(0, v_ij.e_ij) in the support, eq 76."""
    i, j, sound = pairs.i, pairs.j, state["sound_speed"]
    within = pairs.r < state["support"][i]
    closing = np.minimum((pairs.difference(velocity) * pairs.unit).sum(axis=0), 0.0)
    fastest = sound.copy()
    np.maximum.at(fastest, i[within], (0.5 * (sound[i] + sound[j]) - closing)[within])
    return fastest


def _conduction(scene, pairs, mass, velocity, energy, state, w_ij, mean_dW):
    """(P,) rate of energy of Price (2008), eq 27: sum m_j/rho_ij v_sig (u_i - u_j) e_ij.grad W."""
    if scene.conductivity is None:
        return np.zeros(len(w_ij))
    name, strength = scene.conductivity
    i, j, P, rho = pairs.i, pairs.j, state["pressure"], state["density"]
    rho_ij = 0.5 * (rho[i] + rho[j])
    speed = {"approach": abs(w_ij), "pressure_jump": np.sqrt(abs(P[i] - P[j]) / rho_ij)}[name]
    if scene.switched_conductivity:
        share = conducting_share(scene, pairs, mass, velocity, energy, state)[0]
        strength = strength * 0.5 * (share[i] + share[j])
    return strength * speed * mass[j] / rho_ij * (energy[i] - energy[j]) * mean_dW


def _forces(scene, pairs, mass, velocity, energy, alpha, state):
    """Acceleration, energy rate and largest signal speed, eqs 22-26."""
    n, i, j = len(mass), pairs.i, pairs.j
    sound, support = state["sound_speed"], state["support"]
    radial = (pairs.difference(velocity) * pairs.unit).sum(axis=0)
    w_ij = np.minimum(radial, 0.0)  # eq 26
    v_sig = sound[i] + sound[j] - 3 * w_ij  # eq 25
    along = [scene.force_slope(pairs.r, support[side]) for side in (i, j)]
    pressure = PRESSURES[scene.scheme](scene, pairs, mass, energy, state, along, radial)
    mean_dW = 0.5 * (along[0] + along[1])
    viscous = _viscosity(pairs, alpha, state, w_ij, v_sig) * mass[j] * mean_dW
    conducted = _conduction(scene, pairs, mass, velocity, energy, state, w_ij, mean_dW)
    push = pressure.push - viscous  # eq 22
    work = pressure.work + 0.5 * viscous * radial  # eq 23
    fastest = np.zeros(n)
    np.maximum.at(fastest, i, v_sig)
    return {
        "acceleration": pairs.sum(push * pairs.unit, n),
        "energy_rate": pairs.sum(work + conducted, n),
        "signal_speed": fastest,
        "acceleration_scale": pairs.sum(pressure.push_scale + abs(viscous), n),
        "energy_rate_scale": pairs.sum(
            pressure.work_scale + abs(viscous * radial) + abs(conducted), n
        ),
        "signal_speed_scale": fastest,
    }


def _moments(scene, pairs, mass, support):
    """(P,) weights of the gradient, (N, D, D) moments of r_ij with them, (N,) where they are flat.

    Moments are flat, and stand here as unity, where neighbours lie on a line or in a plane.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = scene.kernel_at(pairs.r, support[pairs.i])[1] / pairs.r
    weight = scene.weight(mass)[pairs.j] * np.where(pairs.r > 0, -slope, 0.0)
    moments = _products(pairs, weight, pairs.r * pairs.unit, len(mass))
    flat = np.linalg.eigvalsh(moments)[:, 0] <= 1e-6 * np.trace(moments, axis1=1, axis2=2)
    moments[flat] = np.eye(scene.dimension)
    return weight, moments, flat


def _products(pairs, weight, vectors, count):
    """(N, D, D) sums of weight r_ij,b vector_a, b first."""
    r_ij = pairs.r * pairs.unit
    return np.array([[pairs.sum(weight * a * b, count) for b in r_ij] for a in vectors]).T


def _gradient(scene, pairs, mass, support, field):
    """(N, D, D) d field_a/dx_b of a (D, N) field, exact if linear: Cullen & Dehnen's appendix B."""
    weight, moments, flat = _moments(scene, pairs, mass, support)
    solved = np.linalg.solve(moments, _products(pairs, weight, pairs.difference(field), len(mass)))
    solved[flat] = 0.0  # no gradient is to be had there
    return solved.transpose(0, 2, 1)


def shock_alpha(scene, pairs, mass, velocity, acceleration, alpha, dt, state):
    """(N,) alpha after dt by eqs 70-78."""
    n, i, j, H = len(mass), pairs.i, pairs.j, state["support"]
    v_sig = _fastest_approach(pairs, velocity, state)  # eq 76
    L = _gradient(scene, pairs, mass, H, velocity)
    divergence = np.trace(L, axis1=1, axis2=2)
    rate = np.trace(_gradient(scene, pairs, mass, H, acceleration), axis1=1, axis2=2)
    rate = rate - np.einsum("nab,nba->n", L, L)
    S = 0.5 * (L + L.transpose(0, 2, 1))
    S = S - divergence[:, None, None] / scene.dimension * np.eye(scene.dimension)
    w = scene.kernel_at(pairs.r, H[i])[0]
    weight = scene.weight(mass)
    n_i = state["density"] * weight / mass
    R = pairs.sum(np.sign(state["divergence"][j]) * weight[j] * w, n) / n_i  # eq 73
    converging = abs(2 * (1 - R) ** 4 * divergence) ** 2
    shear = np.einsum("nab,nab->n", S, S)
    flowing = converging + shear > 0
    xi = converging / np.where(flowing, converging + shear, 1.0)  # eq 74
    shock = H**2 * xi * np.maximum(-rate, 0.0)  # eq 75
    target = scene.alpha["max"] * shock / (v_sig**2 + shock)  # eq 77
    target = np.maximum(target, scene.alpha["min"])  # theirs is zero
    tau = H / (2 * scene.alpha["ell"] * v_sig)
    decayed = target + (alpha - target) * np.exp(-dt / tau)
    return np.where(alpha < target, target, decayed)  # eq 78


def _alpha_change(scene, alpha, state):
    """Rate of change of alpha, eqs 27 and 28; zero where alpha is one number or set by shocks."""
    if not isinstance(scene.alpha, dict) or scene.finds_shocks:
        return {"alpha_rate": np.zeros_like(alpha), "alpha_rate_scale": np.zeros_like(alpha)}
    h = state["support"] / scene.h_ratio
    decay = (alpha - scene.alpha["min"]) / (h / (0.25 * state["sound_speed"]))
    room = scene.alpha["max"] - alpha
    return {
        "alpha_rate": np.maximum(-state["divergence"] * room, 0.0) - decay,
        "alpha_rate_scale": state["divergence_scale"] * abs(room) + abs(decay),
    }


def _start_alpha(scene, count):
    """(N,) alpha at t = 0: its minimum, or the one number."""
    value = scene.alpha["min"] if isinstance(scene.alpha, dict) else scene.alpha
    return np.full(count, float(value))


class Before(NamedTuple):
    """What the step before left to a switch that finds shocks."""

    acceleration: np.ndarray  # (D, N)
    dt: float  # the time since


def rates(
    scene, position, velocity, mass, internal_energy, support_guess, alpha=None, before=None
) -> Rates:
    """Steps 2-6 from position and the predicted velocity, (D, N), energy and alpha, (N,).

    `support_guess` (N,) is the H the first density pass starts from; `alpha` defaults to that of
    t = 0; `before` is None at the start, where no shock is looked for.
    ValueError where the energy is negative, H outgrows the box or eq 15 has no solution.
    """
    if np.any(internal_energy < 0):
        raise ValueError("negative internal energy")
    alpha = _start_alpha(scene, len(mass)) if alpha is None else alpha
    state = _smoothing(scene, position, mass, np.asarray(support_guess, dtype=float))
    # the pair set of eq 32's maximum; gradients vanish in it beyond their own H
    pairs = _pairs(scene, position, state["support"], state["support"])
    state |= _flow(scene, pairs, mass, velocity, state)
    state |= _thermodynamics(scene, pairs, mass, internal_energy, state)
    if scene.finds_shocks and before is not None:
        alpha = shock_alpha(
            scene, pairs, mass, velocity, before.acceleration, alpha, before.dt, state
        )
        state["alpha_scale"] = np.linalg.cond(_moments(scene, pairs, mass, state["support"])[1])
    state = {"alpha_scale": np.ones_like(alpha)} | state | {"alpha": alpha}
    state |= _forces(scene, pairs, mass, velocity, internal_energy, alpha, state)
    state |= _alpha_change(scene, alpha, state)
    return Rates(**state)


class Moment(NamedTuple):
    """A line of the history; `dt` is the step that led to it, 0 at the start."""

    time: float
    dt: float
    kinetic: float
    internal: float
    momentum: np.ndarray  # (D,)


@dataclass
class State:
    """Corrected values at `time`, the rates of the last step 2-6, and the next step by eq 32."""

    time: float
    position: np.ndarray
    velocity: np.ndarray
    mass: np.ndarray
    internal_energy: np.ndarray
    alpha: np.ndarray
    rates: Rates
    dt: float
    history: list[Moment] = field(default_factory=list)


def time_step(scene, internal_energy, now: Rates) -> float:
    """Eq 32; `energy_limit` False leaves its u/|du/dt| out."""
    limit = 2 * now.support / now.signal_speed
    if scene.energy_limit:
        with np.errstate(divide="ignore", invalid="ignore"):
            cooling = internal_energy / abs(now.energy_rate)
        limit = np.minimum(limit, np.where(now.energy_rate == 0, np.inf, cooling))
    return scene.C * limit.min()


def _moment(state, dt):
    kinetic = 0.5 * (state.mass * (state.velocity**2).sum(axis=0)).sum()
    internal = (state.mass * state.internal_energy).sum()
    return Moment(state.time, dt, kinetic, internal, (state.mass * state.velocity).sum(axis=1))


def start(scene, position, velocity, mass, internal_energy) -> State:
    """The state at t = 0: converged H, then steps 2-6 with the values themselves."""
    extent = np.ptp(position, axis=1).max()
    guess = scene.eta * scene.h_ratio * extent / len(mass) ** (1 / scene.dimension)
    converged = replace(scene, density_passes="converged")
    now = rates(converged, position, velocity, mass, internal_energy, np.full(len(mass), guess))
    dt = time_step(scene, internal_energy, now)
    alpha = _start_alpha(scene, len(mass))
    state = State(0.0, position, velocity, mass, internal_energy, alpha, now, dt)
    state.history.append(_moment(state, 0.0))
    return state


def _into_box(scene, position, *velocities):
    """Copies of the (D, N) arrays with the particles that left the box back in it.

    Through a periodic face they come in at the other one; a mirror turns them back, velocities
    with them: the image that has just come in is the particle.
    """
    position, *velocities = (array.copy() for array in (position, *velocities))
    for axis, ((low, high), boundary) in enumerate(zip(scene.box, scene.boundaries, strict=True)):
        x = position[axis]
        if boundary == "periodic":
            x += np.where(x < low, high - low, 0.0) - np.where(x >= high, high - low, 0.0)
        elif boundary == "mirror":
            out = (x < low) | (x > high)
            x[out] = np.where(x[out] < low, 2 * low, 2 * high) - x[out]
            for v in velocities:
                v[axis, out] *= -1
    return position, *velocities


def _step(scene, state, dt) -> State:
    """Steps 1-8 over dt; the time is set by the caller, the history is carried on."""
    last, a, v, u = state.rates, state.rates.acceleration, state.velocity, state.internal_energy
    position, v_half, v_tilde, a = _into_box(
        scene,
        state.position + v * dt + 0.5 * a * dt**2,  # eq 1
        v + 0.5 * a * dt,  # eq 2
        v + a * dt,  # eq 4
        a,
    )
    u_half = u + 0.5 * last.energy_rate * dt  # eq 3
    u_tilde = u + last.energy_rate * dt  # eq 5
    alpha_half = state.alpha + 0.5 * last.alpha_rate * dt  # eq 33
    alpha_tilde = state.alpha + last.alpha_rate * dt  # eq 6
    before = Before(a, dt)
    now = rates(scene, position, v_tilde, state.mass, u_tilde, last.support, alpha_tilde, before)
    velocity = v_half + 0.5 * now.acceleration * dt  # eq 29
    energy = u_half + 0.5 * now.energy_rate * dt  # eq 30
    # eq 31, or what was found on the way
    alpha = now.alpha if scene.finds_shocks else alpha_half + 0.5 * now.alpha_rate * dt
    return replace(
        state,
        position=position,
        velocity=velocity,
        internal_energy=energy,
        alpha=alpha,
        rates=now,
        dt=time_step(scene, energy, now),
    )


def integrate(scene, state, end, outputs=()) -> State:
    """Steps 1-9 until `end`, landing on each of `outputs` on the way; history by the step."""
    history = list(state.history)
    for stop in sorted({time for time in (*outputs, end) if state.time < time <= end}):
        while state.time < stop:
            lands = state.time + state.dt >= stop
            dt = stop - state.time if lands else state.dt
            time = stop if lands else state.time + dt
            state = replace(_step(scene, state, dt), time=time)
            history.append(_moment(state, dt))
    return replace(state, history=history)
