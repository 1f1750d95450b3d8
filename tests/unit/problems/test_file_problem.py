"""Initial states from files: the layouts that are accepted, and how they get into a run."""

import hashlib
import os
from pathlib import Path

import h5py
import ic_files
import numpy as np
import pytest
import swiftsimio_files

from sph import config, runner
from sph.errors import ConfigError
from sph.output import checkpoint as checkpoints
from sph.output.run_directory import RunDirectory
from sph.problems import files
from sph.progress import Lines
from sph.restarting import restart

ORDER = ("position", "velocity", "mass", "internal_energy")


def made(path, *overrides, keys=""):
    """Return the configuration of a file."""
    text = f'[problem]\nname = "file"\npath = "{path}"\n{keys}'
    return config.from_text(text).override(overrides)


def initial(found):
    return found.problem.initial(found.physics.eos_model())


def check_state(found, state, rtol=0.0):
    """Check a configuration's initial state: that of `ic_files.particles`, (n, D) as (D, n)."""
    start = initial(found)
    for name in ORDER:
        array = np.asarray(state[name])
        np.testing.assert_allclose(getattr(start, name), array.T, rtol=rtol)
        assert getattr(start, name).dtype == np.float64
        assert getattr(start, name).flags.c_contiguous


@pytest.fixture
def hdf5(tmp_path):
    """hdf5(state, rename={}, drop=(), header={}, **groups): the path of a file."""

    def write(state, rename=None, drop=(), header=None, **groups):
        datasets, attributes = ic_files.tables(state, **(header or {}))
        for name, other in (rename or {}).items():
            datasets[other] = datasets.pop(name)
        for name in drop:
            datasets.pop(name, None)
            attributes.pop(name, None)
        return ic_files.write_hdf5(tmp_path / "ic.hdf5", datasets, attributes, **groups)

    return write


# --- HDF5 -------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_swift_file_gives_particles_box_and_dimension(hdf5, dimension):
    state = ic_files.particles(dimension)
    path = hdf5(state)
    found = made(path)
    check_state(found, state)
    problem = found.problem
    assert (problem.dimension, problem.n, problem.boundary) == (dimension, ic_files.N, "periodic")
    assert problem.domain == [[0.0, 1.0]] * dimension
    assert problem.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


