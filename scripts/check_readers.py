"""Open a run with yt, pynbody, swiftsimio, ParaView's format and sarracen; compare; draw.

    pip install '.[readers]'
    python scripts/check_readers.py                          # made-up states
    python scripts/check_readers.py RUN --pictures DIR       # the last checkpoint of a run

A table says what each program sees: "as written", or what differs. Without RUN, the states are gas
in one, two and three dimensions, gas in physical units, and a solid and a liquid in plane strain.
With --pictures, each program draws the density of RUN, and readers.png has all pictures.

Exits with 0 if all programs see what was written, 1 if one does not, 77 if some are not installed
and the others see what was written; with --require, 1 if a program that it names is not installed.
"""

import argparse
import importlib.util
import sys
import tempfile
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path

import check_readers_states as made_up
import numpy as np
from check_readers_open import READERS, Files, Reader, public_fields, rows, written

from sph.analysis.export import fields
from sph.output import checkpoint as checkpoints
from sph.output.run_directory import find

SKIPPED = 77  # as in Automake and Meson
NOT_INSTALLED = "not installed"


def expected(state: checkpoints.Checkpoint) -> dict[str, np.ndarray]:
    """What a program must see of a run, in the order of the IDs, in code units."""
    return {one.name: rows(one.values) for one in fields.of(state)}


def differences(reader: Reader, files: Files, right: dict, is_made_up: bool = False) -> list[str]:
    """Return what a program sees that is not as written. right: expected fields in code units."""
    state, seen = files.state, reader.see(files)
    units, public = state.config.units, public_fields(state)
    units_within = reader.units_within if units.are_given else 0.0
    # besides, a few roundings of products of units and of H/h
    within = units_within + (1e-14 if reader.is_in_cgs else 0.0)
    order, found = np.argsort(seen["id"]), []
    if missing := public.keys() - right.keys():
        raise ValueError(f"nothing is expected of {', '.join(missing)}")
    for name, values in right.items():
        one = public[name]
        factor = units.factor(one.length, one.mass, one.time) if reader.is_in_cgs else 1.0
        if not is_equal(seen[name][order], values * factor, within):
            found.append(name)
    length, time = (units.in_cgs()[::2]) if reader.is_in_cgs else (1.0, 1.0)
    if not has_positions(state, seen["position"][order] / length, units_within):
        found.append("position")
    if not is_equal(np.array(seen["time"]), np.array(state.time * time), within):
        found.append("time")
    gamma = adiabatic_index(state)
    if gamma is not None and seen.get("adiabatic index", gamma) != gamma:
        found.append("adiabatic index")
    if "box" in seen and not np.all((seen["position"] >= 0) & (seen["position"] <= seen["box"])):
        found.append("box")
    if is_made_up and "slice" in seen and not shows_gas(seen["slice"]):
        found.append("slice")
    return found


def is_equal(seen: np.ndarray, right: np.ndarray, within: float) -> bool:
    """Whether two arrays are equal within a relative tolerance, or a tenth of it of the largest."""
    if seen.shape != right.shape:
        return False
    return bool(np.allclose(seen, right, rtol=within, atol=0.1 * within * np.abs(right).max()))


def has_positions(state: checkpoints.Checkpoint, position: np.ndarray, within: float) -> bool:
    """Differences along used axes as in the state, unused axes in one plane."""
    true = fields.position(state)
    used = true.shape[1]
    moved = position[:, :used] - position[0, :used] - (true - true[0])
    size = max(np.abs(true).max(), np.abs(position).max())
    # the corner of the box is subtracted and added, and the unit multiplied and divided
    return (
        bool(np.abs(moved).max() <= (8 * 1.2e-16 + within) * size)
        and not np.ptp(position[:, used:], axis=0).any()
    )


def adiabatic_index(state: checkpoints.Checkpoint) -> float | None:
    """Gamma; None of a scene without, for which swiftsimio takes 5/3."""
    physics = state.config.physics
    is_gas = physics.formulation == "gas"
    return getattr(physics.eos_model(), "gamma", None) if is_gas else None


