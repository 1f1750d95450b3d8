"""The table [units]: which physical units the numbers of a run are in."""

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from sph.problems.base import Section
from sph.quantity import UNIT_RANGE

# Values in cgs. Solar and terrestrial masses are the nominal GM of IAU 2015 resolution B3 over
# G = 6.67430e-8 (CODATA 2018), radii are nominal too; au, ly, pc and yr (Julian) are exact.
LENGTHS = {
    "nm": 1e-7, "um": 1e-4, "mm": 0.1, "cm": 1.0, "m": 100.0, "km": 1e5, "R_earth": 6.3781e8,
    "R_sun": 6.957e10, "au": 1.495978707e13, "ly": 9.4607304725808e17,
    "pc": 3.0856775814913673e18, "kpc": 3.0856775814913673e21, "Mpc": 3.0856775814913673e24,
}  # fmt: skip
MASSES = {
    "mg": 1e-3, "g": 1.0, "kg": 1e3, "t": 1e6, "M_earth": 5.9721679e27, "M_jup": 1.8981246e30,
    "M_sun": 1.9884099e33,
}  # fmt: skip
TIMES = {
    "ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0,
    "yr": 3.15576e7, "kyr": 3.15576e10, "Myr": 3.15576e13, "Gyr": 3.15576e16,
}  # fmt: skip
CGS = {"length": "cm", "mass": "g", "time": "s"}


Positive = Annotated[float, Field(ge=UNIT_RANGE[0], le=UNIT_RANGE[1])]
if TYPE_CHECKING:
    Length = str
    Mass = str
    Time = str
else:
    Length = Literal[tuple(LENGTHS)]
    Mass = Literal[tuple(MASSES)]
    Time = Literal[tuple(TIMES)]


class Units(Section):
    """Physical units of the numbers in this file and in the output: all three keys, or none.

    They are labels and conversion factors in checkpoints, exports, figures and reports, and an
    initial state from a file that states other units is converted to them. The program computes
    with the bare numbers. Constants such as G must be in these units.
    """

    restart: ClassVar[str | None] = "free"

    length: Positive | Length | None = Field(
        None,
        description="unit of length, by name or as a number of cm; none if not given",
        examples=["pc"],
    )
    mass: Positive | Mass | None = Field(
        None,
        description="unit of mass, by name or as a number of g; none if not given",
        examples=["M_sun"],
    )
    time: Positive | Time | None = Field(
        None,
        description="unit of time, by name or as a number of s; none if not given",
        examples=["Myr"],
    )

    @model_validator(mode="after")
    def _all_or_none(self) -> Self:
        missing = [name for name in CGS if getattr(self, name) is None]
        if missing and len(missing) < len(CGS):
            raise ValueError(
                f"{' and '.join(missing)} missing: expected length, mass and time, or none of them"
            )
        return self

    @property
    def are_given(self) -> bool:
        return self.length is not None

    def in_cgs(self) -> tuple[float, float, float]:
        """Return length, mass and time unit in cm, g and s; 1 each if no units are given."""
        if not self.are_given:
            return 1.0, 1.0, 1.0
        tables = {"length": LENGTHS, "mass": MASSES, "time": TIMES}
        length, mass, time = (
            table[given] if isinstance(given := getattr(self, name), str) else float(given)
            for name, table in tables.items()
        )
        return length, mass, time

    def factor(self, length: int, mass: int, time: int) -> float:
        """Return the value in cgs of the unit with these exponents; 1 if no units are given."""
        unit_length, unit_mass, unit_time = self.in_cgs()
        return unit_length**length * unit_mass**mass * unit_time**time

    def symbol(self, length: int, mass: int, time: int) -> str:
        """Return the unit with these exponents, as "M_sun pc^-3"; "" if no units are given.

        For a run in 1-D or 2-D, of a layer that is one unit of length deep along unused axes.
        """
        if not self.are_given:
            return ""
        factors = self.factors(length, mass, time)
        return " ".join(name + (f"^{power}" if power != 1 else "") for name, power in factors)

    def factors(self, length: int, mass: int, time: int) -> list[tuple[str, int]]:
        """Return names and powers of the units in a unit with these exponents."""
        powers = (("mass", mass), ("length", length), ("time", time))
        return [(self._name(name), power) for name, power in powers if power]

    def _name(self, name: str) -> str:
        given = getattr(self, name)
        return given if isinstance(given, str) else f"({given:.6g} {CGS[name]})"
