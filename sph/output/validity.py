"""Checks that the numbers in a checkpoint form a valid state.

Compiled code does not check its arguments, so lengths, signs, magnitudes, IDs and positions are
checked here.
"""

import numpy as np

from sph.neighbours.lists import MAX_PARTICLES

# Far above the skin of any run, which is below 1 (sph.neighbours.search.best_skin).
MOST_SKIN = 10.0
MOST_STEPS = 2**53  # the history holds float64, which counts exactly up to here


def faults_of_shape(checkpoint) -> list[str]:
    """Return descriptions of what is wrong with the shapes and IDs of a checkpoint."""
    particles, config = checkpoint.particles, checkpoint.config
    n, D = particles.id.size, config.problem.dimension
    if not 1 <= n <= MAX_PARTICLES:
        return [f"it has {n} particles, expected 1 to {MAX_PARTICLES}"]
    found = []
    for name, array in _arrays(checkpoint).items():
        expected = (D,) * (array.ndim - 1) + (n,)
        if array.shape != expected:
            found.append(f"{name} has the shape {array.shape}, expected {expected}")
    ids = np.sort(particles.id)
    if ids[0] < 1 or np.any(ids[1:] == ids[:-1]):
        found.append("its particle IDs are not all positive and unique")
    return found


def faults_of_value(checkpoint) -> list[str]:
    """Return descriptions of what is wrong with the values of a checkpoint with valid shapes."""
    found = [f"{name} = {value}" for name, value in _bad_scalars(checkpoint)]
    above, at_least = _bounds(checkpoint)
    for name, array in _arrays(checkpoint).items():
        if not np.all(np.isfinite(array)):
            found.append(f"{name} is not finite everywhere")
        elif name in above and not array.min() > above[name]:
            found.append(f"{name} is not above {above[name]:g} everywhere")
        elif name in at_least and array.min() < at_least[name]:
            found.append(f"{name} is below {at_least[name]:g} somewhere")
    return found or _faults_of_place(checkpoint)


def _bounds(checkpoint) -> tuple[dict[str, float], dict[str, float]]:
    """Return what the values of fields must be above, and at least."""
    fields = checkpoint.particles.fields
    above = {field.name: field.above for field in fields if field.above is not None}
    at_least = {field.name: field.at_least for field in fields if field.at_least is not None}
    return {"list_support": 0.0, **above}, at_least


def _bad_scalars(checkpoint):
    c = checkpoint
    good = {
        "time": np.isfinite(c.time) and c.time >= 0.0,
        "step": 0 <= c.step <= MOST_STEPS,
        "next_step": np.isfinite(c.next_step) and c.next_step > 0.0,
        "list_skin": 0.0 <= c.list_skin <= MOST_SKIN,
    }
    return [(name, getattr(c, name)) for name, fine in good.items() if not fine]


def _faults_of_place(checkpoint) -> list[str]:
    """Return descriptions of positions outside the domain along closed axes.

    Lists are built from positions inside; particles may leave by what the skin allows.
    """
    problem, found = checkpoint.config.problem, []
    moves = (1.0 + checkpoint.list_skin) * checkpoint.list_support
    places = {"list_position": 0.0, "position": moves}
    for axis, (low, high) in enumerate(problem.box):
        if problem.boundaries[axis] == "open":
            continue
        for name, room in places.items():
            x = _arrays(checkpoint)[name][axis]
            if np.any((x < low - room) | (x > high + room)):
                found.append(f"{name} is outside the domain along {'xyz'[axis]}")
    return found


def _arrays(checkpoint) -> dict[str, np.ndarray]:
    lists = {name: getattr(checkpoint, name) for name in ("list_position", "list_support")}
    return checkpoint.particles.arrays() | lists
