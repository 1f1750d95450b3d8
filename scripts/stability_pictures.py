"""How runs fail beyond the stable range: pictures of what `scripts/stability.py` has searched.

    python scripts/stability_pictures.py [-o DIR] docs/images

DIR is that of the searches, runs/stability if not given. Pictures: every search of C and of eta;
the gas of each problem at twice the largest stable C (grey: at that); Sod's tube in each scheme.
The runs of the last two are made here where they are missing.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from matplotlib.ticker import LogLocator
from stability import PROBLEMS, ROOT, SCHEMES

from sph import config as configuration
from sph.analysis.figures import style
from sph.output import checkpoint
from sph.output.run_directory import RunDirectory
from sph.stability.picture import SYMBOLS

# Values at which Sod's tube is drawn: stable, beyond and far beyond.
SHOWN = {"physics.C": (0.25, 0.4, 0.6), "physics.eta": (1.2, 1.0, 0.85)}
COLUMNS = 5
# Above this many times its limit a figure says no more than that a run blew up; stopped runs too.
MOST = 30.0
# The gallery is of runs at so many times the largest stable C; density against which axis there.
FAR = 2.0
# Checkpoints of runs that stop on the way; others have none but the last, which would cut steps.
OUTPUTS = {"strong_shock": 20, "stiffened_tube": 20}
AXES = {"kelvin_helmholtz": 1, "kelvin_helmholtz_smooth": 1, "blob": 0, "square": 0}


def searches(directory: Path, key: str, target: Path) -> None:
    """How far each run was from its limits against the key, a panel for each problem."""
    rows = -(-len(PROBLEMS) // COLUMNS)
    picture = style.new_figure(12.0, 2.1 * rows)
    panels = picture.subplots(rows, COLUMNS, sharey=True)
    for panel in panels.flat[len(PROBLEMS) :]:
        panel.set_axis_off()
    for panel, problem in zip(panels.flat, PROBLEMS, strict=False):
        for scheme, colour in zip(SCHEMES, style.PALETTE, strict=False):
            path = directory / f"{problem}-{scheme}" / f"{key}.json"
            if path.exists():
                _search(panel, json.loads(path.read_text()), scheme, colour)
        panel.axhline(1.0, color="0.5", linestyle=":", zorder=0)
        panel.set(xscale="log", yscale="log", ylim=(0.02, 1.4 * MOST))
        panel.set_title(problem.replace("_", " "), fontsize=10)
        panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        panel.xaxis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter("")
    for panel in panels[:, 0]:
        panel.set_ylabel("over its limit")
    for panel in panels[-1]:
        panel.set_xlabel(SYMBOLS[key])
    handles, labels = panels[0, 0].get_legend_handles_labels()
    picture.legend(handles, labels, loc="outside lower center", ncols=len(handles))
    style.save_png(picture, target, colours=96, dpi=100)


def _search(panel, found: dict, scheme: str, colour: str) -> None:
    """The worse of error and drift, over what each may be."""
    drift = found["reference"]["largest_drift"]
    trials = sorted(found["trials"], key=lambda trial: trial["value"])
    value = np.array([trial["value"] for trial in trials])
    failed = np.array([trial["verdict"] == "failed" for trial in trials])
    worst = [  # a run that stopped itself has no error
        max(trial["error"], trial["drift"] / drift) if ended else MOST
        for trial, ended in zip(trials, ~failed, strict=True)
    ]
    height = np.clip(worst, 0.025, MOST)
    size = 10 - 2.5 * SCHEMES.index(scheme)  # they often lie on each other
    panel.plot(value, height, "-", color=colour, lw=1.0)
    panel.plot(
        value[~failed], height[~failed], ".", color=colour, ms=size, label=scheme.replace("_", " ")
    )
    panel.plot(value[failed], height[failed], "x", color=colour, ms=size)
    panel.axvline(found["default"], color="0.6", lw=3, alpha=0.4, zorder=0)


def gallery(directory: Path, target: Path) -> None:
    """The gas at FAR times the largest stable C of the first scheme, over that at the latter."""
    rows = -(-len(PROBLEMS) // COLUMNS)
    picture = style.new_figure(12.0, 2.5 * rows)
    panels = picture.subplots(rows, COLUMNS)
    for panel in panels.flat[len(PROBLEMS) :]:
        panel.set_axis_off()
    for panel, problem in zip(panels.flat, PROBLEMS, strict=False):
        home = directory / f"{problem}-{SCHEMES[0]}"
        found = json.loads((home / "physics.C.json").read_text())
        stable = found["ends"]["largest"]["stable"]
        runs = [_run(home, problem, factor * stable) for factor in (1.0, FAR)]
        last = min(len(run.checkpoints()) for run in runs) - 1
        for run, colour, size in zip(runs, ("0.6", style.PALETTE[1]), (9, 3), strict=True):
            state = checkpoint.read(run.checkpoints()[last])
            _density(panel, state, AXES.get(problem), colour, size)
        summary = runs[1].whole_summary()
        drift = summary["conservation"]["energy_drift_max"]
        ended = "" if summary["status"] == "done" else ", stopped"
        panel.set_title(
            f"{problem.replace('_', ' ')}, C = {FAR * stable:.2g}\n"
            f"t = {state.time:.2g}, energy {drift:.0e}{ended}",
            fontsize=9,
        )
        panel.tick_params(labelsize=8)
    style.save_png(picture, target, colours=96, dpi=100)


def _run(home: Path, problem: str, courant: float) -> RunDirectory:
    """The search's run at that C with more checkpoints, and energy free to drift."""
    run = RunDirectory(home / f"shown-C={courant:.4g}")
    if not run.summary.exists():
        sets = {"physics.scheme": SCHEMES[0], **PROBLEMS[problem], "physics.C": courant}
        end = configuration.load(ROOT / "configs" / f"{problem}.toml").time.end
        sets |= {"physics.max_energy_drift": 1e9, "run.threads": 1}
        sets["output.interval"] = sets.get("time.end", end) / OUTPUTS.get(problem, 1)
        command = [
            *(sys.executable, "-m", "sph.cli", "run", str(ROOT / "configs" / f"{problem}.toml")),
            *(part for name in sets for part in ("--set", f"{name}={sets[name]}")),
            *("-o", str(run.path), "--force"),
        ]
        subprocess.run(command, check=False, capture_output=True)  # it may fail: that is shown
    return run


