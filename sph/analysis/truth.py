"""Where, until when and under which physics the exact solution of a problem holds.

All comparisons with exact solutions, and all figures of them, use these functions.
"""

import numpy as np

from sph.config import Config

NONE = "this problem has no exact solution"


def departure(config: Config, time: float) -> str | None:
    """Why exact solution and theory do not hold for this configuration at `time`, or None."""
    problem = config.problem
    if reason := problem.departs(config.physics):
        return reason
    end, event = problem.exact_ends(config.physics.eos_model())
    return f"the exact solution ends at t = {end:.4g}, when {event}" if time > end else None


def left_out(config: Config, time: float, position: np.ndarray) -> str | None:
    """Why errors against the exact solution cannot be taken at (D, N) particles, or None."""
    problem, eos = config.problem, config.physics.eos_model()
    if not problem.has_exact:
        return NONE
    if reason := departure(config, time):
        return reason
    if problem.exact(eos, time, position[:, :1]) is None:
        return NONE
    inside, words = region(problem, eos, time, position)
    return None if inside.any() else f"no particle is in the region where errors are taken, {words}"


def region(problem, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
    """(N,) mask of the particles over which errors are taken, and that region in words.

    The error region of the problem, less where waves from the ends of the domain have arrived.
    """
    inside, words = problem.error_region(eos, time, position)
    reached = inside & ~within(problem, eos, time, position)
    if not reached.any():
        return inside, words
    ends = zip("xyz", problem.undisturbed(eos, time), strict=False)
    ranges = [f"{low:.4g} < {axis} < {high:.4g}" for axis, (low, high) in ends if low > -np.inf]
    undisturbed = f"{', '.join(ranges)}, where no wave from the domain's ends has arrived"
    of_all = words == "the whole domain"
    return inside & ~reached, undisturbed if of_all else f"{words}, within {undisturbed}"


def within(problem, eos, time: float, position: np.ndarray) -> np.ndarray:
    """(N,) whether no wave from the ends of the domain has arrived at the (D, N) positions."""
    low, high = problem.undisturbed(eos, time).T[..., None]
    return np.all((low < position) & (position < high), axis=0)


def figures(config: Config, time: float, particles, pressure, history=None) -> dict[str, float]:
    """All figures of the problem; comparisons with exact solution and theory where these hold.

    history: columns (steps,), or None to leave out figures of the history.
    """
    problem, eos = config.problem, config.physics.eos_model()
    found = problem.report(eos, time, particles, pressure)
    if departure(config, time) is None:
        found |= problem.compare(eos, time, particles, pressure)
    if history is not None and problem.departs(config.physics) is None:
        found |= problem.over_time(eos, history)
    return found


def theory(config: Config, times: np.ndarray) -> dict[str, np.ndarray]:
    """Theory for columns of the history at `times` (M,), where it holds for this physics."""
    if config.problem.departs(config.physics):
        return {}
    return config.problem.theory(config.physics.eos_model(), times)
