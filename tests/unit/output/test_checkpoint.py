import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import h5py
import numpy as np
import pytest

from sph.errors import FileError
from sph.output import checkpoint


@pytest.fixture
def written(tmp_path, make_state):
    path = tmp_path / "checkpoint_000000.h5"
    checkpoint.write(path, make_state())
    return path


def refused(path, *words):
    """The message of the FileError that reading `path` ends in: one sentence and what to try."""
    with pytest.raises(FileError) as caught:
        checkpoint.read(path)
    message = str(caught.value)
    assert caught.value.exit_code == 4
    assert str(path) in message
    assert len(message.splitlines()) == 2
    assert message.splitlines()[1].startswith("Try: ")
    for word in words:
        assert word in message
    return message


def damage(path, offset):
    """Flip one bit."""
    content = bytearray(path.read_bytes())
    content[offset] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("alpha", [None, 0.1])
def test_round_trip_is_bit_for_bit(tmp_path, make_state, dimension, alpha):
    state = make_state(dimension, alpha=alpha)
    state.particles.velocity[0, :3] = -0.0, np.nan, 5e-324
    path = tmp_path / "a.h5"
    checkpoint.write(path, state)
    back = checkpoint.read(path)
    expected = state.particles.arrays() | {
        name: np.asarray(getattr(state, name)) for name in checkpoint.NOT_PARTICLES
    }
    found = back.particles.arrays() | {
        name: np.asarray(getattr(back, name)) for name in checkpoint.NOT_PARTICLES
    }
    assert expected.keys() == found.keys()
    assert ("alpha" in found) == (alpha is not None)
    for name, array in expected.items():
        assert (found[name].dtype, found[name].shape) == (array.dtype, array.shape), name
        assert found[name].tobytes() == array.tobytes(), name
        assert found[name].ndim == 0 or found[name].flags.writeable
    assert (back.config.problem, back.config.physics) == (
        state.config.problem,
        state.config.physics,
    )
    assert back.lineage == state.lineage


def test_pressure_is_that_of_the_state(make_state):
    state = make_state()
    rho, u = state.particles.density, state.particles.internal_energy
    # one rounding a factor, three factors
    np.testing.assert_allclose(state.pressure, (1.4 - 1) * rho * u, rtol=1e-15)


def test_equal_states_make_equal_files(tmp_path, make_state):
    checkpoint.write(tmp_path / "a.h5", make_state(alpha=0.1))
    checkpoint.write(tmp_path / "b.h5", make_state(alpha=0.1))
    checkpoint.write(tmp_path / "c.h5", make_state(alpha=0.1, seed=2))
    content = {name: (tmp_path / f"{name}.h5").read_bytes() for name in "abc"}
    assert content["a"] == content["b"]
    assert content["a"] != content["c"]


def test_private_datasets_are_the_numerical_state_with_a_checksum_each(written, make_state):
    state = make_state()
    with h5py.File(written) as file:
        group = file["Checkpoint"]
        assert set(group) == {*state.particles.arrays(), *checkpoint.NOT_PARTICLES}
        for name, dataset in group.items():
            assert dataset.fletcher32 == bool(dataset.ndim), name
        assert "[run]" not in group.attrs["configuration"]
        assert "[physics]" in group.attrs["configuration"]


def test_hash_sees_values_names_types_and_shapes():
    state = {"a": np.arange(4.0), "b": np.array(1.0)}
    others = [
        {"a": np.arange(4.0) + 1e-15, "b": np.array(1.0)},
        {"c": np.arange(4.0), "b": np.array(1.0)},
        {"a": np.arange(4.0).view(np.int64), "b": np.array(1.0)},
        {"a": np.arange(4.0).reshape(2, 2), "b": np.array(1.0)},
        {"a": np.arange(4.0)},
    ]
    hashes = {checkpoint.state_hash(each) for each in [state, *others]}
    assert len(hashes) == 1 + len(others)
    assert checkpoint.state_hash(dict(reversed(state.items()))) == checkpoint.state_hash(state)


def test_missing_file(tmp_path):
    refused(tmp_path / "no.h5", "there is no checkpoint")


def test_directory(tmp_path):
    refused(tmp_path, "cannot read", "directory")


def test_not_hdf5(tmp_path):
    path = tmp_path / "a.h5"
    for content in (b"", b"[problem]\n"):
        path.write_bytes(content)
        refused(path, "not an HDF5 file")


def test_hdf5_of_another_program(tmp_path):
    path = tmp_path / "a.h5"
    h5py.File(path, "w").close()
    refused(path, "not a checkpoint of sph")