def _density(panel, state, axis: int | None, colour: str, size: float) -> None:
    """Density against one coordinate, or the radius where there is more than one."""
    x = state.particles.position
    if axis is None and len(x) > 1:
        box = np.array(state.config.problem.box)
        along, label = np.linalg.norm(x - box.mean(axis=1)[:, None], axis=0), "r"
    else:
        along, label = x[axis or 0], "xyz"[axis or 0]
    panel.scatter(along, state.particles.density, s=size, color=colour, linewidths=0)
    panel.set_xlabel(f"${label}$", fontsize=9, labelpad=0)


def sod_tube(directory: Path, key: str, target: Path) -> None:
    """Density of Sod's tube in each scheme at SHOWN, with no limit on energy drift."""
    home, values = directory / f"sod-shown-{key}", SHOWN[key]
    command = [
        *(sys.executable, "-m", "sph.cli", "sweep", str(ROOT / "configs" / "sod.toml")),
        *("--vary", f"physics.scheme={','.join(SCHEMES)}"),
        *("--vary", f"{key}={','.join(map(str, values))}"),
        *("--set", "problem.n=200", "--set", "physics.max_energy_drift=1e9"),
        *("--jobs", "1", "--set", "run.threads=1", "-o", str(home)),
    ]
    subprocess.run(command, check=False)  # a run may fail: its panel says so
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
    style.save_png(picture, target, colours=96, dpi=100)


def _profile(panel, directory: Path) -> None:
    """The last density of a run, over the exact one; in the title its energy drift, or its end."""
    run = RunDirectory(directory)
    summary = run.whole_summary()
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
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", dest="directory", type=Path, default=Path("runs/stability"))
    options = parser.parse_args()
    with style.paper():
        for key in SYMBOLS:
            name = key.partition(".")[2]
            searches(options.directory, key, options.folder / f"stability_searches_{name}.png")
            sod_tube(options.directory, key, options.folder / f"stability_{name}.png")
        gallery(options.directory, options.folder / "stability_gallery.png")


if __name__ == "__main__":
    main()
