"""Checks of several keys together, each of whose values is valid by itself."""

import math
from typing import Any

from pydantic_core import PydanticCustomError

from sph import declarations
from sph.config.errors import Issue
from sph.config.toml_text import value_text
from sph.problems.base import Problem, Section

MOST_CHECKPOINTS = 100_000


def both_given(raw: dict[str, dict[str, Any]]) -> list[Issue]:
    """Return an issue if the user gave both physics.eos and physics.gamma."""
    if {"eos", "gamma"} <= raw["physics"].keys():
        text = "replaces physics.gamma, but both are given: expected only one of the two"
        return [Issue(("physics", "eos"), text)]
    return []


def gas_issues(found: dict[str, Section]) -> list[Issue]:
    """Return an issue if the problem needs an ideal gas, or a smaller gamma than is given."""
    if not {"problem", "physics"} <= found.keys():
        return []
    from sph import eos

    problem, physics = found["problem"], found["physics"]
    gas, key = physics.eos_model(), _key_of_eos(physics)
    if problem.ideal_gas and not eos.is_ideal(gas):
        text = f"expected an ideal gas for {problem.name}"
    elif not getattr(gas, "gamma", 0.0) < problem.gamma_below:
        text = f"expected gamma below {problem.gamma_below:g} for {problem.name}"
    else:
        return []
    return [Issue(("physics", key), f"= {physics.shown(key)}: {text}")]


def _key_of_eos(physics: Any) -> str:
    """Return the key of [physics] that gives the equation of state."""
    if physics.materials:
        return "materials"
    return "gamma" if physics.eos is None else "eos"


def part_issues(found: dict[str, Section]) -> list[Issue]:
    """Return what the formulation and the parts find wrong with settings together."""
    if not {"problem", "physics"} <= found.keys():
        return []
    physics, problem = found["physics"], found["problem"]
    issues = []
    for kind in physics.kinds:
        wrong = kind.issues(physics, problem)
        declarations.check_issues(kind, wrong, type(physics).model_fields)
        issues += [
            Issue(("physics", key), f"= {physics.shown(key)}: {text}") for key, text in wrong
        ]
    return issues


def under_physics(found: dict[str, Section]) -> list[Issue]:
    """Let the problem take what it needs from [physics]; return an issue if that is missing."""
    if not {"problem", "physics"} <= found.keys():
        return []
    try:
        found["problem"] = found["problem"].under(found["physics"])
    except PydanticCustomError as error:
        faults = (error.context or {})["issues"]
        return [Issue(("problem", *fault.path), fault.text) for fault in faults]
    except ValueError as error:
        key, _, text = str(error).partition(" ")
        return [Issue(("physics", key.removeprefix("physics.")), text)]
    return []


def under_units(found: dict[str, Section]) -> None:
    """Let the problem take what it needs from [units]. Raises FileError for a wrong file."""
    if {"problem", "units"} <= found.keys():
        units = found["units"]
        given = units.in_cgs() if units.are_given else None
        found["problem"] = found["problem"].in_units(given)


def steps_issues(found: dict[str, Section]) -> list[Issue]:
    """Return an issue if the formulation has no individual time steps, which the user wants."""
    if not {"time", "physics"} <= found.keys() or found["time"].stepping == "global":
        return []
    if found["physics"].kinds[0].individual_steps:
        return []
    name = value_text(found["physics"].formulation)
    text = f'= "individual": expected "global" for physics.formulation = {name}'
    return [Issue(("time", "stepping"), text)]


def pairing_issues(found: dict[str, Section]) -> list[Issue]:
    """Return an issue if particles pair with this kernel at this eta, unless pairing is allowed."""
    if not {"problem", "physics"} <= found.keys():
        return []
    physics, dimension = found["physics"], found["problem"].dimension
    # the limits of kernels were measured for gas; for other matter the summary reports pairs
    if "allow_pairing" not in type(physics).model_fields or physics.allow_pairing:
        return []
    limit = physics.kernel_model().pairs_above.get(dimension, math.inf)
    if physics.eta <= limit:
        return []
    text = (
        f"= {value_text(physics.kernel)}: in {dimension}-D, particles with this kernel form "
        f"close pairs if physics.eta is above {limit:g}; physics.eta is {physics.eta:g}. Try: a "
        "smaller physics.eta, a Wendland kernel, or physics.allow_pairing = true"
    )
    return [Issue(("physics", "kernel"), text)]


def output_issues(found: dict[str, Section]) -> list[Issue]:
    """Return an issue if the run would write more than MOST_CHECKPOINTS and could fill a disk."""
    if not {"time", "output"} <= found.keys():
        return []
    end, interval = found["time"].end, found["output"].interval
    if interval >= end / MOST_CHECKPOINTS:
        return []
    text = (
        f"= {value_text(interval)}: expected at least {end / MOST_CHECKPOINTS:g}, so that the run "
        f"writes no more than {MOST_CHECKPOINTS} checkpoints until time.end"
    )
    return [Issue(("output", "interval"), text)]


def shape_issues(raw: dict[str, Any], problem: type[Problem]) -> list[Issue]:
    """Return issues of problem.domain and problem.boundary that do not match problem.dimension.

    `raw` holds the keys of [problem] that the user gave, whose types are checked later.
    """
    known = {name: field.get_default() for name, field in problem.model_fields.items()} | raw
    if type(known["dimension"]) is not int or known["dimension"] not in (1, 2, 3):
        return []
    found = []
    if isinstance(known["domain"], list):
        found += _domain_issues(known["domain"], known["dimension"])
    if isinstance(known["boundary"], list):
        found += _boundary_issues(known["boundary"], known["dimension"])
    return found


def _domain_issues(domain: list[Any], dimension: int) -> list[Issue]:
    path = ("problem", "domain")
    per_axis = any(isinstance(one, list) for one in domain)
    axes = domain if per_axis else [domain] * dimension
    if len(axes) != dimension or any(not isinstance(a, list) or len(a) != 2 for a in axes):
        expected = "[lo, hi] for all axes" + (
            ", or a list with one [lo, hi] per axis" * (dimension > 1)
        )
        return [Issue(path, f"= {value_text(domain)}: expected {expected} in {dimension}-D")]
    numbers = all(type(end) in (int, float) for axis in axes for end in axis)
    if numbers and any(low >= high for low, high in axes):
        return [Issue(path, f"= {value_text(domain)}: expected lo < hi")]
    return []


def _boundary_issues(boundary: list[Any], dimension: int) -> list[Issue]:
    if len(boundary) == dimension:
        return []
    expected = f"one boundary for all axes, or a list of {dimension}, one per axis"
    return [Issue(("problem", "boundary"), f"= {value_text(boundary)}: expected {expected}")]
