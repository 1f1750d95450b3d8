"""Equations of state: one file each, a NamedTuple with these methods.

    pressure(density, internal_energy)       P
    sound_speed(density, pressure)           c_s
    internal_energy(density, pressure)       u, the inverse of the first (initial states)

All take numbers in compiled code and NumPy arrays of any one shape elsewhere; code units.
"""

from sph import registry
from sph.compiled import verb


@verb
def pressure(self, density, internal_energy):
    return self.pressure(density, internal_energy)


@verb
def sound_speed(self, density, pressure):
    return self.sound_speed(density, pressure)


def make(name: str, **parameters):
    """The equation of state of that name, e.g. make("ideal_gas", gamma=1.4)."""
    return registry.model_class("sph.eos", name)(**parameters)
