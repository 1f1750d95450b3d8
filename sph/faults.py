"""Errors of a simulation that cannot go on: what broke and when, which particle, what to try."""

import numpy as np

from sph.errors import NumericalError
from sph.neighbours.order import BLOCK

# Squares and cubes of what a run begins with, their sums and inverses have to be numbers too.
LARGEST = 1e100
NEARER_UNITS = (
    f"code units in which it is nearer to 1: outside {1.0 / LARGEST:g} to {LARGEST:g} its square "
    "and cube are no numbers any more"
)

TINY_C = 1e-3  # below it steps are short because they are meant to be

SETS = {
    "signal_speed": "the speed of its signals",
    "energy": "u/|du/dt|, how fast it is heated or cooled",
    "acceleration": "its acceleration",
    "support": "how fast its support changes",
    "approach": "its approach to gas that is not its neighbour yet",
}
SETS_FOR_ALL = {
    "growth": "it may not grow faster",
    "end": "it is as long as the run",
    "checkpoint": "it is that of the checkpoint",
    "approach": "particles may not move against each other by more than the box is long",
}


def fault(simulation, what: str, remedy: str, particle: int) -> NumericalError:
    """The error to raise: what broke and when, what to try, and the ID of a particle (0: none)."""
    return NumericalError(
        f"step {simulation.step}, t = {simulation.time:.6g}: {what}.\nTry: {remedy}.", particle
    )


def what_sets(simulation) -> str:
    """The particle and criterion of the coming step, in words."""
    limit = simulation.limit
    if not limit.particle:
        return SETS_FOR_ALL[limit.criterion]
    return f"particle {limit.particle} sets it by {_criterion(simulation.scene, limit.criterion)}"


def _criterion(scene, criterion: str) -> str:
    if criterion in SETS:
        return SETS[criterion]
    return next(filter(None, (part.criterion_words(criterion) for part in scene.all_parts)))


def _holds(scene) -> str:
    """What holds the Courant number below physics.C, in words."""
    by = scene.step_bounds.criterion
    words = (part.held_words(by) for part in scene.all_parts)
    return next(filter(None, words), "the stability of the leapfrog")


def _remedies(scene, trouble: str, held_by: str) -> list[str]:
    return [one for part in scene.all_parts for one in part.remedies(trouble, held_by)]


def smaller_steps(simulation) -> str:
    """What to try where steps were too long, of what can help with this run's settings."""
    scene = simulation.scene
    bounds = scene.step_bounds
    remedies = ["a smaller physics.C"]
    if bounds.courant < scene.physics.C:
        remedies = [
            f"a physics.C below {bounds.courant:.3g}, at which {_holds(scene)} holds it already"
        ]
    remedies += _remedies(scene, "long steps", bounds.criterion)
    if not bounds.energy:
        remedies.append("physics.energy_limit = true")
    return ", ".join(remedies)


def held_courant(scene) -> str | None:
    """In words, that the run takes a smaller Courant number than physics.C; None if it does not."""
    held, given = scene.step_bounds.courant, scene.physics.C
    return (
        None if held == given else f"physics.C = {given:g} is held at {held:.3g} by {_holds(scene)}"
    )


def longer_steps(simulation) -> str:
    """What to try where steps have become too short to go on, by what sets the coming one."""
    scene, criterion = simulation.scene, simulation.limit.criterion
    if criterion == "energy":
        return "physics.energy_limit = false, which leaves fast changes of internal energy to eq 32"
    by_part = _remedies(scene, "short steps", criterion)
    if criterion == "acceleration" and by_part:
        return by_part[0]
    if scene.physics.C < TINY_C:
        return "a larger physics.C"
    if by_part:
        return by_part[0]
    return f"a restart from an earlier checkpoint with {smaller_steps(simulation)}"


def drift_remedy(simulation) -> str:
    """What to try where total energy has drifted too far."""
    remedies = [smaller_steps(simulation), *_remedies(simulation.scene, "drift", "")]
    return f"{', '.join(remedies)}, or a larger physics.max_energy_drift if that is good enough"


def of_numbers(simulation) -> str:
    """What to try where values are not finite: the start took no step that could be too long."""
    return smaller_steps(simulation) if simulation.step else NEARER_UNITS


def fault_of(simulation, name: str, values, bad, remedy: str) -> NumericalError:
    """The error of the first particle whose `values` are `bad`, arrays (N,) or (D, N)."""
    p = simulation.particles
    i = int(np.argwhere(bad)[0][-1])
    count = int(bad.any(axis=tuple(range(bad.ndim - 1))).sum())
    return fault(
        simulation,
        f"{name} of particle {p.id[i]} at {_place(p, i)} is {values[..., i]}; "
        f"{count} particles affected",
        remedy,
        int(p.id[i]),
    )


def endless_sum(simulation) -> NumericalError:
    """The error to raise where every particle's value is finite, but not their sum."""
    p, totals = simulation.particles, simulation.totals
    with np.errstate(all="ignore"):  # the very numbers that are looked for
        remedy = of_numbers(simulation)
        if found := _endless_energy(simulation):
            name, each, remedy = found
        elif not np.isfinite(totals.kinetic_energy):
            name, each = "kinetic energy", (p.velocity**2).sum(axis=0)
        elif not np.isfinite(totals.internal_energy):
            name, each = "internal energy", p.internal_energy
        else:
            name, each = "rate of energy", p.energy_rate
        i = int(np.argmax(np.abs(each)))
    return fault(
        simulation,
        f"the total {name} is not finite; the largest is that of particle {p.id[i]} at "
        f"{_place(p, i)}",
        remedy,
        int(p.id[i]),
    )


def _endless_energy(simulation) -> tuple[str, np.ndarray, str] | None:
    """Name, values (N,) and remedy of a part's energy whose sum is not finite."""
    for part in simulation.scene.all_parts:
        for column, each in part.energies(simulation.particles).items():
            if not np.isfinite(simulation.totals.energies[column]):
                found = part.remedies("endless energy", "")
                remedy = ", ".join(found) or of_numbers(simulation)
                return column.replace("_", " "), each, remedy
    return None


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
