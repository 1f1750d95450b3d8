"""Inverse roots by iteration, which take a third of the time of a root and a division."""

from llvmlite import ir
from numba import types
from numba.core import cgutils

from sph.compiled import instruction
from sph.simd.compaction import AVX512
from sph.simd.types import EXACT, I32, I64, Vec, constant, llvm_type

# First guesses by an integer operation on the exponent, with an error of 3.5 % at most (Lomont
# 2003), and for AVX-512 by an instruction, with an error of 2^-14. With e = 1 - x y^n,
# x^(-1/n) = y (1 + e/n + ...); a step with k terms multiplies the number of correct digits by k.
_SERIES = {2: (1.0, 1.0 / 2.0, 3.0 / 8.0, 5.0 / 16.0), 3: (1.0, 1.0 / 3.0, 2.0 / 9.0, 14.0 / 81.0)}
_GUESSES = {
    (2, types.float64): (0x5FE6EB50C7B537A9, I64),
    (2, types.float32): (0x5F375A86, I32),
    (3, types.float64): (0x553EF0FF289DD796, I64),
}
_STEPS = {(2, types.float64): (3, 4), (2, types.float32): (3, 2), (3, types.float64): (4, 4)}
_ESTIMATES = {
    (types.float64, 8): ("llvm.x86.avx512.rsqrt14.pd.512", (4,)),
    (types.float32, 16): ("llvm.x86.avx512.rsqrt14.ps.512", (2,)),
}


def _guess(builder, x, kind, value, n, base):
    """Return LLVM code for a guess of value^(-1/n), and the numbers of terms of the steps."""
    if n == 2 and AVX512 and isinstance(x, Vec) and (base, x.width) in _ESTIMATES:
        name, steps = _ESTIMATES[base, x.width]
        every = ir.IntType(max(8, x.width))
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(kind, [kind, kind, every]), name
        )
        arguments = (value, ir.Constant(kind, ir.Undefined), ir.Constant(every, -1))
        return builder.call(function, arguments), steps
    guess, integer = _GUESSES[n, base]
    whole = ir.VectorType(integer, x.width) if isinstance(x, Vec) else integer
    bits = builder.bitcast(value, whole)
    part = (
        builder.lshr(bits, constant(whole, 1)) if n == 2 else builder.udiv(bits, constant(whole, n))
    )
    return builder.bitcast(builder.sub(constant(whole, guess), part), kind), _STEPS[n, base]


def _inverse_root(n):
    """A function that returns x^(-1/n) for normal x > 0, to a few units in the last place."""

    @instruction
    def root(typing_context, x):
        base = x.kind if isinstance(x, Vec) else x

        def generate(context, builder, sig, arguments):
            (value,) = arguments
            kind = llvm_type(x)
            y, steps = _guess(builder, x, kind, value, n, base)

            def times(a, b):
                return builder.fmul(a, b, flags=EXACT)

            for terms in steps:
                power = times(value, y)
                for _ in range(n - 1):
                    product, power = power, times(power, y)
                e = builder.fsub(constant(kind, 1.0), times(product, y), flags=EXACT)
                total = constant(kind, _SERIES[n][terms - 1])
                for factor in _SERIES[n][terms - 2 : 0 : -1]:
                    total = builder.fadd(times(total, e), constant(kind, factor), flags=EXACT)
                y = builder.fadd(times(times(total, e), y), y, flags=EXACT)
            return y

        return x(x), generate

    return root


inverse_sqrt = _inverse_root(2)
inverse_cbrt = _inverse_root(3)
