import concurrent.futures
import contextlib
import errno
import fcntl
import io
import json
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
from sph.output import checkpoint, files, stored

REFERENCE = Path(__file__).parents[2] / "reference"


@pytest.fixture
def written(tmp_path, make_state):
    path = tmp_path / "checkpoint_000000.h5"
    checkpoint.write(path, make_state())
    return path


HDF5_SAYS = r"Unable to .*(?=\)\.)"  # differs between versions of HDF5


@pytest.fixture
def refused(messages):
    """refused(path): reading `path` is an error of one sentence and what to try."""

    def check(path, mask=None):
        with messages.raised(FileError, path, mask=mask) as caught:
            checkpoint.read(path)
        assert caught.value.exit_code == 4
        assert len(str(caught.value).splitlines()) == 2
        assert "\nTry: " in str(caught.value)

    return check


def seal(path):
    with io.FileIO(path, "r+") as file:
        files.seal(file)


def unseal(path):
    """Take the digest off the end, as in files of older versions."""
    path.write_bytes(path.read_bytes()[: -files.SEAL_LENGTH])


def damage(path, offset):
    """Flip one bit."""
    content = bytearray(path.read_bytes())
    content[offset] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("alpha", [None, 0.1])
def test_write_and_read_is_bit_for_bit(tmp_path, make_state, dimension, alpha):
    state = make_state(dimension, alpha=alpha)
    state.particles.velocity[0, :3] = -0.0, 1e300, 5e-324
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
    assert back.budget == state.budget


def test_public_pressure_matches_state(make_state):
    state = make_state()
    rho, u = state.particles.density, state.particles.internal_energy
    # one rounding a factor, three factors
    np.testing.assert_allclose(state.pressure, (1.4 - 1) * rho * u, rtol=1e-15)


def test_equal_states_give_equal_files(tmp_path, make_state):
    checkpoint.write(tmp_path / "a.h5", make_state(alpha=0.1))
    checkpoint.write(tmp_path / "b.h5", make_state(alpha=0.1))
    checkpoint.write(tmp_path / "c.h5", make_state(alpha=0.1, seed=2))
    content = {name: (tmp_path / f"{name}.h5").read_bytes() for name in "abc"}
    assert content["a"] == content["b"]
    assert content["a"] != content["c"]


def test_private_datasets_equal_numerical_state(written, make_state):
    state = make_state()
    with h5py.File(written) as file:
        group = file["Checkpoint"]
        arrays = state.particles.arrays()
        scalars = {*stored.SCALARS, *stored.ENERGIES}
        assert set(group) == {*arrays, *stored.LISTS, *scalars}
        for name, array in arrays.items():
            assert group[name].shape == array.shape, name
        assert all(group[name].shape == () for name in scalars)
        assert "threads" not in group.attrs["configuration"]
        assert "[physics]" in group.attrs["configuration"]


def test_state_hash_depends_on_values_names_types_and_shapes():
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


def test_read_missing_file_is_refused(refused, tmp_path):
    refused(tmp_path / "no.h5")


def test_read_directory_is_refused(refused, tmp_path):
    refused(tmp_path)


def test_read_file_not_hdf5_is_refused(refused, tmp_path):
    path = tmp_path / "a.h5"
    for content in (b"", b"[problem]\n"):
        path.write_bytes(content)
        refused(path)


def test_read_hdf5_of_other_program_is_refused(refused, tmp_path):
    path = tmp_path / "a.h5"
    h5py.File(path, "w").close()
    refused(path)


@pytest.mark.parametrize("share", [0.0005, 0.1, 0.9, 0.99])
def test_read_truncated_file_is_refused(refused, written, share):
    content = written.read_bytes()
    written.write_bytes(content[: int(share * len(content))])
    refused(written, mask=HDF5_SAYS)
    with pytest.raises(files.Damaged):
        checkpoint.read(written)


def test_read_flipped_bit_in_array_is_refused(refused, written):
    with h5py.File(written) as file:
        offset = file["Checkpoint/velocity"].id.get_offset()
    damage(written, offset + 100)
    refused(written)


def test_read_flipped_bit_in_number_is_refused(refused, written):
    with h5py.File(written) as file:
        offset = file["Checkpoint/time"].id.get_offset()
    damage(written, offset)
    refused(written)
    unseal(written)
    refused(written)


def test_read_flipped_bit_in_configuration_is_refused(refused, written):
    damage(written, written.read_bytes().index(b"eta = 1.5"))
    unseal(written)
    refused(written)


