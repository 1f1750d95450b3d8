"""Compiled code on disk: whose it is, what decides it, and what becomes of damage."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import numba.core.config
import pytest
from numba import njit

import sph
from sph import cache_directory, compile_cache, fingerprint
from sph.cache_directory import Directory
from sph.compile_cache import Entries
from sph.compiled import COMPILED

ROOT = Path(sph.__file__).parents[1]
TINY = """
import json
from numba import njit
from sph.compiled import COMPILED

@njit(**COMPILED)
def value(x):
    return 2.0 * x + 1.0

if __name__ == "__main__":
    from tiny import value
    found = value(3.0)
    stats = value.stats
    print(json.dumps([found, stats.cache_hits.total(), stats.cache_misses.total()]))
"""


def _double(x):
    return 2.0 * x


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A directory of its own for what this process compiles; a function: as if opened anew."""

    def reopened():
        opened = Directory(tmp_path / "cache" / "sph-0-0123456789abcdef")
        monkeypatch.setattr(compile_cache, "directory", lambda: opened)
        return opened

    reopened()
    return reopened


def called():
    """(result, loaded from the cache or not) of a function that this process has not called yet."""
    function = njit(**COMPILED)(_double)
    result = function(3.0)
    return result, bool(function.stats.cache_hits)


def entry(directory):
    (path,) = directory.path.iterdir()
    return path


