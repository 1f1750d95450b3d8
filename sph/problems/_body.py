"""The table [[problem.body]] of the problem `bodies`: one body."""

from typing import ClassVar, Literal

from pydantic import Field

from sph.problems._shapes import Length, Point, Shaped
from sph.problems.base import Fault
from sph.problems.support import bodies as placement


class Body(Shaped):
    """One body: its shape and sizes, how particles fill it, its material and its motion."""

    vectors: ClassVar = (*Shaped.vectors, "velocity")

    shape: Literal["box", "disc", "sphere", "ring", "cylinder", "tube"] = Field(
        description="shape; a disc and a ring are 2-D, a sphere, a cylinder and a tube 3-D"
    )
    centre: Point | None = Field(
        default=None,
        description="centre of all other shapes; on a mirror, the half inside the domain is placed",
        examples=[[0.5, 0.5]],
    )
    lattice: Literal["cubic", "hexagonal", "bcc", "fcc"] = Field(
        default="cubic",
        description="lattice of the particles; hexagonal in 2-D, bcc and fcc in 3-D",
    )
    spacing: Length | None = Field(
        default=None,
        description="(volume of a particle)^(1/D), adjusted to fit the shape; if not given, the "
        "same for all bodies without it, so that these have problem.n particles",
    )
    velocity: Point | None = Field(
        default=None, description="velocity; at rest if not given", examples=[[0.1, 0.0]]
    )
    material: str | None = Field(
        default=None, description="name in physics.materials; required if that is given"
    )
    density: Length | None = Field(
        default=None,
        description="density; rho_0 of the material if not given; required for a gas",
    )
    pressure: float | None = Field(
        default=None,
        description="pressure; 0 if not given; required for a gas, and refused where it follows "
        "from the density alone",
    )
    clamped: bool = Field(
        default=False, description="whether the particles keep their initial velocity, as in jaws"
    )

    def misfits(self, dimension: int) -> list[Fault]:
        """Return what does not exist in that number of dimensions."""
        faults = super().misfits(dimension)
        if self.lattice not in placement.LATTICES[dimension]:
            listed = ", ".join(f'"{name}"' for name in placement.LATTICES[dimension])
            text = f'= "{self.lattice}": expected one of {listed} in {dimension}-D'
            faults.append(Fault(("lattice",), text))
        return faults
