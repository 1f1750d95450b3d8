"""Standing longitudinal wave in an elastic bar, in uniaxial strain, in 1-D to 3-D.

The bar has free ends, or is periodic. It is periodic along y and z, so that the strain is uniaxial
in every dimension and the speed of the wave is that of eq 415; a bar with free sides would be
slower. The initial state has the velocity of the wave and no strain (eq 445).

The wave speed comes from the frequency of the mode in the history. On a lattice, gradients of
correction orders -1 and 0 are g times the true ones, and long waves run at g times their speed: at
physics.spacing_ratio = 1.2 g is 1.0205 (1-D), .9910 (2-D square), 1.0271 (2-D hexagonal), .9809
(3-D cubic) at order 0, at 2 within .002 of 1. Order 1 has g = 1.
"""

import math
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr, field_validator, model_validator

from sph import quantity as units
from sph.exact import solid_shocks
from sph.problems import base
from sph.problems.support import lattice as placement
from sph.problems.support import oscillation, solids, uniaxial
from sph.quantity import Quantity

_SHARED = base.Problem.model_fields


class Problem(base.Problem):
    """A steel bar in a standing longitudinal wave (SI units)."""

    defaults: ClassVar = {
        "physics.formulation": "continuum",
        "physics.C": 0.2,  # energy drift grows as its square
        "physics.correction": 1,
        "physics.eos": uniaxial.STEEL,
        "physics.strength": {"name": "elastic", "shear_modulus": uniaxial.SHEAR_MODULUS},
        "time.end": 1e-3,
        "output.interval": 2e-4,
    }
    limits: ClassVar = {
        "energy_drift": base.Limit(
            1e-4, "measured: 5.1e-5 at 100 particles per wavelength, errors of the time step"
        ),
        "wave_speed_deviation": base.Limit(
            0.01, "measured: 0.0009 at 100 particles per wavelength, 0.0035 at 50"
        ),
    }
    profiles: ClassVar = ("density", "velocity", "stress", "internal_energy")
    truth: ClassVar = ("linear theory", "linear theory")
    quantities: ClassVar = {
        "mode_velocity": Quantity("amplitude of the velocity of the mode", units.VELOCITY),
        "wave_speed": Quantity("wave speed from the frequency of the mode", units.VELOCITY),
        "wave_speed_exact": Quantity("wave speed of eq 415", units.VELOCITY),
        "wave_speed_error": Quantity("wave_speed over wave_speed_exact, minus 1"),
        "wave_speed_deviation": Quantity("absolute value of wave_speed_error"),
        "mode_damping": Quantity("rate at which the amplitude falls, over the angular frequency"),
    }

    name: Literal["elastic_bar"] = "elastic_bar"
    dimension: Annotated[int, _SHARED["dimension"]] = 1
    n: Annotated[int, _SHARED["n"]] = 100
    domain: list[float] | list[list[float]] = Field(
        default=[0.0, 1.0],
        description="ends of the bar: [lo, hi] along x (y and z are then an eighth as wide), or a "
        "list with one [lo, hi] per axis",
    )
    boundary: Literal["open", "periodic"] = Field(
        default="open",
        description='ends of the bar: "open" (free) or "periodic"; y and z are periodic',
    )
    amplitude: float = Field(
        default=1e-4,
        ge=1e-8,  # below, round-off of the positions becomes visible
        le=1e-2,  # above, shock speeds that depend on the strain change the frequency by 1e-3
        description="amplitude of the velocity in units of the wave speed, and of the strain",
    )
    mode: int = Field(
        default=2,
        ge=1,
        le=20,
        description="number of half wavelengths in the bar; even if the bar is periodic",
    )
    lattice: Literal["cubic", "hexagonal", "bcc"] = Field(
        default="cubic",
        description='initial lattice: "cubic", "hexagonal" (2-D) or "bcc" (3-D)',
    )

    _strength: Any = PrivateAttr(default=None)
    _off_lattice: bool = PrivateAttr(default=False)

    @field_validator("lattice")
    @classmethod
    def _exists(cls, kind, known):
        return placement.checked(kind, known.data.get("dimension"))

    @model_validator(mode="after")
    def _whole_wavelengths(self):
        if self.boundary == "periodic" and self.mode % 2:
            raise ValueError(
                f"mode = {self.mode}: expected an even number of half wavelengths in a periodic "
                f"bar. Try: {self.mode + 1}"
            )
        return self

    def under(self, physics):
        """Return the problem with the strength of [physics]; ValueError for a gas."""
        solids.check_single(physics)
        found = self.model_copy()
        found._strength = physics.strength_model()
        found._off_lattice = uniaxial.is_off_on_lattice(physics)
        return found

    @property
    def box(self) -> np.ndarray:
        return uniaxial.slender_box(self.domain, self.dimension)

    @property
    def boundaries(self) -> tuple[str, ...]:
        return (self.boundary,) + ("periodic",) * (self.dimension - 1)

    def fills_box(self, eos) -> bool:
        return self.boundary == "periodic"

    def allowed(self) -> dict[str, base.Limit]:
        """Return limits for the correction order and spacing_ratio of [physics]."""
        if not self._off_lattice:
            return self.limits
        return self.limits | {"wave_speed_deviation": base.Limit(*uniaxial.OFF_LATTICE)}

    @property
    def shear_modulus(self) -> float:
        return 0.0 if self._strength is None else self._strength.shear_modulus

    @property
    def wavenumber(self) -> float:
        return self.mode * math.pi / float(self.box[0, 1] - self.box[0, 0])

    def wave_speed(self, eos) -> float:
        """Return the speed of longitudinal waves in uniaxial strain (eq 415)."""
        bulk = eos.rho_0 * float(eos.sound_speed(eos.rho_0, 0.0)) ** 2
        return solid_shocks.longitudinal_speed(bulk, self.shear_modulus, eos.rho_0)

    def initial(self, eos) -> base.InitialState:
        """Return particles of equal mass on a lattice, with the velocity of the mode."""
        position = placement.fill(self.box, self.n, self.lattice)
        velocity = np.zeros_like(position)
        velocity[0] = self.amplitude * self.wave_speed(eos) * self._shape(position)
        own = uniaxial.at_rest(self.box, position.shape[1], eos.rho_0)
        return base.InitialState(position, velocity, *own)

    def exact(self, eos, time: float, position: np.ndarray) -> dict[str, np.ndarray]:
        """Return the wave of eq 445 at (D, N) positions, to first order in the amplitude.

        internal_energy: the elastic energy, of second order. "stress": -sigma_xx (N,).
        """
        speed = self.wave_speed(eos)
        angle = self.wavenumber * speed * time
        along = self.wavenumber * (position[0] - self.box[0, 0])
        strain = -self.amplitude * np.sin(along) * math.sin(angle)
        velocity = np.zeros_like(position)
        velocity[0] = self.amplitude * speed * np.cos(along) * math.cos(angle)
        stress = -eos.rho_0 * speed**2 * strain
        return {
            "density": eos.rho_0 * (1.0 - strain),
            "velocity": velocity,
            "pressure": stress + 4.0 / 3.0 * self.shear_modulus * strain,
            "internal_energy": 0.5 * (speed * strain) ** 2,
            "stress": stress,
        }

    def departs(self, physics) -> str | None:
        strength = physics.strength_model()
        if strength is not None and strength.yields:
            # of 2 G amplitude, the largest equivalent stress of the wave
            limit = float(strength.yield_stress_of(0.0, 0.0, 0.0))
            if 2.0 * strength.shear_modulus * self.amplitude >= limit:
                return (
                    f"the theory is of an elastic wave, but with problem.amplitude = "
                    f"{self.amplitude:g} the stress reaches the yield stress {limit:g}"
                )
        return super().departs(physics)

    def diagnostics(self, particles) -> dict[str, float]:
        """Return mode_velocity: the amplitude of the velocity, projected on the mode."""
        shape = particles.mass * self._shape(particles.position)
        own = (shape * self._shape(particles.position)).sum()
        return {"mode_velocity": float((shape * particles.velocity[0]).sum() / own)}

    def theory(self, eos, times: np.ndarray) -> dict[str, np.ndarray]:
        """Return the velocity of the mode without damping (eq 445)."""
        speed = self.wave_speed(eos)
        return {"mode_velocity": self.amplitude * speed * np.cos(self.wavenumber * speed * times)}

    def over_time(self, eos, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Return the wave speed from the frequency of the mode, its error, and the damping.

        wave_speed_error: relative to eq 415; wave_speed_deviation: its absolute value;
        mode_damping: the rate at which the amplitude falls, in units of the angular frequency.
        Empty before one and a half periods.
        """
        speed = self.wave_speed(eos)
        found = oscillation.fit(history["t"], history["mode_velocity"], self.wavenumber * speed)
        if found is None:
            return {}
        # the frequency without damping: omega^2 + damping^2 = (c k)^2
        measured = math.hypot(found.frequency, found.damping) / self.wavenumber
        return {
            "wave_speed": measured,
            "wave_speed_exact": speed,
            "wave_speed_error": measured / speed - 1.0,
            "wave_speed_deviation": abs(measured / speed - 1.0),
            "mode_damping": found.damping / found.frequency,
        }

    def _shape(self, position: np.ndarray) -> np.ndarray:
        """Return cos(k x) (N,), with x from the lower end of the bar."""
        return np.cos(self.wavenumber * (position[0] - self.box[0, 0]))
