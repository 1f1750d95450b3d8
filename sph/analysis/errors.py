"""Norms of the difference between a state and its exact solution."""

import numpy as np

FIELDS = ("density", "velocity", "pressure", "internal_energy")


def norms(difference, volume) -> dict[str, float]:
    """Volume-weighted norms of `difference` (N,) or (D, N), of which the length is taken.

    L1 = sum V |d| / sum V, L2 = sqrt(sum V d^2 / sum V), Linf = max |d|; volume (N,) = m/rho.
    """
    size = np.abs(difference) if difference.ndim == 1 else np.linalg.norm(difference, axis=0)
    total = volume.sum()
    return {
        "L1": float((volume * size).sum() / total),
        "L2": float(np.sqrt((volume * size**2).sum() / total)),
        "Linf": float(size.max()),
    }


def against_exact(problem, eos, time: float, particles, pressure) -> dict | None:
    """Norms by field over the problem's error region, or None where there is no exact solution.

    {"region": words, "particles": how many, "fields": {field: {"L1": …, "L2": …, "Linf": …}}}
    """
    exact = problem.exact(eos, time, particles.position)
    if exact is None:
        return None
    inside, words = problem.error_region(eos, time, particles.position)
    if not inside.any():
        return None
    state = {
        "density": particles.density,
        "velocity": particles.velocity,
        "pressure": pressure,
        "internal_energy": particles.internal_energy,
    }
    volume = (particles.mass / particles.density)[inside]
    fields = {
        name: norms((state[name] - exact[name])[..., inside], volume)
        for name in FIELDS
        if name in exact
    }
    return {"region": words, "particles": int(inside.sum()), "fields": fields}
