"""The program as a user meets it: exit codes, messages, signals."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path

import h5py
import pytest
from click.testing import CliRunner

import sph
from sph import config as configuration
from sph import fingerprint, progress, registry, runner
from sph.cli import main
from sph.output.checkpoint import state_hash
from sph.output.run_directory import RunDirectory
from sph.problems.support import glass

ROOT = Path(sph.__file__).parents[1]
CONFIGS = Path(__file__).parents[2] / "configs"
TUBE = """\
[problem]
name = "shock_tube"
n = 60
[time]
end = 0.2
[output]
interval = 0.05
[run]
threads = 1
"""


def sph_(*arguments):
    """The program in this process."""
    return CliRunner().invoke(main, [str(one) for one in arguments])


def started(directory, *arguments, **environment):
    """The program in a process of its own, its output in pipes."""
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, "-m", "sph.cli", *map(str, arguments)],
        cwd=directory,
        env={**os.environ, "PYTHONPATH": path, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # a shell may have told its background jobs to ignore it
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def read_until(stream, words):
    """Read lines up to the one with `words`; all of them."""
    lines = []
    for line in stream:
        lines.append(line)
        if words in line:
            return "".join(lines)
    raise AssertionError(f"{words!r} never came, but {lines}")


def finished(process):
    """Exit code, stdout and stderr once the process has ended."""
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


def hashes(run):
    """SHA-256 of the state of every checkpoint, by step."""
    found = {}
    for path in RunDirectory(run).checkpoints():
        with h5py.File(path) as file:
            state = {name: dataset[()] for name, dataset in file["Checkpoint"].items()}
        found[int(state["step"])] = state_hash(state)
    return found


@pytest.fixture
def refused(messages):
    """refused(result, code, *facts): an error with this exit code, and a message, no traceback.

    The message has each of `facts`; `mask` finds what varies in its text, which is kept.
    """

    def check(result, code, *facts, mask=None):
        assert result.exit_code == code, result.output
        assert isinstance(result.exception, SystemExit)
        assert "Traceback" not in result.output
        for fact in facts:
            assert fact in result.stderr
        assert result.stdout == ""
        messages.check(result.stderr, mask)

    return check


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "tube.toml"
    path.write_text(TUBE)
    return path


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A run, and what the program said."""
    directory = tmp_path_factory.mktemp("done")
    (directory / "tube.toml").write_text(TUBE)
    result = sph_("run", directory / "tube.toml", "-o", directory / "run")
    assert result.exit_code == 0, result.output
    return directory / "run", result


def copied(done, directory):
    return shutil.copytree(done[0], directory)


# --- exit code 0 ------------------------------------------------------------------------------


def test_run_prints_only_summary_on_stdout(done):
    run, result = done
    lines = result.stdout.splitlines()
    # the tube takes the number nearest to 60 that fills both sides
    assert re.fullmatch(r"shock_tube: 61 particles to t = 0\.2 in \d+ steps \(done\)\.", lines[0])
    assert lines[1].startswith("Error (L1 against the exact solution, the whole domain): density ")
    assert any(line.startswith("Conserved, at worst over the run: energy to ") for line in lines)
    assert any(line.startswith("Cost: ") and "compilation" in line for line in lines)
    assert lines[-1] == f"Results: {run} (`sph plot {run}` draws them)."
    assert "wrote checkpoint_000004.h5" in result.stderr
    assert "wrote" not in result.stdout


def test_run_directory_has_documented_files(done):
    run = done[0]
    found = {str(path.relative_to(run)) for path in run.rglob("*") if path.is_file()}
    assert found == {"config.toml", "history.csv", "summary.json"} | {
        f"checkpoints/checkpoint_{k:06d}.h5" for k in range(5)
    }
    resolved = configuration.load(run / "config.toml")
    assert resolved == configuration.from_text(TUBE)
    assert set(json.loads((run / "summary.json").read_text())) == {
        "status", "reason", "warnings", "version", "problem", "dimension", "particles", "time",
        "steps", "lineage", "settings_changed", "errors", "errors_left_out", "report",
        "conservation", "momentum_along", "nearest", "cost", "compiled_in",
        "left_out",
    }  # fmt: skip


