"""What a number of the output means: help and unit of columns of the history and of figures."""

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import NamedTuple

# Units of D-dimensional code units: D is the dimension of the run, and the mass of a run in 1-D or
# 2-D is per unit area or length.
TIME = "time"
LENGTH = "length"
VELOCITY = "length time^-1"
ENERGY = "mass length^2 time^-2"
SPECIFIC_ENERGY = "length^2 time^-2"
MOMENTUM = "mass length time^-1"
ANGULAR_MOMENTUM = "mass length^2 time^-1"
DENSITY = "mass length^-D"
PRESSURE = "mass length^(2-D) time^-2"
RATE = "time^-1"
SECONDS = "s"
CPU_SECONDS = "CPU s"

# Least and largest unit of length, mass and time in cm, g and s: products of powers of units are
# then finite numbers.
UNIT_RANGE = (1e-50, 1e50)


class Quantity(NamedTuple):
    """A number of the output.

    help: what the number is, and relative to what, as a phrase. unit: a product of powers of
    length, mass and time in code units, one of s, CPU s and bytes, or empty for a number without
    unit, a count or a text.
    """

    help: str
    unit: str = ""


# Fields of particles in figures and profiles.
FIELDS = {
    "x": Quantity("position along x", LENGTH),
    "r": Quantity("distance from the centre of the problem, which moves with the flow", LENGTH),
    "density": Quantity("density", DENSITY),
    "column_density": Quantity("mass per area along a line of sight", "mass length^-2"),
    "velocity": Quantity("velocity along the coordinate of the profile", VELOCITY),
    "v_r": Quantity("velocity along the radius, relative to the centre", VELOCITY),
    "v_phi": Quantity(
        "velocity across the radius, anticlockwise, relative to the centre", VELOCITY
    ),
    "speed": Quantity("size of the velocity", VELOCITY),
    "pressure": Quantity("pressure", PRESSURE),
    "internal_energy": Quantity("internal energy per unit mass", SPECIFIC_ENERGY),
    "stress": Quantity("compressive stress -sigma_xx", PRESSURE),
    "von_mises": Quantity("von Mises stress", PRESSURE),
    "plastic_strain": Quantity("equivalent plastic strain"),
}


def exponents(unit: str) -> tuple[int, int, int] | None:
    """Return the exponents of length, mass and time in a unit; None for other units.

    D counts as 3: with physical units ([units]), a run in 1-D or 2-D is a layer that is one unit of
    length deep along unused axes.
    """
    found = {"length": 0, "mass": 0, "time": 0}
    for factor in unit.split():
        name, _, power = factor.partition("^")
        if name not in found:
            return None
        terms = power.strip("()").replace("D", "3") or "1"  # such as -3 and 2-3
        first, minus, rest = terms.rpartition("-")
        found[name] = int(first or 0) - int(rest) if minus else int(rest)
    return found["length"], found["mass"], found["time"]


def compared(
    quantities: Mapping[str, Quantity], to: str = "exact", error: str = "relative error, absolute"
) -> dict[str, Quantity]:
    """Return `quantities`, with NAME_`to`, the expected value, and NAME_error of each."""
    found: dict[str, Quantity] = {}
    for name, one in quantities.items():
        what = {"exact": "exact value", "reference": "value of the reference solution"}[to]
        found[name] = one
        found[f"{name}_{to}"] = Quantity(f"{what} of {name}", one.unit)
        found[f"{name}_error"] = Quantity(f"{error}: {name} over {name}_{to}, minus 1")
    return found


def meaning(quantities: Mapping[str, Quantity], name: str) -> Quantity | None:
    """Return the declaration of `name`, or None. A declared name may contain "*", any text."""
    if name in quantities:
        return quantities[name]
    return next((one for known, one in quantities.items() if fnmatchcase(name, known)), None)
