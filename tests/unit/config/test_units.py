"""The table [units]: names, numbers, and what they make of exponents."""

import pytest

from sph import config
from sph.config import units
from sph.errors import ConfigError

GALAXY = '[units]\nlength = "pc"\nmass = "M_sun"\ntime = "Myr"\n'


def read(text=""):
    return config.from_text(f'[problem]\nname = "shock_tube"\n{text}', "x.toml")


def test_names_and_numbers_are_values_in_cgs():
    assert read(GALAXY).units.in_cgs() == (3.0856775814913673e18, 1.9884099e33, 3.15576e13)
    given = read('[units]\nlength = 2.5\nmass = "kg"\ntime = 60\n').units
    assert given.in_cgs() == (2.5, 1000.0, 60.0)


def test_relations_between_names():
    """Exact by definition, but for round-off of a product."""
    lengths, times = units.LENGTHS, units.TIMES
    assert lengths["kpc"] == pytest.approx(1e3 * lengths["pc"], rel=1e-15)
    assert lengths["pc"] == pytest.approx(lengths["au"] * 648000 / 3.141592653589793, rel=1e-15)
    assert lengths["ly"] == pytest.approx(2.99792458e10 * times["yr"], rel=1e-15)
    assert times["yr"] == 365.25 * times["d"] == 365.25 * 24 * times["h"]
    # the nominal GM of the Sun, to the digits that the table has
    assert 6.67430e-8 * units.MASSES["M_sun"] == pytest.approx(1.3271244e26, rel=1e-7)
    assert 6.67430e-8 * units.MASSES["M_earth"] == pytest.approx(3.986004e20, rel=1e-7)
    assert 6.67430e-8 * units.MASSES["M_jup"] == pytest.approx(1.2668653e23, rel=1e-7)


def test_factor_and_symbol_of_exponents():
    given = read('[units]\nlength = "m"\nmass = "kg"\ntime = "ms"\n').units
    assert given.factor(-3, 1, 0) == pytest.approx(1e-3, rel=1e-15)  # kg/m^3 in g/cm^3
    assert given.factor(1, 0, -1) == pytest.approx(1e5, rel=1e-15)
    assert given.symbol(-1, 1, -2) == "kg m^-1 ms^-2"
    assert given.symbol(0, 0, 0) == ""
    number = read('[units]\nlength = 3.1e18\nmass = "g"\ntime = "s"\n').units
    assert number.symbol(1, 0, -1) == "(3.1e+18 cm) s^-1"


def test_without_units_there_is_no_symbol_and_factors_are_1():
    plain = read().units
    assert not plain.are_given
    assert plain.in_cgs() == (1.0, 1.0, 1.0)
    assert (plain.factor(2, 1, -2), plain.symbol(2, 1, -2)) == (1.0, "")
    assert "[units]" not in read().to_toml()


def test_configuration_with_units_reads_back():
    given = read(GALAXY)
    assert config.from_text(given.to_toml()) == given
    assert GALAXY in given.recorded


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('length = "pc"', "mass and time missing: expected length, mass and time, or none"),
        ('length = "parsec"\nmass = 1.0\ntime = 1.0', 'line 4: units.length = "parsec".*"pc"'),
        ("length = -1.0\nmass = 1.0\ntime = 1.0", "units.length = -1.0: expected a number"),
        ("length = 1e99\nmass = 1.0\ntime = 1.0", "units.length = 1e.99: expected a number"),
        ('speed = "km/s"', "units.speed is not a key of"),
    ],
)
def test_wrong_units_are_refused(table, words):
    with pytest.raises(ConfigError, match=words):
        read(f"[units]\n{table}\n")
