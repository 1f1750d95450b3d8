"""Open, check and replace files: whole or not there, never through a link, sealed by a digest."""

import contextlib
import errno
import hashlib
import io
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from sph.errors import FileError

# A file that is being written is hidden beside its place; a killed run leaves it there. Its name
# holds random digits, so that nobody can have put a link there.
UNFINISHED = ".partial"
UNFINISHED_NAME = re.compile(r"\..+\.partial")
RANDOM_BYTES = 8

# The last bytes of a sealed file: SHA-256 of all bytes before them. HDF5 does not read them.
SEAL = b"\nsha256 of this file up to here: "
SEAL_LENGTH = len(SEAL) + 64 + 1
BUFFER = 1 << 20

# Directories that a run holds, by path: descriptors of what was there when it began.
_held: dict[Path, int] = {}


class Damaged(FileError):
    """A file is not what was written: its content is lost already, so it may be replaced."""


# --- writing ---


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write to, which takes the place of `path` once it is safely on disk.

    Written beside, synced, renamed, and the directory synced: at every moment, also after a
    power cut, `path` is the old file or the new one. Left with an error, nothing has changed. A
    link at `path` is replaced, not followed.
    Raises FileError where the file system refuses, or the directory is no longer the one held.
    """
    path = Path(path)
    name = f".{path.name}.{secrets.token_hex(RANDOM_BYTES)}{UNFINISHED}"
    with explained(f"cannot write {path}"), _directory_of(path) as directory:
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
        descriptor = os.open(name, flags, 0o666, dir_fd=directory)
        try:
            with open(descriptor, "w+b") as unfinished:
                yield unfinished
                unfinished.flush()
                os.fsync(descriptor)
            os.replace(name, path.name, src_dir_fd=directory, dst_dir_fd=directory)
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(name, dir_fd=directory)
            raise
        os.fsync(directory)


def write_text(path: Path, text: str) -> None:
    """Write `text` (UTF-8) to `path`, all or nothing. Raises FileError."""
    with replacing(path) as unfinished:
        # a path that is not UTF-8 holds lone surrogates, whose Python escape is that of JSON too
        unfinished.write(text.encode("utf-8", "backslashreplace"))


def write_new(path: Path, text: str) -> None:
    """Write `text` to a file that must not be there yet. Raises FileError."""
    if os.path.lexists(path):
        raise FileError(f"{path} is there already.\nTry: another name.")
    write_text(path, text)


def copy_file(source: Path, target: Path) -> None:
    """A copy of `source` at `target`, all or nothing. Raises FileError."""
    with opened(source) as original, replacing(target) as unfinished:
        shutil.copyfileobj(original, unfinished, BUFFER)


def open_to_append(path: Path) -> int:
    """A descriptor that writes at the end of `path`, which is made if missing. Raises FileError.

    A link at `path` is refused.
    """
    with explained(f"cannot write {path}"):
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
        descriptor = os.open(path, flags, 0o666)
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            os.close(descriptor)
            raise FileError(f"{path} is not a regular file.\nTry: remove it.")
        return descriptor


def is_unfinished(name: str) -> bool:
    """Whether that is the name of a file that `replacing` had not finished."""
    return UNFINISHED_NAME.fullmatch(name) is not None


def remove_unfinished(directory: Path) -> None:
    """Remove what a killed run was writing in `directory`."""
    for path in directory.iterdir():
        if is_unfinished(path.name):
            path.unlink(missing_ok=True)


class PatientFile(io.FileIO):
    """A file for h5py to write, in which a write that fails is raised only at the end.

    HDF5 does not bear a full disk: it loses data without an error, or brings the interpreter down.
    So it is told that all went well, and `raise_failure` tells the truth once it is done.
    """

    def __init__(self, file: BinaryIO):
        """Write to the empty `file`, which stays open afterwards."""
        super().__init__(file.fileno(), "w+", closefd=False)
        self._failure: BaseException | None = None

    def write(self, content) -> int:
        rest = memoryview(content).cast("B")
        try:  # no context manager, which costs as much as the write: a checkpoint is a hundred
            while rest:
                rest = rest[super().write(rest) :]
        except BaseException as failure:
            self._note(failure)
        return len(content)

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except BaseException as failure:
            self._note(failure)
        return self.tell() if size is None else size

    def raise_failure(self) -> None:
        """Raise the first failure, if there was one."""
        if self._failure is not None:
            raise self._failure

    def _note(self, failure: BaseException) -> None:
        # an interrupt is no better for HDF5 than a full disk
        self._failure = self._failure or failure


# --- reading ---


@contextlib.contextmanager
def opened(path: Path) -> Iterator[io.FileIO]:
    """The regular file at `path`, to read. No lock is asked for.

    Raises FileError where it cannot be read; a pipe or device, which might block for ever, is
    refused. FileNotFoundError stays as it is.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        with io.FileIO(descriptor) as file:
            mode = os.fstat(descriptor).st_mode
            if stat.S_ISDIR(mode):
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            if not stat.S_ISREG(mode):
                raise OSError(0, "it is not a regular file")
            yield file
    except FileNotFoundError:
        raise
    except OSError as error:
        raise FileError(
            f"cannot read {path}: {_reason(error)}.\nTry: a regular file that you may read."
        ) from error


