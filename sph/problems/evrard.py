"""Collapse of a sphere of cold gas under its own gravity, its bounce and an outgoing shock.

Evrard (1988), MNRAS 235, 911: density M/(2 pi R^2 r) and internal energy 0.05 G M/R, at rest.
Gravitational energy becomes motion, and motion becomes heat in a shock that travels outwards. There
is no exact solution: errors are computed against a spherical finite-volume solution
(`sph.exact.evrard`). The density of the centre grows with the number of particles, because gas at
r = 0 has no entropy at t = 0, so nothing is compared there.
"""

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from sph import quantity as units
from sph.exact import evrard, finite_volume, sphere
from sph.problems import base
from sph.problems.support import lattice as placement
from sph.quantity import Quantity, compared

_SHARED = base.Problem.model_fields

# Errors are averaged between the radii that hold these shares of the mass: inside, kernels are as
# wide as the radius and the density depends on the number of particles; outside, they reach into
# the vacuum.
KEPT = (0.05, 0.9)
_FIRST_ORDER = (
    "5000 particles smooth the collapse, and alpha of up to 3 heats the falling gas; the error is "
    "of first order in the support radius"
)
# The radius of a shock: fit of straight lines over WINDOW of the radius to either side, at RADII
# radii between those that hold these shares of the particles, with FEWEST particles or more each.
# For particles on the reference it is within 1.2 % of the shock; half as wide windows are noisy.
WINDOW, RADII, INNER_AND_OUTER, FEWEST = 0.1, 400, (0.01, 0.999), 16
ENERGIES = ("kinetic", "internal", "gravitational")


