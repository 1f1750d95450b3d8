"""What problems of one elastic body take from [physics], and what they measure of bodies."""

import math

import numpy as np


def check_single(physics) -> None:
    """Raise ValueError unless [physics] has one material, with a density at rest.

    The message begins with a key of [physics].
    """
    if physics.formulation != "continuum":
        raise ValueError(
            f'physics.formulation = "{physics.formulation}": expected "continuum", which has '
            'solids and liquids. Try: physics.formulation = "continuum"'
        )
    if physics.materials is not None:
        raise ValueError("physics.materials is given: expected one material in this problem")
    if not hasattr(physics.eos_model(), "rho_0"):
        key = "gamma" if physics.eos is None else "eos"
        raise ValueError(
            f"physics.{key} = {physics.shown(key)}: expected an equation of state of a solid or "
            'liquid, with a density at rest rho_0. Try: physics.eos of the name "mie_gruneisen" or '
            '"tait"'
        )


def required(physics, liquid: bool = False):
    """Return equation of state and strength of the single material of [physics].

    Raises ValueError, with a message that begins with a key of [physics], for a material without a
    reference density, and unless the material has a strength; with `liquid`, if it has one.
    """
    check_single(physics)
    eos, strength = physics.eos_model(), physics.strength_model()
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
