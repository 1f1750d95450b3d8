"""The state of the gas: named arrays, one entry a particle."""

from dataclasses import dataclass, fields

import numpy as np


@dataclass
class Particles:
    """N particles in D dimensions, all float64 but the IDs, in code units.

    The memory order is that of the neighbour blocks and changes when they are rebuilt;
    `id` (from 1) is what stays with a particle.
    """

    id: np.ndarray  # (N,) int64
    mass: np.ndarray  # (N,)
    position: np.ndarray  # (D, N)
    velocity: np.ndarray  # (D, N)
    internal_energy: np.ndarray  # (N,) u, per unit mass
    support: np.ndarray  # (N,) H, the radius at which the kernel ends
    density: np.ndarray  # (N,)
    omega: np.ndarray  # (N,) Omega, the grad-h term (eq 8)
    acceleration: np.ndarray  # (D, N)
    energy_rate: np.ndarray  # (N,) du/dt
    alpha: np.ndarray | None = None  # (N,) viscosity coefficient, where it evolves
    alpha_rate: np.ndarray | None = None  # (N,)
    pressure: np.ndarray | None = None  # (N,) where the scheme sums it over neighbours

    @classmethod
    def at_start(cls, position, velocity, mass, internal_energy, alpha: float | None = None):
        """Particles with IDs 1 … N in the order given and nothing computed yet (zeros)."""
        n = position.shape[1]
        evolves = alpha is not None

        def contiguous(array):
            return np.array(array, dtype=np.float64, order="C")

        return cls(
            id=np.arange(1, n + 1, dtype=np.int64),
            mass=contiguous(mass),
            position=contiguous(position),
            velocity=contiguous(velocity),
            internal_energy=contiguous(internal_energy),
            support=np.zeros(n),
            density=np.zeros(n),
            omega=np.zeros(n),
            acceleration=np.zeros(position.shape),
            energy_rate=np.zeros(n),
            alpha=np.full(n, alpha) if evolves else None,
            alpha_rate=np.zeros(n) if evolves else None,
        )

    @property
    def number(self) -> int:
        return self.mass.size

    @property
    def dimension(self) -> int:
        return self.position.shape[0]

    def pressure_by(self, eos) -> np.ndarray:
        """(N,) the pressure the scheme summed or, where it sums none, that of `eos`."""
        if self.pressure is not None:
            return self.pressure
        return eos.pressure(self.density, self.internal_energy)

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays that this scene has, by name."""
        named = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: array for name, array in named.items() if array is not None}

    def by_id(self) -> "Particles":
        """A copy ordered by ID, to compare two runs or to plot."""
        order = np.argsort(self.id, kind="stable")
        arrays = self.arrays().items()
        return Particles(**{name: np.ascontiguousarray(a[..., order]) for name, a in arrays})
