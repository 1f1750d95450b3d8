"""Travelling sound wave: one wavelength in a periodic box, along x, in 1 to 3-D.

The wave is a simple wave (Landau & Lifshitz, Fluid Mechanics, paragraph 101): the Riemann invariant
of the waves that go left is uniform, so that velocity v and sound speed c at t = 0 obey
c = c0 + (gamma - 1) v / 2, and each value travels at v + c for ever. That is exact at any
amplitude until the crests overtake the troughs, so the linear and the weakly nonlinear wave have
one exact solution. Units are such that the undisturbed gas has density 1 and sound speed 1: the
wave crosses a box of length 1 once in a time of 1.

How wrong a wave of amplitude 1e-6 is cannot be read off the norms of density and pressure: the
density sum over a lattice is high by 0.25 % (1-D, Wendland C2, eta = 1.6) everywhere, two thousand
times the wave. The report therefore gives errors of the wave alone, in units of its amplitude:
velocity, whose undisturbed value is exactly zero, density relative to its own mean, and, from the
wave's Fourier component, the errors of its amplitude and of the speed at which it travelled.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from sph.problems import base
from sph.problems.support import lattice as placement

_SHARED = base.Problem.model_fields

SAMPLES = 64  # of a wavelength; harmonics fall as amplitude^k, so 32 of them reach round-off


class Problem(base.Problem):
    """Sound wave of small amplitude that travels along x in a periodic box."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 1.0,
        "output.interval": 0.25,
    }
    ideal_gas: ClassVar = True
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-12, "the wave is 1e-12 of the whole energy: round-off of some hundred steps"
        ),
        "error_velocity_relative": base.Limit(
            0.004, "0.0030 with 128 particles, of second order: its waves run 0.08 % too fast"
        ),
    }

    swamped: ClassVar = {
        "error_velocity_relative": base.Limit(0.5, "half of the wave's own amplitude"),
    }

    name: Literal["sound_wave"] = "sound_wave"
    dimension: Annotated[int, _SHARED["dimension"]] = 1
    n: Annotated[int, _SHARED["n"]] = 128
    domain: list[float] | list[list[float]] = Field(
        default=[0.0, 1.0],
        description="[lo, hi] along x, one wavelength (y and z are an eighth as wide), or one "
        "[lo, hi] per axis",
    )
    boundary: Literal["periodic"] = Field(default="periodic", description="of all axes")
    amplitude: float = Field(
        default=1e-6,
        ge=1e-8,  # below, the 1e-10 to which supports are converged shows
        le=0.1,  # above, the wave breaks before it has crossed the box
        description="largest velocity in units of the sound speed",
    )
    lattice: Literal["cubic", "hexagonal", "bcc", "relaxed"] = Field(
        default="cubic",
        description='"cubic", "hexagonal" (2-D), "bcc" (3-D) or "relaxed", a glass, whose noise '
        "hides waves below some 1e-2; in 2-D lattices of the default kernel come apart above some "
        '10,000 particles: take "hexagonal" with wendland_c4 at physics.eta = 2.2',
    )

    @field_validator("lattice")
    @classmethod
    def _exists(cls, kind, known):
        return placement.checked(kind, known.data.get("dimension"))

    @property
    def box(self) -> np.ndarray:
        domain = np.array(self.domain, dtype=float)
        if domain.ndim == 2:
            return domain
        sixteenth = (domain[1] - domain[0]) / 16
        return np.array([domain] + [[-sixteenth, sixteenth]] * (self.dimension - 1))

    def allowed(self) -> dict[str, base.Limit]:
        """A wave has amplitude^2 of the energy; in 2-D and 3-D its error has a floor of 1.6 %."""
        drift = self.limits["energy_drift"]
        drift = drift._replace(bound=max(drift.bound, self.amplitude**2))
        error = self.limits["error_velocity_relative"]
        if self.dimension > 1:
            reason = "lattices at the default eta make waves up to 0.4 % too fast or too slow"
            error = base.Limit(0.03, reason)
        return {"energy_drift": drift, "error_velocity_relative": error}

    def initial(self, eos) -> base.InitialState:
        """Particles of one mass, on a lattice stretched along x to the density of the wave."""
        position = placement.fill(self.box, self.n, self.lattice)
        low, high = self.box[0]
        share = (position[0] - low) / (high - low)  # of the mass, left of a particle
        position[0] = low + (high - low) * _inverse_mass(self._harmonics(eos), share)
        state = self.exact(eos, 0.0, position) or {}
        n = position.shape[1]
        volume = np.prod(self.box[:, 1] - self.box[:, 0])
        mass = np.full(n, self._harmonics(eos)[0].real * volume / n)
        return base.InitialState(position, state["velocity"], mass, state["internal_energy"])

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """The simple wave at (D, N) positions; None from the time on at which it breaks."""
        low, high = self.box[0]
        steepening = self._steepening(eos, time)
        if 2.0 * np.pi * steepening >= 1.0:
            return None
        phase = (position[0] - low - time) / (high - low)
        speed = self.amplitude * np.sin(2.0 * np.pi * _phase_at_start(phase, steepening))
        velocity = np.zeros_like(position)
        velocity[0] = speed
        density = _density(speed, eos.gamma)
        pressure = density**eos.gamma / eos.gamma
        return {
            "density": density,
            "velocity": velocity,
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }

    def exact_ends(self, eos) -> tuple[float, str]:
        return 1.0 / (2.0 * np.pi * self._steepening(eos, 1.0)), "the wave breaks"

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Errors of the wave alone, relative to its amplitude (see the head of this file).

        error_velocity_relative, error_density_relative: volume-weighted L1, density over its mean;
        wave_amplitude_error, phase_speed_error: of the velocity's Fourier component over that of
        the exact velocity at the same particles, minus 1; the phase speed is that since t = 0.
        """
        exact = self.exact(eos, time, particles.position)
        if exact is None:
            return {}
        volume = particles.mass / particles.density
        mean = particles.mass.sum() / volume.sum()
        density = particles.density / mean - exact["density"] / self._harmonics(eos)[0].real
        velocity = np.sqrt(((particles.velocity - exact["velocity"]) ** 2).sum(axis=0))
        scale = volume.sum() * self.amplitude
        figures = {
            "error_velocity_relative": float((volume * velocity).sum() / scale),
            "error_density_relative": float((volume * np.abs(density)).sum() / scale),
        }
        low, high = self.box[0]
        wavenumber = 2.0 * np.pi / (high - low)
        wave = volume * np.exp(-1j * wavenumber * particles.position[0])
        ratio = (wave @ particles.velocity[0]) / (wave @ exact["velocity"][0])
        figures["wave_amplitude_error"] = float(np.abs(ratio)) - 1.0
        if time > 0.0:
            figures["phase_speed_error"] = float(-np.angle(ratio) / (wavenumber * time))
        return figures

    def _steepening(self, eos, time: float) -> float:
        """(v + c - 1) t in wavelengths is this times sin(2 pi phase at t = 0)."""
        low, high = self.box[0]
        return 0.5 * (eos.gamma + 1.0) * self.amplitude * time / (high - low)

    def _harmonics(self, eos) -> np.ndarray:
        """Fourier coefficients of the density at t = 0; the first is its mean."""
        phase = np.arange(SAMPLES) / SAMPLES
        speed = self.amplitude * np.sin(2.0 * np.pi * phase)
        return np.fft.rfft(_density(speed, eos.gamma))[: SAMPLES // 2] / SAMPLES


def _density(speed: np.ndarray, gamma: float) -> np.ndarray:
    """Density (N,) where the simple wave has that velocity: adiabatic, by the sound speed."""
    return (1.0 + 0.5 * (gamma - 1.0) * speed) ** (2.0 / (gamma - 1.0))


def _inverse_mass(harmonics: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Phase (N,), in wavelengths, left of which `share` (N,) of a wavelength's mass lies."""
    relative = harmonics / harmonics[0]
    order = np.flatnonzero(np.abs(relative) > 1e-17)[1:]
    wave = 2j * np.pi * order
    phase = share.copy()
    # Newton's iteration: the slope, the density over its mean, is within 11 % of 1
    for _ in range(8):
        mass, slope = phase.copy(), np.ones_like(phase)
        for k, coefficient in zip(wave, 2.0 * relative[order], strict=True):
            turn = np.exp(k * phase)
            mass += (coefficient * (turn - 1.0) / k).real
            slope += (coefficient * turn).real
        phase -= (mass - share) / slope
    return phase


def _phase_at_start(phase: np.ndarray, steepening: float) -> np.ndarray:
    """Solve start + steepening sin(2 pi start) = phase, which is Kepler's equation: Newton.

    The root is within `steepening` of phase; steps that leave that range are cut to it.
    """
    start = phase.copy()
    for _ in range(50):  # a guard: 5 are enough unless the wave is about to break
        angle = 2.0 * np.pi * start
        excess = start + steepening * np.sin(angle) - phase
        slope = 1.0 + 2.0 * np.pi * steepening * np.cos(angle)
        following = np.clip(start - excess / slope, phase - steepening, phase + steepening)
        if np.all(np.abs(following - start) <= 1e-16 * (1.0 + np.abs(phase))):
            break
        start = following
    return start
