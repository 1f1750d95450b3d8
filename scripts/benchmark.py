"""Benchmark: what a step costs, by phase, size, threads and scene; what compiling costs.

    python scripts/benchmark.py                 everything (about 15 minutes on two cores)
    python scripts/benchmark.py engine scenes   some of: engine, scenes, first, sod

Every figure comes from `sph run` in a process of its own, as a user would run it, and is the median
of --repeats runs. CPU seconds are user + system over all threads. Prints Markdown.
"""

import argparse
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from sph.output.run_directory import RunDirectory

UNIFORM = """
[problem]
name = "uniform"
dimension = {dimension}
n = {n}
noise = 0.2
seed = 1
[physics]
gamma = 1.6666666666666667
eta = 1.6
balsara = {balsara}
alpha = {alpha}
[time]
end = {end}
[output]
interval = {end}
"""
SOD = '[problem]\nname = "shock_tube"\nn = 1000\n[time]\nend = 0.2\n[output]\ninterval = 0.05\n'
STEP = 0.0045 * 64  # of the noisy 3-D lattice times n per axis, by the signal-speed criterion
PHASES = ("order", "lists", "density", "rates", "predict, correct", "step size, sums")
CONSTANT, SWITCHED = "1.0", "{ min = 0.1, max = 2.0 }"


def main():
    parts = {"engine": engine, "scenes": scenes, "first": first_run, "sod": sod}
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", help=", ".join(parts))
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    print(f"Machine: {processor()}, {os.cpu_count()} cores; Python {platform.python_version()}.\n")
    for name in options.parts or parts:
        parts[name](options.repeats)


