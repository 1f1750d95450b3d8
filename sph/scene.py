"""A scene: the parts and models that a configuration selects, as the simulation uses them."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from sph import declarations, parts, registry, simd
from sph.config import Config
from sph.config.toml_text import value_text
from sph.domain import Domain
from sph.errors import ConfigError
from sph.formulations import Formulation
from sph.integrators import bins
from sph.integrators.step_size import Bounds
from sph.part import STAGES, Part, Pass
from sph.problems.base import InitialState
from sph.state import Field


@dataclass(frozen=True)
class Scene:
    """The models and properties of a configuration that determine the compiled code."""

    config: Config

    @property
    def physics(self):
        """The table [physics]."""
        return self.config.physics

    @property
    def dimension(self) -> int:
        return self.config.problem.dimension

    @cached_property
    def domain(self) -> Domain:
        return Domain(self.config.problem.box, self.config.problem.boundaries)

    @cached_property
    def eos(self):
        return self.physics.eos_model()

    @property
    def has_individual_steps(self) -> bool:
        """Whether each particle has its own time step (`sph.individual`)."""
        return self.config.time.stepping == "individual"

    @property
    def lanes(self):
        """The arithmetic of sums over neighbours, see `sph.simd`."""
        return simd.SINGLE if self.is_single else simd.DOUBLE

    @property
    def is_single(self) -> bool:
        """Whether sums over neighbours are in single precision."""
        return self.config.run.precision == "single"

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The optional parts of the scene."""
        asked = [(kind.of(self), kind) for kind in parts.classes(self.physics.formulation)]
        there = [(part, kind) for part, kind in asked if part is not None]
        for part, kind in there:
            declarations.check_part(part, kind, optional=True)
        return tuple(part for part, _ in there)

    @cached_property
    def formulation(self) -> Formulation:
        kind = registry.part_class("sph.formulations", self.physics.formulation)
        found: Any = kind.of(self)
        declarations.check_part(found, kind, optional=False)
        return found

    @cached_property
    def all_parts(self) -> tuple[Part, ...]:
        """The formulation, followed by the optional parts. Raises DeclarationError."""
        found = (self.formulation, *self.parts)
        declarations.check_together(found, self.physics.kinds, self.formulation.roles)
        return found

    @cached_property
    def fields(self) -> tuple[Field, ...]:
        """The declarations of all arrays of the state."""
        found = tuple(field for part in self.all_parts for field in part.fields)
        return bins.fields(found, self.passes) if self.has_individual_steps else found

    @cached_property
    def passes(self) -> tuple[Pass, ...]:
        """The passes of a step, in the order in which they run."""
        found = [one for part in self.all_parts for one in part.passes]
        return tuple(sorted(found, key=lambda one: STAGES.index(one.stage)))

    @cached_property
    def rate_passes(self) -> tuple[Pass, ...]:
        """The passes between prediction and correction."""
        return tuple(one for one in self.passes if one.stage != STAGES[-1])

    @cached_property
    def last_passes(self) -> tuple[Pass, ...]:
        """The passes after the correction."""
        return tuple(one for one in self.passes if one.stage == STAGES[-1])

    @cached_property
    def keeps_momentum(self) -> np.ndarray:
        """(D,) 1.0 for axes along which momentum is conserved (no wall, no field), else 0.0."""
        kept = all(part.keeps_momentum for part in self.all_parts)
        return np.array([kept and kind != "mirror" for kind in self.domain.boundaries], dtype=float)

    @property
    def inexact_momentum(self) -> list[str]:
        """What makes forces of pairs differ from equal and opposite ones by more than round-off."""
        found = [part.title for part in self.all_parts if not part.exact_pairs]
        return found + ["individual time steps"] * self.has_individual_steps

    @cached_property
    def adds_energy(self) -> bool:
        """Whether a part adds energy, which does not count as energy drift."""
        return any(part.adds_energy for part in self.all_parts)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The columns of the history that only some scenes have."""
        found = ["held_supports"] * (self.max_support < math.inf)
        found += ["volume_ratio"] * self.is_filled
        found += [name for part in self.all_parts for name in part.columns]
        found += ["energy_added"] * self.adds_energy
        return (*found, *["shortest_step", "updates"] * self.has_individual_steps)

    @cached_property
    def is_filled(self) -> bool:
        """Whether gas fills a closed box, so that sum m/rho must equal the volume of the box."""
        return self.config.problem.fills_box(self.eos) and "open" not in self.domain.boundaries

    @property
    def max_support(self) -> float:
        """Upper limit of support radii; inf unless all axes are open."""
        if any(boundary != "open" for boundary in self.domain.boundaries):
            return math.inf
        return self.physics.max_support * self.domain.largest_side

    @cached_property
    def step_bounds(self) -> Bounds:
        """The limits on the time step that the configuration determines."""
        physics = self.physics
        held, criterion = physics.C, "signal_speed"
        for part in self.all_parts:
            most, by = part.largest_courant()
            if most < held:
                held, criterion = most, by
        return Bounds(
            held,
            criterion,
            physics.energy_limit,
            any(part.bounds_acceleration for part in self.all_parts),
            self.config.time.end,
        )

    def initial_state(self) -> InitialState:
        """Return the problem's particles.

        Raises ConfigError for numbers so extreme that placement fails: problems square lengths and
        count lattice cells before any particle can be checked.
        """
        problem = self.config.problem
        try:
            with np.errstate(all="ignore"):
                found = problem.initial(self.eos)
                return self._with_density(found) if self.evolves("density") else found
        except (ArithmeticError, ValueError) as error:
            raise ConfigError(
                f"problem.name = {problem.name}: particles cannot be placed with these settings "
                f"({error}).\nTry: numbers in [problem] closer to 1, and sides of problem.domain "
                "of similar length."
            ) from error

    def evolves(self, name: str) -> bool:
        """Return whether a part integrates the field of that name in time."""
        return any(one.value == name for part in self.all_parts for one in part.evolved)

    def _with_density(self, start: InitialState) -> InitialState:
        """Return `start` with the density of the particles, which the formulation integrates."""
        if "density" in start.others:
            return start
        exact = self.config.problem.exact(self.eos, 0.0, start.position)
        if exact is None or not exact["density"].min() > 0.0:
            raise ConfigError(
                f"physics.formulation = {value_text(self.physics.formulation)}: it integrates the "
                f"density in time, and problem.name = {self.config.problem.name} states no initial "
                "density.\nTry: another problem, or another formulation."
            )
        return start._replace(others={**start.others, "density": exact["density"]})

    def described(self) -> tuple[list[str], list[str]]:
        """Return descriptions of the compiled physics, and of the omitted physics with reasons."""
        inside = [
            f"{self.dimension}-D, {len(self.domain.images.sign)} image(s) of the box",
            f"sums over neighbours in {self.config.run.precision} precision",
        ]
        outside = []
        for part in self.all_parts:
            there, left_out = part.described()
            inside += there
            outside += [f"{what}: {why}" for what, why in left_out]
        given = {type(part) for part in self.parts}
        for kind in parts.classes(self.physics.formulation):
            if kind not in given:
                outside.append(f"{kind.title}: physics.{kind.keys[0].name} is not given")
        if self.has_individual_steps:
            inside.append("individual time steps")
        else:
            outside.append('individual time steps: time.stepping = "global"')
        limit = "time step limit u/|du/dt|"
        if self.physics.energy_limit:
            inside.append(limit)
        else:
            outside.append(f"{limit}: physics.energy_limit = false")
        return inside, outside
