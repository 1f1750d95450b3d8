"""Tables of the configuration that give a shape and its sizes."""

from typing import Annotated, ClassVar, Literal

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

Length = Annotated[float, Field(gt=0.0)]
Point = Annotated[list[float], Field(min_length=1, max_length=3)]


class Shaped(base.Section):
    """A shape and its sizes, of which each shape needs those in `shapes`.

    vectors: the keys with one component per axis.
    """

    shapes: ClassVar[dict[str, tuple[str, ...]]] = KEYS
    vectors: ClassVar[tuple[str, ...]] = ("low", "high", "centre")

    shape: str
    low: Point | None = Field(default=None, description="lower corner of a box")
    high: Point | None = Field(default=None, description="upper corner of a box")
    centre: Point | None = Field(
        default=None, description="centre of a disc, sphere, ring, cylinder or tube"
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

    @model_validator(mode="after")
    def _has_its_sizes(self):
        needed = self.shapes[self.shape]
        sizes = dict.fromkeys(key for keys in self.shapes.values() for key in keys)
        given = [name for name in sizes if getattr(self, name) is not None]
        expected = f'expected {", ".join(needed) or "none"} for shape = "{self.shape}"'
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
        """The shape with its sizes, for the shapes in KEYS."""
        if self.shape == "box":
            return placement.box(self.low, self.high)
        outer, inner = self.outer or self.radius or 0.0, self.inner or 0.0
        if self.axis is None:
            return placement.ball(self.centre, outer, inner)
        return placement.cylinder(
            self.centre, outer, self.length or 0.0, "xyz".index(self.axis), inner
        )

    def misfits(self, dimension: int) -> list[Fault]:
        """Return what does not exist in that number of dimensions."""
        faults = []
        if DIMENSION.get(self.shape, dimension) != dimension:
            others = [name for name in self.shapes if DIMENSION.get(name, dimension) == dimension]
            listed = ", ".join(f'"{name}"' for name in others)
            text = f'= "{self.shape}": expected one of {listed} in {dimension}-D'
            faults.append(Fault(("shape",), text))
        for key in self.vectors:
            vector = getattr(self, key)
            if vector is not None and len(vector) != dimension:
                text = f"= {vector}: expected {dimension} components in {dimension}-D"
                faults.append(Fault((key,), text))
        return faults
