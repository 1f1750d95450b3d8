"""The commands of README.md, CONTRIBUTING.md and docs/ run in the order of their page.

A page is followed in an empty directory with a copy of configs/: files that it tells the reader to
create are created, and commands run as they stand, but for settings that make runs short.
"""

import argparse
import re
import runpy
import shutil
import sys
from pathlib import Path

import click
import pytest
from document_blocks import PAGES, ROOT, Block, blocks, words
from document_reader import Reader, is_mention, parsed

from sph.sweep import local

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
    "sph sweep configs/gresho.toml --set physics.kernel=": "runs for minutes; points are checked",
    "sph sweep configs/kelvin_helmholtz_smooth.toml --set time.end=1.0": (
        "runs for minutes; points are checked"
    ),
    "sph report runs/gresho/wendland_c2": "needs these runs",
    "sph report runs/kh/wendland_c2": "needs these runs",
    "sph stress": "runs for minutes; tests/unit/stress runs cases",
    "python scripts/benchmark.py": "measures for minutes",
    "python scripts/check_readers.py": "needs yt, pynbody and swiftsimio",
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


def sweeps_that_do_not_run(page: Path) -> list[str]:
    """Those of the studies, and those that NOT_RUN lists with this reason."""
    sweeps = [command for _, command in EVERYTHING[page] if command.startswith("sph sweep")]
    listed = tuple(start for start, why in NOT_RUN.items() if "points are checked" in why)
    return [one for one in sweeps if page.name == STUDIES or one.startswith(listed)]


@pytest.mark.parametrize("page", list(filter(sweeps_that_do_not_run, WITH_COMMANDS)), ids=name_of)
def test_points_of_sweeps_that_do_not_run_are_valid(page, tmp_path, monkeypatch):
    reader = Reader(tmp_path, monkeypatch)
    monkeypatch.setattr(local, "run", lambda tasks, jobs, tell: None)
    for number, command in enumerate(sweeps_that_do_not_run(page)):
        said = reader.run(f"{command} -o {tmp_path / str(number)}", is_short=False)
        assert "0 of " in said


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
    reader = Reader(tmp_path, monkeypatch)
    for name, source in GIVEN.get(name_of(page), {}).items():
        shutil.copy(ROOT / source, tmp_path / name)
    for command in BEFORE.get(name_of(page), []):
        reader.run(command)
    reader.follow(page, lambda command: is_left_out(command) or is_for_placeholders(command))
