"""Progress of one run or of many: a bar with the time left on a terminal, else plain lines."""

import os
import sys
import time

from sph import standard_streams

# Plain lines are at least this many seconds apart, so that a log stays short.
LINE_INTERVAL = 10.0


class Messages:
    """What every kind of progress can do: a line on stderr.

    Of one run, `step` and `wrote` return None, or why the run is to stop. each_step: whether `step`
    is called after each time step; otherwise, a call may follow several steps.
    """

    each_step = False

    def note(self, text):
        standard_streams.note(text)

    def close(self): ...


class Lines(Messages):
    """Of one run: a line every LINE_INTERVAL, for logs."""

    def start(self, begin, end):
        self.end = end
        self._from = None  # time simulated and clock at the end of the first step
        self._last = time.monotonic()

    def step(self, simulation):
        now = time.monotonic()
        if self._from is None:  # later steps are faster: the first one may have compiled
            self._from = simulation.time, now
        if now - self._last < LINE_INTERVAL:
            return
        self._last = now
        self.note(
            f"step {simulation.step}, t = {simulation.time:.5g} of {self.end:.5g}, "
            f"dt = {simulation.limit.dt:.3g}{self._left(simulation.time, now)}"
        )

    def _left(self, simulated, now):
        begin, started = self._from or (simulated, now)
        if not simulated > begin:
            return ""
        left = (now - started) * (self.end - simulated) / (simulated - begin)
        return f", about {left:.0f} s left" if left < 1e9 else f", about {left:.1e} s left"

    def wrote(self, path, simulation):
        self.note(f"t = {simulation.time:.6g}: wrote {path.name}")


class Bar(Lines):
    """Of one run: a bar over the simulated time."""

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


class RunLines(Messages):
    """Of many runs: a line for each run that ends."""

    def __init__(self, what: str, total: int | None, done: int):
        """what: the runs are called so, in the plural; total: None where it is not known before.

        done: the number of runs that ended in an earlier call.
        """
        self.what, self.total, self.done = what, total, done
        if done:
            self.note(f"{done} of {total} {what} are done already")

    def ended(self, text):
        """A run has ended, as `text` says."""
        self.done += 1
        count = "" if self.total is None else f"[{self.done:{len(str(self.total))}d}/{self.total}] "
        self.note(f"{count}{text}")


class RunBar(RunLines):
    """Of many runs: the same lines above a bar over the runs."""

    FORMAT = "{percentage:3.0f}%|{bar}| {n_fmt} of {total_fmt} {unit} [{elapsed}, {remaining} left]"

    def __init__(self, what: str, total: int, done: int):
        import tqdm

        # `initial`: the runs of an earlier call do not count for the pace of this one
        self._bar = tqdm.tqdm(
            total=total, initial=done, unit=what, bar_format=self.FORMAT, leave=False
        )
        super().__init__(what, total, done)

    def note(self, text):
        self._bar.write(text, file=sys.stderr)

    def ended(self, text):
        super().ended(text)
        self._bar.update()

    def close(self):
        self._bar.close()


class Iterations(Messages):
    """Of an iteration towards a residual: a line every LINE_INTERVAL."""

    def __init__(self, what: str, most: int):
        """what: what is done, as a participle; most: the largest number of iterations."""
        self.what, self.most, self._last = what, most, time.monotonic()

    def step(self, count, residual):
        if time.monotonic() - self._last >= LINE_INTERVAL:
            self._last = time.monotonic()
            self.note(
                f"{self.what}: iteration {count} of at most {self.most}, residual {residual:.2e}"
            )


class IterationBar(Iterations):
    """Of an iteration towards a residual: a bar over the iterations."""

    FORMAT = "{percentage:3.0f}%|{bar}| {desc} [{elapsed}, at most {remaining} left]"

    def __init__(self, what: str, most: int):
        import tqdm

        super().__init__(what, most)
        self._bar = tqdm.tqdm(total=most, bar_format=self.FORMAT, leave=False)

    def note(self, text):
        self._bar.write(text, file=sys.stderr)

    def step(self, count, residual):
        self._bar.set_description_str(f"{self.what}, residual {residual:.2e}", refresh=False)
        self._bar.update(count - self._bar.n)

    def close(self):
        self._bar.close()


class Pictures(Messages):
    """Of pictures of a movie: a line every LINE_INTERVAL."""

    def start(self, total: int):
        """`total` pictures are to be drawn."""
        self.total, self.done, self._last = total, 0, time.monotonic()

    def drew(self):
        """One more is drawn."""
        self.done += 1
        if time.monotonic() - self._last >= LINE_INTERVAL:
            self._last = time.monotonic()
            self.note(f"drew {self.done} of {self.total} pictures")


class PictureBar(Pictures):
    """Of pictures of a movie: a bar over the pictures."""

    def start(self, total: int):
        import tqdm

        super().start(total)
        self._bar = tqdm.tqdm(total=total, unit="pictures", bar_format=RunBar.FORMAT, leave=False)

    def drew(self):
        self._bar.update()

    def close(self):
        if hasattr(self, "_bar"):
            self._bar.close()


def suited() -> Lines:
    """Progress of one run: a bar on a terminal, lines elsewhere."""
    return Bar() if _is_watched() else Lines()


def suited_to_runs(what: str, total: int | None, done: int = 0) -> RunLines:
    """Progress of many runs, see `RunLines`: a bar on a terminal, lines elsewhere."""
    if total is None or not _is_watched():
        return RunLines(what, total, done)
    return RunBar(what, total, done)


def suited_to_iterations(what: str, most: int) -> Iterations:
    """Progress of an iteration, see `Iterations`: a bar on a terminal, lines elsewhere."""
    return IterationBar(what, most) if _is_watched() else Iterations(what, most)


def suited_to_pictures() -> Pictures:
    """Progress of a movie: a bar on a terminal, lines elsewhere."""
    return PictureBar() if _is_watched() else Pictures()


def _is_watched():
    try:
        # some pseudo-terminals have no width, and no bar would show on them
        return sys.stderr.isatty() and os.get_terminal_size(sys.stderr.fileno()).columns > 0
    except (AttributeError, OSError, ValueError):  # there is no stderr, or it is closed
        return False