def processor() -> str:
    """The processor's name, with the widest vector instructions it has."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return platform.processor()
    name = next(line.split(":")[1].strip() for line in text.splitlines() if "model name" in line)
    wide = next((s for s in ("avx512f", "avx2") if s in text), "no AVX2")
    return f"{name} ({wide})"


def uniform(dimension=3, n=64**3, balsara="true", alpha=CONSTANT, steps=12) -> str:
    per_axis = n ** (1 / dimension)
    end = steps * STEP / per_axis
    return UNIFORM.format(dimension=dimension, n=n, balsara=balsara, alpha=alpha, end=end)


def run(text: str, threads=1, cache: Path | None = None) -> dict:
    """One run: the summary's cost, with CPU and wall seconds of the whole process added."""
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "benchmark.toml"
        config.write_text(text)
        environment = dict(os.environ)
        if cache is not None:
            environment["NUMBA_CACHE_DIR"] = str(cache)
        command = [sys.executable, "-m", "sph.cli", "run", str(config), "-o", f"{folder}/run"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        begin = os.times().elapsed
        subprocess.run(
            [*command, "--threads", str(threads)], check=True, capture_output=True, env=environment
        )
        wall = os.times().elapsed - begin
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        summary = RunDirectory(Path(folder, "run")).whole_summary()
    cost = {**summary["cost"]["session"], "particles": summary["particles"]}
    cost["process_cpu"] = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    cost["process_wall"] = wall
    return cost


def median_of(repeats: int, figure, **arguments) -> tuple[dict, dict]:
    """The run with the median figure, and `figure` of all runs: min, median, max."""
    runs = sorted((run(**arguments) for _ in range(repeats)), key=figure)
    values = [figure(one) for one in runs]
    return runs[len(runs) // 2], {
        "min": values[0], "median": statistics.median(values), "max": values[-1]
    }  # fmt: skip


def rate(cost: dict) -> float:
    return cost["updates_per_cpu_second"]


def row(*cells) -> None:
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def header(*cells) -> None:
    row(*cells)
    row(*("---" for _ in cells))


def engine(repeats: int) -> None:
    """3-D noisy lattice, 125 neighbours: microseconds of CPU an update, by phase."""
    print("## Engine: 3-D noisy lattice, 125 neighbours, double precision, one global step\n")
    print("Whole runs of 20 steps with their start (first columns), and what a further step costs:")
    print("the difference to runs of 4 steps, by phase.\n")
    run(uniform(n=4096, steps=3))  # fills the cache of compiled code
    header("particles", "threads", "thousand updates per CPU-s (min … max)", "peak memory (MB)",
           "CPU µs an update", "wall µs", *(f"{phase} (µs)" for phase in PHASES),
           "list builds a step")  # fmt: skip
    peaks = {}
    for per_axis in (32, 64, 100):
        for threads in (1, 2):
            number = per_axis**3
            cost, rates = median_of(
                repeats, rate, text=uniform(n=number, steps=20), threads=threads
            )
            short, _ = median_of(repeats, rate, text=uniform(n=number, steps=4), threads=threads)
            micro = {
                phase: 1e6
                * (cost["phases_cpu_seconds"][phase] - short["phases_cpu_seconds"][phase])
                / (cost["updates"] - short["updates"])
                for phase in PHASES
            }
            wall = (cost["wall_seconds"] - short["wall_seconds"]) / (
                cost["updates"] - short["updates"]
            )
            builds = (cost["list_builds"] - short["list_builds"]) / (cost["steps"] - short["steps"])
            row(
                f"{per_axis}³", threads,
                "{median:.0f} ({min:.0f} … {max:.0f})".format(
                    **{name: value / 1e3 for name, value in rates.items()}
                ),
                f"{cost['peak_memory_bytes'] / 1e6:.0f}", f"{sum(micro.values()):.2f}",
                f"{1e6 * wall:.2f}", *(f"{value:.2f}" for value in micro.values()),
                f"{builds:.2f}",
            )  # fmt: skip
            if threads == 1:
                peaks[number] = cost["peak_memory_bytes"]
    (small, least), *_, (large, most) = peaks.items()
    print(f"\nMemory a particle (slope of the peak from {small} to {large} particles): "
          f"{(most - least) / (large - small):.0f} bytes.\n")  # fmt: skip


def scenes(repeats: int) -> None:
    """What a scene does not need costs nothing."""
    print("## Scenes: time a step, and compiling from an empty cache\n")
    header("dimension", "alpha", "Balsara", "compile CPU s", "µs CPU an update", "density", "rates")
    for dimension, n, steps in ((1, 20_000, 40), (2, 160**2, 40), (3, 40**3, 20)):
        for alpha in (CONSTANT, SWITCHED):
            for balsara in ("false", "true"):
                text = uniform(dimension, n, balsara, alpha, steps)
                with tempfile.TemporaryDirectory() as cache:
                    compile_seconds = run(text, cache=Path(cache))["compile_cpu_seconds"]
                    cost, _ = median_of(repeats, rate, text=text, cache=Path(cache))
                phases, updates = cost["phases_cpu_seconds"], cost["updates"]
                row(
                    f"{dimension}-D", "constant" if alpha == CONSTANT else "switched", balsara,
                    f"{compile_seconds:.1f}", f"{1e6 / cost['updates_per_cpu_second']:.2f}",
                    *(f"{1e6 * phases[name] / updates:.3f}" for name in ("density", "rates")),
                )  # fmt: skip
    print()


def first_run(_repeats: int) -> None:
    """The first run on a machine: nothing compiled yet."""
    print("## First run: CPU seconds of compilation from an empty cache\n")
    header("scene", "compiling", "whole process")
    for name, text in (("1-D Sod, N = 1000", SOD), ("3-D, 32³", uniform(n=32**3, steps=3))):
        with tempfile.TemporaryDirectory() as cache:
            cost = run(text, cache=Path(cache))
        row(name, f"{cost['compile_cpu_seconds']:.1f}", f"{cost['process_cpu']:.1f}")
    print()


def sod(repeats: int) -> None:
    """Sod's tube in 1-D, everything included, with compiled code in the cache."""
    print("## Sod, 1-D, N = 1000 to t = 0.2: whole process, warm\n")
    run(SOD)
    runs = [run(SOD) for _ in range(max(repeats, 5))]
    header("", "min", "median", "max")
    for name in ("process_wall", "process_cpu"):
        values = [one[name] for one in runs]
        row(name.replace("_", " ") + " (s)",
            *(f"{f(values):.2f}" for f in (min, statistics.median, max)))  # fmt: skip
    print()


if __name__ == "__main__":
    main()
