"""The states of a run that `--time` asks for."""

import bisect
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from sph.analysis.figures.sources import Source, State
from sph.errors import ConfigError
from sph.output import checkpoint, frames

BEYOND = 0.01  # of the time of a run: nearer to its ends, a time is rounded rather than wrong
SAME_TIME = 1e-4  # times that differ by a smaller part look equal in a title

Outputs = tuple[Sequence[Path], Callable[[Path], State]]  # in order of time, and what reads them


def states_at(source: Source, times: Sequence[float], say: Callable[[str], object]) -> list[State]:
    """The state nearest to each of `times`, in order and once each; the last without times.

    say: is called with a line for each time that is not the one wanted. Raises ConfigError for a
    time before or after the run, FileError for what is missing or damaged.
    """
    if not times:
        return [source.last()]
    outputs, found = _outputs(source), {}
    for time in times:
        _check(source, outputs, time)
        # the first of two that are equally near: a checkpoint has double precision
        state = min((_nearest(one, time) for one in outputs), key=lambda s: abs(s.time - time))
        found[state.time] = state
        if not np.isclose(state.time, time, rtol=SAME_TIME, atol=0.0):
            say(f"--time {time:g}: the nearest checkpoint or frame is that of t = {state.time:.6g}")
    return [found[time] for time in sorted(found)]


def _outputs(source: Source) -> list[Outputs]:
    """Checkpoints, and frames if the source is a run that has some."""
    found: list[Outputs] = [(source.checkpoints, lambda path: State(checkpoint.read(path)))]
    paths = source.run.frames.paths() if source.run and source.is_run else []
    if paths:
        config = source.last().checkpoint.config
        found.append((paths, lambda path: State(frames.read(path, config))))
    return found


def _check(source: Source, outputs: Sequence[Outputs], time: float) -> None:
    """Raise ConfigError if `time` is before or after all outputs."""
    first = min(read(paths[0]).time for paths, read in outputs)
    last = max(read(paths[-1]).time for paths, read in outputs)
    margin = BEYOND * ((last - first) or abs(last))
    if not first - margin <= time <= last + margin:
        there = f"from {first:.6g} to {last:.6g}" if last > first else f"{last:.6g}"
        raise ConfigError(f"--time {time:g}: {source.path} has no such time; expected {there}.")


def _nearest(outputs: Outputs, time: float) -> State:
    paths, read = outputs
    after = bisect.bisect_left(paths, time, key=lambda path: read(path).time)
    states = map(read, paths[max(after - 1, 0) : after + 1])
    return min(states, key=lambda state: abs(state.time - time))
