"""What a result assumes and a run did not keep: one list of warnings, first in its summary.

Each kind is one function below, and one section of docs/warnings.md with a scene that gives it.
A warning says what was found, against what, and what to try.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from sph import resolution
from sph.summary import Conservation, Nearest, Summary, figure

# The stress suite holds its passing settings to this; more is an error of the time integration.
DRIFT = 1e-3
# Pairs push each other equally: more is neither round-off nor an error of the integration.
MOMENTUM = 1e-6
# Shipped scenes keep sum m/rho to 5 % of the box, most of them to 3 %; too few neighbours (eta of
# 0.85 in 2-D) miss it by 12 %.
VOLUME = 0.06
# Healthy runs end with median distances from .85 (Gresho's vortex, 32^2) to 1.07 (a hexagonal
# lattice) of the spacing, and particles at random places begin with .54; kernels that pair end
# below .46 (docs/measurements.md).
PAIRED = 0.5


class Warning(NamedTuple):
    """A kind, by which reports and documents know it, and a sentence or two for the user."""

    kind: str
    text: str


def of_run(simulation, summary: Summary) -> list[Warning]:
    """The warnings of a run, from its last state and what its summary has."""
    problem = simulation.scene.config.problem
    return [
        *_swamped(problem, summary),
        *_energy(summary["conservation"]),
        *_momentum(summary["conservation"]),
        *_volume(summary["conservation"]),
        *_held(simulation),
        *_resolution(simulation),
        *_paired(summary["nearest"]),
        *_limits(problem, summary),
    ]


def kinds(summary: Mapping[str, object]) -> list[str]:
    """The kinds of warning in a summary, none twice; summaries of older versions have none.

    A summary that was read may be damaged: what is no warning there is left out.
    """
    found = summary.get("warnings")
    warned = [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []
    return list(dict.fromkeys(str(one.get("kind")) for one in warned))


def _swamped(problem, summary: Summary) -> Iterator[Warning]:
    for name, limit in problem.swamped.items():
        value = figure(summary, name)
        if value is not None and not limit.holds(value):
            yield Warning(
                "swamped",
                f"the problem's signal is lost in numerical noise: {_beyond(name, value, limit)} "
                "Try a larger physics.eta with a smoother physics.kernel, or more particles.",
            )


def _energy(kept: Conservation) -> Iterator[Warning]:
    drift = kept["energy_drift_max"]
    if not drift <= DRIFT:
        yield Warning(
            "energy_drift",
            f"total energy drifted by {100 * drift:.2g} %, more than {100 * DRIFT:g} %. Try a "
            "smaller physics.C or, where that does not help, a larger physics.eta.",
        )


def _momentum(kept: Conservation) -> Iterator[Warning]:
    change = kept["momentum_change"]
    if change is not None and not change <= MOMENTUM:
        yield Warning(
            "momentum",
            f"total momentum changed by {change:.2g} of sum m(|v| + c), which pairs of particles "
            f"conserve to round-off: above {MOMENTUM:g} something is wrong. Try another "
            "physics.scheme, and please report this run.",
        )


def _volume(kept: Conservation) -> Iterator[Warning]:
    ratio = kept["volume_ratio"]
    if ratio is not None and not abs(ratio - 1.0) <= VOLUME:
        yield Warning(
            "volume",
            f"the sum of m/rho is {ratio:.3g} of the box's volume, so densities are wrong by "
            f"{100 * abs(1.0 / ratio - 1.0):.2g} % on average. Try a larger physics.eta or more "
            "particles.",
        )


def _held(simulation) -> Iterator[Warning]:
    held = simulation.held_supports
    if held:
        yield Warning(
            "held_supports",
            f"{held} of {simulation.particles.number} particles have too few neighbours: their "
            f"supports are held at {simulation.scene.max_support:.4g} and their densities are too "
            "low. Try a larger physics.max_support.",
        )


def _resolution(simulation) -> Iterator[Warning]:
    if text := resolution.doubt(simulation):
        yield Warning("resolution", text)


def _paired(nearest: Nearest | None) -> Iterator[Warning]:
    if nearest and nearest["median"] < PAIRED:
        yield Warning(
            "paired",
            "particles have paired: the median distance to the nearest neighbour is "
            f"{nearest['median']:.2g} of the particle spacing, so the run has fewer resolution "
            "elements than particles. Try a Wendland kernel, or a smaller physics.eta.",
        )


def _limits(problem, summary: Summary) -> Iterator[Warning]:
    for name, limit in problem.allowed().items():
        value = figure(summary, name)
        if value is None or limit.holds(value) or _is_said(name, problem, summary):
            continue
        yield Warning("limit", _beyond(name, value, limit))


def _is_said(name: str, problem, summary: Summary) -> bool:
    """Whether another kind of warning tells of that figure."""
    if name == "energy_drift":
        return any(_energy(summary["conservation"]))
    return name in problem.swamped and not problem.swamped[name].holds(figure(summary, name))


def _beyond(name: str, value: float, limit) -> str:
    side = "below" if limit.at_least else "above"
    return (
        f"{name.replace('_', ' ')} is {value:.3g}, {side} the limit of {limit.bound:g} "
        f"({limit.reason})."
    )