PLURAL = {"InternalEnergy": "InternalEnergies", "Masses": "Mass", "Velocities": "Velocity"}
VARIANTS = {
    "plural energies, singular mass": {"rename": PLURAL},
    "no IDs": {"drop": ["ParticleIDs"]},
    "vector box": {"header": {"BoxSize": [1.0, 1.0, 1.0]}},
    "box of one element": {"header": {"BoxSize": [1.0]}},
    "units": {"Units": {"Unit mass in cgs (U_M)": [1.0]}},
    "dimension in HydroScheme": {"header": {"Dimension": 3}, "HydroScheme": {"Dimension": [2]}},
    "array of files": {"header": {"NumFilesPerSnapshot": [1], "Flag_Entropy_ICs": [0] * 6}},
    "no counts": {"drop": ["NumPart_ThisFile", "NumPart_Total", "NumFilesPerSnapshot"]},
    "no cosmology": {"Cosmology": {"Cosmological run": [0]}},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_variant_of_layout_gives_same_particles(hdf5, variant):
    state = ic_files.particles()
    found = made(hdf5(state, **VARIANTS[variant]))
    check_state(found, state)
    assert found.problem.domain == [[0.0, 1.0]] * 2


def test_masses_from_table_and_gadget_2_names(hdf5):
    state = ic_files.particles(3)
    path = hdf5(state, drop=["Masses", "Dimension"], header={"MassTable": [0.25, 0, 0, 0, 0, 0]})
    check_state(made(path), state | {"mass": np.full(ic_files.N, 0.25)})


def test_single_precision_is_widened_and_may_round_beyond_the_box(tmp_path):
    state = ic_files.particles()
    state["position"][4] = 1.0
    datasets, header = ic_files.tables(state, BoxSize=0.1)
    single = {name: one.astype(np.float32) for name, one in datasets.items() if one.ndim == 2}
    single["Coordinates"] *= np.float32(0.1)
    assert float(single["Coordinates"].max()) > 0.1  # the nearest number of single precision
    path = ic_files.write_hdf5(tmp_path / "ic.hdf5", datasets | single, header)
    position = initial(made(path)).position
    assert position.dtype == np.float64
    assert (position[:, 4] == 0.0).all()  # the upper end of a periodic axis is the lower one
    others = np.delete(np.arange(ic_files.N), 4)
    np.testing.assert_array_equal(
        position[:, others], single["Coordinates"][others, :2].T.astype(float)
    )


def test_particles_are_in_the_order_of_their_ids(tmp_path):
    state = ic_files.particles()
    datasets, header = ic_files.tables(state)
    datasets["Density"] = np.arange(1.0, ic_files.N + 1.0)
    order = np.random.default_rng(1).permutation(ic_files.N)
    shuffled = {name: array[order] for name, array in datasets.items()}
    shuffled["ParticleIDs"] = 10 * shuffled["ParticleIDs"]
    found = made(ic_files.write_hdf5(tmp_path / "ic.hdf5", shuffled, header))
    check_state(found, state)
    np.testing.assert_array_equal(initial(found).others["density"], datasets["Density"])


def test_without_box_particles_are_open_in_their_extent(hdf5):
    state = ic_files.particles()
    found = made(hdf5(state, header={"BoxSize": 0.0})).problem
    assert found.boundary == "open"
    low, high = state["position"].min(axis=0), state["position"].max(axis=0)
    np.testing.assert_array_equal(found.domain, np.stack([low, high], axis=1))


def test_given_keys_replace_those_of_file(hdf5):
    keys = 'domain = [[-1.0, 2.0], [0.0, 1.0]]\nboundary = ["open", "mirror"]\n'
    found = made(hdf5(ic_files.particles()), keys=keys).problem
    assert found.domain == [[-1.0, 2.0], [0.0, 1.0]]
    assert found.boundaries == ("open", "mirror")


# --- .npz -------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("upright", [True, False])
def test_npz_gives_particles_and_others(tmp_path, dimension, upright):
    state = ic_files.particles(dimension)
    stored = state if upright else state | {n: state[n].T for n in ("position", "velocity")}
    np.savez(tmp_path / "ic.npz", **stored, density=state["mass"])
    found = made(tmp_path / "ic.npz")
    check_state(found, state)
    assert found.problem.boundary == "open"
    np.testing.assert_array_equal(initial(found).others["density"], state["mass"])


def test_npz_with_domain_is_periodic(tmp_path):
    np.savez(tmp_path / "ic.npz", **ic_files.particles(), domain=[0.0, 2.0])
    found = made(tmp_path / "ic.npz").problem
    assert (found.boundary, found.domain) == ("periodic", [[0.0, 2.0]] * 2)


# --- paths and identity -----------------------------------------------------------------------


def test_relative_path_begins_at_configuration_file_or_with_set_here(tmp_path, monkeypatch):
    (tmp_path / "there").mkdir()
    (tmp_path / "here").mkdir()
    for folder, shift in (("there", 0.0), ("here", 1.0)):
        state = ic_files.particles()
        state["velocity"] += shift
        np.savez(tmp_path / folder / "ic.npz", **state)
    text = '[problem]\nname = "file"\npath = "ic.npz"\n'
    (tmp_path / "there" / "mine.toml").write_text(text)
    monkeypatch.chdir(tmp_path / "here")
    found = config.load("../there/mine.toml")
    assert found.problem.path == str(tmp_path / "there" / "ic.npz")
    check_state(found, ic_files.particles())
    for other in (
        config.load("../there/mine.toml", ["problem.path=ic.npz"]), config.from_text(text),
    ):  # fmt: skip
        assert other.problem.path == str(tmp_path / "here" / "ic.npz")
        assert other.problem.sha256 != found.problem.sha256


def test_file_is_read_once_and_arrays_are_not_kept(hdf5, monkeypatch):
    opened, actual = [], files._read
    monkeypatch.setattr(files, "_read", lambda *a: opened.append(a) or actual(*a))
    path = hdf5(ic_files.particles())
    found = config.from_text(f'[problem]\nname = "file"\npath = "{path}"\n')
    initial(found)
    assert len(opened) == 1
    assert not files._last


def test_changed_file_is_refused(messages, hdf5):
    state = ic_files.particles()
    path = hdf5(state)
    found = made(path)
    text = found.to_toml()
    path.write_bytes(path.read_bytes() + b"0")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    files._last.clear()  # as in another process
    found = config.from_text(text)  # complete: the file is not read, as in a restart
    with messages.raised(ConfigError, "problem.sha256", digest, mask="[0-9a-f]{64}"):
        initial(found)
    with messages.raised(ConfigError, "line 4: problem.sha256", digest, mask="[0-9a-f]{64}"):
        made(path, keys=f'sha256 = "{"0" * 64}"\n')
    with messages.raised(ConfigError, "problem.n = 13", "expected 12"):
        made(path, keys="n = 13\n")


# --- runs -------------------------------------------------------------------------------------

CLOUDS = ["time.end=0.01", "output.interval=0.005", "problem.n=1024"]


def run(found, directory):
    """Run a configuration; return its last checkpoint."""
    target = RunDirectory.create(directory)
    runner.run(found, target, Lines())
    return checkpoints.read(target.checkpoints()[-1])


def state_hash(checkpoint) -> str:
    return checkpoints.state_hash(checkpoints._state(checkpoint))


@pytest.fixture(scope="module")
def clouds(tmp_path_factory):
    """The last checkpoint of the two clouds of `regions`, and its path."""
    directory = tmp_path_factory.mktemp("clouds") / "run"
    last = run(config.from_text('[problem]\nname = "regions"\n').override(CLOUDS), directory)
    return last, RunDirectory(directory).checkpoints()[-1]


def test_clouds_by_regions_sample_hdf5_and_npz_are_same_bits(clouds, tmp_path):
    regions = config.from_text('[problem]\nname = "regions"\n')
    start = initial(regions)
    gas = {name: getattr(start, name).T for name in ORDER}
    np.savez(tmp_path / "ic.npz", **gas, domain=[0.0, 1.0])
    datasets, header = ic_files.tables(gas)
    written = ic_files.write_hdf5(tmp_path / "ic.hdf5", datasets, header)
    for i, path in enumerate((files.SAMPLE, tmp_path / "ic.npz", written)):
        last = run(made(path, *CLOUDS), tmp_path / f"run_{i}")
        assert state_hash(last) == state_hash(clouds[0])


def test_end_of_run_is_start_of_another(clouds, tmp_path):
    last, path = clouds
    found = made(path)
    assert (found.problem.dimension, found.problem.n) == (2, 1024)
    assert (found.problem.domain, found.problem.boundary) == ([[0.0, 1.0]] * 2, "periodic")
    start = initial(found)
    for name in ORDER:
        expected = last.by_id(getattr(last.particles, name))
        # positions lie in the box from 0 to 1, so they are stored as they are
        np.testing.assert_array_equal(getattr(start, name), expected)


def test_checkpoint_of_open_box_keeps_coordinates_and_domain(tmp_path):
    text = '[problem]\nname = "particles"\ndimension = 2\n'
    text += "positions = [[-0.3, 0.1], [-0.1, 0.2], [0.1, 0.0], [0.3, -0.2]]\n"
    text += "[time]\nend = 0.02\n[output]\ninterval = 0.02\n"
    last = run(config.from_text(text), tmp_path / "run")
    found = made(RunDirectory(tmp_path / "run").checkpoints()[-1])
    assert (found.problem.domain, found.problem.boundary) == ([[-1.0, 1.0]] * 2, "open")
    # stored from the corner of the box at -1: two roundings of numbers up to 2
    np.testing.assert_allclose(
        initial(found).position, last.by_id(last.particles.position), rtol=0, atol=1e-15
    )


def test_restart_needs_no_file(tmp_path, hdf5):
    state = ic_files.particles(2, 200)
    state["position"] = np.indices((20, 10)).reshape(2, 200).T / [20.0, 10.0] + 0.01
    path = hdf5(state)
    overrides = ["time.end=0.002", "output.interval=0.001"]
    whole = run(made(path, *overrides), tmp_path / "run")
    os.remove(path)
    first = RunDirectory(tmp_path / "run").checkpoints()[1]
    restart(first, [], tmp_path / "again", Lines())
    again = checkpoints.read(RunDirectory(tmp_path / "again").checkpoints()[-1])
    assert state_hash(again) == state_hash(whole)
    assert again.config.problem.sha256 == whole.config.problem.sha256
    with h5py.File(first) as file:
        assert whole.config.problem.sha256 in file["Checkpoint"].attrs["configuration"]


def test_sample_is_what_its_script_writes(tmp_path):
    import runpy

    script = Path(__file__).parents[3] / "scripts" / "two_clouds.py"
    path = tmp_path / "clouds.hdf5"
    runpy.run_path(str(script))["write"](path)
    with h5py.File(path) as one, h5py.File(files.SAMPLE) as other:
        assert set(one["PartType0"]) == set(other["PartType0"])
        for name, dataset in one["PartType0"].items():
            np.testing.assert_array_equal(dataset[()], other["PartType0"][name][()])


@pytest.mark.parametrize("dimension", [2, 3])
def test_file_of_swiftsimio_writer_is_read(dimension):
    path = swiftsimio_files.STORED[dimension]
    state = ic_files.particles(dimension)
    found = made(path)
    check_state(found, state, rtol=1e-15)  # swiftsimio converts the units of energies
    assert (found.problem.dimension, found.problem.boundary) == (dimension, "periodic")
    # swiftsimio's solar mass differs from ours in the 6th digit
    stated = [1.0, 1.0, 1.0] if dimension == 2 else [3.0857e18, 1.9884e33, 3.15576e13]
    assert found.problem.file_units == pytest.approx(stated, rel=1e-5)


@pytest.mark.parametrize("dimension", [2, 3])
def test_stored_file_is_what_swiftsimio_writes(tmp_path, dimension):
    pytest.importorskip("swiftsimio")
    swiftsimio_files.write(tmp_path / "ic.hdf5", dimension)
    with (
        h5py.File(tmp_path / "ic.hdf5") as one,
        h5py.File(swiftsimio_files.STORED[dimension]) as other,
    ):
        assert set(one["PartType0"]) == set(other["PartType0"])
        for name, dataset in one["PartType0"].items():
            np.testing.assert_allclose(dataset[()], other["PartType0"][name][()], rtol=1e-15)
        for group in ("Header", "Units"):
            assert set(one[group].attrs) == set(other[group].attrs)
