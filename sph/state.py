"""The state: named arrays (fields) with one entry per particle.

The part that owns a field declares it once. The declaration determines the sign changes at mirrors,
the memory order, the contents of checkpoints, and the public names and units.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sph.threads import ALONE, CHUNK, Team


class Public(NamedTuple):
    """A field in the public part of a checkpoint: name, exponents of its unit, description."""

    name: str
    length: int
    mass: int
    time: int
    scale_factor: int  # cosmological, for programs that ask
    description: str


class Field(NamedTuple):
    """The declaration of an array.

    rank: 0 for a scalar (N,), 1 for a vector (D, N), 2 for a tensor (D, D, N). A reflecting wall
    changes the sign of a vector's component normal to the wall, and of a tensor's components with
    one normal and one tangential index. A tensor has no public name: the directions that the scene
    lacks are known to the formulation alone (`Formulation.derived`).
    """

    name: str
    rank: int = 0
    stored: bool = True  # in checkpoints; False for a work array
    remade: bool = False  # a restart can compute the field if a checkpoint does not contain it
    above: float | None = None  # bounds of a physical value
    at_least: float | None = None
    integer: bool = False  # int64; only the ID
    public: Public | None = None

    def shape(self, dimension: int, number: int) -> tuple[int, ...]:
        return (dimension,) * self.rank + (number,)


# The fields of every formulation.
COMMON = (
    Field(
        "id",
        integer=True,
        public=Public("ParticleIDs", 0, 0, 0, 0, "Identification number, from 1"),
    ),
    Field("mass", above=0.0, public=Public("Masses", 0, 1, 0, 0, "Mass")),
    Field(
        "position",
        rank=1,
        public=Public(
            "Coordinates", 1, 0, 0, 1, "Position from the corner of the box; add Header/Origin"
        ),
    ),
    Field("velocity", rank=1, public=Public("Velocities", 1, 0, -1, 0, "Velocity")),
    Field(
        "internal_energy",
        at_least=0.0,
        public=Public("InternalEnergies", 2, 0, -2, -2, "Internal energy per unit mass"),
    ),
    Field(
        "support",
        above=0.0,
        public=Public(
            "SmoothingLengths", 1, 0, 0, 1, "Smoothing length h; the kernel ends at H = (H/h) h"
        ),
    ),
    Field(
        "density",
        above=0.0,
        public=Public("Densities", -3, 1, 0, -3, "Density, per D-dimensional volume"),
    ),
    Field("acceleration", rank=1),
    Field("energy_rate"),
    Field("predicted_velocity", rank=1, stored=False),  # at the full step (eqs 4 and 5)
    Field("predicted_energy", stored=False),
    Field("support_before", stored=False),  # support radius of the last step
    Field("sound_speed", stored=False),
    Field("signal_speed", stored=False),  # the largest v_sig of the particle's pairs (eq 32)
)


class State:
    """N particles in D dimensions: one attribute per field, float64 except IDs, in code units.

    Particles are stored in the order of the neighbour blocks. The order changes when the blocks are
    rebuilt; `id` (from 1) identifies a particle during the whole run.
    """

    def __init__(self, fields: Iterable[Field], arrays: Mapping[str, np.ndarray]):
        """Create a state with those `fields` that `arrays` contains, in the order of `fields`.

        The arrays are not copied and must be contiguous.
        """
        self.fields = tuple(field for field in fields if field.name in arrays)
        for field in self.fields:
            assert arrays[field.name].flags.c_contiguous, field.name  # for `rows`
            setattr(self, field.name, arrays[field.name])

    if TYPE_CHECKING:  # an attribute for each field; parts declare the fields

        def __getattr__(self, name: str) -> np.ndarray: ...
        def __setattr__(self, name: str, value: Any) -> None: ...

    @classmethod
    def at_start(
        cls, fields: Iterable[Field], position, velocity, mass, internal_energy,
        others: Mapping[str, np.ndarray] = MappingProxyType({}),
    ) -> "State":  # fmt: skip
        """Return particles with IDs 1 … N in the given order; all other fields are zero.

        others: values of further fields by name; ignored for fields that the scene lacks.
        """
        dimension, n = position.shape
        given = {
            "position": position, "velocity": velocity, "mass": mass,
            "internal_energy": internal_energy, **others,
        }  # fmt: skip
        arrays = {"id": np.arange(1, n + 1, dtype=np.int64)}
        for field in fields:
            if field.name in given:
                arrays[field.name] = np.array(given[field.name], dtype=np.float64, order="C")
            elif not field.integer:
                arrays[field.name] = np.zeros(field.shape(dimension, n))
        return cls(fields, arrays)

    @property
    def number(self) -> int:
        """N."""
        return self.mass.size

    @property
    def dimension(self) -> int:
        """D."""
        return self.position.shape[0]

    def get(self, name: str) -> np.ndarray | None:
        """Return the array of that name, or None if no part of the scene declares it."""
        return self.__dict__.get(name)

    def rows(self, name: str) -> np.ndarray:
        """Return a view of the array of that name, (rows, N): one row for a scalar."""
        return getattr(self, name).reshape(-1, self.number)

    def total(self, values: np.ndarray, team: Team = ALONE) -> float:
        """Return the sum of mass times `values`, (N,)."""
        # A chunk is so short that BLAS does not share it between threads of its own, whose number
        # depends on the machine.
        return sum(team.chunks(lambda a, b: float(self.mass[a:b] @ values[a:b]), self.number))

    def declare(self, fields: Iterable[Field]) -> list[str]:
        """Keep exactly these fields; add missing fields as zeros and return their names."""
        fields, known = tuple(fields), {field.name for field in self.fields}
        for name in known - {field.name for field in fields}:
            delattr(self, name)
        new = [field for field in fields if field.name not in known]
        for field in new:
            setattr(self, field.name, np.zeros(field.shape(self.dimension, self.number)))
        self.fields = fields
        return [field.name for field in new]

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the arrays that a checkpoint stores, by name."""
        return {field.name: getattr(self, field.name) for field in self.fields if field.stored}

    def swap(self, first: str, second: str) -> None:
        """Exchange the arrays of two fields."""
        arrays = getattr(self, first), getattr(self, second)
        setattr(self, second, arrays[0])
        setattr(self, first, arrays[1])

    def subset(self, indices: np.ndarray) -> "State":
        """Return a copy of the stored fields for the particles `indices`, in that order."""
        arrays = self.arrays().items()
        chosen = {name: np.ascontiguousarray(array[..., indices]) for name, array in arrays}
        return State(self.fields, chosen)

    def by_id(self) -> "State":
        """Return a copy in the order of IDs, for comparing runs and for plots."""
        return self.subset(np.argsort(self.id, kind="stable"))

    def reorder(self, order: np.ndarray, names: Iterable[str], team: Team = ALONE) -> None:
        """Reorder the arrays `names` in memory by `order`, (N,) indices."""
        for name in names:
            old = getattr(self, name)
            if team.threads == 1 or self.number <= CHUNK:
                new = old.take(order, axis=-1)
            else:
                new = np.empty_like(old)
                rows = old.reshape(-1, self.number), new.reshape(-1, self.number)
                team.run(_take, self.number, order, *rows, smallest=CHUNK)
            setattr(self, name, new)


def _take(first: int, last: int, order: np.ndarray, old: np.ndarray, new: np.ndarray) -> None:
    """Set new[:, first:last] to old[:, order[first:last]]; both (rows, N)."""
    for source, target in zip(old, new, strict=True):
        # straight to the target, which NumPy does unless it must raise an error for an index
        source.take(order[first:last], out=target[first:last], mode="clip")
