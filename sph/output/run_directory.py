"""The directory of a run: where everything is, and what may be replaced."""

import fcntl
import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sph.errors import FileError
from sph.output import checkpoint, history, same_run
from sph.output.checkpoint import Checkpoint
from sph.output.files import (
    Damaged,
    explained,
    holding,
    is_same_path,
    is_unfinished,
    opened,
    read_text,
    refuse_link,
    remove_unfinished,
    write_text,
)
from sph.output.json_text import json_text
from sph.shell_words import quoted
from sph.summary import Summary, of_json

CHECKPOINT_NAME = re.compile(r"checkpoint_(\d{6,})\.h5")

# A checkpoint of a run that failed is good while energy has drifted by less than this part of
# physics.max_energy_drift: before a collapse the drift grows by more than that from step to step.
GOOD = 0.1

# Bytes of a history that is read to see whether it ends after its first step: a row has some 500.
LONGEST_BEGINNING = 100_000

# First line of config.toml: what tells a run directory from a user's folder of the same look,
# before --force may remove anything from it.
MARK = "# The resolved configuration of a run of sph.\n"


@dataclass(frozen=True)
class RunDirectory:
    """Paths in a run directory, none of which need exist but `path` and its checkpoints/."""

    path: Path

    @classmethod
    def create(cls, path: Path, force: bool = False) -> "RunDirectory":
        """An empty run directory at `path`, its parents made where they are missing.

        With `force` an earlier run there is removed, but nothing that is not of that run.
        Raises FileError where there is something else, or an earlier run and no force.
        """
        run = cls(Path(path))
        with explained(f"cannot write to {path}"):
            if run.path.exists() and not run.path.is_dir():
                raise FileError(f"{path} is a file.\nTry: another directory, with -o.")
            there = run.path.is_dir() and not _holds_nothing(run.path)
            if there and not _is_run(run):
                raise FileError(
                    f"{path} is not a run directory, and it holds other things.\n"
                    "Try: a new directory, with -o."
                )
            refuse_link(run._checkpoint_directory)
            run._checkpoint_directory.mkdir(parents=True, exist_ok=True)
            with run.alone():
                if there:
                    run._make_room(force)
                run._remove_unfinished()
        return run

    @classmethod
    def open(cls, path: Path) -> "RunDirectory":
        """The run directory at `path`. Raises FileError where there is none."""
        run = cls(Path(path))
        if not run._checkpoint_directory.is_dir():
            there = "is not a run directory" if run.path.exists() else "does not exist"
            raise FileError(f"{path} {there}.\nTry: the directory that `sph run` named, with -o.")
        refuse_link(run._checkpoint_directory)
        return run

    @property
    def config(self) -> Path:
        return self.path / "config.toml"

    @property
    def history(self) -> Path:
        return self.path / "history.csv"

    @property
    def summary(self) -> Path:
        return self.path / "summary.json"

    @property
    def offenders(self) -> Path:
        """Where a run that failed leaves the particles at which it did."""
        return self.path / "offenders.h5"

    @property
    def figures(self) -> Path:
        return self.path / "figures"

    @property
    def _checkpoint_directory(self) -> Path:
        return self.path / "checkpoints"

    def checkpoint_path(self, number: int) -> Path:
        """Where checkpoint `number`, from 0, is or will be."""
        return self._checkpoint_directory / f"checkpoint_{number:06d}.h5"

    def checkpoints(self) -> list[Path]:
        """The checkpoints that are there, by number."""
        return list(self._numbered().values())

    def _numbered(self) -> dict[int, Path]:
        """The checkpoints by number, in order."""
        found = [(checkpoint_number(path), path) for path in self._checkpoint_directory.iterdir()]
        return dict(sorted((number, path) for number, path in found if number is not None))

    @property
    def has_failed(self) -> bool:
        """Whether the summary says so."""
        return self.read_summary().get("status") == "failed"

    def latest(self) -> Path:
        """The last checkpoint that is not damaged.

        Raises Damaged where there is none, FileError where a later one cannot be judged: it may be
        good.
        """
        reason = "it has no checkpoints.\nTry: `sph run`, from the start"
        for path in reversed(self.checkpoints()):
            try:
                checkpoint.read(path)
            except Damaged as error:
                reason = str(error)
            else:
                return path
        raise Damaged(f"{self.path} cannot be restarted: {reason}")

    def last_good(self) -> Path:
        """Of a run that failed, the last checkpoint from which energy had hardly drifted.

        A step that goes wrong is found some steps later: a checkpoint written in between holds the
        wrong state already. Raises FileError where none can be read.
        """
        if not self.history.exists():
            return self.latest()
        drifts = history.read(self.history)
        drift = dict(zip(drifts["step"], np.abs(drifts["energy_drift"]), strict=True))
        for path in reversed(self.checkpoints()):
            with suppress(Damaged):
                one = checkpoint.read(path)
                if drift.get(one.step, 0.0) <= GOOD * one.config.physics.max_energy_drift:
                    return path
        return self.latest()

    def check_belongs(self, path: Path, state: Checkpoint, into: Path | None = None) -> None:
        """Raise FileError where the directory holds what is not of the run of checkpoint `path`.

        `state` is what that holds. Looked at are the configuration, the history, the checkpoint
        before and, unless the run goes on `into` another directory, all later ones, which it
        replaces. A damaged one is no obstacle.
        """
        same_run.check_configuration(self.config, state)
        number = checkpoint_number(path) or 0
        if number or self.history.exists():  # the first may be a copy that no run went on from yet
            same_run.check_history(self.history, state)
        numbers = self._numbered()
        for other in reversed([one for one in numbers if one < number]):
            with suppress(Damaged):
                before = checkpoint.read(numbers[other])
                same_run.check_order(numbers[other], path, before, state)
                break
        stays = into is None or is_same_path(into, self.path)
        for other in [one for one in numbers if one > number and stays]:
            with suppress(Damaged):
                after = checkpoint.read(numbers[other])
                same_run.check_order(path, numbers[other], state, after)
                path, state = numbers[other], after

    def drop_checkpoints_after(self, number: int) -> None:
        """Remove later checkpoints, and what a killed run left unfinished. Raises FileError."""
        with explained(f"cannot remove checkpoints of {self.path}"):
            for other, path in self._numbered().items():
                if other > number:
                    path.unlink()
            self._remove_unfinished()

    def write_config(self, text: str) -> None:
        """Write config.toml, all or nothing. Raises FileError."""
        write_text(self.config, MARK + text)

    def write_summary(self, summary: Mapping) -> None:
        """Write summary.json, all or nothing; "nan", "inf" and "-inf" are strings there.

        Raises FileError, and TypeError for what has no place in JSON.
        """
        write_text(self.summary, json_text(summary))

    def whole_summary(self) -> Summary:
        """The summary of a run that has ended. Raises FileError where it cannot be read."""
        try:
            return of_json(read_text(self.summary))
        except (OSError, ValueError, RecursionError) as error:
            raise FileError(
                f"{self.summary} cannot be read: {error}.\n"
                "Try: the sph that wrote it; or `sph restart` of its directory, if it is damaged."
            ) from None

    def read_summary(self) -> dict:
        """What summary.json holds, or an empty dictionary where it cannot be read.

        To ask for the status of a run that may not have ended; `whole_summary` has the figures.
        """
        try:
            found = json.loads(read_text(self.summary))
        except (OSError, FileError, ValueError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the directory against other processes meanwhile. Raises FileError where one has it.

        Files are written to this very directory, also if another takes its place.
        Where the file system knows no locks, nothing is held.
        """
        with explained(f"cannot open {self.path}"):
            flags = os.O_RDONLY | os.O_DIRECTORY
            home = os.open(self.path, flags)
            descriptor = os.open("checkpoints", flags | os.O_NOFOLLOW, dir_fd=home)
        try:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise FileError(
                    f"{self.path} is in use: another sph is running there.\n"
                    "Try: wait for its end, or another directory with -o."
                ) from None
            except OSError:
                pass  # this file system has no locks
            with holding({self.path: home, self._checkpoint_directory: descriptor}):
                yield
        finally:
            os.close(descriptor)
            os.close(home)

    def _make_room(self, force: bool) -> None:
        begun = self.checkpoints() or (self.history.exists() and not self._ended_at_once())
        if begun and not force:
            raise FileError(
                f"{self.path} holds a run already.\nTry: --force to replace it, "
                f"`sph restart {quoted(self.path)}` to go on with it, or another directory with -o."
            )
        if self.figures.is_dir() and not self.figures.is_symlink():
            shutil.rmtree(self.figures)
        for path in (self.history, self.summary, self.offenders, *self.checkpoints()):
            path.unlink(missing_ok=True)
        self.write_config("")  # its mark stays: beside a user's files this is still a run directory

    def _ended_at_once(self) -> bool:
        """Whether its run ended before its first checkpoint, so that nothing is lost with it."""
        if self.summary.exists():
            return False
        with opened(self.history) as file:
            return file.read(LONGEST_BEGINNING + 1).count(b"\n") <= 2

    def _remove_unfinished(self) -> None:
        for directory in (self.path, self._checkpoint_directory):
            remove_unfinished(directory)


def checkpoint_number(path: Path) -> int | None:
    """The number in a checkpoint's name, or None where it is no such name."""
    name = CHECKPOINT_NAME.fullmatch(path.name)
    return int(name[1]) if name else None


def find(run_or_checkpoint: Path) -> tuple[RunDirectory | None, Path]:
    """What to restart from: a run directory's last good checkpoint, or that very checkpoint.

    Of a run that failed that is `RunDirectory.last_good`, else the last that can be read.

    The run directory is None for a checkpoint that is in none. Raises FileError.
    """
    path = Path(run_or_checkpoint)
    if path.is_dir():
        run = RunDirectory.open(path)
        return run, run.last_good() if run.has_failed else run.latest()
    if not path.exists():
        raise FileError(f"{path} does not exist.\nTry: a run directory, or a checkpoint in one.")
    run = RunDirectory(path.absolute().parent.parent)
    inside = checkpoint_number(path) is not None and path.absolute().parent.name == "checkpoints"
    return (run if inside and _is_run(run) else None), path


def _is_run(run: RunDirectory) -> bool:
    try:
        with opened(run.config) as file:
            marked = file.read(len(MARK)) == MARK.encode()
    except (OSError, FileError):
        return False
    return marked and run._checkpoint_directory.is_dir()


def _holds_nothing(directory: Path) -> bool:
    """No file but unfinished ones: empty, or what a run left that died before it began."""
    return all(is_unfinished(name) for _, _, files in os.walk(directory) for name in files)