def test_default_run_directory_named_after_configuration(config, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert sph_("run", "tube.toml", "--set", "time.end=0.01").exit_code == 0
    assert (tmp_path / "runs" / "tube" / "summary.json").exists()


def test_run_with_set_and_threads(config, tmp_path):
    result = sph_(
        "run", config, "-o", tmp_path / "run", "--set", "physics.alpha=2.0", "--threads", 2,
        "--set", "physics.kernel=wendland_c2", "--set", "time.end = 0.01",
    )  # fmt: skip
    assert result.exit_code == 0
    assert "on 2 thread(s)" in result.stdout
    resolved = configuration.load(tmp_path / "run" / "config.toml")
    assert (resolved.physics.alpha, resolved.run.threads, resolved.time.end) == (2.0, 2, 0.01)


def test_run_with_force_replaces_run(refused, done, config, tmp_path):
    run = copied(done, tmp_path / "run")
    (run / "notes.txt").write_text("mine")
    refused(sph_("run", config, "-o", run), 4, "--force", "sph restart")
    assert hashes(run) == hashes(done[0])
    result = sph_("run", config, "-o", run, "--force", "--set", "time.end=0.07")
    assert result.exit_code == 0
    assert [path.name for path in RunDirectory(run).checkpoints()] == [
        f"checkpoint_{k:06d}.h5" for k in range(3)
    ]
    assert (run / "notes.txt").read_text() == "mine"


def test_restart_in_place_and_into_new_directory(done, tmp_path):
    run = copied(done, tmp_path / "run")
    result = sph_("restart", run, "--set", "time.end=0.25", "--threads", 2)
    assert result.exit_code == 0
    assert f"Results: {run} " in result.stdout
    assert "t = 0.25: wrote checkpoint_000005.h5" in result.stderr
    other = tmp_path / "other"
    source = run / "checkpoints" / "checkpoint_000002.h5"
    result = sph_("restart", source, "-o", other, "--set", "time.end=0.25")
    assert result.exit_code == 0
    assert f"Results: {other} " in result.stdout
    assert hashes(other) == hashes(run)


def test_restart_on_other_software_notes_difference(done, tmp_path, monkeypatch):
    run = copied(done, tmp_path / "run")
    assert "digits" not in sph_("restart", run, "--set", "time.end=0.201").stderr
    facts = fingerprint.facts() | {"processor": "another"}
    monkeypatch.setattr(fingerprint, "facts", lambda: facts)
    result = sph_("restart", run, "--set", "time.end=0.202")
    assert result.exit_code == 0
    assert "may differ in their last digits" in result.stderr
    assert "here another)" in result.stderr
    # from here on the other one has computed
    assert "digits" not in sph_("restart", run, "--set", "time.end=0.203").stderr


def test_more_threads_than_processors_is_noted(done, config, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "available_processors", lambda: 2)
    asked = ("-o", tmp_path / "run", "--set", "time.end=0.05", "--threads")
    words = "run.threads = 3, but this process may use only 2 processor(s)"
    assert words not in sph_("run", config, *asked, 2).stderr
    result = sph_("run", config, "--force", *asked, 3)
    assert words in result.stderr
    assert hashes(tmp_path / "run").items() <= hashes(done[0]).items()


def test_restart_with_damaged_checkpoint_notes_skipping_it(done, tmp_path):
    run = copied(done, tmp_path / "run")
    last = run / "checkpoints" / "checkpoint_000004.h5"
    os.truncate(last, 5000)
    result = sph_("restart", run)
    assert result.exit_code == 0
    assert (
        "checkpoint_000004.h5 is skipped (it cannot be read): continuing from checkpoint_000003"
        in result.stderr
    )
    assert hashes(run) == hashes(done[0])


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_configurations_are_valid(path):
    resolved = configuration.load(path)
    # tubes and boxes are of many kinds, each with its own name
    many = resolved.problem.name in ("shock_tube", "uniform")
    assert many or path.stem.startswith(resolved.problem.name)
    assert configuration.from_text(resolved.to_toml()) == resolved


def test_every_problem_has_shipped_configuration():
    for name in registry.names("sph.problems"):
        assert configuration.load(CONFIGS / f"{name}.toml").problem.name == name


@pytest.mark.parametrize("name", registry.names("sph.problems"))
def test_new_writes_a_valid_configuration(name, tmp_path):
    result = sph_("new", name)
    assert result.exit_code == 0
    assert tomllib.loads(result.stdout)["problem"]["name"] == name
    target = tmp_path / "new.toml"
    assert sph_("new", name, "-o", target).stdout == f"wrote {target}\n"
    assert target.read_text() == result.stdout
    assert configuration.load(target).problem.name == name


def test_new_existing_target_exits_with_4(refused, tmp_path):
    target = tmp_path / "new.toml"
    target.touch()
    refused(sph_("new", "shock_tube", "-o", target), 4, "new.toml", "Try: ")
    assert target.read_text() == ""


def test_configuration_from_new_runs(tmp_path):
    target = tmp_path / "new.toml"
    sph_("new", "shock_tube", "-o", target)
    result = sph_("run", target, "-o", tmp_path / "run", "--set", "time.end=0.001")
    assert result.exit_code == 0, result.output


def test_list_names_every_choice():
    result = sph_("list")
    assert result.exit_code == 0
    sections = dict(re.findall(r"^([\w.]+):\n((?:  .*\n)+)", result.stdout, re.MULTILINE))
    for section, package in {
        "problems": "sph.problems", "formulations": "sph.formulations", "kernels": "sph.kernels",
        "eos": "sph.eos", "schemes": "sph.formulations.gas.schemes",
        "viscosity.switches": "sph.parts.viscosity.switches",
        "conductivity": "sph.parts.conductivity", "external": "sph.parts.external",
        "gravity": "sph.parts.gravity", "heating": "sph.parts.heating",
    }.items():  # fmt: skip
        named = [line.split()[0] for line in sections[section].splitlines()]
        assert named == registry.names(package, folders=section == "formulations")
        assert all(len(line.split()) > 3 for line in sections[section].splitlines())


def test_dry_run_writes_nothing(config, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = sph_("run", "tube.toml", "--dry-run")
    assert result.exit_code == 0
    assert "The configuration is valid." in result.stdout
    assert os.listdir(tmp_path) == ["tube.toml"]


@pytest.mark.parametrize("command", [[], ["run"], ["restart"], ["plot"], ["new"], ["list"]])
def test_help_of_every_command(command):
    result = sph_(*command, "--help")
    assert result.exit_code == 0
    assert "Usage: " in result.stdout


def test_version_option():
    assert sph_("--version").stdout == f"sph, version {sph.__version__}\n"


# --- exit code 2 ------------------------------------------------------------------------------


def test_all_config_errors_reported_with_lines(refused, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(TUBE.replace("n = 60", "n = 'many'").replace("interval", "intervall"))
    result = sph_("run", path, "-o", tmp_path / "run", "--set", "physics.C=-1")
    refused(result, 2, f"{path}, line 3: problem.n", f"{path}, line 7: output.intervall")
    assert "--set physics.C=-1: physics.C" in result.stderr
    assert len(result.stderr.splitlines()) == 3
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "physics.aplha=1.0"], ["physics.aplha", "alpha"]),
        (["--set", "physics.alpha"], ["--set physics.alpha"]),
        (["--set", "physics.gamma=0.9"], ["physics.gamma", "0.9"]),
        (["--set", "physics.kernel=wendland"], ["physics.kernel", "wendland_c2"]),
        (["--set", "problem.name=shock_tub"], ["problem.name", "shock_tube"]),
        (["--set", "time.end=soon"], ["time.end", "soon"]),
        (["--threads", "0"], ["--threads"]),
        (["--speed"], ["--speed"]),
    ],
)
@pytest.mark.parametrize("command", ["run", "restart"])
def test_invalid_set_option_exits_with_2(
    refused, command, arguments, words, config, done, tmp_path
):
    source = config if command == "run" else done[0]
    before = hashes(done[0])
    result = sph_(command, source, "-o", tmp_path / "new", *arguments)
    refused(result, 2, *words, mask=r"(?s)Usage: .*")  # the words of click
    assert not (tmp_path / "new").exists()
    assert hashes(done[0]) == before


