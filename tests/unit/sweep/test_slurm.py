"""Sweeps by submitit, whose local executor stands for Slurm: limits, failures, wrong options."""

import os
import signal

import pytest
from sweeps import attempts, hashes, until

from sph.sweep import slurm

pytest.importorskip("submitit")
psutil = pytest.importorskip("psutil")


def job_of(run):
    """ID of the process that submitit's limit signal goes to, for the point in that directory."""
    for process in psutil.process_iter(["cmdline"]):
        arguments = process.info["cmdline"] or []  # None where it ends as we look
        if "sph.cli" in arguments and str(run) in arguments:
            return process.ppid()
    return None


@pytest.mark.slow
def test_job_at_time_limit_continues_by_restart(program, tmp_path):
    arguments = ("--vary", "problem.n=40", "--set", "time.end=1.0")
    path = tmp_path / "sweep"
    process = program.started(*arguments, "--slurm", "cluster=local", "--slurm", "timeout_min=5",
                              "-o", path)  # fmt: skip
    run = path / "problem.n=40"
    until(lambda: (run / "checkpoints" / "checkpoint_000002.h5").exists())
    os.kill(until(lambda: job_of(run)), signal.SIGUSR2)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 0, told
    assert attempts(path, "problem.n=40") == ["run", "restart"]
    result = program.run(*arguments, "-o", tmp_path / "here")
    assert result.exit_code == 0
    assert hashes(path) == hashes(tmp_path / "here")


@pytest.mark.slow
def test_failed_job_is_reported(program, tmp_path):
    result = program.run("--vary", "physics.eta=5e4", "--slurm", "cluster=local", "-o",
                         tmp_path / "sweep")  # fmt: skip
    assert result.exit_code == 3, result.output
    assert "physics.eta=5e4: particle" in result.stderr


def test_slurm_options_are_parsed():
    found = slurm._read(["timeout_min=60", "partition=short", "cpus_per_task=4"])
    assert found == {"timeout_min": 60, "partition": "short", "cpus_per_task": 4}


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("partition", "expected KEY=VALUE"),
        ("timeout_min=soon", "timeout_min"),
        ("portition=short", "portition"),
        ("cluster=nowhere", "nowhere"),
    ],
)
def test_slurm_option_invalid_is_refused(option, words, program, tmp_path):
    local = [] if option.startswith("cluster") else ["--slurm", "cluster=local"]
    result = program.run("--vary", "problem.n=40", "-o", tmp_path / "sweep", "--slurm", option,
                         *local)  # fmt: skip
    assert result.exit_code == 2, result.output
    assert "--slurm" in result.stderr
    assert words in result.stderr


def test_slurm_with_scheduler_is_refused(program, tmp_path):
    places = ("--slurm", "timeout_min=5", "--scheduler", "tcp://127.0.0.1:9")
    result = program.run("--vary", "problem.n=40", "-o", tmp_path / "sweep", *places)
    assert result.exit_code == 2
    assert not (tmp_path / "sweep").exists()
