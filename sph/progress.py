"""Progress of a run or a sweep: a bar with the time left on a terminal, plain lines elsewhere."""

import os
import sys
import time

from sph import standard_streams

# Plain lines come at least this many seconds apart, so that a log stays short.
LINE_INTERVAL = 10.0


class Lines:
    """A line now and then, for logs."""

    def note(self, text):
        standard_streams.note(text)

    def start(self, begin, end):
        self.end = end
        self._from = None  # time simulated and clock at the end of the first step
        self._last = time.monotonic()

    def step(self, simulation):
        now = time.monotonic()
        if self._from is None:  # the first step may have compiled: it says nothing of the pace
            self._from = simulation.time, now
        if now - self._last < LINE_INTERVAL:
            return
        self._last = now
        self.note(
            f"step {simulation.step}, t = {simulation.time:.5g} of {self.end:.5g}, "
            f"dt = {simulation.limit.dt:.3g}{self._left(simulation.time, now)}"
        )

    def _left(self, simulated, now):
        begin, started = self._from
        if not simulated > begin:
            return ""
        left = (now - started) * (self.end - simulated) / (simulated - begin)
        return f", about {left:.0f} s left" if left < 1e9 else f", about {left:.1e} s left"

    def wrote(self, path, simulation):
        self.note(f"t = {simulation.time:.6g}: wrote {path.name}")

    def close(self): ...


class Bar(Lines):
    """A bar over the simulated time."""

    FORMAT = "{percentage:3.0f}%|{bar}| {desc} [{elapsed}, {remaining} left]"

    def start(self, begin, end):
        import tqdm

        self.begin, self.end = begin, end
        self._bar = tqdm.tqdm(total=end - begin, bar_format=self.FORMAT, leave=False)

    def step(self, simulation):
        self._bar.set_description_str(
            f"t = {simulation.time:.4g} of {self.end:.4g}, step {simulation.step}, "
            f"dt {simulation.limit.dt:.2g}",
            refresh=False,
        )
        # set, not added up: a sum of rounded parts may pass the total, of which tqdm warns
        self._bar.n = simulation.time - self.begin
        self._bar.update(0)

    def wrote(self, path, simulation): ...

    def close(self):
        if hasattr(self, "_bar"):
            self._bar.close()


class PointLines:
    """A line for each point of a sweep that has ended."""

    def note(self, text):
        standard_streams.note(text)

    def ended(self, count): ...

    def close(self): ...


class PointBar(PointLines):
    """The same above a bar over the points."""

    FORMAT = "{percentage:3.0f}%|{bar}| {n_fmt} of {total_fmt} points [{elapsed}, {remaining} left]"

    def __init__(self, points, ended):
        import tqdm

        # what an earlier call has done says nothing of the pace of this one
        self._bar = tqdm.tqdm(total=points, initial=ended, bar_format=self.FORMAT, leave=False)

    def note(self, text):
        self._bar.write(text, file=sys.stderr)

    def ended(self, count):
        self._bar.update(count - self._bar.n)

    def close(self):
        self._bar.close()


def suited():
    """A bar where someone is watching a terminal, lines otherwise."""
    return Bar() if _is_watched() else Lines()


def suited_to_points(points, ended):
    """The same for a sweep of so many points, of which so many have ended."""
    return PointBar(points, ended) if _is_watched() else PointLines()


def _is_watched():
    try:
        # some pseudo-terminals have no width, and no bar would show on them
        return sys.stderr.isatty() and os.get_terminal_size(sys.stderr.fileno()).columns > 0
    except (AttributeError, OSError, ValueError):  # there is no stderr, or it is closed
        return False