def test_read_flipped_bit_anywhere_found_by_checksum(written, monkeypatch):
    whole = written.read_bytes()
    monkeypatch.setattr(stored, "load", None)  # not callable
    monkeypatch.setattr(stored, "check_apart", None)
    end = len(whole) - files.SEAL_LENGTH
    for offset in np.random.default_rng(3).integers(len(stored.SIGNATURE), end, size=50):
        written.write_bytes(whole)
        damage(written, offset)
        with pytest.raises(files.Damaged):
            checkpoint.read(written)


def test_read_older_file_without_checksum_succeeds(written, make_state):
    unseal(written)
    assert checkpoint.read(written).time == make_state().time


def test_read_zeroed_sector_without_checksum_harmless_or_refused(written, make_state):
    """HDF5 hangs on some: the global heap of the texts, which is found by its signature, is one."""
    unseal(written)
    whole = written.read_bytes()
    good = checkpoint.state_hash(make_state().particles.arrays())
    for offset in (0, 512, whole.index(b"GCOL") // 512 * 512, len(whole) // 1024 * 512):
        written.write_bytes(whole[:offset] + bytes(512) + whole[offset + 512 :])
        with contextlib.suppress(FileError):
            found = checkpoint.read(written)
            assert checkpoint.state_hash(found.particles.arrays()) == good


@pytest.mark.parametrize(
    ("program", "limits"),
    [
        ("while True: pass", {"SECONDS": 0.5, "PATIENCE": 100}),
        ("bytearray(1 << 30)", {"MEMORY": 100 << 20}),
        ("os.kill(os.getpid(), 11)", {}),
        ("__import__('time').sleep(60)", {"SECONDS": 0.2}),
    ],
    ids=["CPU time", "memory", "crash", "wall-clock time"],
)
def test_inspecting_process_has_limits(refused, written, monkeypatch, program, limits):
    """What HDF5 does on some damaged files, done by a stand-in for it."""
    unseal(written)
    source = Path(stored.__file__).read_text()
    stand_in = source.replace("            load(file, version)", f"            {program}")
    assert stand_in != source
    for name, value in limits.items():
        monkeypatch.setattr(stored, name, value)
    stand_in = stand_in.replace(
        'if __name__ == "__main__":', f"if True:\n    MEMORY = {stored.MEMORY}"
    )
    path = written.parent / "stand_in.py"
    path.write_text(stand_in)
    monkeypatch.setattr(stored, "__file__", str(path))
    refused(written)


def test_read_locked_file_succeeds(written, make_state):
    with written.open("r+b") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        assert checkpoint.read(written).time == make_state().time
    with h5py.File(written, "r") as other:
        assert checkpoint.read(written).time == make_state().time


def test_read_unreadable_file_not_called_damaged(messages, written, monkeypatch):
    def fail(*_):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(checkpoint, "is_sealed", fail)
    with messages.raised(FileError) as caught:
        checkpoint.read(written)
    assert not isinstance(caught.value, files.Damaged)


# --- files of strangers ---


def replaced(name, **changes):
    """A change of /Checkpoint: the dataset `name` made anew from its old values, with changes."""

    def change(group):
        values = group[name][()]
        del group[name]
        group.create_dataset(name, **({"data": values} | changes))

    return change


def in_a_raw_file(group):
    del group["mass"]
    space, kind = h5py.h5s.create_simple((50,)), h5py.h5t.NATIVE_DOUBLE
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_external(b"pipe", 0, 400)
    h5py.h5d.create(group.id, b"mass", kind, space, plan)


def virtual(group):
    del group["mass"]
    layout = h5py.VirtualLayout((50,), float)
    layout[:] = h5py.VirtualSource("pipe", "mass", (50,))
    group.create_virtual_dataset("mass", layout)


def linked(link):
    def change(group):
        del group["mass"]
        group["mass"] = link

    return change


def listed(group, name, entry):
    """Give the list of fields that entry for `name`; None takes it out."""
    fields = json.loads(group.attrs["fields"]) | {name: entry}
    group.attrs["fields"] = json.dumps({name: one for name, one in fields.items() if one})


STRANGE = {
    "longer": replaced("mass", data=np.ones(51)),
    "half": replaced("omega", data=np.ones(25)),
    "complex": replaced("mass", data=np.ones(50, complex)),
    "big-endian": replaced("mass", data=np.ones(50, ">f8")),
    "text": replaced("mass", data=[b"a"] * 50),
    "scalar": replaced("mass", data=1.0),
    "null": replaced("mass", data=h5py.Empty("f8")),
    "time": replaced("time", data=np.nan),
    "step": replaced("step", data=1e300),
    "steps": replaced("step", data=2**63 - 1),
    "negative": replaced("step", data=-1),
    "no step": replaced("next_step", data=0.0),
    "skin": replaced("list_skin", data=1e9),
    "injected": replaced("energy_injected", data=np.nan),
    "baseline": replaced("baseline_scale", data=np.inf),
    "IDs": replaced("id", data=np.ones(50, int)),
    "nan": replaced("velocity", data=np.full((2, 50), np.nan)),
    "support": replaced("support", data=np.zeros(50)),
    "cold": replaced("internal_energy", data=-np.ones(50)),
    "away": replaced("list_position", data=np.full((2, 50), 9.0)),
    "far": replaced("position", data=np.full((2, 50), 1e200)),
    "3-D": replaced("position", data=np.zeros((3, 50))),
    "empty": replaced("mass", data=None, shape=(10**9,), dtype=float, chunks=(1000,)),
    "bomb": replaced("mass", data=np.ones(10**6), compression="gzip"),
    "chunks": replaced(
        "mass", data=None, shape=(50,), dtype=float, chunks=(10**8,), maxshape=(None,)
    ),
    "outside": in_a_raw_file,
    "virtual": virtual,
    "link": linked(h5py.ExternalLink("pipe", "/mass")),
    "soft": linked(h5py.SoftLink("/PartType0/Masses")),
    "more": lambda group: group.create_dataset("more", data=1.0),
    "less": lambda group: group.pop("mass"),
    "unlisted": lambda group: (group.pop("mass"), listed(group, "mass", None)),
    "alpha": lambda group: (
        group.create_dataset("alpha", data=np.ones(50)), listed(group, "alpha", [0, False]),
    ),
    "format": lambda group: group.attrs.update(format_version=[1, 2]),
    "lineage": lambda group: group.attrs.update(lineage="{}"),
    "text array": lambda group: group.attrs.update(configuration=["a"] * 9),
}  # fmt: skip


@pytest.mark.parametrize("what", STRANGE)
def test_read_unexpected_structure_is_refused_first(refused, written, what, monkeypatch):
    """Sealed and with a matching hash, as a stranger can make it; "pipe" would block for ever."""
    monkeypatch.chdir(written.parent)
    os.mkfifo("pipe")
    with h5py.File(written, "r+") as file:
        group = file["Checkpoint"]
        STRANGE[what](group)
        with contextlib.suppress(Exception):
            hashable = what not in ("outside", "virtual", "link", "empty", "chunks")
            state = {name: one[()] for name, one in group.items()} if hashable else {}
            group.attrs["sha256"] = checkpoint.state_hash(state)
    seal(written)
    refused(written)


def test_read_field_of_other_rank_than_declared_is_refused(refused, tmp_path, make_state):
    """Of those that every scene has, the rank is checked before they are read."""
    path = tmp_path / "a.h5"
    checkpoint.write(path, make_state(alpha=0.1))
    with h5py.File(path, "r+") as file:
        group = file["Checkpoint"]
        replaced("alpha", data=np.ones((2, 50)))(group)
        listed(group, "alpha", [1, False])
        group.attrs["sha256"] = checkpoint.state_hash(
            {name: one[()] for name, one in group.items()}
        )
    seal(path)
    refused(path)


@pytest.mark.parametrize(
    "link", [h5py.SoftLink("/Header"), h5py.ExternalLink("pipe", "/Checkpoint")]
)
def test_read_linked_group_is_refused(refused, written, link, monkeypatch):
    monkeypatch.chdir(written.parent)
    os.mkfifo("pipe")
    with h5py.File(written, "r+") as file:
        del file["Checkpoint"]
        file["Checkpoint"] = link
    seal(written)
    refused(written)


def test_read_file_without_particles_is_refused(refused, tmp_path, make_state):
    path = tmp_path / "a.h5"
    state = make_state()
    state.particles = state.particles.subset(np.zeros(0, np.int64))
    state.list_position, state.list_support = np.zeros((2, 0)), np.zeros(0)
    digest = concurrent.futures.Future()
    digest.set_result(checkpoint.state_hash(checkpoint._state(state)))
    with h5py.File(path, "w") as file:
        group = file.create_group("Checkpoint")
        checkpoint._write_private(group.id, state, checkpoint._state(state), digest)
    refused(path)


def test_stored_fields_match_scene(tmp_path, make_state):
    path = tmp_path / "a.h5"
    state = make_state()
    checkpoint.write(path, state)
    with h5py.File(path) as file:
        named = stored.fields_of(file["Checkpoint"].attrs["fields"])
    fields = {one.name: one for one in state.scene.fields if one.stored}
    assert named == {name: (one.rank, one.remade) for name, one in fields.items()}


HOSTILE = {
    "no JSON": "{",
    "deep": "[" * 100_000,
    "a number": "3",
    "a list": '[["mass", 0, false]]',
    "a text": '"mass"',
    "null": "null",
    "a rank alone": '{"mass": 0}',
    "no rank": '{"mass": []}',
    "three entries": '{"mass": [0, false, 1]}',
    "a text for a rank": '{"mass": ["many", false]}',
    "infinite": '{"mass": [Infinity, false]}',
    "NaN": '{"mass": [NaN, false]}',
    "rank 7": '{"mass": [7, false]}',
    "rank 3": '{"mass": [3, false]}',
    "rank -1": '{"mass": [-1, false]}',
    "slash": '{"mass": [0, false], "../PartType0/Masses": [0, false]}',
    "inner slash": '{"a/b": [0, false]}',
    "root": '{"/": [0, false]}',
    "dot": '{".": [0, false]}',
    "empty name": '{"": [0, false]}',
    "NUL": '{"a\\u0000b": [0, false]}',
    "line": '{"mass\\n": [0, false]}',
    "surrogate": '{"\\udcff": [0, false]}',
    "attribute": '{"__class__": [0, false]}',
    "long": json.dumps({"a" * 62: [0, False]}),
    "a number of the run": '{"time": [0, false]}',
    "a list of the search": '{"list_support": [0, false]}',
    "an energy": '{"energy_added": [0, false]}',
}


@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_list_of_fields_is_refused(messages, what):
    with messages.raised(stored.Refused, "its list of fields") as caught:
        stored.fields_of(HOSTILE[what])
    assert caught.value.kind == "foreign"
    assert str(caught.value).isprintable()


def test_list_of_fields_gives_rank_and_remade():
    assert stored.fields_of('{"mass": [0, false], "a_b2": [2, true]}') == {
        "mass": (0, False),
        "a_b2": (2, True),
    }


@pytest.mark.parametrize(
    "named",
    [
        {"mass": [1, False]},
        {"velocity": [7, False]},
        {"more": [0, False]},
        {"more/less": [0, False]},
    ],
    ids=["rank", "high rank", "name", "path"],
)
def test_read_wrong_list_of_fields_is_refused(refused, written, named):
    with h5py.File(written, "r+") as file:
        attributes = file["Checkpoint"].attrs
        attributes["fields"] = json.dumps(json.loads(attributes["fields"]) | named)
    seal(written)
    refused(written)


@pytest.mark.parametrize("version", [0, 1000])
def test_read_other_format_version_is_refused(refused, written, version):
    with h5py.File(written, "r+") as file:
        file["Checkpoint"].attrs["format_version"] = version
    refused(written)


def test_read_invalid_configuration_is_refused(messages, written):
    with h5py.File(written, "r+") as file:
        attributes = file["Checkpoint"].attrs
        text = attributes["configuration"].replace("eta = ", "etta = ")
        attributes["configuration"] = text
        attributes["configuration_sha256"] = checkpoint._text_hash(text)
    with messages.raised(FileError):
        checkpoint.read(written)


def test_write_unwritable_directory_is_refused(messages, tmp_path, make_state):
    (tmp_path / "checkpoints").touch()
    with messages.raised(FileError):
        checkpoint.write(tmp_path / "checkpoints" / "checkpoint_000000.h5", make_state())


def in_another_process(path, preparation):
    """Write a larger state to `path` in a process of its own, after `preparation`."""
    here = Path(__file__).parent
    program = f"""
        import os, resource, signal, sys
        sys.path[:0] = {[str(here), str(REFERENCE)]!r}
        from conftest import random_state
        from sph.errors import FileError
        from sph.output import checkpoint, files, layout
        def die(*_, **__):
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
def test_write_killed_leaves_old_checkpoint(written, make_state, moment):
    whole = written.read_bytes()
    process = in_another_process(written, f"{moment} = die")
    assert process.returncode == -signal.SIGKILL, process.stderr
    assert len(list(written.parent.glob(f".{written.name}.*.partial"))) == 1
    assert written.read_bytes() == whole
    files.remove_unfinished(written.parent)
    checkpoint.write(written, make_state(seed=2))
    assert checkpoint.read(written).time == make_state(seed=2).time
    assert os.listdir(written.parent) == [written.name]


@pytest.mark.slow
@pytest.mark.parametrize("megabytes", [0, 1, 8, 21])
def test_write_full_disk_leaves_old_checkpoint_and_reports(written, megabytes):
    """A limit to the size of a file stands in for the disk: the state is of 21.6 MB."""
    whole = written.read_bytes()
    limit = f"resource.setrlimit(resource.RLIMIT_FSIZE, ({megabytes} << 20, {megabytes} << 20))"
    process = in_another_process(written, limit)
    assert process.returncode == 1
    assert process.stderr.startswith(f"cannot write {written}: File too large.\nTry: ")
    assert written.read_bytes() == whole
    assert os.listdir(written.parent) == [written.name]
