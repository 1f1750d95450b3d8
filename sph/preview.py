"""What a run would be: the answer of `sph run --dry-run`."""

import math

import numpy as np

from sph.clock import Clock
from sph.config import Config
from sph.neighbours import BALL
from sph.runner import output_times, threads_of
from sph.scene import Scene
from sph.simulation import Simulation


def describe(config: Config) -> str:
    """The scene in words: its parts, particles, memory, and steps at the size of the first one.

    The initial state is built and three steps are made and thrown away: the third is timed, the
    first of those that finds all its code loaded.
    """
    clock = Clock()
    threads = threads_of(config)
    simulation = Simulation.start(Scene(config), threads, clock)
    limit = simulation.limit
    for _ in range(3):
        before = clock.cpu
        simulation.advance(math.inf)
    per_step = clock.cpu - before
    simulation.close()
    clock.close()
    inside, outside = simulation.scene.parts()
    particles = simulation.particles
    steps = math.ceil(config.time.end / limit.dt)
    outputs = 1 + sum(1 for _ in output_times(config.time.end, config.output.interval))
    memory = bytes_held(simulation)
    lines = [
        "The configuration is valid.",
        "Compiled in:",
        *(f"  {part}" for part in inside),
        "Left out:",
        *(f"  {part}" for part in outside),
        f"Particles: {particles.number}, "
        f"{neighbours_per_particle(simulation):.0f} neighbours each.",
        f"Memory: {memory / 1e6:.1f} MB for the particles and their lists "
        f"({memory / particles.number:.0f} bytes each), beside some 250 MB for Python and Numba.",
        f"First step: {limit.dt:.4g}, set by the {limit.criterion.replace('_', ' ')} of particle "
        f"{limit.particle}; at that size {steps} steps to t = {config.time.end:g}.",
        f"Time: a step costs {per_step:.2g} CPU s, so some {per_step * steps:.2g} CPU s in all on "
        f"{threads} thread(s); steps that grow or shrink change that.",
        f"Output: {outputs} checkpoints.",
    ]
    return "\n".join(lines)


def bytes_held(simulation) -> int:
    """Bytes of all arrays that the simulation and its neighbour lists hold."""
    search = simulation.search
    held = [
        *vars(simulation.particles).values(), *vars(simulation).values(), *search.lists,
        *search.origin,
    ]  # fmt: skip
    return sum(array.nbytes for array in held if isinstance(array, np.ndarray))


def neighbours_per_particle(simulation) -> float:
    """Mean number of particles in a support, from its volume and the local density."""
    p, D = simulation.particles, simulation.scene.dimension
    return float(np.mean(BALL[D - 1] * p.support**D * p.density / p.mass))
