"""Compare the bits of results: of this source tree and an older one, or of a run and its restart.

    python scripts/same_bits.py                            one line a scene: steps, time, SHA-256
    python scripts/same_bits.py --against CHECKOUT         run both trees, tell differences
    python scripts/same_bits.py --restart                  also stop half-way and restart
    python scripts/same_bits.py sod noh_2d --against …     some scenes only

The scenes are configs/*.toml with few particles and the scenes of the restart tests, each for at
most 300 steps. A hash covers the names and bytes of all particle arrays, sorted by name; where
hashes differ, the arrays that differ are named. Each tree runs in a process of its own. Exits with
1 if a scene fails, or differs and EXPLAINED does not name the difference.
"""

import argparse
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

TREE = Path(__file__).resolve().parent.parent
STEPS = 300

# Sizes at which every scene takes seconds.
SMALL = {
    "kelvin_helmholtz_smooth_billows": ["problem.n=4096"],
    "blob": ["problem.n=2500"],
    "bodies": ["problem.n=600"],
    "contrast_graded": ["problem.n=2000"],
    "evrard": ["problem.n=1000"],
    "expanding_ball": ["problem.n=1000"],
    "gresho": ["problem.n=1024"],
    "kelvin_helmholtz": ["problem.n=3000"],
    "kelvin_helmholtz_smooth": ["problem.n=4096"],
    "keplerian_ring": ["problem.n=1000"],
    "leblanc": ["problem.n=500"],
    "noh_2d": ["problem.n=4000"],
    "noh_3d": ["problem.n=6000"],
    "oscillating_plate": ["problem.n=576"],
    "point_explosion": ["problem.n=4096"],
    "point_explosion_2d": ["problem.n=4096"],
    "polytrope": ["problem.n=1000"],
    "rayleigh_taylor": ["problem.n=2048"],
    "regions": ["problem.n=1024"],
    "rubber_rings": ["problem.n=1100"],
    "sod_3d": ["problem.n=6000"],
    "sound_wave_2d": ["problem.n=1024"],
    "taylor_bar": ["problem.n=700"],
    "yee": ["problem.n=1024"],
}

# The scenes of tests/unit (test_runner, test_restarting, test_simulation*), and one for each part
# of the numerics that no shipped configuration has: a base and what is set on top of it.
BASES = {
    "tube": ['name="shock_tube"', "n=60", "end=0.2"],
    "shear": ['name="kelvin_helmholtz"', "n=4400", "end=0.024"],
    "cloud": ['name="uniform"', "dimension=3", "n=343", "noise=0.2", "end=0.1"],
    "shocks": [
        'name="uniform"', "dimension=2", "n=1600", "noise=0.3", "velocity=1.0",
        'boundary="mirror"', "end=0.032",
    ],
    "alone": [
        'name="particles"', 'boundary="open"', "domain=[0.0, 1.0]", "masses=0.125",
        "positions=[[0.1], [0.2], [0.3], [0.4], [0.5], [0.6], [0.7], [9.0]]", "end=0.1",
    ],
    "contrast": ['name="contrast"', "dimension=2", "n=64", "end=0.01"],
}  # fmt: skip
STRONG = [
    "problem.n=100", "problem.domain=[-1.0, 1.0]", 'problem.boundary="periodic"',
    "problem.left={density=1.0, velocity=0.0, pressure=1000.0}",
    "problem.right={density=1.0, velocity=0.0, pressure=0.01}", "physics.alpha=2.0",
    "time.end=0.012",
]  # fmt: skip
LIQUID = [
    "problem.left={density=1000.0, velocity=0.0, pressure=1e9}",
    "problem.right={density=1000.0, velocity=0.0, pressure=1e5}",
    'physics.eos={name="stiffened_gas", gamma=4.4, p_inf=1e9}',
    'physics.kernel="wendland_c6"', "physics.eta=2.4", "time.end=1.2e-4",
]  # fmt: skip
COLLISION = [
    "problem.left={density=1.0, velocity=5.0, pressure=1.0e-3}",
    "problem.right={density=1.0, velocity=-5.0, pressure=1.0e-3}",
]
CONDUCTION = 'physics.conductivity={name="pressure_jump", switched=true}'
RELAXATION = 'physics.heating={name="relaxation", energy=20.0, time=0.1}'


def alpha(switch: str) -> str:
    return f'physics.alpha={{min=0.1, max=2.0, switch="{switch}"}}'


