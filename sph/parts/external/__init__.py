"""External fields: forces on the gas from what is not gas. One file each, a NamedTuple with

    acceleration(position)    (D, N) at positions (D, N)
    potential(position)       (N,) per unit mass, zero at infinity or wherever the file says
    misfit(boundaries)        why it cannot act in a box of these boundaries (a name for each
                              axis) and what to try; None if it can

The first two are called from Python, once a step, by scenes that name a field and by no others; the
last when a configuration is read. A mirror suits every field: no particle jumps in its potential.
"""

from sph import registry
from sph.model import Model
from sph.part import Key, Part, Pass

FOLDER = "sph.parts.external"


class Field(Model):
    """What a field may leave out."""

    softening = 0.0  # a length, where it can be softened

    def misfit(self, boundaries):
        return None


class External(Part):
    """A field from outside, its potential energy, and the bound that |a| sets on the step."""

    title = "external field"
    keys = (
        Key(
            "external",
            "external gravitational field, with G = 1; none if not given",
            models=FOLDER,
            example={"name": "point_mass", "mass": 1.0},
            restart="refused",
        ),
    )
    balances_pressure = True
    columns = ("potential_energy",)
    keeps_momentum = False
    bounds_acceleration = True

    def __init__(self, field):
        self.field = field
        self.passes = (
            Pass("additions", "rates", self._add, ("position", "acceleration"), ("acceleration",)),
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

    def _add(self, sweep) -> None:
        state = sweep.state
        state.acceleration += self.field.acceleration(state.position)

    def energies(self, state):
        return {"potential_energy": self.field.potential(state.position)}

    def remedies(self, trouble, held_by):
        softening = f"a {'larger ' * (self.field.softening > 0.0)}softening of physics.external"
        if trouble == "endless energy":
            return [f"{softening}, or no particle where its mass is"]
        if trouble == "drift" or (trouble == "short steps" and held_by == "acceleration"):
            return [softening]
        return []
