"""Scenes of gas composed of regions with their own density, pressure and velocity."""

from functools import cached_property
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from sph.errors import ConfigError
from sph.problems import _relax, base
from sph.problems._region import Path, Region, Value, formula
from sph.problems.base import Fault
from sph.problems.support import areas, bodies
from sph.problems.support.expressions import Expression

_SHARED = base.Problem.model_fields


class Gas(NamedTuple):
    """What the regions say of points."""

    owner: np.ndarray  # (M,) last region that gives a density there; -1 for none
    values: dict[Path, np.ndarray]  # (M,) by key: density, pressure, velocity
    faults: list[Fault]


class Placed(NamedTuple):
    """Particles before they have gas."""

    position: np.ndarray  # (D, N)
    mass: np.ndarray | float  # (N,), or the volume by which the density is multiplied
    members: np.ndarray | None = None  # (R, N) which belong to each region; None: those inside
    relaxation: base.Relaxation | None = None


class Problem(_relax.Relaxable):
    """Gas in regions, of which later ones cover earlier ones. No exact solution is known."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,
        "time.end": 0.5,
        "output.interval": 0.1,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-3, "error of the leapfrog in any flow"),
    }
    profiled: ClassVar = False

    name: Literal["regions"] = "regions"
    dimension: Annotated[int, _SHARED["dimension"]] = 2
    n: Annotated[int, _SHARED["n"]] = 1024
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[0.0, 1.0]
    )
    boundary: Annotated[base.Boundary | list[base.Boundary], _SHARED["boundary"]] = "periodic"
    lattice: Literal["cubic", "hexagonal", "bcc", "fcc"] = Field(
        default="cubic",
        description="lattice of the particles; hexagonal in 2-D, bcc and fcc in 3-D",
    )
    masses: Literal["equal", "equal_spacing"] = Field(
        default="equal_spacing",
        description='"equal_spacing": equal spacings, with masses that follow the density; '
        '"equal": equal masses, with spacings that follow the density; without problem.relax each '
        "region then has a lattice of its own, density must be a number, and masses are equal to "
        "a few per cent",
    )
    region: list[Region] = Field(
        default=[
            Region(shape="everywhere", density=1.0, pressure=1.0),
            Region(shape="disc", centre=[0.3, 0.45], radius=0.15, density=4.0, velocity=[1.0, 0.0]),
            Region(
                shape="disc", centre=[0.7, 0.55], radius=0.15, density=4.0, velocity=[-1.0, 0.0]
            ),
        ],
        min_length=1,
        description="the regions, one table [[problem.region]] each; later ones cover earlier ones",
    )

    @model_validator(mode="after")
    def _regions_fit(self):
        if self.box.shape != (self.dimension, 2):
            return self  # reported by the configuration
        for check in (self._misfits, self._unplaceable, self._wrong_values):
            if faults := check():
                raise base.refused(faults)
        return self

    def _misfits(self) -> list[Fault]:
        """Return faults of single keys."""
        found = [
            Fault(("region", i, *fault.path), fault.text)
            for i, region in enumerate(self.region)
            for fault in region.faults(self.dimension)
        ]
        if self.lattice not in bodies.LATTICES[self.dimension]:
            listed = ", ".join(f'"{name}"' for name in bodies.LATTICES[self.dimension])
            text = f'= "{self.lattice}": expected one of {listed} in {self.dimension}-D'
            found.append(Fault(("lattice",), text))
        return found

    def _unplaceable(self) -> list[Fault]:
        """Return faults of keys that do not go together."""
        if self.relax is not None:
            return []
        return [
            Fault(
                ("region", i, "density"),
                f'= "{region.density}": expected a number for masses = "equal". Try: masses = '
                '"equal_spacing", or [problem.relax]',
            )
            for i, region in enumerate(self.region)
            if self.masses == "equal" and isinstance(region.density, str)
        ]

    def _wrong_values(self) -> list[Fault]:
        """Return regions without particles, and faults of the values at a lattice."""
        position, cell = self._even()
        if not position.size:
            return [Fault(("region",), "holds no particle: expected regions inside the domain")]
        volume = float(np.prod(self.box[:, 1] - self.box[:, 0]))
        if self.relax is not None and cell * position.shape[1] < 0.999 * volume:
            text = 'needs gas everywhere. Try: a first region with shape = "everywhere"'
            return [Fault(("relax",), text)]
        return self._gas(position).faults

    # --- fields

    @cached_property
    def _areas(self) -> tuple[areas.Area, ...]:
        return tuple(region.area(self.box) for region in self.region)

    def _even(self) -> tuple[np.ndarray, float]:
        """Positions (D, N) of equal spacing, and the volume of a particle."""
        return areas.covered(self.box, self.n, self.lattice, self._is_gas)

    def _is_gas(self, position: np.ndarray) -> np.ndarray:
        return self._owner(self._members(position)) >= 0

    def _members(self, position: np.ndarray) -> np.ndarray:
        """Return which of the positions (D, M) are in each of R regions, (R, M)."""
        found = np.empty((len(self.region), position.shape[1]), dtype=bool)
        for i, area in enumerate(self._areas):
            found[i] = area.contains(self._images(i, position))
        return found

    def _images(self, i: int, position: np.ndarray) -> np.ndarray:
        """Return the periodic images of positions (D, M) that are nearest to region i."""
        area = self._areas[i]
        if isinstance(area, areas.HalfSpace):
            return position
        return areas.image(position, area, self.box, self.boundaries)

    def _owner(self, members: np.ndarray) -> np.ndarray:
        """Return the last region (M,) that gives a density, -1 for none, for members (R, M)."""
        owner = np.full(members.shape[1], -1)
        for i, region in enumerate(self.region):
            if region.density is not None:
                owner[members[i]] = i
        return owner

    def _gas(self, position: np.ndarray, members: np.ndarray | None = None) -> Gas:
        """Return the gas at positions (D, M), and faults of regions that state it wrongly.

        members: (R, M), which particles belong to each region; those inside if not given.
        """
        m = position.shape[1]
        members = self._members(position) if members is None else members
        keys: list[Path] = [
            ("density",),
            ("pressure",),
            *(("velocity", i) for i in range(self.dimension)),
        ]
        values = {key: np.full(m, np.nan if len(key) == 1 else 0.0) for key in keys}
        faults = []
        for i, region in enumerate(self.region):
            inside = members[i]
            if not inside.any():
                text = "holds no particle: it is outside the domain, or smaller than the spacing"
                faults.append(Fault(("region", i), text))
            for path, value in region.values():
                found = self._evaluated(i, value, position[:, inside])
                if wrong := _wrong(path, value, found, position[:, inside]):
                    faults.append(Fault(("region", i, *path), wrong))
                values[path][inside] = found
        owner = self._owner(members)
        lacking = (owner >= 0) & ~np.isfinite(values["pressure",])
        if lacking.any() and not faults:
            i = int(owner[np.argmax(lacking)])
            text = "is missing: expected a number or an expression here, or in an earlier region"
            faults.append(Fault(("region", i, "pressure"), text))
        return Gas(owner, values, faults)

    def _evaluated(self, i: int, value: Value, position: np.ndarray) -> np.ndarray:
        """Return the values (M,) of a key of region i at positions (D, M)."""
        found = formula(value, self.dimension)
        if not isinstance(found, Expression):
            return np.full(position.shape[1], found)
        centre = self._areas[i].extent.mean(axis=1)[:, None]
        r = np.sqrt(((self._images(i, position) - centre) ** 2).sum(axis=0))
        return found({**dict(zip("xyz", position, strict=False)), "r": r})

    def _density(self, position: np.ndarray, members: np.ndarray | None = None) -> np.ndarray:
        """Return the density (M,) at positions (D, M), 0 where there is no gas."""
        gas = self._gas(position, members)
        return np.where(gas.owner >= 0, gas.values["density",], 0.0)

    # --- particles

    def fills_box(self, eos) -> bool:
        """Return False: regions may leave a vacuum, or open one as they move."""
        return False

    def initial(self, eos) -> base.InitialState:
        """Return the particles. Raises ConfigError for values that are wrong at a particle."""
        position, mass, members, relaxation = self._placed()
        gas = self._gas(position, members)
        if faults := [one for one in gas.faults if len(one.path) > 2]:
            i, key, *_ = faults[0].path[1:]
            raise ConfigError(f"problem.region[{i}].{key} {faults[0].text}")
        density = gas.values["density",]
        velocity = np.array([gas.values["velocity", axis] for axis in range(self.dimension)])
        energy = eos.internal_energy(density, gas.values["pressure",])
        found = density * mass if isinstance(mass, float) else mass
        others = {"density": density}
        return base.InitialState(position, velocity, found, energy, others, relaxation)

    def _placed(self) -> Placed:
        position, cell = self._even()
        if self.masses == "equal":
            return self._equal_masses()
        placed = self.on_glass(position)
        return Placed(placed.position, cell, relaxation=placed.relaxation)

    def _equal_masses(self) -> Placed:
        position, cell = self._even()
        if self.relax is None:
            each = float(self._density(position).sum() * cell / position.shape[1])
            return self._separate_lattices(each)
        start, each = areas.sampled(self.box, position.shape[1], self._density, self.relax.seed)
        # a particle that crosses an edge keeps its volume, else the regions would change in size
        members = self._members(start)
        found = self.relaxed(start, lambda x: each / self._density(x, members))
        mass = np.full(start.shape[1], each)
        return Placed(found.position, mass, members, found.relaxation)

    def _separate_lattices(self, each: float) -> Placed:
        """Return a lattice for each region that gives a density, with masses near `each`."""
        volume = float(np.prod(self.box[:, 1] - self.box[:, 0]))
        positions, masses = [], []
        for i, region in enumerate(self.region):
            if not isinstance(region.density, float | int):
                continue
            n = region.density * volume / each
            extent = self._areas[i].extent
            position, cell = areas.within(self.box, extent, n, self.lattice)
            position = position[:, self._owner(self._members(position)) == i]
            positions.append(position)
            masses.append(np.full(position.shape[1], region.density * cell))
        return Placed(np.hstack(positions), np.concatenate(masses))


def _wrong(path: Path, value: Value, found: np.ndarray, position: np.ndarray) -> str | None:
    """Return what is wrong with the value of a key, `found` (M,) at positions (D, M), or None."""
    fine, expected = np.isfinite(found), "a finite number"
    if path == ("density",):
        fine, expected = fine & (found > 0.0), "a number above 0"
    if path == ("pressure",):
        fine, expected = fine & (found >= 0.0), "a number of at least 0"
    if fine.all():
        return None
    if not isinstance(value, str):
        return f"= {value:g}: expected {expected}"
    first = int(np.argmin(fine))
    where = ", ".join(f"{x:.6g}" for x in position[:, first])
    return f'= "{value}": the value is {found[first]:g} at ({where}); expected {expected}'
