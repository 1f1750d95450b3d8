"""Measurement of CPU and wall-clock time by phase. `sph.summary` defines the terms."""

import time
from collections.abc import Sequence

import numpy as np
from numba.core import event

# The phase in which Numba starts, on first use. `Clock.cpu` does not contain this phase.
STARTING = "start of Numba"

# The phase in which the problem makes its particles, or relaxes them.
PLACING = "initial state"

SHORTEST = 1e-9  # seconds: the clock's resolution


class Clock(event.Listener):
    """CPU seconds of a session and its phases; compilation and the start of Numba count apart.

    seconds: of each phase, without compilation; `STARTING` is one of them.
    compiling: CPU time (user + system, all threads) of compilation.
    """

    def __init__(self):
        self.seconds: dict[str, float] = {}
        self.wall_start = time.perf_counter()
        self.cpu_start = time.process_time()
        self.compiling = 0.0
        self.on_compilation = None  # called once, when the first function begins to compile
        self._depth = 0
        self._began = 0.0
        event.register("numba:compile", self)

    def close(self) -> None:
        event.unregister("numba:compile", self)

    def on_start(self, event):
        if self._depth == 0:
            self._began = time.process_time()
        if told := self.on_compilation:
            self.on_compilation = None
            told()
        self._depth += 1

    def on_end(self, event):
        self._depth -= 1
        if self._depth == 0:
            self.compiling += time.process_time() - self._began

    def phase(self, name: str) -> "Phase":
        """Add the CPU time of a `with` block to the phase `name`, without compilation."""
        return Phase(self, name)

    def divide(self, spent: float, names: Sequence[str], shares: np.ndarray) -> None:
        """Divide CPU seconds among phases, in proportion to `shares`."""
        scale = spent / max(float(shares.sum()), SHORTEST)
        for name, share in zip(names, shares.tolist(), strict=True):
            self.seconds[name] = self.seconds.get(name, 0.0) + scale * share

    @property
    def wall(self) -> float:
        """Wall-clock seconds since the clock was made, with compilation and the start of Numba."""
        return time.perf_counter() - self.wall_start

    @property
    def cpu(self) -> float:
        """CPU seconds since the clock was made: without compilation and the start of Numba."""
        apart = self.compiling + self.seconds.get(STARTING, 0.0)
        return time.process_time() - self.cpu_start - apart


class Phase:
    """A context whose CPU seconds go to a clock.

    Not a generator: a step of a small run has seven phases, which would cost 2 microseconds each.
    """

    __slots__ = ("began", "clock", "compiled", "name")

    def __init__(self, clock: Clock, name: str):
        self.clock, self.name = clock, name

    def __enter__(self):
        self.compiled = self.clock.compiling
        self.began = time.process_time()

    def __exit__(self, *_):
        clock, name = self.clock, self.name
        spent = time.process_time() - self.began - (clock.compiling - self.compiled)
        clock.seconds[name] = clock.seconds.get(name, 0.0) + spent
