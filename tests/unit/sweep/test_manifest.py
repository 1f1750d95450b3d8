"""The directory of a sweep: made once, extended, and refused where it is of something else."""

import os

import h5py
import pytest

from sph import config as configuration
from sph.errors import ConfigError, FileError
from sph.output.run_directory import RunDirectory
from sph.sweep.manifest import SweepDirectory
from sph.sweep.plan import Plan
from sph.sweep.task import execute, standing, tasks

TUBE = '[problem]\nname = "shock_tube"\nn = 40\n'


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "tube.toml"
    path.write_text(TUBE)
    return path


@pytest.fixture
def sweep(tmp_path):
    return SweepDirectory(tmp_path / "sweep")


def of(*varies, overrides=()):
    return Plan.of(varies, overrides)


def files(directory):
    return {path: path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def test_manifest_equals_plan(config, sweep):
    plan = of("problem.n=40,50", "physics.alpha={min = 0.1, max = 2.0},1.0",
              overrides=["physics.kernel=cubic_spline"])  # fmt: skip
    sweep.prepare(config, plan)
    assert sweep.plan() == plan
    assert sweep.base.read_text() == TUBE
    sweep.prepare(config, plan)
    assert sweep.plan() == plan


def test_values_can_be_added(config, sweep):
    sweep.prepare(config, of("problem.n=40,50"))
    sweep.prepare(config, of("problem.n=60"))
    assert sweep.plan() == of("problem.n=40,50,60")


def test_equal_configuration_from_other_source_is_accepted(config, sweep):
    sweep.prepare(config, of("problem.n=50,60"))
    config.write_text("# as before\n" + TUBE.replace("n = 40", "n = 70"))
    # n is varied, the rest are defaults, and threads change no result
    sweep.prepare(config, of("problem.n=50", overrides=["physics.C=0.15", "run.threads=1"]))
    assert sweep.plan() == of("problem.n=50,60")


@pytest.mark.parametrize(
    ("plan", "keys"),
    [
        (of("problem.n=50", overrides=["physics.C=0.3"]), ["physics.C"]),
        (of("problem.n=90", overrides=["physics.C=0.3"]), ["physics.C"]),
        (of("physics.alpha=1.0"), ["problem.n", "physics.alpha"]),
    ],
)
def test_other_sweep_in_directory_is_refused(messages, plan, keys, config, sweep):
    sweep.prepare(config, of("problem.n=50,60"))
    before = files(sweep.path)
    with messages.raised(ConfigError, *keys, "Try: "):
        sweep.prepare(config, plan)
    assert files(sweep.path) == before


def test_changed_configuration_file_is_refused(messages, config, sweep):
    sweep.prepare(config, of("problem.n=50"))
    config.write_text(TUBE + "[physics]\nbalsara = false\n")
    with messages.raised(ConfigError, "physics.balsara"):
        sweep.prepare(config, of("problem.n=50"))


def test_other_run_in_place_of_point_is_refused(messages, config, sweep):
    sweep.prepare(config, of("problem.n=50"))
    run = RunDirectory.create(sweep.path / "problem.n=50")
    other = configuration.load(config, ["problem.n=50", "time.end=0.3"])
    run.write_config(other.to_toml())
    run.write_summary({"status": "done"})
    with messages.raised(ConfigError, "time.end"):
        sweep.prepare(config, of("problem.n=50"))


def test_directory_of_other_files_is_refused(messages, config, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").touch()
    for path in (tmp_path / "mine", config):
        with messages.raised(FileError):
            SweepDirectory(path).prepare(config, of("problem.n=50"))


def test_invalid_point_creates_no_directory(config, sweep):
    with pytest.raises(ConfigError):
        sweep.prepare(config, of("problem.n=50,-1"))
    assert not sweep.path.exists()


@pytest.mark.parametrize("text", [
    "", "points = 1", "[[", 'set = "x"\n[vary]\n[points]', "set = []\n[vary]\nx = 1\n[points]",
    "set = []\n[vary]\n[points]\na = [1]", "a = " + "[" * 5000,
])  # fmt: skip
def test_invalid_manifest_is_refused(messages, text, config, sweep):
    sweep.prepare(config, of("problem.n=50"))
    sweep.manifest.write_text(text)
    with messages.raised(FileError):
        sweep.prepare(config, of("problem.n=50"))


def test_reason_not_text_is_shown_as_far_as_possible(config, sweep):
    plan = of("problem.n=50,60,70,80")
    sweep.prepare(config, plan)
    names = [point.name for point in plan.points]
    os.mkfifo(sweep.logs / f"{names[3]}.failed")
    (sweep.logs / f"{names[0]}.failed").write_bytes(b"no\xff text\n")
    (sweep.logs / f"{names[1]}.failed").touch()
    (sweep.logs / f"{names[2]}.failed").mkdir()
    found = sweep.failures()
    assert found[names[0]] == "no\ufffd text"
    assert found[names[1]] == "no reason was kept"
    assert found[names[2]].startswith("the reason cannot be read: ")
    assert found[names[3]].startswith("the reason cannot be read: ")
    standings = [standing(task) for task in tasks(sweep, plan)]
    assert [one.status for one in standings] == ["failed", "failed", "stopped", "stopped"]
    assert standings[0].reason == found[names[0]]


def test_pipe_in_sweep_directory_is_not_waited_for(messages, config, sweep):
    sweep.prepare(config, of("problem.n=50"))
    sweep.base.unlink()
    os.mkfifo(sweep.base)
    with messages.raised(FileError, "base.toml"):
        sweep.prepare(config, of("problem.n=50"))


@pytest.mark.parametrize(
    "text", ["[" * 100_000, "[]", '{"status": "done", "warnings": 5}', '{"warnings": [1, {}]}']
)
def test_point_with_damaged_summary_has_status(config, sweep, text):
    plan = of("problem.n=50")
    sweep.prepare(config, plan)
    (task,) = tasks(sweep, plan)
    task.run.path.mkdir()
    task.run.summary.write_text(text)
    assert standing(task).status == ("done" if "done" in text else "stopped")
    assert standing(task).warnings == ()


@pytest.mark.parametrize("has_base", [False, True])
def test_sweep_killed_while_preparing_can_be_run_again(config, sweep, has_base):
    sweep.logs.mkdir(parents=True)
    (sweep.path / ".base.toml.0123.partial").touch()
    if has_base:
        sweep.base.write_text(TUBE)
    sweep.prepare(config, of("problem.n=40,50"))
    assert sweep.plan() == of("problem.n=40,50")


@pytest.mark.parametrize("there", ["logs/notes.txt", "notes.txt", "base.toml"])
def test_directory_with_foreign_files_after_kill_is_refused(messages, config, sweep, there):
    sweep.logs.mkdir(parents=True)
    (sweep.path / there).write_text("[problem]\n")
    before = files(sweep.path)
    with messages.raised(FileError):
        sweep.prepare(config, of("problem.n=40,50"))
    assert files(sweep.path) == before


def test_logs_directory_link_is_refused(messages, config, sweep, tmp_path):
    sweep.prepare(config, of("problem.n=40,50"))
    sweep.logs.rename(tmp_path / "elsewhere")
    sweep.logs.symlink_to(tmp_path / "elsewhere")
    with messages.raised(FileError):
        sweep.prepare(config, of("problem.n=40,50"))


def test_log_link_is_not_written_through(config, sweep, tmp_path):
    sweep.prepare(config, of("problem.n=40"))
    (tmp_path / "mine").write_text("precious")
    (task,) = tasks(sweep, sweep.plan())
    task.log.symlink_to(tmp_path / "mine")
    outcome = execute(task)
    assert (outcome.status, outcome.code) == ("failed", 4)
    assert (tmp_path / "mine").read_text() == "precious"


def test_point_with_unreadable_checkpoint_is_not_restarted_from_scratch(config, sweep):
    """It would replace what a newer version may have written."""
    sweep.prepare(config, of("problem.n=40"))
    (task,) = tasks(sweep, sweep.plan())
    run = RunDirectory.create(task.run.path)
    run.write_config(configuration.load(config).to_toml())
    with h5py.File(run.checkpoint_path(0), "w") as file:
        file.create_group("Checkpoint").attrs["format_version"] = 1000
    outcome = execute(task)
    assert (outcome.status, outcome.code) == ("failed", 4)
    assert "a newer format" in outcome.reason
    run.checkpoint_path(0).write_bytes(b"damaged")
    assert "--force" in task.command()
