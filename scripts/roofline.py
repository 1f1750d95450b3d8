"""Roofline of the density and rate pass in 3-D: bound by arithmetic, reached, and the ratio.

    python scripts/roofline.py                   64³ particles, 125 neighbours, one thread
    python scripts/roofline.py --per-axis 32     fewer particles
    python scripts/roofline.py --candidates 277  another number of candidates per particle

The bound is the number of arithmetic instructions of a pass divided by the measured peak rate of
fused multiply-adds. Data in the pair loops come from the first-level cache, so arithmetic is the
limit. Two bounds: `all candidates` computes everything for all candidates of a block; `useful
lanes` computes the distance for all candidates and the rest for neighbours only. Prints Markdown.
"""

import argparse
import sys
from pathlib import Path
from typing import NamedTuple

from benchmark_calibration import Calibration
from benchmark_runs import BenchmarkError, Tree, measure
from benchmark_scenes import engine_case
from roofline_peak import peak, vector_bytes

HOME = Path(__file__).resolve().parent.parent
# Mean number per particle in the neighbour lists of commit a0e46cc: the scene of this script with
# 64³ particles, steps 1 to 20 (291 to 307). The lists before the first step have 338.
CANDIDATES = 297
NEIGHBOURS = 125

# Instructions for a square root and a division. Estimates of 14 bits (vrsqrt14, vrcp14) and Newton
# steps cost less than the processor's own instructions (24 and 16 cycles for 512 bits on Ice Lake).
# Square root r = s / sqrt(s): estimate y; s/2; each step y (3/2 - (s/2) y y), 3 instructions; s y.
# Division: estimate; each step 2 fused multiply-adds. Two steps in double, one in single precision.
ROOT = {"double": 1 + 1 + 2 * 3 + 1, "single": 1 + 1 + 3 + 1}
DIVISION = {"double": 1 + 2 * 2, "single": 1 + 2}


class Operations(NamedTuple):
    """Floating-point instructions for a pair. A fused multiply-add is one instruction."""

    adds: int = 0  # and subtractions
    multiplies: int = 0
    fused: int = 0
    compares: int = 0  # minimum, maximum, comparison
    roots: int = 0
    divisions: int = 0

    def instructions(self, precision: str) -> int:
        simple = self.adds + self.multiplies + self.fused + self.compares
        return simple + self.roots * ROOT[precision] + self.divisions * DIVISION[precision]

    def __add__(self, other) -> "Operations":
        return Operations(*(a + b for a, b in zip(self, other, strict=True)))


def total(*parts: Operations) -> Operations:
    return sum(parts, start=Operations())


# r_ij by axis; the first square and 2 fused multiply-adds; comparison with H^2.
DISTANCE = Operations(adds=3, multiplies=1, fused=2, compares=1)
ROOT_OF_SQUARE = Operations(roots=1)

# Wendland C2 with constant factors outside the loop (formulations/gas/density.py, smoothing.py;
# kernels/wendland_c2.py). q = r/H; u = 1 - q, at least 0.
Q_AND_U = Operations(adds=1, multiplies=1, compares=1)
U_CUBED = Operations(multiplies=2)
W = Operations(multiplies=3, fused=1)  # u^2, u^4, 1 + 4 q, product
# First evaluation of eq 7: sum of m w.
FIRST_SUM = total(Q_AND_U, W, Operations(fused=1))
# Second: also u^3 (u^2 is there), q^2, m q^2, and the sum of m q^2 u^3.
SECOND_SUM = total(FIRST_SUM, Operations(multiplies=3, fused=1))
# Velocity divergence and curl (eqs 16, 17): m u^3; r_ij and v_ij; v . r; the sum; for each of three
# components of v x r a product, a fused multiply-subtract and a fused sum.
GRADIENTS = total(
    Q_AND_U,
    U_CUBED,
    Operations(multiplies=1),
    Operations(adds=6),
    Operations(multiplies=1, fused=2),
    Operations(fused=1),
    Operations(multiplies=3, fused=6),
)
# The pair loop of formulations/gas/rates.py with grad_h, constant alpha and Balsara's factor.
FORCE = total(
    Operations(adds=3, multiplies=1, fused=2),  # v_ij, v . r
    Operations(adds=1, multiplies=1, divisions=1),  # rho_i + rho_j; 1/(r (rho_i + rho_j))
    Operations(multiplies=2, compares=1),  # w_ij (eq 26)
    Operations(adds=1, fused=1),  # v_sig (eq 25)
    total(Q_AND_U, U_CUBED, Operations(multiplies=2)),  # slope at H_i, with m_j and 1/H_i^5
    total(Q_AND_U, U_CUBED, Operations(multiplies=2)),  # slope at H_j
    Operations(multiplies=4),  # Pi (eq 24)
    Operations(adds=1, multiplies=1),  # Balsara's factor of the pair
    Operations(adds=3, multiplies=2, fused=1),  # pair: slope, force, work (eqs 22, 23)
    Operations(fused=1),  # du/dt
    Operations(compares=2),  # largest v_sig of neighbours
    Operations(fused=3),  # acceleration
)

