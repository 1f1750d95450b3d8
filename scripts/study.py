"""The standing studies: which settings are worth their time, problem by problem.

    python scripts/study.py                    what there is
    python scripts/study.py sod gresho         runs what is missing of these, and reports
    python scripts/study.py all --jobs 2

A study is a few calls of `sph sweep`, one for each thing that is varied, and one of `sph report`
over them; all are printed. Runs go to runs/studies/NAME, which may be deleted, and the report with
what it was made by to docs/studies/NAME. Run again, a study does only what is missing.
"""

import argparse
import platform
import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from PIL import Image

HOME = Path(__file__).resolve().parent.parent
RUNS = Path("runs/studies")
RESULTS = Path("docs/studies")
POINT_FAILED = 3  # of a sweep: the report lists such points, and settings that fail tell something
WIDEST = 900  # pixels of maps, which would fill the repository otherwise
PACKAGES = ("numba", "llvmlite", "numpy")


class Study(NamedTuple):
    """A problem, and what is varied of it beside N."""

    config: str
    n: str  # numbers of particles, as --vary takes them
    report: tuple[str, ...]  # options of `sph report`
    sweeps: dict[str, tuple[str, ...]]  # by name: further --vary
    fixed: tuple[str, ...] = ()  # --set of all sweeps
    reference: tuple[str, ...] = ()  # --set of the finer run that errors are taken against
    reference_n: str = ""  # and its numbers of particles: the last is that run
    pictures: tuple[str, ...] = ()  # runs to draw side by side, SWEEP/POINT


SCHEME = ("physics.scheme=grad_h,variational,pressure_energy",)
KERNEL = ("physics.kernel=cubic_spline,quintic_spline,wendland_c2,wendland_c4,wendland_c6",)
ETA = ("physics.eta=1.2,1.6,2.0,2.4",)
PASSES = ('physics.density_passes=1,2,"converged"',)
MORRIS_MONAGHAN = "{min = 0.1, max = 2.0}"
CULLEN_DEHNEN = '{min = 0.02, max = 2.0, switch = "cullen_dehnen"}'
SWITCHES = f"{MORRIS_MONAGHAN},{CULLEN_DEHNEN}"
WITHOUT_BALSARA = (f"physics.alpha=0.5,1.0,{CULLEN_DEHNEN}", "physics.balsara=false")

STUDIES = {
    "sod": Study(
        "configs/sod.toml",
        "200:1600:x2",
        ("--field", "density"),
        {
            "scheme": SCHEME,
            "kernel": KERNEL,
            "eta": ETA,
            "alpha": (f"physics.alpha=0.5,1.0,2.0,{SWITCHES}",),
            "C": ("physics.C=0.1,0.15,0.3,0.4",),
            "density_passes": PASSES,
        },
    ),
    "strong_shock": Study(
        "configs/strong_shock.toml",
        "250:1000:x2",
        ("--field", "density"),
        {
            "scheme": SCHEME,
            "kernel": ("physics.kernel=cubic_spline,wendland_c2,wendland_c4,wendland_c6",),
            "eta": ("physics.eta=1.2,1.6,2.4",),
            "alpha": (f"physics.alpha=1.0,2.0,3.0,{SWITCHES}",),
            "C": ("physics.C=0.1,0.15,0.3",),
            "density_passes": PASSES,
        },
    ),
    "point_explosion": Study(
        "configs/point_explosion.toml",
        "4096,13824",
        ("--field", "report.momentum_radius_error"),
        {
            "scheme": SCHEME,
            "eta": ("physics.eta=1.2,1.4,1.6",),
            "alpha": (f"physics.alpha=1.0,3.0,{SWITCHES}",),
            "C": ("physics.C=0.15,0.3",),
            "density_passes": PASSES,
        },
        ("physics.energy_limit=false",),
    ),
    "kelvin_helmholtz_smooth": Study(
        "configs/kelvin_helmholtz_smooth.toml",
        "1024,2304,4096",
        ("--field", "velocity"),
        {
            "scheme": SCHEME,
            "kernel_and_eta": ("physics.kernel=wendland_c2,wendland_c4", "physics.eta=1.6,2.4"),
            "alpha": ("physics.alpha=0.1,0.5,1.0",),
            "alpha_without_balsara": WITHOUT_BALSARA,
            "C": ("physics.C=0.15,0.3,0.5",),
            "density_passes": PASSES,
        },
        reference=("physics.kernel=wendland_c4", "physics.eta=2.2", "physics.alpha=0.5"),
        reference_n="4096,9216,16384,65536",
    ),
    "gresho": Study(
        "configs/gresho.toml",
        "1024,2304,4096",
        ("--field", "report.error_v_phi"),
        {
            "scheme": SCHEME,
            "kernel": (*KERNEL, "physics.allow_pairing=true"),
            "eta": ("physics.eta=1.6,2.2,3.0,3.8",),
            "alpha": (f"physics.alpha=0.1,0.5,1.0,{MORRIS_MONAGHAN}",),
            "alpha_without_balsara": WITHOUT_BALSARA,
            "C": ("physics.C=0.15,0.3,0.5",),
        },
    ),
    "sound_wave": Study(
        "configs/sound_wave.toml",
        "32:256:x2",
        ("--field", "report.error_velocity_relative", "--x", "updates"),  # seconds are too few
        {
            "kernel": KERNEL,
            "eta": ETA,
            "alpha_without_balsara": (f"physics.alpha=0.5,1.0,{SWITCHES}", "physics.balsara=false"),
            "C": ("physics.C=0.1,0.15,0.2,0.3",),
            "density_passes": PASSES,
        },
    ),
    "sound_wave_2d": Study(
        "configs/sound_wave.toml",
        "576,1024,4096",
        ("--field", "report.error_velocity_relative"),
        {
            "eta_of_Wendland_C2": ("physics.eta=1.6,2.0,2.4",),
            "eta_of_Wendland_C4": ("physics.kernel=wendland_c4", "physics.eta=2.4,2.8"),
        },
        ("problem.dimension=2",),
    ),
    "square": Study(
        "configs/square.toml",
        "448,1792",
        ("--field", "internal_energy"),
        {
            "scheme": SCHEME,
            "pressure_energy_kernel": (
                "physics.scheme=pressure_energy",
                "physics.kernel=wendland_c2,wendland_c4",
                "physics.eta=1.6,1.8,2.0,2.4",
            ),
            "pressure_energy_alpha": (
                "physics.scheme=pressure_energy",
                "physics.alpha=0.1,1.0,3.0",
            ),
        },
        pictures=(
            "scheme/problem.n=1792,physics.scheme=grad_h",
            "scheme/problem.n=1792,physics.scheme=variational",
            "scheme/problem.n=1792,physics.scheme=pressure_energy",
            "pressure_energy_kernel/problem.n=1792,physics.scheme=pressure_energy,"
            "physics.kernel=wendland_c4,physics.eta=1.8",
        ),
    ),
}


