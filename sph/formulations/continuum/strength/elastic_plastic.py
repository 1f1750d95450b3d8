"""Elastic-perfectly plastic solid: a constant yield stress (eq 432)."""

from typing import Annotated, NamedTuple

from sph.formulations.continuum.strength import Strength
from sph.model import Parameter, model


@model(Strength)
class ElasticPlastic(NamedTuple):
    """`shear_modulus`: G; `yield_stress`: Y in uniaxial tension."""

    shear_modulus: Annotated[float, Parameter("shear modulus G", above=0.0)]
    yield_stress: Annotated[float, Parameter("yield stress Y in uniaxial tension", at_least=0.0)]

    yields = True

    def yield_stress_of(self, plastic_strain, strain_rate, internal_energy):
        return self.yield_stress + 0.0 * plastic_strain
