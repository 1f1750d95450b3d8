"""The commands of README.md, CONTRIBUTING.md and docs/ run in the order of their page.

A page is followed in an empty directory with a copy of configs/: files that it tells the reader to
create are created, and commands run as they stand, but for settings that make runs short.
"""

import argparse
import ast
import importlib.util
import os
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner
from document_blocks import PAGES, ROOT, Block, blocks, words

from sph import config as configuration
from sph.cli import main
from sph.errors import SphError
from sph.sweep import local, task

# Commands that do not run here, by how they begin; of `sph` and of scripts the options are checked.
NOT_RUN = {
    "python3 -m venv": "makes an environment",
    ".venv/bin/python -m pip install": "installs; .ci/run does it",
    "python -m pip install": "installs; .ci/run does it",
    "pip install": "installs",
    ".venv/bin/python -m pytest": "would run these tests in themselves",
    "python -m pytest": "would run tests in tests",
    "source .venv/bin/activate": "needs the environment",
    "ruff ": "checks the sources; .ci/run does it",
    "lint-imports": "checks the sources; .ci/run does it",
    "mypy": "checks the sources; .ci/run does it",
    "pre-commit ": "checks the sources",
    "mkdocs ": "makes the site; .ci/run does it",
    "git worktree": "changes the repository",
    "dask scheduler": "serves until it is stopped; tests/unit/sweep has a scheduler of its own",
    "sph sweep configs/sod.toml --vary problem.n=100:800:x2 --scheduler": "needs that scheduler",
    "sph sweep configs/sod_3d.toml --vary problem.n=100000,800000 --slurm": "needs Slurm",
    "sph stress": "runs for minutes; tests/unit/stress runs cases",
    "python scripts/benchmark.py": "measures for minutes",
    "python scripts/check_readers.py": "needs yt, pynbody and swiftsimio",
    "python scripts/check_vtk.py": "needs pyvista",
    "python scripts/gravity.py": "measures for minutes",
    "python scripts/peers.py": "needs PySPH",
    "python scripts/peers_solids.py": "needs PySPH",
    "python scripts/plate_modes.py": "runs for minutes",
    "python scripts/precision.py": "runs for minutes",
    "python scripts/roofline.py": "measures for minutes",
    "python scripts/stability.py": "runs for hours",
    "python scripts/stability_pictures.py": "needs the runs of scripts/stability.py",
    "python scripts/study.py": "runs for minutes",
    "python scripts/write_": "writes documents; tests compare them with the sources",
}
STUDIES = "made_by.md"  # what scripts/study.py called: hundreds of runs, whose points are checked
# Runs that a page takes for granted.
BEFORE = {
    "README.md": ["sph run configs/blob.toml"],
    "docs/api.md": ["sph run configs/sod.toml"],
    "docs/snapshot.md": ["sph run configs/sod.toml", "sph export runs/sod --csv --vtk"],
    "docs/sweeps.md": [
        "sph sweep configs/sod.toml --vary physics.eta=1.6,1.8 -o runs/sod/eta",
        "sph sweep configs/sod.toml --vary physics.alpha=1.0,1.5 -o runs/sod/kernel",
    ],
}
# Further files that a page takes for granted, and where they come from.
GIVEN = {"docs/initial_states.md": {"ic.hdf5": "sph/problems/files/two_clouds.hdf5"}}
PLACEHOLDER = re.compile(r"…|\b(?:[A-Z]{3,}|DIR)\b(?!\])")
FEW = {1: 100, 2: 400, 3: 1000}  # particles of a shortened run, by dimension
PART = 0.05  # of its time


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def commands_of(page: Path) -> list[tuple[Block, str]]:
    return [(block, command) for block in blocks(page) for command in block.commands]


def is_for_placeholders(command: str) -> bool:
    return bool(PLACEHOLDER.search(re.sub(r"_SPH_COMPLETE", "", command)))


def is_left_out(command: str) -> bool:
    return command.startswith(tuple(NOT_RUN))


EVERYTHING = {page: commands_of(page) for page in PAGES}
WITH_COMMANDS = [page for page, found in EVERYTHING.items() if found]


