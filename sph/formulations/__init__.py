"""Formulations: which equations are solved for density and rates. One folder each.

The folder's `__init__.py` defines one subclass of `Formulation`.
"""

import numpy as np

from sph.part import Part
from sph.state import COMMON, Public, State

# Derived: no array of the state.
PRESSURE = Public("Pressures", -1, 1, -2, -5, "Pressure")


class Formulation(Part):
    """The part that every scene has one of (`physics.formulation`)."""

    fields = COMMON
    # The models that passes take, and those at the start, which has no past to begin from.
    models: tuple
    starting_models: tuple

    @property
    def label(self) -> str:
        """What the equations are called in a checkpoint."""
        return self.name

    def pressure(self, state: State) -> np.ndarray:
        """(N,) pressure of the state at the end of a step."""
        raise NotImplementedError
