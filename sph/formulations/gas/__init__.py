"""Compressible gas by grad-h SPH: density, pair forces and internal energy."""

from typing import Literal, NamedTuple

import numpy as np

from sph import declarations, faults, kernels, registry
from sph.eos import is_ideal
from sph.formulations import Formulation
from sph.formulations.gas.density import density
from sph.formulations.gas.rates import rates
from sph.formulations.gas.smoothing import Smoothing
from sph.formulations.gas.thermodynamics import predict
from sph.formulations.gas.weighting import ByMass, ByNumber
from sph.integrators.leapfrog import POSITIVE
from sph.part import Evolved, Key, Pass
from sph.state import COMMON, Field

SCHEMES = "sph.formulations.gas.schemes"

# Relative tolerance of a converged support radius, by precision of the sums over neighbours. The
# round-off of a density sum is about 1e-14 in double precision and 1e-7 in single precision.
TOLERANCES = {"double": 1e-10, "single": 1e-6}

FIELDS = (*COMMON, Field("omega"))


class Models(NamedTuple):
    """The models in the formulas. Their types, not their parameters, decide the compiled code."""

    scheme: tuple
    kernel: tuple
    smoothing: tuple
    weighting: tuple
    eos: tuple
    viscosity: tuple
    exchange: tuple | None
    balsara: tuple | None
    support_ratio: float  # H/h of the kernel
    eta: float
    max_support: float  # upper limit of H; inf for no limit


