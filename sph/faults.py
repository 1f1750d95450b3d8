"""Errors that stop a simulation: what failed, when, at which particle, and what to try."""

import numpy as np

from sph.errors import NumericalError
from sph.neighbours.order import BLOCK

# Squares and cubes of initial values, their sums and inverses must not overflow float64.
LARGEST = 1e100
NEARER_UNITS = (
    f"other code units: expected values from {1.0 / LARGEST:g} to {LARGEST:g}, whose squares and "
    "cubes float64 can hold"
)
NOT_NEGATIVE = "an initial state whose masses, pressures and internal energies are not negative"

FEW_OF_BOX = 0.02  # a smaller share of a closed box that particles extend over is noted

TINY_C = 1e-3  # for smaller physics.C, short steps are intended

SETS = {
    "signal_speed": "signal speed",
    "energy": "u/|du/dt|, the rate of change of internal energy",
    "acceleration": "acceleration",
    "support": "rate of change of the support radius",
    "approach": "approach to a particle that is not a neighbour yet",
}
SETS_FOR_ALL = {
    "growth": "limited by the largest growth per step",
    "end": "limited by the length of the run",
    "checkpoint": "taken from the checkpoint",
    "approach": "limited by relative motions of the length of the box",
}


def fault(simulation, what: str, remedy: str, particle: int) -> NumericalError:
    """Return the error to raise. what: the failure; remedy: what to try; particle: ID, or 0."""
    return NumericalError(
        f"step {simulation.step}, t = {simulation.time:.6g}: {what}.\nTry: {remedy}.", particle
    )


def what_sets(simulation) -> str:
    """Return a description of what limits the next step: criterion and particle."""
    limit = simulation.limit
    if not limit.particle:
        return SETS_FOR_ALL[limit.criterion]
    criterion = _criterion(simulation.scene, limit.criterion)
    return f"limited by particle {limit.particle} ({criterion})"


def _criterion(scene, criterion: str) -> str:
    if criterion in SETS:
        return SETS[criterion]
    return next(filter(None, (part.criterion_words(criterion) for part in scene.all_parts)))


def _holds(scene) -> str:
    """Return what reduces the Courant number below physics.C, as text."""
    by = scene.step_bounds.criterion
    words = (part.held_words(by) for part in scene.all_parts)
    return next(filter(None, words), "the stability of the leapfrog")


def _remedies(scene, trouble: str, held_by: str) -> list[str]:
    return [one for part in scene.all_parts for one in part.remedies(trouble, held_by)]


def smaller_steps(simulation) -> str:
    """Return what to try if steps were too long, given the settings of this run."""
    scene = simulation.scene
    bounds = scene.step_bounds
    remedies = ["a smaller physics.C"]
    if bounds.courant < scene.physics.C:
        remedies = [
            f"a physics.C below {bounds.courant:.3g}, to which {_holds(scene)} already reduces it"
        ]
    remedies += _remedies(scene, "long steps", bounds.criterion)
    if not bounds.energy:
        remedies.append("physics.energy_limit = true")
    return ", ".join(remedies)


def mostly_empty(scene, particles) -> str | None:
    """Return a note that the particles are in a small part of a closed box, or None.

    As in a file whose box has another unit than its positions.
    """
    problem = scene.config.problem
    for axis, boundary in enumerate(problem.boundaries):
        low, high = problem.box[axis]
        share = np.ptp(particles.position[axis]) / (high - low)
        if boundary != "open" and share < FEW_OF_BOX and particles.number > 1:
            return (
                f"the particles extend over {100.0 * share:.2g} % of the domain along "
                f"{'xyz'[axis]}, [{low:g}, {high:g}], which is {boundary} there: check that "
                "positions and box have one unit (problem.domain)"
            )
    return None


def held_courant(scene) -> str | None:
    """Return a note that the run uses a smaller Courant number than physics.C, or None."""
    held, given = scene.step_bounds.courant, scene.physics.C
    return (
        None
        if held == given
        else f"physics.C = {given:g} is reduced to {held:.3g} by {_holds(scene)}"
    )


def longer_steps(simulation) -> str:
    """Return what to try if steps have become too short, by the criterion of the next step."""
    scene, criterion = simulation.scene, simulation.limit.criterion
    if criterion == "energy":
        return "physics.energy_limit = false, which removes the limit u/|du/dt|"
    by_part = _remedies(scene, "short steps", criterion)
    if criterion == "acceleration" and by_part:
        return by_part[0]
    if scene.physics.C < TINY_C:
        return "a larger physics.C"
    if by_part:
        return by_part[0]
    return f"a restart from an earlier checkpoint with {smaller_steps(simulation)}"


def drift_remedy(simulation) -> str:
    """Return what to try if energy drift is too large."""
    remedies = [smaller_steps(simulation), *_remedies(simulation.scene, "drift", "")]
    return (
        f"{', '.join(remedies)}, or a larger physics.max_energy_drift if such a drift is acceptable"
    )


def of_numbers(simulation) -> str:
    """Return what to try if values are not finite; smaller steps can help only after the start."""
    remedy = smaller_steps(simulation) if simulation.step else NEARER_UNITS
    wider = 'run.precision = "double", whose numbers have a wider range, or '
    return wider * simulation.scene.is_single + remedy


def fault_of(simulation, name: str, values, bad, remedy: str) -> NumericalError:
    """Return the error of the first particle with `bad` values, arrays (N,) or (D, N)."""
    p = simulation.particles
    i = int(np.argwhere(bad)[0][-1])
    count = int(bad.any(axis=tuple(range(bad.ndim - 1))).sum())
    return fault(
        simulation,
        f"{name} of particle {p.id[i]} at {_place(p, i)} is {values[..., i]}; "
        f"{count} particle{'s' * (count != 1)} affected",
        remedy,
        int(p.id[i]),
    )


def endless_sum(simulation) -> NumericalError:
    """The error to raise where every particle's value is finite, but not their sum."""
    p, totals = simulation.particles, simulation.totals
    with np.errstate(all="ignore"):  # overflow is what is searched for
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
    """Return the error for a block whose support radii grow without limit."""
    among = simulation.particles.id[block * BLOCK : (block + 1) * BLOCK].tolist()
    return fault(
        simulation,
        f"no support radius contains enough neighbours for one of the particles {among}",
        "a closed domain (problem.boundary), or more particles",
        among[0],
    )


def crowded(simulation) -> NumericalError:
    """Return the error for a particle without a support radius, marked by a density below 0."""
    p = simulation.particles
    i = int(np.argmin(p.density))
    here = p.position[:, i]
    images = zip(*simulation.scene.domain.images, strict=True)
    there = (s[:, None] * p.position + o[:, None] == here[:, None] for s, o in images)
    others = sum(int(same.all(axis=0).sum()) for same in there) - 1
    because = (
        f"{others} other particle(s) or images at the same position have"
        if others
        else "the particle alone has"
    )
    return fault(
        simulation,
        f"no support radius is small enough for particle {p.id[i]} at {_place(p, i)}: "
        f"{because} more mass than the support should contain",
        "a larger physics.eta, positions that do not coincide, or, for very unequal masses, "
        'physics.density = "number"',
        int(p.id[i]),
    )


def _place(particles, i: int) -> str:
    """Return the position of particle i as text."""
    return f"({', '.join(f'{x:.6g}' for x in particles.position[:, i])})"
