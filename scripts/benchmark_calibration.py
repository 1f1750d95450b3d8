"""A fixed piece of compiled work whose CPU time says how fast the machine is at this moment.

The work is that of a pair loop: copy candidates to scratch arrays, then sum over all pairs of 8
particles and 320 candidates in 3-D, with one square root and one division a pair. The loop contains
no code of sph, so a change of sph cannot change the loop. Never change the loop either: every
stored ratio in docs/benchmarks refers to it.
"""

import time

import numpy as np
from numba import njit

PARTICLES = 1 << 15  # four arrays of 256 kB: more than the first-level cache, as in a run
BLOCKS, BLOCK, CANDIDATES = 64, 8, 320
SECONDS = 0.25  # CPU time of one calibration


@njit(error_model="numpy", fastmath={"nsz", "arcp", "contract", "afn", "reassoc"})
def _pairs(position, mass, candidates, out):
    scratch = np.empty((3, CANDIDATES))
    m = np.empty(CANDIDATES)
    for block in range(BLOCKS):
        for k in range(CANDIDATES):
            j = candidates[block, k]
            m[k] = mass[j]
            for d in range(3):
                scratch[d, k] = position[d, j]
        for i in range(block * BLOCK, (block + 1) * BLOCK):
            total = 0.0
            for k in range(CANDIDATES):
                squared = 1e-6
                for d in range(3):
                    r_d = position[d, i] - scratch[d, k]
                    squared += r_d * r_d
                r = np.sqrt(squared)
                inverse = 1.0 / (r * (mass[i] + m[k]))
                u = (1.0 - r) + abs(1.0 - r)
                total += m[k] * (u * u * u) * (1.0 + 4.0 * r) * inverse
            out[i] = total


def _arrays():
    """Return position, mass, candidates and out: sequences without a random generator."""
    k = np.arange(PARTICLES)
    position = np.array([(k * step) % 1.0 for step in (0.6180339887, 0.7548776662, 0.8191725134)])
    mass = 1.0 + (k * 0.5698402910) % 1.0
    index = np.arange(BLOCKS * CANDIDATES).reshape(BLOCKS, CANDIDATES)
    return position, mass, (index * 7919) % PARTICLES, np.zeros(BLOCKS * BLOCK)


class Calibration:
    """Measures CPU nanoseconds for one pair of the fixed work."""

    def __init__(self, seconds: float = SECONDS):
        self.seconds = seconds
        self.arrays = _arrays()
        _pairs(*self.arrays)

    def __call__(self) -> float:
        """Return CPU ns per pair, the mean over `seconds` of work."""
        begin = now = time.thread_time()
        calls = 0
        while now - begin < self.seconds:
            _pairs(*self.arrays)
            calls += 1
            now = time.thread_time()
        return 1e9 * (now - begin) / (calls * BLOCKS * BLOCK * CANDIDATES)