class Gas(Formulation):
    """Density, smoothing lengths, thermodynamics and rates."""

    keys = (
        Key(
            "eta",
            "smoothing length h divided by the local particle spacing (m/rho)^(1/D), in D "
            "dimensions; larger values give more neighbours",
            kind=float,
            default=1.6,
            above=0.0,
        ),
        Key(
            "allow_pairing",
            "allow a spline kernel at values of eta for which its particles form close pairs (the "
            "pairing instability)",
            kind=bool,
            default=False,
        ),
        Key(
            "scheme",
            "pair force: how a pair of neighbours accelerate each other and exchange energy; "
            "`sph list` describes each",
            default="grad_h",
            models=SCHEMES,
        ),
        Key(
            "density",
            'density estimate of a particle: "mass" sums m_j W over the neighbours; "number" sums '
            "W over the neighbours and multiplies by the particle's own mass, which is better for "
            "unequal masses and identical for equal masses",
            kind=Literal["mass", "number"],
            default="mass",
        ),
        Key(
            "density_passes",
            "number of iterations per step for density and smoothing length, which depend on each "
            'other; "converged" iterates until both are constant to 1e-10',
            kind=int | Literal["converged"],
            default=2,
            at_least=1,
            at_most=100,  # more iterations change nothing but the time that a step takes
        ),
    )
    neighbours_key = "physics.eta"
    individual_steps = True
    roles = ("viscosity", "balsara", "exchange")
    reserves = ("pressure", "energy_shift", "div_v", "curl_v")
    evolved = (Evolved("internal_energy", "energy_rate", "predicted_energy", POSITIVE),)

    def __init__(self, scene):
        physics = scene.physics
        terms = {role: model for part in scene.parts for role, model in part.terms.items()}
        needs = {name for part in scene.parts for name in part.needs}
        needs |= {"div_v"} if scene.has_individual_steps else set()  # predicts densities
        self.scheme = registry.model(SCHEMES, physics.scheme)
        self.dimension = scene.dimension
        self.density_passes = physics.density_passes
        self.density = physics.density
        self.exchanges = terms.get("exchange") is not None
        self.bounds_acceleration = (
            physics.density == "number"
        )  # the signal speed does not contain unequal masses
        sums = self.scheme.sums_pressure
        self.fields = (*FIELDS, Field("pressure_term", stored=False))
        if sums or self.exchanges:
            self.fields += (Field("pressure", stored=sums, remade=True),)
        if sums:
            self.fields += (Field("energy_shift", stored=False),)
        self.fields += tuple(
            Field(name, stored=False) for name in ("div_v", "curl_v") if name in needs
        )
        tolerance = TOLERANCES[scene.config.run.precision]
        self.starting_models = self._models(scene, terms, Smoothing(0, tolerance))
        passes = 0 if physics.density_passes == "converged" else physics.density_passes
        self.models = self._models(scene, terms, Smoothing(passes, tolerance))
        declarations.check_on_vectors(self.models)
        self.eos = self.models.eos
        self.idle = ("check",) if self.eos.lowest_energy is None else ()
        self.passes = self._passes(scene)

    @classmethod
    def of(cls, scene):
        return cls(scene)

    @classmethod
    def issues(cls, physics, problem):
        if physics.materials:
            return [("formulation", 'expected "continuum", which has physics.materials')]
        scheme = registry.model(SCHEMES, physics.scheme)
        eos = physics.eos_model()
        if eos.under_tension:
            return [(
                "eos", f"{eos.name} may have a negative pressure, which the gas formulation does "
                'not take. Try: physics.formulation = "continuum", or the equation of state '
                "ideal_gas or stiffened_gas"
            )]  # fmt: skip
        if scheme.sums_pressure and not is_ideal(eos):
            return [("scheme", f"expected an ideal gas, not {physics.shown('eos')}")]
        return []

    def _models(self, scene, terms, smoothing) -> Models:
        physics = scene.physics
        kernel = physics.kernel_model()
        return Models(
            scheme=self.scheme,
            kernel=kernel,
            smoothing=smoothing,
            weighting=ByNumber() if physics.density == "number" else ByMass(),
            eos=scene.eos,
            viscosity=terms["viscosity"],
            exchange=terms.get("exchange"),
            balsara=terms["balsara"],
            support_ratio=kernels.support_ratio(kernel, scene.dimension),
            eta=float(physics.eta),
            max_support=scene.max_support,
        )

    def _passes(self, scene) -> tuple[Pass, ...]:
        """Return the two passes, with the fields that this scene has."""
        declared = {field.name for part in (self, *scene.parts) for field in part.fields}

        def of(*names):
            return tuple(name if name in declared else None for name in names)

        gas = ("position", "predicted_velocity", "mass", "predicted_energy", "support")
        exchanged = "predicted_energy" if self.exchanges else None
        alpha = "predicted_alpha" if "predicted_alpha" in declared else "alpha"
        prediction = Pass(
            "prediction",
            "density",
            predict,
            ("predicted_energy", "support", "density", "omega", *of("div_v", "curl_v")),
            of("pressure", "pressure_term", "sound_speed", "balsara"),
            at_start=False,
        )
        # a pressure that is a sum over neighbours cannot be predicted for one particle
        is_predicted = scene.has_individual_steps and not self.scheme.sums_pressure
        return (
            *[prediction] * is_predicted,
            # steps 2-4 and 6: density, support, Omega, div v, curl v, EOS and rate of alpha
            Pass(
                "density",
                "density",
                density,
                of(*gas, "predicted_alpha"),
                of("support_before", "density", "omega", "pressure", "energy_shift", "div_v",
                   "curl_v", "pressure_term", "sound_speed", "balsara", "alpha_rate"),
                swaps=("support", "support_before"),
                widens=True,
                models_at_start=self.starting_models,
            ),
            # step 5: acceleration, du/dt, and the signal speed of each particle
            Pass(
                "rates",
                "rates",
                rates,
                of(*gas, "density", "pressure_term", "sound_speed", alpha, "balsara", "pressure",
                   "energy_shift", exchanged, "exchange_share"),
                ("acceleration", "energy_rate", "signal_speed"),
            ),
        )  # fmt: skip

    @property
    def label(self):
        return self.scheme.name

    def remake(self, state, missing):
        if "pressure" in missing and self.scheme.sums_pressure:
            state.pressure[:] = self.eos.pressure(state.density, state.internal_energy)

    def pressure(self, state):
        # a restart that changes the scheme writes a state without the sum
        if self.scheme.sums_pressure and state.get("pressure") is not None:
            return state.pressure
        return self.eos.pressure(state.density, state.internal_energy)

    def described(self):
        kernel = self.models.kernel
        flattened = ", gradient flattened" if kernel.flattened else ""
        inside = [
            f"scheme {self.scheme.name}, kernel {kernel.name}{flattened}",
            f"density by {self.density}",
            f"equation of state {self.eos.name}",
            "supports converged to 1e-10"
            if self.density_passes == "converged"
            else f"{self.density_passes} density pass(es)",
        ]
        sums = "pressure sum over neighbours"
        if self.scheme.sums_pressure:
            return [*inside, sums], []
        return inside, [(sums, f"{self.scheme.name} computes pressure from density")]

    def check(self, simulation):
        """Raise NumericalError if tension makes the sound speed of a particle imaginary."""
        if "check" in self.idle:
            return
        p = simulation.particles
        above = p.internal_energy - self.eos.lowest_energy(p.density)
        if not (above <= 0.0).any():
            return
        i = int(np.nanargmin(above))
        raise faults.fault(
            simulation,
            f"particle {p.id[i]} is under more tension than its equation of state allows: "
            f"density {p.density[i]:.6g}, internal energy {p.internal_energy[i]:.6g}",
            "a weaker rarefaction, more particles, or a boundary other than open, at which the "
            "density sum lacks neighbours",
            int(p.id[i]),
        )
