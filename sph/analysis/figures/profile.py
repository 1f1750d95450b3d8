"""One state as a function of one coordinate, x or the radius, beside its exact solution."""

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sph.analysis import truth
from sph.analysis.figures.sources import State

EXACT_POINTS = 2000
LONGEST_TITLE = 90  # letters in a line
# Exact solutions whose spread is within this range of their mean are drawn as deviations from the
# mean: above, the signal is seen beside errors of the mean; below, it is round-off.
SMALL_SIGNAL = (1e-9, 0.01)


class Profile(NamedTuple):
    """One state as a function of one coordinate; "velocity" is the component along it."""

    symbol: str  # of the coordinate: x or r
    coordinate: np.ndarray  # (M,) of the particles in the region over which errors are taken
    fields: dict[str, np.ndarray]  # (M,) each
    exact_coordinate: np.ndarray
    exact: dict[str, np.ndarray]  # empty where there is none
    is_scattered: bool  # in 2 and 3-D, where many particles share a coordinate

    def means(self, name: str) -> tuple[float, float]:
        """Mean of a field over the particles, and of its exact solution at the same places."""
        exact = np.interp(self.coordinate, self.exact_coordinate, self.exact[name])
        there = np.isfinite(exact)
        return float(self.fields[name][there].mean()), float(exact[there].mean())

    def less_means(self, name: str) -> "Profile":
        """This profile with a field and its exact solution as deviations from their means."""
        mean, exact_mean = self.means(name)
        return self._replace(
            fields=self.fields | {name: self.fields[name] - mean},
            exact=self.exact | {name: self.exact[name] - exact_mean},
        )


def profile(state: State) -> Profile:
    """The particles of the problem's error region, and the exact solution there."""
    particles, problem = state.particles, state.problem
    inside, _ = problem.error_region(state.eos, state.time, particles.position)
    if not inside.any():
        inside[:] = True
    if state.is_radial:
        inside &= state.radius < _reach(problem)
        coordinate = state.radius[inside]
        names = ("v_r", "v_phi") if state.dimension == 2 else ("v_r",)
        velocities = {name: state.scalar(name)[inside] for name in names}
        velocities["velocity"] = velocities["v_r"]
    else:
        coordinate = particles.position[0, inside]
        velocities = {"velocity": particles.velocity[0, inside]}
    scalars = {
        name: state.scalar(name)[inside] for name in problem.profiles if name not in velocities
    }
    end = coordinate.max()
    # not at r = 0 itself, where an exact blast has no gas
    start = max(coordinate.min(), end / EXACT_POINTS) if state.is_radial else coordinate.min()
    at = np.linspace(start, end, EXACT_POINTS)
    exact = _exact_along(state, at)
    return Profile(
        "r" if state.is_radial else "x",
        coordinate, scalars | velocities, at, exact, is_scattered=state.dimension > 1,
    )  # fmt: skip


def has_small_signal(profiles: Sequence[Profile], name: str) -> bool:
    """Whether all exact solutions vary so little that errors of the mean would hide them."""
    for one in profiles:
        values = one.exact.get(name, np.zeros(0))
        values = values[np.isfinite(values)]
        if not values.size:
            return False
        low, high = SMALL_SIGNAL[0] * abs(values.mean()), SMALL_SIGNAL[1] * abs(values.mean())
        if not low < np.ptp(values) < high:
            return False
    return True


def without_exact(left_out: Sequence[str | None]) -> str:
    """Lines for a title that say why an exact solution that the problem has is not drawn.

    left_out: one reason a state, None where the solution is drawn or the problem has none.
    """
    which = "" if len(left_out) == 1 else "in part "
    return "".join(
        "\n" + textwrap.fill(f"{which}without the exact solution: {reason}", LONGEST_TITLE)
        for reason in sorted({reason for reason in left_out if reason})[:1]
    )


def _reach(problem) -> float:
    """The largest circle in a periodic box: beyond it, only its corners hold gas."""
    sides = problem.box[:, 1] - problem.box[:, 0]
    periodic = [boundary == "periodic" for boundary in problem.boundaries]
    return float(sides[periodic].min() / 2.0) if any(periodic) else np.inf


def _exact_along(state: State, at: np.ndarray) -> dict[str, np.ndarray]:
    """On a line along x through the centre of the box, where `at` is x or the radius.

    NaN where waves from the ends of the domain have come, and the solution does not hold.
    """
    if state.left_out:
        return {}
    position = np.repeat(state.problem.centre[:, None], at.size, axis=1)
    if state.is_radial:
        position += state.problem.drift[:, None] * state.time
    position[0] = position[0] + at if state.is_radial else at
    exact = state.exact(position) or {}
    holds = truth.within(state.problem, state.eos, state.time, position)
    velocity = exact["velocity"]
    fields = exact | {"velocity": velocity[0]}
    if state.is_radial:
        velocity = velocity - state.problem.drift[:, None]
        fields |= dict(zip(("v_r", "v_phi"), velocity, strict=False), velocity=velocity[0])
    return {name: np.where(holds, values, np.nan) for name, values in fields.items()}
