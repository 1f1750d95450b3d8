"""The table [[problem.body]] of the problem `bodies`: one body."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from sph.problems import base
from sph.problems.base import Fault
from sph.problems.support import bodies as placement

# Keys of each shape, and the number of dimensions in which it exists; None for all.
KEYS = {
    "box": ("low", "high"),
    "disc": ("centre", "radius"),
    "sphere": ("centre", "radius"),
    "ring": ("centre", "inner", "outer"),
    "cylinder": ("centre", "radius", "length", "axis"),
    "tube": ("centre", "inner", "outer", "length", "axis"),
}
DIMENSION = {"disc": 2, "ring": 2, "sphere": 3, "cylinder": 3, "tube": 3}
SIZES = ("low", "high", "centre", "radius", "inner", "outer", "length", "axis")
VECTORS = ("low", "high", "centre", "velocity")

Length = Annotated[float, Field(gt=0.0)]
Point = Annotated[list[float], Field(min_length=1, max_length=3)]


class Body(base.Section):
    """One body: its shape and sizes, how particles fill it, its material and its motion."""

    shape: Literal["box", "disc", "sphere", "ring", "cylinder", "tube"] = Field(
        description="shape; a disc and a ring are 2-D, a sphere, a cylinder and a tube 3-D"
    )
    low: Point | None = Field(default=None, description="lower corner of a box")
    high: Point | None = Field(default=None, description="upper corner of a box")
    centre: Point | None = Field(
        default=None,
        description="centre of all other shapes; on a mirror, the half inside the domain is placed",
    )
    radius: Length | None = Field(
        default=None, description="radius of a disc, a sphere or a cylinder"
    )
    inner: Length | None = Field(default=None, description="inner radius of a ring or tube")
    outer: Length | None = Field(default=None, description="outer radius of a ring or tube")
    length: Length | None = Field(default=None, description="length of a cylinder or tube")
    axis: Literal["x", "y", "z"] | None = Field(
        default=None, description="axis of a cylinder or tube"
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
    velocity: Point | None = Field(default=None, description="velocity; at rest if not given")
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

    @model_validator(mode="after")
    def _has_its_sizes(self):
        needed = KEYS[self.shape]
        given = [name for name in SIZES if getattr(self, name) is not None]
        expected = f'expected {", ".join(needed)} for shape = "{self.shape}"'
        faults = [Fault((k,), f"is missing: {expected}") for k in needed if k not in given]
        faults += [
            Fault((k,), f'is not a key of shape "{self.shape}": {expected}')
            for k in given
            if k not in needed
        ]
        corners = zip(self.low or (), self.high or (), strict=False)
        if not faults and any(low >= high for low, high in corners):
            faults = [Fault(("low",), f"= {self.low}: expected below high = {self.high}")]
        if not faults and "inner" in needed and not self.inner < self.outer:  # type: ignore[operator]
            faults = [Fault(("inner",), f"= {self.inner:g}: expected below outer = {self.outer:g}")]
        if faults:
            raise base.refused(faults)
        return self

    @property
    def geometry(self) -> placement.Shape:
        """The shape with its sizes."""
        if self.shape == "box":
            return placement.box(self.low, self.high)
        outer, inner = self.outer or self.radius or 0.0, self.inner or 0.0
        if self.axis is None:
            return placement.ball(self.centre, outer, inner)
        axis = "xyz".index(self.axis)
        return placement.cylinder(self.centre, outer, self.length or 0.0, axis, inner)

    def misfits(self, dimension: int) -> list[Fault]:
        """Return what does not exist in that number of dimensions."""
        faults = []
        if DIMENSION.get(self.shape, dimension) != dimension:
            others = [name for name in KEYS if DIMENSION.get(name, dimension) == dimension]
            listed = ", ".join(f'"{name}"' for name in others)
            text = f'= "{self.shape}": expected one of {listed} in {dimension}-D'
            faults.append(Fault(("shape",), text))
        for key in VECTORS:
            vector = getattr(self, key)
            if vector is not None and len(vector) != dimension:
                text = f"= {vector}: expected {dimension} components in {dimension}-D"
                faults.append(Fault((key,), text))
        if self.lattice not in placement.LATTICES[dimension]:
            listed = ", ".join(f'"{name}"' for name in placement.LATTICES[dimension])
            text = f'= "{self.lattice}": expected one of {listed} in {dimension}-D'
            faults.append(Fault(("lattice",), text))
        return faults
