"""A method of a model gives equal results on arrays, on numbers in compiled code and on vectors."""

import numpy as np
import pytest
from lanes import LANES, compiled, precision

from sph import registry, simd
from sph.compiled import VERBS
from sph.eos.ideal_gas import IdealGas
from sph.formulations.gas.weighting import ByMass, ByNumber
from sph.parts.viscosity import _shocks  # noqa: F401 (the verb alpha_after)
from sph.parts.viscosity.balsara import Balsara
from sph.parts.viscosity.constant import ConstantAlpha

FOLDERS = (
    "sph.kernels", "sph.eos", "sph.formulations.gas.schemes", "sph.parts.conductivity",
    "sph.parts.viscosity.switches", "sph.formulations.continuum.strength",
)  # fmt: skip
# Of parameters without a default.
PARAMETERS = {
    "gamma": 1.4, "p_inf": 0.3, "min": 0.2, "max": 2.0, "rho_0": 0.6, "c_0": 1.5, "slope": 1.2,
    "gruneisen": 1.5, "shear_modulus": 0.7, "yield_stress": 0.1, "A": 0.2, "B": 0.3, "n": 0.4,
    "C": 0.1, "m": 1.1, "reference_rate": 0.3, "specific_heat": 2.0, "room_temperature": 0.1,
    "melting_temperature": 0.6,
}  # fmt: skip
# Arguments that are not positive.
SIGNED = {"w_ij", "divergence", "slope_i", "slope_j"}
N = 48


def shipped():
    """Every model of the folders, once more for each switch it has, and those without a folder."""
    for folder in FOLDERS:
        for name in registry.names(folder):
            kind = registry.model_class(folder, name)
            given = {key: PARAMETERS[key] for key in kind._fields if key in PARAMETERS}
            yield kind(**given)
            flags = [key for key, value in kind._field_defaults.items() if value is False]
            yield from (kind(**given, **{flag: True}) for flag in flags)
    yield from (Balsara(), ConstantAlpha(0.7), ByMass(), ByNumber())


MODELS = list(shipped())
OTHERS = {"eos": IdealGas(1.4)}


def verbs_of(model, lanes):
    """The names of the verbs of a model: of vectors, and of numbers where `lanes` is scalar."""
    is_scalar = lanes is simd.SCALAR
    return [
        name
        for name, one in VERBS.items()
        if (one.takes_vectors or is_scalar) and hasattr(model, name)
    ]


def test_models_have_every_verb():
    found = {name for model in MODELS for name in verbs_of(model, simd.SCALAR)}
    # tests in this process may have verbs of their own; those of gravity take tuples of vectors,
    # and are tested with its forces
    own = {name: one for name, one in VERBS.items() if one.__module__.startswith("sph.")}
    assert found == {name for name, one in own.items() if one.__module__ != "sph.parts.gravity"}


def label(model):
    flags = [key for key, value in model._asdict().items() if value is True]
    return "-".join([type(model).__name__, *flags])


def values_of(verb, kind):
    """Arrays (N,), by name, for the arguments of a verb that differ between lanes."""
    random = np.random.default_rng(3)
    names = [one for one in verb.verb_parameters if one not in ("self", "dim", *OTHERS)]
    found = {name: random.uniform(0.05, 1.3, N).astype(kind) for name in names}
    for name in SIGNED & found.keys():
        found[name] *= -1.0
    if "q" in found:
        found["q"][:4] = 0.0, 1.0, 0.5, 1.0 / 3.0
    return found


def on_arrays(model, name, dim, values):
    """The results (rows, N) of a method for arrays in double precision."""
    given = {"dim": dim, **OTHERS, **{key: one.astype(float) for key, one in values.items()}}
    result = getattr(model, name)(*(given[one] for one in VERBS[name].verb_parameters[1:]))
    several = result if isinstance(result, tuple) else (result,)
    return np.array([np.broadcast_to(one, N) for one in several])


def in_compiled_code(lanes, model, cases):
    """The results (rows, N) of each case (name, dim, values, rows) in one loop over vectors."""
    lines, inputs, row = [], [], 0
    for k, (name, dim, values, rows) in enumerate(cases):
        given = {"self": "model", "dim": str(dim), **{one: one for one in OTHERS}}
        for one, array in values.items():
            given[one] = f"load(lanes, a, ({len(inputs)}, i))"
            inputs.append(array)
        call = f"{name}({', '.join(given[one] for one in VERBS[name].verb_parameters)})"
        lines.append(f"result{k} = {call}")
        for part in range(rows):
            value = f"result{k}[{part}]" if rows > 1 else f"result{k}"
            lines.append(f"store(out, ({row}, i), filled(lanes, {value}))")
            row += 1
    body = "".join(f"        {one}\n" for one in lines)
    run = compiled(
        f"def run(lanes, model, a, out, eos):\n    for i in range(0, {N}, width(lanes)):\n{body}",
        **VERBS,
    )
    out = np.full((row, N), np.nan, precision(lanes))
    run(lanes, model, np.array([*inputs, np.zeros(N, out.dtype)]), out, OTHERS["eos"])
    return out


CASES = [
    (model, name) for model in MODELS for name, lanes in LANES.items() if verbs_of(model, lanes)
]


@pytest.mark.parametrize(
    ("model", "name_of_lanes"), CASES, ids=[f"{label(model)}-{name}" for model, name in CASES]
)
def test_methods_give_equal_results(model, name_of_lanes):
    lanes = LANES[name_of_lanes]
    kind, cases, expected = precision(lanes), [], []
    for name in verbs_of(model, lanes):
        values = values_of(VERBS[name], kind)
        for dimension in (1, 2, 3) if "dim" in VERBS[name].verb_parameters else (1,):
            dim = (0,) * dimension
            expected.append(on_arrays(model, name, dim, values))
            cases.append((name, dim, values, len(expected[-1])))
    found, row = in_compiled_code(lanes, model, cases), 0
    for (name, dim, _, rows), true in zip(cases, expected, strict=True):
        # some roundings of the largest term, which in a polynomial is the one at q = 0
        terms = np.maximum(abs(true), abs(true).max())
        differs = found[row : row + rows] != true  # an infinite value has no difference
        error = abs(np.where(differs, found[row : row + rows], 0.0) - np.where(differs, true, 0.0))
        assert np.all(error <= 40 * np.finfo(kind).eps * terms), (name, dim, np.max(error / terms))
        row += rows
