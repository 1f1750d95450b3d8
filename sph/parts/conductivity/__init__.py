"""Artificial conductivity: heat that flows between neighbours to smooth a contact.

A conductivity is a file that holds a NamedTuple with the method

    exchange_speed(pressure_i, pressure_j, density_i, density_j, w_ij)    speed of the exchange

where w_ij <= 0 is the speed of approach (eq 26). The pair then exchanges energy at the rate
m_j exchange_speed (u_i - u_j) / rho_ij (dW/dr), equal and opposite for the two. A field `switched`
tells whether that is times the mean of the two particles' shares, found by the pass over contacts.
The class attribute `suits_gravity` tells whether it rests in equilibrium with an external field.
"""

from sph import registry
from sph.model import Model
from sph.part import Key, Part, Pass
from sph.parts.conductivity._contacts import contacts
from sph.state import Field

FOLDER = "sph.parts.conductivity"

# The strength times C beyond which the leapfrog is unstable (docs/measurements.md, "Time step and
# viscosity").
LARGEST = 1.5


class Exchange(Model):
    """What a conductivity may leave out."""

    suits_gravity = True
    switched = False


class Conductivity(Part):
    """A term of the energy equation, and where it is switched the pass that finds contacts."""

    title = "artificial conductivity"
    keys = (
        Key(
            "conductivity",
            "artificial conductivity: smooths contacts by exchanging internal energy between "
            "neighbours; `switched` limits it to contacts; none if not given",
            models=FOLDER,
            example={"name": "pressure_jump", "strength": 1.0, "switched": True},
        ),
    )
    formulations = ("gas",)
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
                    self._find_contacts,
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
                "this model acts wherever pressure varies, which with "
                f"physics.{balanced[0]} it does in equilibrium; expected a model that does not. "
                'Try: "approach"',
            )
        ]

    def described(self):
        switch = "switch of conductivity"
        if self.exchange.switched:
            return [self.title, switch], []
        return [self.title], [(switch, "no conductivity asks for it")]

    def _find_contacts(self, sweep) -> None:
        s = sweep.state
        sweep.run(
            contacts, sweep.models, s.position, s.predicted_velocity, s.mass, s.predicted_energy,
            s.support, s.density, s.sound_speed, s.exchange_share,
        )  # fmt: skip

    def largest_courant(self):
        return LARGEST / self.exchange.strength if self.exchange.strength else float(
            "inf"
        ), self.name

    def criterion_words(self, criterion):
        if criterion == self.name:
            return "the strength of physics.conductivity and the speed of its signals"
        return None

    def held_words(self, criterion):
        return "the strength of physics.conductivity" if criterion == self.name else None

    def remedies(self, trouble, held_by):
        if trouble == "long steps" and held_by == self.name:
            return ["a smaller strength of physics.conductivity"]
        if trouble == "short steps" and held_by == self.name:
            return [f"less of what sets it: {self.held_words(held_by)}"]
        return []
