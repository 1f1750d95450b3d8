"""Isentropic vortex: a smooth steady vortex in gas of uniform entropy.

Yee, Vinokur & Djomehri (2000), J. Comput. Phys. 162, 33, section 5: with all derivatives continuous
it shows the order of a method where Gresho's vortex, which has kinks, cannot.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from sph.problems import base
from sph.problems.base import wide
from sph.problems.support import lattice as placement
from sph.problems.support.vortex import from_centre, rotation

_SHARED = base.Problem.model_fields

STRENGTH = 5.0  # beta of the paper
WIDTH = 10.0  # at whose edge the gas still goes round at 2.5e-5 of the sound speed


class Problem(base.Problem):
    """A smooth steady vortex in the middle of a periodic square, at rest or carried along."""

    defaults: ClassVar = {
        "physics.gamma": 1.4,
        "physics.alpha": 1.0,
        "time.end": 10.0,
        "output.interval": 2.5,
    }
    ideal_gas: ClassVar = True
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-3, "a smooth flow, whose energy the scheme conserves to the order of the time step"
        ),
    }

    name: Literal["yee"] = "yee"
    dimension: Literal[2] = Field(default=2, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 4096
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"], wide(WIDTH)] = Field(
        default=[-5.0, 5.0]
    )
    boundary: Literal["periodic"] = Field(default="periodic", description="of both axes")
    velocity: list[float] = Field(
        default=[0.0, 0.0],
        min_length=2,
        max_length=2,
        description="bulk motion [vx, vy], which carries the vortex along",
    )
    lattice: Literal["cubic", "hexagonal", "relaxed"] = Field(
        default="cubic", description='"cubic", "hexagonal" or "relaxed", a glass'
    )

    def initial(self, eos) -> base.InitialState:
        """An undisturbed lattice with masses by the density.

        A lattice stretched to particles of one mass, whose cells are then sheared, was worse: L1 of
        density at t = 1 0.0059 instead of 0.0054 with 64 x 64, of velocity at t = 10 0.0322
        instead of 0.0318. The masses stay smooth, as particles go round at their own radius.
        """
        position = placement.fill(self.box, self.n, self.lattice)
        n = position.shape[1]
        volume = np.prod(self.box[:, 1] - self.box[:, 0]) / n
        state = self.exact(eos, 0.0, position)
        return base.InitialState(
            position, state["velocity"], state["density"] * volume, state["internal_energy"]
        )

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """The initial vortex, carried along by the bulk motion, at any (D, N) positions."""
        offset, radius = from_centre(self.box, position, self.velocity, time)
        # rotation rate, and P/rho, which is 1 far away; P = rho^gamma
        rate = STRENGTH / (2.0 * np.pi) * np.exp(0.5 * (1.0 - radius**2))
        temperature = 1.0 - 0.5 * (eos.gamma - 1.0) / eos.gamma * rate**2
        density = temperature ** (1.0 / (eos.gamma - 1.0))
        pressure = density * temperature
        return {
            "density": density,
            "velocity": rotation(offset, rate) + np.array(self.velocity)[:, None],
            "pressure": pressure,
            "internal_energy": eos.internal_energy(density, pressure),
        }
