"""Management of the candidate lists: when to rebuild them, and with which skin."""

from typing import NamedTuple

import numpy as np
from numba import njit

from sph.compiled import COMPILED
from sph.domain import Domain, Images
from sph.errors import NumericalError
from sph.neighbours import first_guess, lists, order, tree
from sph.neighbours.order import BLOCK
from sph.threads import Team

# Growth of support radii that lists allow between two builds. If exceeded, the pass is repeated.
GROWTH = 0.05

# Cost of a build (memory order and lists) divided by that of the two passes, and share of the
# passes that grows with the skin (copying listed blocks, and their selection). Measured in 3-D with
# 125 neighbours: (0.24 + 0.11) / (0.53 + 0.66) and 0.15 / (0.53 + 0.66) microseconds per particle.
BUILD_OVER_PASSES = 0.3
COPYING = 0.12

# Extent of the region of a list in support diameters: a superblock and H around it.
WIDTH = 1.8

# Number of steps that lists of particles almost at rest are made for. More would gain little.
MOST_STEPS = 20

# Share of superblocks above which all lists are built again instead of those that asked.
MANY = 0.3

# A support radius requests lists as wide as itself. After this many requests in a step,
# the guess was wrong by orders of magnitude (coincident particles), and the width is doubled.
PATIENCE = 4


class Origin(NamedTuple):
    """Data from which the lists were built and, with the memory order, can be rebuilt."""

    position: np.ndarray  # (D, N)
    support: np.ndarray  # (N,)
    skin: float


@njit(**COMPILED)
def motion(first, last, position, support, list_position, list_support, boxes):
    """Return the largest |r - r_list| / H_list and the largest H / H_list of blocks [first, last).

    boxes (blocks, 2 D) receives the lower and upper corners of the box of each block.
    """
    D, n = position.shape
    moved = 0.0
    grown = 0.0
    for block in range(first, last):
        a, b = block * BLOCK, min((block + 1) * BLOCK, n)
        for d in range(D):
            low = high = position[d, a]
            for i in range(a + 1, b):
                low = min(low, position[d, i])
                high = max(high, position[d, i])
            boxes[block, d], boxes[block, D + d] = low, high
        for i in range(a, b):
            squared = 0.0
            for d in range(D):
                squared += (position[d, i] - list_position[d, i]) ** 2
            moved = max(moved, squared / list_support[i] ** 2)
            grown = max(grown, support[i] / list_support[i])
    return np.sqrt(moved), grown


@njit(**COMPILED)
def _largest_step(first, last, velocity, support, dt):
    """Return the largest |v| dt / H of particles [first, last)."""
    D = velocity.shape[0]
    largest = 0.0
    for i in range(first, last):
        squared = 0.0
        for d in range(D):
            squared += velocity[d, i] ** 2
        largest = max(largest, squared / support[i] ** 2)
    return np.sqrt(largest) * dt


def best_skin(step: float, dimension: int, share: float = 1.0) -> float:
    """Return the skin with the lowest cost per step if particles move `step` supports in a step.

    Lists that serve k steps need a skin of GROWTH + 2 (k - 1) step. Each step then costs 1/k of a
    build, and the number of listed blocks grows as (1 + skin/WIDTH)^D. share: of the particles that
    a step computes. A superblock is copied if any of its blocks has such a particle.
    """
    copying = COPYING * min(1.0, lists.SUPERBLOCK * share)
    least, steps = np.inf, 1
    for k in range(1, round(MOST_STEPS / share) + 1):
        skin = GROWTH + 2 * (k - 1) * step
        cost = BUILD_OVER_PASSES / k + copying * (1 + skin / WIDTH) ** dimension
        if not cost < least:  # the costs are convex in k
            break
        least, steps = cost, k
    return GROWTH + 2 * (steps - 1) * step


