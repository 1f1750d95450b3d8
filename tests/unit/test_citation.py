"""The paper cites its bibliography, and CITATION.cff names the version of the program."""

import re
from pathlib import Path

from sph.version import __version__

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def test_paper_cites_what_its_bibliography_has():
    cited = set(re.findall(r"@(\w+)", (DOCS / "paper.md").read_text(encoding="utf-8")))
    entries = re.findall(r"^@\w+\{(\w+),", (DOCS / "paper.bib").read_text("utf-8"), re.MULTILINE)
    assert sorted(entries) == sorted(cited)


def test_citation_names_the_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (\S+)$", text, re.MULTILINE).group(1) == __version__
