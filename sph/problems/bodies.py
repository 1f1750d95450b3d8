"""Several solid or liquid bodies that the configuration describes, one table for each.

Bodies may differ in shape, lattice, material and velocity. They act on each other where their
particles are within each other's support.
"""

import difflib
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from sph import quantity as units
from sph.errors import ConfigError
from sph.problems import base
from sph.problems._body import Body
from sph.problems.base import Fault
from sph.problems.support import bodies as placement
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields


class Matter(NamedTuple):
    """The initial matter of a body."""

    material: int  # number in physics.materials, from 0
    density: float
    internal_energy: float


class Problem(base.Problem):
    """Bodies of one or several materials: collisions, impacts, loads."""

    defaults: ClassVar = {
        "physics.formulation": "continuum",
        "physics.eos": {"name": "tait", "rho_0": 1.0, "c_0": 1.0},
        "physics.strength": {"name": "elastic", "shear_modulus": 0.2},
        "time.end": 4.0,
        "output.interval": 0.5,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-3, "errors of the time step; measured: 2.1e-5 in an impact"),
        "momentum_change": base.Limit(1e-12, "pair forces are equal and opposite: only round-off"),
    }
    profiled: ClassVar = False
    quantities: ClassVar = {
        "body_*_velocity_*": Quantity(
            "velocity of the centre of mass of a body, by its number from 0, along an axis",
            units.VELOCITY,
        ),
    }

    name: Literal["bodies"] = "bodies"
    dimension: Annotated[int, _SHARED["dimension"]] = 2
    n: int = Field(
        default=1000,
        ge=2,
        le=100_000_000,
        description="number of particles of all bodies whose spacing is not given",
    )
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[-3.0, 3.0]
    )
    boundary: Annotated[base.Boundary | list[base.Boundary], _SHARED["boundary"]] = "open"
    body: list[Body] = Field(
        default=[
            Body(shape="disc", centre=[-1.1, 0.0], radius=1.0, velocity=[0.05, 0.0]),
            Body(shape="disc", centre=[1.1, 0.0], radius=1.0, velocity=[-0.05, 0.0]),
        ],
        min_length=1,
        description="the bodies, one table [[problem.body]] each",
    )

    _matter: tuple[Matter, ...] | None = PrivateAttr(default=None)
    _materials: int = PrivateAttr(default=1)

    @model_validator(mode="after")
    def _bodies_fit(self):
        if len(np.shape(self.domain)) == 2 and len(self.domain) != self.dimension:
            return self  # reported by the configuration
        for check in (self._misfits, self._outside, self._empty, self._overlaps):
            if faults := check():
                raise base.refused(faults)
        return self

    def _misfits(self) -> list[Fault]:
        return [
            Fault(("body", i, *fault.path), fault.text)
            for i, body in enumerate(self.body)
            for fault in body.misfits(self.dimension)
        ]

    def _outside(self) -> list[Fault]:
        faults = []
        for i, body in enumerate(self.body):
            halved = placement.halved(body.geometry, self.box, self.boundaries)
            if halved and body.lattice != "cubic":
                text = (
                    f'= "{body.lattice}": expected "cubic" for a body with its centre on a mirror'
                )
                faults.append(Fault(("body", i, "lattice"), text))
            axis = placement.outside(body.geometry, self.box, self.boundaries)
            if axis is not None:
                low, high = self.box["xyz".index(axis)]
                begin, end = body.geometry.extent["xyz".index(axis)]
                text = (
                    f"reaches from {begin:.6g} to {end:.6g} along {axis}, outside the domain: "
                    f"expected inside [{low:.6g}, {high:.6g}]"
                )
                faults.append(Fault(("body", i), text))
        return faults

    def _empty(self) -> list[Fault]:
        return [
            Fault(("body", i), one) for i, one in enumerate(self._placed) if isinstance(one, str)
        ]

    def _overlaps(self) -> list[Fault]:
        placed = self.placed
        return [
            Fault(
                ("body", j),
                f"overlaps problem.body[{i}]: expected no particle inside another body, and at "
                "least half a spacing between particles of two bodies. Try: other positions, or a "
                "gap of a spacing",
            )
            for j in range(len(placed))
            for i in range(j)
            if placement.overlap(placed[i], placed[j])
        ]

    @cached_property
    def _placed(self) -> tuple[placement.Placed | str, ...]:
        """The particles of each body, or why it has none."""
        shared = self._shared_spacing()
        found: list[placement.Placed | str] = []
        for body in self.body:
            try:
                whole = placement.place(body.geometry, body.lattice, body.spacing or shared)
            except ValueError as error:
                found.append(str(error))
            else:
                found.append(placement.within(whole, self.box))
        return tuple(found)

    @property
    def placed(self) -> tuple[placement.Placed, ...]:
        """The particles of each body."""
        return tuple(one for one in self._placed if isinstance(one, placement.Placed))

    def _shared_spacing(self) -> float:
        """Return the spacing of the bodies that give none, which have n particles together."""
        volume = sum(
            placement.volume_within(body.geometry, self.box, self.boundaries)
            for body in self.body
            if body.spacing is None
        )
        return float((volume / self.n) ** (1.0 / self.dimension))

    @property
    def clamps(self) -> bool:
        return any(body.clamped for body in self.body)

    def fills_box(self, eos) -> bool:
        """Return False: there is vacuum around the bodies."""
        return False

    def under(self, physics):
        """Return the problem with the initial matter of each body.

        Raises `base.refused` for a body whose material is unknown or whose density is not given.
        """
        models = {name: eos for name, (eos, _) in physics.materials_models().items()}
        named = physics.materials is not None
        faults, matter = [], []
        for i, body in enumerate(self.body):
            found = _matter(body, models, named)
            if isinstance(found, Fault):
                faults.append(Fault(("body", i, *found.path), found.text))
            else:
                matter.append(found)
        if faults:
            raise base.refused(faults)
        copy = self.model_copy()
        copy._matter, copy._materials = tuple(matter), len(models)
        return copy

    def initial(self, eos) -> base.InitialState:
        """Return the particles of one body after another, of mass density x cell (eq 455)."""
        placed, matter = self.placed, self._matter_under(eos)
        counts = [one.position.shape[1] for one in placed]

        def each(values) -> np.ndarray:
            return np.repeat(np.array(values, dtype=float), counts, axis=-1)

        still = [0.0] * self.dimension
        density = each([one.density for one in matter])
        others = {"density": density, "body": each(np.arange(1.0, len(placed) + 1.0))}
        if self._materials > 1:
            others["material"] = each([one.material for one in matter])
        if self.clamps:
            others["clamped"] = each([body.clamped for body in self.body])
        return base.InitialState(
            np.hstack([one.position for one in placed]),
            each(np.array([body.velocity or still for body in self.body]).T),
            density * each([one.cell for one in placed]),
            each([one.internal_energy for one in matter]),
            others,
        )

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return the velocity of the centre of mass of each body, as body_0_velocity_x."""
        owner = self._owner(particles.id)
        found = {}
        for i in range(len(self.body)):
            mine = owner == i
            share = particles.mass[mine] / particles.mass[mine].sum()
            for axis, component in enumerate(particles.velocity[:, mine] @ share):
                found[f"body_{i}_velocity_{'xyz'[axis]}"] = float(component)
        return found

    def _owner(self, ids: np.ndarray) -> np.ndarray:
        """Return the index of the body (N,) of particles with these IDs."""
        ends = np.cumsum([one.position.shape[1] for one in self.placed])
        return np.searchsorted(ends, ids, side="left")

    def _matter_under(self, eos) -> tuple[Matter, ...]:
        if self._matter is not None:
            return self._matter
        found = [_matter(body, {"": eos}, named=False) for body in self.body]
        return tuple(one for one in found if isinstance(one, Matter))


def _matter(body: Body, models: dict[str, Any], named: bool) -> Matter | Fault:
    """Return the matter of a body, or what is wrong with its keys.

    models: the equations of state by the name of their material. named: whether materials have
    names; otherwise there is one equation of state, with the key "".
    """
    listed = ", ".join(models)
    if not named and body.material is not None:
        text = f'= "{body.material}": physics.materials is not given. Try: leave material out'
        return Fault(("material",), text)
    if named and body.material is None:
        return Fault(("material",), f"is missing: expected one of {listed}")
    name = body.material or ""
    if name not in models:
        close = difflib.get_close_matches(name, models, n=1)
        hint = f"did you mean {close[0]}?" if close else f"expected one of {listed}"
        return Fault(("material",), f'= "{name}" is not in physics.materials; {hint}')
    return _initial_matter(body, models[name], list(models).index(name))


def _initial_matter(body: Body, eos, index: int) -> Matter | Fault:
    kind = type(eos).__name__
    density = body.density if body.density is not None else getattr(eos, "rho_0", None)
    if density is None:
        text = f"is missing: expected a number, because the equation of state {kind} has no rho_0"
        return Fault(("density",), text)
    if body.pressure is None and not hasattr(eos, "rho_0"):
        text = f"is missing: expected a number, because the equation of state is {kind}"
        return Fault(("pressure",), text)
    try:
        energy = float(eos.internal_energy(density, body.pressure or 0.0))
    except ConfigError:
        found = float(eos.pressure(density, 0.0))
        text = f"= {body.pressure:g}: expected {found:.6g}, which follows from the density"
        return Fault(("pressure",), text)
    return Matter(index, density, energy)
