"""A preview of a run: the output of `sph run --dry-run`."""

import math
from typing import NamedTuple

import numpy as np

from sph import standard_streams
from sph.clock import Clock
from sph.config import Config
from sph.errors import ConfigError, NumericalError
from sph.integrators.step_size import StepLimit
from sph.neighbours import BALL
from sph.output.times import output_times
from sph.runner import threads_of
from sph.scene import Scene
from sph.simulation import Simulation

# Larger runs are previewed with this many particles, and the figures scaled: it takes seconds.
MOST_BUILT = 20_000
# Several steps are timed, since they share the cost of a list build; at most these.
TIMED_STEPS, TIMED_SECONDS = 20, 2.0


class Sample(NamedTuple):
    """A few steps of a run, with all of its particles or fewer."""

    parts: tuple[list[str], list[str]]  # compiled in, left out
    particles: int
    neighbours: float  # of a particle
    memory: int  # bytes
    limit: StepLimit  # of the first step
    steps: int  # made
    last_step: float  # of these: a first step may be far from those that follow
    step_seconds: float  # CPU


def describe(config: Config) -> str:
    """Return a text on the scene, the particles, the memory and the expected number of steps.

    Makes a few steps and discards them. For more than MOST_BUILT particles the steps use fewer
    particles, and memory and cost are scaled with N, the time step with N^(-1/D). Raises
    NumericalError if the run could not start.
    """
    standard_streams.note(
        "preparing a few steps; the first use of new settings compiles code, for up to a minute"
    )
    sample, is_whole = _sampled(config)
    particles = sample.particles if is_whole else config.problem.n
    ratio = particles / sample.particles
    memory = sample.memory * ratio
    shorter = ratio ** (-1.0 / config.problem.dimension)
    first, dt = sample.limit.dt * shorter, sample.last_step * shorter
    steps, per_step = config.time.end / dt, sample.step_seconds * ratio
    outputs = 1 + sum(1 for _ in output_times(config.time.end, config.output.interval))
    inside, outside = sample.parts
    scaled = [] if is_whole else [f"Figures are scaled from {sample.particles} particles."]
    whose = f" of particle {sample.limit.particle}" if is_whole else ""
    lines = [
        "The configuration is valid.",
        *config.problem.remarks(),
        "Compiled in:",
        *(f"  {part}" for part in inside),
        "Left out:",
        *(f"  {part}" for part in outside),
        *scaled,
        f"Particles: {_count(particles, is_whole)}, {sample.neighbours:.0f} neighbours each.",
        f"Memory: {memory / 1e6:.1f} MB for the particles and their lists "
        f"({memory / particles:.0f} bytes each), in addition to 250 MB for Python and Numba.",
        f"First step: {first:.4g}, set by the {sample.limit.criterion.replace('_', ' ')}{whose}; "
        f"step {sample.steps} is {dt:.4g}: at that size {_count(steps, is_whole)} steps reach "
        f"t = {config.time.end:g}.",
        f"Time: a step costs {per_step:.2g} CPU s, and all steps about {per_step * steps:.2g} "
        f"CPU s on {threads_of(config)} thread(s).",
        f"Output: {outputs} checkpoints{_frames(config)}.",
    ]
    return "\n".join(lines)


def _frames(config: Config) -> str:
    number = config.output.frames
    return "" if number is None else f", and {number} frames, at most one a step"


def _count(number: float, is_exact: bool) -> str:
    """A count, to three digits where it is an estimate or too long to read."""
    if not is_exact or not number < 1e12:
        return f"some {number:.3g}"
    return str(math.ceil(number))


def _sampled(config: Config) -> tuple[Sample, bool]:
    """A sample, and whether it has all particles of the run.

    Else it has the fewest from MOST_BUILT on for which the scene is valid. Raises NumericalError.
    """
    n = MOST_BUILT
    while n < config.problem.n:
        standard_streams.note(f"trying {n} of {config.problem.n} particles")
        try:
            return _sample(config.override([f"problem.n={n}"])), False
        except ConfigError:  # too few for this problem, such as for its thinnest layer
            n *= 4
        except NumericalError as error:  # too few for its supports, or the run itself fails
            if n > MOST_BUILT:
                raise NumericalError(f"with {n} particles: {error}") from error
            n *= 4
    return _sample(config), True


def _sample(config: Config) -> Sample:
    clock = Clock()
    simulation = Simulation.start(Scene(config), threads_of(config), clock)
    limit = simulation.limit
    for _ in range(2):  # later steps find their code loaded
        simulation.advance(math.inf)
    began, timed = clock.cpu, 0
    while timed == 0 or (
        timed < TIMED_STEPS
        and clock.cpu - began < TIMED_SECONDS
        and simulation.time < config.time.end
    ):
        last_step = simulation.limit.dt
        simulation.advance(math.inf)
        timed += 1
    per_step = (clock.cpu - began) / timed
    sample = Sample(
        simulation.scene.described(),
        simulation.particles.number,
        neighbours_per_particle(simulation),
        bytes_held(simulation),
        limit,
        simulation.step,
        last_step,
        per_step,
    )
    # what else a run compiles: steps in one call (`sph.steps`), and the figures of its summary
    if simulation.time < config.time.end:
        simulation.proceed(config.time.end, 1)
    simulation.nearest()
    simulation.close()
    clock.close()
    return sample


def bytes_held(simulation) -> int:
    """Bytes of all arrays that the simulation and its neighbour lists hold."""
    search = simulation.search
    held = [
        *vars(simulation.particles).values(), *vars(simulation).values(), *search.lists,
        *search.origin, search.boxes,
    ]  # fmt: skip
    return sum(array.nbytes for array in held if isinstance(array, np.ndarray))


def neighbours_per_particle(simulation) -> float:
    """Mean number of particles in a support, from its volume and the local density."""
    p, D = simulation.particles, simulation.scene.dimension
    return float(np.mean(BALL[D - 1] * p.support**D * p.density / p.mass))
