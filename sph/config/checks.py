"""Checks across keys: what each key allows by itself, but not together."""

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
    """A problem that is solved for an ideal gas, with another one."""
    if not {"problem", "physics"} <= found.keys() or not found["problem"].ideal_gas:
        return []
    from sph import eos

    physics = found["physics"]
    if eos.is_ideal(physics.eos_model()):
        return []
    text = f"= {value_text(physics.eos)}: expected an ideal gas for {found['problem'].name}"
    return [Issue(("physics", "eos"), text)]


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
