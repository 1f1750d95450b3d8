"""A search, from the command line to its result."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from sph.errors import ConfigError
from sph.stability import search
from sph.stability.criterion import Criterion, Judge, Trial
from sph.stability.search import Edge, Stride
from sph.stability.trials import Trials
from sph.sweep.local import available_processors


class Key(NamedTuple):
    """How the ends of the stable range of a key are searched: strides from the configured value."""

    strides: dict[str, Stride]  # by the name of the end


# C: 64 times the default is more than one step for most runs. eta: down to a third, below one
# neighbour in 1-D, and up to three times as many in 1-D, 27 times in 3-D.
KEYS = {
    "physics.C": Key({"largest": Stride(2.0, 6)}),
    "physics.eta": Key({"smallest": Stride(1 / 1.4, 3), "largest": Stride(1.4, 3)}),
}


@dataclass(frozen=True)
class Found:
    """The result of a search."""

    config: str
    key: str
    default: float
    scheme: str
    problem: str
    particles: int
    end: float  # of the runs
    whole_end: float  # of the configuration file
    judge: Judge
    edges: dict[str, Edge]  # by the name of the end
    trials: tuple[Trial, ...]  # by value

    def at(self, value: float) -> Trial:
        """The trial of that value."""
        return next(trial for trial in self.trials if trial.value == value)

    def islands(self, end: str) -> list[float]:
        """Stable values beyond an end of the range."""
        outside = self.edges[end].outside
        if outside is None:
            return []
        stable = (trial.value for trial in self.trials if trial.is_stable)
        beyond = outside.__lt__ if end == "largest" else outside.__gt__
        return [value for value in stable if beyond(value)]


def run(
    config: Path, key: str, overrides: Sequence[str], directory: Path,
    limits: Sequence[str] = (), jobs: int | None = None,
) -> Found:  # fmt: skip
    """Search the stable range of `key`, one of KEYS. Raises ConfigError, and as `Trials`."""
    if key not in KEYS:
        raise ConfigError(f"--key {key}: expected one of {', '.join(KEYS)}")
    criterion, jobs = Criterion.of(limits), jobs or available_processors()
    trials = Trials(config, key, overrides, directory, criterion, jobs)
    edges = {
        end: search.find(trials.are_stable, trials.default, stride, criterion.resolution, jobs)
        for end, stride in KEYS[key].strides.items()
    }
    resolved = trials.config
    return Found(
        config.stem, key, trials.default, resolved.physics.scheme, resolved.problem.name,
        trials.judge.summary["particles"], resolved.time.end, trials.whole_end,
        trials.judge, edges,
        tuple(trials.done[value] for value in sorted(trials.done)),
    )  # fmt: skip
