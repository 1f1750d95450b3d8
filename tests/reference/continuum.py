"""The continuum scheme, written out densely in double precision: the engine's reference.

Every particle meets every particle and every image of it. Nothing is imported from the program:
images and kernels are those of `dense`. Equations "R" are those of the second seed, completed.
Code units throughout; vectors are (D, N), tensors (D, D, N), scalars (N,). L[a, b] is dv_a/dx_b.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import dense
import numpy as np

WORST_CONDITION = 1e6  # of the matrix of order 1, beyond which a particle takes order 0


@dataclass(frozen=True)
class Scene:
    """Parameters of the scheme; `box` (D, 2), one of `boundaries` per axis."""

    box: np.ndarray
    boundaries: tuple[str, ...]  # "periodic", "mirror" or "open"
    kernel: str = "cubic_spline"
    order: int = 0  # of the kernel's correction: -1 none, 0 constants, 1 linear fields
    spacing_ratio: float = 1.2  # d over the spacing (m/rho)^(1/D)
    q_a: float = 2.0
    q_b: float = 1.0
    balsara: bool = True
    tensile: float = 0.0  # epsilon of the tensile correction

    @property
    def dimension(self):
        return len(self.box)

    def lengths(self, mass, density):
        """(N,) d, in place of R8: its solution."""
        return self.spacing_ratio * (mass / density) ** (1 / self.dimension)

    def kernel_at(self, r, support):
        """(W, dW/dr) of a pair of support H_ij = d_i + d_j."""
        w, slope = dense.KERNELS[self.kernel](r / support, self.dimension)
        return w * support**-self.dimension, slope * support ** -(self.dimension + 1.0)


class Matter(NamedTuple):
    """Particles at one time; stress is the whole sigma = S - p I, sound_speed that of solids."""

    position: np.ndarray
    velocity: np.ndarray
    mass: np.ndarray
    density: np.ndarray
    stress: np.ndarray
    sound_speed: np.ndarray
    rest_density: np.ndarray | None = None  # initial density, for the tensile correction


@dataclass
class Rates:
    """What one evaluation gives. `x_scale` is what round-off in x is measured by.

    It is the sum of the absolute values of the terms of x, with the condition number of order 1's
    matrix where B is in them. The scale of a vector or tensor is one number a particle.
    """

    normalisation: np.ndarray  # alpha of order 0
    normalisation_slope: np.ndarray  # its gradient, (D, N)
    correction: np.ndarray  # B of order 1, (D, D, N); NaN where the particle takes order 0
    falls_back: np.ndarray  # (N,) where order 1 was asked for and is not to be had
    velocity_gradient: np.ndarray
    divergence: np.ndarray
    curl: np.ndarray  # its modulus
    density_rate: np.ndarray
    balsara: np.ndarray
    acceleration: np.ndarray
    energy_rate: np.ndarray
    signal_speed: np.ndarray
    normalisation_scale: np.ndarray
    normalisation_slope_scale: np.ndarray
    correction_scale: np.ndarray
    velocity_gradient_scale: np.ndarray
    divergence_scale: np.ndarray
    curl_scale: np.ndarray
    density_rate_scale: np.ndarray
    balsara_scale: np.ndarray
    acceleration_scale: np.ndarray
    energy_rate_scale: np.ndarray
    signal_speed_scale: np.ndarray


class Pairs(NamedTuple):
    """P pairs (i, j) whose kernels overlap, j a particle or its image; i itself is included."""

    near: dense.Pairs
    support: np.ndarray  # (P,) H_ij
    kernel: np.ndarray  # (P,) W
    gradient: np.ndarray  # (D, P) of W by x_i

    @property
    def separation(self):
        """(D, P) x_i - x_j."""
        return self.near.r * self.near.unit

    def sum(self, terms, count):
        """Sums over j of (..., P) terms: (..., count)."""
        flat = terms.reshape(-1, terms.shape[-1])
        sums = [np.bincount(self.near.i, row, count) for row in flat]
        return np.array(sums).reshape(*terms.shape[:-1], count)

    def of_image(self, vector):
        """(D, P) a (D, N) vector of each j: images have its components reflected."""
        return self.near.sign * vector[:, self.near.j]

    def tensor_of_image(self, tensor):
        """(D, D, P) a (D, D, N) tensor of each j: off-diagonals change their sign with one axis."""
        sign = self.near.sign
        return sign[:, None] * sign[None, :] * tensor[:, :, self.near.j]


def pairs_of(scene, position, support):
    """All pairs with r < H_ij = (H_i + H_j)/2."""
    near = dense._pairs(scene, position, support, support)
    mean = 0.5 * (support[near.i] + support[near.j])
    meet = near.r < mean
    near = dense.Pairs(*(array[..., meet] for array in near))
    kernel, slope = scene.kernel_at(near.r, mean[meet])
    return Pairs(near, mean[meet], kernel, slope * near.unit)


class Correction(NamedTuple):
    """The corrected kernel of every particle, and what its parts are summed from."""

    normalisation: np.ndarray
    slope: np.ndarray  # (D, N)
    matrix: np.ndarray  # (D, D, N) B, NaN where order 0 is taken
    falls_back: np.ndarray
    slope_scale: np.ndarray
    matrix_scale: np.ndarray


def correction_of(scene, pairs, volume):
    """alpha = 1/sum V_j W, grad alpha = -alpha^2 sum V_j grad W, B = -[sum V_j grad W x_ij]^-1."""
    n, d = len(volume), scene.dimension
    V_j = volume[pairs.near.j]
    alpha = 1 / pairs.sum(V_j * pairs.kernel, n)
    slope = -(alpha**2) * pairs.sum(V_j * pairs.gradient, n)
    slope_scale = alpha**2 * pairs.sum(V_j * norm(pairs.gradient), n)
    matrix, falls_back = np.full((d, d, n), np.nan), np.full(n, scene.order == 1)
    matrix_scale = np.zeros(n)
    if scene.order == 1:
        M = pairs.sum(V_j * pairs.gradient[:, None] * pairs.separation[None, :], n).transpose(
            2, 0, 1
        )
        largest, smallest = np.linalg.svd(M, compute_uv=False)[:, [0, -1]].T
        falls_back = ~(largest <= WORST_CONDITION * smallest) | (largest == 0)
        good = ~falls_back
        matrix[:, :, good] = -np.linalg.inv(M[good]).transpose(1, 2, 0)
        matrix_scale[good] = largest[good] / smallest[good] ** 2  # condition times |B|
    return Correction(alpha, slope, matrix, falls_back, slope_scale, matrix_scale)


def norm(field):
    """(P,) modulus of vectors (D, P) or of tensors (D, D, P)."""
    return np.sqrt((field**2).reshape(-1, field.shape[-1]).sum(axis=0))


def apply(tensor, vector):
    """(D, P) tensor . vector."""
    return np.einsum("abp,bp->ap", tensor, vector)


class Gradients(NamedTuple):
    """Corrected gradients of each pair, (D, P), and what round-off in them is measured by, (P,)."""

    own: np.ndarray  # grad W_j(i), at x_i with the correction of i
    other: np.ndarray  # grad W_i(j), at x_j with the correction of j
    own_scale: np.ndarray
    other_scale: np.ndarray


def gradients_of(scene, pairs, by):
    """The gradients of all pairs. Without correction the gradient at x_j is minus that at x_i."""
    i, j = pairs.near.i, pairs.near.j
    own, own_scale = _one_side(
        scene, pairs, by, i, pairs.gradient, by.slope[:, i], by.matrix[:, :, i]
    )
    other, other_scale = _one_side(
        scene, pairs, by, j, -pairs.gradient, pairs.of_image(by.slope),
        pairs.tensor_of_image(by.matrix),
    )  # fmt: skip
    return Gradients(own, other, own_scale, other_scale)


def _one_side(scene, pairs, by, k, gradient, slope, matrix):
    plain = norm(gradient)
    if scene.order == -1:
        return gradient, plain
    constant = by.normalisation[k] * gradient + pairs.kernel * slope
    constant_scale = by.normalisation[k] * plain + pairs.kernel * by.slope_scale[k]
    if scene.order == 0:
        return constant, constant_scale
    falls_back = by.falls_back[k]
    return (
        np.where(falls_back, constant, apply(matrix, gradient)),
        np.where(falls_back, constant_scale, by.matrix_scale[k] * plain),
    )


def flow(scene, pairs, slopes, matter, volume, lengths):
    """L, its trace and curl, d rho/dt and the switch f: R3-R5."""
    n, d = len(volume), scene.dimension
    V_j, v_ij = volume[pairs.near.j], pairs.near.difference(matter.velocity)
    L = -pairs.sum(V_j * v_ij[:, None] * slopes.own[None, :], n)
    scale = pairs.sum(V_j * norm(v_ij) * slopes.own_scale, n)
    divergence = np.trace(L)
    curl = curl_of(L)
    curl_scale = 2 * scale * (d > 1)
    divergence_scale = d * scale
    sum_ = abs(divergence) + curl + 1e-4 * matter.sound_speed / lengths
    return {
        "velocity_gradient": L,
        "divergence": divergence,
        "curl": curl,
        "density_rate": -matter.density * divergence,
        "balsara": switch(scene, L, matter.sound_speed, lengths),
        "velocity_gradient_scale": scale,
        "divergence_scale": divergence_scale,
        "curl_scale": curl_scale,
        "density_rate_scale": matter.density * divergence_scale,
        "balsara_scale": 1 + (divergence_scale + curl_scale) / sum_ * scene.balsara,
    }


def curl_of(velocity_gradient):
    """(N,) the modulus of the curl."""
    return np.sqrt(2) * norm(spin(velocity_gradient))


def switch(scene, L, sound_speed, lengths):
    """(N,) f of eq 410."""
    if not scene.balsara:
        return np.ones_like(lengths)
    compression = abs(np.trace(L))
    return compression / (compression + curl_of(L) + 1e-4 * sound_speed / lengths)


def strain_rate(velocity_gradient):
    """(D, D, N) the symmetric part of L (R5)."""
    return 0.5 * (velocity_gradient + velocity_gradient.transpose(1, 0, 2))


def spin(velocity_gradient):
    """(D, D, N) the antisymmetric part of L (R5)."""
    return 0.5 * (velocity_gradient - velocity_gradient.transpose(1, 0, 2))


def deviatoric_rate(velocity_gradient, shear_modulus):
    """(D, D, N) 2 G (strain rate - its trace I/3): dS/dt of a particle that does not turn.

    The 3 holds for plane strain in 2-D and uniaxial strain in 1-D too.
    """
    rate, d = strain_rate(velocity_gradient), len(velocity_gradient)
    return 2 * shear_modulus * (rate - np.trace(rate) / 3 * np.eye(d)[:, :, None])


def equivalent_rate(velocity_gradient):
    """(N,) (2/3 e : e)^(1/2), e the deviator of the strain rate in three dimensions."""
    rate, d = strain_rate(velocity_gradient), len(velocity_gradient)
    mean = np.trace(rate) / 3
    e = rate - mean * np.eye(d)[:, :, None]
    return np.sqrt(2 / 3 * ((e**2).sum(axis=(0, 1)) + (3 - d) * mean**2))


def approach_speed(pairs, matter):
    """(P,) mu_ij without the switch: negative where particles approach, else zero."""
    h_ij = 0.5 * pairs.support  # (d_i + d_j)/2
    v_ij, x_ij = pairs.near.difference(matter.velocity), pairs.separation
    mu = h_ij * (v_ij * x_ij).sum(axis=0) / (pairs.near.r**2 + 0.01 * h_ij**2)
    return np.minimum(mu, 0.0)


def viscosity(scene, pairs, matter, mu, switch):
    """(P,) pi_ij for mu with the mean switch f of the pair in it."""
    i, j = pairs.near.i, pairs.near.j
    mu = mu * 0.5 * (switch[i] + switch[j])
    c, rho = (0.5 * (x[i] + x[j]) for x in (matter.sound_speed, matter.density))
    return (-scene.q_b * c * mu + scene.q_a * mu**2) / rho


def tensile_stress(scene, stress):
    """(D, D, N) R: principal stresses -epsilon max(0, sigma) along the axes of sigma."""
    principal, axes = np.linalg.eigh(stress.transpose(2, 0, 1))
    pulled = -scene.tensile * np.maximum(principal, 0.0)
    return np.einsum("nak,nk,nbk->abn", axes, pulled, axes)


def tensile_weight(scene, pairs, matter):
    """(P,) F = (W d_0^D / w(spacing/d_0))^4, d_0 the mean of the initial d of the pair."""
    initial = scene.lengths(matter.mass, matter.rest_density)
    d_0 = 0.5 * (initial[pairs.near.i] + initial[pairs.near.j])
    at_spacing = scene.kernel_at(d_0 / scene.spacing_ratio, 2 * d_0)[0]
    return (pairs.kernel / at_spacing) ** 4


def forces(scene, pairs, slopes, matter, volume, state):
    """Acceleration and energy rate, R6 with full stresses, and twice the speed of the step."""
    n, i, j = len(volume), pairs.near.i, pairs.near.j
    v_ij = pairs.near.difference(matter.velocity)
    own, other = matter.stress[:, :, i], pairs.tensor_of_image(matter.stress)
    own_size, other_size = norm(own), norm(other)
    if scene.tensile > 0:
        R = tensile_stress(scene, matter.stress)
        F = tensile_weight(scene, pairs, matter)
        own, other = own + F * R[:, :, i], other + F * pairs.tensor_of_image(R)
        own_size = (1 + scene.tensile * F) * own_size
        other_size = (1 + scene.tensile * F) * other_size
    V_iV_j, m_im_j = volume[i] * volume[j], matter.mass[i] * matter.mass[j]
    own_force = V_iV_j * apply(own, slopes.own)
    other_force = V_iV_j * apply(other, slopes.other)
    own_bound = V_iV_j * own_size * slopes.own_scale
    other_bound = V_iV_j * other_size * slopes.other_scale

    mu = approach_speed(pairs, matter)
    mean_slope = 0.5 * (slopes.own - slopes.other)
    viscous = m_im_j * viscosity(scene, pairs, matter, mu, state["balsara"]) * mean_slope
    mean_bound = 0.5 * (slopes.own_scale + slopes.other_scale)
    viscous_bound = (
        m_im_j * viscosity(scene, pairs, matter, mu, state["balsara_scale"]) * mean_bound
    )

    work = -(own_force * v_ij).sum(axis=0) + 0.5 * (viscous * v_ij).sum(axis=0)
    work_bound = (own_bound + 0.5 * viscous_bound) * norm(v_ij)
    fastest = np.zeros(n)
    np.maximum.at(fastest, i, -mu)
    Q = scene.q_b * matter.sound_speed + scene.q_a * fastest
    signal_speed = 2 * (Q + np.sqrt(Q**2 + matter.sound_speed**2))
    return {
        "acceleration": pairs.sum(own_force - other_force - viscous, n) / matter.mass,
        "energy_rate": pairs.sum(work, n) / matter.mass,
        "signal_speed": signal_speed,
        "acceleration_scale": pairs.sum(own_bound + other_bound + viscous_bound, n) / matter.mass,
        "energy_rate_scale": pairs.sum(work_bound, n) / matter.mass,
        "signal_speed_scale": signal_speed,
    }


def velocity_gradient(scene: Scene, matter: Matter) -> np.ndarray:
    """(D, D, N) L, which needs no stress."""
    volume = matter.mass / matter.density
    lengths = scene.lengths(matter.mass, matter.density)
    pairs = pairs_of(scene, matter.position, 2 * lengths)
    slopes = gradients_of(scene, pairs, correction_of(scene, pairs, volume))
    return flow(scene, pairs, slopes, matter, volume, lengths)["velocity_gradient"]


def rates(scene: Scene, matter: Matter, factor: np.ndarray | None = None) -> Rates:
    """Every rate of the scheme at the state of the particles; `factor` (N,) in place of f."""
    volume = matter.mass / matter.density
    lengths = scene.lengths(matter.mass, matter.density)
    pairs = pairs_of(scene, matter.position, 2 * lengths)
    by = correction_of(scene, pairs, volume)
    slopes = gradients_of(scene, pairs, by)
    state = flow(scene, pairs, slopes, matter, volume, lengths)
    if factor is not None:
        state["balsara"] = factor
    state |= forces(scene, pairs, slopes, matter, volume, state)
    return Rates(
        normalisation=by.normalisation,
        normalisation_slope=by.slope,
        correction=by.matrix,
        falls_back=by.falls_back,
        normalisation_scale=by.normalisation,
        normalisation_slope_scale=by.slope_scale,
        correction_scale=by.matrix_scale,
        **state,
    )


def time_step(scene: Scene, matter: Matter, now: Rates) -> float:
    """0.6 d/(Q + sqrt(Q^2 + c^2)), the smallest of all particles: C = 0.3."""
    return (1.2 * scene.lengths(matter.mass, matter.density) / now.signal_speed).min()


# --- the step ---


class Law(NamedTuple):
    """What the materials of all particles make of density, energy and a trial deviator."""

    pressure: np.ndarray
    sound_speed: np.ndarray
    shear_modulus: np.ndarray
    deviator: np.ndarray  # (D, D, N), on the yield surface or within it
    plastic_strain: np.ndarray  # its increment by the return


@dataclass
class Body:
    """Corrected values at one time, and the rates of the last evaluation.

    `law(density, energy, deviator, rate, plastic_strain)`, with the equivalent rate of strain,
    returns a Law.
    """

    scene: Scene
    law: Callable[..., Law]
    position: np.ndarray
    velocity: np.ndarray
    mass: np.ndarray
    density: np.ndarray
    energy: np.ndarray
    deviator: np.ndarray
    plastic_strain: np.ndarray
    rest_density: np.ndarray
    rates: Rates | None = None
    shear_modulus: np.ndarray | None = None
    density_rate: np.ndarray | None = None  # the mean over the last step

    def evaluate(self, velocity, volume_density, density, energy, deviator, L):
        """Rates at the present position and the predicted values.

        Volumes and supports are those of `volume_density`, pressure that of `density`. L is the
        velocity gradient in the middle of the step.
        """
        now = self.law(density, energy, deviator, equivalent_rate(L), self.plastic_strain)
        stress = now.deviator - now.pressure * np.eye(len(velocity))[:, :, None]
        matter = Matter(self.position, velocity, self.mass, volume_density, stress,
                        now.sound_speed, self.rest_density)  # fmt: skip
        lengths = self.scene.lengths(self.mass, volume_density)
        self.rates = rates(self.scene, matter, switch(self.scene, L, now.sound_speed, lengths))
        self.shear_modulus = now.shear_modulus
        return now

    def gradient(self, velocity, density):
        """L at the present position, with volumes of `density`."""
        at_rest = np.zeros_like(self.deviator), np.ones_like(density)
        return velocity_gradient(
            self.scene, Matter(self.position, velocity, self.mass, density, *at_rest)
        )

    def start(self):
        """The rates at t = 0, after the stress has returned to the yield surface."""
        L = self.gradient(self.velocity, self.density)
        now = self.evaluate(
            self.velocity, self.density, self.density, self.energy, self.deviator, L
        )
        self.deviator = now.deviator
        self.plastic_strain = self.plastic_strain + now.plastic_strain
        self.density_rate = -self.density * np.trace(L)

    def advance(self, dt):
        """One step: positions, the middle of the step, forces at its end (eqs 1-6 and 29-31).

        Density and stress change by the velocity gradient in the middle of the step.
        """
        half, old = 0.5 * dt, self.rates
        self.position = self.position + self.velocity * dt + 0.5 * old.acceleration * dt**2
        middle = self.velocity + old.acceleration * half
        volume_density = self.density + self.density_rate * dt
        L = centred(self.gradient(middle, volume_density), dt)
        grown = self.density * np.exp(-np.trace(L) * dt)
        self.density_rate = (grown - self.density) / dt
        self.density = grown
        change = half * deviatoric_rate(L, self.shear_modulus)
        trial = turned(self.deviator + change, L, dt) + change
        energy = self.energy + old.energy_rate * dt
        predicted = self.velocity + old.acceleration * dt
        now = self.evaluate(predicted, volume_density, grown, energy, trial, L)
        self.deviator = now.deviator
        self.plastic_strain = self.plastic_strain + now.plastic_strain
        self.velocity = middle + self.rates.acceleration * half
        self.energy = self.energy + (old.energy_rate + self.rates.energy_rate) * half


def centred(L, dt):
    """(D, D, N) the velocity gradient with respect to positions half a step before.

    Positions then are x - v dt/2, so the deformation since is (I - L dt/2)^-1.
    """
    back = np.eye(len(L)) - 0.5 * dt * L.transpose(2, 0, 1)
    return (L.transpose(2, 0, 1) @ np.linalg.inv(back)).transpose(1, 2, 0)


def turned(tensor, velocity_gradient, dt):
    """(D, D, N) the tensor turned by a step: (I - A)^-1 (I + A), A = W dt/2 (Hughes & Winget)."""
    A = 0.5 * dt * spin(velocity_gradient).transpose(2, 0, 1)
    unit = np.eye(len(tensor))
    turn = np.linalg.solve(unit - A, unit + A)
    return np.einsum("nac,cdn,nbd->abn", turn, tensor, turn)
