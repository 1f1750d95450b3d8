"""Springs that hold each particle to where it began, and the length of its path since then."""

from collections.abc import Mapping

import numpy as np

from sph import quantity as units
from sph.integrators.leapfrog import STRAIGHT
from sph.part import Evolved, Key, Part, Pass
from sph.quantity import Quantity
from sph.state import Field, Public


class Tether(Part):
    """Acceleration -k (x - x_0), energy k (x - x_0)^2/2, and steps that resolve the oscillation."""

    title = "tether"
    keys = (
        Key(
            "tether",
            "spring constant per unit mass of the tether of each particle; none if not given",
            kind=float,
            above=0.0,
            example=4.0,
            restart="same kind",
        ),
    )
    columns: Mapping[str, Quantity] = {
        "tether_energy": Quantity("energy of the springs", units.ENERGY),
        "longest_path": Quantity("length of the longest path of a particle", units.LENGTH),
    }
    fields = (
        Field("anchor", rank=1),
        Field("path", at_least=0.0, public=Public("Paths", 1, 0, 0, 0, "Length of the path")),
        Field("path_rate"),
        Field("predicted_path", stored=False),
    )
    evolved = (Evolved("path", "path_rate", "predicted_path", STRAIGHT),)
    keeps_momentum = False

    def __init__(self, constant):
        self.constant = constant
        self.passes = (
            Pass(
                "additions",
                "tether",
                self._pull,
                reads=("position", "predicted_velocity", "anchor"),
                updates=("acceleration",),
                writes=("path_rate",),
            ),
        )

    @classmethod
    def of(cls, scene):
        constant = scene.physics.tether
        return None if constant is None else cls(constant)

    @classmethod
    def issues(cls, physics, problem):
        if physics.tether is not None and "periodic" in problem.boundaries:
            return [("tether", "a particle that crosses a periodic face would jump")]
        return []

    def start(self, state):
        state.anchor[:] = state.position

    def _pull(self, position, velocity, anchor, acceleration, path_rate):
        acceleration -= self.constant * (position - anchor)
        path_rate[:] = np.sqrt((velocity**2).sum(axis=0))

    def step_limit(self, state):
        return np.full(state.number, 0.05 / np.sqrt(self.constant))

    def energies(self, state):
        away = state.position - state.anchor
        return {"tether_energy": 0.5 * self.constant * (away**2).sum(axis=0)}

    def sums(self, state):
        return {"longest_path": float(state.path.max())}
