"""Accuracy and CPU time of this program and of PySPH for elastic solids, on the same particles.

    python scripts/peers_solids.py                              the plate and the rings
    python scripts/peers_solids.py --only plate -o solids --pysph-python ~/pysph/bin/python

PySPH comes with `pip install "sph[peers]"`, or may live in an environment of its own, whose Python
is then given. The oscillating plate is judged by its period against linear elasticity, the rings by
whether they rebound in one piece, and how fast. CPU seconds are user + system on one thread, of the
time loop without compilation, start-up and the diagnostics of each step. Writes solids.json and
solids.md.
"""

import argparse
import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from peers import HOME, SHORT, require_pysph, timed

from sph import config as configuration
from sph.config import Config
from sph.domain import Domain
from sph.formulations.continuum import pieces
from sph.output import checkpoint, history
from sph.output.run_directory import RunDirectory

COLUMNS = ("problem", "code", "particles", "steps", "CPU s", "whole process", "figures")


class Case(NamedTuple):
    """A problem for both codes; PySPH's settings are those of its example of that name."""

    title: str
    config: str
    sizes: tuple[int, ...]  # particles asked for
    settings: dict[str, tuple[str, ...]]  # overrides of our configuration, by name
    pysph_sizes: tuple[int, ...]
    example: tuple[str, str]  # module and class in pysph.examples.solid_mech
    arrays: tuple[str, ...]  # of the example: the moving particles, and those that are held
    step: float  # PySPH's fixed time step over the spacing, of its example
    smoothing: float  # h over spacing, of its example
    frames: int  # states of PySPH that are judged


CASES = {
    "plate": Case(
        "Oscillating plate",
        "oscillating_plate",
        (290, 576, 962, 1448),
        {"sph": (), "sph, C = 0.15": ("physics.C=0.15",)},
        (290, 576, 962, 1448),
        ("oscillating_plate", "OscillatingPlate"),
        ("plate", "wall"),
        1e-5 / 0.002,
        1.3,
        400,
    ),
    "rings": Case(
        "Rubber rings",
        "rubber_rings",
        (1100, 2200, 4400),
        {"sph": (), "sph, C = 0.15": ("physics.C=0.15",)},
        (1100, 2200, 4400),
        ("rings", "Rings"),
        ("solid",),
        1e-8 / 0.0005,
        1.5,
        100,
    ),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=CASES, action="append", help="may be repeated")
    parser.add_argument("-o", dest="directory", type=Path, default=Path("solids"), metavar="DIR")
    parser.add_argument("--pysph-python", default=sys.executable, metavar="PATH")
    options = parser.parse_args()
    require_pysph(options.pysph_python)
    directory = options.directory.resolve()
    directory.mkdir(parents=True, exist_ok=True)
    rows = []
    for key in options.only or CASES:
        for row in runs_of(CASES[key], directory / key, options.pysph_python):
            rows.append(row)
            print(line(row), flush=True)
            write(rows, directory)
    print(f"\nTable: {directory / 'solids.md'}")


def runs_of(case: Case, directory: Path, python: str):
    """Yields a row for every run of the case, ours first."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, overrides in case.settings.items():
        own_run(case, case.sizes[0], overrides, directory / "short", share=SHORT)
        for n in case.sizes:
            home = directory / f"{name}_{n}".replace(", ", "_").replace(" = ", "_")
            yield row(case, name, n, own_run(case, n, overrides, home))
    pysph_run(case, case.pysph_sizes[0], directory, python, share=SHORT)
    for n in case.pysph_sizes:
        yield row(case, "PySPH", n, pysph_run(case, n, directory, python))


def config_of(case: Case, n: int, overrides: tuple[str, ...] = ()) -> Config:
    path = HOME / "configs" / f"{case.config}.toml"
    return configuration.load(path, [f"problem.n={n}", *overrides])


def own_run(case: Case, n: int, overrides, home: Path, share: float = 1.0) -> dict:
    """One run of this program, on one thread as PySPH's; {"failure"} or what it cost and found."""
    config = config_of(case, n, overrides)
    end = config.time.end * share
    settings = [*overrides, f"problem.n={n}", f"time.end={end!r}", f"output.interval={end!r}"]
    command = [sys.executable, "-m", "sph.cli", "run", f"configs/{case.config}.toml"]
    command += [word for setting in settings for word in ("--set", setting)]
    process, failure = timed([*command, "--threads", "1", "--force", "-o", str(home)])
    if failure:
        return {"failure": failure}
    run = RunDirectory.open(home)
    session = run.whole_summary()["cost"]["session"]
    last = checkpoint.read(run.latest())
    return {
        "number": last.particles.number,
        "steps": session["steps"],
        # PySPH's runs have no diagnostics of each step
        "cpu_seconds": session["cpu_seconds"] - session["phases_cpu_seconds"]["diagnostics"],
        "process_seconds": process,
        "figures": figures(config, history.read(run.history), last.particles),
    }