def test_run_invalid_toml_exits_with_2(refused, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text("[problem]\nname = \n")
    refused(sph_("run", path), 2, f"{path}, line 2", mask=r"(?<=TOML: ).*")


def test_new_unknown_problem_exits_with_2(refused):
    refused(sph_("new", "shock_tub"), 2, "shock_tub", "shock_tube")


def test_restart_impossible_change_exits_with_2(refused, done):
    result = sph_("restart", done[0], "--set", "problem.n=61")
    refused(result, 2, "problem.n")


# --- exit code 3 ------------------------------------------------------------------------------


def test_numerical_failure_exits_with_3(refused, config, tmp_path):
    run = tmp_path / "run"
    result = sph_("run", config, "-o", run, "--set", "physics.max_energy_drift=1e-15")
    first = run / "checkpoints" / "checkpoint_000000.h5"
    facts = ("particle ", "offenders.h5", "Try: ", f"`sph restart {first} --set ")
    # numbers of a drift at round-off, which vary by machine
    refused(result, 3, *facts, mask=r" *-?\b\d[\d.]*(e[-+]?\d+)?\b")
    assert json.loads((run / "summary.json").read_text())["status"] == "failed"
    result = sph_(
        "restart", first, "--set", "physics.max_energy_drift=0.02", "--set", "time.end=0.01"
    )
    assert result.exit_code == 0, result.output


# --- exit code 4 ------------------------------------------------------------------------------


def test_missing_file_exits_with_4(refused, tmp_path):
    refused(sph_("run", tmp_path / "no.toml"), 4, "no.toml")
    refused(sph_("run", tmp_path), 4)
    refused(sph_("restart", tmp_path / "no"), 4, str(tmp_path / "no"))
    refused(sph_("restart", tmp_path), 4)


@pytest.mark.parametrize("command", ["restart", "plot", "report"])
def test_invalid_file_name_exits_with_4(refused, command):
    refused(sph_(command, "x" * 300), 4, "x" * 300)


def test_invalid_checkpoint_exits_with_4(refused, done, tmp_path):
    good = (done[0] / "checkpoints" / "checkpoint_000002.h5").read_bytes()
    bad = tmp_path / "bad.h5"
    bad.write_text("not HDF5")
    refused(sph_("restart", bad), 4, "bad.h5")
    bad.write_bytes(good[: len(good) // 2])
    refused(sph_("restart", bad), 4, "bad.h5", mask=r"Unable to .*(?=\)\.)")  # HDF5's words
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1.0
    refused(sph_("restart", tmp_path / "other.h5"), 4, "other.h5")
    bad.write_bytes(good)
    with h5py.File(bad, "a") as file:
        file["Checkpoint"].attrs["format_version"] = 99
    refused(sph_("restart", bad), 4, "(99)", "Try: ")
    bad.write_bytes(good)
    refused(sph_("restart", bad), 4, "-o DIR")


@pytest.mark.parametrize("command", ["run", "restart"])
def test_unwritable_directory_exits_with_4(refused, command, config, done, tmp_path):
    source = config if command == "run" else RunDirectory(done[0]).checkpoint_path(3)
    (tmp_path / "file").touch()
    for below in ("", "run"):
        result = sph_(command, source, "-o", tmp_path / "file" / below)
        refused(result, 4, "file", "Try: ")


def test_directory_of_other_files_exits_with_4(refused, config, tmp_path):
    refused(sph_("run", config, "-o", tmp_path, "--force"), 4)
    assert config.exists()


# --- signals ----------------------------------------------------------------------------------


def test_interrupt_while_loading_shows_no_traceback(refused, config, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(configuration, "load", interrupted)
    result = sph_("run", config)
    refused(result, 130, "sph: ended by Ctrl-C")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda one: one.name)
def test_signal_during_relaxation_ends_there_and_leaves_nothing(number, tmp_path, monkeypatch):
    pushes = []

    def interrupted(position, *_):
        pushes.append(position)
        if len(pushes) == 1:
            signal.raise_signal(number)
        return 0.0 * position

    monkeypatch.setattr(glass, "_push", interrupted)
    config = tmp_path / "glass.toml"
    config.write_text('[problem]\nname = "uniform"\ndimension = 2\nn = 100\nrelax = {}\n')
    handler = signal.signal(number, signal.default_int_handler)  # as the process may have one
    try:
        result = sph_("run", config, "-o", tmp_path / "run")
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        signal.signal(number, handler)
    assert (result.exit_code, len(pushes)) == (130, 1), result.output
    assert result.stderr.endswith("sph: ended by Ctrl-C\n")
    assert [*tmp_path.iterdir()] == [config]


@pytest.mark.slow
def test_run_after_dry_run_compiles_nothing(config, tmp_path):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    code, _, err = finished(started(tmp_path, "run", config, "--dry-run", **cache))
    assert code == 0, err
    code, _, err = finished(started(tmp_path, "run", config, "-o", "run", **cache))
    assert (code, "compiling" in err) == (0, False), err


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda one: one.name)
def test_signal_during_run_writes_checkpoint_and_exits_with_75(number, config, tmp_path):
    process = started(tmp_path, "run", config, "-o", "run", "--set", "time.end=1e6",
                      "--set", "output.interval=1e5")  # fmt: skip
    read_until(process.stderr, "wrote checkpoint_000000.h5")
    process.send_signal(number)
    code, out, err = finished(process)
    assert (code, out) == (75, "")
    assert "stopped by " + {2: "Ctrl-C", 15: "SIGTERM"}[number] in err
    assert "`sph restart run` continues the run" in err
    assert "Traceback" not in err
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["status"] == "stopped"
    last = max(hashes(tmp_path / "run"))
    assert summary["steps"] == last
    end = f"time.end={summary['time'] + 0.01}"
    assert sph_("restart", tmp_path / "run", "--set", end).exit_code == 0
    assert max(hashes(tmp_path / "run")) > last


def test_second_interrupt_ends_at_once(refused, config, tmp_path, monkeypatch):
    class InterruptingProgress(progress.Lines):
        def step(self, simulation):
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(progress, "suited", InterruptingProgress)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        result = sph_("run", config, "-o", tmp_path / "run")
    finally:
        signal.signal(signal.SIGINT, handler)
    refused(result, 130, "wrote checkpoint_000000.h5", "sph: ended by Ctrl-C")


@pytest.mark.slow
def test_stop_while_compiling_and_restart_equals_uninterrupted_run(config, tmp_path):
    """Also compiled code is the same whether it was just compiled or comes from the cache."""
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    process = started(tmp_path, "run", config, "-o", "stopped", **cache)
    read_until(process.stderr, "compiling the code")
    process.send_signal(signal.SIGTERM)
    code, _, err = finished(process)
    assert code == 75, err
    assert "at t = 0, step 0" in err
    code, _, err = finished(started(tmp_path, "restart", "stopped", **cache))
    assert code == 0, err
    code, out, err = finished(started(tmp_path, "run", config, "-o", "other", **cache))
    assert code == 0, err
    assert " 0 CPU s for compilation" in out  # else this shows nothing
    assert "compiling the code" not in err
    found = hashes(tmp_path / "stopped")
    assert len(found) == 5
    assert found == hashes(tmp_path / "other")


@pytest.mark.slow
def test_killed_run_restarts_from_last_good_checkpoint(config, tmp_path):
    process = started(tmp_path, "run", config, "-o", "run", "--set", "time.end=1e3")
    read_until(process.stderr, "wrote checkpoint_000002.h5")
    process.kill()
    finished(process)
    run = tmp_path / "run"
    assert not (run / "summary.json").exists()
    with h5py.File(RunDirectory(run).latest()) as file:
        end = round(float(file["Checkpoint/time"][()]) + 0.1, 2)
    result = sph_("restart", run, "--set", f"time.end={end}")
    assert result.exit_code == 0, result.output
    assert not list(run.rglob("*.partial"))
    result = sph_("run", config, "-o", tmp_path / "whole", "--set", f"time.end={end}")
    assert result.exit_code == 0
    assert hashes(run) == hashes(tmp_path / "whole")
    steps = [int(row.split(",")[0]) for row in (run / "history.csv").read_text().split()[1:]]
    assert steps == list(range(max(hashes(run)) + 1))


def test_overflow_gives_one_message(config, tmp_path):
    heating = 'physics.heating={ name = "relaxation", energy = 1e308, time = 1e-3 }'
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # NumPy's would be a second account of the same
        result = sph_("run", config, "-o", tmp_path / "run", "--set", heating)
    assert result.exit_code == 3, result.output


def test_out_of_memory_shows_no_traceback(config, tmp_path, monkeypatch):
    def full(*_):
        raise MemoryError("Unable to allocate 763. MiB")

    monkeypatch.setattr("sph.simulation.Simulation.of_problem", full)
    result = sph_("run", config, "-o", tmp_path / "run")
    assert result.exit_code == 2
    assert "763. MiB\nTry: a smaller problem.n" in result.stderr
