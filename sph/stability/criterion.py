"""When a run is stable: its errors, energy and limits, compared with small time steps."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sph.analysis.errors import FIELDS, norms
from sph.config.errors import suggestion
from sph.errors import ConfigError, NumericalError, first_line
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import Checkpoint
from sph.output.run_directory import RunDirectory
from sph.problems.base import Limit
from sph.summary import Summary, figure

NONE = float("nan")


class Criterion(NamedTuple):
    """The criteria of stability; every default stands here alone."""

    # C of the reference run, as a part of the configuration's: errors of the step fall as C^2, so
    # that what a quarter leaves of them is small beside what error_growth allows.
    reference: float = 0.25
    # L1 error of any field, and energy drift, over the reference's: a half more is well above what
    # the order of sums does, and well below what a run does that blows up.
    error_growth: float = 1.5
    # Without an exact solution: L1 of the difference from the reference, particle by particle, as
    # a part of the field's mean size (of |v| + c_s for velocity); and of each figure of the report,
    # as a part of itself: a mode may be lost that is small beside the flow.
    deviation: float = 0.05
    # With an exact solution: errors below this part of the field's mean size do not count, however
    # small the reference's are; nor do such differences of a figure. The default is round-off.
    negligible: float = 1e-9
    # Factor between the last stable and the first unstable value at which bisection ends.
    resolution: float = 1.1

    @classmethod
    def of(cls, texts) -> "Criterion":
        """The defaults with `KEY=VALUE` set on top. Raises ConfigError."""
        values = {}
        for text in texts:
            key, _, value = text.partition("=")
            if key not in cls._fields:
                raise ConfigError(f"--limit {text}: unknown; {suggestion(key, cls._fields)}")
            values[key] = _positive(text, value, above=1.0 if key in ABOVE_ONE else 0.0)
        if values.get("reference", 0.0) > 1.0:
            raise ConfigError("--limit reference: expected at most 1, of the configuration's C")
        return cls(**values)


ABOVE_ONE = ("error_growth", "resolution")


@dataclass(frozen=True)
class Trial:
    """A run at a value of the key, and its verdict."""

    value: float
    name: str  # its directory
    verdict: str  # "stable", "beyond" a limit, or "failed": the run stopped itself
    reason: str  # in words; empty where it is stable
    error: float  # the field nearest to its limit or farthest beyond, over that limit
    field: str  # which that is
    drift: float  # largest |E - E_0|/|E_0| at any step
    time: float  # reached
    steps: int
    cpu: float  # CPU seconds

    @property
    def is_stable(self) -> bool:
        return self.verdict == "stable"


class Judge:
    """Judges runs against a reference run of the same particles."""

    def __init__(self, reference: Path, criterion: Criterion, holds_report: bool = True):
        """Raises NumericalError where the reference run itself failed, and FileError.

        holds_report: whether figures of the report must be the reference's where nothing is exact.
        """
        self.directory = reference
        self.summary = RunDirectory(reference).whole_summary()
        if self.summary["status"] != "done":
            raise NumericalError(
                f"the reference run {reference.name} fails: {self.summary['reason']}\nTry: "
                "--limit reference with a smaller part of C, or other settings with --set."
            )
        self.state = _last(reference)
        self.criterion = criterion
        self.drift = self._largest_drift()
        self.errors = self._largest_errors()
        self.figures = self._limits_of_figures()
        self.report = {}
        if holds_report and not self.has_exact:
            self.report = self._numbers(self.summary)

    @property
    def has_exact(self) -> bool:
        return self.summary["errors"] is not None

    def trial(self, value: float, directory: Path) -> Trial:
        """The trial from the run in `directory`, which has ended. Raises FileError."""
        summary = RunDirectory(directory).whole_summary()
        drift = summary["conservation"]["energy_drift_max"]
        numbers = (drift, summary["time"], summary["steps"], summary["cost"]["cpu_seconds"])
        if summary["status"] == "failed":
            reason = first_line(summary["reason"] or "")
            return Trial(value, directory.name, "failed", reason, NONE, "", *numbers)
        errors = self._errors(summary, directory)
        field = max(errors, key=lambda name: _closeness(errors[name] / self.errors[name]))
        error = errors[field] / self.errors[field]
        broken = []
        if not error <= 1.0:
            broken.append(f"the error of {field.replace('_', ' ')} is {error:.3g} of its limit")
        if not drift <= self.drift:
            broken.append(f"energy drifts by {drift:.2g}, more than {self.drift:.2g}")
        for name, limit in self.figures.items():
            own = _figure(summary, name)
            if not limit.holds(own):
                side = "less" if limit.at_least else "more"
                bound = f"{side} than {limit.bound:.3g}"
                broken.append(f"{name.replace('_', ' ')} is {own:.3g}, {bound}")
        broken += self._other_figures(summary)
        verdict = "beyond" if broken else "stable"
        return Trial(
            value, directory.name, verdict, " and ".join(broken), error, field, *numbers
        )  # fmt: skip

    def in_words(self) -> str:
        """The criteria, in words."""
        if self.has_exact:
            errors = (
                f"L1 errors of all fields at most {self.criterion.error_growth:g} times those at "
                f"C = {self._courant:g}"
            )
        else:
            what = "fields and figures of the report" if self.report else "fields"
            errors = (
                f"{what} within {self.criterion.deviation:.0%} of the run at C = {self._courant:g}"
            )
        figures = "".join(
            f", {name.replace('_', ' ')} at {'least' if limit.at_least else 'most'} "
            f"{limit.bound:.3g}"
            for name, limit in self.figures.items()
        )
        return f"it ends, {errors}, energy drift at most {self.drift:.2g}{figures}"

    @property
    def _courant(self) -> float:
        return self.state.config.physics.C

    def _largest_drift(self) -> float:
        """The problem's limit, or error_growth times what the reference does where that is more."""
        limit = self.state.config.problem.limits.get("energy_drift")
        bound = self.state.config.physics.max_energy_drift if limit is None else limit.bound
        own = self.summary["conservation"]["energy_drift_max"]
        return max(bound, self.criterion.error_growth * own)

    def _limits_of_figures(self) -> dict[str, Limit]:
        """The problem's other limits, or error_growth times what the reference has beyond one.

        Over error_growth where the figure must not fall below. Without figures that the reference
        lacks, because it is too short for them.
        """
        found, growth = {}, self.criterion.error_growth
        for name, limit in self.state.config.problem.limits.items():
            own = _figure(self.summary, name)
            if name == "energy_drift" or name.startswith("l1.") or own != own:
                continue
            beyond = own / growth if limit.at_least else own * growth
            found[name] = limit if limit.holds(own) else limit._replace(bound=beyond)
        return found

    def _other_figures(self, summary: Summary) -> list[str]:
        """Words for figures of the report that are not the reference's, where nothing is exact."""
        found, figures, criterion = [], self._numbers(summary), self.criterion
        for name, own in self.report.items():
            value = figures.get(name, NONE)
            if not abs(value - own) <= criterion.deviation * abs(own) + criterion.negligible:
                found.append(f"{name.replace('_', ' ')} is {value:.3g}, the reference's {own:.3g}")
        return found

    @staticmethod
    def _numbers(summary: Summary) -> dict[str, float]:
        return summary["report"] or {}

    def _largest_errors(self) -> dict[str, float]:
        """The largest L1 error that a stable run has, by field."""
        sizes = _sizes(self.state)
        if not self.has_exact:
            return {name: self.criterion.deviation * size for name, size in sizes.items()}
        growth, negligible = self.criterion.error_growth, self.criterion.negligible
        fields = self.summary["errors"]["fields"] if self.summary["errors"] else {}
        return {
            name: max(growth * norm["L1"], negligible * sizes[name])
            for name, norm in fields.items()
        }

    def _errors(self, summary: Summary, directory: Path) -> dict[str, float]:
        """L1 errors by field: against the exact solution, or else against the reference."""
        if self.has_exact:
            return {name: _figure(summary, f"l1.{name}") for name in self.errors}
        state = _last(directory)
        own = self.state
        volume = own.by_id(own.particles.mass / own.particles.density)
        return {
            name: norms(state.by_id(state.field(name)) - own.by_id(own.field(name)), volume)["L1"]
            for name in self.errors
        }


def _figure(summary: Summary, name: str) -> float:
    """The figure that a limit of that name holds; NaN where the run has no such figure."""
    value = figure(summary, name)
    return NONE if value is None else value


def _last(directory: Path) -> Checkpoint:
    return checkpoints.read(RunDirectory(directory).checkpoints()[-1])


def _sizes(state: Checkpoint) -> dict[str, float]:
    """Mean size of each field over the volume; of |v| + c_s for velocity, which may be zero."""
    p = state.particles
    volume = p.mass / p.density
    sound = state.config.physics.eos_model().sound_speed(p.density, state.pressure)
    sizes = {name: state.field(name) for name in FIELDS}
    sizes["velocity"] = np.linalg.norm(p.velocity, axis=0) + sound
    return {name: norms(size, volume)["L1"] for name, size in sizes.items()}


def _closeness(value: float) -> float:
    """`value` as a sort key: NaN counts as infinite."""
    return value if value == value else float("inf")


def _positive(text: str, value: str, above: float) -> float:
    try:
        number = float(value)
    except ValueError:
        number = NONE
    if not (above < number < float("inf")):
        raise ConfigError(f"--limit {text}: expected a number above {above:g}")
    return number
