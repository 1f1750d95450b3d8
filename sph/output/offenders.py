"""The file offenders.h5 of a failed run: the particle that failed, and its neighbours."""

from pathlib import Path

import numpy as np

from sph.domain import Domain
from sph.errors import FileError
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import PART, Checkpoint
from sph.state import State

# Most lines of the table, so that the message fits one screen.
SHOWN = 8


def leave(path: Path, state: Checkpoint, identity: int) -> str:
    """Write the particle with ID `identity` and its neighbours to `path`; return a table of them.

    The file is a checkpoint of these particles only, in order of distance. If no particle has that
    ID, nothing is written and the text is empty.
    """
    found = np.flatnonzero(state.particles.id == identity)
    if not found.size:
        return ""
    indices, distance = _neighbourhood(state, int(found[0]))
    try:
        checkpoints.write(path, _part(state, indices))
        where = f"These particles are in {path}, which has the format of a checkpoint.\n"
    except FileError as error:  # the error of the run must be shown also if the disk is full
        where = f"These particles could not be written: {error}\n"
    return _table(state.particles, indices, distance) + where


def _neighbourhood(state: Checkpoint, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Return indices of i and its neighbours, nearest first, and their distances.

    Neighbours are particles closer to i than the larger of both support radii.
    """
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
    return Checkpoint(
        particles=state.particles.subset(indices),
        time=state.time,
        step=state.step,
        next_step=state.next_step,
        list_position=np.ascontiguousarray(state.list_position[:, indices]),
        list_support=state.list_support[indices],
        list_skin=state.list_skin,
        config=state.config,
        lineage=(*state.lineage, PART),
        budget=state.budget,
    )


def _table(particles: State, indices: np.ndarray, distance: np.ndarray) -> str:
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
        return "\n".join([*lines, "The neighbours of this particle are not known yet."]) + "\n"
    more = indices.size - SHOWN
    lines.append(f"... and {more} more neighbours." if more > 0 else "(no further neighbours)")
    return "\n".join(lines) + "\n"
