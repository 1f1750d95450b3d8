"""What `run.precision = "single"` changes in the results of every shipped configuration.

    python scripts/precision.py                    all configurations, into runs/precision
    python scripts/precision.py sod noh_2d         some of them
    python scripts/precision.py -o DIR             runs in another directory

Each configuration is run in double and in single precision on one thread, with fewer particles
(REDUCED) if it would otherwise take more than about 30 CPU seconds. Runs that are in the directory
already are not repeated. Prints a Markdown table, which docs/precision.md contains.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from sph.output import checkpoint as checkpoints
from sph.output.run_directory import RunDirectory

HOME = Path(__file__).resolve().parent.parent
PRECISIONS = ("double", "single")
FIELDS = ("density", "velocity", "pressure")
DIGITS = 1e-3  # largest relative difference of two numbers that agree to 3 digits

REDUCED = {
    "blob": ["problem.n=2500"],
    "contrast_graded": ["problem.n=2000"],
    "kelvin_helmholtz": ["problem.n=6000"],
    "keplerian_ring": ["problem.n=1000"],
    "noh_2d": ["problem.n=8000"],
    "noh_3d": ["problem.n=16000"],
    "point_explosion": ["problem.n=16384"],
    "sod_3d": ["problem.n=24000"],
}
HEADER = (
    "configuration", "particles", "precision", *(f"L1 {field}" for field in FIELDS),
    "energy drift", "momentum", "steps", "CPU s", "3 digits", "particles apart",
)  # fmt: skip
WORDS = ("configuration", "precision", "3 digits")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="configurations; default: all")
    parser.add_argument("-o", dest="directory", type=Path, default=Path("runs/precision"))
    options = parser.parse_args()
    every = sorted(path.stem for path in (HOME / "configs").glob("*.toml"))
    print(_line(HEADER))
    print(_line(":---" if name in WORDS else "---:" for name in HEADER))
    for name in options.names or every:
        runs = [run(name, precision, options.directory) for precision in PRECISIONS]
        for line in rows(name, *runs):
            print(_line(line), flush=True)


def run(name: str, precision: str, home: Path) -> RunDirectory:
    """Return the run of a configuration in that precision, made unless it is there."""
    found = RunDirectory(home / f"{name}-{precision}")
    if not found.summary.is_file():
        settings = [f"run.precision={precision}", "run.threads=1", *REDUCED.get(name, [])]
        command = [sys.executable, "-m", "sph.cli", "run", str(HOME / "configs" / f"{name}.toml")]
        command += ["-o", str(found.path), *(word for one in settings for word in ("--set", one))]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        if result.returncode:
            sys.exit(f"{name} in {precision} precision: {result.stderr}")
    return found


def rows(name: str, *runs: RunDirectory):
    """Return the two lines of a configuration: double and single precision."""
    summaries = [json.loads(one.summary.read_text()) for one in runs]
    double, single = map(figures, summaries)
    wrong = [key for key in double if not _agree(double[key], single[key])]
    for index, (precision, found) in enumerate(zip(PRECISIONS, (double, single), strict=True)):
        cost, last = summaries[index]["cost"], index == len(runs) - 1
        conserved = summaries[index]["conservation"]
        yield (
            "" if last else name,
            "" if last else str(summaries[0]["particles"]),
            precision,
            *(_number(found.get(key)) for key in (*FIELDS, "energy drift")),
            _number(conserved["momentum_change"]),
            str(summaries[index]["steps"]),
            f"{cost['cpu_seconds']:.1f}",
            (", ".join(wrong) or "all") if last else "",
            _number(difference(*runs)) if last else "",
        )


def figures(summary) -> dict[str, float | None]:
    """Return the numbers of a summary that should not depend on the precision."""
    errors = (summary["errors"] or {"fields": {}})["fields"]
    found = {field: errors[field]["L1"] for field in FIELDS if field in errors}
    return found | {"energy drift": summary["conservation"]["energy_drift_max"]}


def difference(*runs: RunDirectory) -> float:
    """Return the median over particles of the relative difference of density at the end."""
    last = [checkpoints.read(one.checkpoints()[-1]).particles for one in runs]
    double, single = (one.density[np.argsort(one.id)] for one in last)
    return float(np.median(abs(single / double - 1.0)))


def _agree(a: float | None, b: float | None) -> bool:
    if a is None or b is None:
        return a is b
    return abs(a - b) <= DIGITS * abs(a)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def _line(cells) -> str:
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
