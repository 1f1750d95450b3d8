"""Errors of a state: norms of its difference from the exact solution."""

import numpy as np

from sph.analysis import truth
from sph.config import Config
from sph.problems.support import uniaxial
from sph.summary import AbsoluteNorms, Errors, Norms

FIELDS = ("density", "velocity", "pressure", "internal_energy")
OF_SOLIDS = (*FIELDS, "stress")


def norms(difference, volume) -> AbsoluteNorms:
    """Volume-weighted norms of `difference` (N,), or of the length of a vector (D, N).

    L1 = sum V |d| / sum V, L2 = sqrt(sum V d^2 / sum V), Linf = max |d|; volume (N,) = m/rho.
    """
    size = np.abs(difference) if difference.ndim == 1 else np.linalg.norm(difference, axis=0)
    return _norms_of(size, volume)


def _norms_of(size, volume) -> AbsoluteNorms:
    total = volume.sum()
    return {
        "L1": float((volume * size).sum() / total),
        "L2": float(np.sqrt((volume * size**2).sum() / total)),
        "Linf": float(size.max()),
    }


def by_field(state: dict, exact: dict, volume, inside) -> dict[str, Norms]:
    """Norms of state - exact of each field over the particles `inside` (N,), volume (N,).

    "relative_L1" is sum V |d| / sum V |exact|. Of a velocity it depends on the frame of reference:
    |v| is taken, not |v| + c_s.
    """
    found: dict[str, Norms] = {}
    volume = volume[inside]
    for name in OF_SOLIDS:
        if name in exact:
            nothing = np.broadcast_to(0.0, exact[name].shape)
            own = _norms_of(_distances(state[name], exact[name], inside), volume)
            size = _norms_of(_distances(exact[name], nothing, inside), volume)["L1"]
            found[name] = {**own, "relative_L1": own["L1"] / size if size > 0.0 else None}
    return found


def _distances(values, others, inside) -> np.ndarray:
    """|values - others| of the particles `inside`, scalars (N,) or vectors (D, N)."""
    if values.ndim == 1:
        return np.abs(values[inside] - others[inside])
    # axis by axis, so that the errors of a large run take less memory than its steps
    return np.sqrt(sum((a[inside] - b[inside]) ** 2 for a, b in zip(values, others, strict=True)))


def against_exact(config: Config, time: float, particles, pressure) -> Errors | None:
    """Errors by field where the exact solution holds, or None: `truth.left_out` says why."""
    if truth.left_out(config, time, particles.position):
        return None
    problem, eos = config.problem, config.physics.eos_model()
    exact = problem.exact(eos, time, particles.position) or {}
    inside, words = truth.region(problem, eos, time, particles.position)
    state = {
        "density": particles.density,
        "velocity": particles.velocity,
        "pressure": pressure,
        "internal_energy": particles.internal_energy,
    }
    if "stress" in exact:
        state["stress"] = uniaxial.compressive_stress(particles, pressure)
    fields = by_field(state, exact, particles.mass / particles.density, inside)
    return {
        "against": problem.truth[0],
        "region": words,
        "particles": int(inside.sum()),
        "fields": fields,
    }
