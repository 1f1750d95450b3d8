"""Equations of state, one file each: a NamedTuple with these methods, in code units.

    pressure(density, internal_energy)       P
    sound_speed(density, pressure)           c_s
    internal_energy(density, pressure)       u, the inverse of `pressure`

and, if u of cold gas is not 0,

    lowest_energy(density)                   u of cold gas, where the sound speed is 0

Arguments are numbers in compiled code, and elsewhere NumPy arrays of equal shape.

An equation of state that is an ideal gas in P + p_inf has the attributes `gamma` and `p_inf`, which
exact solutions use.
"""

from sph import registry
from sph.compiled import verb


@verb
def pressure(self, density, internal_energy):
    return self.pressure(density, internal_energy)


@verb
def sound_speed(self, density, pressure):
    return self.sound_speed(density, pressure)


def is_gamma_law(eos) -> bool:
    """Return whether P + p_inf = (gamma - 1)(rho u - p_inf), as `sph.exact.riemann` requires."""
    return hasattr(eos, "gamma") and hasattr(eos, "p_inf")


def is_ideal(eos) -> bool:
    """Return whether P = (gamma - 1) rho u."""
    return is_gamma_law(eos) and eos.p_inf == 0.0


def make(name: str, **parameters):
    """Return the equation of state of that name, e.g. make("ideal_gas", gamma=1.4)."""
    return registry.model_class("sph.eos", name)(**parameters)
