"""Error against CPU time of this program and of PySPH on the same particles.

    python scripts/peers.py                                     all four problems
    python scripts/peers.py --only sod -o peers --pysph-python ~/pysph/bin/python

PySPH comes with `pip install "sph[peers]"`, or may live in an environment of its own, whose Python
is then given. Both codes start from the same particles; one function takes the norms of both.
CPU seconds are user + system on one thread, of the time loop without compilation and start-up (a
short first run of each scheme compiles) and, beside them, of the whole process. Writes
peers.json, peers.md and peers.png.
"""

import argparse
import json
import resource
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import peers_grid
import peers_report

from sph import config as configuration
from sph.analysis import errors
from sph.config import Config
from sph.output import checkpoint
from sph.output.run_directory import RunDirectory

HOME = Path(__file__).resolve().parent.parent
PATIENCE = 3600  # wall seconds of one run, after which it counts as not ended
SHORT = 0.01  # of the time to the end: the run that only compiles
NONSENSE = 0.1  # relative change of the energy beyond which errors mean nothing
GRID = 256  # cells per axis of the grid that judges the shear layer


class Case(NamedTuple):
    """A problem for both codes; PySPH's settings are those of its example of that name."""

    title: str
    config: str
    sizes: tuple[int, ...]  # particles asked for
    overrides: tuple[str, ...]  # of our configuration, for all sizes alike
    example: tuple[str, str]  # module and class in pysph.examples.gas_dynamics
    schemes: dict[str, tuple[int, ...]]  # PySPH's schemes, with the particles each is run at
    step: float  # PySPH's fixed time step over the smallest spacing, of its example
    smoothing: float  # first h over spacing, of its example
    one_smoothing: bool  # the first h of all particles is that of the largest spacing
    domain: dict
    as_shipped: tuple[str, ...] = ()  # schemes with which PySPH's example is also run untouched


UNIT = {"xmin": 0.0, "xmax": 1.0, "ymin": 0.0, "ymax": 1.0}
CASES = {
    "sod": Case(
        "Sod, 1-D",
        "sod",
        (90, 180, 360, 720, 1440),
        (
            "time.end=0.15",
            "physics.scheme=variational",
            "physics.kernel=cubic_spline",
            "physics.eta=1.2",
            "physics.alpha=0.7",
            "physics.C=0.3",
        ),
        ("sod_shocktube", "SodShockTube"),
        {"adke": (180, 360, 720), "mpm": (180, 360, 720), "gsph": (180, 360, 720)},
        0.128,
        1.2,
        True,
        {"xmin": -0.5, "xmax": 0.5, "mirror_in_x": True, "n_layers": 2},
    ),
    "sedov": Case(
        "Point explosion, 2-D",
        "point_explosion_2d",
        (576, 1024, 2304, 4096, 9216),
        (
            "physics.scheme=variational",
            "physics.kernel=cubic_spline",
            "physics.eta=1.2",
            "physics.alpha=1.0",
            "physics.conductivity=approach",
            "physics.energy_limit=false",
        ),
        ("sedov", "SedovPointExplosion"),
        {"mpm": (1024, 2304, 4096), "tsph": (1024, 2304)},
        0.0104,
        1.2,
        False,
        {},
    ),
    "noh": Case(
        "Noh, 2-D",
        "noh_2d",
        (314, 707, 1257, 2827, 5027),
        (
            "physics.scheme=variational",
            "physics.eta=1.2",
            "physics.alpha=0.7",
            "physics.conductivity=approach",
            "physics.C=0.2",
        ),
        ("noh", "NohImplosion"),
        {"crksph": (707, 1257, 2827), "mpm": (707, 1257, 2827), "gsph": (1257,)},
        0.05,
        1.5,
        False,
        {},
        as_shipped=("gsph", "mpm"),
    ),
    "shear": Case(
        "Smooth Kelvin–Helmholtz, 2-D",
        "kelvin_helmholtz_smooth",
        (576, 1024, 2304, 4096),
        (),
        ("kelvin_helmholtz_instability", "KHInstability"),
        {"mpm": (576, 1024, 2304), "gsph": (576, 1024)},
        0.2,
        1.5,
        False,
        UNIT | {"periodic_in_x": True, "periodic_in_y": True},
    ),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=CASES, action="append", help="may be repeated")
    parser.add_argument("-o", dest="directory", type=Path, default=Path("peers"), metavar="DIR")
    parser.add_argument("--pysph-python", default=sys.executable, metavar="PATH")
    options = parser.parse_args()
    require_pysph(options.pysph_python)
    directory = options.directory.resolve()
    directory.mkdir(parents=True, exist_ok=True)
    rows = []
    for key in options.only or CASES:
        for row in runs_of(CASES[key], directory / key, options.pysph_python):
            rows.append(row)
            print(peers_report.line(row), flush=True)
            peers_report.write(rows, directory)
    print(f"\n{peers_report.verdict(rows)}\n\nTable and picture: {directory}")


