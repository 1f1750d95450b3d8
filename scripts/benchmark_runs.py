"""Runs of `sph` in processes of their own, from one or more source trees, and their figures.

A figure is a value in CPU seconds, wall seconds or bytes. Each repeat of a figure in CPU seconds is
also stored as a ratio to the calibration (`benchmark_calibration`) just before and after.
"""

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

SECONDS = {"CPU s": 1.0, "CPU µs": 1e-6}  # units that are compared by ratios to the calibration


class Quantity(NamedTuple):
    """What a figure is: its unit, and whether a check compares the figure."""

    unit: str
    checked: bool


QUANTITIES = {
    "update": Quantity("CPU µs", True),
    "step": Quantity("CPU µs", True),
    "process": Quantity("CPU s", True),
    "compilation": Quantity("CPU s", True),
    "memory per particle": Quantity("bytes", True),
    "whole run, update": Quantity("CPU µs", False),
    "update, wall": Quantity("µs", False),
    "process, wall": Quantity("s", False),
    "list builds per step": Quantity("", False),
    "peak memory": Quantity("MB", False),
}
PHASE = Quantity("CPU µs", False)  # any other quantity is a phase of the program's clock


def quantity(name: str) -> Quantity:
    """Return the quantity of the figure "part / scene / quantity"."""
    return QUANTITIES.get(name.rsplit(" / ", 1)[-1], PHASE)


class Tree(NamedTuple):
    """A source tree of sph."""

    path: Path
    precisions: tuple[str, ...]  # that its configuration accepts

    @classmethod
    def at(cls, path: Path) -> "Tree":
        """Return the tree in a folder. Raises BenchmarkError if the folder has no sph."""
        question = (
            "import sph; from sph.config.sections import SECTIONS; "
            "print(sph.__file__); print('precision' in SECTIONS['run'].model_fields)"
        )
        path = path.resolve()
        answer = _child(path, ["-c", question], f"{path} is no source tree of sph")
        file, has_precision = answer.split("\n")[:2]
        if not Path(file).is_relative_to(path):
            raise BenchmarkError(
                f"{path}: expected a source tree with the folder sph; Python found {file}.\n"
                "Try: a checkout, for example of `git worktree add FOLDER COMMIT`."
            )
        return cls(path, ("double", "single") if has_precision == "True" else ("double",))


class BenchmarkError(Exception):
    """A mistake in the call, or a run that failed. The message is for the user."""


class Spent(NamedTuple):
    """Time of a whole process."""

    cpu: float  # seconds, user + system, all threads
    wall: float


def _child(tree: Path, arguments: list[str], problem: str, cache: Path | None = None) -> str:
    """Run Python with the tree's sph in a temporary folder; return stdout."""
    paths = [str(tree), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    with tempfile.TemporaryDirectory() as elsewhere:  # -m puts the current folder before all others
        done = subprocess.run(
            [sys.executable, *arguments], cwd=elsewhere, env=environment, capture_output=True,
            text=True,
        )  # fmt: skip
    if done.returncode:
        last = done.stderr.strip().splitlines()[-5:]
        raise BenchmarkError("\n".join([f"{problem}: exit code {done.returncode}.", *last]))
    return done.stdout


def process(tree: Tree, arguments: list[str], cache: Path | None = None) -> Spent:
    """Run `sph` with these arguments. Raises BenchmarkError if the run fails."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), os.times().elapsed
    _child(tree.path, ["-m", "sph", *arguments], f"sph {arguments[0]} of {tree.path} failed", cache)
    after, end = resource.getrusage(resource.RUSAGE_CHILDREN), os.times().elapsed
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Spent(cpu, end - begin)


def run(tree: Tree, text: str, threads=1, cache: Path | None = None) -> dict:
    """Run a configuration. Return the cost in its summary, with the `Spent` of the process."""
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder, "benchmark.toml")
        config.write_text(text, encoding="utf-8")
        arguments = ["run", str(config), "-o", f"{folder}/run", "--threads", str(threads)]
        spent = process(tree, arguments, cache)
        summary = json.loads(Path(folder, "run", "summary.json").read_text(encoding="utf-8"))
    return {**summary["cost"]["session"], "particles": summary["particles"], "process": spent}


class Measurement(NamedTuple):
    """Figures that one or more runs give together.

    once: returns the value of each quantity for a tree, from one repeat.
    warm: a configuration that is run first, to fill the cache of compiled code; none if empty.
    """

    part: str
    scene: str
    once: Callable[[Tree], dict[str, float]]
    warm: str = ""
    precision: str = "double"


class Series(NamedTuple):
    """The repeats of a figure; `ratios` to the calibration, empty if the unit is not CPU time."""

    values: list[float]
    ratios: list[float]

    @property
    def compared(self) -> list[float]:
        """What a check compares: ratios if there are any."""
        return self.ratios or self.values

    def add(self, other: "Series") -> None:
        self.values.extend(other.values)
        self.ratios.extend(other.ratios)


Figures = dict[str, Series]  # by name, "part / scene / quantity"


def measure(one: Measurement, trees: list[Tree], repeats: int, calibrate) -> list[Figures]:
    """Return the figures of each tree. Trees alternate, as other work on the machine varies."""
    figures: list[Figures] = [{} for _ in trees]
    if one.warm:
        for tree in trees:
            run(tree, one.warm)
    for repeat in range(repeats):
        order = range(len(trees)) if repeat % 2 == 0 else reversed(range(len(trees)))
        for index in order:
            before = calibrate()
            values = one.once(trees[index])
            pair_seconds = 1e-9 * 0.5 * (before + calibrate())
            for name, value in values.items():
                full = f"{one.part} / {one.scene} / {name}"
                seconds = SECONDS.get(quantity(full).unit)
                ratios = [] if seconds is None else [value * seconds / pair_seconds]
                figures[index].setdefault(full, Series([], [])).add(Series([value], ratios))
    return figures


def spread(values: list[float]) -> dict[str, float]:
    return {"min": min(values), "median": statistics.median(values), "max": max(values)}
