"""What problems of one elastic body take from [physics], and what they measure of bodies."""

import math

import numpy as np


def required(physics, liquid: bool = False):
    """Return equation of state and strength of the single material of [physics].

    Raises ValueError, with a message that begins with a key of [physics], for a material without a
    reference density, and unless the material has a strength; with `liquid`, if it has one.
    """
    if physics.formulation != "continuum":
        raise ValueError(
            f'physics.formulation = "{physics.formulation}": expected "continuum"; this problem '
            "needs an evolved density" + ("" if liquid else " and a strength")
        )
    if physics.materials is not None:
        raise ValueError("physics.materials is given: expected one material in this problem")
    eos, strength = physics.eos_model(), physics.strength_model()
    if not hasattr(eos, "c_0"):
        raise ValueError(
            f'physics.eos = "{eos.name}": expected an equation of state with a reference density, '
            'such as "tait"'
        )
    if liquid and strength is not None:
        raise ValueError("physics.strength: expected none, because this problem is about a liquid")
    if not liquid and strength is None:
        raise ValueError("physics.strength is missing: this problem is about a solid")
    return eos, strength


def angular_momentum(particles) -> float:
    """Return the angular momentum about the centre of mass in 2-D."""
    m, (x, y), (u, v) = particles.mass, *moving(particles)
    return float((m * (x * v - y * u)).sum())


def moving(particles) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities (D, N) relative to the centre of mass."""
    share = particles.mass / particles.mass.sum()
    position, velocity = particles.position, particles.velocity
    return (
        position - (position * share).sum(axis=1)[:, None],
        velocity - (velocity * share).sum(axis=1)[:, None],
    )


def wrapped(angle: float) -> float:
    """Return an angle between -pi and pi."""
    return math.remainder(angle, 2.0 * math.pi)
