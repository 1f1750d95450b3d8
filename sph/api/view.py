"""What a script sees of a simulation that is going on."""

import numpy as np

from sph.api.particles import Particles
from sph.output import checkpoint as checkpoints
from sph.runner import state_of
from sph.simulation import Simulation as Engine


class View:
    """The present state of a simulation, which `sph.run` passes to its callback."""

    def __init__(self, engine: Engine):
        self._engine = engine

    @property
    def time(self) -> float:
        """Time reached, in code units."""
        return self._engine.time

    @property
    def step(self) -> int:
        """Number of time steps taken."""
        return self._engine.step

    @property
    def next_step(self) -> float:
        """Length of the next time step, before it is cut to end at an output."""
        return self._engine.limit.dt

    @property
    def particles(self) -> Particles:
        """The particles, whose fields are always those of the present state."""
        engine = self._engine
        return Particles(
            lambda: engine.particles, lambda: engine.scene.formulation.pressure(engine.particles)
        )

    @property
    def box(self) -> np.ndarray:
        """(D, 2) lower and upper ends of the domain along each axis."""
        return self._engine.scene.domain.box.copy()

    @property
    def energy_drift(self) -> float:
        """Relative change of total energy since the start, without what sources added."""
        return float(self._engine.energy_drift)

    @property
    def state_hash(self) -> str:
        """SHA-256 of the state that a checkpoint would hold: equal for runs equal bit for bit."""
        return checkpoints.hash_of(state_of(self._engine))

    def __repr__(self) -> str:
        number = self._engine.particles.number
        return f"<simulation of {number} particles at t = {self.time:.6g}, step {self.step}>"
