"""The engine with one lane and in single precision, against the dense transcription.

Properties that both precisions must have: units of a scene do not matter, nor does the place of a
periodic box; momentum is conserved.
"""

from dataclasses import replace
from unittest import mock

import dense
import numpy as np
import pytest
import test_engine as engine
from marks import slow_except

from sph import simd

# Round-off of a float32 number. Positions are relative to their superblock, here nearly the whole
# box: distances have an error of EPS times the box, and rates one of up to 18 EPS box/H (seen) of
# the sum of absolute pair terms, as a kernel near its edge changes by more than its argument. In a
# real scene a superblock is about two supports wide, and the same bound is 1e-6 to 5e-6.
EPS = 2.0**-24
SINGLE_ROUND_OFF = 30 * EPS
SINGLE_TOLERANCE = 1e-6  # of a converged support, as in runs


def rates(case, lists, lanes):
    """Names, and |error| of the engine as a fraction of the sum of pair terms, per particle."""
    tolerance = SINGLE_TOLERANCE if lanes is simd.SINGLE else engine.TIGHT
    scattered, skin = engine.random_gas(case, lists)
    with mock.patch.object(engine, "TIGHT", tolerance):
        gas, found, _ = engine.run_engine(case, scattered, skin, threads=1, lanes=lanes)
    alpha = found.pop("alpha", None)
    if not case.finds_shocks:
        alpha = gas.alpha if case.evolves else None
    state = (case.dense_scene, gas.position, gas.velocity, gas.mass, gas.energy, gas.support)
    expected = dense.rates(*state, alpha)
    errors = {
        name: abs(values - getattr(expected, name)) / getattr(expected, f"{name}_scale")
        for name, values in found.items()
    }
    if case.finds_shocks:
        switched = dense.rates(*state, gas.alpha, dense.Before(gas.acceleration, engine.STEP))
        errors["alpha"] = abs(alpha - switched.alpha) / switched.alpha_scale
    return gas, found, errors, expected


@pytest.mark.parametrize("case", slow_except({0}, [engine.CASES[k] for k in (8, 22, 33)]), ids=str)
def test_one_lane_matches_transcription_and_vectors(case):
    _, found, errors, expected = rates(case, "reused", simd.SCALAR)
    for name, error in errors.items():
        assert np.all(error <= engine.ROUND_OFF), (name, error.max())
    _, vectors, _, _ = rates(case, "reused", simd.DOUBLE)
    # The same sums in another order: not the same bits, which would be two runs of one code.
    assert any(not np.array_equal(values, found[name]) for name, values in vectors.items())
    for name, values in vectors.items():
        scale = getattr(expected, f"{name}_scale")
        assert np.all(abs(values - found[name]) <= engine.ROUND_OFF * scale), name


@pytest.mark.parametrize("lists", ["fresh", "reused", "widened"])
@pytest.mark.parametrize("case", slow_except({2}, engine.CASES[::4]), ids=str)
def test_single_precision_matches_transcription(case, lists):
    _, _, errors, expected = rates(case, lists, simd.SINGLE)
    box = np.ptp(case.box, axis=1).max()
    for name, error in errors.items():
        bound = SINGLE_ROUND_OFF * (1.0 + box / expected.support)
        assert np.all(error <= bound), (name, np.max(error / bound))
        if name != "sound_speed":  # from the density in double precision
            assert error.max() > EPS / 8, f"{name} is not in single precision"


PROPERTIES = [
    engine.Case(("periodic",), "wendland_c2", 2, alpha=engine.SWITCHED),
    engine.Case(("periodic", "mirror"), "wendland_c2", 2, alpha=engine.SHOCKS),
    engine.Case(("periodic", "open", "mirror"), "wendland_c4", 2, conductivity=engine.JUMP),
]
FAST_PROPERTIES = slow_except({0}, PROPERTIES)
# Powers of two of the units of length, velocity and mass.
SCALES = [
    (60, 0, 0), (-60, 0, 0), (0, 60, 0), (0, -60, 0), (0, 0, 60), (0, 0, -60), (60, -60, 60),
    (-60, 60, -60), (20, 15, -40),
]  # fmt: skip


