"""Comparison of a shock tube with its exact solution: peaks, plateaus, shocks, contact."""

from typing import NamedTuple

import numpy as np

from sph import quantity as units
from sph.exact import riemann
from sph.quantity import Quantity

# Shocks with a smaller jump of density, relative to the gas ahead, are ignored: states with rounded
# digits produce weak waves.
FAINT = 0.02


QUANTITIES = {
    "peak_density_exact": Quantity("largest density of the exact solution", units.DENSITY),
    "density_L1_relative": Quantity(
        "sum of V |error of rho| over the sum of V rho, exact, in the region of the errors"
    ),
    **{
        f"plateau_{side}_{name}_error": Quantity(
            f"median {name} on the {side} of the contact over exact, minus 1{relative}"
        )
        for side in ("left", "right")
        for name, relative in (
            ("density", ""), ("velocity", ", relative to its change by the waves"), ("pressure", "")
        )
    },
    **{
        f"shock_{side}_error": Quantity(
            f"distance that the {side} shock has travelled relative to the gas ahead over exact, "
            "minus 1"
        )
        for side in ("left", "right")
    },
    "contact_energy_excess": Quantity(
        "largest internal energy between the outer waves over exact, minus 1 (wall heating)"
    ),
}  # fmt: skip


class Tube(NamedTuple):
    """State of the particles at a time and the exact state at their positions, each (N,)."""

    states: tuple[riemann.State, riemann.State]
    eos: tuple
    time: float
    x: np.ndarray  # from the diaphragm
    region: np.ndarray  # whether a particle counts
    density: np.ndarray
    velocity: np.ndarray
    pressure: np.ndarray
    internal_energy: np.ndarray
    mass: np.ndarray
    exact: dict[str, np.ndarray]


def of(tube: Tube) -> dict[str, float]:
    """Return the numbers of `Problem.compare` that exist for this solution."""
    star = riemann.star_state(*tube.states, tube.eos)
    speed = riemann.wave_speeds(*tube.states, tube.eos)
    figures = {
        "peak_density_exact": max(
            *(state.density for state in tube.states), star.density_left, star.density_right
        ),
    }
    if tube.region.any():
        figures["density_L1_relative"] = _relative_error(tube)
    if tube.time == 0.0 or star.vacuum:
        return figures
    figures |= _plateaus(tube, star, speed)
    figures |= _shocks(tube, star, speed)
    figures["contact_energy_excess"] = _contact_energy_excess(tube, speed)
    return figures


def _relative_error(tube: Tube) -> float:
    volume = (tube.mass / tube.density)[tube.region]
    exact = tube.exact["density"][tube.region]
    found = tube.density[tube.region]
    return float((volume * np.abs(found - exact)).sum() / (volume * exact).sum())


def _plateaus(tube: Tube, star: riemann.Star, speed: riemann.WaveSpeeds) -> dict[str, float]:
    """Return errors of the plateaus, without a tenth at either end, where waves are smeared.

    Velocity errors are relative to the larger change of velocity by the two waves, which does not
    depend on the frame of reference.
    """
    figures = {}
    change = max(abs(star.velocity - state.velocity) for state in tube.states)
    for side, start, end, density in (
        ("left", speed.left_tail, speed.contact, star.density_left),
        ("right", speed.contact, speed.right_tail, star.density_right),
    ):
        margin = 0.1 * (end - start)
        low, high = ((start + margin) * tube.time, (end - margin) * tube.time)
        inside = tube.region & (low < tube.x) & (tube.x < high)
        if not inside.any():
            continue
        for name, truth, scale in (
            ("density", density, density),
            ("velocity", star.velocity, change or 1.0),
            ("pressure", star.pressure, abs(star.pressure)),
        ):
            error = float(np.median(getattr(tube, name)[inside])) - truth
            figures[f"plateau_{side}_{name}_error"] = error / scale if scale else error
    return figures


def _shocks(tube: Tube, star: riemann.Star, speed: riemann.WaveSpeeds) -> dict[str, float]:
    """Return errors of shock positions, where the density first crosses the middle of its jump."""
    figures = {}
    inward = np.argsort(tube.x)
    for side, ahead, shock, tail, behind, order in (
        ("left", tube.states[0], speed.left_head, speed.left_tail, star.density_left, inward),
        (
            "right", tube.states[1], speed.right_head, speed.right_tail, star.density_right,
            inward[::-1],
        ),
    ):  # fmt: skip
        if shock != tail or behind < (1.0 + FAINT) * ahead.density:
            continue
        order = order[tube.region[order]]
        if not order.size:
            continue
        x, above = tube.x[order], tube.density[order] - 0.5 * (ahead.density + behind)
        first = int(np.argmax(above > 0.0))
        if first == 0:  # no particle is dense enough, or the region begins behind the shock
            continue
        share = above[first] / (above[first] - above[first - 1])
        found = x[first] + share * (x[first - 1] - x[first])
        travelled = (shock - ahead.velocity) * tube.time
        figures[f"shock_{side}_error"] = float((found - shock * tube.time) / travelled)
    return figures


def _contact_energy_excess(tube: Tube, speed: riemann.WaveSpeeds) -> float:
    """Return the excess in the star states, or at the nearest two particles if they are empty."""
    x, contact = tube.x, speed.contact * tube.time
    between = (speed.left_tail * tube.time < x) & (x < speed.right_tail * tube.time)
    for side in (x < contact, x >= contact):
        if side.any():
            between[np.argmin(np.where(side, np.abs(x - contact), np.inf))] = True
    return float(np.max(tube.internal_energy[between] / tube.exact["internal_energy"][between])) - 1
