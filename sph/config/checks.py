"""Checks across keys: what each key allows by itself, but not together."""

import math
from typing import Any

from sph.config.errors import Issue
from sph.config.toml_text import value_text
from sph.problems.base import Problem, Section

MOST_CHECKPOINTS = 100_000


def both_given(raw: dict[str, dict[str, Any]]) -> list[Issue]:
    """Two keys for the same thing: which of them the user means is not ours to guess."""
    if {"eos", "gamma"} <= raw["physics"].keys():
        text = "stands in place of physics.gamma: give one of the two"
        return [Issue(("physics", "eos"), text)]
    return []


def gas_issues(found: dict[str, Section]) -> list[Issue]:
    """A problem that is solved for an ideal gas, or for gamma below a bound, with another gas."""
    if not {"problem", "physics"} <= found.keys():
        return []
    from sph import eos

    problem, physics = found["problem"], found["physics"]
    gas, key = physics.eos_model(), "gamma" if physics.eos is None else "eos"
    if problem.ideal_gas and not eos.is_ideal(gas):
        text = f"expected an ideal gas for {problem.name}"
    elif not getattr(gas, "gamma", 0.0) < problem.gamma_below:
        text = f"expected gamma below {problem.gamma_below:g} for {problem.name}"
    else:
        return []
    return [Issue(("physics", key), f"= {value_text(getattr(physics, key))}: {text}")]


def external_issues(found: dict[str, Section]) -> list[Issue]:
    """A field that cannot act in this box, and a conductivity that is none for its equilibrium."""
    if not {"problem", "physics"} <= found.keys() or found["physics"].external is None:
        return []
    physics, issues = found["physics"], []
    if misfit := physics.external_model().misfit(found["problem"].boundaries):
        issues.append(Issue(("physics", "external"), f"= {value_text(physics.external)}: {misfit}"))
    conductivity = physics.conductivity_model()
    if conductivity is not None and not conductivity.suits_gravity:
        text = (
            f"= {value_text(physics.conductivity)}: expected none that acts where pressure varies "
            'in equilibrium, as it does with physics.external. Try: "approach"'
        )
        issues.append(Issue(("physics", "conductivity"), text))
    return issues


def pairing_issues(found: dict[str, Section]) -> list[Issue]:
    """A kernel whose particles pair at this eta, unless the user allows pairing."""
    if not {"problem", "physics"} <= found.keys() or found["physics"].allow_pairing:
        return []
    physics, dimension = found["physics"], found["problem"].dimension
    limit = getattr(physics.kernel_model(), "pairs_above", {}).get(dimension, math.inf)
    if physics.eta <= limit:
        return []
    text = (
        f"= {value_text(physics.kernel)}: in {dimension}-D its particles pair where physics.eta "
        f"is above {limit:g}, and it is {physics.eta:g}; take a smaller physics.eta or a Wendland "
        "kernel, or set physics.allow_pairing = true"
    )
    return [Issue(("physics", "kernel"), text)]


def output_issues(found: dict[str, Section]) -> list[Issue]:
    """More checkpoints than anyone can want: a disk is soon full of them."""
    if not {"time", "output"} <= found.keys():
        return []
    end, interval = found["time"].end, found["output"].interval
    if interval >= end / MOST_CHECKPOINTS:
        return []
    text = (
        f"= {value_text(interval)}: expected at least {end / MOST_CHECKPOINTS:g}, for no more than "
        f"{MOST_CHECKPOINTS} checkpoints until time.end"
    )
    return [Issue(("output", "interval"), text)]


def shape_issues(raw: dict[str, Any], problem: type[Problem]) -> list[Issue]:
    """The domain and the boundaries against the number of dimensions; types are checked later."""
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
        expected = "[lo, hi] for all axes" + (", or a list of one for each" * (dimension > 1))
        return [Issue(path, f"= {value_text(domain)}: expected {expected} in {dimension}-D")]
    numbers = all(type(end) in (int, float) for axis in axes for end in axis)
    if numbers and any(low >= high for low, high in axes):
        return [Issue(path, f"= {value_text(domain)}: expected lo below hi")]
    return []


def _boundary_issues(boundary: list[Any], dimension: int) -> list[Issue]:
    if len(boundary) == dimension:
        return []
    expected = f"one for all axes, or a list of one for each in {dimension}-D"
    return [Issue(("problem", "boundary"), f"= {value_text(boundary)}: expected {expected}")]
