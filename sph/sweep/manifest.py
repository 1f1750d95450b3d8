"""The directory of a sweep: its configuration, its points, and their runs.

    base.toml    the configuration, as the user gave it but for absolute paths
    sweep.toml   the keys that are set and varied, and the points by name
    logs/        a log for each point, and the reason of its last failure
    <point>/     a run directory

Neither file says which points have ended: the run directories do.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path

from sph import config as configuration
from sph.config import Config
from sph.config.copies import read_to_copy
from sph.config.toml_text import key_text, value_text
from sph.errors import ConfigError, FileError, first_line
from sph.output.files import (
    explained,
    is_unfinished,
    opened,
    read_text,
    refuse_link,
    write_text,
)
from sph.output.run_directory import RunDirectory
from sph.sweep.plan import Plan, Point
from sph.version import __version__

HEADER = "# A sweep of sph: base.toml with these keys varied. Each point is a run directory.\n\n"
OTHER_DIRECTORY = "Try: another directory, with -o."


@dataclass(frozen=True)
class SweepDirectory:
    """Paths in the directory of a sweep."""

    path: Path

    @property
    def base(self) -> Path:
        return self.path / "base.toml"

    @property
    def manifest(self) -> Path:
        return self.path / "sweep.toml"

    @property
    def logs(self) -> Path:
        return self.path / "logs"

    @property
    def is_one(self) -> bool:
        return self.manifest.is_file()

    def plan(self) -> Plan:
        """The plan in sweep.toml. Raises FileError where it cannot be read."""
        try:
            found = tomllib.loads(read_text(self.manifest))
            points = tuple(Point(name, _texts(one)) for name, one in found["points"].items())
            varied = {key: list(_texts(values)) for key, values in found["vary"].items()}
            return Plan(_texts(found["set"]), varied, points)
        except OSError as error:
            raise FileError(f"{self.manifest} cannot be read: {error.strerror}") from None
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise FileError(
                f"{self.manifest} is not the manifest of a sweep.\n{OTHER_DIRECTORY}"
            ) from None

    def prepare(self, config: Path, plan: Plan) -> None:
        """Create the directory of that sweep; in an existing one, check the plan and add points.

        Raises ConfigError where a point is invalid, or its configuration differs from the one in
        this directory; FileError where the directory holds other files or cannot be written. In
        these cases nothing is changed.
        """
        resolved = plan.resolved(config)
        with explained(f"cannot write to {self.path}"):
            if self.is_one:
                plan = self._extended(plan, resolved)
            elif self.path.exists():
                self._refuse_other_things(read_to_copy(config))
            self._refuse_other_runs(resolved)
            refuse_link(self.logs)
            self.logs.mkdir(parents=True, exist_ok=True)
        if not self.is_one:
            write_text(self.base, read_to_copy(config))
        write_text(self.manifest, _text(plan))

    def failures(self) -> dict[str, str]:
        """Why the last attempt of a point failed, by name of the point."""
        found = sorted(self.logs.glob("*.failed"))
        return {path.stem: reason_in(path) for path in found}

    def _extended(self, plan: Plan, resolved: dict[str, Config]) -> Plan:
        """The plan of this directory with the points that `plan` adds. Raises ConfigError."""
        before = self.plan()
        if list(before.varied) != list(plan.varied):
            raise ConfigError(
                f"{self.path} holds a sweep over {', '.join(before.varied) or 'nothing'}, not over "
                f"{', '.join(plan.varied) or 'nothing'}.\n{OTHER_DIRECTORY}"
            )
        if self.base.exists() and not self.base.is_file():  # a pipe would be waited for
            raise FileError(f"{self.base} is not a regular file.\n{OTHER_DIRECTORY}")
        for point in plan.points:
            try:
                overrides = (*before.overrides, *point.settings)
                there = configuration.load(self.base, overrides)
            except ConfigError:
                there = None
            _refuse_change(f"{self.path} holds a sweep", there, resolved[point.name])
        varied = {key: _union(before.varied[key], plan.varied[key]) for key in plan.varied}
        return Plan(before.overrides, varied, _union(before.points, plan.points))

    def _refuse_other_runs(self, resolved: dict[str, Config]) -> None:
        """Raise ConfigError where a point's directory holds a run of another configuration."""
        for name, config in resolved.items():
            run = RunDirectory(self.path / name)
            if run.config.is_file() and (run.summary.is_file() or has_checkpoints(run)):
                there = configuration.load(run.config)
                _refuse_change(f"{run.path} holds a run", there, config)

    def _refuse_other_things(self, base: str) -> None:
        """Raise FileError where the directory holds other files than those of a killed sweep."""
        there = set()
        if self.path.is_dir():
            there = {one for one in self.path.iterdir() if not is_unfinished(one.name)}
        logs = {self.logs} if self.logs.is_dir() and not any(self.logs.iterdir()) else set()
        ours = (
            {self.base} if logs and self.base in there and read_text(self.base) == base else set()
        )
        if not self.path.is_dir() or there - logs - ours:
            raise FileError(
                f"{self.path} exists already and is not the directory of a sweep.\n"
                f"{OTHER_DIRECTORY}"
            )


def reason_in(path: Path) -> str:
    """The reason in a `.failed` file; never raises."""
    try:
        with opened(path) as file:
            return file.readall().decode(errors="replace").strip() or "no reason was kept"
    except OSError as error:
        return f"the reason cannot be read: {error.strerror}"
    except FileError as error:
        return f"the reason cannot be read: {first_line(str(error))}"


def has_checkpoints(run: RunDirectory) -> bool:
    """Whether the run directory exists and holds a checkpoint, damaged or not."""
    try:
        return bool(run.checkpoints())
    except FileNotFoundError:
        return False


def _refuse_change(what: str, there: Config | None, now: Config) -> None:
    """Raise ConfigError with the keys that differ, except those that change no result."""
    if there is not None and there.recorded == now.recorded:
        return
    differences = [] if there is None else _differences(there, now)
    told = "".join(f"\n  {line}" for line in differences)
    raise ConfigError(f"{what} of another configuration{':' if told else '.'}{told}\n"
                      f"{OTHER_DIRECTORY}")  # fmt: skip


def _differences(there: Config, now: Config) -> list[str]:
    before, after = (tomllib.loads(one.recorded) for one in (there, now))

    def shown(table: dict, key: str) -> str:
        return value_text(table[key]) if key in table else "not set"

    return [
        f"{table}.{key} = {shown(before[table], key)} there, {shown(after[table], key)} now"
        for table in before
        for key in before[table] | after[table]
        if before[table].get(key) != after[table].get(key)
    ]


def _texts(values) -> tuple[str, ...]:
    """A list of strings, as a tuple. Raises TypeError for anything else."""
    if not isinstance(values, list) or not all(isinstance(one, str) for one in values):
        raise TypeError
    return tuple(values)


def _text(plan: Plan) -> str:
    tables = {
        "vary": plan.varied,
        "points": {point.name: list(point.settings) for point in plan.points},
    }
    text = (
        f"{HEADER}version = {value_text(__version__)}\nset = {value_text(list(plan.overrides))}\n"
    )
    for table, keys in tables.items():
        lines = (f"{key_text(key)} = {value_text(value)}\n" for key, value in keys.items())
        text += f"\n[{table}]\n" + "".join(lines)
    return text


def _union(before, after):
    """The items of `before`, then those that only `after` has; in the type of `before`."""
    return type(before)([*before, *(one for one in after if one not in before)])