def shows_gas(image: np.ndarray) -> bool:
    """Whether the middle plane shows gas, whose density rises along x as it was made to."""
    image = np.where(np.isfinite(image), image, 0.0)
    along_x = image.max(axis=0)
    gas = along_x[along_x > 0]
    return gas.size > 10 and gas[-10:].mean() > gas[:10].mean()


def verdict(reader: Reader, files: Files, right: dict, is_made_up: bool) -> str:
    try:
        wrong = differences(reader, files, right, is_made_up)
    except Exception:
        traceback.print_exc()
        return "cannot open it"
    return f"WRONG: {', '.join(wrong)}" if wrong else "as written"


def is_installed(reader: Reader) -> bool:
    return importlib.util.find_spec(reader.package) is not None


def check(cases: dict[str, tuple[Files, dict, bool]], readers: Sequence[Reader]) -> dict[str, str]:
    """Print the table. Return the worst verdict by the name of the program.

    cases: files, expected fields, and whether the state is made up, by name.
    """
    print(f"{'program':<12}" + "".join(f"{name:<16}" for name in cases))
    worst = {}
    for reader in readers:
        if not is_installed(reader):
            worst[reader.name] = NOT_INSTALLED
            print(f"{reader.name:<12}skipped: {reader.package} is not installed", flush=True)
            continue
        verdicts = [verdict(reader, *case) for case in cases.values()]
        wrong = [one for one in verdicts if one != "as written"]
        worst[reader.name] = wrong[0] if wrong else "as written"
        print(f"{reader.name:<12}" + "".join(f"{one:<16}" for one in verdicts), flush=True)
    return worst


def made_up_cases(directory: Path) -> dict[str, tuple[Files, dict, bool]]:
    found = {}
    for name, state in made_up.made_up().items():
        (directory / name).mkdir()
        files = written([made_up.earlier(state), state], directory / name)
        found[name] = files, made_up.expected(state), True
    return found


def case_of_run(source: Path, directory: Path) -> dict[str, tuple[Files, dict, bool]]:
    """The last checkpoint of a run with its first as an earlier time step, or a checkpoint."""
    run, path = find(source)
    chosen = [path] if run is None or not source.is_dir() else [*run.checkpoints()[:1], path]
    states = [checkpoints.read(one) for one in dict.fromkeys(chosen)]
    files = written(states, directory, path)
    return {path.name: (files, expected(states[-1]), False)}


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    text, names = __doc__ or "", [reader.name for reader in READERS]
    parser = argparse.ArgumentParser(
        description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", nargs="?", type=Path, help="a run directory, or a checkpoint")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="draw RUN into this directory")
    parser.add_argument(
        "--require", nargs="*", choices=names, metavar="PROGRAM",
        help=f"programs that must be installed, of {', '.join(names)}; all if none is named",
    )  # fmt: skip
    asked = parser.parse_args(given)
    if asked.pictures and not asked.run:
        parser.error("--pictures needs RUN")
    asked.required = names if asked.require == [] else asked.require or []
    return asked


def main(given: Sequence[str] | None = None) -> int:
    asked = arguments(given)
    warnings.filterwarnings("ignore")
    with tempfile.TemporaryDirectory() as directory:
        target = Path(directory)
        cases = case_of_run(asked.run, target) if asked.run else made_up_cases(target)
        worst = check(cases, READERS)
        if asked.pictures:
            import check_readers_pictures as pictures

            ((files, *_),) = cases.values()
            can_draw = [one for one in READERS if worst[one.name] == "as written"]
            for path in pictures.draw(files, can_draw, asked.pictures):
                print(f"wrote {path}")
    skipped = [name for name, one in worst.items() if one == NOT_INSTALLED]
    if missing := [name for name in skipped if name in asked.required]:
        print(f"required, but not installed: {', '.join(missing)}", file=sys.stderr)
        return 1
    if any(one not in ("as written", NOT_INSTALLED) for one in worst.values()):
        return 1
    return SKIPPED if skipped else 0


if __name__ == "__main__":
    sys.exit(main())
