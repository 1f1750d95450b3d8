"""TOML and Python of README.md, CONTRIBUTING.md and docs/ are valid and run.

Python with prompts (>>>) and problem files run in tests/unit/api/test_examples.py, the examples of
CONTRIBUTING.md and design.md in test_documents.py, and files that a page creates in
test_document_commands.py.
"""

import ast
import importlib.util
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from click.testing import CliRunner
from document_blocks import PAGES, ROOT, Block, blocks

from sph import config as configuration
from sph.cli import main
from sph.output import checkpoint

EVERYTHING = [block for page in PAGES for block in blocks(page)]
TOML = [block for block in EVERYTHING if block.kind == "toml"]
PYTHON = [block for block in EVERYTHING if block.kind == "python"]
BODY = {"shape": "sphere", "centre": [0.5, 0.0, 0.0], "radius": 0.1}
STEEL = {"name": "mie_gruneisen", "rho_0": 7850.0, "c_0": 3600.0, "slope": 1.8, "gruneisen": 1.8}
WATER = {"name": "tait", "rho_0": 1000.0, "c_0": 1480.0}
# What a page leaves out of a piece of a configuration, by a table of the piece.
AROUND = {
    ("docs/configuration.md", "physics"): {"problem": {"name": "shock_tube"}},
    ("docs/continuum.md", "problem"): {
        "problem": {"name": "bodies", "dimension": 3},
        "physics": {
            "formulation": "continuum",
            "materials": {"steel": {"eos": STEEL}, "water": {"eos": WATER}},
        },
    },
    ("docs/continuum.md", "materials"): {
        "problem": {"name": "bodies", "dimension": 3, "body": [BODY | {"material": "steel"}]},
        "physics": {"formulation": "continuum"},
    },
    ("docs/continuum.md", "physics"): {
        "problem": {"name": "bodies", "dimension": 3, "body": [BODY]},
        "physics": {"formulation": "continuum"},
    },
    ("docs/gravity.md", "physics"): {"problem": {"name": "evrard"}},
    ("docs/initial_states.md", "problem"): {"problem": {"name": "uniform"}},
}
# The file that a configuration of docs/initial_states.md names.
SNAPSHOT = ROOT / "sph/problems/files/two_clouds.hdf5"
TIMES = {"time": {"end": 1.0}, "output": {"interval": 1.0}}


def page_of(block: Block) -> str:
    return str(block.page.relative_to(ROOT))


def merged(one: dict, other: dict) -> dict:
    """Both, with the entries of `other` where both have one."""
    both = {
        key: merged(one[key], other[key]) if isinstance(one[key], dict) else other[key]
        for key in {*one} & {*other}
    }
    return one | other | both


@pytest.mark.parametrize(
    "block", [one for one in TOML if not one.name], ids=lambda block: block.place
)
def test_configurations_are_valid(block):
    tables = tomllib.loads(block.text)
    if "path" in tables.get("problem", {}):
        tables["problem"]["path"] = str(SNAPSHOT)
    if page_of(block) == "docs/own_problem.md":
        assert [*tables] == ["project"]  # of pyproject.toml
        return
    first = "materials" if "materials" in tables.get("physics", {}) else next(iter(tables))
    around = AROUND.get((page_of(block), first), {})
    if {"problem", "physics"} <= set(tables):  # a whole one
        around = {}
    configuration.from_text(tomli_w.dumps(merged(merged(TIMES, around), tables)))


def test_python_is_python():
    for block in PYTHON:
        if ">>>" not in block.text:
            is_entry = block.text[0] == " "  # of a dictionary
            ast.parse(f"({{{block.text}}})" if is_entry else block.text, block.place)


def test_code_holds_no_links():
    code = [block for block in EVERYTHING if block.kind in ("sh", "output", "other")]
    assert not [block.place for block in code if re.search(r"\]\(\w+\.md", block.text)]


def paragraphs_of(page: str) -> list[str]:
    """The pieces of Python of a page that a blank line ends, without those that create files."""
    found = [one for one in PYTHON if page_of(one) == page and not one.name]
    return [part for one in found for part in re.split(r"\n\n(?=\S)", one.text)]


def has_modules(code: str) -> bool:
    """Whether all modules that the code imports are installed."""
    named = [one for one in ast.walk(ast.parse(code)) if isinstance(one, ast.Import)]
    return all(importlib.util.find_spec(one.names[0].name) for one in named)


def test_checkpoints_and_exports_are_read_as_described(tmp_path, monkeypatch):
    """With h5py and sph; with yt, pynbody, swiftsimio, pandas, sarracen, pyvista if installed."""
    run = str(tmp_path / "run")
    for line in (
        ["run", str(ROOT / "configs" / "sod.toml"), "-o", run],
        ["export", run, "--csv", "--vtk"],
    ):
        done = CliRunner().invoke(main, line)
        assert done.exit_code == 0, done.output
    shutil.copytree(tmp_path / "run" / "export", tmp_path / "export")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    space, executed, named = {}, 0, tmp_path / "checkpoint_000004.h5"
    kept = tmp_path / "run" / "checkpoints" / named.name
    shutil.copy(kept, named)
    for code in paragraphs_of("docs/snapshot.md"):
        assert all(Path(name).exists() for name in re.findall(r'"([\w/]+\.\w+)"', code))
        if not has_modules(code):
            continue
        if "StressTensors" in code:
            checkpoint.write(named, importlib.import_module("check_readers_states").made_up_solid())
        else:
            shutil.copy(kept, named)
        exec(compile(code, "docs/snapshot.md", "exec"), space)
        executed += 1
    assert executed >= 3
    assert space["density"].max() == pytest.approx(1.0, rel=0.05)  # of the left gas of the tube
    stress = np.array([[space["".join(sorted(i + j))] for i in "xyz"] for j in "xyz"])
    deviator = stress - np.trace(stress) / 3.0 * np.eye(3)[:, :, None]
    expected = np.sqrt(1.5 * (deviator**2).sum(axis=(0, 1)))
    assert expected.max() > 0.0
    # a sum of a dozen rounded terms, whose differences of components lose a digit or two
    assert space["von_mises"] == pytest.approx(expected, rel=1e-12, abs=1e-12 * expected.max())
    assert space["state"].pressure.max() == pytest.approx(1.0, rel=0.05)


def test_initial_state_of_numpy_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    x = np.random.default_rng(1).random((50, 2))
    space = {"numpy": np, "x": x, "v": 0.0 * x, "m": np.full(50, 0.02), "u": np.ones(50)}
    (code,) = paragraphs_of("docs/initial_states.md")
    exec(compile(code, "docs/initial_states.md", "exec"), space)
    text = (
        '[problem]\nname = "file"\npath = "ic.npz"\n[time]\nend = 1.0\n[output]\ninterval = 1.0\n'
    )
    (tmp_path / "ic.toml").write_text(text)
    problem = configuration.load(tmp_path / "ic.toml").problem
    assert (problem.n, problem.boundary) == (50, "periodic")


def test_script_of_tutorial_runs(capsys):
    (code,) = [one for one in paragraphs_of("docs/tutorial.md") if "import sph" in one][:1]
    whole = "\n\n".join(paragraphs_of("docs/tutorial.md"))
    assert whole.startswith(code)
    exec(compile(whole, "docs/tutorial.md", "exec"), {})
    error, density = map(float, capsys.readouterr().out.split())
    # the error at t = 0.1 with 198 particles is between those that api.md and the tutorial state
    assert 0.003 < error < 0.02
    assert density == pytest.approx(1.0, rel=0.05)
