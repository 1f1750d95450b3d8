"""The documentation of the configuration is what the sources say."""

import runpy
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_configuration_page_matches_sections():
    script = runpy.run_path(str(ROOT / "scripts" / "write_configuration.py"))
    written = (ROOT / "docs" / "configuration.md").read_text()
    assert written == script["text"](), "run: python scripts/write_configuration.py"
