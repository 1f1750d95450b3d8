"""Passes over particles and their candidate neighbours: shared arguments and rules.

A pass copies the candidates of a block, with images applied, into contiguous scratch arrays
(`gather`). It then runs loops without branches over these arrays for every particle of the block.
Only the pass over a particle's own block writes to the particle, and candidates have a fixed order,
so results do not depend on the number of threads. An argument that is None removes the code that
uses the argument from the compiled pass.
"""

from typing import Any, NamedTuple

import numpy as np
from numba.extending import is_jitted

from sph.neighbours import lists
from sph.neighbours.lists import SUPERBLOCK
from sph.neighbours.order import BLOCK
from sph.part import Pass
from sph.state import State
from sph.threads import SMALLEST_RANGE, Team

SMALLEST = SMALLEST_RANGE // SUPERBLOCK  # number of superblocks in a range


class Neighbours(NamedTuple):
    """Lists of all superblocks, complete up to reach_factor times each particle's list_support."""

    lists: lists.Lists
    images: tuple
    boxes: np.ndarray  # (blocks, 2 D) lower and upper corners of the present positions
    list_support: np.ndarray  # (N,) H when the lists were built
    reach_factor: float
    lanes: tuple  # the arithmetic of pairs, see `sph.simd`
    active: np.ndarray | None = None  # the particles to compute, see `sph.passes.active`

    @property
    def superblocks(self) -> int:
        """The number of superblocks, over which passes run."""
        return self.lists.count.size


class Sweep:
    """The arguments of passes: the state, its neighbours, the models and the step.

    wanted (blocks,): for a pass that may request wider lists. The pass skips blocks where `wanted`
    is 0. For each other block it sets `wanted` to 0 if the lists were wide enough, otherwise to the
    multiple of list_support that the lists must reach before the pass is repeated for the block.
    """

    def __init__(self, state: State, team: Team, blocks: int, models: Any):
        self.state = state
        self.team = team
        self.dim = (0,) * state.dimension
        self.wanted = np.empty(blocks)
        self.models = models  # those of the formulation
        self.neighbours: Neighbours | None = None
        self.dt: float | np.ndarray = 0.0  # of the present step; (N,) with individual steps
        self.is_start = False  # before the first step, where supports are guesses

    def want_all(self, one: Pass) -> None:
        """Prepare a pass over all particles that are active."""
        state, active = self.state, self.state.get("active")
        if active is None:
            self.wanted.fill(1.0)
            return
        if one.widens:
            np.maximum.reduceat(active, np.arange(0, active.size, BLOCK), out=self.wanted)
        if one.swaps is not None:  # the pass writes only the values of active particles
            first, second = one.swaps
            getattr(state, second)[:] = getattr(state, first)

    def make(self, one: Pass) -> None:
        """Run a pass once. If it requests wider lists, `swaps` waits until it has them."""
        arrays = [None if name is None else getattr(self.state, name) for name in one.arrays]
        if not is_jitted(one.function):
            self._call(one, arrays)
            return
        models = self.models if one.models is None else one.models
        # Before the first step supports are guesses and must converge. Only the pass that finds
        # them gets models for that, so no other pass is compiled twice.
        if self.is_start and one.models_at_start is not None:
            models = one.models_at_start
        extra = [self.wanted] * one.widens + [self.dt] * one.takes_step
        self.run(one.function, models, *arrays, *extra)
        if one.swaps is not None and not (one.widens and self.wanted.max() > 0.0):
            self.state.swap(*one.swaps)

    def _call(self, one: Pass, arrays: list[np.ndarray | None]) -> None:
        """Call an uncompiled pass.

        If not all particles are active, it gets copies of the values of those that are.
        """
        active = self.state.get("active")
        if one.takes_sweep:
            one.function(self, *arrays)
            return
        if active is None or active.all():
            one.function(*arrays)
            return
        chosen = np.flatnonzero(active)
        parts = [None if array is None else array[..., chosen] for array in arrays]
        one.function(*parts)
        for array, part in zip(arrays[len(one.reads) :], parts[len(one.reads) :], strict=True):
            if array is not None:
                array[..., chosen] = part

    def run(self, function, models, *arguments) -> None:
        """Call function(first, last, dim, models, neighbours, *arguments) over superblocks."""
        neighbours: Any = self.neighbours
        self.team.run(
            function, neighbours.superblocks, self.dim, models, neighbours, *arguments,
            smallest=SMALLEST,
        )  # fmt: skip
