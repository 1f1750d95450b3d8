"""The run directory: the paths of its files, and which of them may be replaced."""

import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sph.errors import FileError, NumericalError
from sph.output import checkpoint, history, locks, same_run
from sph.output.checkpoint import Checkpoint
from sph.output.files import (
    Damaged,
    explained,
    is_same_path,
    is_unfinished,
    opened,
    read_text,
    refuse_link,
    remove_unfinished,
    replacing,
    write_text,
)
from sph.output.frames import Frames
from sph.output.json_text import json_text
from sph.shell_words import quoted
from sph.summary import Summary, of_json

CHECKPOINT_NAME = re.compile(r"checkpoint_(\d{6,})\.h5")

# The end of a message on a run without checkpoints.
AGAIN = "\nTry: `sph run`, to start the run again."

# A checkpoint of a failed run is valid if its energy drift is below this fraction of
# physics.max_energy_drift: shortly before a failure the drift grows by more than that per step.
GOOD = 0.1

# Bytes of a history that are read to see whether it has a second step; a row has about 500.
LONGEST_BEGINNING = 100_000

# First line of config.toml. It marks a run directory, from which --force may remove files.
MARK = "# The resolved configuration of a run of sph.\n"


@dataclass(frozen=True)
class RunDirectory:
    """Paths in a run directory. Only `path` and `path`/checkpoints must exist.

    made: config.toml and directories that did not exist before `create`, the innermost first.
    """

    path: Path
    made: tuple[Path, ...] = field(default=(), compare=False, repr=False)

    @classmethod
    def create(cls, path: Path, force: bool = False) -> "RunDirectory":
        """Create a run directory at `path`, and its parents.

        Files of an earlier run stay until `make_room`. Raises FileError if `path` holds other
        files, or an earlier run and `force` is false.
        """
        path = Path(path)
        inside = (path / name for name in ("config.toml", "checkpoints", "frames"))
        paths = (*inside, path, *path.parents)
        run = cls(path, tuple(one for one in paths if not one.exists()))
        with explained(f"cannot write to {path}"):
            if run.path.exists() and not run.path.is_dir():
                raise FileError(f"{path} is a file.\nTry: another directory, with -o (output=).")
            there = run.path.is_dir() and not _holds_nothing(run.path)
            if there and not _is_run(run):
                raise FileError(
                    f"{path} is not a run directory, and it is not empty.\n"
                    "Try: a new directory, with -o (output=)."
                )
            refuse_link(run._checkpoint_directory)
            run._checkpoint_directory.mkdir(parents=True, exist_ok=True)
            with run.alone():
                if there and not force:
                    run._refuse_begun()
                run._remove_unfinished()
        return run

    @classmethod
    def open(cls, path: Path) -> "RunDirectory":
        """Return the run directory at `path`. Raises FileError if there is none."""
        run = cls(Path(path))
        if not run._checkpoint_directory.is_dir():
            problem = "is not a run directory" if run.path.exists() else "does not exist"
            raise FileError(f"{path} {problem}.\nTry: a directory that `sph run` wrote.")
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
    def problem(self) -> Path:
        """Path of a copy of the user's problem file, as the file was when the run began."""
        return self.path / "problem.py"

    @property
    def relaxation(self) -> Path:
        """Path of how relaxation to a glass ended; summaries of later restarts contain it too."""
        return self.path / "relaxation.json"

    @property
    def offenders(self) -> Path:
        """Path of the file in which a failed run stores the particles at which it failed."""
        return self.path / "offenders.h5"

    @property
    def frames(self) -> Frames:
        return Frames(self.path / "frames")

    @property
    def figures(self) -> Path:
        return self.path / "figures"

    @property
    def _checkpoint_directory(self) -> Path:
        return self.path / "checkpoints"

    def checkpoint_path(self, number: int) -> Path:
        """Return the path of checkpoint `number`, which counts from 0."""
        return self._checkpoint_directory / f"checkpoint_{number:06d}.h5"

    def checkpoints(self) -> list[Path]:
        """Return the existing checkpoints, in order of their numbers."""
        return list(self._numbered().values())

    def _numbered(self) -> dict[int, Path]:
        """Return the existing checkpoints by number, in order."""
        found = [(checkpoint_number(path), path) for path in self._checkpoint_directory.iterdir()]
        return dict(sorted((number, path) for number, path in found if number is not None))

    @property
    def has_failed(self) -> bool:
        """Whether the run failed, according to its summary."""
        return self.read_summary().get("status") == "failed"

    def latest(self) -> Path:
        """Return the last checkpoint that is not damaged.

        Raises Damaged if there is none, and FileError if a later one cannot be read, since that one
        may be valid.
        """
        reason = f"has no checkpoint.{AGAIN}"
        for path in reversed(self.checkpoints()):
            try:
                checkpoint.read(path)
            except Damaged as error:
                reason = f"has no valid checkpoint: {error}"
            else:
                return path
        raise Damaged(f"{self.path} {reason}")

    def last_good(self) -> Path:
        """Return the last checkpoint of a failed run that was written before its energy drifted.

        A faulty step is detected only some steps later, and a checkpoint written in between holds a
        faulty state. Raises FileError if no checkpoint can be read.
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
        """Raise FileError if the directory holds files of another run than checkpoint `path`.

        `state` is the content of `path`. Checked are the configuration, the history, the previous
        checkpoint and, unless the run continues `into` another directory, all later checkpoints,
        which it replaces. Damaged checkpoints are ignored.
        """
        same_run.check_configuration(self.config, state)
        number = checkpoint_number(path) or 0
        if number or self.history.exists():  # the first may be a copy that was not continued yet
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
        """Remove later checkpoints and the unfinished files of a killed run. Raises FileError."""
        with explained(f"cannot remove checkpoints of {self.path}"):
            for other, path in self._numbered().items():
                if other > number:
                    path.unlink()
            self._remove_unfinished()

    def write_config(self, text: str) -> None:
        """Write config.toml atomically. Raises FileError."""
        write_text(self.config, MARK + text)

    def write_problem(self, source: bytes) -> None:
        """Write the copy of the user's problem file atomically. Raises FileError."""
        with replacing(self.problem) as unfinished:
            unfinished.write(source)

    def write_relaxation(self, ended: Mapping) -> None:
        """Write how relaxation to a glass ended, atomically. Raises FileError."""
        write_text(self.relaxation, json_text(ended))

    def read_relaxation(self) -> dict | None:
        """Return how relaxation ended; None without relaxation, or if the file cannot be read."""
        return _json_object(self.relaxation) or None

    def write_summary(self, summary: Mapping) -> None:
        """Write summary.json atomically, with non-finite numbers as "nan", "inf" and "-inf".

        Raises FileError, and TypeError for values that JSON cannot express.
        """
        write_text(self.summary, json_text(summary))

    def whole_summary(self) -> Summary:
        """The summary of a run that has ended. Raises FileError where it cannot be read."""
        try:
            return of_json(read_text(self.summary))
        except json.JSONDecodeError as error:
            problem = f"line {error.lineno} is not valid JSON"
        except (OSError, ValueError, RecursionError) as error:
            problem = str(error)
        raise FileError(
            f"{self.summary} cannot be read: {problem}.\n"
            "Try: the sph that wrote it; or `sph restart` of its directory, if it is damaged."
        )

    def read_summary(self) -> dict:
        """Return the content of summary.json, or an empty dictionary if it cannot be read.

        For the status of a run that may not have ended; `whole_summary` has the figures.
        """
        return _json_object(self.summary)

    def is_running(self) -> bool | None:
        """Return whether a process has locked the directory; None on file systems without locks."""
        return locks.is_held(self._checkpoint_directory)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Lock the directory within the block. Raises FileError if another process has locked it.

        Files are written to the locked directory even if another one takes its place.
        """
        with locks.held(self.path, self._checkpoint_directory):
            yield

    def _refuse_begun(self) -> None:
        if self.checkpoints() or (self.history.exists() and not self._ended_at_once()):
            raise FileError(
                f"{self.path} already holds a run.\nTry: --force (in Python force=True) to replace "
                f"it, `sph restart {quoted(self.path)}` to continue it, or another directory, with "
                "-o (output=)."
            )

    def make_room(self) -> None:
        """Remove the files of an earlier run, and no others. Raises FileError."""
        with explained(f"cannot remove the files of an earlier run in {self.path}"):
            if self.figures.is_dir() and not self.figures.is_symlink():
                shutil.rmtree(self.figures)
            files = (self.history, self.summary, self.offenders, self.problem, self.relaxation)
            for path in (*files, *self.checkpoints()):
                path.unlink(missing_ok=True)
            self.frames.drop_after(-1)
            if self.config.exists():
                self.write_config("")  # keeps MARK, so that this remains a run directory

    @contextmanager
    def withdrawn_unless_begun(self, is_copy: bool = False) -> Iterator[None]:
        """If the block fails before there is a checkpoint, remove what it made of the directory.

        is_copy: whether checkpoints in a directory that `create` made are only copies.

        A NumericalError leaves the directory, with its configuration and offenders.h5. Files of an
        earlier run stay if the block fails before `make_room`.
        """
        try:
            yield
        except NumericalError:
            raise
        except BaseException:
            if not self.checkpoints() or (is_copy and self.path in self.made):
                with suppress(OSError, FileError):
                    self.make_room()
            self._remove_made()
            raise

    def _remove_made(self) -> None:
        """Remove config.toml and the directories that `create` made, unless a file is left."""
        if self.checkpoints():
            return
        with suppress(OSError):
            for one in self.made:
                if one.is_dir():
                    one.rmdir()
                else:
                    one.unlink(missing_ok=True)

    def _ended_at_once(self) -> bool:
        """Return whether the run ended in its first step, so that nothing of value is lost."""
        if self.summary.exists():
            return False
        with opened(self.history) as file:
            return file.read(LONGEST_BEGINNING + 1).count(b"\n") <= 2

    def _remove_unfinished(self) -> None:
        for directory in (self.path, self._checkpoint_directory):
            remove_unfinished(directory)


def _json_object(path: Path) -> dict:
    """Return the JSON object in a file, empty if there is none or it cannot be read."""
    try:
        found = json.loads(read_text(path))
    except (OSError, FileError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def checkpoint_number(path: Path) -> int | None:
    """Return the number in a checkpoint's file name, or None for other names."""
    name = CHECKPOINT_NAME.fullmatch(path.name)
    return int(name[1]) if name else None


def find(run_or_checkpoint: Path) -> tuple[RunDirectory | None, Path]:
    """Return the run directory and the checkpoint to restart from. Raises FileError.

    For a run directory, the checkpoint is `last_good` of a failed run, otherwise `latest`. For a
    checkpoint, it is that checkpoint; the run directory is None if the checkpoint is not in one.
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
    """Return whether the directory has no files, or only unfinished ones of a killed run."""
    return all(is_unfinished(name) for _, _, files in os.walk(directory) for name in files)