def require_pysph(python: str):
    """Raises SystemExit with what to do where that Python has no PySPH."""
    try:
        found = subprocess.run([python, "-c", "import pysph"], capture_output=True).returncode == 0
    except OSError:
        found = False
    if not found:
        raise SystemExit(
            f'{python} has no PySPH. Try: pip install "sph[peers]" (it needs a C++ compiler), or '
            "--pysph-python PATH with the Python of an environment that has it."
        )


def runs_of(case: Case, directory: Path, python: str):
    """Yields a row for every run of the case, ours first."""
    directory.mkdir(parents=True, exist_ok=True)
    judge = Judge(config_of(case, case.sizes[0]))
    own_run(case, case.sizes[0], directory, share=SHORT)
    for n in case.sizes:
        yield judge.row(case, "sph", n, own_run(case, n, directory))
    for scheme, sizes in case.schemes.items():
        pysph_run(case, scheme, sizes[0], directory, python, share=SHORT)
        for n in sizes:
            ended = pysph_run(case, scheme, n, directory, python)
            yield judge.row(case, f"PySPH {scheme}", n, ended)
    for scheme in case.as_shipped:
        ended = pysph_run(case, scheme, 0, directory, python)
        yield judge.row(case, f"PySPH {scheme}, example as shipped", 0, ended)


def config_of(case: Case, n: int) -> Config:
    path = HOME / "configs" / f"{case.config}.toml"
    return configuration.load(path, [f"problem.n={n}", *case.overrides])


def own_run(case: Case, n: int, directory: Path, share: float = 1.0) -> dict:
    """One run of this program, on one thread as PySPH's; {"failure"} or the last state."""
    end = config_of(case, n).time.end * share
    settings = [*case.overrides, f"problem.n={n}", f"time.end={end!r}", f"output.interval={end!r}"]
    command = [sys.executable, "-m", "sph.cli", "run", f"configs/{case.config}.toml"]
    command += [word for setting in settings for word in ("--set", setting)]
    home = directory / f"sph_{n}"
    process, failure = timed([*command, "--threads", "1", "--force", "-o", str(home)])
    if failure:
        return {"failure": failure}
    run = RunDirectory.open(home)
    session = run.whole_summary()["cost"]["session"]
    last = checkpoint.read(run.latest())
    return {
        "state": last.particles,
        "time": last.time,
        "steps": session["steps"],
        "cpu_seconds": session["cpu_seconds"],
        "process_seconds": process,
        "energy_ratio": energy(last.particles) / energy(initial_state(config_of(case, n))),
    }


def pysph_run(
    case: Case, scheme: str, n: int, directory: Path, python: str, share: float = 1.0
) -> dict:
    """One run of PySPH from our particles, or of its example as shipped where n is 0.

    {"failure"} or the last state.
    """
    home = directory / f"pysph_{scheme}_{n}"
    job, result = home.with_suffix(".json"), home.with_suffix(".npz")
    module, application = case.example
    settings = {"example": module, "application": application, "scheme": scheme}
    settings |= {"result": str(result), "as_shipped": n == 0}
    if n:
        settings |= from_our_particles(case, n, home.with_suffix(".start.npz"), share)
    job.write_text(json.dumps(settings, indent=1))
    result.unlink(missing_ok=True)
    part = Path(__file__).with_name("peers_pysph.py")
    process, failure = timed([python, str(part), str(job)])
    if failure:
        return {"failure": failure}
    last = np.load(result)
    dimension = config_of(case, case.sizes[0]).problem.dimension
    state = SimpleNamespace(
        position=np.stack([last[x] for x in "xy"[:dimension]]),
        velocity=np.stack([last[u] for u in "uv"[:dimension]]),
        mass=last["m"],
        density=last["rho"],
        internal_energy=last["e"],
    )
    figures = {name: last[name].item() for name in ("time", "steps", "cpu_seconds", "energy_ratio")}
    return {"state": state, "process_seconds": process, **figures}