def in_new_process(directory, **environment):
    """([value, hits, misses], stderr) of TINY in `directory`."""
    (directory / "tiny.py").write_text(TINY)
    inherited = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "tiny.py"],
        cwd=directory,
        env=inherited | {"PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr


# --- damage -----------------------------------------------------------------------------------


def test_compiled_code_is_kept_and_private(cache):
    assert called() == (6.0, False)
    assert called() == (6.0, True)
    assert entry(cache()).stat().st_mode & 0o777 == 0o600
    assert cache().path.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize(
    "damage",
    [
        lambda whole: b"",
        lambda whole: whole[: len(whole) // 2],
        lambda whole: b"not compiled code",
        lambda whole: whole[:-100] + bytes([whole[-100] ^ 1]) + whole[-99:],
    ],
    ids=["empty", "cut", "garbage", "one bit"],
)
def test_damaged_entry_is_compiled_again(cache, capsys, damage):
    called()
    path = entry(cache())
    whole = path.read_bytes()
    path.write_bytes(damage(whole))
    assert called() == (6.0, False)
    assert called() == (6.0, True)
    assert len(list(path.parent.iterdir())) == 1
    assert capsys.readouterr().err == ""


def test_entry_of_other_signature_is_ignored(cache):
    """As where an entry was renamed."""
    called()
    first = entry(cache())
    whole = first.read_bytes()
    function = njit(**COMPILED)(_double)
    function(3)
    (second,) = set(first.parent.iterdir()) - {first}
    second.write_bytes(whole)
    function = njit(**COMPILED)(_double)
    assert function(3) == 6
    assert not function.stats.cache_hits


@pytest.mark.parametrize("kind", ["fifo", "directory", "link"])
def test_entry_not_regular_file_is_ignored(cache, kind, tmp_path):
    called()
    path = entry(cache())
    path.rename(tmp_path / "elsewhere")
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "directory":
        path.mkdir()
    else:
        path.symlink_to(tmp_path / "elsewhere")
    assert called() == (6.0, False)


# --- no place ---------------------------------------------------------------------------------


def assert_uncached(capsys, *words):
    """Code is compiled, twice, and the reason is told once, with what to try."""
    assert called() == (6.0, False)
    assert called() == (6.0, False)
    told = capsys.readouterr().err
    assert told.count("sph: compiled code cannot be cached in ") == 1
    assert "variable NUMBA_CACHE_DIR" in told
    for word in words:
        assert word in told


def test_full_disk_compiles_and_warns_once(cache, capsys, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", full)
    assert_uncached(capsys, str(cache().path), "No space left")
    assert list(cache().path.iterdir()) == []
    monkeypatch.undo()


def test_deleted_directory_compiles_and_warns(cache, capsys):
    called()
    entry(cache()).unlink()
    opened = cache()
    assert opened.descriptor is not None
    opened.path.rmdir()
    assert_uncached(capsys, "No such file")


def test_directory_of_other_user_is_not_used(cache, capsys, monkeypatch):
    called()
    cache()
    mine = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: mine + 1)
    assert_uncached(capsys, f"belongs to another user (UID {mine})")


@pytest.mark.parametrize("mode", [0o770, 0o777])
def test_directory_writable_by_others_is_not_used(cache, capsys, mode):
    called()
    cache().path.chmod(mode)
    assert_uncached(capsys, "other users can write to it")


def test_entry_writable_by_others_is_not_used(cache):
    called()
    entry(cache()).chmod(0o666)
    assert called() == (6.0, False)
    assert called() == (6.0, True)  # written anew


@pytest.mark.slow
def test_unwritable_home_compiles_and_warns(tmp_path):
    """Commands that compile nothing say nothing of it."""
    nowhere = {"HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null/cache"}
    (value, hits, misses), told = in_new_process(tmp_path, **nowhere)
    assert (value, hits, misses) == (7.0, 0, 1)
    assert told.startswith("sph: compiled code cannot be cached in /dev/null/cache")
    assert "Not a directory" in told
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-m", "sph", "list"], cwd=ROOT, env=environment | nowhere,
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


def test_no_home_compiles_and_warns(cache, capsys, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda name: f"~/.cache/{name}")
    assert cache_directory.place() is None
    nowhere = Directory(None)
    monkeypatch.setattr(compile_cache, "directory", lambda: nowhere)
    assert_uncached(capsys, "no home directory")


# --- loaded code ------------------------------------------------------------------------------

CALLING = """
import sys
import numpy as np
from numba import njit
from sph.compiled import COMPILED

@njit(**COMPILED)
def many(n):
    found = np.empty(n)
    for i in range(n):
        found[i] = max(0.0, i - 1.0) ** n
    return found

@njit(**COMPILED)
def total(n):
    return many(n).sum()

@njit(**COMPILED)
def hashed(text):
    return hash(text) % 8

def loaded():
    return [name for name in ("numba.np.linalg", "numba.np.arraymath", "scipy.linalg")
            if name in sys.modules]
"""


@pytest.fixture
def ask(tmp_path):
    """What a new process finds for an expression, with the modules of Numba that it imported."""
    (tmp_path / "calling.py").write_text(CALLING)

    def asked(*expressions):
        found = ", ".join(f"({one}, {one.split('(')[0]}.stats.cache_hits.total())"
                          for one in expressions)  # fmt: skip
        done = subprocess.run(
            [sys.executable, "-c", f"from calling import *; print([{found}, loaded()])"],
            cwd=tmp_path, capture_output=True, text=True, timeout=120,
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT),
                              "PYTHONHASHSEED": "1"},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        *values, modules = eval(done.stdout)
        return values, modules

    return asked


@pytest.mark.slow
def test_loaded_code_runs_without_imports_for_compilation(ask):
    values, modules = ask("many(3).tolist()")
    assert values == [([0.0, 0.0, 1.0], 0)]
    assert modules
    values, modules = ask("many(3).tolist()")
    assert values == [([0.0, 0.0, 1.0], 1)]
    assert modules == []


@pytest.mark.slow
def test_code_compiled_around_loaded_code_is_stored_and_loaded(ask):
    ask("many(3).tolist()")
    assert ask("many(3).tolist()", "total(3)")[0] == [([0.0, 0.0, 1.0], 1), (1.0, 0)]
    assert ask("total(3)") == ([(1.0, 1)], [])


@pytest.mark.slow
def test_loaded_code_finds_symbols_that_modules_of_numba_define(ask):
    (compiled,), _ = ask("hashed('text')")
    (loaded,), modules = ask("hashed('text')")
    assert (loaded[0], compiled[1], loaded[1]) == (compiled[0], 0, 1)
    assert modules


# --- what decides code ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("OPT", 0), ("LOOP_VECTORIZE", 0), ("SLP_VECTORIZE", 1), ("ENABLE_AVX", 0),
        ("CPU_NAME", "generic"), ("CPU_FEATURES", "-avx2"), ("BOUNDSCHECK", 1),
        ("DISABLE_JIT", 1), ("DISABLE_INTEL_SVML", 1), ("USING_SVML", True),
        ("DEBUGINFO_DEFAULT", 1), ("OF_A_LATER_NUMBA", 1),
    ],
)  # fmt: skip
def test_setting_that_changes_code_changes_key(name, value, monkeypatch):
    before = fingerprint.settings()
    monkeypatch.setattr(numba.core.config, name, value, raising=False)
    after = fingerprint.settings()
    assert {k for k in after if after[k] != before.get(k)} == {f"NUMBA_{name}"}


