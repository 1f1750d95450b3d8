"""A polytrope: a sphere of gas that its own gravity holds together, at rest or pulsating.

P ~ rho^(1 + 1/n) at t = 0 (see `sph.exact.lane_emden`). With a kick, velocities have the shape of
the fundamental radial mode, whose period is known. Gas is stable to convection only if
gamma >= 1 + 1/n (Schwarzschild): n = 3/2 needs 5/3, n = 1 needs 2. With less, the equilibrium holds
only until convection has grown out of the noise of the particles.
"""

import math
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from sph import kernels, registry
from sph import quantity as units
from sph.exact import lane_emden
from sph.problems import base
from sph.problems.support import densities, oscillation
from sph.problems.support import lattice as placement
from sph.quantity import Quantity, compared

_SHARED = base.Problem.model_fields

KEPT = 0.7  # of the radius: errors are averaged inside; outside, kernels reach the surface
GROWN = 5.0  # growth times of convection at half of the mass, after which errors are not taken
LARGEST = 1e40  # mass and radius, whose powers must not overflow
CENTRAL = 32  # innermost particles, over which the central density is averaged


class Problem(base.Problem):
    """A self-gravitating sphere in hydrostatic equilibrium, or in its fundamental radial mode."""

    defaults: ClassVar = {
        "physics.gamma": 5.0 / 3.0,
        "physics.alpha": 1.0,  # less leaves motion of the first arrangement, which stirs the star
        "physics.gravity": {},
        "time.end": 20.0,
        "output.interval": 4.0,
    }
    ideal_gas: ClassVar = True
    radial: ClassVar = True
    limits: ClassVar = {
        "energy_drift": base.Limit(1e-3, "an equilibrium, or a pulsation over many steps"),
        "central_density_error": base.Limit(
            0.05, "kernels blur the centre: 4 % with 4000 particles, 2 % with 10,000"
        ),
    }
    quantities: ClassVar = {
        "mode_velocity": Quantity(
            "radial velocity of the surface in the fundamental mode, over the escape speed"
        ),
        "outer_radius": Quantity(
            "distance of the outermost particle from the centre of mass", units.LENGTH
        ),
        "virial_ratio": Quantity(
            "2 K + 3 sum of m P/rho over the exact -W of the star; 1 in equilibrium"
        ),
        "mode_damping": Quantity(
            "rate at which the amplitude of the mode falls, over its angular frequency"
        ),
        **compared(
            {
                "central_density": Quantity(
                    "mean density of the innermost particles", units.DENSITY
                ),
                "half_mass_radius": Quantity(
                    "median distance of particles from the centre of mass", units.LENGTH
                ),
                "mode_period": Quantity("period of the fundamental mode", units.TIME),
            }
        ),
    }

    name: Literal["polytrope"] = "polytrope"
    dimension: Literal[3] = Field(default=3, description="number of space dimensions")
    n: int = Field(default=4000, ge=100, le=100_000_000, description="number of particles")
    domain: Annotated[list[float] | list[list[float]], _SHARED["domain"]] = Field(
        default=[-2.0, 2.0]
    )
    boundary: Literal["open"] = Field(default="open", description="vacuum outside, on all sides")
    index: float = Field(
        default=1.5,
        ge=0.5,
        le=3.0,  # the centre is 54 times as dense as the mean; softer stars need more particles
        description="polytropic index n of the pressure, P ~ rho^(1 + 1/n), at t = 0; gas with "
        "physics.gamma below 1 + 1/n is unstable to convection",
    )
    mass: float = Field(default=1.0, gt=0.0, le=LARGEST, description="mass of the sphere")
    radius: float = Field(
        default=1.0, ge=1.0 / LARGEST, le=LARGEST, description="radius of the sphere at t = 0"
    )
    kick: float = Field(
        default=0.0,
        ge=-0.2,
        le=0.2,
        description="radial velocity of the surface at t = 0 in units of the escape speed "
        "(2 G mass/radius)^(1/2); inside, velocities have the shape of the fundamental radial mode",
    )
    lattice: Literal["cubic", "bcc", "relaxed"] = Field(
        default="relaxed",
        description='initial lattice: "cubic", "bcc" or "relaxed", a disordered glass; it is '
        "stretched along the radius to give the density",
    )

    _G: float = PrivateAttr(default=1.0)
    _gamma: float = PrivateAttr(default=5.0 / 3.0)
    _kernel: Any = PrivateAttr(default_factory=lambda: kernels.make("wendland_c2"))
    _eta: float = PrivateAttr(default=1.6)

    @model_validator(mode="after")
    def _in_the_box(self):
        room = float((self.box[:, 1] - self.box[:, 0]).min() / 2.0)
        if not self.radius <= room:
            raise ValueError(
                f"radius = {self.radius:g}: expected at most {room:g}, half of the shortest side "
                "of the domain. Try: a wider domain"
            )
        return self

    def under(self, physics):
        """Return the problem with the constant of gravity, gamma, kernel and eta of [physics]."""
        if getattr(physics, "gravity", None) is None:
            raise ValueError(
                "physics.gravity is missing: its own gravity holds a polytrope together. Try: a "
                "table [physics.gravity]"
            )
        found = self.model_copy()
        found._G = registry.model("sph.parts.gravity", physics.gravity.choice(), "order").G
        found._kernel, found._eta = physics.kernel_model(), physics.eta
        found._gamma = getattr(physics.eos_model(), "gamma", self._gamma)
        if found._gamma <= 4.0 / 3.0:
            raise ValueError(
                f"physics.gamma = {found._gamma:g}: expected above 4/3; the sphere would collapse "
                "or disperse"
            )
        return found

    @property
    def star(self) -> lane_emden.Polytrope:
        """The equilibrium."""
        return lane_emden.Polytrope(self.index, self.mass, self.radius, self._G)

    @property
    def mode(self) -> lane_emden.Mode:
        """The fundamental radial mode."""
        return self.star.fundamental_mode(self._gamma)

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass, from a ball of a lattice that is stretched radially."""
        position = placement.ball(self.n, self.lattice, 3)
        n = position.shape[1]
        distance = np.sqrt((position**2).sum(axis=0))
        radius = self.star.radius_of_mass(self.mass * distance**3)
        offset = position * (radius / distance)
        velocity = np.zeros_like(offset)
        if self.kick != 0.0:
            speed = self.kick * self.star.escape_speed / self.radius
            velocity = speed * offset * self.mode.shape(radius / self.radius)
        # SPH densities, so that P/rho^(1 + 1/n) is uniform. With exact densities it would not be
        # so at the surface, where kernels blur, and the outer gas would sink.
        density = densities.summed(offset, self.mass / n, self._kernel, self._eta)
        pressure = self.star.pressure_of(density)
        energy = eos.internal_energy(density, pressure)
        mass = np.full(n, self.mass / n)
        return base.InitialState(self.centre[:, None] + offset, velocity, mass, energy)

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray] | None:
        """Return the equilibrium at (3, N) positions; None with a kick."""
        if self.kick != 0.0:
            return None
        offset = position - self.centre[:, None]
        radius = np.sqrt((offset**2).sum(axis=0))
        density, pressure = self.star.density(radius), self.star.pressure(radius)
        inside = density > 0.0
        energy = eos.internal_energy(np.where(inside, density, 1.0), pressure)
        return {
            "density": density,
            "velocity": np.zeros_like(position),
            "pressure": pressure,
            "internal_energy": np.where(inside, energy, 0.0),
        }

    def departs(self, physics) -> str | None:
        return base.other_physics(physics, besides="gravity")

    def exact_ends(self, eos) -> tuple[float, str]:
        """Return when convection has changed the profile, if the gas is unstable to convection."""
        half = self.star.radius_of_mass(np.array(0.5 * self.mass))
        rate = math.sqrt(max(0.0, -float(self.star.squared_buoyancy(half, self._gamma))))
        end = GROWN / rate if rate * self.mode.period > 1e-3 else math.inf
        return end, "convection mixes the gas"

    def allowed(self) -> dict[str, base.Limit]:
        """Return limits for a star at rest, or for one that pulsates."""
        if self.kick == 0.0:
            return self.limits
        reason = "measured: 0.6 % with 10,000 particles, of a mode that viscosity damps"
        return {
            "energy_drift": self.limits["energy_drift"],
            "mode_period_error": base.Limit(0.01, reason),
        }

    def error_region(self, eos, time: float, position: np.ndarray) -> tuple[np.ndarray, str]:
        """Return the inner part of the star; outside, kernels reach beyond its surface."""
        reach = KEPT * self.radius
        offset = position - self.centre[:, None]
        return (offset**2).sum(axis=0) < reach**2, f"r < {reach:.4g} around the centre"

    def diagnostics(self, particles) -> dict[str, float]:
        """Return mode_velocity, central_density and half_mass_radius.

        mode_velocity: sum m v.xi over sum m xi^2, for the displacement xi of the fundamental mode:
        the radial velocity of the surface in units of the escape speed. central_density: mean over
        the innermost particles. half_mass_radius: median distance from the centre of mass.
        """
        offset, radius = self._from_centre_of_mass(particles)
        shape = offset * self.mode.shape(radius / self.radius)
        weighted = particles.mass * shape
        amplitude = (weighted * particles.velocity).sum() / (weighted * shape).sum()
        return {
            "mode_velocity": float(amplitude * self.radius / self.star.escape_speed),
            "central_density": float(particles.density[_innermost(radius)].mean()),
            "half_mass_radius": float(np.median(radius)),
        }

    def theory(self, eos, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return the velocity of the fundamental mode without damping, to first order."""
        if self.kick == 0.0:
            return {}
        return {"mode_velocity": self.kick * np.cos(self.mode.frequency * times)}

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return period and damping time of the mode, if the star was kicked and has pulsated.

        mode_period_error: relative, absolute value. mode_damping: the rate at which the amplitude
        falls, in units of the frequency.
        """
        if self.kick == 0.0:
            return {}
        mode = self.mode
        found = oscillation.fit(history["t"], history["mode_velocity"], mode.frequency)
        if found is None:
            return {}
        return {
            "mode_period": found.period,
            "mode_period_exact": mode.period,
            "mode_period_error": abs(found.period / mode.period - 1.0),
            "mode_damping": found.damping / mode.frequency,
        }

    def report(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return outer_radius, the distance of the outermost particle, and virial_ratio.

        virial_ratio: 2 K + 3 sum m P/rho over the exact -W; 1 in equilibrium.
        """
        _, radius = self._from_centre_of_mass(particles)
        kinetic = (particles.mass * (particles.velocity**2).sum(axis=0)).sum()
        thermal = 3.0 * (particles.mass * pressure / particles.density).sum()
        return {
            "outer_radius": float(radius.max()),
            "virial_ratio": float((kinetic + thermal) / -self.star.potential_energy),
        }

    def compare(self, eos, time: float, particles, pressure) -> dict[str, float]:
        """Return central density and half-mass radius, those of the equilibrium, and errors.

        central_density_exact: mean over the same innermost particles at their distances. Errors are
        absolute values of relative errors.
        """
        _, radius = self._from_centre_of_mass(particles)
        found = self.diagnostics(particles)
        central = float(self.star.density(radius[_innermost(radius)]).mean())
        half = float(self.star.radius_of_mass(np.array(0.5 * self.mass)))
        return {
            "central_density": found["central_density"],
            "central_density_exact": central,
            "central_density_error": abs(found["central_density"] / central - 1.0),
            "half_mass_radius": found["half_mass_radius"],
            "half_mass_radius_exact": half,
            "half_mass_radius_error": abs(found["half_mass_radius"] / half - 1.0),
        }

    def _from_centre_of_mass(self, particles) -> tuple[np.ndarray, np.ndarray]:
        """Return offsets (3, N) and distances (N,)."""
        share = particles.mass / particles.mass.sum()
        offset = particles.position - (particles.position * share).sum(axis=1)[:, None]
        return offset, np.sqrt((offset**2).sum(axis=0))


def _innermost(radius: np.ndarray) -> np.ndarray:
    """Return the indices of the innermost particles."""
    return np.argsort(radius, kind="stable")[:CENTRAL]
