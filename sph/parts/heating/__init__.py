"""Heating and cooling that is not caused by the flow, one file each: a NamedTuple with

    heated(internal_energy, dt)    u (N,) after heating alone for dt, exact or implicit

The method is exact or implicit, so stiff heating does not limit the time step. Each step applies
it for dt/2 at its beginning and end (Strang splitting: Strang 1968, SIAM J. Numer. Anal. 5, 506).
The history records the energy added, which does not count as energy drift. Called from Python.
"""

from sph import registry
from sph.part import Key, Part

FOLDER = "sph.parts.heating"


class Heating(Part):
    """Heating or cooling, applied for half a step at the beginning and end of each step."""

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