@pytest.mark.parametrize(
    "name", ["CACHE_DIR", "NUMBA_NUM_THREADS", "DEBUG_CACHE", "DUMP_ASSEMBLY", "CUDA_DRIVER"]
)
def test_setting_that_changes_no_code_keeps_key(name, monkeypatch):
    before = fingerprint.settings()
    monkeypatch.setattr(numba.core.config, name, "another")
    assert fingerprint.settings() == before


def test_directory_name_depends_on_every_fact(monkeypatch):
    facts = fingerprint.facts()
    assert {"sources of sph", "Numba", "NumPy", "llvmlite", "processor"} < set(facts)
    keys = {fingerprint.key()}
    for name in facts:
        monkeypatch.setattr(fingerprint, "facts", lambda name=name: facts | {name: "another"})
        keys.add(fingerprint.key())
    assert len(keys) == 1 + len(facts)


@pytest.mark.slow
def test_code_of_other_settings_is_not_used(tmp_path):
    place = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert in_new_process(tmp_path, **place, NUMBA_OPT="0")[0] == [7.0, 0, 1]
    assert in_new_process(tmp_path, **place)[0] == [7.0, 0, 1]
    assert in_new_process(tmp_path, **place, NUMBA_NUM_THREADS="1")[0] == [7.0, 1, 0]
    directories = list((tmp_path / "cache").iterdir())
    assert len(directories) == 2
    assert all(cache_directory.NAME.fullmatch(path.name) for path in directories)


def test_code_of_sources_edited_meanwhile_is_not_kept(cache, monkeypatch):
    monkeypatch.setattr(fingerprint, "sources", lambda: "of another edit")
    called()
    assert list(cache().path.iterdir()) == []


def test_entry_name_depends_on_source_file(tmp_path, monkeypatch):
    names = set()
    for text in ("def f(x):\n    return g(x)\n", "def f(x):\n    return h(x)\n"):
        path = tmp_path / "module.py"
        path.write_text(text)
        compile_cache._file_hash.cache_clear()
        space = {"__name__": "module"}
        exec(compile(text, str(path), "exec"), space)
        names.add(Entries(space["f"])._key)
    assert len(names) == 2


def test_differences_name_each_fact():
    facts = fingerprint.facts()
    assert fingerprint.differences(fingerprint.as_json()) is None
    then = facts | {"processor": "z80", "NUMBA_OPT": "0", "sources of sph": "0", "more": "1"}
    then["features of the processor"] = "none"
    words = fingerprint.differences(json.dumps(then))
    assert f"processor (z80, here {facts['processor']})" in words
    assert "NUMBA_OPT (0, here 3)" in words
    assert "more (1, here not set)" in words
    assert "other sources of sph, " in words
    assert "features of the processor, " in words
    assert "Python" not in words


@pytest.mark.parametrize("then", [None, "", "{", "[]", b"\xff", 3, "[" * 100_000])
def test_differences_without_facts_are_none(then):
    assert fingerprint.differences(then) is None
