"""A scene: what the configuration asks for, and nothing else, in the form the passes take."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sph import kernels, schemes
from sph.config import Config
from sph.domain import Domain
from sph.errors import ConfigError
from sph.integrators.step_size import Bounds
from sph.passes import Models
from sph.passes.smoothing import Converged, FixedPasses
from sph.passes.weighting import ByMass, ByNumber
from sph.problems.base import InitialState
from sph.viscosity import balsara

# Relative tolerance of the converged support: round-off of the density sum is some 1e-14.
TOLERANCE = 1e-10


@dataclass(frozen=True)
class Scene:
    """The compiled-in choices of a configuration."""

    config: Config

    @property
    def dimension(self) -> int:
        return self.config.problem.dimension

    @cached_property
    def domain(self) -> Domain:
        return Domain(self.config.problem.box, self.config.problem.boundaries)

    @cached_property
    def eos(self):
        return self.config.physics.eos_model()

    @cached_property
    def viscosity(self):
        return self.config.physics.viscosity_model()

    @property
    def evolves_alpha(self) -> bool:
        return self.viscosity.evolves

    @property
    def finds_shocks(self) -> bool:
        """Whether alpha follows from gradients of velocity and acceleration."""
        return getattr(self.viscosity, "finds_shocks", False)

    @property
    def conducts(self) -> bool:
        return self.config.physics.conductivity is not None

    @cached_property
    def external(self):
        """The external field, a model of `sph.external`, or None."""
        return self.config.physics.external_model()

    @cached_property
    def heating(self):
        """The source of internal energy, a model of `sph.heating`, or None."""
        return self.config.physics.heating_model()

    @property
    def finds_contacts(self) -> bool:
        """Whether conductivity is switched by the Laplacian of the energy."""
        return self.conducts and self.models.conductivity.switched

    @property
    def sums_pressure(self) -> bool:
        return schemes.sums_pressure(self.models.scheme)

    @cached_property
    def keeps_momentum(self) -> np.ndarray:
        """(D,) 1.0 for axes along which total momentum is conserved: no wall, no field."""
        free = [kind != "mirror" and self.external is None for kind in self.domain.boundaries]
        return np.array(free, dtype=float)

    @cached_property
    def is_filled(self) -> bool:
        """Whether gas fills a box without open sides, so that sum m/rho is to be its volume."""
        return self.config.problem.fills_box(self.eos) and "open" not in self.domain.boundaries

    @property
    def max_support(self) -> float:
        """Where supports are held; inf where a closed axis ends them, which is an error."""
        if any(boundary != "open" for boundary in self.domain.boundaries):
            return math.inf
        return self.config.physics.max_support * self.domain.largest_side

    @property
    def bounds_acceleration(self) -> bool:
        """Whether |a| bounds the step: a field, or heavy gas beside light, sends no signal."""
        return self.external is not None or self.config.physics.density == "number"

    @cached_property
    def step_bounds(self) -> Bounds:
        """What bounds the time step, of what the configuration sets."""
        physics = self.config.physics
        return Bounds(
            physics.C, physics.energy_limit, self.bounds_acceleration, self.config.time.end,
            self.viscosity.largest(), getattr(self.models.conductivity, "strength", 0.0),
        )  # fmt: skip

    @property
    def needs_curl(self) -> bool:
        return self.config.physics.balsara and self.dimension > 1

    @property
    def needs_divergence(self) -> bool:
        return self.config.physics.balsara or self.evolves_alpha

    @cached_property
    def models(self) -> Models:
        """The models of the density and rate passes."""
        passes = self.config.physics.density_passes
        if passes == "converged":
            return self.starting_models
        return self._models(FixedPasses(passes, TOLERANCE))

    @cached_property
    def starting_models(self) -> Models:
        """The same, but with converged supports: what a run begins with."""
        return self._models(Converged(TOLERANCE))

    def _models(self, smoothing) -> Models:
        physics = self.config.physics
        kernel = physics.kernel_model()
        return Models(
            scheme=schemes.make(physics.scheme),
            kernel=kernel,
            smoothing=smoothing,
            weighting=ByNumber() if physics.density == "number" else ByMass(),
            eos=self.eos,
            viscosity=self.viscosity,
            conductivity=physics.conductivity_model(),
            balsara=balsara.Balsara() if physics.balsara else None,
            support_ratio=kernels.support_ratio(kernel, self.dimension),
            eta=float(physics.eta),
            max_support=self.max_support,
        )

    def initial_state(self) -> InitialState:
        """The problem's particles. Raises ConfigError for numbers too extreme to place any.

        Problems square lengths and count lattice cells before there is a particle to check.
        """
        problem = self.config.problem
        try:
            with np.errstate(all="ignore"):
                return problem.initial(self.eos)
        except (ArithmeticError, ValueError) as error:
            raise ConfigError(
                f"problem.name = {problem.name}: particles cannot be placed with these settings "
                f"({error}).\nTry: numbers in [problem] that are nearer to 1, and sides of "
                "problem.domain of similar length."
            ) from error

    def parts(self) -> tuple[list[str], list[str]]:
        """What is compiled in, and what was left out and why, in words."""
        physics = self.config.physics
        kernel = self.models.kernel
        name = type(kernel).__module__.rsplit(".", 1)[-1]
        flattened = ", gradient flattened" if getattr(kernel, "flattened", False) else ""
        inside = [
            f"{self.dimension}-D, {len(self.domain.images.sign)} image(s) of the box",
            f"scheme {physics.scheme}, kernel {name}{flattened}",
            f"density by {physics.density}",
            f"equation of state {type(self.eos).__module__.rsplit('.', 1)[-1]}",
            "supports converged to 1e-10"
            if physics.density_passes == "converged"
            else f"{physics.density_passes} density pass(es)",
        ]
        outside = []

        def part(there: bool, what: str, why_not: str):
            if there:
                inside.append(what)
            else:
                outside.append(f"{what}: {why_not}")

        part(self.evolves_alpha, "equation for alpha", "alpha is one number")
        part(self.finds_shocks, "gradients of velocity", "no switch asks for them")
        part(self.sums_pressure, "sum of the pressure", f"{physics.scheme} takes it from density")
        part(self.conducts, "artificial conductivity", "physics.conductivity is not given")
        part(self.finds_contacts, "switch of conductivity", "no conductivity asks for it")
        part(self.external is not None, "external field", "physics.external is not given")
        part(self.heating is not None, "heating", "physics.heating is not given")
        part(physics.balsara, "Balsara factor", "physics.balsara = false")
        part(self.needs_divergence, "divergence of velocity", "neither Balsara nor alpha needs it")
        part(
            self.needs_curl,
            "curl of velocity",
            "no curl in 1-D" if self.dimension == 1 else "no Balsara factor asks for it",
        )
        part(physics.energy_limit, "time step limit u/|du/dt|", "physics.energy_limit = false")
        return inside, outside
