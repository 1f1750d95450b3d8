"""Explicit SIMD vectors in compiled code: several candidates of a particle per instruction.

A vector (`Vec`) holds several numbers, one in each lane; a mask (`Mask`) holds as many truth
values. Compiled code uses vectors like numbers: + - * / ** and comparisons, the NumPy functions in
`sph.simd.functions`, and `larger` and `smaller` of `sph.compiled`. In an operation of a vector and
a number, the number applies to every lane, in the precision of the vector. The methods of models,
such as kernels, therefore take vectors as they take NumPy arrays.

The arithmetic of a pass (`lanes`) decides the width and the precision when the pass is compiled:
`DOUBLE`, `SINGLE`, or `SCALAR`, which computes one number at a time from the same source. LLVM
divides vectors that are wider than the registers of a processor, so the width is the same on every
processor, and no function needs an instruction of one processor alone.
"""

from sph.simd.compaction import INSTRUCTIONS, front, pick
from sph.simd.lanes import (
    any_lane,
    block_width,
    count,
    filled,
    filled_block,
    lane_max,
    lane_sum,
    numbers_from,
    width,
)
from sph.simd.memory import load, load_block, load_inside, rows, store, store_inside
from sph.simd.operators import select
from sph.simd.roots import inverse_cbrt, inverse_sqrt
from sph.simd.spatial import (
    at,
    corner,
    cross,
    curl_dim,
    dot,
    lane_sums,
    larger_each,
    load_rows,
    load_spatial,
    minus,
    pick_spatial,
    plus,
    put,
    store_spatial,
    times,
    zeros,
)
from sph.simd.tensors import (
    full_dim,
    outer,
    symmetric_at,
    symmetric_dim,
    symmetric_outer,
    symmetric_times,
)
from sph.simd.types import DOUBLE, SCALAR, SINGLE, Double, Mask, Scalar, Single, Vec

__all__ = [
    "DOUBLE",
    "INSTRUCTIONS",
    "SCALAR",
    "SINGLE",
    "Double",
    "Mask",
    "Scalar",
    "Single",
    "Vec",
    "any_lane",
    "at",
    "block_width",
    "corner",
    "count",
    "cross",
    "curl_dim",
    "dot",
    "filled",
    "filled_block",
    "front",
    "full_dim",
    "inverse_cbrt",
    "inverse_sqrt",
    "lane_max",
    "lane_sum",
    "lane_sums",
    "larger_each",
    "load",
    "load_block",
    "load_inside",
    "load_rows",
    "load_spatial",
    "minus",
    "numbers_from",
    "outer",
    "pick",
    "pick_spatial",
    "plus",
    "put",
    "rows",
    "select",
    "store",
    "store_inside",
    "store_spatial",
    "symmetric_at",
    "symmetric_dim",
    "symmetric_outer",
    "symmetric_times",
    "times",
    "width",
    "zeros",
]
