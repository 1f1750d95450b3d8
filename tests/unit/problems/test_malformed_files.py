"""Files that the problem `file` refuses: each message names file, dataset and what was expected."""

import contextlib

import h5py
import ic_files
import numpy as np
import pytest

from sph import config
from sph.errors import ConfigError, FileError


def load(path, keys=""):
    return config.from_text(f'[problem]\nname = "file"\npath = "{path}"\n{keys}')


def changed(index, value, name):
    """Return a change of one entry of a dataset."""

    def change(datasets, header):
        datasets[name][index] = value

    return change


def put(**header):
    return lambda datasets, attributes: attributes.update(header)


def replace(**arrays):
    return lambda datasets, header: datasets.update(arrays)


def drop(name):
    def change(datasets, header):
        datasets.pop(name, None)
        header.pop(name, None)

    return change


N = ic_files.N
# change of a good file, keys of the configuration, and what the message must name
HDF5 = {
    "several files": (put(NumFilesPerSnapshot=4), "", "NumFilesPerSnapshot"),
    "other particles in header": (
        put(NumPart_Total=[N, 5, 0, 0, 0, 0]), "", "type 1 (dark matter)",
    ),
    "entropies": (put(Flag_Entropy_ICs=[1, 0, 0, 0, 0, 0]), "", "Flag_Entropy_ICs"),
    "redshift": (put(Redshift=9.0), "", "Header/Redshift is 9"),
    "scale factor": (put(**{"Scale-factor": [0.5]}), "", "Header/Scale-factor is 0.5"),
    "outside the box": (changed((3, 1), 1.5, "Coordinates"), "", "PartType0/Coordinates"),
    "outside between mirrors": (
        changed((3, 1), -0.5, "Coordinates"), 'boundary = "mirror"\n', "particle 4",
    ),
    "two equal IDs": (changed(5, 2, "ParticleIDs"), "", "PartType0/ParticleIDs"),
    "IDs that are no integers": (
        replace(ParticleIDs=np.linspace(0.0, 1.0, N)), "", "PartType0/ParticleIDs",
    ),
    "NaN": (changed((7, 0), np.nan, "Velocities"), "", "PartType0/Velocities"),
    "infinity": (changed(2, np.inf, "InternalEnergy"), "", "PartType0/InternalEnergy"),
    "shape of vectors": (replace(Velocities=np.zeros((3, N))), "", "PartType0/Velocities"),
    "too few components": (
        replace(Coordinates=np.random.default_rng(0).random((N, 1))), "", "PartType0/Coordinates",
    ),
    "shape of scalars": (replace(Masses=np.ones(N - 1)), "", "PartType0/Masses"),
    "text": (replace(Masses=np.array([b"a"] * N)), "", "PartType0/Masses"),
    "negative mass": (changed(1, -1.0, "Masses"), "", "PartType0/Masses"),
    "zero mass": (changed(1, 0.0, "Masses"), "", "PartType0/Masses"),
    "negative energy": (changed(1, -1.0, "InternalEnergy"), "", "PartType0/InternalEnergy"),
    "negative density": (replace(Density=np.full(N, -1.0)), "", "PartType0/Density"),
    "no energies": (drop("InternalEnergy"), "", "InternalEnergies or InternalEnergy"),
    "no coordinates": (drop("Coordinates"), "", "Coordinates"),
    "no masses": (drop("Masses"), "", "Header/MassTable"),
    "number of particles": (put(NumPart_ThisFile=[N + 1, 0, 0, 0, 0, 0]), "", "NumPart_ThisFile"),
    "box without length": (put(BoxSize=-1.0), "", "Header/BoxSize"),
    "box of text": (put(BoxSize="one"), "", "Header/BoxSize"),
    "dimension": (put(Dimension=4), "", "Header/Dimension"),
    "2-D file that states 3-D": (put(Dimension=3), "", "problem.dimension = 2"),
    "3-D coordinates in 2-D": (
        changed((0, 2), 0.5, "Coordinates"), "dimension = 2\n", "PartType0/Coordinates",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", HDF5)
def test_malformed_hdf5_file_is_refused(messages, tmp_path, case):
    change, keys, named = HDF5[case]
    datasets, header = ic_files.tables(ic_files.particles())
    load(ic_files.write_hdf5(tmp_path / "good.hdf5", datasets, header), keys)
    change(datasets, header)
    path = ic_files.write_hdf5(tmp_path / "ic.hdf5", datasets, header)
    with messages.raised(FileError, "ic.hdf5: ", named, "expected"):
        load(path, keys)


def test_groups_that_do_not_fit_are_refused(messages, tmp_path):
    datasets, header = ic_files.tables(ic_files.particles())
    path = tmp_path / "ic.hdf5"
    ic_files.write_hdf5(path, datasets, header, Cosmology={"Cosmological run": [1]})
    with messages.raised(FileError, "Cosmology/Cosmological run"):
        load(path)
    ic_files.write_hdf5(path, datasets, header)
    with h5py.File(path, "a") as file:
        file["PartType4/Masses"] = np.ones(3)
    with messages.raised(FileError, "PartType4", "stars"):
        load(path)
    solid = '[physics]\nformulation = "continuum"\n[problem]\n'
    ic_files.write_hdf5(path, datasets, header, Checkpoint={"configuration": solid})
    with messages.raised(FileError, "continuum", "sph restart"):
        load(path)
    ic_files.write_hdf5(path, datasets, header, Checkpoint={"configuration": "="})
    with messages.raised(FileError, "configuration in /Checkpoint"):
        load(path)


def test_file_without_layout_is_refused(messages, tmp_path):
    path = tmp_path / "ic.hdf5"
    with h5py.File(path, "w") as file:
        file["rho"] = np.ones(3)
    with messages.raised(FileError, "/Header"):
        load(path)
    datasets, header = ic_files.tables(ic_files.particles(2, 0))
    ic_files.write_hdf5(path, datasets, header)
    with messages.raised(FileError, "holds no particle"):
        load(path)


def test_dataset_without_end_is_refused_before_it_fills_memory(tmp_path):
    path = ic_files.write_hdf5(tmp_path / "ic.hdf5", *ic_files.tables(ic_files.particles()))
    with h5py.File(path, "a") as file:
        del file["PartType0/Coordinates"]
        file["PartType0"].create_dataset("Coordinates", (10**12, 3), "f8", chunks=(10, 3))
    with pytest.raises(FileError, match="at most 100000000 particles"):
        load(path)


@pytest.mark.parametrize("path", ["a\\u0000b", "a\\nb", ""])
def test_path_that_names_no_file(path):
    text = f'[problem]\nname = "file"\npath = "{path}"\n'
    if not path:  # the sample
        assert config.from_text(text).problem.n == 1024
        return
    with pytest.raises(ConfigError, match=r"line 3: problem.path = .* expected printable UTF-8"):
        config.from_text(text)


def test_file_that_is_not_hdf5_is_refused(messages, tmp_path):
    path = tmp_path / "ic.hdf5"
    with messages.raised(FileError, "No such file"):
        load(path)
    path.write_bytes(b"")
    with messages.raised(FileError, "is empty"):
        load(path)
    path.write_text("x,y,z\n0,0,0\n")
    with messages.raised(FileError, "neither an HDF5 file"):
        load(path)
    good = ic_files.write_hdf5(tmp_path / "good", *ic_files.tables(ic_files.particles()))
    path.write_bytes(good.read_bytes()[:800])
    with messages.raised(FileError, "cut short"):
        load(path)
    with messages.raised(FileError, "is not a regular file"):
        load(tmp_path)


NPZ = {
    "missing array": ({"mass": None}, "no array mass"),
    "objects": ({"mass": np.array([None] * N)}, "cannot be read"),
    "shape": ({"velocity": np.zeros((N + 1, 2))}, "velocity has the shape"),
    "four components": ({"position": np.zeros((N, 4))}, "position has the shape"),
    "NaN": ({"internal_energy": np.full(N, np.nan)}, "internal_energy has nan"),
    "other field": ({"density": np.ones(3)}, "density has the shape"),
    "domain": ({"domain": [1.0, 0.0]}, "domain is [1.0, 0.0]"),
    "outside the domain": ({"domain": [0.0, 0.5]}, "outside the box"),
}


@pytest.mark.parametrize("case", NPZ)
def test_malformed_npz_file_is_refused(messages, tmp_path, case):
    changes, named = NPZ[case]
    arrays = {k: v for k, v in (ic_files.particles() | changes).items() if v is not None}
    np.savez(tmp_path / "ic.npz", **arrays)
    with messages.raised(FileError, "ic.npz: ", named, "expected"):
        load(tmp_path / "ic.npz")


def test_damaged_npz_file_is_refused(tmp_path):
    np.savez(tmp_path / "ic.npz", **ic_files.particles())
    content = (tmp_path / "ic.npz").read_bytes()
    for end in (10, 400, len(content) - 30):
        (tmp_path / "ic.npz").write_bytes(content[:end])
        with pytest.raises(FileError, match=r"cannot be read as an .npz file"):
            load(tmp_path / "ic.npz")


def test_damaged_hdf5_file_never_ends_in_a_traceback(tmp_path):
    """Whatever bytes are wrong, the file is read or refused."""
    good = ic_files.write_hdf5(tmp_path / "good", *ic_files.tables(ic_files.particles()))
    content, random = good.read_bytes(), np.random.default_rng(0)
    for _ in range(100):
        wrong = bytearray(content)
        for at in random.integers(0, 4000, 3):
            wrong[at] = random.integers(0, 256)
        (tmp_path / "ic.hdf5").write_bytes(wrong)
        with contextlib.suppress(FileError):
            load(tmp_path / "ic.hdf5")
