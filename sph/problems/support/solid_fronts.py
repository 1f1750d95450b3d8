"""Fronts of plane waves in solids: the exact solution's constants, positions, comparison."""

from typing import Any

import numpy as np

from sph import quantity as units
from sph.exact.solid_shocks import Front, Material
from sph.quantity import Quantity
from sph.quantity import compared as with_errors

HUGONIOT = ("rho_0", "c_0", "slope", "gruneisen")  # what eqs 422 and 440 need of an eos
# Plateaus are measured without a fifth at either end: there are the smeared fronts and, where the
# plates touch, the excess of heat of the start of the run (wall heating).
MARGIN = 0.2

QUANTITIES = {
    "shock_position": Quantity("distance of the shock from the plane of impact", units.LENGTH),
    "precursor_position": Quantity(
        "distance of the elastic precursor from the plane of impact", units.LENGTH
    ),
    **with_errors(
        {
            "shock_speed": Quantity("speed of the shock relative to the plate", units.VELOCITY),
            "precursor_speed": Quantity(
                "speed of the elastic precursor relative to the plate", units.VELOCITY
            ),
            "shock_stress": Quantity("median of -sigma_xx behind the shock", units.PRESSURE),
            "shock_pressure": Quantity("median pressure behind the shock", units.PRESSURE),
            "shock_density": Quantity("median density behind the shock", units.DENSITY),
            "shock_internal_energy": Quantity(
                "median internal energy per unit mass behind the shock", units.SPECIFIC_ENERGY
            ),
            "elastic_limit": Quantity(
                "median of -sigma_xx between the elastic precursor and the shock", units.PRESSURE
            ),
        }
    ),
}


def material(eos, strength: Any) -> Material | None:
    """Return the constants of the exact solution; None for laws without one."""
    if not all(hasattr(eos, name) for name in HUGONIOT):
        return None
    found = Material(*(float(getattr(eos, name)) for name in HUGONIOT))
    if strength is None:
        return found
    found = found._replace(shear_modulus=strength.shear_modulus)
    if not strength.yields:
        return found
    if not hasattr(strength, "yield_stress"):
        return None
    return found._replace(yield_stress=strength.yield_stress)


def names(fronts: tuple[Front, ...]) -> tuple[str, ...]:
    """Return "shock", or "precursor" and "shock"."""
    return ("precursor", "shock")[-len(fronts) :] if fronts else ()


def positions(fronts: tuple[Front, ...], distance, change) -> dict[str, float]:
    """Return NAME_position: where, coming from outside, the velocity is half way up a front.

    distance, change: (N,) distance from the plane of impact and change of velocity since t = 0.
    Interpolated linearly between two particles; 0 where there is no front yet.
    """
    inward = np.argsort(-distance, kind="stable")
    found, ahead = {}, 0.0
    for name, front in zip(names(fronts), fronts, strict=True):
        half = 0.5 * (ahead + front.behind.velocity)
        found[f"{name}_position"] = _crossing(distance[inward], change[inward] - half)
        ahead = front.behind.velocity
    return found


def _crossing(distance: np.ndarray, above: np.ndarray) -> float:
    """Return where `above` (N,) first becomes positive, at descending `distance` (N,); 0 if never.

    The outermost distance if it is positive there.
    """
    first = int(np.argmax(above > 0.0))
    if not above[first] > 0.0:
        return 0.0
    if first == 0:
        return float(distance[0])
    share = above[first] / (above[first] - above[first - 1])
    return float(distance[first] + share * (distance[first - 1] - distance[first]))


def plateaus(
    fronts: tuple[Front, ...], reach: list[float], distance, fields: dict[str, np.ndarray]
) -> dict[str, float]:
    """Return medians of `fields` (N,) behind the fronts, with exact values and errors.

    reach: exact distances of the fronts. NAME of `fields`, a field of `Medium`: shock_NAME, behind
    the slower front; elastic_limit: the stress between the two fronts.
    """
    figures: dict[str, float] = {}
    inside = _between(distance, 0.0, reach[-1])
    if inside.any():
        for name, values in fields.items():
            exact = getattr(fronts[-1].behind, name)
            figures |= compared(f"shock_{name}", float(np.median(values[inside])), exact)
    inside = _between(distance, reach[-1], reach[0])  # empty without a precursor
    if inside.any():
        limit = float(np.median(fields["stress"][inside]))
        figures |= compared("elastic_limit", limit, fronts[0].behind.stress)
    return figures


def _between(distance: np.ndarray, inner: float, outer: float) -> np.ndarray:
    """Return which particles are between two fronts, without MARGIN at either."""
    margin = MARGIN * (outer - inner)
    return (inner + margin < distance) & (distance < outer - margin)


def compared(name: str, found: float, exact: float) -> dict[str, float]:
    """Return a figure, its exact value and its relative error (absolute value)."""
    return {name: found, f"{name}_exact": exact, f"{name}_error": abs(found / exact - 1.0)}
