"""Warnings on a finished run whose result is doubtful. They stand first in its summary.

Each kind is one function below, and one section of docs/warnings.md with an example. A warning says
what was found, which limit it exceeds, and what to try.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from sph import resolution
from sph.summary import Conservation, Nearest, Summary, Tearing, figure

# Limit of the stress suite for settings that pass; a larger drift is an error of time integration.
DRIFT = 1e-3
# Pair forces are equal and opposite: more is neither round-off nor an error of time integration. In
# single precision round-off added up to 3e-7 in 1000 steps of 256 particles (configs/moving_box).
MOMENTUM = {"double": 1e-6, "single": 1e-4}
# Where forces of pairs are not equal and opposite to round-off: individual steps change momentum by
# 1e-6 (point explosion) to 5e-5 (blob), a tree code by 1e-5 (Evrard's collapse).
MOMENTUM_INEXACT = 1e-3
# In shipped configurations sum m/rho is within 5 % of the box's volume, in most within 3 %. With
# too few neighbours (eta = 0.85 in 2-D) it is wrong by 12 %.
VOLUME = 0.06
# Median distance to the nearest neighbour, in particle spacings. Runs without pairing end with 0.85
# (Gresho vortex, 32^2) to 1.07 (hexagonal lattice), and random positions start with 0.54. Runs
# with pairing end below 0.46 (docs/measurements.md).
PAIRED = 0.5


class Warning(NamedTuple):
    """A warning: its kind, which names its section in docs/warnings.md, and its text."""

    kind: str
    text: str


def of_run(simulation, summary: Summary) -> list[Warning]:
    """Return the warnings of a run, from its final state and its summary."""
    config = simulation.scene.config
    problem, precision = config.problem, config.run.precision
    neighbours = simulation.scene.formulation.neighbours_key
    return [
        *_swamped(problem, summary, neighbours),
        *_energy(summary["conservation"], neighbours),
        *_momentum(summary["conservation"], simulation.scene, MOMENTUM[precision]),
        *_volume(summary["conservation"], neighbours),
        *_held(simulation),
        *_resolution(simulation),
        *_paired(summary["nearest"], neighbours),
        *_torn(summary.get("tearing")),
        *_limits(problem, summary, precision),
    ]


def kinds(summary: Mapping[str, object]) -> list[str]:
    """Return the kinds of warnings in a summary, each once. Older summaries have no warnings.

    Entries of a damaged summary that are not warnings are skipped.
    """
    found = summary.get("warnings")
    warned = [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []
    return list(dict.fromkeys(str(one.get("kind")) for one in warned))


def _swamped(problem, summary: Summary, neighbours: str) -> Iterator[Warning]:
    for name, limit in problem.swamped.items():
        value = figure(summary, name)
        if value is not None and not limit.holds(value):
            yield Warning(
                "swamped",
                f"the problem's signal is lost in numerical noise: {_beyond(name, value, limit)} "
                f"Try a larger {neighbours} with a smoother physics.kernel, or more particles.",
            )


def _energy(kept: Conservation, neighbours: str) -> Iterator[Warning]:
    drift = kept["energy_drift_max"]
    if not drift <= DRIFT:
        yield Warning(
            "energy_drift",
            f"total energy drifted by {100 * drift:.2g} %, more than {100 * DRIFT:g} %. Try a "
            f"smaller physics.C or, where that does not help, a larger {neighbours}.",
        )


def _momentum(kept: Conservation, scene, most: float) -> Iterator[Warning]:
    change = kept["momentum_change"]
    inexact = scene.inexact_momentum
    most = MOMENTUM_INEXACT if inexact else most
    if change is None or change <= most:
        return
    because = (
        f"It is conserved only approximately with {' and '.join(inexact)}. Try a smaller physics.C."
        if inexact
        else "Pair forces conserve momentum to round-off, so this is a fault of the program. Try "
        "another physics.scheme, and please report this run."
    )
    yield Warning(
        "momentum",
        f"total momentum changed by {change:.2g} of sum m(|v| + c), more than {most:g}. {because}",
    )


def _volume(kept: Conservation, neighbours: str) -> Iterator[Warning]:
    ratio = kept["volume_ratio"]
    if ratio is not None and not abs(ratio - 1.0) <= VOLUME:
        yield Warning(
            "volume",
            f"the sum of m/rho is {ratio:.3g} of the box's volume, so densities are wrong by "
            f"{100 * abs(1.0 / ratio - 1.0):.2g} % on average. Try a larger {neighbours} or more "
            "particles.",
        )


def _held(simulation) -> Iterator[Warning]:
    held = simulation.held_supports
    if held:
        yield Warning(
            "held_supports",
            f"{held} of {simulation.particles.number} particles have too few neighbours: their "
            f"support radius is at its upper limit, {simulation.scene.max_support:.4g}, and their "
            "density is too low. Try a larger physics.max_support.",
        )


def _resolution(simulation) -> Iterator[Warning]:
    if text := resolution.doubt(simulation):
        yield Warning("resolution", text)


def _paired(nearest: Nearest | None, neighbours: str) -> Iterator[Warning]:
    if nearest and nearest["median"] < PAIRED:
        yield Warning(
            "paired",
            "particles form close pairs (pairing instability): the median distance to the nearest "
            f"neighbour is {nearest['median']:.2g} of the particle spacing, so the resolution is "
            "lower than the number of particles suggests. Try a Wendland kernel, or a smaller "
            f"{neighbours}.",
        )


def _torn(found: Tearing | None) -> Iterator[Warning]:
    if found and found["pieces"] > found["bodies"]:
        number = found["bodies"]
        bodies = "1 solid body is" if number == 1 else f"{number} solid bodies are"
        yield Warning(
            "torn",
            f"{bodies} in {found['pieces']} pieces. The equations contain no law of fracture, so "
            "where a body tears depends on the particles. Try physics.tensile_correction = 0.3.",
        )


def _limits(problem, summary: Summary, precision: str) -> Iterator[Warning]:
    for name, limit in problem.allowed().items():
        if name == "momentum_change" and precision == "single":
            continue  # a problem's limit is the round-off of double precision
        value = figure(summary, name)
        if value is None or limit.holds(value) or _is_said(name, problem, summary):
            continue
        yield Warning("limit", _beyond(name, value, limit))


def _is_said(name: str, problem, summary: Summary) -> bool:
    """Return whether another kind of warning already reports that number."""
    if name == "energy_drift":
        return any(_energy(summary["conservation"], ""))
    return name in problem.swamped and not problem.swamped[name].holds(figure(summary, name))


def _beyond(name: str, value: float, limit) -> str:
    side = "below" if limit.at_least else "above"
    return (
        f"{name.replace('_', ' ')} is {value:.3g}, {side} the limit of {limit.bound:g} "
        f"({limit.reason})."
    )
