"""Whether float64 resolves a state: positions against spacings, velocities against sound.

The gap between a number and the next grows with the number (`np.spacing`). Far from 0 the gap
becomes a share of the particle spacing, in fast bulk motion a share of the speed of sound, and the
sums of SPH, which are differences of such numbers, lose that share. Measured with thresholds off:
`uniform` (1-D 100 particles, 2-D 225 hexagonal; t = 0.5 and 2) with lower = 1e6 ... 1e14, Sod's
tube (198) there, and `shock_tube` (200) in bulk motion of Mach 1e3 ... 1e15, both against the same
run at 0. The largest error of any particle is proportional to the ratio gap/spacing or
gap/(speed of sound):

| ratio | uniform: v/c  | uniform: u    | Sod: density | Sod: v | Sod in motion: v |
| 1e-8  | 1e-8 ... 7e-8 | 1e-8 ... 2e-8 | 2e-8         | 6e-8   | 5e-8             |
| 1e-5  | 4e-6 ... 2e-5 | 6e-6 ... 2e-5 | 2e-5         | 7e-5   | 6e-5             |
| 1e-3  | 2e-4 ... 1e-3 | 2e-4 ... 3e-3 | 1.5e-3       | 6e-3   | 8e-3             |
| 1e-1  | 2e-2 ... 1e-1 | 6e-2 ... 4e-1 | 2e-1         | 3e-1   | 8e-1             |
"""

from typing import NamedTuple

import numpy as np

from sph.faults import fault

# Steady states are wrong by up to some five times the ratio: by 1e-3, and by 1e-6.
REFUSED = 2e-4
DOUBTED = 2e-7


class Gap(NamedTuple):
    """The least resolved number of a state: a position or velocity, and what it must resolve."""

    kind: str  # "position" or "velocity"
    index: int  # type: ignore[assignment]  # of the particle in memory order
    size: float  # distance to the next float64
    scale: float  # the particle's spacing, or speed of sound and relative velocity together

    @property
    def ratio(self) -> float:
        return self.size / self.scale


def largest_gap(particles, spacing, sound_speed) -> Gap:
    """The gap with the largest ratio to its scale, of any particle and kind.

    particles: positions and velocities (D, N); spacing, sound_speed: (N,) or one number.
    A velocity is compared with c + |v - median of v|: gas at Mach 1e17 that is all in one motion is
    not resolved, cold gas whose streams meet at such a speed is.
    """
    departure = particles.velocity - np.median(particles.velocity, axis=1, keepdims=True)
    scales = {
        "position": np.broadcast_to(spacing, particles.mass.shape),
        "velocity": sound_speed + np.linalg.norm(departure, axis=0),
    }
    gaps = []
    for kind, scale in scales.items():
        size = np.spacing(np.abs(getattr(particles, kind)).max(axis=0))
        # pressureless gas at rest has no sound that could be lost, and the watchdog reports NaN
        ratio = np.divide(size, scale, out=np.zeros_like(size), where=scale > 0.0)
        i = int(np.argmax(np.nan_to_num(ratio, nan=0.0)))
        gaps.append(Gap(kind, i, float(size[i]), float(scale[i])))
    return max(gaps, key=lambda gap: gap.size / gap.scale if gap.scale > 0.0 else 0.0)


def check_extent(simulation) -> None:
    """Raise NumericalError, before neighbours are looked for, where positions cannot be resolved.

    What the box holds on average is the spacing: far enough away, particles coincide.
    """
    box = simulation.scene.domain.box
    n = simulation.particles.number
    spacing = (np.prod(box[:, 1] - box[:, 0]) / n) ** (1.0 / len(box))
    _refuse(simulation, largest_gap(simulation.particles, spacing, np.inf))


def check(simulation) -> None:
    """Raise NumericalError where rounding takes more than REFUSED; supports must be known."""
    _refuse(simulation, _gap_of(simulation))


def doubt(simulation) -> str | None:
    """What rounding does to the results, in words, where it takes more than DOUBTED."""
    gap = _gap_of(simulation)
    if not gap.ratio > DOUBTED:
        return None
    what, remedy = _in_words(simulation, gap)
    return f"{what}: expect relative errors up to {5.0 * gap.ratio:.1g}. Try: {remedy}."


def _gap_of(simulation) -> Gap:
    p, models, eos = simulation.particles, simulation.scene.models, simulation.scene.eos
    with np.errstate(all="ignore"):  # gas that is torn apart, which the watchdog reports
        sound_speed = eos.sound_speed(p.density, eos.pressure(p.density, p.internal_energy))
    spacing = p.support / (models.support_ratio * models.eta)
    # a density below 0 marks a particle that has no support, which has an error of its own
    return largest_gap(p, np.where(p.density > 0.0, spacing, np.inf), sound_speed)


def _refuse(simulation, gap: Gap) -> None:
    if gap.ratio > REFUSED:
        what, remedy = _in_words(simulation, gap)
        raise fault(simulation, what, remedy, int(simulation.particles.id[gap.index]))


def _in_words(simulation, gap: Gap) -> tuple[str, str]:
    """What is not resolved, and what to try."""
    p = simulation.particles
    value = ", ".join(f"{x:.6g}" for x in getattr(p, gap.kind)[:, gap.index])
    measure, remedy = {
        "position": ("the particle spacing", "shift problem.domain nearer to 0"),
        "velocity": (
            "the speed of sound", "subtract the bulk velocity from all particles, or hotter gas",
        ),
    }[gap.kind]  # fmt: skip
    return (
        f"float64 does not resolve the {gap.kind} ({value}) of particle {p.id[gap.index]}: the "
        f"next number is {gap.size:.3g} away, {gap.ratio:.3g} of {measure} ({gap.scale:.3g})",
        remedy,
    )
