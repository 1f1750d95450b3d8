"""A reader who follows the pages of the documentation: creates their files, runs their commands."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner
from document_blocks import ROOT, Block, blocks, words

from sph import config as configuration
from sph.cli import main
from sph.errors import SphError
from sph.sweep import local, task

FEW = {1: 100, 2: 400, 3: 1000}  # particles of a shortened run, by dimension
PART = 0.05  # of its time
QUICK = "--set time.end=0.01 --set output.interval=0.01"  # for a run in a process of its own


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


class Reader:
    """Follows a page in the current directory."""

    def __init__(self, home: Path, monkeypatch):
        self.home, self.extends = home, False
        shutil.copytree(ROOT / "configs", home / "configs")
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

    def follow(self, page: Path, skips: Callable[[str], bool]) -> None:
        """Create the files and run the commands of a page, but those that `skips` names."""
        found = blocks(page)
        for block, after in zip(found, [*found[1:], None], strict=True):
            if block.name:
                self.create(block)
            for command in block.commands:
                if skips(command):
                    continue
                is_shown = after is not None and after.kind == "output"
                said = self.run(command, block, is_short=not is_shown)
                if is_shown:
                    check_output(after, said)

    def create(self, block: Block) -> None:
        """Create a file; one of the package sph in the folder for extensions instead."""
        inside = block.name.startswith("sph/")
        self.extends = self.extends or inside
        name = block.name.replace("sph/", "sph_extensions/", 1) if inside else block.name
        path = self.home / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.text)

    def run(self, command: str, block: Block | None = None, is_short=True) -> str:
        """Run a command; returns what it prints."""
        first, *line = words(command.removeprefix(".venv/bin/"))
        where = f"{block.place if block else 'before'}: {command}"
        if first != "sph":
            return self.in_shell(command, where)
        try:
            context = parsed(command)
        except click.UsageError as error:
            if block is None or not is_mention(block, error):
                raise
            return ""
        if self.extends:  # this process has looked for extensions already
            return self.in_shell(f"{command} {QUICK if line[0] == 'run' else ''}", where)
        line += shortened(context) if is_short else []
        done = CliRunner().invoke(main, line)
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
    end = PART * resolved.time.end
    settings = {"time.end": end, "output.interval": min(end, resolved.output.interval)}
    if problem.name != "file" and problem.n > FEW[problem.dimension]:
        settings["problem.n"] = FEW[problem.dimension]
    sets = [f"{key}={value!r}" for key, value in settings.items() if key not in varied]
    with suppress(SphError):  # some problems refuse few particles
        configuration.load(given["config"], [*given["overrides"], *sets])
        return _options(sets, name)
    return _options(sets[:2], name)


def _options(sets: list[str], name: str) -> list[str]:
    fewer = ["--limit", "resolution=2.0"] if name == "stability" else []
    return [*(f"--set={one}" for one in sets), *fewer]


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