def pysph_run(case: Case, n: int, directory: Path, python: str, share: float = 1.0) -> dict:
    """One run of PySPH from our particles; {"failure"} or what it cost and found."""
    home = directory / f"pysph_{n}"
    job, result = home.with_suffix(".json"), home.with_suffix(".npz")
    config = config_of(case, n)
    start = initial_state(config)
    job.write_text(json.dumps(job_of(case, config, start, home, share), indent=1))
    result.unlink(missing_ok=True)
    part = Path(__file__).with_name("peers_pysph_solids.py")
    process, failure = timed([python, str(part), str(job)])
    if failure:
        return {"failure": failure}
    found = np.load(result)
    states = [state_of(case, start, found, k) for k in range(found["t"].size)]
    rows_of = [config.problem.diagnostics(state) for state in states]
    columns = {name: np.array([one[name] for one in rows_of]) for name in rows_of[0]}
    return {
        "number": start.mass.size,
        "steps": found["steps"].item(),
        "cpu_seconds": found["cpu_seconds"].item(),
        "process_seconds": process,
        "figures": figures(config, columns | {"t": found["t"]}, states[-1]),
    }


def initial_state(config: Config) -> SimpleNamespace:
    """The particles at t = 0, `held` where no force moves them."""
    start = config.problem.initial(config.physics.eos_model())
    n = start.mass.size
    others = {"clamped": np.zeros(n), "body": np.ones(n), **start.others}
    return SimpleNamespace(
        position=start.position,
        velocity=start.velocity,
        mass=start.mass,
        density=others["density"],
        held=others["clamped"],
        body=others["body"],
        spacing=float(np.sqrt((start.mass / others["density"]).mean())),
    )


def job_of(case: Case, config: Config, start: SimpleNamespace, home: Path, share: float) -> dict:
    """Writes the particles at t = 0; the keys of the job that say how to begin from them."""
    particles = home.with_suffix(".start.npz")
    axes = zip("xy", "uv", start.position, start.velocity, strict=True)
    fields = {name: value for x, u, at, by in axes for name, value in ((x, at), (u, by))}
    np.savez(particles, **fields, m=start.mass, rho=start.density, held=start.held)
    eos, strength = config.physics.eos_model(), config.physics.strength_model()
    bulk, shear = eos.rho_0 * eos.c_0**2, strength.shear_modulus
    module, application = case.example
    return {
        "example": module,
        "application": application,
        "arrays": case.arrays,
        "particles": str(particles),
        "result": str(home.with_suffix(".npz")),
        "spacing": start.spacing,
        "smoothing": case.smoothing,
        "step": case.step * start.spacing,
        "end": config.time.end * share,
        "frames": case.frames,
        "density": eos.rho_0,
        "youngs": 9 * bulk * shear / (3 * bulk + shear),
        "poisson": (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear)),
    }


def state_of(case: Case, start: SimpleNamespace, found, k: int) -> SimpleNamespace:
    """The particles of a frame of PySPH, in the order of ours."""
    position, velocity = start.position.copy(), np.zeros_like(start.velocity)
    moving = ~found["held"]
    for d, (x, u) in enumerate(("xu", "yv")):
        position[d, moving], velocity[d, moving] = found[x][k], found[u][k]
    n = start.mass.size
    support = np.full(n, 2 * case.smoothing * start.spacing)
    return SimpleNamespace(
        id=np.arange(1, n + 1), number=n, position=position, velocity=velocity, mass=start.mass,
        body=start.body, support=support,
    )  # fmt: skip


def figures(config: Config, columns: dict, last) -> dict[str, float]:
    """What the problem makes of the history, and the pieces and the approach at the end."""
    problem = config.problem
    found = problem.over_time(config.physics.eos_model(), columns)
    if "approach" in columns:  # of the rings, also where they are still in contact
        found["approach"] = float(columns["approach"][-1])
    return found | {"pieces": pieces.of(last, Domain(problem.box, problem.boundaries)).pieces}


def row(case: Case, code: str, n: int, ended: dict) -> dict:
    """A line of the table: what was run, its cost and its figures, or why there are none."""
    return {"case": case.title, "code": code, "n": ended.pop("number", n), "failure": None, **ended}


def line(row: dict) -> str:
    """One line of the table."""
    start = f"| {row['case']} | {row['code']} | {row['n']} |"
    if row["failure"]:
        return f"{start} **{row['failure']}** | | | |"
    found = ", ".join(f"{name} {value:.4g}" for name, value in row["figures"].items())
    return (
        f"{start} {row['steps']} | {row['cpu_seconds']:.1f} | {row['process_seconds']:.1f} "
        f"| {found} |"
    )


def write(rows: list[dict], directory: Path):
    """solids.json and solids.md in the directory."""
    (directory / "solids.json").write_text(json.dumps(rows, indent=1))
    head = "| " + " | ".join(COLUMNS) + " |"
    table = "\n".join([head, "|---" * len(COLUMNS) + "|", *map(line, rows)])
    (directory / "solids.md").write_text(f"{table}\n")


if __name__ == "__main__":
    main()
