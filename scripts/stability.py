"""How far the defaults are from the limit: `sph stability` for every scheme and problem.

    python scripts/stability.py [-o DIR] [--only sod --only noh …]     the searches, half an hour
    python scripts/stability.py [-o DIR] --table                       what is there, as Markdown
    python scripts/stability.py [-o DIR] --pictures docs/images        how each scheme fails

Stopped and called again, it goes on where it was: runs that are there are not repeated. Problems
are small and short, so that a search takes seconds.
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

# Shipped configurations, and what makes them small. Not too short: an instability needs some tens
# of steps to be seen, at the largest C as well.
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
    "square": {"problem.n": 448, "time.end": 0.5},
    "kelvin_helmholtz_smooth": {"problem.n": 576, "time.end": 0.3},
    "kelvin_helmholtz": {"problem.n": 1530, "time.end": 0.2},
    "yee": {"problem.n": 1024},
    "point_explosion": {"problem.n": 1728},
    "expanding_ball": {"problem.n": 500, "time.end": 0.5},
    "contrast": {},
    "blob": {"problem.n": 1000, "time.end": 3.0},
    "keplerian_ring": {"problem.n": 500, "time.end": 3.0},
    "particles": {"time.end": 1.0},
}
# Where particles follow the exact solution to nearly nothing, half as much again is nothing either.
LIMITS = {"contrast": ["negligible=1e-6"], "keplerian_ring": ["negligible=5e-3"]}
IDEAL_GAS_ONLY = {"pressure_energy": ("stiffened_tube",)}

# Values at which Sod's tube is drawn: stable, beyond and far beyond.
SHOWN = {"physics.C": (0.25, 0.4, 0.6), "physics.eta": (1.2, 1.0, 0.85)}


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
        "| problem | N, to t | scheme | C: stable up to | over its C | then | steps there "
        "| run stops at | η: stable from | to | its η | below, above |",
        "| :--- | :--- | :--- | ---: | ---: | :--- | ---: | ---: | ---: | ---: | ---: | :--- |",
    ]
    for problem, scheme in combinations(only):
        target = directory / f"{problem}-{scheme}"
        courant, eta = (_read(target, key) for key in KEYS)
        if courant or eta:
            some = courant or eta
            lines.append(
                f"| {problem} | {some.get('particles', '')}, {some.get('end', '')} | {scheme} | "
                f"{' | '.join((*_courant(courant), *_eta(eta)))} |"
            )
    return "\n".join(lines)


def _read(target: Path, key: str) -> dict:
    path, said = target / f"{key}.json", target / f"{key}.said"
    if path.exists():
        return json.loads(path.read_text())
    return {"failed": said.read_text()} if said.exists() else {}


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
    return ", ".join([*parts, *["energy"] * ("energy drifts" in end["reason"])])


def pictures(directory: Path, target: Path) -> None:
    """Density of Sod's tube in each scheme at SHOWN, with no limit on energy drift."""
    from sph.analysis.figures import style

    for key, values in SHOWN.items():
        home = directory / f"sod-shown-{key}"
        command = [
            *(sys.executable, "-m", "sph.cli", "sweep", str(ROOT / "configs" / "sod.toml")),
            *("--vary", f"physics.scheme={','.join(SCHEMES)}"),
            *("--vary", f"{key}={','.join(map(str, values))}"),
            *("--set", "problem.n=200", "--set", "physics.max_energy_drift=1e9"),
            *("--jobs", "1", "--set", "run.threads=1", "-o", str(home)),
        ]
        subprocess.run(command, check=False)  # a run may fail: its panel says so
        with style.paper():
            picture = style.new_figure(9.0, 7.0)
            panels = picture.subplots(len(SCHEMES), len(values), sharex=True, sharey=True)
            for row, scheme in zip(panels, SCHEMES, strict=True):
                row[0].set_ylabel(rf"$\rho$  ({scheme.replace('_', ' ')})")
                for panel, value in zip(row, values, strict=True):
                    _profile(panel, home / f"physics.scheme={scheme},{key}={value}")
                    panel.set_title(f"{key} = {value}{panel.get_title()}", fontsize=10)
            for panel in panels[-1]:
                panel.set_xlabel("$x$")
            # what has blown up goes off the panel rather than hide the rest
            panels[0, 0].set_ylim(0.0, 1.5)
            picture.savefig(target / f"stability_{key.partition('.')[2]}.png", dpi=100)


def _profile(panel, directory: Path) -> None:
    """The last density of a run, over the exact one; in the title its energy drift, or its end."""
    import numpy as np

    from sph.analysis.figures import style
    from sph.output import checkpoint
    from sph.output.run_directory import RunDirectory

    run = RunDirectory(directory)
    summary = json.loads(run.summary.read_text())
    state = checkpoint.read(run.checkpoints()[-1])
    x = state.particles.position[0]
    order = np.argsort(x)
    problem, eos = state.config.problem, state.config.physics.eos_model()
    exact = problem.exact(eos, state.time, state.particles.position)["density"]
    panel.plot(x[order], exact[order], color="0.6")
    panel.plot(x, state.particles.density, ".", ms=2.5, color=style.PALETTE[0])
    drift = summary["conservation"]["energy_drift_max"]
    ended = "" if summary["status"] == "done" else f", stopped at t = {summary['time']:.2g}"
    panel.set_title(f", drift {drift:.1g}{ended}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-o", dest="directory", type=Path, default=Path("runs/stability"))
    parser.add_argument("--only", action="append", choices=tuple(PROBLEMS), default=[])
    parser.add_argument("--table", action="store_true", help="print what is there")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="draw into FOLDER")
    options = parser.parse_args()
    os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    if options.pictures:
        pictures(options.directory, options.pictures)
    elif not options.table:
        search(options.directory, options.only)
    print(table(options.directory, options.only))


if __name__ == "__main__":
    main()
