"""Files that are either whole or not there, and errors of the file system in the user's words."""

import contextlib
import io
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from sph.errors import FileError

# A file that is being written is hidden beside its place; a killed run leaves it there.
UNFINISHED = ".partial"


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A name beside `path` to write to, which takes its place once it is safely on disk.

    Written beside, synced, renamed, and the directory synced: at every moment, also after a
    power cut, `path` is the old file or the new one. Left with an error, nothing has changed.
    Raises FileError where the file system refuses.
    """
    unfinished = path.with_name(f".{path.name}{UNFINISHED}")
    with explained(f"cannot write {path}"):
        try:
            yield unfinished
            _sync(unfinished)
            os.replace(unfinished, path)
        finally:
            with contextlib.suppress(OSError):
                unfinished.unlink()
        _sync(path.parent)


def write_text(path: Path, text: str) -> None:
    """Write `text` (UTF-8) to `path`, all or nothing. Raises FileError."""
    with replacing(path) as unfinished:
        # a path that is not UTF-8 holds lone surrogates, whose Python escape is that of JSON too
        unfinished.write_text(text, encoding="utf-8", errors="backslashreplace")


def is_unfinished(name: str) -> bool:
    """Whether that is the name of a file that `replacing` had not finished."""
    return name.startswith(".") and name.endswith(UNFINISHED)


def remove_unfinished(directory: Path) -> None:
    """Remove what a killed run was writing in `directory`."""
    for path in directory.iterdir():
        if is_unfinished(path.name):
            path.unlink(missing_ok=True)


class PatientFile(io.FileIO):
    """A new file for h5py to write, in which a write that fails is raised only at the end.

    HDF5 does not bear a full disk: it loses data without an error, or brings the interpreter down.
    So it is told that all went well, and `raise_failure` tells the truth once it is done.
    """

    def __init__(self, path: Path):
        super().__init__(path, "w+")
        self._failure: BaseException | None = None

    def write(self, content) -> int:
        rest = memoryview(content).cast("B")
        with self._noted():
            while rest:
                rest = rest[super().write(rest) :]
        return len(content)

    def truncate(self, size: int | None = None) -> int:
        with self._noted():
            return super().truncate(size)
        return self.tell() if size is None else size

    def raise_failure(self) -> None:
        """Raise the first failure, if there was one."""
        if self._failure is not None:
            raise self._failure

    @contextlib.contextmanager
    def _noted(self) -> Iterator[None]:
        try:
            yield
        except BaseException as failure:  # an interrupt is no better for HDF5 than a full disk
            self._failure = self._failure or failure


@contextlib.contextmanager
def explained(what: str) -> Iterator[None]:
    """Turn an OSError into a FileError that begins with `what`."""
    try:
        yield
    except OSError as error:
        # h5py sets the number, but its text is an account of its own internals
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise FileError(
            f"{what}: {reason}.\nTry: a directory that you may write to and that has space left."
        ) from error


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def copy_file(source: Path, target: Path) -> None:
    """A copy of `source` at `target`, all or nothing. Raises FileError."""
    with replacing(target) as unfinished:
        shutil.copyfile(source, unfinished)


def write_new(path: Path, text: str) -> None:
    """Write `text` to a file that must not be there yet. Raises FileError."""
    if path.exists():
        raise FileError(f"{path} is there already.\nTry: another name.")
    write_text(path, text)
