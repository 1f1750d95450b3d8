"""What passes over the blocks' candidates share: gather only, one writer a particle, a fixed order.

A pass copies a block's candidates into contiguous scratch, images applied (`gather`), and runs
branch-free loops over it for every particle of the block, so its results do not depend on the
number of threads. Arguments that are None leave their part out of the compiled code.
"""

from typing import Any, NamedTuple

import numpy as np

from sph.state import State
from sph.threads import Team

TINY = 1e-300  # keeps 1/r finite where r_ij = 0 and what it multiplies is zero too


class Neighbours(NamedTuple):
    """Candidates of all blocks, complete within reach_factor times list_support of particles."""

    lists: tuple
    images: tuple
    list_support: np.ndarray  # (N,) H when the lists were built
    reach_factor: float


class Sweep:
    """The arguments of passes: the state, its neighbours, the models and the step.

    wanted (blocks,): for a pass that widens lists. Blocks where it is 0 are passed over; the pass
    sets it to 0, or to the multiple of list_support to which the block must be listed before it is
    run again for it.
    """

    def __init__(self, state: State, team: Team, blocks: int, models: Any):
        self.state = state
        self.team = team
        self.dim = (0,) * state.dimension
        self.wanted = np.empty(blocks)
        self.models = models  # of the formulation
        self.neighbours: Neighbours | None = None
        self.dt = 0.0  # of the present step
        self.is_start = False  # before the first step, where supports are guesses

    def run(self, function, models, *arguments) -> None:
        """Call function(first, last, dim, models, neighbours, *arguments) over ranges of blocks."""
        self.team.run(function, self.wanted.size, self.dim, models, self.neighbours, *arguments)
