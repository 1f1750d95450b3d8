"""A team of threads that share a pass over blocks.

Compiled passes release the interpreter's lock, so plain Python threads run them side by side.
Every particle is written by the one range that holds it, so the split does not show in the result.
"""

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

# Blocks below which a range is not worth handing to another thread: handing over costs some 50
# microseconds, and 256 blocks of eight particles are 600 of them in 1-D, 5000 in 3-D.
SMALLEST_RANGE = 256


def available_processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Team:
    """`threads` threads; with one, everything runs in the caller."""

    def __init__(self, threads: int):
        self.threads = threads
        self._pool = ThreadPoolExecutor(threads, "sph") if threads > 1 else None

    def run(
        self, function: Callable[..., None], items: int, *arguments: Any,
        smallest: int = SMALLEST_RANGE,
    ) -> None:  # fmt: skip
        """Call function(first, last, *arguments) over ranges that cover [0, items).

        No range is shorter than `smallest` items.
        """
        # four ranges a thread even out regions that cost more than others
        ranges = min(4 * self.threads, items // smallest)
        if self._pool is None or ranges < 2:
            function(0, items, *arguments)
            return
        edges = [items * k // ranges for k in range(ranges + 1)]
        calls = [
            self._pool.submit(function, first, last, *arguments)
            for first, last in itertools.pairwise(edges)
        ]
        for call in calls:
            call.result()

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown()
