"""Check that float64, in single precision float32, resolves positions and velocities.

The gap between a float64 number and the next grows with the number (`np.spacing`). Far from 0 it
becomes a noticeable fraction of the particle spacing, and in fast bulk motion of the speed of
sound c. The sums of SPH use differences of such numbers and lose that fraction. Measured with the
limits switched off:
`uniform` (1-D 100 particles, 2-D 225 hexagonal; t = 0.5 and 2) with lower = 1e6 ... 1e14, Sod's
tube (198) at the same places, and `shock_tube` (200) in bulk motion at Mach 1e3 ... 1e15, the last
two compared with the run at 0. The largest error of any particle is proportional to gap/spacing or
gap/c:

| ratio | uniform: v/c  | uniform: u    | Sod: density | Sod: v | Sod in motion: v |
| 1e-8  | 1e-8 ... 7e-8 | 1e-8 ... 2e-8 | 2e-8         | 6e-8   | 5e-8             |
| 1e-5  | 4e-6 ... 2e-5 | 6e-6 ... 2e-5 | 2e-5         | 7e-5   | 6e-5             |
| 1e-3  | 2e-4 ... 1e-3 | 2e-4 ... 3e-3 | 1.5e-3       | 6e-3   | 8e-3             |
| 1e-1  | 2e-2 ... 1e-1 | 6e-2 ... 4e-1 | 2e-1         | 3e-1   | 8e-1             |

In single precision the sums see positions relative to the middle of a superblock (`sph.passes.
gather`) as float32 numbers. The ratio is 1e-5 at most in a superblock of equal particles, and large
where a superblock contains a small dense cluster. Clusters of 200 particles in a cloud of 200 (3-D,
sizes 1e-2, 1e-4 and 1e-6 of the cloud): ratios 2e-5, 2e-3 and 0.2 gave density errors of 1e-5, 4e-4
and 5e-2.
"""

from typing import NamedTuple

import numpy as np

from sph.faults import fault
from sph.neighbours.order import BLOCK

# Steady states have errors up to five times the ratio, here 1e-3 and 1e-6.
REFUSED = 2e-4
DOUBTED = 2e-7
DOUBTED_SINGLE = 2e-5


class Gap(NamedTuple):
    """The position or velocity that float64 resolves worst, compared with its scale."""

    kind: str  # "position", "velocity", or "place" for positions in single precision
    index: int  # type: ignore[assignment]  # of the particle in memory order
    size: float  # distance to the next number
    scale: float  # the particle spacing, or the speed of sound plus the relative velocity

    @property
    def ratio(self) -> float:
        return self.size / self.scale


def largest_gap(particles, spacing, sound_speed) -> Gap:
    """Return the gap with the largest ratio to its scale, over all particles and both kinds.

    particles: positions and velocities (D, N); spacing, sound_speed: (N,) or one number.
    A velocity is compared with c + |v - median of v|. So gas in uniform motion at Mach 1e17 is not
    resolved, but cold streams that collide at that speed are.
    """
    spacing = np.broadcast_to(spacing, particles.mass.shape)
    gaps = [_largest("position", particles.position, spacing)]
    speed = _departure(particles.velocity)
    speed += sound_speed
    gaps.append(_largest("velocity", particles.velocity, speed))
    return max(gaps, key=lambda gap: gap.size / gap.scale if gap.scale > 0.0 else 0.0)


# The next two work axis by axis and in place: the arrays of a large run leave little memory.


def _departure(velocity: np.ndarray) -> np.ndarray:
    """Return |v - median of v|, (N,), of velocities (D, N)."""
    squared = np.zeros(velocity.shape[1])
    for v in velocity:
        away = v - np.median(v)
        away *= away
        squared += away
    return np.sqrt(squared, out=squared)


def _largest(kind: str, values: np.ndarray, scale: np.ndarray) -> Gap:
    """Return the largest gap of values (D, N) over scale (N,)."""
    size = np.zeros(values.shape[1])
    for row in values:
        np.maximum(size, np.abs(row), out=size)
    np.spacing(size, out=size)
    # pressureless gas at rest has scale 0 and needs no check; the watchdog reports NaN
    ratio = np.divide(size, scale, out=np.zeros_like(size), where=scale > 0.0)
    i = int(np.argmax(np.nan_to_num(ratio, copy=False, nan=0.0)))
    return Gap(kind, i, float(size[i]), float(scale[i]))


