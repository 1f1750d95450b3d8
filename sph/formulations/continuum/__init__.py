"""Fluids and solids by SPH of the continuum equations: evolved density, corrected kernel."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from sph.formulations import Formulation
from sph.formulations.continuum import fields, pieces, schedule, soundness
from sph.formulations.continuum.material import Material
from sph.part import Key
from sph.quantity import Quantity

STRENGTH = "sph.formulations.continuum.strength"

# Support radius over the smoothing length d of the equations.
SUPPORT_RATIO = 2.0

# Largest stable Courant number. Viscosity damps differences between neighbours at a rate of up to
# 2.6 Q/d (all pairs of a line of particles approaching, spacing ratio 1.5; less in 2-D and 3-D, and
# at 1.2), and a step is C d/Q where viscosity rules: 2.6 C < 1 (see `integrators.step_size`). Where
# it does not, waves have w < 1.1 c/d, which the leapfrog bears up to C = 0.9.
LARGEST_COURANT = 0.38

CORRECTIONS = {
    "corrections_failed": Quantity("number of particles at which correction 1 fell back to 0")
}


class ContinuumModels(NamedTuple):
    """The models in the formulas. Their types, not their parameters, decide the compiled code."""

    kernel: tuple
    eos: tuple  # of the first material
    q_a: float
    q_b: float
    support_ratio: float  # H/d
    eta: float  # d over the particle spacing
    max_support: float  # upper limit of H; inf for no limit


class Continuum(Formulation):
    """Continuity, kernel correction, constitutive laws and rates."""

    defaults = {"kernel": "cubic_spline", "energy_limit": False, "C": 0.3}  # noqa: RUF012
    neighbours_key = "physics.spacing_ratio"
    keys = (
        Key(
            "spacing_ratio",
            "smoothing length d divided by the local particle spacing (m/rho)^(1/D), in D "
            "dimensions; the support radius is 2 d; larger values give more neighbours",
            kind=float,
            default=1.2,
            at_least=0.9,  # gradients on a lattice are 4 % too small, and 16 to 20 % at 0.8
        ),
        Key(
            "correction",
            "order of the kernel correction: -1 for none; 0 for a kernel whose sum over the "
            "neighbours is 1; 1 for exact gradients of linear fields, also at free surfaces",
            kind=Literal[-1, 0, 1],
            default=0,
            restart="refused",  # order 1 has a column of its own in the history
        ),
        Key("q_a", "coefficient of the quadratic artificial viscosity", kind=float, default=2.0,
            at_least=0.0),
        Key("q_b", "coefficient of the linear artificial viscosity", kind=float, default=1.0,
            at_least=0.0),
        Key(
            "balsara",
            "Balsara factor: reduces artificial viscosity where the flow shears or rotates",
            kind=bool,
            default=True,
        ),
        Key(
            "strength",
            "law for the deviatoric stress of a solid; a fluid if not given",
            models=STRENGTH,
            restart="refused",
            example={"name": "elastic", "shear_modulus": 1.0},
        ),
        Key(
            "tensile_correction",
            "coefficient of the tensile correction, which repels close particles of a solid under "
            "tension so that they do not form clumps (Gray et al. 2001 use 0.3); 0 for none",
            kind=float,
            default=0.0,
            at_least=0.0,
            restart="same kind",
        ),
        Key(
            "allow_tearing",
            "let a run go on in which a solid body has torn into pieces, although no law of "
            "fracture says where it breaks",
            kind=bool,
            default=False,
            restart="free",
        ),
    )  # fmt: skip
    reserves = (
        "pressure", "stress", "deviatoric_stress",
        "plastic_strain", "material", "clamped", "balsara", "kernel_factor", "kernel_gradient",
        "kernel_matrix", "tension", "initial_support", "body",
    )  # fmt: skip
    columns: Mapping[str, Quantity] = CORRECTIONS
    bounds_acceleration = True  # cold matter at rest has no other bound

    def __init__(self, scene):
        physics = scene.physics
        self.dimension = scene.dimension
        self.domain = scene.domain
        self.order = physics.correction
        self.spacing_ratio = float(physics.spacing_ratio)
        self.allows_tearing = physics.allow_tearing
        self.is_clamped = scene.config.problem.clamps
        self.keeps_momentum = not self.is_clamped
        self.has_balsara = physics.balsara
        self.tensile_correction = float(physics.tensile_correction)
        self.names = tuple(physics.materials_models())
        self.materials = tuple(
            Material(float(number), eos, strength, self.tensile_correction)
            for number, (eos, strength) in enumerate(physics.materials_models().values())
        )
        self.eos = self.materials[0].eos
        strengths = [one.strength for one in self.materials if one.strength is not None]
        self.is_solid = bool(strengths)
        self.yields = any(one.yields for one in self.materials)
        self.corrects_tension = self.is_solid and self.tensile_correction > 0.0
        self.models = ContinuumModels(
            kernel=physics.kernel_model(),
            eos=self.eos,
            q_a=float(physics.q_a),
            q_b=float(physics.q_b),
            support_ratio=SUPPORT_RATIO,
            eta=self.spacing_ratio,
            max_support=scene.max_support,
        )
        self.fields = fields.of(self)
        self.evolved = fields.evolved(self)
        self.passes = schedule.of(self)
        self.columns = CORRECTIONS if self.order == 1 else {}
        # `check` only names the particle: a NaN is in the sums of the step, always checked
        self.idle = ("check",) if self.order == 1 else ("check", "sums")

    @classmethod
    def of(cls, scene):
        return cls(scene)

    @classmethod
    def issues(cls, physics, problem):
        found = []
        if physics.materials is not None and not physics.materials:
            found.append(("materials", "expected at least one material"))
        for key in ("eos", "strength"):
            if physics.materials and getattr(physics, key) is not None:
                text = "expected it in the tables of physics.materials, which are given"
                found.append((key, text))
        return found

    def largest_courant(self):
        return LARGEST_COURANT, "signal_speed"

    # --- state ---

    def start(self, state):
        if not self.is_solid:
            return
        spacing = (state.mass / state.density) ** (1.0 / self.dimension)
        support = SUPPORT_RATIO * self.spacing_ratio * spacing
        if self.corrects_tension:
            state.initial_support[:] = support
        strengths = np.array([one.strength is not None for one in self.materials])
        material = state.get("material")
        kind = np.zeros(state.number) if material is None else material
        pieces.start(state, support, self.domain, strengths[kind.astype(int)])

    def remake(self, state, missing):
        if "initial_support" in missing:  # the density of a solid has changed little
            self.start(state)

    def pressure(self, state):
        return self._by_material(state, lambda one, rho, u: one.eos.pressure(rho, u))

    def sound_speed(self, state):
        def of(one, rho, u):
            c = one.eos.sound_speed(rho, one.eos.pressure(rho, u))
            G = 0.0 if one.strength is None else one.strength.shear_modulus
            return np.sqrt(c * c + 4.0 / 3.0 * G / rho)  # eq 415

        return self._by_material(state, of)

    def stress(self, state) -> np.ndarray:
        """Return the stress tensor (3, 3, N) of the state at the end of a step.

        Directions that the scene lacks are those of plane strain (2-D) and uniaxial strain (1-D).
        """
        D, found = self.dimension, np.zeros((3, 3, state.number))
        if self.is_solid:
            found[:D, :D] = state.deviatoric_stress
            for d in range(D, 3):  # S stays traceless
                found[d, d] = -np.trace(state.deviatoric_stress) / (3 - D)
        found[np.arange(3), np.arange(3)] -= self.pressure(state)
        return found

    def _by_material(self, state, formula: Any) -> np.ndarray:
        """Return formula(material, density, internal energy), (N,)."""
        if len(self.materials) == 1:
            return formula(self.materials[0], state.density, state.internal_energy)
        found = np.empty(state.number)
        for one in self.materials:
            there = state.material == one.number
            found[there] = formula(one, state.density[there], state.internal_energy[there])
        return found

    def pieces(self, state):
        return pieces.of(state, self.domain) if self.is_solid else None

    def sums(self, state):
        """Return corrections_failed: the number of particles at which order 1 fell back to 0."""
        if self.order != 1:
            return {}
        # the kernel has a gradient of its own only there
        return {"corrections_failed": float(state.kernel_gradient.any(axis=0).sum())}

    def derived(self, state):
        found = super().derived(state)
        if self.is_solid:
            found.append((fields.STRESS, self.stress(state)))
        return found

    # --- words ---

    @property
    def label(self):
        return "continuum"

    def described(self):
        kernel = self.models.kernel
        inside = [
            f"continuum equations, kernel {kernel.name}, correction of order {self.order}",
            "density by the equation of continuity",
        ]
        outside = []
        for name, one in zip(self.names, self.materials, strict=True):
            of = f"material {name}: " * (len(self.materials) > 1)
            inside.append(f"{of}equation of state {one.eos.name}")
            if one.strength is not None:
                inside.append(f"{of}strength {one.strength.name}")
        for there, what, why_not in (
            (self.is_solid, "stress tensor", "physics.strength is not given"),
            (self.corrects_tension, "tensile correction", "physics.tensile_correction is 0"
             if self.is_solid else "fluids do not need it"),
            (self.has_balsara, "Balsara factor", "physics.balsara = false"),
            (self.is_clamped, "clamped particles", "the problem has none"),
            (len(self.materials) > 1, "several materials", "the scene has one"),
        ):  # fmt: skip
            if there:
                inside.append(what)
            else:
                outside.append((what, why_not))
        return inside, outside

    def check(self, simulation):
        soundness.check(simulation, self.materials)

    def check_output(self, simulation):
        """Raise NumericalError if a solid body has torn."""
        if self.is_solid and not self.allows_tearing:
            pieces.check(simulation)
