"""A team of threads that share a pass over blocks.

Compiled passes release the interpreter's lock, so plain Python threads run them side by side.
Every particle is written by the one range that holds it, so the split does not show in the result.
"""

from concurrent.futures import ThreadPoolExecutor

# Below this many items a range is not worth handing to another thread (about 50 microseconds).
SMALLEST_RANGE = 64


class Team:
    """`threads` threads; with one, everything runs in the caller."""

    def __init__(self, threads: int):
        self.threads = threads
        self._pool = ThreadPoolExecutor(threads, "sph") if threads > 1 else None

    def run(self, function, items: int, *arguments) -> None:
        """Call function(first, last, *arguments) over ranges that cover [0, items)."""
        if self._pool is None or items < 2:
            function(0, items, *arguments)
            return
        # four ranges a thread even out regions that cost more than others
        ranges = min(4 * self.threads, max(1, items // SMALLEST_RANGE), items)
        edges = [items * k // ranges for k in range(ranges + 1)]
        calls = [
            self._pool.submit(function, first, last, *arguments)
            for first, last in zip(edges[:-1], edges[1:], strict=True)
        ]
        for call in calls:
            call.result()

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown()
