"""External gravitational field, added to the acceleration that the gas causes.

A field is a file with a NamedTuple that has the methods

    acceleration(position)    acceleration (D, N) at positions (D, N)
    potential(position)       potential (N,) per unit mass; the file says where it is zero
    misfit(boundaries)        why the field cannot be used with these boundaries (one per axis) and
                              what to try, or None

Python calls `acceleration` and `potential` once per step, and `misfit` when it reads a
configuration. Every field works with reflecting walls, because no particle is moved to another
place there; a periodic boundary moves particles, and so changes their potential energy.
"""

from collections.abc import Mapping

from sph import registry
from sph.model import Model
from sph.part import Key, Part, Pass
from sph.quantity import ENERGY, Quantity

FOLDER = "sph.parts.external"


class Field(Model):
    """Defaults of an external field."""

    softening = None  # a length; None for fields that cannot be softened

    @classmethod
    def required(cls):
        return "acceleration", "potential"

    def misfit(self, boundaries):
        return None


class External(Part):
    """An external field, its potential energy, and the limit on the time step by |a|."""

    title = "external field"
    keys = (
        Key(
            "external",
            "external gravitational field; none if not given",
            models=FOLDER,
            example={"name": "point_mass", "mass": 1.0},
            restart="refused",
        ),
    )
    balances_pressure = True
    columns: Mapping[str, Quantity] = {
        "potential_energy": Quantity("potential energy in the external field", ENERGY)
    }
    keeps_momentum = False
    bounds_acceleration = True

    def __init__(self, field):
        self.field = field
        self.passes = (
            Pass("additions", "rates", self._add, ("position",), updates=("acceleration",)),
        )

    @classmethod
    def of(cls, scene):
        field = registry.model(FOLDER, scene.physics.external)
        return None if field is None else cls(field)

    @classmethod
    def issues(cls, physics, problem):
        field = registry.model(FOLDER, physics.external)
        misfit = None if field is None else field.misfit(problem.boundaries)
        return [("external", misfit)] if misfit else []

    def _add(self, position, acceleration) -> None:
        acceleration += self.field.acceleration(position)

    def energies(self, state):
        return {"potential_energy": self.field.potential(state.position)}

    def remedies(self, trouble, held_by):
        if self.field.softening is None:
            return []
        softening = f"a {'larger ' * (self.field.softening > 0.0)}softening of physics.external"
        if trouble == "endless energy":
            return [f"{softening}, or no particle at the position of its mass"]
        if trouble == "drift" or (trouble == "short steps" and held_by == "acceleration"):
            return [softening]
        return []
