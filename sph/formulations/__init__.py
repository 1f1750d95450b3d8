"""Formulations, one folder each: the equations for density and rates.

The `__init__.py` of a folder defines one subclass of `Formulation`.
"""

from typing import Any

import numpy as np

from sph.part import Part
from sph.state import COMMON, Public, State

# Derived: no array of the state.
PRESSURE = Public("Pressures", -1, 1, -2, -5, "Pressure")


class Formulation(Part):
    """The part with the basic equations (`physics.formulation`), of which a scene has one."""

    fields = COMMON
    # What the passes take; `kernel`, `eos`, `support_ratio` (H/h) and `eta` are among them.
    models: Any

    @property
    def label(self) -> str:
        """Name of the equations in a checkpoint."""
        return self.name

    def pressure(self, state: State) -> np.ndarray:
        """Return the pressure (N,) of the state at the end of a step."""
        raise NotImplementedError
