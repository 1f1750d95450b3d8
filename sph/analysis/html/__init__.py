"""report.html: a page on one run, or on several, that needs no other file and no network."""

from collections.abc import Sequence
from pathlib import Path

from sph.analysis import report as reports
from sph.analysis.html import comparison, run_page
from sph.analysis.info.run_state import is_run
from sph.output.files import explained, refuse_link, write_text

NAME = "report.html"


def write(
    sources: Sequence[Path], question: reports.Question, directory: Path | None = None
) -> list[Path]:
    """Write report.html; return the files written, its pictures among them.

    One run directory gives a page on that run, in the directory; other sources give a page that
    compares their runs, in report/ of the first source, beside the files of `report.write`.
    `directory` replaces these places. Raises FileError, and ConfigError as `report.make`.
    """
    if len(sources) == 1 and is_run(sources[0]):
        pictures, text = run_page.of(sources[0])
        target = (sources[0] if directory is None else directory) / NAME
        if directory is not None:
            with explained(f"cannot write to {directory}"):
                directory.mkdir(parents=True, exist_ok=True)
        write_text(target, text)
        return [*pictures, target]
    found = reports.make(sources, question)
    target = sources[0] / "report" if directory is None else directory
    written = reports.write(found, target)
    if directory is None:
        refuse_link(target)
    pictures = [path for path in written if path.suffix == ".png"]
    write_text(target / NAME, comparison.text(found, pictures))
    return [*written, target / NAME]