class Problem(base.Problem):
    """Evrard's collapse: cold gas that falls together under its own gravity and bounces."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": {"min": 0.1, "max": 3.0},
        "physics.gravity": {},
        "physics.max_support": 10.0,  # after the bounce the outer gas leaves the initial sphere
        "time.end": 1.95,
        "output.interval": 0.39,
    }
    ideal_gas: ClassVar = True
    radial: ClassVar = True
    truth: ClassVar = finite_volume.TRUTH
    limits: ClassVar = {
        "energy_drift": base.Limit(
            0.002, "a collapse, a strong shock and a tree's forces; measured: 5e-4"
        ),
        "potential_minimum_error": base.Limit(0.32, f"{_FIRST_ORDER}: 0.27 measured"),
        "internal_maximum_error": base.Limit(0.36, f"{_FIRST_ORDER}: 0.31 measured"),
        "kinetic_maximum_error": base.Limit(0.57, f"{_FIRST_ORDER}: 0.52 measured"),
    }
    quantities: ClassVar = compared(
        {
            "half_mass_radius": Quantity(
                "radius of the sphere that holds half of the particles", units.LENGTH
            ),
            "shock_radius": Quantity(
                "radius where the radial velocity falls most steeply", units.LENGTH
            ),
            "potential_minimum": Quantity(
                "lowest gravitational energy, at the bounce", units.ENERGY
            ),
            "potential_minimum_time": Quantity("time of potential_minimum", units.TIME),
            "internal_maximum": Quantity("largest internal energy, at the bounce", units.ENERGY),
            "internal_maximum_time": Quantity("time of internal_maximum", units.TIME),
            "kinetic_maximum": Quantity("largest kinetic energy before the bounce", units.ENERGY),
            "kinetic_maximum_time": Quantity("time of kinetic_maximum", units.TIME),
        },
        to="reference",
    )
    title: ClassVar = "Evrard collapse"

    name: Literal["evrard"] = "evrard"
    dimension: Literal[3] = Field(default=3, description="number of space dimensions")
    n: Annotated[int, _SHARED["n"]] = 5000
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[-1.0, 1.0]
    )
    boundary: Literal["open"] = Field(default="open", description="vacuum outside, on all sides")
    mass: float = Field(default=1.0, gt=0.0, description="mass M of the sphere")
    radius: float = Field(
        default=1.0,
        gt=0.0,
        description="radius R of the sphere at t = 0; its centre is that of the domain, which must "
        "hold it",
    )
    energy: float = Field(
        default=0.05, gt=0.0, description="internal energy per unit mass at t = 0"
    )
    lattice: Literal["cubic", "bcc", "relaxed"] = Field(
        default="cubic",
        description='initial lattice: "cubic", "bcc" or "relaxed", a disordered glass; it is '
        "stretched along the radius to give the density",
    )

    _G: float = PrivateAttr(default=1.0)

    @model_validator(mode="after")
    def _fits(self):
        try:
            shortest = float((self.box[:, 1] - self.box[:, 0]).min())
        except ValueError:  # rows of different lengths are reported by the configuration
            return self
        if 2.0 * self.radius > shortest * (1.0 + 1e-12):
            raise ValueError(
                f"radius = {self.radius:g}: expected at most {shortest / 2.0:g}, half the shortest "
                "side of the domain. Try: a larger problem.domain"
            )
        return self

    def under(self, physics):
        """Return the problem with the constant of gravity of [physics.gravity]."""
        if getattr(physics, "gravity", None) is None:
            raise ValueError(
                "physics.gravity is missing: the sphere collapses under its own gravity. Try: a "
                "table [physics.gravity]"
            )
        found = self.model_copy()
        found._G = physics.gravity.G
        return found

    @property
    def units(self) -> "Units":
        """Units in which G, M and R are 1."""
        speed = float(np.sqrt(self._G * self.mass / self.radius))
        return Units(self.mass, self.radius, speed)

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass, from a ball of a lattice that is stretched radially."""
        position = placement.ball(self.n, self.lattice, 3)
        # the ball has the share r^3 of the mass within r, the sphere r^2
        position *= self.radius * np.sqrt(np.sqrt((position**2).sum(axis=0)))
        n = position.shape[1]
        position += self.centre[:, None]
        return base.InitialState(
            position,
            np.zeros_like(position),
            np.full(n, self.mass / n),
            np.full(n, self.energy),
        )

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """Return the reference solution at (3, N) positions; vacuum outside its surface."""
        units, cells = self.units, self._reference(eos, time)[0]
        offset = position - self.centre[:, None]
        distance = np.sqrt((offset**2).sum(axis=0))
        radius = distance / units.length
        inside = radius < cells.faces[-1]
        density, speed, pressure = (np.where(inside, one, 0.0) for one in cells.at(radius))
        energy = pressure / ((eos.gamma - 1.0) * np.where(inside, density, 1.0))
        return {
            "density": density * units.mass / units.length**3,
            "velocity": units.speed * speed * offset / np.where(distance > 0.0, distance, 1.0),
            "pressure": pressure * units.mass * units.speed**2 / units.length**3,
            "internal_energy": energy * units.speed**2,
        }

    def departs(self, physics) -> str | None:
        gamma = physics.eos_model().gamma
        if gamma < evrard.LEAST_GAMMA:
            return (
                f"the reference is computed for gamma of at least {evrard.LEAST_GAMMA:g}, but "
                f"physics.gamma is {gamma:g}"
            )
        return base.other_physics(physics, besides="gravity")

    def exact_ends(self, eos) -> tuple[float, str]:
        return evrard.LAST_TIME * self.units.time, "the computation of the reference ends"

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """Return the gas without its centre and its outer end, where there is a reference."""
        if eos.gamma < evrard.LEAST_GAMMA or time > self.exact_ends(eos)[0]:
            return super().error_region(eos, time, position)
        cells = self._reference(eos, time)[0]
        low, high = self.radius * evrard.radius_of_mass(cells, KEPT)
        offset = position - self.centre[:, None]
        squared = (offset**2).sum(axis=0)
        words = f"{low:.4g} < r < {high:.4g} around the centre"
        return (low**2 < squared) & (squared < high**2), words

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return half_mass_radius: of the sphere that holds half of the particles."""
        return {"half_mass_radius": float(np.median(self._radial(particles)[0]))}

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return the half-mass radius and, while the shock is in the gas, the radius of the shock.

        Both with the value of the reference and the relative error. shock_radius: where the radial
        velocity of the particles falls most steeply.
        """
        units, cells = self.units, self._reference(eos, time)[0]
        half = units.length * float(evrard.radius_of_mass(cells, 0.5))
        radius, speed = self._radial(particles)
        figures = _compared("half_mass_radius", float(np.median(radius)), half)
        shock = evrard.shock(cells)
        if shock is not None:
            found = _steepest(radius, speed, particles.density)
            figures |= _compared("shock_radius", found, units.length * shock)
        return figures

    def theory(self, eos, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return the energies of the reference at `times` (M,), NaN after its end."""
        units, energies = self.units, self._energies(eos, times)
        at = times / units.time
        unit = units.mass * units.speed**2
        return {
            f"{name}_energy": unit
            * np.interp(at, energies.time, getattr(energies, name), right=np.nan)
            for name in ENERGIES
        }

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return extremes of the energies, their times, and relative errors of both.

        potential_minimum, internal_maximum: extremes of gravitational and internal energy at the
        bounce; kinetic_maximum: before the bounce. Empty before the bounce.
        """
        times, units = history["t"], self.units
        by_run = evrard.extremes(times, *(history[f"{name}_energy"] for name in ENERGIES))
        energies = self._energies(eos, times)
        expected = evrard.extremes(energies.time, *(getattr(energies, name) for name in ENERGIES))
        unit = units.mass * units.speed**2
        figures: dict[str, float] = {}
        for name in by_run.keys() & expected.keys():
            (found_time, found), (time, value) = by_run[name], expected[name]
            figures |= _compared(name, found, unit * value)
            figures |= _compared(f"{name}_time", found_time, units.time * time)
        return dict(sorted(figures.items()))

    def _reference(self, eos, time: float) -> tuple[finite_volume.Cells, sphere.Energies]:
        """Return the reference in units of G, M and R."""
        units = self.units
        return evrard.solve(eos.gamma, self.energy / units.speed**2, time / units.time)

    def _energies(self, eos, times: np.ndarray) -> sphere.Energies:
        """Return the energies of the reference until the last of `times` or its own end."""
        return self._reference(eos, min(float(times[-1]), self.exact_ends(eos)[0]))[1]

    def _radial(self, particles) -> tuple[np.ndarray, np.ndarray]:
        """Return distances from the centre and radial velocities (N,) of particles."""
        offset = particles.position - self.centre[:, None]
        radius = np.sqrt((offset**2).sum(axis=0))
        outward = (particles.velocity * offset).sum(axis=0)
        return radius, outward / np.where(radius > 0.0, radius, 1.0)


class Units(NamedTuple):
    """Units of mass, length and speed."""

    mass: float
    length: float
    speed: float

    @property
    def time(self) -> float:
        return self.length / self.speed


def _steepest(radius: np.ndarray, speed: np.ndarray, density: np.ndarray) -> float:
    """Return the radius where the radial velocity of particles (N,) falls most steeply.

    The slope is that of the straight line through the particles within WINDOW of a radius, weighted
    so that equal lengths along the radius count alike. NaN with too few particles.
    """
    order = np.argsort(radius)
    r, v = radius[order], speed[order]
    w = 1.0 / (density[order] * r * r)
    inner, outer = (float(np.quantile(r, share)) for share in INNER_AND_OUTER)
    at = np.geomspace(inner, outer, RADII)
    low, high = np.searchsorted(r, np.outer((1.0 - WINDOW, 1.0 + WINDOW), at))
    enough = high - low >= FEWEST
    if not enough.any():
        return float("nan")
    at, low, high = at[enough], low[enough], high[enough]
    sums = (
        np.concatenate([[0.0], np.cumsum(one)]) for one in (w, w * r, w * v, w * r * r, w * r * v)
    )
    n, x, y, xx, xy = (one[high] - one[low] for one in sums)
    slope = (xy - x * y / n) / (xx - x * x / n)
    return float(at[np.argmin(slope)])


def _compared(name: str, found: float, expected: float) -> dict[str, float]:
    return {
        name: found,
        f"{name}_reference": expected,
        f"{name}_error": abs(found / expected - 1.0),
    }
