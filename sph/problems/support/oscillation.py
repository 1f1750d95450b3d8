"""Frequency and damping of an oscillation in the history of a run."""

from typing import NamedTuple

import numpy as np


class Oscillation(NamedTuple):
    """exp(-damping t) times a sine of angular frequency `frequency`."""

    frequency: float
    damping: float

    @property
    def period(self) -> float:
        return 2.0 * np.pi / self.frequency


def fit(time: np.ndarray, value: np.ndarray, guess: float) -> Oscillation | None:
    """Return the damped sine plus a constant that fits `value` at ascending `time` (M,) best.

    guess: an angular frequency near that sought. Each value counts in proportion to its time step.
    Returns None if the values last less than one and a half periods of the guess. Amplitude, phase
    and constant enter linearly and are solved for inside the fit of frequency and damping (Golub &
    Pereyra 1973, SIAM J. Numer. Anal. 10, 413).
    """
    from scipy.optimize import least_squares  # costs 0.1 s to import

    since = time - time[0] if time.size else time
    if time.size < 6 or since[-1] * guess < 3.0 * np.pi:
        return None
    value = value / (np.abs(value).max() or 1.0)  # the fit stops at an absolute accuracy
    weight = np.sqrt(np.gradient(since))

    def misfit(unknown):
        frequency, damping = unknown * guess
        envelope = np.exp(-damping * since)
        columns = (envelope * np.cos(frequency * since), envelope * np.sin(frequency * since))
        basis = weight[:, None] * np.column_stack([*columns, np.ones_like(since)])
        linear = np.linalg.lstsq(basis, weight * value, rcond=None)[0]
        return basis @ linear - weight * value

    found = least_squares(misfit, (1.0, 0.02), bounds=((0.5, -0.2), (1.5, 1.0)), xtol=1e-12)
    return Oscillation(*(float(one) for one in found.x * guess))
