"""Kelvin-Helmholtz instability of a smooth shear layer, which converges with resolution.

McNally, Lyra & Passy (2012), ApJS 201, 18: section 2 for the initial state, section 4 for the
mode's amplitude.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field

from sph.lattice import fill
from sph.problems import base

_SHARED = base.Problem.model_fields

DENSITY = (1.0, 2.0)  # outside, inside
SPEED = (0.5, -0.5)  # along x
RAMP = 0.025  # the length over which one becomes the other
PRESSURE = 2.5
WAVELENGTH = 0.5
PERTURBATION = 0.01  # amplitude of the velocity along y


def only(domain: list[float]) -> AfterValidator:
    """Annotates the domain of a problem that is set up for no other."""

    def check(given):
        if given not in (domain, [domain, domain]):
            raise ValueError(f"this problem is set up for {domain} along both axes only")
        return given

    return AfterValidator(check)


class Problem(base.Problem):
    """Two streams of densities 1 and 2 with smooth ramps between them."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 1.5,
        "output.interval": 0.25,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-3, "a smooth flow, whose energy the scheme conserves to the order of the time step"
        )
    }

    name: Literal["kelvin_helmholtz_smooth"] = "kelvin_helmholtz_smooth"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 16384
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"], only([0.0, 1.0])] = Field(
        default=[0.0, 1.0]
    )
    boundary: Literal["periodic"] = Field(default="periodic", description="of both axes")

    def initial(self, eos) -> base.InitialState:
        """A cubic lattice with masses by the density."""
        position = fill(self.box, self.n, "cubic")
        x, y = position
        density = _ramped(*DENSITY, y)
        velocity = np.stack([_ramped(*SPEED, y), PERTURBATION * np.sin(2 * np.pi * x / WAVELENGTH)])
        mass = density / y.size  # the box has volume 1
        return base.InitialState(
            position, velocity, mass, eos.internal_energy(density, np.full(y.size, PRESSURE))
        )

    def diagnostics(self, particles) -> dict[str, float]:
        x, y = particles.position
        upward = particles.velocity[1]
        return {"mode_amplitude": mode_amplitude(particles, x, y - 0.5, upward, WAVELENGTH)}

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        return self.diagnostics(particles)


def mode_amplitude(particles, x, height, velocity, wavelength: float) -> float:
    """Amplitude of the mode of that wavelength along x in `velocity` (N,) (eqs 10-13).

    `height` (N,) is y above the middle of the slab, whose faces are at heights of +-1/4. Particles
    weigh by their volume and by their distance from the nearer face, as a surface mode decays.
    """
    wavenumber = 2.0 * np.pi / wavelength
    distance = np.abs(np.abs(height) - 0.25)
    weight = particles.mass / particles.density * np.exp(-wavenumber * distance)
    sine = (weight * velocity * np.sin(wavenumber * x)).sum()
    cosine = (weight * velocity * np.cos(wavenumber * x)).sum()
    return float(2.0 * np.hypot(sine, cosine) / weight.sum())


def _ramped(outside: float, inside: float, y: np.ndarray) -> np.ndarray:
    """From `outside` to `inside` across y = 1/4 and back across 3/4."""
    depth = 0.25 - np.abs(y - 0.5)  # into the slab
    share = 0.5 * np.exp(-np.abs(depth) / RAMP)  # of the other stream
    return np.where(
        depth < 0.0,
        outside + (inside - outside) * share,
        inside + (outside - inside) * share,
    )
