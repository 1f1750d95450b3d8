"""Periods of the plate (`oscillating_plate`) by the equations of the continuum scheme, linearised.

    python scripts/plate_modes.py                       orders -1, 0, 1 with 10, 20, 30 and 40 rows
    python scripts/plate_modes.py --rows 10 --ratio 1.6

Around a state of rest without stress eqs 405, 408 and 430 are linear: a sparse matrix maps
displacements to accelerations. Its eigenvector that resembles the first mode of a thin plate has
the period that a run has without viscosity, with a small amplitude, and before the instabilities of
zero-energy modes. A run of 40 rows would take hours; its matrix takes half a minute. Prints a
Markdown table, which docs/measurements.md contains.
"""

import argparse

import numpy as np
from scipy.sparse import bmat, csr_matrix, diags
from scipy.sparse.linalg import eigs
from scipy.spatial import cKDTree

from sph import config as configuration
from sph import kernels

DIM = (0, 0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rows", type=int, nargs="+", default=[10, 20, 30, 40])
    parser.add_argument("--order", type=int, nargs="+", default=[-1, 0, 1])
    parser.add_argument("--ratio", type=float, default=1.2, help="physics.spacing_ratio")
    parser.add_argument("--kernel", default="cubic_spline")
    chosen = parser.parse_args()
    print("| rows | particles |" + "".join(f" order {order} |" for order in chosen.order))
    print("| --- " * (2 + len(chosen.order)) + "|")
    for rows in chosen.rows:
        config = _config(rows, chosen.ratio, chosen.kernel)
        exact = config.problem.period
        found = [_period(config, order) for order in chosen.order]
        words = [f"{period:.4f} ({100 * (period / exact - 1):+.1f} %)" for period in found]
        number = config.problem.initial(config.physics.eos_model()).mass.size
        print(f"| {rows} | {number} | {' | '.join(words)} |", flush=True)


def _config(rows: int, ratio: float, kernel: str):
    overrides = [f"physics.spacing_ratio={ratio}", f"physics.kernel={kernel}"]
    text = '[problem]\nname = "oscillating_plate"\n'
    small = configuration.from_text(text).override(overrides)
    return small.override([f"problem.n={small.problem._count(rows)}"])


def _period(config, order: int) -> float:
    """Return the period of the first mode."""
    state = config.problem.initial(config.physics.eos_model())
    matrix = _accelerations(config, state, order)
    free = np.flatnonzero(np.tile(state.others["clamped"] == 0.0, 2))
    mode = state.velocity.ravel()[free]
    near = (2.0 * np.pi / config.problem.period) ** 2
    values, vectors = eigs(-matrix[free][:, free].tocsc(), k=8, sigma=0.95 * near, v0=mode)
    likeness = np.abs(vectors.conj().T @ mode)
    return float(2.0 * np.pi / np.sqrt(values[np.argmax(likeness)].real))


def _accelerations(config, state, order: int):
    """Return the matrix (2 N, 2 N) of the accelerations, by all x, then all y."""
    material = config.problem._material
    n, volume = state.mass.size, float(state.mass[0] / material.density)
    i, j, gradient = _gradients(config, state.position, volume, order)

    def matrix(values):
        return csr_matrix((values, (i, j)), shape=(n, n))

    derivative = [  # eq 405
        matrix(volume * g) - diags(np.bincount(i, volume * g, n)) for g in gradient
    ]
    force = [  # eq 408, per unit volume
        diags(np.bincount(i, volume * g, n)) - matrix(volume * g).T for g in gradient
    ]
    first, G = material.bulk - 2.0 * material.shear / 3.0, material.shear
    dx, dy = derivative
    xx = bmat([[(first + 2.0 * G) * dx, first * dy]])
    yy = bmat([[first * dx, (first + 2.0 * G) * dy]])
    xy = bmat([[G * dy, G * dx]])
    return bmat([[force[0] @ xx + force[1] @ xy], [force[0] @ xy + force[1] @ yy]]).tocsr() * (
        1.0 / material.density
    )


def _gradients(config, position, volume: float, order: int):
    """Return pairs i, j (M,) and the corrected gradient of the kernel at i (2, M), eqs 402-404."""
    kernel, n = config.physics.kernel_model(), position.shape[1]
    H = 2.0 * config.physics.spacing_ratio * np.sqrt(volume)
    pairs = cKDTree(position.T).query_pairs(H * (1.0 - 1e-9), output_type="ndarray").T
    i, j = np.hstack([pairs, pairs[::-1]])
    apart = position[:, i] - position[:, j]
    q = np.sqrt((apart**2).sum(axis=0)) / H
    scale = kernels.normalisation(kernel, DIM) / H**2
    W, own = scale * kernel.w(DIM, q), scale * float(kernel.w(DIM, np.zeros(1))[0])
    gradient = scale / H**2 * kernel.dw_over_q(DIM, q) * apart
    if order == 0:
        factor = 1.0 / (volume * (np.bincount(i, W, n) + own))
        slope = [-(factor**2) * np.bincount(i, volume * g, n) for g in gradient]
        gradient = factor[i] * gradient + W * np.array(slope)[:, i]
    if order == 1:
        moments = [[np.bincount(i, -volume * g * x, n) for x in apart] for g in gradient]
        inverse = np.linalg.inv(np.array(moments).transpose(2, 0, 1))
        gradient = np.einsum("mab,bm->am", inverse[i], gradient)
    return i, j, gradient


if __name__ == "__main__":
    main()
