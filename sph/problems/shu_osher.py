"""A Mach 3 shock that runs into sine waves of density, and amplifies them.

Shu & Osher (1989), J. Comput. Phys. 83, 32, problem 8. There is no exact solution: errors are
computed against a Lagrangian finite-volume solution. The sensitive feature is the train of short
waves behind the shock, which artificial viscosity damps.

The published domain is [-5, 5], with inflow on the left. Here the box is periodic and extends
farther to the left, by the distance that the rarefaction from the left end travels.
"""

from functools import lru_cache
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from sph import quantity as units
from sph.eos import is_gamma_law
from sph.exact import finite_volume
from sph.problems import base
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

# State behind the shock, with the published digits: Mach 3 into density 1 and pressure 1
DENSITY, VELOCITY, PRESSURE = 3.857143, 2.629369, 10.33333
AHEAD_PRESSURE = 1.0
DIAPHRAGM = -4.0
WAVE, WAVENUMBER = 0.2, 5.0
LEAST_DENSITY = 1.0 - WAVE  # ahead of the shock, where the sound speed is largest
# Distances behind the shock of the train of short waves: 0.5 < x < 2.3 at the published time of 1.8
TRAIN = (0.1, 1.9)
CELLS = 6000  # of the reference


class Problem(base.Problem):
    """A Mach 3 shock that runs into gas at rest with a sine wave in density."""

    defaults: ClassVar = {
        "physics.gamma": 1.4,
        "physics.alpha": 1.0,
        "time.end": 1.8,
        "output.interval": 0.3,
    }
    truth: ClassVar = finite_volume.TRUTH
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-4, "a shock of moderate strength, as in the shock tubes, which have 1e-5"
        )
    }
    quantities: ClassVar = {
        "shock_position": Quantity("largest x of a particle denser than 2", units.LENGTH),
        "wave_density": Quantity(
            "root mean square of the density about its mean, from 1.9 to 0.1 behind the shock, "
            "volume-weighted",
            units.DENSITY,
        ),
        "peak_density": Quantity("largest density from 1.9 to 0.1 behind the shock", units.DENSITY),
    }
    title: ClassVar = "Shu-Osher tube"

    name: Literal["shu_osher"] = "shu_osher"
    dimension: Literal[1] = Field(default=1, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 1600
    domain: list[float] | list[list[float]] = Field(
        default=[-12.5, 5.5],
        description="ends of the box [lo, hi]; waves from the ends move inward, from lo at speed "
        "4.57, and exclude gas from the errors",
    )
    boundary: Literal["periodic", "open"] = Field(
        default="periodic",
        description='"periodic", or "open": the gas at the ends expands into vacuum',
    )

    @model_validator(mode="after")
    def _holds_the_diaphragm(self):
        if self.box.shape == (1, 2) and not self.box[0, 0] < DIAPHRAGM < self.box[0, 1]:
            raise ValueError(
                f"domain = {self.domain}: expected x = {DIAPHRAGM} inside, where the shock starts"
            )
        return self

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass, each at the middle of its mass element."""
        low, high = self.box[0]
        behind, ahead = DENSITY * (DIAPHRAGM - low), _mass_ahead(high)
        n_behind = max(1, round(self.n * behind / (behind + ahead)))
        mass = behind / n_behind
        n_ahead = max(1, round(ahead / mass))
        x_behind = DIAPHRAGM - (np.arange(n_behind)[::-1] + 0.5) * mass / DENSITY
        x_ahead = _inverse_mass((np.arange(n_ahead) + 0.5) * ahead / n_ahead)
        position = np.concatenate([x_behind, x_ahead])[None]
        density, velocity, pressure = _undisturbed(position[0])
        return base.InitialState(
            position,
            velocity[None],
            np.concatenate([np.full(n_behind, mass), np.full(n_ahead, ahead / n_ahead)]),
            eos.internal_energy(density, pressure),
        )

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """Return the reference without ends at (D, N) positions; None without a gamma law."""
        if not is_gamma_law(eos):
            return None
        if time > 0.0:
            cells = _reference(eos, time, float(self.box[0, 1]))
            density, speed, pressure = cells.at(position[0])
        else:
            density, speed, pressure = _undisturbed(position[0])
        return {
            "density": density,
            "velocity": speed[None],
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }

    def exact_ends(self, eos) -> tuple[float, str]:
        """Return when a wave of the flow meets a wave from an end, both as in `error_region`.

        The shock speed is that of Mach 3 into density 1, close to the mean over the sine wave.
        Left-going sound waves behind the shock are slower than the gas, so they move right.
        """
        (low, high), sound = self.box[0], float(eos.sound_speed(DENSITY, PRESSURE))
        at_low = (DIAPHRAGM - low) / (2.0 * sound)
        shock = 3.0 * float(eos.sound_speed(1.0, AHEAD_PRESSURE))
        ahead = float(eos.sound_speed(LEAST_DENSITY, AHEAD_PRESSURE))
        at_high = (high - DIAPHRAGM) / (shock + ahead)
        end = low if at_low < at_high else high
        return min(at_low, at_high), f"waves from the end at x = {end:g} meet those of the flow"

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """Return the region that waves from the ends of the box have not reached."""
        low, high = self.box[0]
        low += (VELOCITY + eos.sound_speed(DENSITY, PRESSURE)) * time
        high -= eos.sound_speed(LEAST_DENSITY, AHEAD_PRESSURE) * time
        x = position[0]
        return (low < x) & (x < high), f"{low:.4g} < x < {high:.4g}"

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return the strength of the short waves behind the shock.

        shock_position: largest x of a particle denser than 2, a density that occurs only behind the
        shock; wave_density: volume-weighted root mean square of the density about its mean, from
        1.9 to 0.1 behind the shock; peak_density: largest density there. The last two converge to
        0.449 and 4.69 at t = 1.8 (6400 particles). A second-order finite-volume code with 16000
        cells gives 0.448 and 4.68, because its limiter clips extrema.
        """
        inside, _ = self.error_region(eos, time, particles.position)
        x, density = particles.position[0, inside], particles.density[inside]
        volume = particles.mass[inside] / density
        if not (density > 2.0).any():
            return {}
        shock = float(x[density > 2.0].max())
        train = (shock - TRAIN[1] < x) & (x < shock - TRAIN[0])
        figures = {"shock_position": shock}
        if train.any():
            mean = np.average(density[train], weights=volume[train])
            variance = np.average((density[train] - mean) ** 2, weights=volume[train])
            figures["wave_density"] = float(np.sqrt(variance))
            figures["peak_density"] = float(density[train].max())
        return figures


def _undisturbed(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return density, velocity and pressure (N,) at t = 0."""
    behind = x < DIAPHRAGM
    return (
        np.where(behind, DENSITY, 1.0 + WAVE * np.sin(WAVENUMBER * x)),
        np.where(behind, VELOCITY, 0.0),
        np.where(behind, PRESSURE, AHEAD_PRESSURE),
    )


def _mass_ahead(x):
    """Return the mass between the diaphragm and x at t = 0."""
    wave = np.cos(WAVENUMBER * x) - np.cos(WAVENUMBER * DIAPHRAGM)
    return x - DIAPHRAGM - WAVE / WAVENUMBER * wave


def _inverse_mass(mass: np.ndarray) -> np.ndarray:
    """Return x (N,) such that `_mass_ahead(x)` is `mass` (N,), by Newton's iteration."""
    x = DIAPHRAGM + mass
    for _ in range(20):  # 6 suffice, since the density is within 20 % of 1
        step = (_mass_ahead(x) - mass) / _undisturbed(x)[0]
        x -= step
        if np.all(np.abs(step) <= 1e-15 * (1.0 + np.abs(x))):
            break
    return x


@lru_cache(maxsize=16)
def _reference(eos, time: float, end: float) -> finite_volume.Cells:
    """Return the reference: cells of nearly equal mass, from beyond the reach of sound to `end`."""
    start = DIAPHRAGM - 1.1 * float(eos.sound_speed(DENSITY, PRESSURE)) * time
    behind, ahead = DENSITY * (DIAPHRAGM - start), float(_mass_ahead(end))
    n_behind = round(CELLS * behind / (behind + ahead))
    faces = np.concatenate(
        [
            np.linspace(start, DIAPHRAGM, n_behind, endpoint=False),
            _inverse_mass(np.linspace(0.0, ahead, CELLS - n_behind + 1)),
        ]
    )
    _, velocity, pressure = _undisturbed(0.5 * (faces[1:] + faces[:-1]))
    mass = np.diff(np.where(faces < DIAPHRAGM, DENSITY * (faces - DIAPHRAGM), _mass_ahead(faces)))
    cells = finite_volume.Cells(faces, mass / np.diff(faces), velocity, pressure)
    return finite_volume.evolve(cells, eos, time, walls=(False, False))
