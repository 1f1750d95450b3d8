"""Benchmark: what a particle update and a step cost, by phase, size, precision and scene.

    python scripts/benchmark.py                      all parts (about 30 CPU minutes)
    python scripts/benchmark.py --quick              the main figures (about 6 CPU minutes)
    python scripts/benchmark.py engine small         some of: engine, small, whole, start, scenes,
                                                     solids
    python scripts/benchmark.py --json FILE          also write the figures to a JSON file
    python scripts/benchmark.py --against CHECKOUT   also another source tree, runs alternating
    python scripts/benchmark.py --check              compare with docs/benchmarks
    python scripts/benchmark.py --check --from FILE  compare a stored result, without measuring

Every figure comes from `sph` in a process of its own, as a user runs it, and is the median of
--repeats runs. CPU time is user + system over all threads. Prints Markdown. Exit codes: 0 done,
1 slower than the last stored result, 2 wrong arguments, a damaged file or a run that failed.
"""

import argparse
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmark_calibration import Calibration
from benchmark_results import TOLERANCE, changes, last, machine, read, result, slower, write
from benchmark_runs import (
    BenchmarkError,
    Figures,
    Measurement,
    Tree,
    measure,
    quantity,
    spread,
)
from benchmark_scenes import PARTS

HOME = Path(__file__).resolve().parent.parent


def main(arguments: list[str] | None = None) -> int:
    options = parsed(arguments)
    try:
        if options.stored:
            content = read(options.stored)
            return report(last(content["machine"], but=options.stored), content)
        return measured(options)
    except BenchmarkError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2


