"""The table [[problem.region]]: a shape, and the gas in it."""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from sph.problems._shapes import KEYS, PER_AXIS, Point, Shaped
from sph.problems.base import Fault
from sph.problems.support import areas, bodies
from sph.problems.support.expressions import Expression, parsed

# A number, or an expression in x, y, z and r.
Value = float | str
# The path of a key in the table of a region.
Path = tuple[str | int, ...]

EXPRESSION = "a number, or an expression in x, y, z and r, the distance from the region's centre"


class Region(Shaped):
    """One region: its shape and sizes, and the gas in it.

    A key that is not given is as in the earlier regions.
    """

    shapes: ClassVar = {
        "everywhere": (),
        **KEYS,
        "slab": ("axis", "range"),
        "half_plane": ("point", "normal"),
    }
    vectors: ClassVar = (*Shaped.vectors, "point", "normal", "velocity")

    shape: Literal[
        "everywhere", "box", "disc", "sphere", "ring", "cylinder", "tube", "slab", "half_plane"
    ] = Field(
        description="shape; a disc and a ring are 2-D, a sphere, a cylinder and a tube 3-D; "
        "periodic boundaries repeat all shapes but a half-plane"
    )
    axis: Literal["x", "y", "z"] | None = Field(
        default=None,
        description="axis of a cylinder or tube; axis that is normal to a slab",
        examples=["x"],
    )
    range: list[float] | None = Field(
        default=None,
        min_length=2,
        max_length=2,
        description="ends [lo, hi] of a slab along axis",
        examples=[[0.0, 0.5]],
    )
    point: Point | None = Field(
        default=None, description="a point on the edge of a half-plane", examples=[[0.5, 0.5]]
    )
    normal: Point | None = Field(
        default=None,
        description="vector from the edge of a half-plane into it, of any length",
        examples=[[1.0, 0.0]],
    )
    density: Value | None = Field(
        default=None, description=f"density: {EXPRESSION}", examples=["1 + 0.1*sin(2*pi*x)"]
    )
    pressure: Value | None = Field(
        default=None, description=f"pressure: {EXPRESSION}", examples=["1 + exp(-(r/0.1)**2)"]
    )
    velocity: Annotated[list[Value], PER_AXIS] | None = Field(
        default=None,
        min_length=1,
        max_length=3,
        description="velocity, one number or expression per axis; zero if no region gives one",
        examples=[["-y", 0.5]],
    )

    def faults(self, dimension: int) -> list[Fault]:
        """Return what is wrong with the region in that number of dimensions."""
        found = self.misfits(dimension)
        if self.shape == "slab" and "xyz".index(self.axis or "x") >= dimension:
            text = f'= "{self.axis}": expected one of {", ".join("xyz"[:dimension])}'
            found.append(Fault(("axis",), f"{text} in {dimension}-D"))
        if self.range is not None and not self.range[0] < self.range[1]:
            found.append(Fault(("range",), f"= {self.range}: expected lo < hi"))
        if self.normal is not None and not any(self.normal):
            found.append(Fault(("normal",), f"= {self.normal}: expected a vector that is not zero"))
        for path, value in self.values():
            try:
                formula(value, dimension)
            except ValueError as error:
                found.append(Fault(path, f'= "{value}" {error}'))
        return found

    def values(self) -> list[tuple[Path, Value]]:
        """Return the given values with the paths of their keys."""
        found: list[tuple[Path, Value]] = [
            ((key,), value)
            for key in ("density", "pressure")
            if (value := getattr(self, key)) is not None
        ]
        return found + [(("velocity", i), value) for i, value in enumerate(self.velocity or ())]

    def area(self, box: np.ndarray) -> areas.Area:
        """Return the part of the box (D, 2) that the region covers."""
        if self.shape == "everywhere":
            return areas.Everywhere(box)
        if self.shape == "half_plane":
            return areas.HalfSpace(box, np.array(self.point), np.array(self.normal))
        if self.shape == "slab":
            extent = box.copy()
            extent["xyz".index(self.axis or "x")] = self.range
            return areas.Solid(bodies.Shape(extent))
        return areas.Solid(self.geometry)


def formula(value: Value, dimension: int) -> Expression | float:
    """Return the expression or the number of a value. Raises ValueError for a wrong expression."""
    if isinstance(value, str):
        return parsed(value, [*"xyz"[:dimension], "r"])
    return value
