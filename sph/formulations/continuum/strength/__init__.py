"""Strength of solids, one file each: shear modulus, and yield stress if the solid yields.

A model without `yields` is elastic at any stress. The others bound the equivalent stress of eq 434
by `yield_stress_of`; a yield stress of zero or less is that of a melt.
"""

from typing import Any, Protocol

from sph.compiled import verb
from sph.model import Model


class StrengthModel(Protocol):
    """A strength model: a file with a NamedTuple that has this parameter and this method."""

    yields: bool

    @property
    def shear_modulus(self) -> float:
        """The shear modulus G."""

    def yield_stress_of(self, plastic_strain: Any, strain_rate: Any, internal_energy: Any) -> Any:
        """Return the yield stress Y in uniaxial tension; it must not fall with plastic strain.

        plastic_strain: the sum of equivalent plastic strains; strain_rate: the equivalent rate of
        strain; internal_energy: per unit mass.
        """


class Strength(Model):
    """Defaults of a strength model."""

    yields = False  # whether the scene has plastic strain, and yield_stress_of is called

    @classmethod
    def required(cls) -> tuple[str, ...]:
        return "shear_modulus", "yield_stress_of"


@verb
def yield_stress_of(self, plastic_strain, strain_rate, internal_energy):
    return self.yield_stress_of(plastic_strain, strain_rate, internal_energy)


yield_stress_of.takes_vectors = False  # type: ignore[attr-defined]