def read_text(path: Path) -> str:
    """The UTF-8 text in `path`. Raises FileError, FileNotFoundError and UnicodeDecodeError."""
    with opened(path) as file:
        return file.readall().decode()


# --- seals ---


def seal(file: io.FileIO) -> None:
    """Append the SHA-256 of the whole file to it."""
    with contextlib.suppress(OSError, AttributeError):
        # on Linux the disk then begins to write, while the digest is computed
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    digest = _digest(file, os.fstat(file.fileno()).st_size)
    file.write(SEAL + digest.encode() + b"\n")


def is_sealed(file: io.FileIO) -> bool:
    """Whether the file ends in the SHA-256 of what stands before it. Raises ValueError if it does
    not match, OSError."""
    content = os.fstat(file.fileno()).st_size - SEAL_LENGTH
    if content < 0:
        return False
    file.seek(content)
    ending = file.read(SEAL_LENGTH)
    if not ending.startswith(SEAL):
        return False
    if ending != SEAL + _digest(file, content).encode() + b"\n":
        raise ValueError("its content does not match the SHA-256 at its end")
    return True


def _digest(file: io.FileIO, length: int) -> str:
    """SHA-256 of the first `length` bytes; the position is then behind them."""
    digest, buffer = hashlib.sha256(), memoryview(bytearray(min(length, BUFFER)))
    file.seek(0)
    while length:
        count = file.readinto(buffer[: min(length, BUFFER)])
        if not count:
            raise OSError("the file has become shorter")
        digest.update(buffer[:count])
        length -= count
    return digest.hexdigest()


# --- directories ---


@contextlib.contextmanager
def holding(directories: dict[Path, int]) -> Iterator[None]:
    """Write files to these very directories meanwhile (descriptors by path), or not at all.

    A directory that another has taken the place of is an error of every `replacing` in it.
    """
    before = dict(_held)
    _held.update(directories)
    try:
        yield
    finally:
        _held.clear()
        _held.update(before)


def check_in_place(path: Path, descriptor: int) -> None:
    """Raise FileError where `path` is no longer what `descriptor` has open."""
    try:
        if os.path.samestat(os.stat(path), os.fstat(descriptor)):
            return
    except FileNotFoundError:
        pass
    raise FileError(
        f"{path} was moved, deleted or replaced while the run was using it: the run ends here and "
        "writes nothing to what is there now.\nTry: one run at a time in a directory."
    )


def is_same_path(one: Path, other: Path) -> bool:
    """Whether both lead to the same place, there or not. A link to itself is no error."""
    return os.path.realpath(one) == os.path.realpath(other)


def refuse_link(directory: Path) -> None:
    """Raise FileError where `directory` is a link, through which a run would write elsewhere."""
    if directory.is_symlink():
        raise FileError(
            f"{directory} is a symbolic link: files would be written to {os.readlink(directory)}.\n"
            f"Try: `rm {directory}`, which removes the link alone."
        )


@contextlib.contextmanager
def _directory_of(path: Path) -> Iterator[int]:
    """A descriptor of the directory of `path`: the held one, as long as it is in its place."""
    held = _held.get(path.parent)
    if held is not None:
        check_in_place(path.parent, held)
        yield held
        return
    descriptor = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def explained(what: str) -> Iterator[None]:
    """Turn an OSError into a FileError that begins with `what`."""
    try:
        yield
    except OSError as error:
        raise FileError(
            f"{what}: {_reason(error)}.\n"
            "Try: a directory that you may write to and that has space left."
        ) from error


def _reason(error: OSError) -> str:
    # h5py sets the number, but its text is an account of its own internals
    return os.strerror(error.errno) if error.errno else error.strerror or str(error)
