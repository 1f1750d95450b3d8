"""Whether particles have paired: distances to the nearest neighbour, as data and in words."""

import numpy as np

# Healthy runs end with medians from .85 (Gresho's vortex, 32^2) to 1.07 (a hexagonal lattice), and
# particles at random places begin with .54; kernels that pair end below .46 (docs/measurements.md).
PAIRED = 0.5


def figures(nearest: np.ndarray) -> dict[str, float]:
    """The median and the smallest of `nearest` (N,), from `Simulation.nearest()`."""
    return {"median": float(np.median(nearest)), "smallest": float(nearest.min())}


def warning(median: float) -> str | None:
    """What to tell of that median distance, in spacings; None where particles keep apart."""
    if not median < PAIRED:
        return None
    return (
        f"particles have paired: the median distance to the nearest neighbour is {median:.2g} of "
        "the particle spacing, so the run has fewer resolution elements than particles. "
        "Try: a Wendland kernel, or a smaller physics.eta."
    )
