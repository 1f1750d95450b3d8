"""The complete texts of messages that users see, compared with those kept in one file."""

import difflib
import re
from contextlib import contextmanager
from pathlib import Path

import pytest

from sph.version import __version__

HEADER = """\
The complete texts of messages that users see, each under the test that causes the message.
After a change of texts: pytest -m "slow or not slow" --update-messages, then read the difference.
"""
MARK = "--- "


class Snapshot:
    """The file of texts by name: the ID of a test, and a number where the test has several."""

    def __init__(self, path: Path, update: bool):
        self.path, self.update = path, update
        self.kept = read(path)
        self.seen: dict[str, str] = {}

    def compare(self, name: str, text: str) -> None:
        """Fail the test if the text is not the one that is kept."""
        self.seen[name] = text
        kept = self.kept.get(name)
        if text == kept or self.update:
            return
        lines = difflib.unified_diff(
            (kept or "").splitlines(), text.splitlines(), self.path.name, "now", lineterm=""
        )
        pytest.fail("\n".join([name, *lines, "If this is right: pytest --update-messages"]))

    def write(self, tests: set[str]) -> None:
        """Replace the texts of tests that ran, and drop those of tests that no longer exist.

        `tests` are the IDs of all tests in the files that were collected.
        """
        ran, files = {base_of(name) for name in self.seen}, {file_of(name) for name in tests}
        untouched = {
            name: text
            for name, text in self.kept.items()
            if base_of(name) not in ran and (base_of(name) in tests or file_of(name) not in files)
        }
        entries = sorted((untouched | self.seen).items())
        text = "".join(f"\n{MARK}{name}\n{text}\n" for name, text in entries)
        self.path.write_text(HEADER + text)


def read(path: Path) -> dict[str, str]:
    if not path.exists():
        return {}
    _, *entries = re.split(rf"^{MARK}", path.read_text(), flags=re.MULTILINE)
    pairs = (entry.partition("\n") for entry in entries)
    return {name: text.rstrip("\n") for name, _, text in pairs}


def base_of(name: str) -> str:
    return re.sub(r" #\d+$", "", name)


def file_of(name: str) -> str:
    return name.partition("::")[0]


class Messages:
    """The messages of one test. `temporary` is the directory of all tests' temporary files."""

    def __init__(self, snapshot: Snapshot, test: str, temporary: Path):
        self.snapshot, self.test, self.count = snapshot, test, 0
        self.temporary = re.compile(rf"{re.escape(str(temporary))}/[^/\s:`'\")]+")

    def check(self, text, mask: str | None = None) -> None:
        """Compare a complete text; what the pattern `mask` finds varies and is left out."""
        text = str(text).encode("utf-8", "backslashreplace").decode()  # a name may be no UTF-8
        text = self.temporary.sub("<tmp>", text).replace(f"sph {__version__}", "sph <version>")
        text = re.sub(mask, "#", text) if mask else text
        text = "\n".join(line.rstrip() for line in text.strip("\n").splitlines())
        self.count += 1
        number = f" #{self.count}" if self.count > 1 else ""
        self.snapshot.compare(f"{self.test}{number}", text)

    @contextmanager
    def raised(self, error, *facts, mask: str | None = None):
        """Expect an error of this type, with each of `facts` in its text, and compare the text."""
        with pytest.raises(error) as caught:
            yield caught
        for fact in facts:
            assert str(fact) in str(caught.value)
        self.check(caught.value, mask)