def commands(name: str, jobs: int) -> list[list[str]]:
    """What a study calls, in order."""
    study = STUDIES[name]
    runs, results = RUNS / name, RESULTS / name

    def sweep(called: str, fixed: tuple[str, ...], varies: tuple[str, ...]) -> list[str]:
        sets = [part for one in fixed for part in ("--set", one)]
        vary = [part for one in varies for part in ("--vary", one)]
        ending = ["--jobs", str(jobs), "-o", str(runs / called)]
        return ["sph", "sweep", study.config, *sets, *vary, *ending]

    called = [
        sweep(one, study.fixed, (f"problem.n={study.n}", *varies))
        for one, varies in study.sweeps.items()
    ]
    options = [*study.report, "-o", str(results)]
    if study.reference:
        called.append(sweep("reference", study.reference, (f"problem.n={study.reference_n}",)))
        finest = study.reference_n.rpartition(",")[2]
        options += ["--reference", str(runs / "reference" / f"problem.n={finest}")]
    called.append(["sph", "report", *(str(runs / one) for one in study.sweeps), *options])
    if study.pictures:
        drawn = [str(runs / one) for one in study.pictures]
        called.append(["sph", "plot", *drawn, "-o", str(results / "runs.png")])
    return called


def carry_out(name: str, jobs: int) -> None:
    """Run a study, and write what it was made by."""
    called = commands(name, jobs)
    for command in called:
        print("$", shlex.join(command), flush=True)
        ended = subprocess.run([sys.executable, "-m", "sph.cli", *command[1:]], cwd=HOME)
        if ended.returncode not in (0, POINT_FAILED):
            sys.exit(ended.returncode)
    picture = HOME / RESULTS / name / "runs.png"
    if picture.is_file():
        with Image.open(picture) as drawn:
            drawn.thumbnail((WIDEST, WIDEST))
            drawn.convert("RGB").quantize(256).save(picture, optimize=True)
    (HOME / RESULTS / name / "report.json").unlink()  # the same as report.csv, at thrice the size
    lines = "\n".join(map(shlex.join, called))
    (HOME / RESULTS / name / "made_by.md").write_text(
        f"# How this was made\n\n`python scripts/study.py {name}` called\n\n```sh\n{lines}\n```\n\n"
        f"{machine()}\n",
        encoding="utf-8",
    )


def machine() -> str:
    """Processor, cores and versions in a sentence."""
    listed = Path("/proc/cpuinfo")
    names = [
        line.partition(":")[2].strip()
        for line in (listed.read_text().splitlines() if listed.is_file() else [])
        if line.startswith("model name")
    ]
    processor = f"{len(names)} cores of {names[0]}" if names else platform.processor()
    packages = ", ".join(f"{package} {version(package)}" for package in PACKAGES)
    return (
        f"{processor}; {platform.system()}, Python {platform.python_version()}, {packages}. "
        "Other work ran on the same cores, so seconds are good for ratios within a sweep only."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join([*STUDIES, "all"]))
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="runs at once")
    given = parser.parse_args()
    unknown = [name for name in given.names if name not in (*STUDIES, "all")]
    if unknown or not given.names:
        print(*(f"no study is called {name}" for name in unknown), sep="\n", end="")
        print("studies:", ", ".join([*STUDIES, "all"]))
        sys.exit(2 if unknown else 0)
    for name in STUDIES if "all" in given.names else given.names:
        carry_out(name, given.jobs)


if __name__ == "__main__":
    main()
