"""Where a result comes from: versions, machine, hashes and restarts."""

import json
from pathlib import Path
from typing import Any

import h5py

from sph.analysis.html.page import items, paragraph, table
from sph.output import checkpoint as checkpoints
from sph.output.files import opened
from sph.output.run_directory import RunDirectory
from sph.output.stored import GROUP

# Facts of the fingerprint that a reader asks for; the others are settings of Numba.
FACTS = (
    "sources of sph", "Python", "NumPy", "Numba", "llvmlite", "C library", "machine", "processor",
)  # fmt: skip


def section(found: dict[str, Any], run: RunDirectory) -> str:
    """Return the section of a run's page. found: of `sph.analysis.info.of`."""
    rows: list[tuple[str, str]] = [("directory", str(run.path.resolve()))]
    if found["state"]["version"]:
        rows.append(("version of sph at the end", found["state"]["version"]))
    last = found["state"]["last_checkpoint"]
    if last:
        rows += _of_checkpoint(Path(last["path"]))
    lineage = items(found["lineage"]) if found["lineage"] else paragraph("No restarts.")
    return table(("", ""), rows, ("", "value")) + "\n" + lineage


def _of_checkpoint(path: Path) -> list[tuple[str, str]]:
    """Facts of the last checkpoint, which `read` has checked."""
    state = checkpoints.read(path)
    with opened(path) as file, h5py.File(file, "r") as content:
        attributes = content[GROUP].attrs
        hashes = [
            ("SHA-256 of the last state", str(attributes["sha256"])),
            ("SHA-256 of the configuration", str(attributes["configuration_sha256"])),
        ]
    try:
        facts = json.loads(state.computed_by or "{}")
    except ValueError:
        facts = {}
    return [("last checkpoint", path.name), *hashes] + [
        (name, str(facts[name])) for name in FACTS if name in facts
    ]