SCENES = {
    "tube, mirror": ("tube", ['problem.boundary="mirror"']),
    "tube, alpha by divergence": ("tube", [alpha("morris_monaghan")]),
    "tube, alpha by shocks": ("tube", [alpha("cullen_dehnen")]),
    "tube, heating": ("tube", ['problem.boundary="mirror"', RELAXATION]),
    "tube, liquid": ("tube", ['problem.boundary="mirror"', *LIQUID]),
    "tube, strong": ("tube", STRONG),
    "tube, collision": ("tube", COLLISION),
    "tube, collision, no energy limit": ("tube", [*COLLISION, "physics.energy_limit=false"]),
    "tube, alpha 16": ("tube", ["physics.alpha=16.0"]),
    "tube, C 0.075": ("tube", ["physics.C=0.075"]),
    "tube, variational": ("tube", ['physics.scheme="variational"']),
    "tube, pressure_energy": ("tube", ['physics.scheme="pressure_energy"']),
    "tube, number": ("tube", ['physics.density="number"', 'problem.masses="equal_spacing"']),
    "tube, converged": ("tube", ['physics.density_passes="converged"']),
    "tube, cubic spline": ("tube", ['physics.kernel="cubic_spline"', "physics.eta=1.2"]),
    "tube, quintic spline": ("tube", ['physics.kernel="quintic_spline"', "physics.eta=1.2"]),
    "tube, wendland_c4": ("tube", ['physics.kernel="wendland_c4"']),
    "tube, conductivity everywhere": ("tube", ['physics.conductivity.name="pressure_jump"']),
    "tube, conductivity by approach": ("tube", ['physics.conductivity.name="approach"']),
    "shear": ("shear", [alpha("morris_monaghan")]),
    "shear, alpha by shocks": ("shear", [alpha("cullen_dehnen")]),
    "shear, pressure_energy": (
        "shear", [alpha("morris_monaghan"), 'physics.scheme="pressure_energy"', CONDUCTION],
    ),
    "shocks": ("shocks", [alpha("cullen_dehnen"), CONDUCTION, "physics.C=0.03"]),
    "cloud, open": (
        "cloud",
        [
            'problem.boundary="open"', "physics.C=0.02", "physics.balsara=false",
            "physics.density_passes=3",
        ],
    ),
    "cloud, point mass": (
        "cloud",
        [
            'problem.boundary="open"',
            'physics.external={name="point_mass", mass=1.0, softening=0.5}', "physics.C=0.02",
            alpha("cullen_dehnen"),
        ],
    ),
    "alone": ("alone", ["physics.eta=1.2"]),
    "contrast, all parts": (
        "contrast",
        [
            alpha("cullen_dehnen"), CONDUCTION,
            'physics.heating={name="relaxation", energy=1.0, time=0.1}',
        ],
    ),
}  # fmt: skip

# Differences from an older tree that a change of the numerics has made on purpose, by scene.
ONCE = "the pressure that pressure_jump compares is computed once a particle: other rounding"
EXPLAINED = {
    "tube, alpha 16": "C is held where the leapfrog is stable with that alpha (since 15dd102)",
    "tube, conductivity everywhere": ONCE,
    "shocks": ONCE,
    "cloud, open": ONCE,
    "contrast, all parts": ONCE,
}


class Enough(Exception):
    """The scene has been followed as far as it is compared."""


class Follow:
    """Progress of a run that keeps what the last step left, and ends or interrupts the run."""

    each_step = False

    def __init__(self, end: float, stop_at: int | None):
        self.end, self.stop_at, self.found = end, stop_at, None

    def step(self, simulation):
        if simulation.step >= STEPS or simulation.time >= self.end:
            self.found = fingerprint(simulation)
            raise Enough
        if simulation.step == self.stop_at:
            signal.raise_signal(signal.SIGINT)

    def note(self, text): ...
    def start(self, begin, end): ...
    def wrote(self, path, simulation): ...
    def close(self): ...


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", help="names of scenes (default: all)")
    parser.add_argument("--against", type=Path, help="a checkout to compare with")
    parser.add_argument("--restart", action="store_true", help="compare with restarts half-way")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    scenes = all_scenes()
    if unknown := set(options.scenes) - scenes.keys():
        parser.error(f"no scene {', '.join(sorted(unknown))}; there are: {', '.join(scenes)}")
    chosen = {name: scenes[name] for name in options.scenes or scenes}
    if options.child:
        for name, (text, overrides) in chosen.items():
            print(json.dumps([name, results(text, overrides, options.restart)]), flush=True)
        return 0
    mine = run_tree(TREE, chosen, options.restart)
    theirs = run_tree(options.against, chosen, False) if options.against else None
    return tell(mine, theirs)