PASSES = {  # for every candidate; for every neighbour
    "density": (DISTANCE, total(ROOT_OF_SQUARE, FIRST_SUM, SECOND_SUM, GRADIENTS)),
    "rates": (DISTANCE, total(ROOT_OF_SQUARE, FORCE)),
}


def bounds(name: str, precision: str, rate: float, candidates: float, neighbours: float):
    """Return the least µs for an update of a particle: (all candidates, useful lanes).

    rate: instructions per second times lanes, as `roofline_peak.peak` returns.
    """
    each, near = (one.instructions(precision) for one in PASSES[name])
    return (
        1e6 * candidates * (each + near) / rate,
        1e6 * (candidates * each + neighbours * near) / rate,
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--per-axis", type=int, default=64, help="particles per axis (default 64)")
    parser.add_argument("--repeats", type=int, default=3, help="runs, of which the best counts")
    parser.add_argument("--candidates", type=float, default=CANDIDATES)
    parser.add_argument("--tree", type=Path, default=HOME, help="source tree to measure")
    options = parser.parse_args()
    try:
        tree = Tree.at(options.tree)
        report(tree, options)
    except BenchmarkError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2
    return 0


def report(tree: Tree, options: argparse.Namespace) -> None:
    calibrate = Calibration(0.01)
    rates = {precision: peak(precision) for precision in tree.precisions}
    for precision, rate in rates.items():
        lanes = vector_bytes() // (8 if precision == "double" else 4)
        print(f"Peak, {precision}: {rate / 1e9:.1f}e9 fused multiply-adds per second, "
              f"{rate / lanes / 1e9:.2f}e9 vector instructions of {lanes} lanes.")  # fmt: skip
    print(f"{options.candidates:.0f} candidates and {NEIGHBOURS} neighbours per particle; "
          f"{options.per_axis}³ particles; least time of {options.repeats} runs.\n")  # fmt: skip
    row("pass", "precision", "instructions per candidate + neighbour",
        "bound, all candidates (µs)", "bound, useful lanes (µs)", "reached (µs)",
        "bound / reached, all candidates", "bound / reached, useful lanes")  # fmt: skip
    row(*("---" for _ in range(8)))
    for precision in tree.precisions:
        case = engine_case(options.per_axis, 1, NEIGHBOURS, precision)
        figures = measure(case, [tree], options.repeats, calibrate)[0]
        sums = [0.0, 0.0, 0.0]
        for name in PASSES:
            found = bounds(name, precision, rates[precision], options.candidates, NEIGHBOURS)
            reached = min(figures[f"{case.part} / {case.scene} / {name}"].values)
            each, near = (one.instructions(precision) for one in PASSES[name])
            table_row(name, precision, f"{each} + {near}", *found, reached)
            sums = [a + b for a, b in zip(sums, (*found, reached), strict=True)]
        table_row("both", precision, "", *sums)


def table_row(name: str, precision: str, counts: str, full: float, useful: float, reached: float):
    row(name, precision, counts, f"{full:.3f}", f"{useful:.3f}", f"{reached:.3f}",
        f"{full / reached:.2f}", f"{useful / reached:.2f}")  # fmt: skip


def row(*cells) -> None:
    print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    sys.exit(main())
