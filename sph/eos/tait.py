"""Tait's law for liquids and elastic solids: pressure from the density alone (eq 420).

With gamma = 1 the law is linear, P = c_0^2 (rho - rho_0); gamma = 7 fits water (Cole 1948,
Underwater Explosions, Princeton University Press). The continuum formulation only: the pressure is
negative below rho_0.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.eos import Defaults
from sph.errors import ConfigError
from sph.model import Parameter, model

# Of rho_0 c_0^2, up to which two pressures are equal.
TOLERANCE = 1e-9


@model(Defaults)
class Tait(NamedTuple):
    """`rho_0`: density at P = 0; `c_0`: speed of sound there; `gamma`: exponent."""

    rho_0: Annotated[float, Parameter("density without pressure", above=0.0)]
    c_0: Annotated[float, Parameter("speed of sound at rho_0", above=0.0)]
    gamma: Annotated[
        float, Parameter("exponent of the density; 1 is the linear law, 7 is water", at_least=1.0)
    ] = 1.0

    under_tension = True

    def pressure(self, density, internal_energy):
        compressed = (density / self.rho_0) ** self.gamma - 1.0
        return self.rho_0 * self.c_0**2 / self.gamma * compressed  # eq 420

    def sound_speed(self, density, pressure):
        return self.c_0 * (density / self.rho_0) ** (0.5 * (self.gamma - 1.0))  # eq 421

    def internal_energy(self, density, pressure):
        """Return 0: the pressure does not depend on u, which initial states count from zero.

        Raises ConfigError for a pressure that is neither 0 nor that of the density.
        """
        own = self.pressure(density, 0.0)
        differ = np.abs(pressure - own) > TOLERANCE * self.rho_0 * self.c_0**2
        wrong = np.atleast_1d(differ & (np.asarray(pressure) != 0.0))
        if wrong.any():
            rho, asked, own = (
                np.broadcast_to(one, wrong.shape)[wrong][0] for one in (density, pressure, own)
            )
            raise ConfigError(
                f"the initial state has pressure {asked:g} at density {rho:g}, but "
                f'physics.eos "tait" gives {own:g} there, whatever the energy. Try: a density or '
                "pressure that agree, or an equation of state with internal energy"
            )
        return 0.0 * density
