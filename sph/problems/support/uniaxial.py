"""Plane waves along x in solids: a steel, box, initial state, stress."""

import numpy as np

# Constants of a steel in SI units: density, bulk speed of sound, slope of the shock speed.
STEEL = {
    "name": "mie_gruneisen",
    "rho_0": 7850.0,
    "c_0": 3600.0,
    "slope": 1.8,
    "gruneisen": 1.81,
}
SHEAR_MODULUS, YIELD_STRESS = 8e10, 6e8

# Largest relative error of wave speeds where gradients on a lattice are wrong, and why.
OFF_LATTICE = (
    0.04,
    "gradients of orders -1 and 0 on a lattice are wrong by up to 3 %; try physics.correction = 1, "
    "or physics.spacing_ratio = 2",
)


def is_off_on_lattice(physics) -> bool:
    """Return whether gradients on a lattice are wrong by more than 0.3 %."""
    return physics.correction < 1 and physics.spacing_ratio != 2.0


def slender_box(domain, dimension: int) -> np.ndarray:
    """Return the box (D, 2) of a `domain`: [lo, hi] along x, or one [lo, hi] per axis.

    With [lo, hi], y and z are an eighth as wide and centred on 0.
    """
    ends = np.array(domain, dtype=float)
    if ends.ndim == 2:
        return ends
    sixteenth = (ends[1] - ends[0]) / 16
    return np.array([ends] + [[-sixteenth, sixteenth]] * (dimension - 1))


def at_rest(box: np.ndarray, number: int, rho_0: float) -> tuple[np.ndarray, np.ndarray, dict]:
    """Return mass and internal energy (N,) and the density of particles that fill `box` (D, 2).

    Masses are equal; there is no stress and no energy.
    """
    mass = rho_0 * np.prod(box[:, 1] - box[:, 0]) / number
    return np.full(number, mass), np.zeros(number), {"density": np.full(number, rho_0)}


def compressive_stress(particles, pressure: np.ndarray) -> np.ndarray:
    """Return -sigma_xx (N,): the pressure, less the deviatoric stress S_xx of a solid."""
    deviatoric = getattr(particles, "deviatoric_stress", None)
    return pressure if deviatoric is None else pressure - deviatoric[0, 0]
