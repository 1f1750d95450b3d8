"""The functions of NumPy that vectors have (`sph.simd`), and their names in LLVM.

Methods of models may use these functions, np.where, abs, + - * / **, comparisons, & | ^ ~ of these,
and `larger` and `smaller` of `sph.compiled`.
"""

from typing import Any

import numpy as np

UNARY: dict[Any, str] = {
    np.abs: "llvm.fabs", np.sqrt: "llvm.sqrt", np.exp: "llvm.exp", np.exp2: "llvm.exp2",
    np.log: "llvm.log", np.log2: "llvm.log2", np.log10: "llvm.log10", np.sin: "llvm.sin",
    np.cos: "llvm.cos", np.tan: "llvm.tan", np.tanh: "llvm.tanh", np.floor: "llvm.floor",
    np.ceil: "llvm.ceil",
}  # fmt: skip
BINARY: dict[Any, str] = {
    np.maximum: "llvm.maxnum",
    np.minimum: "llvm.minnum",
    np.power: "llvm.pow",
}
