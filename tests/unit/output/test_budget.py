"""The energy budget that a run goes on with after a restart: of the checkpoint, or the history."""

import io
import math
import shutil

import h5py
import numpy as np
import pytest

from sph import config as configuration
from sph import restarting, runner
from sph.integrators import step_size
from sph.output import checkpoint, files, stored
from sph.output.history import read as read_history
from sph.output.run_directory import RunDirectory
from sph.progress import Lines

# Two streams part so fast that a step takes more than half of the internal energy, which is kept
# positive, beside a source: so energy is injected, added, and drifts.
PARTING = """
[problem]
name = "shock_tube"
n = 60
boundary = "open"
left = { density = 1.0, velocity = -10.0, pressure = 0.7 }
right = { density = 1.0, velocity = 10.0, pressure = 0.7 }
[physics]
energy_limit = false
C = 0.4
max_energy_drift = 10.0
heating = { name = "relaxation", energy = 1.0, time = 0.1 }
[time]
end = 0.04
[output]
interval = 0.01
[run]
threads = 1
"""
OF_THE_BUDGET = ("energy_injected", "energy_added", "energy_drift")


@pytest.fixture(scope="module")
def long_steps():
    """Without the bound on the change of supports, steps are long enough for the rule to act."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(step_size, "SUPPORT_CHANGE", math.inf)
        yield


@pytest.fixture(scope="module")
def parting(tmp_path_factory, long_steps):
    """The run, to its end, in one go."""
    directory = RunDirectory.create(tmp_path_factory.mktemp("budget") / "run")
    runner.run(configuration.from_text(PARTING), directory, Lines())
    past = read_history(directory.history)
    (row,) = np.flatnonzero(past["step"] == checkpoint.read(directory.checkpoint_path(2)).step)
    assert all(past[name][row] != 0.0 for name in OF_THE_BUDGET)  # else there is none to keep
    return directory


def as_format_1(path):
    """Make of a checkpoint what an earlier version would have written."""
    old = checkpoint.read(path)
    old.budget = None
    checkpoint.write(path, old)
    with h5py.File(path, "r+") as file:
        del file["Checkpoint"].attrs["fields"]
        assert file["Checkpoint"].attrs["format_version"] == 1
        assert not {*stored.ENERGIES} & {*file["Checkpoint"]}
    with io.FileIO(path, "r+") as file:
        files.seal(file)


def assert_goes_on_as(past, uninterrupted):
    """Every row has the bits of the run that was not interrupted, but for what a clock says."""
    rows = uninterrupted["step"] >= past["step"][0]
    assert past.keys() == uninterrupted.keys()
    for name in past.keys() - {"wall_seconds", "cpu_seconds"}:
        # a history that begins with a checkpoint does not know what set the step then
        first = int(name.startswith("limiter") and past["step"][0] > 0)
        assert past[name][first:].tolist() == uninterrupted[name][rows][first:].tolist(), name


@pytest.mark.slow
def test_restart_of_format_1_takes_budget_from_history(parting, tmp_path):
    run = RunDirectory(shutil.copytree(parting.path, tmp_path / "run"))
    source = run.checkpoint_path(2)
    whole = checkpoint.read(source)
    as_format_1(source)
    old = checkpoint.read(source)
    assert old.budget is None
    assert checkpoint.state_hash(old.particles.arrays()) == checkpoint.state_hash(
        whole.particles.arrays()
    )
    restarting.restart(source, [], None, Lines())
    assert_goes_on_as(read_history(run.history), read_history(parting.history))
    last = checkpoint.read(run.checkpoint_path(4))
    assert last.budget == checkpoint.read(parting.checkpoint_path(4)).budget


@pytest.mark.slow
def test_restart_without_run_takes_budget_from_checkpoint(parting, tmp_path):
    lone = tmp_path / "lone.h5"
    shutil.copy(parting.checkpoint_path(2), lone)
    _, run = restarting.restart(lone, [], tmp_path / "elsewhere", Lines())
    past = read_history(run.history)
    assert past["step"][0] == checkpoint.read(lone).step
    assert_goes_on_as(past, read_history(parting.history))
    last = checkpoint.read(run.checkpoint_path(2))
    assert last.budget == checkpoint.read(parting.checkpoint_path(4)).budget


@pytest.mark.slow
def test_restart_of_format_1_without_run_starts_new_budget(parting, tmp_path):
    lone = tmp_path / "lone.h5"
    shutil.copy(parting.checkpoint_path(2), lone)
    as_format_1(lone)
    _, run = restarting.restart(lone, [], tmp_path / "elsewhere", Lines())
    past, uninterrupted = read_history(run.history), read_history(parting.history)
    assert [past[name][0] for name in OF_THE_BUDGET] == [0.0, 0.0, 0.0]
    rows = uninterrupted["step"] >= checkpoint.read(lone).step
    assert past["total_energy"].tolist() == uninterrupted["total_energy"][rows].tolist()
