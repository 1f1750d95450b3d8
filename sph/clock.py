"""What a run costs, in time. What the words mean is defined in `sph.summary`."""

import time
from contextlib import contextmanager

from numba.core import event

# The phase in which Numba fills its tables, on first use. It is no part of `Clock.cpu`.
STARTING = "start of Numba"


class Clock(event.Listener):
    """CPU seconds of a session and its phases; compilation and the start of Numba are apart.

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

    @contextmanager
    def phase(self, name: str):
        """Add the CPU time of the block to the phase `name`, without compilation."""
        begin, compiled = time.process_time(), self.compiling
        try:
            yield
        finally:
            spent = time.process_time() - begin - (self.compiling - compiled)
            self.seconds[name] = self.seconds.get(name, 0.0) + spent

    @property
    def wall(self) -> float:
        """Wall-clock seconds since the clock was made, with compilation and the start of Numba."""
        return time.perf_counter() - self.wall_start

    @property
    def cpu(self) -> float:
        """CPU seconds since the clock was made: without compilation and the start of Numba."""
        apart = self.compiling + self.seconds.get(STARTING, 0.0)
        return time.process_time() - self.cpu_start - apart
