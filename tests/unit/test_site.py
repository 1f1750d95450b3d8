"""The documentation site has every page, and the problems of the tutorial begin.

`mkdocs build` checks the links; these tests need no MkDocs.
"""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from sph import config

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SITE = (DOCS / "site" / "mkdocs.yml").read_text(encoding="utf-8")
TUTORIAL = (DOCS / "tutorial.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"`(\w+\.(?:toml|py))`:[^\n]*\n\n```\w+\n(.*?)```", TUTORIAL, re.DOTALL))


def listed(key: str) -> str:
    """The lines below a key of mkdocs.yml."""
    return re.search(rf"^{key}:.*\n((?: +.*\n)+)", SITE, re.MULTILINE).group(1)


def pages() -> list[str]:
    return re.findall(r"[^:\n]: (\S+\.md)$", listed("nav"), re.MULTILINE)


def from_top() -> dict[str, str]:
    """Documents of the top directory by the page that the hook makes of them."""
    hooks = (DOCS / "site" / "hooks.py").read_text(encoding="utf-8")
    table = re.search(r"^PAGES = \{(.*?)\}", hooks, re.MULTILINE | re.DOTALL).group(1)
    return {page: name for name, page in re.findall(r'"(\S+)": "(\S+)"', table)}


def test_every_page_is_in_the_navigation_once():
    left_out = {line.strip().lstrip("/") for line in listed("exclude_docs").splitlines()}
    left_out |= {
        str(path.relative_to(DOCS))
        for pattern in listed("not_in_nav").split()[:1]
        for path in DOCS.glob(pattern.lstrip("/"))
        if path.name != "README.md"
    }
    written = {str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md")} - left_out
    assert sorted(pages()) == sorted(written | set(from_top()))


def test_every_entry_of_the_navigation_exists():
    top = from_top()
    sources = [ROOT / top[page] if page in top else DOCS / page for page in pages()]
    assert len(sources) > 20
    assert not [str(path) for path in sources if not path.exists()]


def test_pages_of_problems_match_sources():
    script = runpy.run_path(str(ROOT / "scripts" / "write_problems.py"))
    written = {
        one.name: one.read_text(encoding="utf-8") for one in (DOCS / "problems").glob("*.md")
    }
    assert written == script["pages"](), "run: python scripts/write_problems.py"


def test_page_of_a_problem_has_its_theory_and_limits():
    page = (DOCS / "problems" / "noh.md").read_text(encoding="utf-8")
    assert "**(231)** State inside the shock" in page
    assert "`planar_norm_density`" in page
    assert "sph run configs/noh_2d.toml" in page


@pytest.fixture
def directory_of_tutorial(tmp_path, monkeypatch):
    """A current directory with the files that the tutorial creates."""
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    exec(compile(FILES["make_ic.py"], "docs/tutorial.md", "exec"), {})
    return tmp_path


@pytest.mark.parametrize(
    ("name", "particles"), [("bubble.toml", 2500), ("hot_spot.toml", 1600), ("my_pulse.toml", 200)]
)
def test_problem_of_the_tutorial_has_an_initial_state(directory_of_tutorial, name, particles):
    if name not in FILES:  # the tutorial writes this configuration by `sph new`
        Path(name).write_text('[problem]\nfile = "my_pulse.py"\n', encoding="utf-8")
    scene = config.load(directory_of_tutorial / name)
    gas = scene.problem.initial(scene.physics.eos_model())
    assert gas.position.shape[1] == particles
    assert np.ptp(gas.internal_energy) > 0  # bubble, hot spot or pulse is there
