"""Comparison of many runs: error against cost, as a table, in words and in figures."""

from collections.abc import Sequence
from pathlib import Path

from sph.analysis.report import runs, table, words
from sph.analysis.report.compare import COSTS, DRIFT, Question, Report, Series, compare
from sph.errors import ConfigError
from sph.output.files import explained, refuse_link, write_text

__all__ = ["COSTS", "Question", "Report", "Series", "in_words", "make", "write"]


def make(sources: Sequence[Path], question: Question) -> Report:
    """The comparison of the runs in `sources`, without the reference itself.

    Raises FileError for files that are missing or cannot be read, ConfigError for a field or key
    that no run has, and for a reference that does not fit.
    """
    rows = runs.read(sources)
    if question.reference is not None:
        rows = _against(question.reference, rows)
    if not question.field:
        has_errors = any("density" in row.figures() for row in rows)
        question = question._replace(field="density" if has_errors else DRIFT)
    _check(rows, question)
    return compare(rows, question)


def _against(path: Path, rows: Sequence[runs.Row]) -> list[runs.Row]:
    """The rows without the reference itself, with their errors against it."""
    from sph.analysis.reference import Reference, errors_of

    reference = Reference(path)
    others = [row for row in rows if row.path != path.resolve()]
    for row in others:
        if row.status == "done":
            row.reference = errors_of(row.path, reference)
    return others


def in_words(report: Report) -> str:
    """The table and its findings, for the terminal."""
    return f"{table.as_text(report)}\n\n" + "\n".join(words.sentences(report))


def write(report: Report, directory: Path) -> list[Path]:
    """Write table, words and pictures into `directory`; returns the files. Raises FileError."""
    from sph.analysis.figures import report as pictures

    if directory.name == "report":  # the default, in a directory that may belong to another user
        refuse_link(directory)
    with explained(f"cannot write to {directory}"):
        directory.mkdir(parents=True, exist_ok=True)
    drawn = pictures.draw(report, directory)
    sentences = words.sentences(report)
    texts = {
        "report.csv": table.as_csv(report),
        "report.json": table.as_json(report, sentences),
        "report.md": table.as_markdown(report, sentences, [path.name for path in drawn]),
    }
    for name, text in texts.items():
        write_text(directory / name, text)
    return [*(directory / name for name in texts), *drawn]


def _check(rows: Sequence[runs.Row], question: Question) -> None:
    ended = [row for row in rows if row.status == "done"]
    there = dict.fromkeys(name for row in ended for name in row.figures())
    if ended and question.field not in there:
        raise ConfigError(
            f"--field {question.field}: no run has this error. Expected one of "
            f"{', '.join(there)}.\nTry: one of these, or --reference DIR, a finer run."
        )
    keys = {key for row in rows for key in row.settings}
    unknown = [key for key in question.by if key not in keys]
    if unknown:
        raise ConfigError(
            f"--by {unknown[0]}: no run has this key. Keys that vary: "
            f"{', '.join(runs.varied_keys(ended)) or 'nothing'}."
        )
