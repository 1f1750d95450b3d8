"""What a run costs: CPU seconds by phase, with compilation counted apart."""

import time
from contextlib import contextmanager

from numba.core import event


class Clock(event.Listener):
    """CPU seconds (user + system, all threads) by phase; compilation is a phase of its own."""

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
        """Count the time inside under `name`, less what was spent compiling."""
        begin, compiled = time.process_time(), self.compiling
        try:
            yield
        finally:
            spent = time.process_time() - begin - (self.compiling - compiled)
            self.seconds[name] = self.seconds.get(name, 0.0) + spent

    @property
    def wall(self) -> float:
        """Wall-clock seconds since the clock was made."""
        return time.perf_counter() - self.wall_start

    @property
    def cpu(self) -> float:
        """CPU seconds since the clock was made, compilation included."""
        return time.process_time() - self.cpu_start
