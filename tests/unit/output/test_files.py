import contextlib
import os

import pytest

from sph.errors import FileError
from sph.output import files


def test_write_is_synced_before_it_is_renamed_and_the_directory_after(tmp_path, monkeypatch):
    calls = []

    def sync(descriptor):
        calls.append(("sync", os.path.realpath(f"/proc/self/fd/{descriptor}")))

    def rename(old, new):
        calls.append(("rename", str(old)))
        os.rename(old, new)

    monkeypatch.setattr(files.os, "fsync", sync)
    monkeypatch.setattr(files.os, "replace", rename)
    files.write_text(tmp_path / "a.txt", "text")
    beside = str(tmp_path / ".a.txt.partial")
    assert calls == [("sync", beside), ("rename", beside), ("sync", str(tmp_path))]
    assert (tmp_path / "a.txt").read_text() == "text"


def test_an_error_while_writing_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    files.write_text(path, "old")
    with contextlib.suppress(ZeroDivisionError), files.replacing(path) as unfinished:
        unfinished.write_text("half")
        raise ZeroDivisionError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("parent", ["missing", "a_file"])
def test_a_place_that_cannot_be_written_is_named(tmp_path, parent):
    (tmp_path / "a_file").touch()
    path = tmp_path / parent / "a.txt"
    with pytest.raises(FileError, match=r"(?s)cannot write .*a\.txt: .*\nTry: ") as caught:
        files.write_text(path, "text")
    assert caught.value.exit_code == 4


def test_unfinished_files_are_told_from_a_users(tmp_path):
    for name in (".history.csv.partial", "download.partial", ".hidden"):
        (tmp_path / name).touch()
    files.remove_unfinished(tmp_path)
    assert sorted(os.listdir(tmp_path)) == [".hidden", "download.partial"]