class Search:
    """The candidate lists of particles in block order, and how far they are complete."""

    def __init__(self, domain: Domain, team: Team):
        self.domain = domain
        self.team = team
        self.origin: Origin | None = None
        self.lists: lists.Lists | None = None
        self.images: Images | None = None  # of the domain, which the lists refer to
        self.boxes: np.ndarray | None = None  # (blocks, 2 D) of the present positions
        self._room: np.ndarray | None = None  # that each chunk of the lists needed
        self.reach_factor = 0.0  # candidates are complete within this factor of the list support
        self._widenings = 0  # in this step

    def stale(self, position: np.ndarray, support: np.ndarray) -> bool:
        """Return whether particles have moved so far that the lists may miss a neighbour.

        A pair is listed if its distance was within (1 + skin) of the larger support. Both particles
        may have moved since. Also sets `reach_factor` for the passes.
        """
        self._widenings = 0
        origin = self.origin
        if self.lists is None or origin is None:
            return True
        found = self.team.chunks(
            motion, self.lists.first[-1], position, support, origin.position, origin.support,
            self.boxes,
        )  # fmt: skip
        moved, grown = map(max, zip(*found, strict=True))
        self.reach_factor = 1.0 + origin.skin - 2.0 * moved
        return not self.reach_factor > grown

    def skin_for(self, velocity: np.ndarray, support: np.ndarray, dt: float, share: float) -> float:
        """Return the skin for lists built now, for velocity (D, N), support (N,) and step dt.

        share: see `best_skin`.
        """
        steps = self.team.chunks(_largest_step, support.size, velocity, support, dt)
        return best_skin(max(steps), velocity.shape[0], share)

    def guess(self, position: np.ndarray, ratio: float) -> np.ndarray:
        """Supports (N,) to begin with, none so wide that lists cannot serve it."""
        least = 1e-9 * self.domain.largest_side  # where all particles are in one place
        most = min(self.domain.longest_reach / (1 + 2 * GROWTH), self.domain.largest_side)
        guess = np.clip(first_guess.from_spacing(position, ratio), least, most)
        first_guess.trim(position, ratio, least, guess)
        return guess

    def order(self, position: np.ndarray, identity: np.ndarray) -> np.ndarray:
        """Return the block order of the particles, (N,) indices."""
        if identity.size > lists.MAX_PARTICLES:
            raise NumericalError(
                f"{identity.size} particles: expected at most {lists.MAX_PARTICLES}, the limit of "
                "the candidate lists. Try: a smaller problem.n."
            )
        return order.block_order(position, identity, self.team)

    def build(self, origin: Origin, identity: np.ndarray) -> None:
        """Build the lists from `origin`, whose arrays are in block order and must not change."""
        self._check_reach(origin, identity)
        self.lists = self.boxes = None  # frees the old lists before the new ones are built
        builder = self._builder(origin)
        self.boxes = builder.boxes()
        self.lists, self._room = builder.all(self._room)
        self.origin = origin
        self.reach_factor = 1.0 + origin.skin

    def forget(self) -> None:
        """Free the lists and their origin, which are of no use after a change of memory order."""
        self.lists = self.boxes = self.origin = None

    def _builder(self, origin: Origin) -> lists.Builder:
        """Return the builder of the lists of `origin`.

        The tree is not kept: the lists need it again only where a support asks for wider ones.
        """
        assert self.images is not None
        boxes = tree.build(origin.position, origin.support)
        return lists.Builder(boxes, origin.skin, self.images, self.team)

    def _check_reach(self, origin: Origin, identity: np.ndarray) -> bool:
        """Set the images that `origin` needs; return whether they changed."""
        largest = int(np.argmax(origin.support))
        self.domain.check_reach(origin.support[largest], identity.size, int(identity[largest]))
        before = self.images
        self.images = self.domain.images_within((1 + origin.skin) * origin.support[largest])
        return self.images is not before

    def widen(self, wanted: np.ndarray, identity: np.ndarray) -> None:
        """Extend lists where blocks ask for `wanted` (blocks,) times the list support.

        Lists of other superblocks change only if the larger supports reach them.
        """
        assert self.origin is not None
        assert self.lists is not None
        self._widenings += 1
        asked = wanted > 0.0
        # where particles have moved, lists reach less far than the supports they are built for
        growth = (2.0 if self._widenings > PATIENCE else 1.0) / min(self.reach_factor, 1.0)
        factor = np.where(asked, wanted * growth, 1.0)
        support = self.origin.support * np.repeat(factor, BLOCK)[: identity.size]
        origin = self.origin._replace(support=support)
        changed = self._check_reach(origin, identity)
        first = self.lists.first
        own = np.logical_or.reduceat(asked, first[:-1])
        if changed or np.count_nonzero(own) > MANY * own.size:
            reach_factor, boxes = self.reach_factor, self.boxes
            self.build(origin, identity)
            self.reach_factor, self.boxes = reach_factor, boxes
            return
        self.origin = origin
        builder = self._builder(origin)
        self.lists = builder.again(self.lists, own)
        reached = lists.listed(self.lists, own)
        self.lists = builder.again(self.lists, reached & ~own)
