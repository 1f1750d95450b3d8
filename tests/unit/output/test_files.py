import contextlib
import io
import os
import re
import shutil
from pathlib import Path

import pytest

from sph.errors import FileError
from sph.output import files


def test_write_syncs_file_then_renames_then_syncs_directory(tmp_path, monkeypatch):
    calls = []

    def sync(descriptor):
        calls.append(("sync", os.path.realpath(f"/proc/self/fd/{descriptor}")))

    def rename(old, new, **directories):
        calls.append(("rename", old))
        os.rename(old, new, **directories)

    monkeypatch.setattr(files.os, "fsync", sync)
    monkeypatch.setattr(files.os, "replace", rename)
    files.write_text(tmp_path / "a.txt", "text")
    beside = calls[1][1]
    assert re.fullmatch(r"\.a\.txt\.[0-9a-f]{16}\.partial", beside)
    assert calls == [
        ("sync", str(tmp_path / beside)), ("rename", beside), ("sync", str(tmp_path)),
    ]  # fmt: skip
    assert (tmp_path / "a.txt").read_text() == "text"


def test_write_error_leaves_old_file_only(tmp_path):
    path = tmp_path / "a.txt"
    files.write_text(path, "old")
    with contextlib.suppress(ZeroDivisionError), files.replacing(path) as unfinished:
        unfinished.write(b"half")
        raise ZeroDivisionError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("parent", ["missing", "a_file"])
def test_write_unwritable_directory_names_it(messages, tmp_path, parent):
    (tmp_path / "a_file").touch()
    path = tmp_path / parent / "a.txt"
    with messages.raised(FileError, "a.txt", "\nTry: ") as caught:
        files.write_text(path, "text")
    assert caught.value.exit_code == 4


def test_unfinished_files_distinguished_from_user_files(tmp_path):
    for name in (".history.csv.partial", "download.partial", ".hidden"):
        (tmp_path / name).touch()
    with files.replacing(tmp_path / "a.txt"):
        (unfinished,) = (name for name in os.listdir(tmp_path) if name.startswith(".a.txt."))
        shutil.copy(tmp_path / unfinished, tmp_path / unfinished.replace(".a.", ".b."))
    (tmp_path / "a.txt").unlink()
    files.remove_unfinished(tmp_path)
    assert sorted(os.listdir(tmp_path)) == [".hidden", "download.partial"]


def test_write_to_link_replaces_link(messages, tmp_path, monkeypatch):
    """Also not through one at the very name of the unfinished file, whoever guessed that."""
    mine = tmp_path / "mine"
    mine.write_text("precious")
    path = tmp_path / "a.txt"
    path.symlink_to(mine)
    (tmp_path / ".a.txt.partial").symlink_to(mine)
    files.write_text(path, "text")
    assert (path.is_symlink(), path.read_text(), mine.read_text()) == (False, "text", "precious")
    monkeypatch.setattr(files.secrets, "token_hex", lambda _: "guessed")
    (tmp_path / ".a.txt.guessed.partial").symlink_to(mine)
    with messages.raised(FileError):
        files.write_text(path, "other")
    assert mine.read_text() == "precious"


def test_append_to_link_or_pipe_is_refused(messages, tmp_path):
    mine = tmp_path / "mine"
    mine.write_text("precious")
    (tmp_path / "link").symlink_to(mine)
    os.mkfifo(tmp_path / "pipe")
    for name in ("link", "pipe"):
        with messages.raised(FileError, name):
            files.open_to_append(tmp_path / name)
    assert mine.read_text() == "precious"


def test_read_not_regular_file_is_refused_without_waiting(messages, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    for name in ("pipe", "link", "."):
        with messages.raised(FileError, "\nTry: "):
            files.read_text(tmp_path / name)


@pytest.mark.parametrize("how", ["replaced", "deleted"])
def test_write_after_directory_was_replaced_is_refused(messages, tmp_path, how):
    home = tmp_path / "run"
    home.mkdir()
    descriptor = os.open(home, os.O_RDONLY)
    with files.holding({home: descriptor}):
        files.write_text(home / "a.txt", "first")
        home.rename(tmp_path / "moved")
        if how == "replaced":
            home.mkdir()
        with messages.raised(FileError):
            files.write_text(home / "a.txt", "second")
    os.close(descriptor)
    assert (tmp_path / "moved" / "a.txt").read_text() == "first"
    assert not (home / "a.txt").exists()


def test_checksum_detects_every_change(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(content := bytes(range(256)) * 9)
    with io.FileIO(path, "r+") as file:
        assert not files.is_sealed(file)
        files.seal(file)
        assert files.is_sealed(file)
    sealed = path.read_bytes()
    assert sealed.startswith(content)
    for changed in (b"x" + sealed[1:], sealed[1:], sealed[:-3] + b"00\n", b"0" + sealed):
        path.write_bytes(changed)
        with files.opened(Path(path)) as file, pytest.raises(ValueError, match="SHA-256"):
            files.is_sealed(file)
