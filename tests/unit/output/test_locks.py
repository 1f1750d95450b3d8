"""Locks of run directories."""

import fcntl
import os

import pytest

from sph.errors import FileError
from sph.output import locks


@pytest.fixture
def home(tmp_path):
    (tmp_path / "checkpoints").mkdir()
    return tmp_path


def test_lock_is_seen_and_refused_to_others(home):
    inside = home / "checkpoints"
    assert locks.is_held(inside) is False
    with locks.held(home, inside):
        assert locks.is_held(inside) is True
        with pytest.raises(FileError, match="in use by another run"), locks.held(home, inside):
            pass
    assert locks.is_held(inside) is False


def test_look_of_another_process_does_not_refuse_the_lock(home, monkeypatch):
    """`is_held` holds a shared lock for a moment."""
    inside = home / "checkpoints"
    looking = os.open(inside, os.O_RDONLY)
    fcntl.flock(looking, fcntl.LOCK_SH)
    monkeypatch.setattr(locks.time, "sleep", lambda _: fcntl.flock(looking, fcntl.LOCK_UN))
    with locks.held(home, inside):
        assert locks.is_held(inside) is True
    os.close(looking)