def parsed(command: str) -> click.Context | None:
    """What the real parser makes of `sph …`; None for --help and --version."""
    line = words(command.removeprefix(".venv/bin/"))[1:]
    try:
        if line[0].startswith("-"):
            main.make_context("sph", line)
        return main.commands[line[0]].make_context(f"sph {line[0]}", line[1:])
    except click.exceptions.Exit:
        return None


def is_mention(block: Block, error: Exception) -> bool:
    """Whether a command in a sentence lacks an argument, as `sph run --dry-run`."""
    lacks = isinstance(error, (click.MissingParameter, click.BadOptionUsage))
    return block.kind == "inline" and lacks


def check_script(command: str, monkeypatch) -> None:
    """Raise where the script does not exist or refuses the options; the script does not run."""
    path, *options = words(command)[1:]
    text = (ROOT / path).read_text(encoding="utf-8")
    if "argparse" not in text:
        assert not options, f"{path} has no options"
        return

    def stop(self, *given):
        read(self, *given)
        raise click.exceptions.Exit(0)

    read = argparse.ArgumentParser.parse_args
    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", stop)
    monkeypatch.setattr(sys, "argv", [path, *options])
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    with pytest.raises(click.exceptions.Exit):
        runpy.run_path(str(ROOT / path), run_name="__main__")


@pytest.mark.parametrize("page", WITH_COMMANDS, ids=name_of)
def test_parsers_accept_commands(page, monkeypatch):
    monkeypatch.chdir(ROOT)
    wrong = []
    for block, command in EVERYTHING[page]:
        given = words(command)
        if block.kind == "inline" and is_for_placeholders(command):
            continue  # test_documents.py checks the names of options
        try:
            if Path(given[0]).name == "sph":
                parsed(command)
            elif given[1:2] and given[1].startswith("scripts/"):
                check_script(command, monkeypatch)
            elif "pytest" in given:
                named = [one for one in given[3:] if one.startswith("tests")]
                assert all((ROOT / one).exists() for one in named)
        except (click.UsageError, KeyError, AssertionError, SystemExit) as error:
            if not is_mention(block, error):
                wrong.append(f"{block.place}: {command}: {error!r}")
    assert not wrong


def test_every_exception_is_used():
    texts = [command for found in EVERYTHING.values() for _, command in found]
    assert not [start for start in NOT_RUN if not any(one.startswith(start) for one in texts)]
    names = {name_of(page) for page in WITH_COMMANDS}
    assert {*BEFORE, *GIVEN} <= names


