"""Artificial conductivity: exchange of internal energy, which smooths contacts.

A conductivity is a file with a NamedTuple that has the method

    exchange_speed(pressure_i, pressure_j, density_i, density_j, w_ij)    speed of the exchange

where w_ij <= 0 is the speed of approach (eq 26). Particle i gains internal energy per unit mass
from particle j at the rate m_j exchange_speed (u_i - u_j) / rho_ij (dW/dr); the energies that the
two particles exchange are equal and opposite. If the parameter `switched` is true, the rate is
multiplied by the mean of `exchange_share` of both particles, which the pass over contacts computes.
The class attribute `suits_gravity` is true if there is no exchange in hydrostatic equilibrium in an
external field.
"""

import math

from sph import registry
from sph.model import Model
from sph.part import Key, Part, Pass
from sph.parts.conductivity._contacts import contacts
from sph.state import Field

FOLDER = "sph.parts.conductivity"

# Largest strength times C at which the leapfrog is stable (docs/measurements.md, "Time step and
# viscosity").
LARGEST = 1.5


class Exchange(Model):
    """Defaults of a conductivity."""

    suits_gravity = True
    switched = False

    @classmethod
    def required(cls):
        return "exchange_speed", "strength"


class Conductivity(Part):
    """A term of the energy equation, with a pass that finds contacts if `switched` is true."""

    title = "artificial conductivity"
    keys = (
        Key(
            "conductivity",
            "artificial conductivity: smooths contacts by exchanging internal energy between "
            "neighbours; `switched` limits the exchange to contacts; none if not given",
            models=FOLDER,
            example={"name": "pressure_jump", "strength": 1.0, "switched": True},
        ),
    )
    formulations = ("gas",)
    reserves = ("exchange_share",)
    changes_solution = False

    def __init__(self, exchange):
        self.exchange = exchange
        self.terms = {"exchange": exchange}
        if exchange.switched:
            self.fields = (Field("exchange_share", stored=False),)
            self.passes = (
                Pass(
                    "gradients",
                    "conductivity",
                    contacts,
                    ("position", "predicted_velocity", "mass", "predicted_energy", "support",
                     "density", "sound_speed"),
                    ("exchange_share",),
                ),
            )  # fmt: skip

    @classmethod
    def of(cls, scene):
        exchange = registry.model(FOLDER, scene.physics.conductivity)
        return None if exchange is None else cls(exchange)

    @classmethod
    def issues(cls, physics, problem):
        exchange = registry.model(FOLDER, physics.conductivity)
        balanced = physics.given(balances_pressure=True)
        if exchange is None or exchange.suits_gravity or not balanced:
            return []
        return [
            (
                "conductivity",
                "this model acts wherever pressure varies, but with "
                f"physics.{balanced[0]} pressure varies even in equilibrium; expected a model that "
                'does not act in equilibrium. Try: "approach"',
            )
        ]

    def described(self):
        switch = "switch of conductivity"
        if self.exchange.switched:
            return [self.title, switch], []
        return [self.title], [(switch, "physics.conductivity is not switched")]

    def largest_courant(self):
        strength = self.exchange.strength
        return (LARGEST / strength if strength else math.inf), self.name

    @classmethod
    def criterion_words(cls, criterion):
        if criterion == cls.name:
            return "signal speed, with C reduced for the strength of physics.conductivity"
        return None

    def held_words(self, criterion):
        return "the strength of physics.conductivity" if criterion == self.name else None

    def remedies(self, trouble, held_by):
        if trouble == "long steps" and held_by == self.name:
            return ["a smaller strength of physics.conductivity"]
        if trouble == "short steps" and held_by == self.name:
            return [f"a smaller value of {self.held_words(held_by)}"]
        return []
