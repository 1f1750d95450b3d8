"""Results of the benchmark as JSON files, and the comparison of two results of one machine."""

import datetime
import json
import math
import os
import platform
import subprocess
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numba
from benchmark_runs import BenchmarkError, Figures, quantity, spread
from llvmlite import binding

STORED = Path(__file__).resolve().parent.parent / "docs" / "benchmarks"
FORMAT = 1
# Machines with equal values are of one kind: their ratios to the calibration are comparable. The
# calibration's own machine code depends on Numba and LLVM.
KIND = ("processor", "instructions", "cores", "numba", "llvm")
# A change of more than this is a warning. Medians of ratios of three repeats scatter by less
# (docs/benchmarks/README.md).
TOLERANCE = 0.05


def machine() -> dict:
    llvm = ".".join(map(str, binding.llvm_version_info))
    processor, instructions = _processor()
    return {
        "processor": processor, "instructions": instructions, "cores": os.cpu_count(),
        "python": platform.python_version(), "numba": numba.__version__, "llvm": llvm,
        "numpy": version("numpy"),
    }  # fmt: skip


def _processor() -> tuple[str, str]:
    """Return the processor's name and the widest vector instructions that it has."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine(), "unknown"
    names = [line.split(":")[1].strip() for line in text.splitlines() if "model name" in line]
    wide = next((name for name in ("avx512f", "avx2") if name in text), "no AVX2")
    return names[0] if names else platform.machine(), wide


def _git(tree: Path, *arguments: str) -> str | None:
    done = subprocess.run(["git", "-C", str(tree), *arguments], capture_output=True, text=True)
    return done.stdout.strip() if done.returncode == 0 else None


def result(tree: Path, figures: Figures, calibration: list[float]) -> dict:
    """Return a result that can be stored as JSON. calibration: CPU ns per pair, all measured."""
    commit = _git(tree, "rev-parse", "HEAD")
    text = (tree / "sph" / "version.py").read_text(encoding="utf-8")
    return {
        "format": FORMAT,
        "commit": commit,
        "commit_date": commit and _git(tree, "show", "-s", "--format=%cI", "HEAD"),
        "changed": bool(_git(tree, "status", "--porcelain", "--", "sph")),
        "measured": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "version": text.split('__version__ = "')[1].split('"')[0],
        "machine": machine(),
        "calibration_ns_per_pair": spread(calibration),
        "figures": {
            name: {
                "unit": quantity(name).unit,
                "checked": quantity(name).checked,
                "repeats": len(series.values),
                **spread(series.values),
                "ratio": spread(series.ratios) if series.ratios else None,
            }
            for name, series in figures.items()
        },
    }


def write(path: Path, content: dict) -> None:
    """Write a result. Raises BenchmarkError if the file cannot be written."""
    try:
        path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise BenchmarkError(f"{path} cannot be written: {error.strerror}") from None


def read(path: Path) -> dict:
    """Return the result in a file. Raises BenchmarkError if the file does not have the format."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["format"] != FORMAT:
            raise ValueError(f"format {content['format']}")
        datetime.datetime.fromisoformat(content["measured"])
        for name in KIND:
            content["machine"][name]
        for name, figure in content["figures"].items():
            if not 0.0 < _compared(figure) < math.inf and figure["checked"]:
                raise ValueError(f"figure {name!r}: {_compared(figure)}")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise BenchmarkError(
            f"{path}: expected a result of the benchmark, format {FORMAT}; "
            f"found {type(error).__name__}: {error}.\n"
            "Try: restore the file with git, or delete it and measure again with --json."
        ) from None
    return content


def _compared(figure: dict) -> float:
    return (figure["ratio"] or figure)["median"]


def last(machine: dict, folder: Path = STORED, but: Path | None = None) -> tuple[Path, dict] | None:
    """Return the file and content of the latest stored result of this kind of machine, if any.

    but: a file that does not count. Raises BenchmarkError if a file is damaged.
    """
    paths = [path for path in sorted(folder.glob("*.json")) if not but or path != but.resolve()]
    stored = [(path, read(path)) for path in paths]
    fitting = [
        (path, one) for path, one in stored
        if all(one["machine"][name] == machine[name] for name in KIND)
    ]  # fmt: skip
    return max(
        fitting, default=None, key=lambda one: datetime.datetime.fromisoformat(one[1]["measured"])
    )


class Change(NamedTuple):
    """A checked figure in two results; before and after: ratios to the calibration, or bytes."""

    name: str
    before: float
    after: float

    @property
    def relative(self) -> float:
        return self.after / self.before - 1.0


def changes(old: dict, new: dict) -> tuple[list[Change], list[str]]:
    """Return the changes of the checked figures of both results, and names that only `old` has.

    Only names of the parts that were measured for `new` are returned.
    """
    parts = {name.split(" / ")[0] for name in new["figures"]}
    before, after = (
        {name: _compared(one) for name, one in each["figures"].items() if one["checked"]}
        for each in (old, new)
    )
    both = [Change(name, before[name], after[name]) for name in before if name in after]
    missing = [name for name in before if name not in after and name.split(" / ")[0] in parts]
    return both, missing


def slower(all_changes: Iterable[Change]) -> list[Change]:
    """Return the changes that are warnings, the largest first."""
    found = [one for one in all_changes if one.relative > TOLERANCE]
    return sorted(found, key=lambda one: -one.relative)