def from_our_particles(case: Case, n: int, particles: Path, share: float) -> dict:
    """Writes the particles at t = 0; the keys of the job that say how to begin from them."""
    start = initial_state(config := config_of(case, n))
    dimension = start.position.shape[0]
    axes = zip("xyz"[:dimension], "uvw", start.position, start.velocity, strict=False)
    fields = {name: value for x, u, at, by in axes for name, value in ((x, at), (u, by))}
    fields |= {"m": start.mass, "rho": start.density, "e": start.internal_energy}
    fields["p"] = config.physics.eos_model().pressure(start.density, start.internal_energy)
    np.savez(particles, **fields)
    spacing = float((start.mass / start.density).min() ** (1.0 / dimension))
    return {
        "particles": str(particles),
        "dimension": dimension,
        "domain": case.domain,
        "smoothing": case.smoothing,
        "one_smoothing": case.one_smoothing,
        "step": case.step * spacing,
        "end": config.time.end * share,
    }


def initial_state(config: Config) -> SimpleNamespace:
    """The particles at t = 0 with their nominal density."""
    start = config.problem.initial(config.physics.eos_model())._asdict()
    exact = config.problem.exact(config.physics.eos_model(), 0.0, start["position"])
    # the shear layer, which has no exact solution, begins on a lattice of cells of volume 1/N
    density = exact["density"] if exact else start["mass"] * start["mass"].size
    return SimpleNamespace(**start, density=density)


def timed(command: list[str]) -> tuple[float, str | None]:
    """Runs it: CPU seconds of the whole process, and why it did not end well or None."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        ended = subprocess.run(command, cwd=HOME, capture_output=True, text=True, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        return 0.0, f"not ended after {PATIENCE} s"
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if ended.returncode < 0:
        return spent, f"crashed ({signal.Signals(-ended.returncode).name})"
    if ended.returncode > 0:
        return spent, (ended.stderr.strip().splitlines() or ["no message"])[-1][:90]
    return spent, None


class Judge:
    """Takes the errors of either code's last state on one problem."""

    def __init__(self, config: Config):
        self.config, self.eos = config, config.physics.eos_model()
        self._grid = None

    def row(self, case: Case, code: str, n: int, ended: dict) -> dict:
        """A line of the table: what was run, its cost, errors, or why there are none."""
        row = {"case": case.title, "code": code, "n": n, "failure": ended.get("failure")}
        if row["failure"]:
            return row
        state = ended.pop("state")
        row |= ended | {"n": int(state.mass.size)}
        if not np.isfinite(row["energy_ratio"]):
            return row | {"failure": "not-a-number in the last state"}
        if row["time"] < self.config.time.end * (1.0 - 1e-6):
            return row | {"failure": f"ended at t = {row['time']:.3g}"}
        if abs(row["energy_ratio"] - 1.0) > NONSENSE:
            return row | {"failure": f"nonsense after {row['steps']} steps, exit status 0"}
        return row | {"L1": self._errors(state)}

    def _errors(self, state) -> dict[str, float]:
        end = self.config.time.end
        pressure = self.eos.pressure(state.density, state.internal_energy)
        found = errors.against_exact(self.config, end, state, pressure)
        if found:
            return {name: norm["L1"] for name, norm in found["fields"].items()}
        truth = self._from_grid(state.position % 1.0)
        differences = {
            "density": state.density - truth[0],
            "velocity": state.velocity - truth[1:3],
            "pressure": pressure - truth[3],
        }
        volume = state.mass / state.density
        return {name: errors.norms(d, volume)["L1"] for name, d in differences.items()}

    def _from_grid(self, position):
        """Density, velocity, pressure (4, N) of the grid's solution, found at the first call."""
        if self._grid is None:
            fine = self.config.override([f"problem.n={GRID**2}"])
            start = initial_state(fine)
            pressure = self.eos.pressure(start.density, start.internal_energy)
            order = np.lexsort((start.position[1], start.position[0]))
            state = np.stack([start.density, *start.velocity, pressure])[:, order]
            state = state.reshape(4, GRID, GRID)
            self._grid = peers_grid.solve(state, self.eos.gamma, fine.time.end)
        return np.stack([peers_grid.at_points(field, position) for field in self._grid])


def energy(state) -> float:
    """Total energy: kinetic and internal."""
    return float(
        (state.mass * (0.5 * (state.velocity**2).sum(axis=0) + state.internal_energy)).sum()
    )


if __name__ == "__main__":
    main()
