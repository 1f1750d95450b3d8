"""The trial of a model's methods: it accepts what vectors have, and refuses the rest in words."""

from typing import NamedTuple

import numpy as np
import pytest
from lanes import LANES, compiled, precision

from sph import config, declarations
from sph.compiled import larger, smaller
from sph.errors import DeclarationError
from sph.kernels import Defaults
from sph.model import model
from sph.scene import Scene
from sph.simd.functions import BINARY, UNARY


def kernel(expression):
    """A kernel whose w is an expression of q."""
    space = {"np": np, "larger": larger, "smaller": smaller}
    method = eval(f"lambda self, dim, q: {expression}", space)
    method.__name__ = "w"
    methods = {"w": method, "__module__": "sph_extensions.kernels.mine"}
    return model(Defaults)(type("Mine", (Numbers,), methods))(0.5, True)


class Numbers(NamedTuple):
    """Parameters of a kernel."""

    a: float
    flag: bool


ACCEPTED = [
    *(f"np.{one.__name__}(q)" for one in UNARY),
    *(f"np.{one.__name__}(q, 0.5)" for one in BINARY),
    "larger(1.0 - q, 0.0 * q)", "smaller(q, self.a)", "abs(-q) + (+q)", "2 / (1 + q)**3 - q * q",
    "q**self.a", "2.0**q", "np.where(q < self.a, q, 0.0)", "np.where(self.flag, q, 1)",
    "(q <= 1.0) * q", "np.where((q > 0.1) & ~(q >= 1) | (q == 2) ^ (q != 3), 1, q)",
    "q if self.flag else 1.0", "q * len(dim)", "np.float64(2.0) * q",
]  # fmt: skip
REFUSED = {
    "np.arcsin(q)": "np.arcsin",
    "np.sign(q)": "np.sign",
    "q // 2": "np.floor_divide",
    "q % 1.0": "np.remainder",
    "np.clip(q, 0.0, 1.0)": "np.clip",
    "np.where(q, q, 1.0)": "np.where",
    "np.where(q < 1)": "np.where",
    "np.where(q < 1, np.ones(3), q)": "np.where",
    "q if q < 1 else 0.0": "a condition (if, and, or, not, max, min)",
    "q if 0 < q < 1 else 0.0": "a condition (if, and, or, not, max, min)",
    "max(q, 0.0)": "a condition (if, and, or, not, max, min)",
    "(q < 1) * 2.0": "np.multiply of a comparison",
    "-(q < 1)": "np.negative of a comparison",
    "(q < 1) & self.flag": "np.bitwise_and of a comparison",
    "np.maximum(q < 1, q > 2)": "np.maximum of a comparison",
    "q * np.ones(3)": "np.multiply with an array",
    "q.sum()": "'Vector' object has no attribute 'sum'",
    "np.add.reduce(q)": "np.add",
    "__import__('math').exp(q)": "must be real number, not Vector",
    "q[0]": "not subscriptable",
}


@pytest.mark.parametrize("expression", ACCEPTED)
def test_accepts_what_vectors_have(expression):
    declarations.check_on_vectors((kernel(expression), None, 0.5))


@pytest.mark.parametrize("name", ["double", "single"])
def test_accepted_expressions_compile_on_vectors(name):
    lanes, kind = LANES[name], precision(LANES[name])
    mine = "\n".join(
        f"    store(out, ({k}, 0), filled(lanes, {one}))".replace("self.", "").replace("dim", "d")
        for k, one in enumerate(ACCEPTED)
    )
    run = compiled(f"def run(lanes, d, x, a, flag, out):\n    q = load(lanes, x, 0)\n{mine}")
    x = np.linspace(0.1, 1.2, 16).astype(kind)
    out = np.zeros((len(ACCEPTED), 16), kind)
    run(lanes, (0, 0), x, 0.5, True, out)
    for row, expression in zip(out, ACCEPTED, strict=True):
        one = kernel(expression)
        exact = np.broadcast_to(one.w((0, 0), x.astype(float)), 16)
        # some roundings, where tan and powers grow to 3
        error = abs(row - exact)[: lanes.width]
        assert np.all(error <= 40 * np.finfo(kind).eps * np.maximum(abs(exact[: lanes.width]), 1))


@pytest.mark.parametrize("expression", REFUSED)
def test_refuses_what_vectors_lack(expression):
    with pytest.raises(DeclarationError) as caught:
        declarations.check_on_vectors((kernel(expression),))
    message = str(caught.value)
    assert message.startswith("sph_extensions.kernels.mine.Mine: w ")
    assert REFUSED[expression] in message
    assert "np.where" in message.partition("Expected only")[2]


def test_scene_tries_its_models(monkeypatch):
    from sph.kernels.wendland_c2 import WendlandC2

    text = '[problem]\nname = "shock_tube"\nn = 80\n[time]\nend = 0.2\n'
    scene = Scene(config.from_text(text, "the test"))
    monkeypatch.setattr(WendlandC2, "force_over_q", lambda self, dim, q: np.arcsin(q))
    with pytest.raises(DeclarationError, match=r"wendland_c2.WendlandC2: .* np.arcsin"):
        _ = scene.formulation


@pytest.mark.parametrize("name", [one for one in LANES if one != "scalar"])
def test_refused_condition_would_not_compile(name):
    """Otherwise a branch would be taken for all lanes."""
    run = compiled("def run(lanes, a):\n    return 1.0 if load(lanes, a, 0) < 1.0 else 0.0")
    with pytest.raises(Exception, match="bool"):
        run(LANES[name], np.zeros(16, precision(LANES[name])))