@pytest.mark.parametrize("name", ["double", "single"])
@pytest.mark.parametrize("case", FAST_PROPERTIES, ids=str)
def test_units_of_powers_of_two_change_no_bit(case, name):
    """Single precision would overflow or lose everything below 1e-38 without units."""
    lanes = {"double": simd.DOUBLE, "single": simd.SINGLE}[name]
    gas, skin = engine.random_gas(case, "reused")
    _, before, _ = engine.run_engine(case, gas, skin, threads=1, lanes=lanes)
    D = case.dimension
    for length, speed, mass in SCALES:
        a, b, c = 2.0**length, 2.0**speed, 2.0**mass
        scaled = replace(
            gas, position=a * gas.position, velocity=b * gas.velocity, mass=c * gas.mass,
            energy=b * b * gas.energy, acceleration=b * b / a * gas.acceleration,
            support=a * gas.support, earlier=a * gas.earlier, listed=a * gas.listed,
        )  # fmt: skip
        large = scaled_case(case, a)
        with mock.patch.object(engine, "STEP", engine.STEP * a / b):
            _, after, _ = engine.run_engine(large, scaled, skin, threads=1, lanes=lanes)
        rho = c / a**D
        units = {
            "support": a, "density": rho, "omega": 1.0, "sound_speed": b, "acceleration": b * b / a,
            "energy_rate": b**3 / a, "signal_speed": b, "balsara": 1.0, "alpha_rate": b / a,
            "alpha": 1.0, "pressure": rho * b * b, "divergence": b / a, "curl": b / a,
        }  # fmt: skip
        for quantity, values in before.items():
            np.testing.assert_array_equal(after[quantity], units[quantity] * values, quantity)


class Scaled(engine.Case):
    """A case with its box in other units."""

    factor = 1.0

    @property
    def box(self):
        return self.factor * super().box


def scaled_case(case, factor):
    """The case with a box `factor` times as large."""
    kind = type("Scaled", (Scaled,), {"factor": factor})
    return kind(**vars(case))


@pytest.mark.parametrize("name", slow_except({0, 1}, ["double", "single", "scalar"]))
@pytest.mark.parametrize("case", FAST_PROPERTIES, ids=str)
def test_momentum_is_conserved(case, name):
    case = replace(case, boundaries=("periodic",) * case.dimension)
    lanes = {"double": simd.DOUBLE, "single": simd.SINGLE, "scalar": simd.SCALAR}[name]
    gas, skin = engine.random_gas(case, "fresh")
    gas, found, _ = engine.run_engine(case, gas, skin, threads=1, lanes=lanes)
    forces = gas.mass * found["acceleration"]
    total = abs(forces.sum(axis=1))
    _, _, _, expected = rates(case, "fresh", simd.DOUBLE)
    terms = (gas.mass * expected.acceleration_scale).sum()
    # Round-off of the same pair terms, computed for each of the two particles. Single: distances
    # have an error of EPS box/H, as above, but not the same for both: they are of two superblocks.
    round_off = EPS * np.ptp(case.box, axis=1).max() / gas.support.min()
    assert np.all(total <= (round_off if name == "single" else 1e-15) * terms)


@pytest.mark.parametrize("case", FAST_PROPERTIES, ids=str)
def test_single_precision_does_not_depend_on_place_of_box(case):
    """Positions are relative to the superblock before they are rounded to single precision."""
    case = replace(case, boundaries=("periodic",) * case.dimension)
    gas, skin = engine.random_gas(case, "fresh")
    # a multiple of 2^-40, so that shifted positions are exact
    exact = np.round(gas.position * 2.0**40) / 2.0**40
    gas = replace(gas, position=exact, earlier=exact)
    before = engine.run_engine(case, gas, skin, threads=1, lanes=simd.SINGLE)[1]
    for factor in (1.0, -3.0, 1000.0):
        shift = factor * np.ptp(case.box, axis=1)[:, None]
        moved = replace(gas, position=exact + shift, earlier=exact + shift)
        kind = type("Moved", (Moved,), {"shift": shift})
        after = engine.run_engine(kind(**vars(case)), moved, skin, threads=1, lanes=simd.SINGLE)[1]
        for name, values in before.items():
            np.testing.assert_array_equal(after[name], values, name)


class Moved(engine.Case):
    """A case with its box elsewhere."""

    shift = 0.0

    @property
    def box(self):
        return super().box + self.shift
