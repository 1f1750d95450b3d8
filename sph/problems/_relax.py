"""The table [problem.relax]: particles relax to a glass before the run."""

from collections.abc import Callable
from contextlib import closing
from typing import Any

import numpy as np
from pydantic import Field

from sph import kernels, progress
from sph.domain import Domain
from sph.errors import ConfigError
from sph.problems import base
from sph.problems.support import glass


class Relax(base.Section):
    """Relaxation to a glass, a disordered arrangement whose densities are uniform."""

    residual: float = Field(
        default=1e-3,
        gt=0.0,
        description="density error at which relaxation ends: the rms scatter of the density sums "
        "about their mean, over that mean",
    )
    iterations: int = Field(
        default=400, ge=1, description="most iterations; if these do not suffice, an error"
    )
    seed: int = Field(default=0, ge=0, description="seed of the random positions at the start")


def smoothing(physics, dimension: int) -> glass.Smoothing:
    """Return the density sum of a run with that table [physics]."""
    kernel: Any = physics.kernel_model()
    key = physics.kinds[0].neighbours_key
    eta = getattr(physics, key.removeprefix("physics."))
    return glass.Smoothing(kernel, eta * kernels.support_ratio(kernel, dimension))


def usual_smoothing(dimension: int) -> glass.Smoothing:
    """Return the density sum of the default kernel, for a problem without configuration."""
    kernel: Any = kernels.make("wendland_c2")
    return glass.Smoothing(kernel, 1.6 * kernels.support_ratio(kernel, dimension))


def opens(boundaries: tuple[str, ...]) -> list[base.Fault]:
    """Return a fault if an axis is open: there gas would expand instead of relaxing."""
    if "open" not in boundaries:
        return []
    text = 'needs closed boundaries: expected problem.boundary "periodic" or "mirror" on all axes'
    return [base.Fault(("relax",), text)]


def relaxed(
    keys: Relax,
    position: np.ndarray,
    domain: Domain,
    volume: Callable[[np.ndarray], np.ndarray],
    sums: glass.Smoothing,
) -> np.ndarray:
    """Return relaxed positions (D, N). Raises ConfigError if the residual is not reached.

    volume: returns the volumes (N,) of particles at positions (D, N).
    """
    with closing(progress.suited_to_iterations("relaxing", keys.iterations)) as shown:
        found = glass.relaxed(
            position, domain, volume, sums, keys.residual, keys.iterations, shown.step
        )
        if not found.scatter <= keys.residual:
            raise ConfigError(
                f"problem.relax.residual = {keys.residual:g}: the density error is "
                f"{found.scatter:.3g} after {found.iterations} iterations.\nTry: a larger "
                "residual, or more problem.relax.iterations."
            )
        shown.note(
            f"relaxed {position.shape[1]} particles in {found.iterations} iterations: density "
            f"error {found.scatter:.2e} rms about a mean of {found.mean - 1.0:+.2e}"
        )
    return found.position