class Reader:
    """Follows a page in the current directory."""

    def __init__(self, page: Path, home: Path, monkeypatch):
        self.page, self.home, self.monkeypatch = page, home, monkeypatch
        shutil.copytree(ROOT / "configs", home / "configs")
        for name, source in GIVEN.get(name_of(page), {}).items():
            shutil.copy(ROOT / source, home / name)
        (home / "bin").mkdir()
        program = home / "bin" / "sph"
        program.write_text(f'#!/bin/sh\nexec {sys.executable} -m sph "$@"\n')
        program.chmod(0o755)
        paths = {"PATH": f"{home / 'bin'}:{os.environ['PATH']}", "PYTHONPATH": f"{home}:{ROOT}"}
        self.environment = os.environ | paths | {"HOME": str(home)}
        monkeypatch.chdir(home)
        monkeypatch.setattr(local, "run", self.one_by_one)
        monkeypatch.setattr(task, "subprocess", SimpleNamespace(
            Popen=self.point, DEVNULL=None, TimeoutExpired=subprocess.TimeoutExpired
        ))  # fmt: skip

    def follow(self) -> None:
        for command in BEFORE.get(name_of(self.page), []):
            self.run(command)
        found = blocks(self.page)
        for block, after in zip(found, [*found[1:], None], strict=True):
            if block.name:
                path = self.home / block.name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(block.text)
            for command in block.commands:
                if is_left_out(command) or is_for_placeholders(command):
                    continue
                is_shown = after is not None and after.kind == "output"
                said = self.run(command, block, is_short=not is_shown)
                if is_shown:
                    check_output(after, said)

    def run(self, command: str, block: Block | None = None, is_short=True) -> str:
        """Run a command; returns what it prints."""
        first, *line = words(command.removeprefix(".venv/bin/"))
        where = f"{block.place if block else self.page}: {command}"
        if first != "sph":
            return self.in_shell(command, where)
        try:
            context = parsed(command)
        except click.UsageError as error:
            assert is_mention(block, error), where
            return ""
        done = CliRunner().invoke(main, [*line, *(shortened(context) if is_short else [])])
        assert done.exit_code == 0, f"{where}\n{done.output}"
        return done.stdout

    def in_shell(self, command: str, where: str) -> str:
        """Run another program, or `sph` with variables of the shell."""
        if "zsh_source" in command:  # another shell may not be there: its code is only printed
            command = command.removeprefix('eval "$(').removesuffix(')"')
        if "_SPH_COMPLETE=bash" in command:
            command += " && complete -p sph"
        for _, file in re.findall(r"> (~/)?(\S+)", command):
            (self.home / file).parent.mkdir(parents=True, exist_ok=True)
        command = re.sub(r"^python ", f"{sys.executable} ", command)
        done = subprocess.run(
            ["bash", "-c", command], env=self.environment, capture_output=True, text=True
        )
        assert done.returncode == 0, f"{where}\n{done.stdout}{done.stderr}"
        assert ">" in command or "python" in command or "sph" in done.stdout, where
        return done.stdout

    def one_by_one(self, tasks, jobs, tell) -> None:
        """The points of a sweep in this process, which has imported and compiled everything."""
        for one in tasks:
            tell(task.execute(one))

    def point(self, command, stdout, **_):
        """As subprocess.Popen."""
        done = CliRunner().invoke(main, command[3:])
        stdout.write(done.output.encode())
        return SimpleNamespace(returncode=done.exit_code, wait=lambda _: done.exit_code)


def shortened(context: click.Context | None) -> list[str]:
    """Options that shorten the runs of a command."""
    name = context.info_name.removeprefix("sph ") if context else ""
    given = context.params if context else {}
    if name not in ("run", "sweep", "stability") or given.get("dry_run"):
        return []
    varied = {one.partition("=")[0] for one in given.get("varies", ())}
    resolved = configuration.load(given["config"], given["overrides"])
    problem = resolved.problem
    settings = {"time.end": PART * resolved.time.end}
    if resolved.output.interval > settings["time.end"]:
        settings["output.interval"] = settings["time.end"]
    if problem.name != "file" and problem.n > FEW[problem.dimension]:
        settings["problem.n"] = FEW[problem.dimension]
    fewer = ["--limit", "resolution=2.0"] if name == "stability" else []
    sets = [f"--set={key}={value!r}" for key, value in settings.items() if key not in varied]
    return [*sets, *fewer]


NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")


def check_output(shown: Block, said: str) -> None:
    """Each line of the page is one of the output, up to "..."; numbers agree within 3 %.

    The page rounds to two or three digits, and other processors round otherwise.
    """
    lines = said.splitlines()
    for wanted in shown.text.splitlines():
        begin = wanted.partition("...")[0]
        start = NUMBER.split(begin)[0]
        (line,) = [one for one in lines if one.startswith(start)]
        numbers = [float(one) for one in NUMBER.findall(begin)]
        assert NUMBER.sub("#", line).startswith(NUMBER.sub("#", begin)), shown.place
        found = [float(one) for one in NUMBER.findall(line)][: len(numbers)]
        assert found == pytest.approx(numbers, rel=0.03), shown.place


def is_slow(page: Path) -> bool:
    """Whether a page has scenes of its own to compile."""
    name = name_of(page)
    return page.parent.name == "problems" or name in (
        "CONTRIBUTING.md", "docs/continuum.md", "docs/measurements.md"
    )  # fmt: skip


def runs_commands(page: Path) -> bool:
    return page.name != STUDIES and any(
        not is_left_out(command) and not is_for_placeholders(command)
        for _, command in EVERYTHING[page]
    )


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=name_of(page), marks=[pytest.mark.slow] if is_slow(page) else [])
        for page in WITH_COMMANDS
        if runs_commands(page)
    ],
)
def test_commands_run(page, tmp_path, monkeypatch):
    Reader(page, tmp_path, monkeypatch).follow()
