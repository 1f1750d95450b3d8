"""Single precision of the sums over neighbours: threads, restarts and the lineage."""

import shutil

import pytest
from click.testing import CliRunner

from sph import config as configuration
from sph import threads
from sph.cli import main
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import state_hash
from sph.output.run_directory import RunDirectory

TUBE = """\
[problem]
name = "shock_tube"
n = 60
[time]
end = 0.02
[output]
interval = 0.01
[run]
threads = 1
precision = "single"
"""
SHEAR = """
[problem]
name = "kelvin_helmholtz"
n = 4400
[time]
end = 0.02
[output]
interval = 0.02
[run]
precision = "single"
"""


def sph_(*arguments):
    result = CliRunner().invoke(main, [str(one) for one in arguments])
    assert result.exit_code == 0, result.output


def bits(path):
    return state_hash(checkpoints.read(path).particles.arrays())


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    home = tmp_path_factory.mktemp("precision")
    (home / "tube.toml").write_text(TUBE)
    sph_("run", home / "tube.toml", "-o", home / "run")
    return RunDirectory(home / "run")


def test_number_of_threads_changes_no_bit(simulate, monkeypatch):
    monkeypatch.setattr(threads, "CHUNK", 1000)  # so that loops over particles are shared, too
    config = configuration.from_text(SHEAR)
    runs = [simulate(config, number) for number in (1, 2, 3)]
    for _ in range(4):
        for run in runs:
            run.advance(0.02)
        hashes = {state_hash(run.particles.arrays()) for run in runs}
        assert len(hashes) == 1


@pytest.mark.parametrize("alone", [False, True], ids=["run", "lone checkpoint"])
def test_restart_without_settings_keeps_precision_and_bits(finished, tmp_path, alone):
    source = finished.checkpoint_path(1)
    if alone:
        source = shutil.copy(source, tmp_path / "lone.h5")
    sph_("restart", source, "-o", tmp_path / "new")
    again = RunDirectory(tmp_path / "new").checkpoint_path(2)
    assert bits(again) == bits(finished.checkpoint_path(2))
    assert checkpoints.read(again).config.run.precision == "single"


def test_changed_precision_is_recorded_and_kept(finished, tmp_path):
    run = RunDirectory(shutil.copytree(finished.path, tmp_path / "run"))
    sph_("restart", run.checkpoint_path(1), "--set", "run.precision=double")
    last = checkpoints.read(run.checkpoint_path(2))
    assert last.lineage[-1].endswith('with run.precision = "double" (was "single")')
    # the checkpoint itself holds the change, in case the restart is stopped at once
    assert checkpoints.read(run.checkpoint_path(1)).config.run.precision == "double"
    assert bits(run.checkpoint_path(2)) != bits(finished.checkpoint_path(2))
