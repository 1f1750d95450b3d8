"""Units that files with initial states are in, and conversion to those of the run.

Names of attributes: SWIFT's group /Units; Springel (2005), MNRAS 364, 1105 (GADGET-2) and its
descendants GADGET-4, AREPO and GIZMO, which write their parameters to /Header or /Parameters.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

from sph.problems.base import Units
from sph.problems.files.contents import Contents, check, refusal
from sph.quantity import UNIT_RANGE

if TYPE_CHECKING:  # h5py takes 0.1 s to import
    import h5py

    from sph.problems.files.lookup import Lookup

GROUPS = ("Units", "Header", "Parameters")
SWIFT = ("Unit length in cgs (U_L)", "Unit mass in cgs (U_M)", "Unit time in cgs (U_t)")
# of length, mass and velocity, from which that of time follows
GADGET = (
    ("UnitLength_in_cm", "UnitMass_in_g", "UnitVelocity_in_cm_per_s"),
    ("UnitLength_In_CGS", "UnitMass_In_CGS", "UnitVelocity_In_CGS"),
)

# Exponents of length, mass and time. A density is per volume in every dimension.
EXPONENTS = {
    "position": (1, 0, 0), "velocity": (1, 0, -1), "internal_energy": (2, 0, -2),
    "density": (-3, 1, 0),
}  # fmt: skip
WITHOUT_UNIT = ("alpha", "body", "clamped", "material", "plastic_strain")


class Conversion(NamedTuple):
    """The units of a file, and those of the run that reads the file.

    of_file: None if the file decides; of_run: None if the run has no [units].
    """

    of_file: Units | None = None
    of_run: Units | None = None

    def of(self, found: Contents) -> "Conversion":
        """Return this conversion with the units that the file states, where it decides."""
        return self._replace(of_file=self.of_file or found.units)


def convert(found: Contents, wanted: Conversion) -> Contents:
    """Return the contents in the units of the run; arrays change in place.

    Numbers stay as they are if the run has no [units], or if the units of the file are unknown.
    Raises FileError if the file states units that cannot be used, or if no rule converts an array.
    """
    found.conversion = wanted.of(found)
    of_file, of_run = found.conversion
    if of_run is None:
        return found
    if of_file is None and found.unit_fault:
        raise refusal(
            found.path,
            found.unit_fault,
            "units of length, mass and time, because the configuration has [units]",
            "problem.file_units = [LENGTH, MASS, TIME], the units of the numbers in the file in "
            "cm, g and s",
        )
    if of_file is None or of_file == of_run:
        return found
    _scale(found, tuple(one / other for one, other in zip(of_file, of_run, strict=True)))
    return check(found)


def _scale(found: Contents, ratios: tuple[float, ...]) -> None:
    """Multiply all numbers, whose units of length, mass and time are in these ratios to the run's.

    A run in 1-D or 2-D is a layer that is one unit of length deep along unused axes. The layer of
    the run is therefore 1/ratio times as deep as that of the file, and its masses likewise.
    """
    length, mass, time = ratios

    def factor(name: str) -> float:
        of_length, of_mass, of_time = EXPONENTS[name]
        return length**of_length * mass**of_mass * time**of_time

    for name in ("position", "velocity", "internal_energy"):
        getattr(found, name)[...] *= factor(name)
    found.mass *= mass * length ** (len(found.position) - 3)
    if found.box is not None:
        found.box = found.box * length
    if unknown := sorted(found.others.keys() - EXPONENTS.keys() - set(WITHOUT_UNIT)):
        raise refusal(
            found.path,
            f"it has {' and '.join(unknown)}, for which no conversion of units is known",
            ", ".join(["density", *WITHOUT_UNIT]) + " besides the four fields of gas",
            "numbers in the units of the configuration, without problem.file_units",
        )
    found.others = {
        name: array * factor(name) if name in EXPONENTS else array
        for name, array in found.others.items()
    }


def stated(file: "Lookup") -> tuple[Units | None, str]:
    """Return the units that an HDF5 file states, or None, and why stated units cannot be used.

    Checkpoints of runs without [units] state none: they have the number 1 for other readers, and
    UnitsGiven = 0.
    """
    if not file.header("UnitsGiven", 1)[0]:
        return None, ""
    for name in GROUPS:
        group = file.get(file.file, name)
        for keys in () if group is None else (SWIFT, *GADGET):
            there = [key for key in keys if key in group.attrs]
            if there:
                return _triple(file, group, keys, there)
    return None, ""


def _triple(
    file: "Lookup", group: "h5py.Group", keys: tuple[str, ...], there: list[str]
) -> tuple[Units | None, str]:
    place = group.name[1:]
    if missing := [key for key in keys if key not in there]:
        return None, f"{place} has {' and '.join(there)}, but no {' and no '.join(missing)}"
    length, mass, third = (float(file.numbers(group, key)[0]) for key in keys)
    time = third if keys is SWIFT else length / third if third else math.inf
    for key, value in zip(keys, (length, mass, time), strict=True):
        if not UNIT_RANGE[0] <= value <= UNIT_RANGE[1]:
            return None, f"{place}/{key} gives a unit of {value:g}"
    for where in ("Header", "Parameters"):
        there_too = file.get(file.file, where)
        if there_too is not None and "HubbleParam" in there_too.attrs:
            hubble = file.numbers(there_too, "HubbleParam")[0]
            if hubble not in (0.0, 1.0):
                return None, f"{where}/HubbleParam is {hubble:g}: units may contain factors of h"
    return (length, mass, time), ""
