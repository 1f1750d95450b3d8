"""Errors of a simulation that cannot go on: what broke and when, which particle, what to try."""

import numpy as np

from sph.errors import NumericalError
from sph.neighbours.order import BLOCK

SMALLER_STEPS = "a smaller physics.C, a larger physics.alpha, physics.energy_limit = true"


def fault(simulation, what: str, remedy: str, particle: int) -> NumericalError:
    """The error to raise: what broke and when, what to try, and the ID of a particle (0: none)."""
    return NumericalError(
        f"step {simulation.step}, t = {simulation.time:.6g}: {what}.\nTry: {remedy}.", particle
    )


def what_sets(limit) -> str:
    """The particle and criterion of a step, in words."""
    if not limit.particle:
        return "it may not grow faster"
    by = {
        "signal_speed": "the speed of its signals",
        "energy": "u/|du/dt|, how fast it is heated or cooled",
        "acceleration": "its acceleration",
        "support": "how fast its support changes",
    }
    return f"particle {limit.particle} sets it by {by[limit.criterion]}"


def fault_of(simulation, name: str, values, bad, remedy: str) -> NumericalError:
    """The error of the first particle whose `values` are `bad`, arrays (N,) or (D, N)."""
    p = simulation.particles
    i = int(np.argwhere(bad)[0][-1])
    count = int(bad.any(axis=tuple(range(bad.ndim - 1))).sum())
    return fault(
        simulation,
        f"{name} of particle {p.id[i]} at {_place(p, i)} is {values[..., i]}; "
        f"{count} particle(s) are so",
        remedy,
        int(p.id[i]),
    )


def endless_sum(simulation) -> NumericalError:
    """The error to raise where what each particle has is a number, but not the sum of it."""
    p, totals, external = simulation.particles, simulation.totals, simulation.scene.external
    with np.errstate(all="ignore"):  # the very numbers that are looked for
        if external is not None and not np.isfinite(totals.potential_energy):
            name, each = "potential energy", external.potential(p.position)
            remedy = "a softening of physics.external, or no particle where its mass is"
        elif not np.isfinite(totals.kinetic_energy):
            name, each, remedy = "kinetic energy", (p.velocity**2).sum(axis=0), SMALLER_STEPS
        elif not np.isfinite(totals.internal_energy):
            name, each, remedy = "internal energy", p.internal_energy, SMALLER_STEPS
        else:
            name, each, remedy = "rate of energy", p.energy_rate, SMALLER_STEPS
        i = int(np.argmax(np.abs(each)))
    return fault(
        simulation,
        f"the sum of all {name} is no number; the most is with particle {p.id[i]} at "
        f"{_place(p, i)}",
        remedy,
        int(p.id[i]),
    )


def starved(simulation, block: int) -> NumericalError:
    """The error to raise where particles of a block ask for wider supports without an end."""
    among = simulation.particles.id[block * BLOCK : (block + 1) * BLOCK].tolist()
    return fault(
        simulation,
        f"no support holds enough neighbours for a particle among {among}",
        "a closed domain (problem.boundary), or more particles",
        among[0],
    )


def crowded(simulation) -> NumericalError:
    """The error to raise where a density below zero says that a particle has no support."""
    p = simulation.particles
    i = int(np.argmin(p.density))
    here = p.position[:, i]
    images = zip(*simulation.scene.domain.images, strict=True)
    there = (s[:, None] * p.position + o[:, None] == here[:, None] for s, o in images)
    others = sum(int(same.all(axis=0).sum()) for same in there) - 1
    because = (
        f"{others} other(s) in the same place, images at walls among them, outweigh"
        if others
        else "alone it outweighs"
    )
    return fault(
        simulation,
        f"there is no support small enough for particle {p.id[i]} at {_place(p, i)}: "
        f"{because} what it is to hold",
        "a larger physics.eta, particles apart from each other, or physics.density = "
        '"number" where one is much heavier than its neighbour',
        int(p.id[i]),
    )


def _place(particles, i: int) -> str:
    """Where that particle is, in words."""
    return f"({', '.join(f'{x:.6g}' for x in particles.position[:, i])})"
