"""Self-gravity in 3-D: a tree code with the kernel's own softening.

The force between particles closer than a support radius is that of masses with the density of the
SPH kernel (Price & Monaghan 2007), so it is exactly Newton's beyond. Distant groups of particles
act through their multipole moments (`_tree`, `_forces`).

An expansion is a file with a NamedTuple that has the parameters G, softening and opening_angle and,
for compiled code, the method

    attraction(m, Q, OCT, r, r_inv)    (pull, depth) by nodes at -r, which has the length 1/r_inv
    moments()                        number of components of Q and OCT that `attraction` reads

where m, Q and OCT are mass, quadrupole and octupole of the nodes (`_tree`). The acceleration is
-G times pull, and the potential -G times depth. The name of the file is the value of `order`.
"""

from collections.abc import Mapping
from typing import Annotated, Literal, NamedTuple

import numpy as np

from sph import kernels, registry
from sph.compiled import verb
from sph.formulations.gas.weighting import ByMass, ByNumber
from sph.model import Model, Parameter
from sph.part import Key, Part, Pass
from sph.quantity import ENERGY, Quantity
from sph.state import Field, Public
from sph.threads import SMALLEST_RANGE

FOLDER = "sph.parts.gravity"

# The largest node that may act as one group is OPENING_ANGLE times its distance: errors and costs
# of other values are in docs/gravity.md.
OPENING_ANGLE = 0.5

Constant = Annotated[float, Parameter("gravitational constant", above=0.0)]
Softening = Annotated[
    float | Literal["adaptive"],
    Parameter(
        '"adaptive": softening by the kernel of each particle, whose support follows the density; '
        "a number: by a kernel of this support radius for all particles. The force between two "
        "particles further apart than the support radius is exactly Newton's",
        above=0.0,
    ),
]
Angle = Annotated[
    float,
    Parameter(
        "a group of particles acts as a whole if its radius is below this fraction of its "
        "distance; smaller values are more accurate and slower",
        above=0.0,
    ),
]

POTENTIAL = Field(
    "potential",
    public=Public("Potentials", 2, 0, -2, -1, "Gravitational potential per unit mass"),
)
ZETA = Field("zeta", stored=False)


class Expansion(Model):
    """Defaults of an expansion."""

    opening_angle: float

    @classmethod
    def required(cls):
        return "attraction", "moments", "G", "softening", "opening_angle"

    def issues(self):
        if not self.opening_angle < 1.0:  # the series need not converge
            return [("opening_angle", f"= {self.opening_angle}: expected less than 1")]
        return []


@verb
def attraction(self, m, Q, OCT, r, r_inv):
    return self.attraction(m, Q, OCT, r, r_inv)


@verb
def moments(self):
    return self.moments()


attraction.takes_vectors = moments.takes_vectors = False  # type: ignore[attr-defined]


class GravityModels(NamedTuple):
    """The models in the compiled loops."""

    expansion: tuple
    kernel: tuple
    weighting: tuple


class Gravity(Part):
    """Acceleration and potential of all particles by all particles."""

    title = "self-gravity"
    keys = (
        Key(
            "gravity",
            "self-gravity of the gas, in 3-D with open boundaries; none if not given. The table "
            "may be empty",
            models=FOLDER,
            label="order",
            default_model="octupole",
            label_help="multipole moments of distant groups of particles",
            example={"G": 1.0},
            restart="same kind",
        ),
    )
    formulations = ("gas",)
    reserves = ("potential", "zeta")
    balances_pressure = True
    columns: Mapping[str, Quantity] = {
        "gravitational_energy": Quantity("potential energy of self-gravity", ENERGY)
    }
    bounds_acceleration = True
    exact_pairs = False  # a node acts on particles that do not act on it

    def __init__(self, expansion, kernel, weighting):
        self.expansion = expansion
        self.is_adaptive = expansion.softening == "adaptive"
        length = 0.0 if self.is_adaptive else expansion.softening
        self.models = GravityModels(expansion._replace(softening=length), kernel, weighting)
        self.fields = (POTENTIAL,)
        if self.is_adaptive:
            from sph.parts.gravity._zeta import find_zeta

            self.fields += (ZETA,)
            reads = ("position", "mass", "support", "density", "omega")
            self.passes = (Pass("gradients", "gravity", find_zeta, reads, writes=("zeta",)),)
        self.passes += (
            Pass(
                "additions",
                "gravity",
                self._attract,
                ("position", "mass", "support", "zeta" if self.is_adaptive else None),
                updates=("acceleration",),
                writes=("potential",),
                takes_sweep=True,
            ),
        )

    @classmethod
    def of(cls, scene):
        if scene.physics.gravity is None:
            return None
        expansion = registry.model(FOLDER, scene.physics.gravity.choice(), "order")
        weighting = ByNumber() if scene.physics.density == "number" else ByMass()
        return cls(expansion, scene.physics.kernel_model(), weighting)

    @classmethod
    def issues(cls, physics, problem):
        if physics.gravity is None:
            return []
        if problem.dimension != 3:
            return [("gravity", _not_in(problem.dimension))]
        found = []
        closed = [kind for kind in problem.boundaries if kind != "open"]
        if closed:
            found.append(
                (
                    "gravity",
                    f"expected open boundaries on all axes, not {closed[0]}: the force of the "
                    "images of the box is not computed. Try: problem.boundary = "
                    '"open", or another problem',
                )
            )
        kernel = physics.kernel_model()
        if not kernels.softens(kernel):
            found.append(
                (
                    "gravity",
                    f'the kernel "{kernel.name}" has no methods enclosed_over_q3 and '
                    "potential_depth, which soften the force. Try: another physics.kernel, or add "
                    "these methods to the kernel",
                )
            )
        return found

    def described(self):
        length = self.expansion.softening
        by = "H of each particle" if self.is_adaptive else f"H = {length:g} for all particles"
        return [
            self.title,
            f"multipole moments to the {self.expansion.name}, softening by {by}",
        ], []

    def _attract(self, sweep, position, mass, support, zeta, acceleration, potential) -> None:
        """Add the acceleration (D, N) by gravity, and set the potential (N,)."""
        from sph.parts.gravity import _tree
        from sph.parts.gravity._forces import attract

        if not self.is_adaptive:
            support = np.full(mass.size, self.expansion.softening)
        nodes = _tree.build(position, mass, support, sweep.team)
        sweep.team.run(
            attract, nodes.groups.size - 1, sweep.dim, self.models, sweep.neighbours, nodes,
            position, mass, support, zeta, acceleration, potential, smallest=SMALLEST_RANGE // 8,
        )  # fmt: skip

    def energies(self, state):
        return {"gravitational_energy": 0.5 * state.potential}

    def remedies(self, trouble, held_by):
        if trouble == "drift":
            return ["a smaller physics.gravity.opening_angle"]
        if trouble == "short steps" and held_by == "acceleration":
            return ["a larger number for physics.gravity.softening"]
        return []


def _not_in(dimension: int) -> str:
    return (
        f"expected problem.dimension = 3, not {dimension}: particles in {dimension}-D are "
        "infinite sheets or lines, which do not attract each other with 1/r^2"
    )