def parsed(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", help=", ".join(PARTS))
    parser.add_argument("--repeats", type=int, default=3, help="runs for each figure (default 3)")
    parser.add_argument("--quick", action="store_true", help="the most important figures only")
    parser.add_argument("--json", type=Path, help="file to write the figures to")
    parser.add_argument("--tree", type=Path, default=HOME, help="source tree to measure")
    parser.add_argument("--against", type=Path, help="another source tree to compare with")
    parser.add_argument("--check", action="store_true", help="compare with docs/benchmarks")
    parser.add_argument("--from", type=Path, dest="stored", help="result for --check")
    options = parser.parse_args(arguments)
    if unknown := [name for name in options.parts if name not in PARTS]:
        parser.error(f"{unknown[0]!r} is no part: expected {', '.join(PARTS)}")
    if options.repeats < 1:
        parser.error(f"--repeats {options.repeats}: expected at least 1")
    if options.stored and not options.check:
        parser.error("--from FILE is for --check")
    return options


def measured(options: argparse.Namespace) -> int:
    trees = [Tree.at(path) for path in (options.tree, options.against) if path]
    values: list[float] = []  # of the calibration
    calibration = Calibration()

    def calibrate() -> float:
        values.append(calibration())
        return values[-1]

    print(f"Machine: {', '.join(f'{name} {value}' for name, value in machine().items())}.\n")
    figures: list[Figures] = [{} for _ in trees]
    done: list[Measurement] = []
    for name in options.parts or PARTS:
        for one in PARTS[name](options.quick):
            if not all(one.precision in tree.precisions for tree in trees):
                note(f"left out: {one.part} / {one.scene} (no run.precision in a source tree)")
                continue
            note(f"{one.part} / {one.scene}")
            for all_of_tree, new in zip(
                figures, measure(one, trees, options.repeats, calibrate), strict=True
            ):
                all_of_tree.update(new)
            done.append(one)
    before, again = None, []
    if options.check and (before := last(machine(), but=options.json)):
        again = repeated(before[1], trees[0], figures[0], done, options.repeats, calibrate)
    for name in options.parts or PARTS:
        print_part(name, figures[0])
    print("Calibration, CPU ns per pair: {min:.3f} … {max:.3f}, median {median:.3f}.\n".format(
        **spread(values)))  # fmt: skip
    if options.against:
        print_ratios(trees, figures)
    content = result(trees[0].path, figures[0], values)
    if options.json:
        write(options.json, content)
    return report(before, content, again) if options.check else 0


def note(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def repeated(old: dict, tree: Tree, figures: Figures, done, repeats: int, calibrate) -> list[str]:
    """Measure again what is slower than the stored result `old`, and add the repeats.

    Return the names of the figures that were slower before.
    """
    content = result(tree.path, figures, [1.0])
    names = [one.name for one in slower(changes(old, content)[0])]
    for one in done:
        if any(name.startswith(f"{one.part} / {one.scene} / ") for name in names):
            note(f"again, as it was slower: {one.part} / {one.scene}")
            for name, series in measure(one, [tree], repeats, calibrate)[0].items():
                figures[name].add(series)
    return names


def report(before: tuple[Path, dict] | None, content: dict, again: Sequence[str] = ()) -> int:
    """Print how a result compares with `before`, a stored one. Return 1 if a figure is slower.

    again: names of the figures that were measured again.
    """
    if before is None:
        print("Check: docs/benchmarks has no result of this kind of machine; nothing compared.")
        return 0
    file, old = before
    both, missing = changes(old, content)
    slow = slower(both)
    print(f"Check against {file.name} (commit {str(old['commit'])[:7]}): {len(both)} figures, "
          f"{len(slow)} slower by more than {100 * TOLERANCE:.0f} %"
          f"{f', {len(again)} measured again' if again else ''}.")  # fmt: skip
    for name in missing:
        print(f"Not measured now: {name}")
    if slow:
        print()
        header("figure", "stored ratio", "now", "slower by")
        for one in slow:
            row(one.name, f"{one.before:.4g}", f"{one.after:.4g}", f"{100 * one.relative:.1f} %")
    return 1 if slow else 0


def row(*cells) -> None:
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def header(*cells) -> None:
    row(*cells)
    row(*("---" for _ in cells))


def print_part(part: str, figures: Figures) -> None:
    """Print tables of a part: a row for each scene, a column for each quantity."""
    found: dict[str, dict[str, str]] = {}
    for name, series in figures.items():
        if name.startswith(f"{part} / "):
            _, scene, what = name.split(" / ")
            found.setdefault(scene, {})[what] = cell(name, series.values)
    if found:
        print(f"## {PARTS[part].__doc__}\n")
    tables: dict[tuple[str, ...], list[str]] = {}
    for scene, cells in found.items():
        tables.setdefault(tuple(cells), []).append(scene)
    for columns, its_scenes in tables.items():
        units = [quantity(f"{part} / x / {one}").unit for one in columns]
        titles = [
            f"{one} ({unit})" if unit else one for one, unit in zip(columns, units, strict=True)
        ]
        header("scene", *titles)
        for scene in its_scenes:
            row(scene, *(found[scene][one] for one in columns))
        print()


def cell(name: str, values: list[float]) -> str:
    """The median; of checked figures also the least and the largest."""
    least, median, most = map(short, spread(values).values())
    if not quantity(name).checked or len(values) == 1:
        return median
    return f"{median} ({least} … {most})"


def short(value: float) -> str:
    """Three digits, without an exponent above 1000."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


def print_ratios(trees: list[Tree], figures: list[Figures]) -> None:
    """Print the figures of both trees; each ratio is of runs that followed each other."""
    mine, other = figures
    print(f"## {trees[0].path} against {trees[1].path}\n")
    header("figure", "this", "other", "other / this (min … max)")
    for name, series in mine.items():
        if quantity(name).checked and name in other:
            ratios = [b / a for a, b in zip(series.values, other[name].values, strict=True)]
            row(name, f"{statistics.median(series.values):.4g}",
                f"{statistics.median(other[name].values):.4g}",
                "{median:.3f} ({min:.3f} … {max:.3f})".format(**spread(ratios)))  # fmt: skip
    print()


if __name__ == "__main__":
    sys.exit(main())
