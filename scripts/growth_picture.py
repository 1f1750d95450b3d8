"""Growth of the smooth Kelvin-Helmholtz mode in several runs, beside linear theory and SWIFT.

    for n in 64 96 128; do
      sph run configs/kelvin_helmholtz_smooth.toml --set problem.n=$((n*n)) -o runs/kh_$n; done
    python scripts/growth_picture.py runs/kh_64 runs/kh_96 runs/kh_128 -o docs/images/kh_growth.png

`sph plot` draws one run's mode beside linear theory; this lays several over each other: a colour
for each number of particles, a style of line for each setting.
"""

import argparse
from pathlib import Path

import numpy as np

from sph import config as configuration
from sph.analysis.figures import style
from sph.output.history import read
from sph.output.run_directory import RunDirectory
from sph.problems.kelvin_helmholtz_smooth import GROWTH

# SWIFT 2026.04, SPHENIX, 128 x 128 particles, measured on the same problem in the same way
SWIFT_TIMES = np.arange(7) * 0.25
SWIFT = (0.0100, 0.0095, 0.0096, 0.0159, 0.0213, 0.0270, 0.0281)
STYLES = ("-", ":", "-.")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN")
    parser.add_argument("-o", dest="target", required=True, type=Path, metavar="FILE")
    options = parser.parse_args()
    with style.paper():
        picture = draw([RunDirectory.open(path) for path in options.runs])
        picture.savefig(options.target, bbox_inches="tight")


def draw(runs: list[RunDirectory]):
    """The figure: mode amplitude against time. Prints each run's growth rate."""
    picture = style.new_figure(6.4, 4.6)
    panel = picture.add_subplot()
    sizes: dict[int, str] = {}
    settings: dict[str, str] = {}
    for run in runs:
        config, history = configuration.load(run.config), read(run.history)
        problem, physics = config.problem, config.physics
        ratio = problem.over_time(physics.eos_model(), history)["growth_ratio"]
        side = round(problem.n**0.5)
        setting = f"{physics.kernel.replace('_', ' ')}, η = {physics.eta:g}, α = {physics.alpha}"
        colour = sizes.setdefault(side, style.PALETTE[len(sizes)])
        dashes = settings.setdefault(setting, STYLES[len(settings)])
        label = f"{side}², {setting}: {ratio:.2f} of linear growth"
        panel.plot(history["t"], history["mode_amplitude"], dashes, color=colour, label=label)
        print(label, np.interp(SWIFT_TIMES, history["t"], history["mode_amplitude"]).round(4))
    t = np.linspace(0.0, config.time.end, 151)
    theory = problem.theory(physics.eos_model(), t)["mode_amplitude"]
    panel.plot(t, theory, "--", color=style.EXACT, label="linear theory")
    panel.plot(SWIFT_TIMES, SWIFT, "o", color="grey", label="SWIFT 2026.04, SPHENIX, 128²")
    panel.axvspan(*GROWTH, color="black", alpha=0.06, lw=0)
    panel.set(xlabel="$t$", ylabel="mode amplitude of $v_y$", yscale="log", ylim=(6e-3, 0.6))
    panel.legend(loc="upper left", fontsize=8)
    return picture


if __name__ == "__main__":
    main()
