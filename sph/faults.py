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

# A larger alpha keeps colliding gas from passing through itself where alpha is small; where it is
# large it is a smaller one that lowers the drift (docs/measurements.md, "Time step and viscosity").
SMALL_ALPHA, LARGE_ALPHA = 1.0, 2.0

TINY_C = 1e-3  # below it steps are short because they are meant to be

# What may hold the Courant number below physics.C.
HOLDS = {
    "signal_speed": "the stability of the leapfrog",
    "viscosity": "physics.alpha",
    "conductivity": "the strength of physics.conductivity",
}

SETS = {
    "signal_speed": "the speed of its signals",
    "energy": "u/|du/dt|, how fast it is heated or cooled",
    "acceleration": "its acceleration",
    "support": "how fast its support changes",
    "viscosity": "physics.alpha and the speed of its signals",
    "conductivity": "the strength of physics.conductivity and the speed of its signals",
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


def what_sets(limit) -> str:
    """The particle and criterion of a step, in words."""
    if not limit.particle:
        return SETS_FOR_ALL[limit.criterion]
    return f"particle {limit.particle} sets it by {SETS[limit.criterion]}"


def smaller_steps(simulation) -> str:
    """What to try where steps were too long, of what can help with this run's settings."""
    bounds = simulation.scene.step_bounds
    held, by = bounds.held
    remedies = ["a smaller physics.C"]
    if held < bounds.courant:
        remedies = [f"a physics.C below {held:.3g}, at which {HOLDS[by]} holds it already"]
    if bounds.alpha > LARGE_ALPHA:
        remedies.append("a smaller physics.alpha")
    elif bounds.alpha < SMALL_ALPHA:
        remedies.append("a larger physics.alpha if particles pass through each other")
    if by == "conductivity":
        remedies.append("a smaller strength of physics.conductivity")
    if not bounds.energy:
        remedies.append("physics.energy_limit = true")
    return ", ".join(remedies)


def held_courant(scene) -> str | None:
    """In words, that the run takes a smaller Courant number than physics.C; None if it does not."""
    held, by = scene.step_bounds.held
    if held == scene.config.physics.C:
        return None
    return f"physics.C = {scene.config.physics.C:g} is held at {held:.3g} by {HOLDS[by]}"


def longer_steps(simulation) -> str:
    """What to try where steps have become too short to go on, by what sets the coming one."""
    scene, criterion = simulation.scene, simulation.limit.criterion
    if criterion == "energy":
        return "physics.energy_limit = false, which leaves fast heating and cooling to eq 32"
    if criterion == "acceleration" and scene.external is not None:
        return _softening(simulation)
    if scene.config.physics.C < TINY_C:
        return "a larger physics.C"
    if criterion in ("viscosity", "conductivity"):
        return f"less of what sets it: {HOLDS[criterion]}"
    return f"a restart from an earlier checkpoint with {smaller_steps(simulation)}"


def drift_remedy(simulation) -> str:
    """What to try where total energy has drifted too far."""
    remedies = [smaller_steps(simulation)]
    if simulation.scene.external is not None:
        remedies.append(_softening(simulation))
    return f"{', '.join(remedies)}, or a larger physics.max_energy_drift if that is good enough"


def of_numbers(simulation) -> str:
    """What to try where values are not finite: the start took no step that could be too long."""
    return smaller_steps(simulation) if simulation.step else NEARER_UNITS


def _softening(simulation) -> str:
    softened = getattr(simulation.scene.external, "softening", 0.0) > 0.0
    return f"a {'larger ' * softened}softening of physics.external"


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
            remedy = f"{_softening(simulation)}, or no particle where its mass is"
        elif not np.isfinite(totals.kinetic_energy):
            name, each = "kinetic energy", (p.velocity**2).sum(axis=0)
            remedy = of_numbers(simulation)
        elif not np.isfinite(totals.internal_energy):
            name, each = "internal energy", p.internal_energy
            remedy = of_numbers(simulation)
        else:
            name, each = "rate of energy", p.energy_rate
            remedy = of_numbers(simulation)
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
