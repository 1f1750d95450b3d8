"""Johnson-Cook solid: hardening with strain and rate, softening with temperature (eq 433).

Johnson & Cook (1983), Proc. 7th International Symposium on Ballistics, 541. The temperature follows
from the internal energy with a constant specific heat; u = 0 is room temperature. From the melting
temperature on the yield stress is zero.
"""

from typing import Annotated, NamedTuple

import numpy as np

from sph.compiled import larger, smaller
from sph.formulations.continuum.strength import Strength
from sph.model import Parameter, model


@model(Strength)
class JohnsonCook(NamedTuple):
    """`A`, `B`, `n`: yield stress, and hardening with strain; `C`: with rate; `m`: softening."""

    shear_modulus: Annotated[float, Parameter("shear modulus G", above=0.0)]
    A: Annotated[float, Parameter("yield stress without plastic strain", at_least=0.0)]
    B: Annotated[float, Parameter("hardening: coefficient of plastic strain^n", at_least=0.0)]
    n: Annotated[float, Parameter("exponent of hardening", above=0.0)]
    C: Annotated[float, Parameter("coefficient of ln(strain rate/reference_rate)", at_least=0.0)]
    m: Annotated[float, Parameter("exponent of softening with temperature", above=0.0)]
    reference_rate: Annotated[
        float, Parameter("strain rate up to which the rate has no effect", above=0.0)
    ]
    specific_heat: Annotated[float, Parameter("energy per unit mass and kelvin", above=0.0)]
    room_temperature: Annotated[float, Parameter("temperature at u = 0, kelvin", at_least=0.0)]
    melting_temperature: Annotated[
        float, Parameter("temperature from which on the yield stress is zero, kelvin", above=0.0)
    ]

    yields = True

    def issues(self):
        if self.melting_temperature > self.room_temperature:
            return []
        return [("melting_temperature", "expected a temperature above room_temperature")]

    def yield_stress_of(self, plastic_strain, strain_rate, internal_energy):
        strain = larger(plastic_strain, 0.0)
        hardened = self.A + self.B * strain**self.n
        rate = larger(strain_rate / self.reference_rate, 1.0)
        warmth = internal_energy / self.specific_heat
        homologous = warmth / (self.melting_temperature - self.room_temperature)
        softening = 1.0 - smaller(larger(homologous, 0.0), 1.0) ** self.m
        return hardened * (1.0 + self.C * np.log(rate)) * softening
