"""Mie-Grueneisen equation of state of solids (eqs 422-424).

A shock has the speed c_0 + slope v, where v is the jump of velocity at the shock. The reference is
the exact Hugoniot curve of material at rho_0 without pressure and energy, with Gamma rho =
Gamma_0 rho_0 constant. Below rho_0 the cold pressure is linear in the density. The continuum
formulation only: the pressure is negative in tension.

The Hugoniot curve ends at the density rho_0/(1 - 1/slope), which no shock reaches. Pressure and
speed of sound are NaN from there on, and the speed of sound is NaN where its square is negative (in
extreme tension), so that the watchdog stops the run.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.eos import Defaults
from sph.model import Parameter, model


@model(Defaults)
class MieGruneisen(NamedTuple):
    """`rho_0`, `c_0`: density and bulk speed of sound at rest; `slope`; `gruneisen`: Gamma_0."""

    rho_0: Annotated[float, Parameter("density without pressure and energy", above=0.0)]
    c_0: Annotated[float, Parameter("bulk speed of sound at rho_0", above=0.0)]
    slope: Annotated[
        float, Parameter("increase of shock speed with the jump of velocity", at_least=0.0)
    ]
    gruneisen: Annotated[float, Parameter("Grueneisen coefficient at rho_0", above=0.0)]

    under_tension = True

    def pressure(self, density, internal_energy):
        strain = 1.0 - self.rho_0 / density
        left = 1.0 - self.slope * strain  # zero at the end of the Hugoniot curve
        left = np.where(left > 0.0, left, np.nan)
        hugoniot = self.rho_0 * self.c_0**2 * strain / (left * left)  # eq 422
        compression = hugoniot * (1.0 - 0.5 * self.gruneisen * strain)
        cold = np.where(strain > 0.0, compression, self.c_0**2 * (density - self.rho_0))
        return cold + self.gruneisen * self.rho_0 * internal_energy  # eq 423

    def sound_speed(self, density, pressure):
        strain = 1.0 - self.rho_0 / density
        left = 1.0 - self.slope * strain
        left = np.where(left > 0.0, left, np.nan)
        ratio = self.rho_0 / density * self.c_0
        compression = ratio * ratio * (1.0 + (self.slope - self.gruneisen) * strain)
        compression = compression / (left * left * left)
        squared = np.where(strain > 0.0, compression, self.c_0**2)
        squared = squared + self.gruneisen * self.rho_0 * pressure / (density * density)  # eq 424
        return np.sqrt(np.where(squared >= 0.0, squared, np.nan))

    def internal_energy(self, density, pressure):
        cold = self.pressure(density, 0.0 * density)
        return (pressure - cold) / (self.gruneisen * self.rho_0)

    def lowest_energy(self, density):
        at_rest = self.sound_speed(density, 0.0 * density)
        return self.internal_energy(
            density, -((density * at_rest) ** 2) / (self.gruneisen * self.rho_0)
        )
