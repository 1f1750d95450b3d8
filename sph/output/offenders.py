"""What a run that failed leaves of the place where it did: a particle and its neighbours."""

from pathlib import Path

import numpy as np

from sph.domain import Domain
from sph.errors import FileError
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import PART, Checkpoint
from sph.particles import Particles

# Lines of the table: with the words around it, one screen.
SHOWN = 8


def leave(path: Path, state: Checkpoint, identity: int) -> str:
    """Write the particle of that ID and its neighbours to `path`; returns them in words.

    The file is a checkpoint like any other, of those particles alone, in order of distance. Nothing
    is written, and the words are empty, where no particle has that ID.
    """
    found = np.flatnonzero(state.particles.id == identity)
    if not found.size:
        return ""
    indices, distance = _neighbourhood(state, int(found[0]))
    try:
        checkpoints.write(path, _part(state, indices))
        where = f"They are in {path}, in the layout of a checkpoint.\n"
    except FileError as error:  # a full disk must not hide what went wrong
        where = f"They could not be written: {error}\n"
    return _table(state.particles, indices, distance) + where


def _neighbourhood(state: Checkpoint, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices of i and all within a support of it or it of them, nearest first; distances."""
    particles, problem = state.particles, state.config.problem
    here = particles.position[:, i, None]
    squared = np.full(particles.number, np.inf)
    for sign, offset in zip(*Domain(problem.box, problem.boundaries).images, strict=True):
        image = sign[:, None] * particles.position + offset[:, None]
        squared = np.fmin(squared, ((image - here) ** 2).sum(axis=0))
    squared[i] = 0.0
    distance = np.sqrt(squared)
    near = distance < np.fmax(particles.support, particles.support[i])
    indices = np.flatnonzero(near)
    indices = indices[np.lexsort((particles.id[indices], distance[indices]))]
    indices = np.concatenate([[i], indices[indices != i]])
    return indices, distance[indices]


def _part(state: Checkpoint, indices: np.ndarray) -> Checkpoint:
    arrays = {
        name: np.ascontiguousarray(array[..., indices])
        for name, array in state.particles.arrays().items()
    }
    return Checkpoint(
        particles=Particles(**arrays),
        time=state.time,
        step=state.step,
        next_step=state.next_step,
        list_position=np.ascontiguousarray(state.list_position[:, indices]),
        list_support=state.list_support[indices],
        list_skin=state.list_skin,
        config=state.config,
        lineage=(*state.lineage, PART),
    )


def _table(particles: Particles, indices: np.ndarray, distance: np.ndarray) -> str:
    names = ("ID", "distance", "support", "density", "energy", "du/dt", "speed", "|dv/dt|")
    lines = ["".join(f"{name:>11}" for name in names)]
    for i, r in zip(indices[:SHOWN], distance, strict=False):
        values = (
            r, particles.support[i], particles.density[i], particles.internal_energy[i],
            particles.energy_rate[i], np.linalg.norm(particles.velocity[:, i]),
            np.linalg.norm(particles.acceleration[:, i]),
        )  # fmt: skip
        lines.append(f"{particles.id[i]:>11}" + "".join(f"{value:>11.3g}" for value in values))
    if not particles.support[indices[0]] > 0.0:
        return "\n".join([*lines, "Its neighbours are not known yet."]) + "\n"
    more = indices.size - SHOWN
    lines.append(f"and {more} more neighbours." if more > 0 else "These are all its neighbours.")
    return "\n".join(lines) + "\n"