def all_scenes() -> dict[str, tuple[str, list[str]]]:
    """The TOML text of each scene and what is set on top of it, by name."""
    scenes = {
        path.stem: (path.read_text(), SMALL.get(path.stem, []))
        for path in sorted((TREE / "configs").glob("*.toml"))
    }
    for name, (base, overrides) in SCENES.items():
        *problem, end = BASES[base]
        scenes[name] = ("\n".join(["[problem]", *problem, "[time]", end]), overrides)
    return scenes


def run_tree(tree: Path, scenes, restart: bool) -> dict[str, dict]:
    """What each scene leaves when the source tree `tree` runs it in a process of its own."""
    command = [sys.executable, __file__, "--child", *["--restart"] * restart, *scenes]
    environment = os.environ | {"PYTHONPATH": str(tree.resolve())}
    # standard error also has a note for each run that is stopped half-way
    child = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if child.returncode:
        sys.exit(f"{tree}: the child process failed\n{child.stderr}")
    return dict(json.loads(line) for line in child.stdout.splitlines())


def results(text: str, overrides: list[str], restart: bool) -> dict:
    """Of the uninterrupted run and, if asked for, of one that was restarted on two threads."""
    whole = followed(text, overrides, None)
    if restart and "step" in whole:
        whole["restarted"] = followed(text, overrides, max(1, whole["step"] // 2))
    return whole


def followed(text: str, overrides: list[str], stop_at: int | None) -> dict:
    """The fingerprint where the scene ends, or the error that ended it before."""
    from sph import config as configuration
    from sph import restarting, runner
    from sph.errors import SphError, Stopped
    from sph.output.run_directory import RunDirectory

    with tempfile.TemporaryDirectory() as home:
        try:
            config = configuration.from_text(text, "the scene")
            # no output but at the end: landing on one cuts a step
            fixed = [f"output.interval={config.time.end!r}", "physics.max_energy_drift=0.02"]
            config = config.override(["run.threads=1", *fixed, *overrides])
            follow = Follow(config.time.end, stop_at)
            directory = RunDirectory.create(Path(home) / "run")
            runner.MOST = 1  # `follow` looks at every step
            try:
                runner.run(config, directory, follow)
            except Stopped:
                restarting.restart(directory.path, ["run.threads=2"], None, follow)
        except Enough:
            return follow.found
        except SphError as error:
            return {"error": f"{type(error).__name__}: {error}".splitlines()[0]}
    return {"error": "ended before it was followed to its end"}


def fingerprint(simulation) -> dict:
    """Steps, time and the SHA-256 of the state: of all arrays together and of each."""
    state = getattr(simulation, "state", None) or simulation.particles
    together, each = hashlib.sha256(), {}
    for name, array in sorted(state.arrays().items()):
        content = array.tobytes()
        together.update(name.encode() + content)
        each[name] = hashlib.sha256(content).hexdigest()
    return {
        "step": simulation.step, "time": simulation.time, "hash": together.hexdigest(), "each": each
    }  # fmt: skip


def tell(mine: dict[str, dict], theirs: dict[str, dict] | None) -> int:
    """Print a line for each scene; 1 if there is a difference that is not explained."""
    unexplained = 0
    for name, found in mine.items():
        words, unexplained = short(found), unexplained + ("error" in found)
        compared = {"restart": found.get("restarted"), "against": theirs and theirs[name]}
        for other, there in compared.items():
            if there is None:
                continue
            difference = differences(found, there)
            words += f"  {other}: {difference or 'same'}"
            if difference and other == "against" and name in EXPLAINED:
                words += f" (explained: {EXPLAINED[name]})"
            elif difference:
                unexplained += 1
        print(f"{name:34} {words}", flush=True)
    print(f"{len(mine)} scenes, {unexplained} unexplained differences or failures")
    return int(unexplained > 0)


def differences(one: dict, other: dict) -> str:
    """What differs between two fingerprints, in words; "" where nothing does."""
    if "error" in one or "error" in other:
        return "" if one.get("error") == other.get("error") else f"differs: {short(other)}"
    if all(one[key] == other[key] for key in ("step", "time", "hash")):
        return ""
    arrays = one["each"].keys() | other["each"].keys()
    differing = [name for name in arrays if one["each"].get(name) != other["each"].get(name)]
    return f"differs: {short(other)} ({', '.join(sorted(differing)) or 'step or time'})"


def short(found: dict) -> str:
    if "error" in found:
        return found["error"]
    return f"step {found['step']:3}  t = {found['time']!r:22} {found['hash'][:16]}"


if __name__ == "__main__":
    sys.exit(main())
