"""Shocks of uniaxial strain in solids: linear shock speed, Mie-Grueneisen energy, strength.

Davison (2008), Fundamentals of Shock Wave Propagation in Solids. The material ahead is at rest
without stress at density rho_0, and the waves run towards +x. Stresses are positive in compression:
`stress` is -sigma_xx = pressure + deviator, with the deviator -S_xx. Units are whatever the numbers
are; energies are per unit mass.
"""

import math
from typing import Any, NamedTuple

import numpy as np


class Material(NamedTuple):
    """Constants of the shock speed Us = c_0 + slope up, of the energy, and of the strength.

    gruneisen: Grueneisen's Gamma at rho_0, with Gamma rho constant. Perfectly plastic at
    yield_stress, in simple tension.
    """

    rho_0: float
    c_0: float
    slope: float
    gruneisen: float
    shear_modulus: float = 0.0
    yield_stress: float = math.inf

    @property
    def yield_deviator(self) -> float:
        """Largest deviator in uniaxial strain, two thirds of the yield stress (eq 442)."""
        return 2.0 / 3.0 * self.yield_stress if self.shear_modulus > 0.0 else 0.0

    @property
    def yield_compression(self) -> float:
        """1 - rho_0/rho at which the material yields; 1 if it never does (eq 443)."""
        if self.shear_modulus == 0.0:
            return 0.0
        return -math.expm1(-0.5 * self.yield_stress / self.shear_modulus)


class Medium(NamedTuple):
    """State of the material: numbers, or arrays (N,). velocity: along the waves."""

    density: Any
    velocity: Any
    pressure: Any
    deviator: Any
    internal_energy: Any

    @property
    def stress(self) -> Any:
        return self.pressure + self.deviator


class Front(NamedTuple):
    """A shock: its speed in the frame of the material at rest, and the state behind the shock."""

    speed: float
    behind: Medium


def longitudinal_speed(bulk_modulus: float, shear_modulus: float, density: float) -> float:
    """Return the speed of small longitudinal waves in uniaxial strain (eq 415)."""
    return math.sqrt((bulk_modulus + 4.0 / 3.0 * shear_modulus) / density)


def deviator(material: Material, compression: float) -> float:
    """Return the deviator after compression to 1 - rho_0/rho, never reversed (eq 442)."""
    if compression >= material.yield_compression:
        return material.yield_deviator
    return -4.0 / 3.0 * material.shear_modulus * math.log1p(-compression)


def behind(material: Material, ahead: Medium, compression: float) -> Front:
    """Return the shock from `ahead` to a `compression` 1 - rho_0/rho (eqs 422 and 440-442)."""
    rho_0, _, _, gruneisen = material[:4]
    on_hugoniot = _hugoniot_pressure(material, compression)
    s = deviator(material, compression)
    squeezed = (compression - 1.0 + rho_0 / ahead.density) / rho_0  # decrease of 1/rho
    # eq 440 is linear in the energy, and eq 441 in the pressure, so both are solved directly
    cold = on_hugoniot * (1.0 - 0.5 * gruneisen * compression)
    energy = ahead.internal_energy + 0.5 * (ahead.stress + s) * squeezed
    pressure = (cold + gruneisen * rho_0 * energy) / (1.0 - 0.5 * gruneisen * rho_0 * squeezed)
    jump = pressure + s - ahead.stress
    velocity = ahead.velocity + math.sqrt(jump * squeezed)
    speed = ahead.velocity + math.sqrt(jump / squeezed) / ahead.density
    energy = ahead.internal_energy + 0.5 * (ahead.stress + pressure + s) * squeezed
    return Front(speed, Medium(rho_0 / (1.0 - compression), velocity, pressure, s, energy))


def elastic_limit(material: Material) -> Front | None:
    """Return the elastic precursor up to the Hugoniot elastic limit (eq 444); None without one."""
    if not 0.0 < material.yield_compression < largest_compression(material):
        return None
    return behind(material, at_rest(material), material.yield_compression)


def fronts(material: Material, speed: float) -> tuple[Front, ...]:
    """Return the shocks of material that is brought to `speed`, the fastest first (eq 444).

    One shock, or an elastic precursor and a plastic shock where the latter is slower. Raises
    ValueError for a speed that is not positive.
    """
    if not (math.isfinite(speed) and speed > 0.0):
        raise ValueError(f"speed = {speed}: expected a finite positive number")
    rest, precursor = at_rest(material), elastic_limit(material)
    if precursor is None or speed <= precursor.behind.velocity:
        return (_driven(material, rest, speed),)
    plastic = _driven(material, precursor.behind, speed)
    if plastic.speed < precursor.speed:
        return precursor, plastic
    return (_driven(material, rest, speed),)


def at_rest(material: Material) -> Medium:
    """Return the material ahead of all waves."""
    return Medium(material.rho_0, 0.0, 0.0, 0.0, 0.0)


def largest_compression(material: Material) -> float:
    """Return the 1 - rho_0/rho at which the pressure behind a shock diverges (eqs 422 and 440)."""
    return min(1.0, 1.0 / max(material.slope, 1e-9), 2.0 / max(material.gruneisen, 1e-9))


def at(found: tuple[Front, ...], ahead: Medium, xi: np.ndarray) -> Medium:
    """Return the state (N,) at x/t = `xi` (N,), in the frame of the material at rest."""
    inside = [xi < front.speed for front in found]
    fields = []
    for name in Medium._fields:
        value = np.full(xi.shape, getattr(ahead, name))
        for within, front in zip(inside, found, strict=True):  # slower fronts overwrite faster
            value = np.where(within, getattr(front.behind, name), value)
        fields.append(value)
    return Medium(*fields)


def _hugoniot_pressure(material: Material, compression: float) -> float:
    """Return the pressure on the Hugoniot curve of the material without strength (eq 422)."""
    rho_0, c_0, slope = material[:3]
    return rho_0 * c_0**2 * compression / (1.0 - slope * compression) ** 2


def _driven(material: Material, ahead: Medium, speed: float) -> Front:
    """Return the shock behind which the material has velocity `speed`."""
    from scipy.optimize import brentq  # costs 0.1 s to import

    start = 1.0 - material.rho_0 / ahead.density
    room = largest_compression(material) - start

    def excess(share: float) -> float:
        return behind(material, ahead, start + share * room).behind.velocity - speed

    share = brentq(excess, 1e-12, 1.0 - 1e-9, xtol=1e-15, rtol=1e-14)
    return behind(material, ahead, start + share * room)
