"""Atomic writing, checked reading and checksums of files. Symbolic links are never followed."""

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

# An unfinished file is hidden in the directory of its target; a killed run leaves it behind. Its
# name contains random digits, so that no other user can place a link there in advance.
UNFINISHED = ".partial"
UNFINISHED_NAME = re.compile(r"\..+\.partial")
RANDOM_BYTES = 8

# The end of a sealed file: the SHA-256 of all bytes before it. HDF5 ignores it.
SEAL = b"\nsha256 of this file up to here: "
SEAL_LENGTH = len(SEAL) + 64 + 1
BUFFER = 1 << 20

# Descriptors of the directories that a run holds open, by path.
_held: dict[Path, int] = {}


class Damaged(FileError):
    """The content of a file is not what was written. The file may be replaced."""


# --- writing ---


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Yield a file to write to, which replaces `path` when the block ends without an error.

    The file is written under another name, synced and renamed, and the directory is synced. So
    `path` is always the old file or the new one, even after a power failure. After an error, `path`
    is unchanged. A link at `path` is replaced, not followed.
    Raises FileError if the file cannot be written or its directory was replaced meanwhile.
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
    """Write `text` (UTF-8) to `path` atomically. Raises FileError."""
    with replacing(path) as unfinished:
        # a path that is not UTF-8 contains lone surrogates, which Python and JSON escape alike
        unfinished.write(text.encode("utf-8", "backslashreplace"))


def write_new(path: Path, text: str) -> None:
    """Write `text` to a new file. Raises FileError, also if `path` exists."""
    if os.path.lexists(path):
        raise FileError(f"{path} already exists.\nTry: another name.")
    write_text(path, text)


def copy_file(source: Path, target: Path) -> None:
    """Copy `source` to `target` atomically. Raises FileError."""
    with opened(source) as original, replacing(target) as unfinished:
        shutil.copyfileobj(original, unfinished, BUFFER)


def open_to_append(path: Path) -> int:
    """Return a descriptor that appends to `path`, which is created if missing.

    Raises FileError, also if `path` is a link.
    """
    with explained(f"cannot write {path}"):
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
        descriptor = os.open(path, flags, 0o666)
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            os.close(descriptor)
            raise FileError(f"{path} is not a regular file.\nTry: remove it.")
        return descriptor


def is_unfinished(name: str) -> bool:
    """Return whether `name` is that of an unfinished file of `replacing`."""
    return UNFINISHED_NAME.fullmatch(name) is not None


def remove_unfinished(directory: Path) -> None:
    """Remove the unfinished files that a killed run left in `directory`."""
    for path in directory.iterdir():
        if is_unfinished(path.name):
            path.unlink(missing_ok=True)


class PatientFile(io.FileIO):
    """A file for h5py whose failed writes are raised only at the end, by `raise_failure`.

    On a full disk HDF5 loses data without an error, or crashes the interpreter. So each failed
    write is reported to HDF5 as successful.
    """

    def __init__(self, file: BinaryIO):
        """Write to the empty `file`, which stays open."""
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
        """Raise the first error of a write, if there was one."""
        if self._failure is not None:
            raise self._failure

    def _note(self, failure: BaseException) -> None:
        # HDF5 tolerates an interrupt no better than a full disk
        self._failure = self._failure or failure


# --- reading ---


@contextlib.contextmanager
def opened(path: Path) -> Iterator[io.FileIO]:
    """Yield the regular file at `path`, open for reading, without a lock.

    Raises FileNotFoundError if there is no file, and FileError if it cannot be read or is a pipe or
    device, which might block forever.
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
            f"cannot read {path}: {_reason(error)}.\nTry: a regular file with read permission."
        ) from error


def read_text(path: Path) -> str:
    """Return the UTF-8 text in `path`. Raises FileError and FileNotFoundError."""
    with opened(path) as file:
        content = file.readall()
    try:
        return content.decode()
    except UnicodeDecodeError:
        raise FileError(
            f"cannot read {path}: it is not UTF-8 text.\nTry: a text file that sph wrote."
        ) from None


# --- seals ---


def seal(file: io.FileIO) -> None:
    """Append the SHA-256 of the whole file to it."""
    with contextlib.suppress(OSError, AttributeError):
        # on Linux, writing to disk then begins while the digest is computed
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    digest = _digest(file, os.fstat(file.fileno()).st_size)
    file.write(SEAL + digest.encode() + b"\n")


def is_sealed(file: io.FileIO) -> bool:
    """Return whether the file ends with the SHA-256 of all bytes before it.

    Raises ValueError if that SHA-256 does not match, and OSError.
    """
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
    """Return the SHA-256 of the first `length` bytes; leave the position after them."""
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
    """Within the block, write files only to these directories (descriptors by path).

    If another directory has taken the place of one of them, each `replacing` in it raises
    FileError.
    """
    before = dict(_held)
    _held.update(directories)
    try:
        yield
    finally:
        _held.clear()
        _held.update(before)


@contextlib.contextmanager
def holding_directory(path: Path) -> Iterator[None]:
    """Within the block, hold the directory `path` too. Raises FileError if it cannot be opened."""
    with explained(f"cannot open {path}"):
        descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        with holding({path: descriptor}):
            yield
    finally:
        os.close(descriptor)


def check_in_place(path: Path, descriptor: int) -> None:
    """Raise FileError if `path` is no longer the file or directory open as `descriptor`."""
    try:
        if os.path.samestat(os.stat(path), os.fstat(descriptor)):
            return
    except FileNotFoundError:
        pass
    raise FileError(
        f"{path} was moved, deleted or replaced during the run. The run stops and writes nothing "
        "more.\nTry: only one run at a time in a directory."
    )


def is_same_path(one: Path, other: Path) -> bool:
    """Return whether both paths resolve to the same place, which need not exist."""
    return os.path.realpath(one) == os.path.realpath(other)


def refuse_link(directory: Path) -> None:
    """Raise FileError if `directory` is a symbolic link, which would redirect all files."""
    if directory.is_symlink():
        raise FileError(
            f"{directory} is a symbolic link to {os.readlink(directory)}; expected a directory.\n"
            f"Try: `rm {directory}`, which removes only the link."
        )


@contextlib.contextmanager
def _directory_of(path: Path) -> Iterator[int]:
    """Yield a descriptor of the directory of `path`, the held one if there is one."""
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
    """Convert an OSError within the block to a FileError whose message begins with `what`."""
    try:
        yield
    except OSError as error:
        raise FileError(
            f"{what}: {_reason(error)}.\nTry: a directory with write permission and free space."
        ) from error


def _reason(error: OSError) -> str:
    # h5py sets errno, but its text describes internals of HDF5
    return os.strerror(error.errno) if error.errno else error.strerror or str(error)
