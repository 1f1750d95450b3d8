"""A trial of a user's problem before the first step.

Without it, faults in `exact`, `report` and others would end a run only after its whole cost.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from sph.analysis import truth
from sph.config import Config
from sph.config.outside import Outside
from sph.errors import DeclarationError
from sph.steps import rows

POINTS = 3  # another number than that of particles, as in figures
ROWS = 8  # of a made-up history


def notes(simulation) -> Iterator[str]:
    """Call once what a run, its summary and its figures call of a problem from outside the package.

    simulation: before its first step. Yields notes on methods that raise an exception which the
    values of the initial state may explain. Raises DeclarationError for all other faults.
    """
    config, particles = simulation.scene.config, simulation.particles
    problem, eos = config.problem, config.physics.eos_model()
    if not isinstance(problem, Outside):
        return
    times = np.linspace(0.0, config.time.end, ROWS)
    row = rows.of_simulation(simulation)
    end, pressure = _last_time(config), simulation.scene.formulation.pressure(particles)
    with _read_only([*particles.arrays().values(), pressure, times]):
        _exact(config, particles.position)
        truth.theory(config, times)
        row |= {name: [value] for name, value in problem.diagnostics(particles).items()}
    history = {name: np.array(values * ROWS) for name, values in row.items()} | {"t": times}
    calls = [lambda: problem.report(eos, end, particles, pressure)]
    if truth.departure(config, end) is None:
        calls.append(lambda: problem.compare(eos, end, particles, pressure))
    if problem.departs(config.physics) is None:
        calls.append(lambda: problem.over_time(eos, history))
    for call in calls:
        try:
            with _read_only([*particles.arrays().values(), pressure]):
                call()
        except DeclarationError as error:
            if not _depends_on_values(error.__cause__):
                raise
            yield f"in a trial call with the initial state, {error}"


@contextmanager
def _read_only(arrays: list[np.ndarray]) -> Iterator[None]:
    """Let a method that would change the particles, and so the run, fail here."""
    were = [one.flags.writeable for one in arrays]
    try:
        for one in arrays:
            one.flags.writeable = False
        yield
    finally:
        for one, was in zip(arrays, were, strict=True):
            one.flags.writeable = was


def _last_time(config: Config) -> float:
    """Return the end of the run, or that of the exact solution if it is earlier."""
    ends, _ = config.problem.exact_ends(config.physics.eos_model())
    return min(config.time.end, ends)


def _exact(config: Config, position: np.ndarray) -> None:
    """Call what tells the exact solution and where it holds, at the start and at the end."""
    problem, eos = config.problem, config.physics.eos_model()
    few = position[:, np.arange(POINTS) % position.shape[1]]
    few.flags.writeable = False
    for time in (0.0, _last_time(config)):
        truth.region(problem, eos, time, few)
        try:
            problem.exact(eos, time, few)
        except DeclarationError as error:
            text, *source = str(error).split("\n")
            again = "\n".join([f"{text} (t = {time:g}, {POINTS} points)", *source])
            raise DeclarationError(again) from error.__cause__


def _depends_on_values(cause: BaseException | None) -> bool:
    """Whether an exception may come from a state in which nothing has happened yet.

    Such as the maximum over no particles, or a fit to a constant.
    """
    if isinstance(cause, IndexError):
        return "size 0" in str(cause) or "out of range" in str(cause)
    if isinstance(cause, ValueError):
        return not any(
            word in str(cause) for word in ("broadcast", "shape", "dimension", "read-only")
        )
    return isinstance(cause, ArithmeticError)
