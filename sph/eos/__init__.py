"""Equations of state: one file each, a NamedTuple with these methods.

    pressure(density, internal_energy)       P
    sound_speed(density, pressure)           c_s
    internal_energy(density, pressure)       u, the inverse of the first (initial states)

and, where they end elsewhere than at u = 0,

    lowest_energy(density)                   u of cold gas, at and below which there is no sound

All take numbers in compiled code and NumPy arrays of any one shape elsewhere; code units.

One that is an ideal gas in P + p_inf has the attributes `gamma` and `p_inf`, for exact solutions.
"""

from sph import registry
from sph.compiled import verb
from sph.model import Model


class Eos(Model):
    """What an equation of state may leave out."""

    lowest_energy = None


@verb
def pressure(self, density, internal_energy):
    return self.pressure(density, internal_energy)


@verb
def sound_speed(self, density, pressure):
    return self.sound_speed(density, pressure)


def is_gamma_law(eos) -> bool:
    """Whether P + p_inf = (gamma - 1)(rho u - p_inf), which has an exact Riemann solution."""
    return hasattr(eos, "gamma") and hasattr(eos, "p_inf")


def is_ideal(eos) -> bool:
    """Whether P = (gamma - 1) rho u."""
    return is_gamma_law(eos) and eos.p_inf == 0.0


def make(name: str, **parameters):
    """The equation of state of that name, e.g. make("ideal_gas", gamma=1.4)."""
    return registry.model_class("sph.eos", name)(**parameters)
