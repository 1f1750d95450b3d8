"""scripts/roofline*.py: counts of operations, bounds and the measured peak."""

import importlib
import sys
from pathlib import Path

import pytest
from llvmlite import binding

from sph.kernels.wendland_c2 import WendlandC2

SCRIPTS = Path(__file__).parents[2] / "scripts"


@pytest.fixture(scope="module", autouse=True)
def scripts_in_reach():
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def roofline(scripts_in_reach):
    return importlib.import_module("roofline")


@pytest.fixture(scope="module")
def roofline_peak(scripts_in_reach):
    return importlib.import_module("roofline_peak")


class Counted:
    """A number that counts operations."""

    counts: dict[str, int]

    def __init__(self, value, counts):
        self.value, self.counts = value, counts

    def _of(self, kind, value):
        self.counts[kind] += 1
        return Counted(value, self.counts)

    def __add__(self, other):
        return self._of("add", self.value + getattr(other, "value", other))

    def __mul__(self, other):
        return self._of("multiply", self.value * getattr(other, "value", other))

    def __rsub__(self, other):
        return self._of("add", other - self.value)

    def __ge__(self, other):
        return self.value >= getattr(other, "value", other)

    __radd__, __rmul__ = __add__, __mul__


def counted(formula) -> dict[str, int]:
    counts = {"add": 0, "multiply": 0}
    formula(Counted(0.25, counts))
    return counts


def test_kernel_operations_of_the_roofline_are_those_of_the_kernel(roofline):
    """Each fused multiply-add is an addition and a multiplication of the formula."""
    kernel, dim = WendlandC2(), (0, 0, 0)
    w = counted(lambda q: kernel.w(dim, q))
    # without q = r/H and the second u u, which the compiler shares
    ours = roofline.total(roofline.Q_AND_U, roofline.W)
    assert w["add"] == ours.adds + ours.fused
    assert w["multiply"] - 1 == ours.multiplies - 1 + ours.fused
    slope = counted(lambda q: kernel.dw_over_q(dim, q))
    ours = roofline.total(roofline.Q_AND_U, roofline.U_CUBED)
    assert slope["add"] == ours.adds
    # also without the factor -20, which is multiplied into a factor outside the loop
    assert slope["multiply"] - 1 == ours.multiplies - 1


def test_bounds_follow_from_the_counts(roofline):
    one = roofline.Operations(adds=1, multiplies=2, fused=3, compares=4, roots=1, divisions=1)
    assert one.instructions("double") == 10 + 9 + 5
    assert one.instructions("single") == 10 + 6 + 3
    for name, (each, near) in {"density": (7, 54), "rates": (7, 59)}.items():
        full, useful = roofline.bounds(name, "double", 2e9, 300, 100)
        # 1e6 µs a second over 2e9 instructions a second
        assert full == pytest.approx(300 * (each + near) / 2e3, rel=1e-14)
        assert useful == pytest.approx((300 * each + 100 * near) / 2e3, rel=1e-14)


@pytest.mark.skipif(binding.llvm_version_info < (15,), reason="older LLVM has typed pointers")
def test_peak_loop_compiles_to_fused_instructions_of_whole_vectors(roofline_peak, monkeypatch):
    monkeypatch.setattr(roofline_peak, "SECONDS", 0.002)
    monkeypatch.setattr(roofline_peak, "LOOPS", 1 << 10)
    # One fused instruction a cycle and lane at 0.1 GHz: any processor has more; an emulated
    # multiply-add is a call of the C library.
    assert 1e8 < roofline_peak.peak("double") < 1e12
    assert 1e8 < roofline_peak.peak("single") < 2e12
