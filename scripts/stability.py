"""How far the defaults are from the limit: `sph stability` for every scheme and problem.

    python scripts/stability.py [-o DIR] [--only sod --only noh …]     the searches, half an hour
    python scripts/stability.py [-o DIR] --table                       what is there, as Markdown

Stopped and called again, it goes on where it was: runs that are there are not repeated. Problems
are small, so that a search takes seconds.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCHEMES = ("grad_h", "variational", "pressure_energy")
KEYS = ("physics.C", "physics.eta")

# Shipped configurations, and what makes them small. Runs are whole: an instability may be slow.
# Three are shortened, and the table says so: later the modes of kelvin_helmholtz and
# rayleigh_taylor and the broken ring are chaotic, so runs at any two C differ.
PROBLEMS = {
    "sod": {"problem.n": 200},
    "strong_shock": {"problem.n": 300},
    "noh": {},
    "blast_waves": {},
    "shu_osher": {"problem.n": 400},
    "sound_wave": {"problem.n": 64},
    "stiffened_tube": {"problem.n": 300},
    "uniform": {"problem.n": 256, "time.end": 2.0},
    "point_explosion_2d": {"problem.n": 1024},
    "gresho": {"problem.n": 576},
    "square": {"problem.n": 448},
    "kelvin_helmholtz_smooth": {"problem.n": 576},
    "kelvin_helmholtz": {"problem.n": 1530, "time.end": 0.2},
    "rayleigh_taylor": {"problem.n": 512, "time.end": 2.5},
    "yee": {"problem.n": 1024},
    "point_explosion": {"problem.n": 1728},
    "expanding_ball": {"problem.n": 500},
    "contrast": {},
    "blob": {"problem.n": 1000},
    "keplerian_ring": {"problem.n": 500, "time.end": 3.0},
    "particles": {"time.end": 1.0},
}
# Where particles follow the exact solution to nearly nothing, half as much again is nothing either.
LIMITS = {"contrast": ["negligible=1e-6"], "keplerian_ring": ["negligible=5e-3"]}
IDEAL_GAS_ONLY = {"pressure_energy": ("stiffened_tube",)}


def combinations(only):
    """(problem, scheme) in the order of the table."""
    for problem in PROBLEMS:
        for scheme in SCHEMES:
            if problem not in IDEAL_GAS_ONLY.get(scheme, ()) and (not only or problem in only):
                yield problem, scheme


def searches(only):
    """(problem, scheme, key) in the order they are made: a scheme's largest C come first."""
    for scheme in SCHEMES:
        for key in KEYS:
            yield from (
                (problem, scheme, key) for problem, one in combinations(only) if one == scheme
            )


def search(directory: Path, only) -> None:
    """Make what is missing; what a search that exits with 3 said is kept for the table."""
    for problem, scheme, key in searches(only):
        target = directory / f"{problem}-{scheme}"
        words = target / f"{key}.said"
        if words.exists():
            continue
        sets = {"physics.scheme": scheme, "run.threads": 1, **PROBLEMS[problem]}
        command = [
            sys.executable, "-m", "sph.cli", "stability",
            str(ROOT / "configs" / f"{problem}.toml"), "--key", key, "--jobs", "1",
            "-o", str(target),
            *(part for name in sets for part in ("--set", f"{name}={sets[name]}")),
            *(part for limit in LIMITS.get(problem, ()) for part in ("--limit", limit)),
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        said = (done.stdout + done.stderr).strip()
        print(f"{problem} {scheme} {key}: exit {done.returncode}\n{done.stdout}", flush=True)
        if done.returncode in (0, 3):
            target.mkdir(parents=True, exist_ok=True)
            words.write_text(said)
        else:
            print(said, flush=True)


def table(directory: Path, only) -> str:
    """A line for each problem and scheme that has been searched."""
    lines = [
        "| problem | N, to t (of time.end) | scheme | C: stable up to | over its C | then "
        "| steps there | run stops at | η: stable from | to | its η | below, above |",
        "| :--- | :--- | :--- | ---: | ---: | :--- | ---: | ---: | ---: | ---: | ---: | :--- |",
    ]
    for problem, scheme in combinations(only):
        target = directory / f"{problem}-{scheme}"
        courant, eta = (_read(target, key) for key in KEYS)
        if courant or eta:
            some = courant or eta
            lines.append(
                f"| {problem} | {some.get('particles', '')}, {_time(some)} | {scheme} | "
                f"{' | '.join((*_courant(courant), *_eta(eta)))} |"
            )
    return "\n".join(lines)


def _read(target: Path, key: str) -> dict:
    path, said = target / f"{key}.json", target / f"{key}.said"
    if path.exists():
        return json.loads(path.read_text())
    return {"failed": said.read_text()} if said.exists() else {}


def _time(found: dict) -> str:
    """To what time the runs went, and of which where the configuration's own is later."""
    if "end" not in found:
        return ""
    end, whole = found["end"], found["whole_end"]
    return f"{end:g} ({whole:g})" if end < whole else f"{end:g}"


def _courant(found: dict) -> tuple[str, str, str, str, str]:
    if "ends" not in found:
        return ("reference fails" if found else "–", "", "", "", "")
    end = found["ends"]["largest"]
    failed = [trial["value"] for trial in found["trials"] if trial["verdict"] == "failed"]
    steps = (str(one["steps"]) for one in found["trials"] if one["value"] == end["stable"])
    stops = f"{min(failed):.2g}" if failed else ""
    return _value(end, ">"), _ratio(end), _why(found, end), next(steps, ""), stops


def _eta(found: dict) -> tuple[str, str, str, str]:
    if "ends" not in found:
        return ("reference fails" if found else "–", "", "", "")
    low, high = found["ends"]["smallest"], found["ends"]["largest"]
    why = f"{_why(found, low) or '–'}; {_why(found, high) or '–'}"
    return _value(low, "<"), _value(high, ">"), f"{found['default']:g}", why


def _value(end: dict, sign: str) -> str:
    if end["stable"] is None:
        return "none"
    return f"{'' if end['unstable'] else sign + ' '}{end['stable']:.3g}"


def _ratio(end: dict) -> str:
    return "" if end["over_default"] is None else f"{end['over_default']:.2g}"


def _why(found: dict, end: dict) -> str:
    """What ends it, in a word or two."""
    if end["unstable"] is None:
        return ""
    if end["verdict"] == "failed":
        return "stops: " + next(
            (word for word in ("energy", "wider", "support", "step") if word in end["reason"]),
            "numbers",
        )
    field = next(one["field"] for one in found["trials"] if one["value"] == end["unstable"])
    parts = [f"error of {field.replace('_', ' ')}"] * ("the error of" in end["reason"])
    parts += ["energy"] * ("energy drifts" in end["reason"])
    reference = found["reference"]
    figures = [
        name.replace("_", " ") for name in reference["largest_figures"] | reference["figures"]
    ]
    return ", ".join([*parts, *(name for name in figures if f"{name} is " in end["reason"])])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-o", dest="directory", type=Path, default=Path("runs/stability"))
    parser.add_argument("--only", action="append", choices=tuple(PROBLEMS), default=[])
    parser.add_argument("--table", action="store_true", help="print what is there")
    options = parser.parse_args()
    os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    if not options.table:
        search(options.directory, options.only)
    print(table(options.directory, options.only))


if __name__ == "__main__":
    main()
