"""Artificial viscosity: coefficient alpha (constant or by a switch) and Balsara factor.

A viscosity is a NamedTuple with the methods

    pair_alpha(alpha_i, alpha_j)    alpha of the pair (eq 24)
    start()                         alpha of every particle at t = 0
    largest()                       upper limit of alpha

and the class attribute `evolves`, which is False if alpha is constant (constant.py): a constant
needs no array. The viscosities in switches/ also have the method

    alpha_rate(alpha, h, sound_speed, divergence)    rate of change of alpha (eqs 27-28)

or, with the class attribute `finds_shocks`, which requires the pass over velocity gradients,

    alpha_after(alpha, dt, support, signal_speed, divergence, divergence_rate, shear, signs)

which returns alpha at the end of a step dt. signal_speed is the largest (c_i + c_j)/2 - w_ij within
the support H, divergence_rate is d(div v)/dt, shear is the sum of squares of the traceless rate of
strain, and signs is the kernel-weighted mean of sgn(div v_j).
"""

import math

from sph import registry
from sph.integrators.leapfrog import STRAIGHT
from sph.model import Model, Parameter
from sph.part import Evolved, Key, Part, Pass
from sph.state import Field, Public

SWITCHES = "sph.parts.viscosity.switches"

ALPHA = Field(
    "alpha",
    at_least=0.0,
    public=Public(
        "ViscosityParameters", 0, 0, 0, 0, "Coefficient alpha of the artificial viscosity"
    ),
)
ALPHA_RATE = Field("alpha_rate", remade=True)

# A larger alpha prevents interpenetration if alpha is small. If alpha is large, a smaller alpha
# reduces energy drift (docs/measurements.md, "Time step and viscosity").
SMALL_ALPHA, LARGE_ALPHA = 1.0, 2.0


class Coefficient(Model):
    """Defaults of a viscosity."""

    evolves = True
    finds_shocks = False


LOWEST = Parameter("smallest alpha: each alpha decays to this value", at_least=0.0)
HIGHEST = Parameter("largest alpha, approached in strong compression", at_least=0.0)


class Switch(Coefficient):
    """Base of switches: alpha is between `min` and `max`; a pair uses the mean of both."""

    min: float
    max: float

    @classmethod
    def required(cls):
        return "min", "max", "alpha_after" if cls.finds_shocks else "alpha_rate"

    def issues(self):
        if self.min > self.max:
            return [("min", f"= {self.min}: expected at most max = {self.max}")]
        return []

    def start(self):
        return self.min

    def largest(self):
        return self.max

    def pair_alpha(self, alpha_i, alpha_j):
        return 0.5 * (alpha_i + alpha_j)  # eq 24 with the mean of both in place of a constant


class Viscosity(Part):
    """The coefficient alpha, its evolution, and the Balsara factor."""

    keys = (
        Key(
            "alpha",
            "artificial viscosity: one coefficient alpha for all particles, or a table "
            "{ min, max } in which a switch sets alpha for each particle",
            kind=float,
            default=1.0,
            at_least=0.0,
            models=SWITCHES,
            label="switch",
            default_model="morris_monaghan",
            label_help="method that sets alpha from the compression of the gas",
            restart="same kind",
        ),
        Key(
            "balsara",
            "Balsara factor: reduces artificial viscosity where the flow shears or rotates; "
            "in 1-D, only where |div v| is below about 1e-4 c/H, with c the speed of sound",
            kind=bool,
            default=True,
        ),
    )
    formulations = ("gas",)
    reserves = ("alpha", "alpha_rate", "predicted_alpha", "balsara")
    changes_solution = False

    def __init__(self, coefficient, balsara, dimension: int):
        self.coefficient, self.balsara = coefficient, balsara
        self.dimension = dimension
        self.terms = {"viscosity": coefficient, "balsara": balsara}
        rates = coefficient.evolves and not coefficient.finds_shocks
        if coefficient.evolves:
            self.fields += (ALPHA,)
        if rates:
            self.fields += (ALPHA_RATE, Field("predicted_alpha", stored=False))
            self.evolved = (Evolved("alpha", "alpha_rate", "predicted_alpha", STRAIGHT),)
        balanced = balsara is not None  # a model without parameters is an empty tuple
        if balanced:
            self.fields += (Field("balsara", stored=False),)
        if balanced or coefficient.evolves:
            self.needs += ("div_v",)
        if balanced and dimension > 1:
            self.needs += ("curl_v",)
        if coefficient.finds_shocks:
            from sph.parts.viscosity._shocks import shocks

            self.passes = (
                Pass(
                    "gradients",
                    "viscosity",
                    shocks,
                    ("position", "predicted_velocity", "mass", "support", "density", "sound_speed",
                     "div_v", "acceleration"),
                    updates=("alpha",),
                    at_start=False,
                    takes_step=True,
                ),
            )  # fmt: skip

    @classmethod
    def of(cls, scene):
        from sph.parts.viscosity import balsara, constant

        alpha = scene.physics.alpha
        coefficient = (
            constant.ConstantAlpha(alpha)  # type: ignore[call-arg]
            if isinstance(alpha, float)
            else registry.model(SWITCHES, alpha.choice(), "switch")
        )
        factor = balsara.Balsara() if scene.physics.balsara else None
        return cls(coefficient, factor, scene.dimension)

    def described(self):
        inside, outside = [], []
        for there, what, why_not in (
            (self.coefficient.evolves, "equation for alpha", "alpha is constant"),
            (
                self.coefficient.finds_shocks,
                "gradients of velocity",
                "not needed by physics.alpha",
            ),
            (self.balsara is not None, "Balsara factor", "physics.balsara = false"),
            (
                "div_v" in self.needs,
                "divergence of velocity",
                "not needed by Balsara factor or alpha",
            ),
            (
                "curl_v" in self.needs,
                "curl of velocity",
                "no curl in 1-D" if self.dimension == 1 else "physics.balsara = false",
            ),
        ):
            if there:
                inside.append(what)
            else:
                outside.append((what, why_not))
        return inside, outside

    def start(self, state):
        if self.coefficient.evolves:
            state.alpha[:] = self.coefficient.start()

    def largest_courant(self):
        # 2 alpha C + 4 C^2 = 1 (docs/equations.md); without viscosity it is the leapfrog's own
        alpha = self.coefficient.largest()
        stable = 1.0 / (alpha + math.hypot(2.0, alpha))
        return stable, self.name if alpha > 2.0 * stable else "signal_speed"

    @classmethod
    def criterion_words(cls, criterion):
        reason = "signal speed, with C reduced for physics.alpha"
        return reason if criterion == cls.name else None

    def held_words(self, criterion):
        return "physics.alpha" if criterion == self.name else None

    def remedies(self, trouble, held_by):
        if trouble == "long steps":
            if self.coefficient.largest() > LARGE_ALPHA:
                return ["a smaller physics.alpha"]
            if self.coefficient.largest() < SMALL_ALPHA:
                return ["a larger physics.alpha if particles pass through each other"]
        if trouble == "short steps" and held_by == self.name:
            return ["a smaller value of physics.alpha"]
        return []
