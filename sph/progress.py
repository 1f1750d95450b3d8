"""Progress of a run: a bar with the time left on a terminal, plain lines elsewhere."""

import sys
import time

# Plain lines come at least this many seconds apart, so that a log stays short.
LINE_INTERVAL = 10.0


class Quiet:
    """Says nothing."""

    def start(self, begin, end): ...
    def step(self, simulation): ...
    def wrote(self, path, simulation): ...
    def close(self): ...


class Lines(Quiet):
    """A line now and then, for logs."""

    def __init__(self, stream=None):
        self.stream = stream or sys.stderr
        self._last = time.monotonic()

    def start(self, begin, end):
        self.begin, self.end = begin, end
        self._started = time.monotonic()

    def step(self, simulation):
        now = time.monotonic()
        if now - self._last < LINE_INTERVAL:
            return
        self._last = now
        done = (simulation.time - self.begin) / (self.end - self.begin)
        left = (now - self._started) * (1 - done) / done
        print(
            f"step {simulation.step}, t = {simulation.time:.5g} of {self.end:.5g} "
            f"({100 * done:.0f} %), dt = {simulation.limit.dt:.3g}, about {left:.0f} s left",
            file=self.stream,
            flush=True,
        )

    def wrote(self, path, simulation):
        print(f"t = {simulation.time:.6g}: wrote {path.name}", file=self.stream, flush=True)


class Bar(Quiet):
    """A bar over the simulated time."""

    FORMAT = "{percentage:3.0f}%|{bar}| t = {postfix} [{elapsed}, {remaining} left]"

    def start(self, begin, end):
        import tqdm

        self.begin, self.end = begin, end
        self._bar = tqdm.tqdm(total=end - begin, bar_format=self.FORMAT, leave=False)

    def step(self, simulation):
        self._bar.set_postfix_str(
            f"{simulation.time:.4g} of {self.end:.4g}, step {simulation.step}, "
            f"dt {simulation.limit.dt:.2g}",
            refresh=False,
        )
        self._bar.update(simulation.time - self.begin - self._bar.n)

    def close(self):
        if hasattr(self, "_bar"):
            self._bar.close()


def suited():
    """A bar where someone is watching a terminal, lines otherwise."""
    return Bar() if sys.stderr.isatty() else Lines()
