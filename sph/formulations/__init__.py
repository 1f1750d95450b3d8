"""Formulations, one folder each: the equations for density and rates of change.

The `__init__.py` of a folder defines one subclass of `Formulation`.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from sph.part import Part
from sph.state import COMMON, Field, Public, State

# Pressure is computed from the state, not stored in it.
PRESSURE = Public("Pressures", -1, 1, -2, -5, "Pressure")


class Formulation(Part):
    """The part with the basic equations. A scene has exactly one (`physics.formulation`)."""

    fields: tuple[Field, ...] = COMMON
    roles: ClassVar[tuple[str, ...]] = ()  # of the terms that its pair loops call
    # defaults of keys of [physics] that every formulation has, if not those of most formulations
    defaults: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    neighbours_key: ClassVar[str] = ""  # the key that sets the number of neighbours
    individual_steps: ClassVar[bool] = False  # whether particles may have time steps of their own
    # The models that passes use, among them `kernel`, `eos`, `support_ratio` (H/h) and `eta`.
    models: Any

    eos: Any  # of the scene or, where there are several materials, of the first

    @property
    def label(self) -> str:
        """The name of the equations that checkpoints store."""
        return self.name

    def pressure(self, state: State) -> np.ndarray:
        """Return the pressure (N,) of the state at the end of a step."""
        raise NotImplementedError

    def sound_speed(self, state: State) -> np.ndarray:
        """Return the speed of sound (N,) of the state at the end of a step."""
        return self.eos.sound_speed(state.density, self.pressure(state))

    def derived(self, state: State) -> list[tuple[Public, np.ndarray]]:
        """Return public quantities that checkpoints hold besides the stored fields.

        Arrays: (N,), or (D, N) and (3, 3, N) for vectors and symmetric tensors. The pressure is the
        first.
        """
        return [(PRESSURE, self.pressure(state))]

    def pieces(self, state: State) -> Any:
        """Return solid bodies and their connected pieces, or None if there are no solids."""
        return None


BASE = Formulation