@pytest.mark.parametrize("share", [0.0005, 0.1, 0.9, 0.999])
def test_truncated(written, share):
    content = written.read_bytes()
    written.write_bytes(content[: int(share * len(content))])
    refused(written, "truncated or damaged")


def test_one_flipped_bit_in_an_array(written):
    with h5py.File(written) as file:
        offset = file["Checkpoint/velocity"].id.get_chunk_info(0).byte_offset
    damage(written, offset + 100)
    refused(written, "damaged")


def test_one_flipped_bit_in_a_number(written):
    with h5py.File(written) as file:
        offset = file["Checkpoint/time"].id.get_offset()
    damage(written, offset)
    refused(written, "the state does not match its SHA-256")


def test_one_flipped_bit_in_the_configuration(written):
    damage(written, written.read_bytes().index(b"eta = 1.5"))
    refused(written, "the configuration does not match its SHA-256")


def test_flipped_bits_anywhere_are_harmless_or_refused(written, make_state):
    """Metadata carries no checksum of HDF5's own: what is read must be the state or an error."""
    whole = written.read_bytes()
    good = checkpoint.state_hash(make_state().particles.arrays())
    random = np.random.default_rng(3)
    outcomes = {"refused": 0, "harmless": 0}
    for offset in random.integers(len(whole), size=200):
        written.write_bytes(whole)
        damage(written, offset)
        try:
            found = checkpoint.read(written)
        except FileError:
            outcomes["refused"] += 1
        else:
            outcomes["harmless"] += 1
            assert checkpoint.state_hash(found.particles.arrays()) == good
    assert min(outcomes.values()) > 0, outcomes


@pytest.mark.parametrize(("version", "word"), [(0, "an older"), (1000, "a newer")])
def test_other_formats(written, version, word):
    with h5py.File(written, "r+") as file:
        file["Checkpoint"].attrs["format_version"] = version
    refused(written, word, f"({version})", f"({checkpoint.FORMAT_VERSION})")


def test_configuration_that_this_version_does_not_take(written):
    with h5py.File(written, "r+") as file:
        attributes = file["Checkpoint"].attrs
        text = attributes["configuration"].replace("eta = ", "etta = ")
        attributes["configuration"] = text
        attributes["configuration_sha256"] = checkpoint._text_hash(text)
    with pytest.raises(FileError, match="etta"):
        checkpoint.read(written)


def test_unwritable_place(tmp_path, make_state):
    (tmp_path / "checkpoints").touch()
    with pytest.raises(FileError, match=r"cannot write .*: Not a directory"):
        checkpoint.write(tmp_path / "checkpoints" / "checkpoint_000000.h5", make_state())


def in_another_process(path, preparation):
    """Write a larger state to `path` in a process of its own, after `preparation`."""
    program = f"""
        import os, resource, signal, sys
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from conftest import random_state
        from sph.errors import FileError
        from sph.output import checkpoint, files, layout
        def die(*_):
            os.kill(os.getpid(), signal.SIGKILL)
        {preparation}
        try:
            checkpoint.write({str(path)!r}, random_state(number=100_000))
        except FileError as error:
            sys.exit(str(error))
    """
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True
    )


@pytest.mark.parametrize(
    "moment", ["layout._unit_attributes", "files.os.fsync", "files.os.replace"]
)
def test_killed_while_writing_leaves_the_old_checkpoint(written, make_state, moment):
    whole = written.read_bytes()
    process = in_another_process(written, f"{moment} = die")
    assert process.returncode == -signal.SIGKILL, process.stderr
    assert (written.parent / f".{written.name}.partial").exists()
    assert written.read_bytes() == whole
    checkpoint.write(written, make_state(seed=2))  # what the killed one left is in nobody's way
    assert checkpoint.read(written).time == make_state(seed=2).time
    assert os.listdir(written.parent) == [written.name]


@pytest.mark.parametrize("megabytes", [0, 1, 8, 21])
def test_full_disk_leaves_the_old_checkpoint_and_says_so(written, megabytes):
    """A limit to the size of a file stands in for the disk: the state is of 21.6 MB."""
    whole = written.read_bytes()
    limit = f"resource.setrlimit(resource.RLIMIT_FSIZE, ({megabytes} << 20, {megabytes} << 20))"
    process = in_another_process(written, limit)
    assert process.returncode == 1
    assert process.stderr.startswith(f"cannot write {written}: File too large.\nTry: ")
    assert written.read_bytes() == whole
    assert os.listdir(written.parent) == [written.name]
