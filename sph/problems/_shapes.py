"""Tables of the configuration that give a shape and its sizes."""

import json
from typing import Annotated, Any, ClassVar, Literal

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
PER_AXIS = "one per axis"  # in messages, for the number of entries
Point = Annotated[list[float], Field(min_length=1, max_length=3), PER_AXIS]


class Shaped(base.Section):
    """A shape and its sizes, of which each shape needs those in `shapes`.

    vectors: the keys with one component per axis.
    """

    shapes: ClassVar[dict[str, tuple[str, ...]]] = KEYS
    vectors: ClassVar[tuple[str, ...]] = ("low", "high", "centre")

    shape: str
    low: Point | None = Field(
        default=None, description="lower corner of a box", examples=[[0.0, 0.0]]
    )
    high: Point | None = Field(
        default=None, description="upper corner of a box", examples=[[0.5, 1.0]]
    )
    centre: Point | None = Field(
        default=None,
        description="centre of a disc, sphere, ring, cylinder or tube",
        examples=[[0.5, 0.5]],
    )
    radius: Length | None = Field(
        default=None, description="radius of a disc, a sphere or a cylinder", examples=[0.2]
    )
    inner: Length | None = Field(
        default=None, description="inner radius of a ring or tube", examples=[0.1]
    )
    outer: Length | None = Field(
        default=None, description="outer radius of a ring or tube", examples=[0.2]
    )
    length: Length | None = Field(
        default=None, description="length of a cylinder or tube", examples=[1.0]
    )
    axis: Literal["x", "y", "z"] | None = Field(
        default=None, description="axis of a cylinder or tube", examples=["x"]
    )

    @model_validator(mode="before")
    @classmethod
    def _has_its_keys(cls, given: Any) -> Any:
        """Before the types of values: a key of another shape is the wrong key, whatever it has."""
        shape = given.get("shape") if isinstance(given, dict) else None
        if not isinstance(shape, str) or shape not in cls.shapes:
            return given
        if given.keys() - cls.model_fields.keys():
            return given  # a misspelt key, such as center, is not a missing one
        needed = cls.shapes[shape]
        sizes = dict.fromkeys(key for keys in cls.shapes.values() for key in keys)
        has = [name for name in sizes if given.get(name) is not None]
        expected = f'expected {", ".join(needed) or "none"} for shape = "{shape}"'
        whole = f"{expected}, such as {cls._example(shape)}" if needed else expected
        faults = [Fault((k,), f"is missing: {whole}") for k in needed if k not in has]
        faults += [
            Fault((k,), f'is not a key of shape "{shape}": {expected if faults else whole}')
            for k in has
            if k not in needed
        ]
        if faults:
            raise base.refused(faults)
        return given

    @model_validator(mode="after")
    def _has_sizes_in_order(self):
        corners = zip(self.low or (), self.high or (), strict=False)
        if any(low >= high for low, high in corners):
            raise base.refused(
                [Fault(("low",), f"= {self.low}: expected below high = {self.high}")]
            )
        if self.inner is not None and self.outer is not None and not self.inner < self.outer:
            text = f"= {self.inner:g}: expected below outer = {self.outer:g}"
            raise base.refused([Fault(("inner",), text)])
        return self

    @classmethod
    def _example(cls, shape: str) -> str:
        """Return the table of a shape as a user writes it."""
        number = DIMENSION.get(shape, 2)
        keys = [("shape", shape)]
        for key in cls.shapes[shape]:
            value = (cls.model_fields[key].examples or [None])[0]
            keys.append((key, value + value[:1] if key in cls.vectors and number == 3 else value))
        return f"{{ {', '.join(f'{key} = {json.dumps(value)}' for key, value in keys)} }}"

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
                example = (vector * 3 if vector else [0.0] * 3)[:dimension]
                text = (
                    f"= {vector}: expected {dimension} components in {dimension}-D, {PER_AXIS}, "
                    f"such as {key} = {json.dumps(example)}"
                )
                faults.append(Fault((key,), text))
        return faults
