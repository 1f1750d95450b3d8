"""Every equation that the code cites as "eq N" is stated in docs/equations.md."""

import re
from pathlib import Path

import pytest

import sph
from sph import kernels, registry

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "equations.md"
CODE = Path(sph.__file__).parent

# A space, or the end of a line with what begins the next one in a comment.
GAP = r"[\s#]+"
NUMBER = r"\d+(?:[-–]\d+)?"
CITATION = re.compile(
    rf"\b(?:[Ee]qs?\.?|[Ee]quations?){GAP}({NUMBER}(?:(?:,|,?{GAP}and){GAP}{NUMBER})*)(?!\.?\d)"
)
# Numbers of other publications follow a year, "et al.", or a possessive ("Price (2008), eq 27",
# "their eq 7"), or have a decimal point ("Toro eq 4.5"), which CITATION refuses.
FOREIGN = re.compile(
    rf"(?:\b(?:19|20)\d\d[a-z]?\)?,?|\bet al\.,?|\b(?:their|his|her)|\b[A-Z]\w+'s){GAP}$"
)


def cited(text: str) -> list[tuple[int, int]]:
    """(line, number) of each equation of the page that `text` cites, lines from 1."""
    found = []
    for match in CITATION.finditer(text):
        if FOREIGN.search(text[: match.start()]):
            continue
        line = text.count("\n", 0, match.start()) + 1
        for ends in re.findall(NUMBER, match[1]):
            first, *last = map(int, re.split("[-–]", ends))
            found += [(line, number) for number in range(first, max([first, *last]) + 1)]
    return found


def stated() -> list[int]:
    """Numbers of the page's equations, in its order."""
    return [int(n) for n in re.findall(r"^\*\*\((\d+)\)\*\* ", PAGE.read_text("utf-8"), re.M)]


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("# eq 24", [24]),
        ("(eqs 7-8, 15-17 and 27-28)", [7, 8, 15, 16, 17, 27, 28]),
        ("Eqs 7, 8 and 15 as printed", [7, 8, 15]),
        ("solves eqs\n    # 7 and 15 together", [7, 15]),
        ("eq 6 and the first of 31", [6]),
        ("eqs 11-14; Dehnen & Aly 2012, table 1", [11, 12, 13, 14]),
        ("as Hopkins (2013) (eqs 7 and 15 here)", [7, 15]),
        ("Price (2008), eq 27; Price 2008, eqs 27-28", []),
        ("(Hopkins\n2013, eq 12, with w_j)", []),
        ("their eq 7, Agertz et al., eq 3, Cullen & Dehnen's eq 15", []),
        ("Toro eq 4.5, eqs 14.42-14.43 and eq 106.3", []),
    ],
)
def test_citation_of_other_publication_is_ignored(text, numbers):
    assert [number for _, number in cited(text)] == numbers


@pytest.mark.parametrize("tree", [CODE, ROOT / "docs"], ids=["code", "docs"])
def test_cited_equations_are_stated(tree):
    known = set(stated())
    files = sorted(tree.rglob("*.py")) if tree == CODE else sorted(tree.glob("*.md"))
    citations = [
        (path, line, number) for path in files for line, number in cited(path.read_text("utf-8"))
    ]
    missing = [
        f"{path.relative_to(ROOT)}:{line}: eq {number} is not in docs/equations.md"
        for path, line, number in citations
        if number not in known
    ]
    assert citations  # else the pattern finds nothing and the test proves nothing
    assert not missing, "\n".join(missing)


def test_equation_numbers_are_unique_and_have_formula():
    text = PAGE.read_text("utf-8")
    numbers = stated()
    assert len(numbers) == len(set(numbers))
    without = [
        part[:30]
        for part in re.split(r"^(?=\*\*\(\d+\)\*\* )", text, flags=re.M)[1:]
        if not re.search(r"\n\n\$\$ .+ \$\$\n", part)
    ]
    assert not without


def test_files_named_on_page_exist():
    named = set(re.findall(r"`(\w+\.py)`", PAGE.read_text("utf-8")))
    assert named
    assert named - {path.name for path in CODE.rglob("*.py")} == set()


@pytest.mark.parametrize("kernel", registry.names("sph.kernels"))
def test_support_ratio_on_page_matches_code(kernel):
    row = re.search(rf"^\| `{kernel}` \|(.*)\|$", PAGE.read_text("utf-8"), re.M)
    stated = [float(cell) for cell in row[1].split("|")[:3]]
    found = [kernels.support_ratio(kernels.make(kernel), dimension) for dimension in (1, 2, 3)]
    assert stated == pytest.approx(found, abs=5e-7)  # half a unit of the last digit stated
