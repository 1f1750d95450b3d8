"""The page that compares several runs, such as those of a sweep."""

from collections.abc import Sequence
from pathlib import Path

from sph.analysis.html.page import Section, items, page, paragraph, picture, table
from sph.analysis.info.words import number
from sph.analysis.report import Report, words
from sph.analysis.report.runs import Row
from sph.analysis.report.table import cells

HEADINGS = {"report.": "Figures of the problem", "conservation.": "Conservation"}


def text(report: Report, pictures: Sequence[Path]) -> str:
    """Return the page. pictures: PNG files."""
    header, *lines = cells(report)
    every = [*report.rows, *report.without]
    sections = [
        Section("Findings", items(words.sentences(report))),
        Section("Runs with an error", table(header, lines, ["number"] * len(header))),
        Section("Pictures", "\n".join(picture(path, _caption(path)) for path in pictures)),
        Section("All runs", _runs(every)),
        *(Section(title, _figures(every, prefix)) for prefix, title in HEADINGS.items()),
        Section("Settings", _settings(report, every)),
    ]
    names = sorted({row.value("problem.name") for row in every} - {"–"})
    head = paragraph(f"{len(every)} runs of {', '.join(names) or 'no known problem'}")
    return page(f"Comparison by {report.question.error_name}", head, sections)


def _caption(path: Path) -> str:
    return path.stem.replace("_", " ").capitalize()


def _runs(rows: Sequence[Row]) -> str:
    """Status, reason and warnings of every run, also of those without an error."""
    lines = [
        (
            _name(row),
            row.status,
            str(row.n or ""),
            str(row.steps or ""),
            number(row.cost["cpu"]) if row.cost else "",
            number(row.cost["wall"]) if row.cost else "",
            "; ".join(filter(None, [row.reason, *row.warnings])),
        )
        for row in rows
    ]
    header = ("run", "status", "N", "steps", "CPU s", "wall-clock s", "reason, warnings")
    return table(header, lines, ("name", "", *["number"] * 4, ""))


def _figures(rows: Sequence[Row], prefix: str) -> str:
    """A column for each run, a line for each figure whose name begins with `prefix`."""
    ended = [row for row in rows if row.summary]
    every = dict.fromkeys(name for row in ended for name in row.figures())
    names = [name for name in every if name.startswith(prefix)]
    if not names:
        return paragraph("None.")
    lines = [
        (name.removeprefix(prefix), *(number(_value(row, name)) for row in ended)) for name in names
    ]
    header = ("name", *(_name(row).replace(",", ", ") for row in ended))  # where lines may break
    return table(header, lines, ("name", *["number"] * len(ended)))


def _value(row: Row, name: str):
    table_name, _, entry = name.partition(".")
    return (row.ended[table_name] or {}).get(entry)  # type: ignore[literal-required]


def _settings(report: Report, rows: Sequence[Row]) -> str:
    """The keys in which the runs differ, and those that all share."""
    varied = list(report.keys)
    lines = [(_name(row), *(row.value(key) for key in varied)) for row in rows]
    differing = table(("run", *varied), lines, ["name", *["value"] * len(varied)])
    known = next((row for row in rows if row.settings), None)
    if known is None:
        return differing
    shared = [(key, known.value(key)) for key in known.settings if key not in varied]
    same = table(("key of all runs", "value"), shared, ("name", "value"))
    return f"{differing}\n{same}"


def _name(row: Row) -> str:
    return f"{row.sweep}/{row.name}" if row.sweep else row.name
