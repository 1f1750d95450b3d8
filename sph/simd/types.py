"""The types of vectors and masks, and LLVM code that the other modules share."""

from typing import NamedTuple

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.extending import lower_cast, models, register_model

from sph.compiled import FASTMATH

FAST = tuple(sorted(FASTMATH))
FASTEST = ("fast",)  # for a minimum and maximum, see `sph.compiled`
EXACT = ("contract",)  # for formulas whose order of operations matters

I1, I32, I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)


class Double(NamedTuple):
    """8 lanes in double precision."""

    width = 8  # type: ignore[misc]
    block_width = 8  # type: ignore[misc]  # for loops over the particles of a block
    kind = types.float64  # type: ignore[misc]


class Single(NamedTuple):
    """16 lanes in single precision."""

    width = 16  # type: ignore[misc]
    block_width = 8  # type: ignore[misc]
    kind = types.float32  # type: ignore[misc]


class Scalar(NamedTuple):
    """One lane in double precision."""

    width = 1  # type: ignore[misc]
    block_width = 1  # type: ignore[misc]
    kind = types.float64  # type: ignore[misc]


DOUBLE, SINGLE, SCALAR = Double(), Single(), Scalar()  # type: ignore[call-arg]


def is_number(kind) -> bool:
    return isinstance(kind, types.Number | types.Boolean)


class Vec(types.Type):
    """`width` numbers of type `kind`."""

    def __init__(self, kind, width):
        self.kind, self.width = kind, width
        super().__init__(f"Vec({kind}, {width})")

    def unify(self, typingctx, other):
        """A variable that is a vector or a number, depending on a condition, is a vector."""
        return self if is_number(other) else None

    def can_convert_from(self, typingctx, other):
        return Conversion.safe if is_number(other) else None


class Mask(types.Type):
    """The truth values of a comparison of vectors of type `compared`."""

    def __init__(self, compared):
        self.compared, self.width = compared, compared.width
        super().__init__(f"Mask({compared})")


KINDS = {
    types.float32: ir.FloatType(), types.float64: ir.DoubleType(), types.int32: I32,
    types.int64: I64,
}  # fmt: skip
SHORT = {types.float32: "f32", types.float64: "f64", types.int32: "i32", types.int64: "i64"}


@register_model(Vec)
class _VecModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(KINDS[kind.kind], kind.width))


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(I1, kind.width))


def vector_type(kind, width):
    """Return the type of `width` lanes: a number if there is one lane."""
    return Vec(kind, width) if width > 1 else kind


def llvm_type(kind):
    return ir.VectorType(KINDS[kind.kind], kind.width) if isinstance(kind, Vec) else KINDS[kind]


def in_every_lane(builder, value, kind: Vec):
    """Return a vector with `value` in every lane."""
    undefined = ir.Constant(llvm_type(kind), ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(I32, 0))
    return builder.shuffle_vector(first, undefined, integers([0] * kind.width))


def integers(values, kind=I32):
    values = list(values)
    return ir.Constant(ir.VectorType(kind, len(values)), values)


def constant(kind, value):
    """Return a constant of an LLVM type, number or vector."""
    if isinstance(kind, ir.VectorType):
        return ir.Constant(kind, [value] * kind.count)
    return ir.Constant(kind, value)


def call(builder, name, kind, result, arguments, flags=FAST):
    """Call the LLVM intrinsic `name` for vectors of a type, or for numbers."""
    suffix = f"v{kind.width}{SHORT[kind.kind]}" if isinstance(kind, Vec) else SHORT[kind]
    full = f"{name}.{suffix}"
    function_type = ir.FunctionType(result, [argument.type for argument in arguments])
    function = cgutils.get_or_insert_function(builder.module, function_type, full)
    return builder.call(function, arguments, fastmath=flags)


def as_vector(context, builder, value, kind, wanted: Vec):
    """Return a value of type `kind` as a vector of type `wanted`; a mask is 1 where true."""
    if isinstance(kind, Vec):
        return value
    if isinstance(kind, Mask):
        return builder.uitofp(value, llvm_type(wanted))
    return in_every_lane(builder, context.cast(builder, value, kind, wanted.kind), wanted)


@lower_cast(types.Number, Vec)
def _cast(context, builder, kind, wanted, value):
    return as_vector(context, builder, value, kind, wanted)
