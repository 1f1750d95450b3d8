"""Directories of compiled code: which are removed, and that none in use is."""

import fcntl
import os

import pytest

from sph import cache_directory
from sph.cache_directory import Directory, prune


def directories(place, count, size=0):
    """Directories of which the first was used last, with `size` bytes each."""
    paths = [place / f"sph-0.1.{k}-{k:016x}" for k in range(count)]
    for age, path in enumerate(paths):
        path.mkdir()
        (path / "entry.code").write_bytes(bytes(size))
        os.utime(path, (1e9 - age, 1e9 - age))
    return paths


def test_prune_removes_oldest_directories_not_in_use(tmp_path):
    paths = directories(tmp_path, 6)
    other = tmp_path / "sph-something"
    other.mkdir()
    used = Directory(paths[4])
    assert used.descriptor is not None  # which opens it
    os.utime(paths[4], (1.0, 1.0))
    prune(tmp_path, kept=2)
    assert set(tmp_path.iterdir()) == {paths[0], paths[1], paths[4], other}
    fcntl.flock(used.descriptor, fcntl.LOCK_UN)
    prune(tmp_path, kept=2)
    assert set(tmp_path.iterdir()) == {paths[0], paths[1], other}


def test_prune_keeps_bytes_below_limit(tmp_path):
    paths = directories(tmp_path, 6, size=1000)
    prune(tmp_path, kept_bytes=3500)
    assert set(tmp_path.iterdir()) == set(paths[:3])
    used = Directory(paths[2])
    assert used.descriptor is not None
    prune(tmp_path, kept_bytes=500)
    assert set(tmp_path.iterdir()) == {paths[2]}


def test_use_makes_directory_newest(tmp_path):
    paths = directories(tmp_path, 3)
    used = Directory(paths[2])
    assert used.descriptor is not None
    fcntl.flock(used.descriptor, fcntl.LOCK_UN)
    prune(tmp_path, kept=1)
    assert set(tmp_path.iterdir()) == {paths[2]}


def test_new_directory_prunes_old_ones(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(cache_directory, "prune", asked.append)
    for _ in range(2):
        assert Directory(tmp_path / "sph-0-0").descriptor is not None
    assert asked == [tmp_path]


def test_prune_keeps_directory_made_again_before_lock(tmp_path, monkeypatch):
    """Another process removes the old directory, and a third one makes and uses a new one."""
    (path,) = directories(tmp_path, 1)
    lock = fcntl.flock
    users = []

    def late(opened, kind):
        if not users:
            path.rename(tmp_path / "removed")
            users.append(Directory(path))
            assert users[0].descriptor is not None
        return lock(opened, kind)

    monkeypatch.setattr(cache_directory.fcntl, "flock", late)
    monkeypatch.setattr(cache_directory, "prune", lambda place: None)
    prune(tmp_path, kept=0)
    users[0].write("entry.code", b"content")
    assert users[0].read("entry.code") == b"content"


@pytest.fixture
def removing(tmp_path, monkeypatch):
    """A directory that another process is removing; the removal ends in the next pause."""
    (path,) = directories(tmp_path, 1)
    other = os.open(path, os.O_RDONLY)  # an open file of its own, as another process has
    fcntl.flock(other, fcntl.LOCK_EX)

    def ends(*_):
        if path.exists():
            (path / "entry.code").unlink()
            path.rmdir()
            fcntl.flock(other, fcntl.LOCK_UN)

    monkeypatch.setattr(cache_directory.time, "sleep", ends)
    yield path
    os.close(other)


def test_directory_being_removed_is_made_again(removing):
    opened = Directory(removing)
    assert os.path.samestat(os.fstat(opened.descriptor), removing.stat())
    opened.write("entry.code", b"content")
    assert opened.read("entry.code") == b"content"


def test_directory_removed_before_lock_is_made_again(removing, monkeypatch):
    """The removal begins and ends between the opening and the lock."""
    lock = fcntl.flock

    def late(opened, kind):
        if kind & fcntl.LOCK_SH and removing.exists():
            cache_directory.time.sleep()
        return lock(opened, kind)

    monkeypatch.setattr(cache_directory.fcntl, "flock", late)
    opened = Directory(removing)
    assert os.path.samestat(os.fstat(opened.descriptor), removing.stat())


def test_directory_whose_removal_does_not_end_is_not_used(removing, monkeypatch, capsys):
    monkeypatch.setattr(cache_directory.time, "sleep", lambda seconds: None)
    opened = Directory(removing)
    assert opened.descriptor is None
    opened.warn()
    assert "another process is removing it" in capsys.readouterr().err
