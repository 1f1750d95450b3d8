"""Linear elastic solid, which never yields (eq 430)."""

from typing import Annotated, NamedTuple

import numpy as np

from sph.formulations.continuum.strength import Strength
from sph.model import Parameter, model


@model(Strength)
class Elastic(NamedTuple):
    """`shear_modulus`: G."""

    shear_modulus: Annotated[float, Parameter("shear modulus G", above=0.0)]

    def yield_stress_of(self, plastic_strain, strain_rate, internal_energy):
        # beside materials that yield, in a scene with several
        return np.inf + 0.0 * plastic_strain
