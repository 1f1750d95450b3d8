"""Heating and cooling: sources of internal energy other than the flow. One file each, a NamedTuple
with

    heated(internal_energy, dt)    (N,) u after dt of heating alone, from (N,) u: exact or implicit

so that however stiff a source is, it never shortens the step: a step has half of it at either end
(Strang 1968, SIAM J. Numer. Anal. 5, 506). What it adds is counted in the history and taken out of
the energy drift. Called from Python, by scenes that name a source and by no others.
"""

from sph import registry
from sph.part import Key, Part

FOLDER = "sph.parts.heating"


class Heating(Part):
    """A source of internal energy, solved by itself over half a step at either end."""

    title = "heating"
    keys = (
        Key(
            "heating",
            "heating or cooling that is not caused by the flow; none if not given",
            models=FOLDER,
            example={"name": "relaxation", "energy": 1.0, "time": 0.1},
            restart="same kind",
        ),
    )
    adds_energy = True

    def __init__(self, source):
        self.source = source

    @classmethod
    def of(cls, scene):
        source = registry.model(FOLDER, scene.physics.heating)
        return None if source is None else cls(source)

    def split(self, state, dt):
        before = state.internal_energy
        state.internal_energy = self.source.heated(before, dt)
        return float(state.mass @ (state.internal_energy - before))

    def split_predicted(self, state, dt):
        state.predicted_energy = self.source.heated(state.predicted_energy, dt)
