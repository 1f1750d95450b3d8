"""The table [problem.relax]: particles relax to a glass before the run."""

from collections.abc import Callable
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from sph import kernels, progress
from sph.domain import Domain
from sph.errors import ConfigError
from sph.problems import base
from sph.problems.support import glass, lattice


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


class Placed(NamedTuple):
    """Positions (D, N), and how relaxation ended; None without relaxation."""

    position: np.ndarray
    relaxation: base.Relaxation | None


class Relaxable(base.Problem):
    """A problem whose particles can begin on a glass instead of a lattice."""

    relax: Relax | None = Field(
        default=None,
        description="relaxation to a glass before the run; not done if not given",
        examples=[{"residual": 1e-3}],
    )

    _sums: glass.Smoothing | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _is_closed(self):
        if self.relax is not None and "open" in self.boundaries:
            text = 'needs closed boundaries: expected "periodic" or "mirror" on all axes'
            raise base.refused([base.Fault(("relax",), text)])
        return self

    def under(self, physics):
        """Return the problem with the density sum of the run, which relaxation makes uniform."""
        copy = super().under(physics).model_copy()
        copy._sums = _smoothing(physics, self.dimension)
        return copy

    def on_glass(self, position: np.ndarray) -> Placed:
        """Return the positions (D, N) of a lattice with equal volumes, relaxed if that is asked."""
        if self.relax is None:
            return Placed(position, None)
        start = lattice.with_noise(position, self.box, 0.5, self.relax.seed)
        each = float(np.prod(self.box[:, 1] - self.box[:, 0])) / position.shape[1]
        return self.relaxed(start, lambda x: np.full(x.shape[1], each))

    def relaxed(self, start: np.ndarray, volume: Callable[[np.ndarray], np.ndarray]) -> Placed:
        """Return relaxed positions (D, N), and how relaxation ended.

        volume: returns the volumes (N,) of particles at positions (D, N). Raises ConfigError if the
        residual is not reached.
        """
        assert self.relax is not None
        sums = self._sums or _usual_smoothing(self.dimension)
        return _relaxed(self.relax, start, Domain(self.box, self.boundaries), volume, sums)


def _smoothing(physics, dimension: int) -> glass.Smoothing:
    """Return the density sum of a run with that table [physics]."""
    kernel: Any = physics.kernel_model()
    key = physics.kinds[0].neighbours_key
    eta = getattr(physics, key.removeprefix("physics."))
    return glass.Smoothing(kernel, eta * kernels.support_ratio(kernel, dimension))


def _usual_smoothing(dimension: int) -> glass.Smoothing:
    """Return the density sum of the default kernel, for a problem without configuration."""
    kernel: Any = kernels.make("wendland_c2")
    return glass.Smoothing(kernel, 1.6 * kernels.support_ratio(kernel, dimension))


def _relaxed(
    keys: Relax,
    position: np.ndarray,
    domain: Domain,
    volume: Callable[[np.ndarray], np.ndarray],
    sums: glass.Smoothing,
) -> Placed:
    """Return relaxed positions (D, N), see `Relaxable.relaxed`."""
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
    ended = base.Relaxation(found.iterations, found.scatter, found.mean - 1.0)
    return Placed(found.position, ended)
