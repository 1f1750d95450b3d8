"""Kelvin-Helmholtz instability of a smooth shear layer.

McNally, Lyra & Passy (2012), ApJS 201, 18: section 2 for the initial state, section 4 for the
amplitude of the mode. Its growth is compared with linear theory for this initial state, measured by
this amplitude. The initial velocity is not an eigenmode, so the amplitude first falls.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from sph import quantity as units
from sph.exact import kelvin_helmholtz as linear
from sph.problems import _relax, base
from sph.problems.base import only
from sph.problems.support.lattice import fill
from sph.problems.support.shear_mode import mode_amplitude, surface_weight
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields

DENSITY = (1.0, 2.0)  # outside, inside
SPEED = (0.5, -0.5)  # along x
RAMP = 0.025  # length of the transition between both
PRESSURE = 2.5
WAVELENGTH = 0.5
PERTURBATION = 0.01  # amplitude of the velocity along y
# Interval of time in which growth is measured: decaying modes have vanished, and displacements are
# still below the width of the ramp.
GROWTH = (0.5, 1.0)
POINTS = 128  # of linear theory along y; its growth rate is then accurate to 0.1 %


class Problem(_relax.Relaxable):
    """Two streams of densities 1 and 2 with a smooth transition: growth rate against theory."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 1.5,
        "output.interval": 0.25,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-3, "a smooth flow, with the energy error of the time step only"
        ),
        "growth_ratio": base.Limit(
            0.6, "measured: 0.71 with 64 x 64 particles, default kernel and eta", at_least=True
        ),
    }
    swamped: ClassVar = {
        "growth_ratio": base.Limit(0.25, "a quarter of the linear growth rate", at_least=True)
    }
    quantities: ClassVar = {
        "mode_amplitude": Quantity("amplitude of the mode in the velocity along y", units.VELOCITY),
        "growth_rate": Quantity(
            "growth rate of mode_amplitude from t = 0.5 to 1, by least squares", units.RATE
        ),
        "linear_growth_rate": Quantity(
            "growth rate of linear theory over the same times", units.RATE
        ),
        "growth_ratio": Quantity("growth_rate over linear_growth_rate"),
        "growth_error": Quantity("|growth_ratio - 1|, the relative error of the growth rate"),
    }
    title: ClassVar = "Kelvin-Helmholtz instability, smooth layer"

    name: Literal["kelvin_helmholtz_smooth"] = "kelvin_helmholtz_smooth"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 16384
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"], only([0.0, 1.0])] = Field(
        default=[0.0, 1.0]
    )
    boundary: Literal["periodic"] = Field(default="periodic", description="boundary of both axes")

    def initial(self, eos) -> base.InitialState:
        """Return a cubic lattice, or a glass, whose masses follow the density."""
        position, relaxation = self.on_glass(fill(self.box, self.n, "cubic"))
        x, y = position
        density = _ramped(*DENSITY, y)
        velocity = np.stack([_ramped(*SPEED, y), PERTURBATION * np.sin(2 * np.pi * x / WAVELENGTH)])
        mass = density / y.size  # the box has volume 1
        energy = eos.internal_energy(density, np.full(y.size, PRESSURE))
        others = {"density": density}
        return base.InitialState(position, velocity, mass, energy, others, relaxation)

    def diagnostics(self, particles) -> dict[str, float]:
        x, y = particles.position
        upward = particles.velocity[1]
        return {"mode_amplitude": mode_amplitude(particles, x, y - 0.5, upward, WAVELENGTH)}

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        return self.diagnostics(particles)

    def theory(self, eos, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return mode_amplitude (M,) from linear theory."""
        y = linear.points(1.0, POINTS)
        density, wavenumber = _ramped(*DENSITY, y), 2.0 * np.pi / WAVELENGTH
        stiffness = density * eos.sound_speed(density, np.full(POINTS, PRESSURE)) ** 2
        layer = linear.ShearLayer(1.0, _ramped(*SPEED, y), density, stiffness)
        start = np.zeros((3, POINTS), dtype=complex)
        start[1] = -1j * PERTURBATION  # sin(kx) is the real part of -i e^(ikx)
        upward = linear.evolution(layer, wavenumber, start, times)[:, 1]
        weight = surface_weight(y - 0.5, wavenumber)
        return {"mode_amplitude": np.abs(upward @ weight) / weight.sum()}

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return growth rates of the mode from t = 0.5 to 1, by least squares.

        growth_rate: measured; linear_growth_rate: of linear theory at these times; growth_ratio:
        growth_rate over linear_growth_rate; growth_error: |growth_ratio - 1|. Empty if the history
        does not cover these times.
        """
        t = history["t"]
        inside = (t >= GROWTH[0]) & (t <= GROWTH[1])
        if t[0] > GROWTH[0] or t[-1] < GROWTH[1] or inside.sum() < 2:
            return {}
        t = t[inside]
        by_theory = _growth(t, self.theory(eos, t)["mode_amplitude"])
        measured = _growth(t, history["mode_amplitude"][inside])
        return {
            "growth_rate": measured,
            "linear_growth_rate": by_theory,
            "growth_ratio": measured / by_theory,
            "growth_error": abs(measured / by_theory - 1.0),
        }


def _growth(t: np.ndarray, amplitude: np.ndarray) -> float:
    """Return the slope of ln(amplitude) over time, by least squares."""
    return float(np.polyfit(t, np.log(amplitude), 1)[0])


def _ramped(outside: float, inside: float, y: np.ndarray) -> np.ndarray:
    """Return a smooth change from `outside` to `inside` across y = 1/4 and back across 3/4."""
    depth = 0.25 - np.abs(y - 0.5)  # into the slab
    share = 0.5 * np.exp(-np.abs(depth) / RAMP)  # of the other stream
    return np.where(
        depth < 0.0,
        outside + (inside - outside) * share,
        inside + (outside - inside) * share,
    )