def check_extent(simulation) -> None:
    """Raise NumericalError if float64 does not resolve positions. Called before neighbour search.

    The spacing is the mean spacing in the box.
    """
    box = simulation.scene.domain.box
    n = simulation.particles.number
    spacing = (np.prod(box[:, 1] - box[:, 0]) / n) ** (1.0 / len(box))
    _refuse(simulation, largest_gap(simulation.particles, spacing, np.inf))


def check(simulation) -> None:
    """Raise NumericalError if a ratio exceeds REFUSED. Support radii must be known."""
    _refuse(simulation, _gap_of(simulation))
    if simulation.scene.is_single:
        _refuse(simulation, _gap_in_single(simulation))


def doubt(simulation) -> str | None:
    """Return a warning on the effect of rounding if a ratio exceeds DOUBTED, else None."""
    gap = _gap_of(simulation)
    if simulation.scene.is_single and not gap.ratio > DOUBTED:
        gap = _gap_in_single(simulation)
    if not gap.ratio > (DOUBTED_SINGLE if gap.kind == "place" else DOUBTED):
        return None
    what, remedy = _in_words(simulation, gap)
    return f"{what}: expect relative errors up to {5.0 * gap.ratio:.1g}. Try: {remedy}."


def _gap_of(simulation) -> Gap:
    p = simulation.particles
    with np.errstate(all="ignore"):  # unphysical states, which the watchdog reports
        sound_speed = simulation.scene.formulation.sound_speed(p)
    return largest_gap(p, _spacing(simulation), sound_speed)


def _spacing(simulation) -> np.ndarray:
    """Return the particle spacing (N,), inf for particles without a support radius."""
    p, models = simulation.particles, simulation.scene.formulation.models
    # a density below 0 marks a particle without a support radius, which is reported elsewhere
    return np.where(p.density > 0.0, p.support / (models.support_ratio * models.eta), np.inf)


def _gap_in_single(simulation) -> Gap:
    """Return the gap of positions from the middle of superblocks that has the largest ratio."""
    position, spacing = simulation.particles.position, _spacing(simulation)
    begin = simulation.search.lists.first[:-1] * BLOCK
    number = np.diff(begin, append=spacing.size)
    size = np.zeros(spacing.size, np.float32)
    for x in position:  # axis by axis, as above
        middle = 0.5 * (np.minimum.reduceat(x, begin) + np.maximum.reduceat(x, begin))
        away = x - np.repeat(middle, number)
        away /= spacing
        np.maximum(size, np.spacing(np.abs(away).astype(np.float32)), out=size)
    i = int(np.argmax(size))
    return Gap("place", i, float(size[i] * spacing[i]), float(spacing[i]))


def _refuse(simulation, gap: Gap) -> None:
    if gap.ratio > REFUSED:
        what, remedy = _in_words(simulation, gap)
        raise fault(simulation, what, remedy, int(simulation.particles.id[gap.index]))


def _in_words(simulation, gap: Gap) -> tuple[str, str]:
    """Return the description of what is not resolved, and what to try."""
    p = simulation.particles
    number, field, measure, remedy = {
        "position": (
            "float64", "position", "the particle spacing", "shift problem.domain closer to 0",
        ),
        "velocity": (
            "float64", "velocity", "the speed of sound",
            "subtract the bulk velocity, or use hotter gas",
        ),
        "place": (
            "float32", "position", "the particle spacing", 'run.precision = "double"',
        ),
    }[gap.kind]  # fmt: skip
    value = ", ".join(f"{x:.6g}" for x in getattr(p, field)[:, gap.index])
    origin = ", relative to its neighbours in memory" if gap.kind == "place" else ""
    return (
        f"{number} does not resolve the {field} ({value}) of particle {p.id[gap.index]}{origin}: "
        f"the next {number} number is {gap.size:.3g} away, which is {gap.ratio:.3g} of {measure} "
        f"({gap.scale:.3g})",
        remedy,
    )
