"""A team of threads that share a pass over blocks of particles, or a loop over particles.

Compiled functions release Python's global interpreter lock, so ordinary threads run them in
parallel. Each particle belongs to exactly one range, so results do not depend on the number of
threads.
"""

import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

# Smallest number of blocks in a range. Starting a range in another thread costs about 50
# microseconds; a pass over 256 blocks of eight particles takes 600 in 1-D and 5000 in 3-D.
SMALLEST_RANGE = 256

# Number of particles in a chunk. Every sum over particles is a sum over each chunk, and then over
# chunks in order. A loop over a chunk takes 10 to 100 microseconds. At most 10000, above which BLAS
# shares a product between threads of its own (`State.total`).
CHUNK = 8192


def available_processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Team:
    """A number of threads, one of which is the calling thread."""

    def __init__(self, threads: int):
        self.threads = threads
        self._pool = ThreadPoolExecutor(threads - 1, "sph") if threads > 1 else None

    def run(
        self, function: Callable[..., Any], items: int, *arguments: Any,
        smallest: int = SMALLEST_RANGE,
    ) -> list[Any]:  # fmt: skip
        """Call function(first, last, *arguments) for ranges that cover [0, items).

        No range is shorter than `smallest` items. Returns the results in the order of ranges, whose
        number depends on the number of threads.
        """
        # four ranges per thread balance the load where some ranges cost more than others
        ranges = min(4 * self.threads, items // smallest)
        if self._pool is None or ranges < 2:
            return [function(0, items, *arguments)]
        return self._share(function, [items * k // ranges for k in range(ranges + 1)], arguments)

    def chunks(self, function: Callable[..., Any], items: int, *arguments: Any) -> list[Any]:
        """As `run`, for ranges of CHUNK items, whatever the number of threads."""
        if items <= CHUNK:
            return [function(0, items, *arguments)]
        return self._share(function, [*range(0, items, CHUNK), items], arguments)

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown()

    def _share(
        self, function: Callable[..., Any], edges: Sequence[int], arguments: tuple[Any, ...]
    ) -> list[Any]:
        """Call function(first, last, *arguments) for ranges between consecutive edges."""
        results: list[Any] = [None] * (len(edges) - 1)
        ranges = iter(list(enumerate(itertools.pairwise(edges))))

        def work() -> None:
            for k, (first, last) in ranges:  # each thread takes the next (a step of list iterators
                results[k] = function(first, last, *arguments)  # is atomic)

        helpers = []
        if self._pool is not None:
            number = min(self.threads, len(results)) - 1
            helpers = [self._pool.submit(work) for _ in range(number)]
        try:
            work()
        finally:
            for helper in helpers:
                if not helper.cancel():  # one that has not begun is not waited for
                    helper.result()
        return results


ALONE = Team(1)  # the calling thread
