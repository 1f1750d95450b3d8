"""The fields of particles as arrays in the order of their IDs."""

from collections.abc import Callable

import numpy as np

from sph.state import State


class Particles:
    """The fields of N particles in D dimensions, in code units, in the order of their IDs 1 … N.

    Each field is an attribute, computed or read when it is asked for; `fields` names all fields,
    and `particles["density"]` equals `particles.density`. Arrays are copies. A field that the scene
    does not have raises AttributeError, which names those that there are.
    """

    id: np.ndarray  #: (N,) identification numbers
    position: np.ndarray  #: (D, N)
    velocity: np.ndarray  #: (D, N)
    mass: np.ndarray  #: (N,)
    internal_energy: np.ndarray  #: (N,) per unit mass
    density: np.ndarray  #: (N,) per D-dimensional volume
    pressure: np.ndarray  #: (N,)
    support: np.ndarray  #: (N,) radius H beyond which the kernel is zero

    def __init__(self, state: Callable[[], State], pressure: Callable[[], np.ndarray]):
        """Present the state that `state` returns. pressure: returns (N,) in the state's order."""
        self._of_state, self._of_pressure = state, pressure

    @property
    def fields(self) -> list[str]:
        """Names of all fields."""
        return [*(one.name for one in self._of_state().fields if one.stored), "pressure"]

    @property
    def number(self) -> int:
        """N."""
        return self._of_state().number

    @property
    def dimension(self) -> int:
        """D."""
        return self._of_state().dimension

    def __len__(self) -> int:
        return self.number

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.fields:
            raise KeyError(f"no field {name!r}; expected one of {', '.join(self.fields)}")
        state = self._of_state()
        # some schemes store a pressure too: the formulation knows which one counts
        values = self._of_pressure() if name == "pressure" else getattr(state, name)
        return values[..., np.argsort(state.id, kind="stable")]

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_"):  # asked for by copy and pickle, before __init__
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.fields]

    def __repr__(self) -> str:
        return f"<{self.number} particles in {self.dimension}-D: {', '.join(self.fields)}>"
