"""Equations of state, one file each: pressure and sound speed of a gas, liquid or solid."""

from collections.abc import Callable
from typing import Any, Protocol

from sph import registry
from sph.compiled import verb
from sph.model import Model


class EquationOfState(Protocol):
    """An equation of state: a file with a NamedTuple that has these methods.

    The arguments are numbers in compiled code and arrays of equal shape elsewhere, in code units.
    A gas with P + p_inf = (gamma - 1)(rho u - p_inf) has the attributes gamma and p_inf, which the
    exact solutions use.
    """

    def pressure(self, density: Any, internal_energy: Any) -> Any:
        """Return the pressure P."""

    def sound_speed(self, density: Any, pressure: Any) -> Any:
        """Return the speed of sound c."""

    def internal_energy(self, density: Any, pressure: Any) -> Any:
        """Return u, the inverse of `pressure`, for initial states."""


class Defaults(Model):
    """Defaults of an equation of state: attributes that its class need not define."""

    # lowest_energy(density): the u at which the speed of sound becomes 0; None if this is u = 0
    lowest_energy: Callable[[Any], Any] | None = None
    # whether the pressure may be negative at rest, which only the continuum formulation takes
    under_tension = False

    @classmethod
    def required(cls) -> tuple[str, ...]:
        return "pressure", "sound_speed", "internal_energy"


@verb
def pressure(self: EquationOfState, density: Any, internal_energy: Any) -> Any:
    return self.pressure(density, internal_energy)


@verb
def sound_speed(self: EquationOfState, density: Any, pressure: Any) -> Any:
    return self.sound_speed(density, pressure)


def is_gamma_law(eos: EquationOfState) -> bool:
    """Return whether P + p_inf = (gamma - 1)(rho u - p_inf), as `sph.exact.riemann` requires."""
    return hasattr(eos, "gamma") and hasattr(eos, "p_inf")


def is_ideal(eos: Any) -> bool:
    """Return whether P = (gamma - 1) rho u."""
    return is_gamma_law(eos) and eos.p_inf == 0.0


def make(name: str, **parameters: Any) -> EquationOfState:
    """Return the equation of state of that name, e.g. make("ideal_gas", gamma=1.4)."""
    return registry.model_class("sph.eos", name)(**parameters)
