"""Candidate lists kept valid: when to build them anew, with how much skin, and from what."""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.errors import NumericalError
from sph.neighbours import first_guess, lists, order, tree
from sph.neighbours.order import BLOCK

# Room for supports to grow between two builds. Where it falls short the pass is done once more.
GROWTH = 0.03

# Cost of building lists over the cost of the two passes, measured in 3-D with 125 neighbours:
# (0.2 + 1.4) / (0.93 + 0.85) microseconds a particle.
BUILD_OVER_PASSES = 0.9

# A support asks for lists a quarter wider than itself. Where that is not enough so often in one
# step, the guess was off by orders of magnitude (particles at one place): they get twice as much.
PATIENCE = 4


class Origin(NamedTuple):
    """What the lists were built from: enough, with the memory order, to build them again."""

    position: np.ndarray  # (D, N)
    support: np.ndarray  # (N,)
    skin: float


@njit(**COMPILED)
def _motion(position, support, list_position, list_support):
    """Largest |r - r_list| / H_list and largest H / H_list."""
    D, n = position.shape
    moved = 0.0
    grown = 0.0
    for i in range(n):
        squared = 0.0
        for d in range(D):
            squared += (position[d, i] - list_position[d, i]) ** 2
        moved = max(moved, squared / list_support[i] ** 2)
        grown = max(grown, support[i] / list_support[i])
    return np.sqrt(moved), grown


@njit(**COMPILED)
def _largest_step(velocity, support, dt):
    """Largest |v| dt / H."""
    D, n = velocity.shape
    largest = 0.0
    for i in range(n):
        squared = 0.0
        for d in range(D):
            squared += velocity[d, i] ** 2
        largest = max(largest, squared / support[i] ** 2)
    return np.sqrt(largest) * dt


def best_skin(step: float, dimension: int) -> float:
    """The skin that makes a step cheapest when particles move `step` supports a step.

    Lists that are to serve k steps need a skin of 2 (k - 1) step beside the room for growth: each
    step then pays 1/k of a build, and passes over candidates that grow as (1 + skin)^D.
    """
    least, steps = np.inf, 1
    for k in range(1, 21):
        cost = BUILD_OVER_PASSES / k + (1 + GROWTH + 2 * (k - 1) * step) ** dimension
        if not cost < least:  # the costs are convex in k
            break
        least, steps = cost, k
    return GROWTH + 2 * (steps - 1) * step


class Search:
    """Lists over particles in block order, and how far they can be trusted."""

    def __init__(self, domain, team):
        self.domain = domain
        self.team = team
        self.origin = None
        self.lists = None
        self.images = None  # that the lists refer to
        self._room = None
        self.reach_factor = 0.0  # of the list support: within it candidates are complete
        self._widenings = 0  # of this step

    def stale(self, position, support) -> bool:
        """Whether particles have moved so far that the lists may miss a neighbour.

        A pair is listed if it was within (1 + skin) of the larger support; each of the two may have
        moved since. Keeps `reach_factor` for the passes.
        """
        self._widenings = 0
        if self.lists is None:
            return True
        moved, grown = _motion(position, support, self.origin.position, self.origin.support)
        self.reach_factor = 1.0 + self.origin.skin - 2.0 * moved
        return not self.reach_factor > grown

    def skin_for(self, velocity, support, dt: float) -> float:
        """The skin for lists built now, for particles of velocity (D, N) and a step dt."""
        return best_skin(_largest_step(velocity, support, dt), velocity.shape[0])

    def guess(self, position, ratio: float) -> np.ndarray:
        """Supports (N,) to begin with, none so wide that lists cannot serve it."""
        least = 1e-9 * self.domain.largest_side  # where all particles are in one place
        most = min(self.domain.longest_reach / (1 + 2 * GROWTH), self.domain.largest_side)
        guess = np.clip(first_guess.from_spacing(position, ratio), least, most)
        first_guess.trim(position, ratio, least, guess)
        return guess

    def order(self, position, identity) -> np.ndarray:
        """The block order of these particles, (N,) indices."""
        if identity.size > lists.MAX_PARTICLES:
            raise NumericalError(
                f"{identity.size} particles are more than the {lists.MAX_PARTICLES} that lists can "
                "number on one machine."
            )
        return order.block_order(position, identity, self.team)

    def build(self, origin: Origin, identity) -> None:
        """Build the lists from `origin`, whose arrays are in block order and are kept."""
        largest = int(np.argmax(origin.support))
        self.domain.check_reach(origin.support[largest], identity.size, int(identity[largest]))
        self.images = self.domain.images_within((1 + origin.skin) * origin.support[largest])
        boxes = tree.build(origin.position, origin.support)
        self.lists = None  # the old ones, the largest arrays there are, make room for the new
        self.lists, self._room = lists.build(
            boxes, origin.position, origin.support, origin.skin, self.images, self.team,
            self._room,
        )  # fmt: skip
        self.origin = origin
        self.reach_factor = 1.0 + origin.skin

    def widen(self, position, wanted, identity) -> None:
        """List particles where they are now, to `wanted` (blocks,) times the list support."""
        self._widenings += 1
        factor = np.repeat(np.maximum(wanted, 1.0), BLOCK)[: identity.size]
        support = self.origin.support * factor
        if self._widenings > PATIENCE:
            support = np.where(factor > 1.0, 2.0 * support, support)
        self.build(Origin(position.copy(), support, self.origin.skin), identity)
