"""Heating and cooling that the flow does not cause, for example by radiation.

A source is a file with a NamedTuple that has the method

    heated(internal_energy, dt)    internal energy (N,) after heating alone for the time dt

The method solves the heating exactly or implicitly, so stiff heating does not limit the time step.
Each step applies the method for dt/2 at its beginning and for dt/2 at its end (Strang splitting:
Strang 1968, SIAM J. Numer. Anal. 5, 506). The history records the energy added, which does not
count as energy drift. The method is called from Python, not from compiled code.
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
            "heating or cooling that the flow does not cause; none if not given",
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
        return state.total(state.internal_energy - before)

    def split_predicted(self, state, dt):
        state.predicted_energy = self.source.heated(state.predicted_energy, dt)
