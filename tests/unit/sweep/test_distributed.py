"""Sweeps by Dask: the same numbers, on a cluster in this process and on a scheduler of its own."""

import json
import subprocess
import sys

import pytest
from sweeps import TWELVE, attempts, hashes, runs, until

distributed = pytest.importorskip("distributed")


@pytest.fixture
def cluster():
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",  # for clients in other processes
        host="127.0.0.1",
        dashboard_address=None,
    ) as found:
        yield found


@pytest.fixture
def address(tmp_path):
    """A scheduler and a worker, each a process started as a user would."""
    file = tmp_path / "scheduler.json"
    options = ["--scheduler-file", str(file), "--no-dashboard"]
    commands = [
        ["scheduler", *options, "--host", "127.0.0.1", "--port", "0"],
        ["worker", *options, "--nthreads", "2", "--local-directory", str(tmp_path)],
    ]
    started = []
    try:
        for command in commands:
            started.append(
                subprocess.Popen(
                    [sys.executable, "-m", "dask", *command],
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
            )
            until(lambda: file.exists() and file.read_text())  # the file is empty at first
        yield json.loads(file.read_text())["address"]
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait(30)


@pytest.mark.slow
def test_sweep_by_dask_equals_local_sweep(killed_sweep, cluster, program, tmp_path):
    """Bit for bit those of a sweep that was killed and went on from checkpoints."""
    result = program.run(*TWELVE, "--scheduler", cluster.scheduler_address, "-o", tmp_path / "dask")
    assert result.exit_code == 0, result.output
    assert len(runs(tmp_path / "dask")) == 12
    assert hashes(tmp_path / "dask") == hashes(killed_sweep.path)


@pytest.mark.slow
def test_sweep_with_external_scheduler_reports_failures(address, program, tmp_path):
    path = tmp_path / "sweep"
    arguments = ("--vary", "physics.max_energy_drift=0.02,1e-15", "--set", "time.end=0.002",
                 "--scheduler", address, "-o", path)  # fmt: skip
    result = program.run(*arguments)
    assert result.exit_code == 3, result.output
    assert "1 of 2 points are done, 1 failed:\n  physics.max_energy_drift=1e-15: " in result.stderr
    result = program.run(*arguments)
    assert result.exit_code == 3
    assert attempts(path, "physics.max_energy_drift=0.02") == ["run"]
    assert attempts(path, "physics.max_energy_drift=1e-15") == ["run", "run"]


@pytest.mark.slow
def test_sigterm_stops_dask_workers(cluster, program, tmp_path):
    path = tmp_path / "sweep"
    process = program.started("--vary", "problem.n=40,50,60", "--set", "time.end=4.0",
                              "--scheduler", cluster.scheduler_address, "-o", path)  # fmt: skip
    until(lambda: len(list(path.glob("*/checkpoints/checkpoint_000002.h5"))) == 2)
    process.terminate()
    _, told = process.communicate(timeout=60)
    assert process.returncode == 75, told
    assert "0 of 3 points are done" in told
    assert "Traceback" not in told
    assert sum(run.summary.exists() for run in runs(path).values()) == 2


def test_worker_without_shared_files_is_reported(cluster, program, tmp_path, monkeypatch):
    from sph.sweep import distributed as ours
    from sph.sweep.manifest import SweepDirectory
    from sph.sweep.plan import Point
    from sph.sweep.task import Task

    told = []
    elsewhere = Task(SweepDirectory(tmp_path / "nowhere"), Point("a", ()), ())
    ours.run([elsewhere], cluster.scheduler_address, told.append)
    assert [one.status for one in told] == ["failed"]
    assert "the files of a sweep must be shared" in told[0].reason


def test_unreachable_scheduler_exits_with_4(program, tmp_path, monkeypatch):
    monkeypatch.setattr("sph.sweep.distributed.CONNECT_SECONDS", 0.2)
    result = program.run("--vary", "problem.n=40", "-o", tmp_path / "sweep",
                         "--scheduler", "tcp://127.0.0.1:9")  # fmt: skip
    assert result.exit_code == 4, result.output
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "module", "words"),
    [
        (["--scheduler", "tcp://127.0.0.1:9"], "distributed", 'pip install "sph[dask]"'),
        (["--slurm", "timeout_min=5"], "submitit", 'pip install "sph[slurm]"'),
    ],
)
def test_missing_extra_is_named(arguments, module, words, program, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    result = program.run("--vary", "problem.n=40", "-o", tmp_path / "sweep", *arguments)
    assert result.exit_code == 2
    assert words in result.stderr
    assert "Traceback" not in result.output
