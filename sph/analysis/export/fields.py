"""The fields of a checkpoint as exports hold them: particles in the order of their IDs."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from sph import kernels
from sph.output.checkpoint import Checkpoint
from sph.output.layout import frame_of, in_frame
from sph.state import Public

# Names of what a formulation derives from its fields, by their public names.
DERIVED = {"Pressures": "pressure", "StressTensors": "stress"}


class Exported(NamedTuple):
    """A field: name, array (N,), (N, D) or (N, 3, 3), and its public declaration."""

    name: str
    values: np.ndarray
    public: Public


def position(checkpoint: Checkpoint) -> np.ndarray:
    """Return (N, D) positions in the coordinates of the run, inside periodic boxes."""
    particles, problem = checkpoint.particles, checkpoint.config.problem
    frame = frame_of(problem, particles.position)
    D = particles.dimension
    inside = in_frame(frame, problem.boundaries, particles.position)[:, :D] + frame.origin[:D]
    return inside[_order(checkpoint)]


def of(checkpoint: Checkpoint) -> Iterator[Exported]:
    """Yield the public fields except the position: `h` is the smoothing length."""
    particles, order = checkpoint.particles, _order(checkpoint)
    ratio = kernels.support_ratio(checkpoint.config.physics.kernel_model(), particles.dimension)
    for field in particles.fields:
        if field.public is None or not field.stored or field.name == "position":
            continue
        values = np.moveaxis(getattr(particles, field.name), -1, 0)[order]
        if field.name == "support":
            yield Exported("h", values / ratio, field.public)
        else:
            yield Exported(field.name, values, field.public)
    for public, array in checkpoint.scene.formulation.derived(particles):
        name = DERIVED.get(public.name, public.name.lower())
        yield Exported(name, np.moveaxis(array, -1, 0)[order], public)


def unit_of(config, public: Public) -> str:
    """Return the unit of a field: in code units, or in the physical units of the run."""
    powers = (public.length, public.mass, public.time)
    if config.units.are_given:
        return config.units.symbol(*powers)
    named = (("mass", powers[1]), ("length", powers[0]), ("time", powers[2]))
    return " ".join(name + (f"^{power}" if power != 1 else "") for name, power in named if power)


def _order(checkpoint: Checkpoint) -> np.ndarray:
    return np.argsort(checkpoint.particles.id)
