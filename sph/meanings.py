"""Meaning and unit of columns of history.csv and entries of summary.json, by name.

The declarations stand in `sph.columns`, `sph.summary`, and with the parts and problems that compute
the numbers. docs/output.md is written from them.
"""

import functools
from collections.abc import Mapping
from types import UnionType
from typing import Annotated, Any, NotRequired, get_args, get_origin, get_type_hints, is_typeddict

from sph import columns, faults, parts, registry
from sph.config.physics import DEFAULT, FORMULATIONS
from sph.integrators.step_size import CRITERIA
from sph.part import Part
from sph.quantity import Quantity, exponents, meaning
from sph.summary import Summary


def of_column(config, name: str) -> Quantity | None:
    """Return the declaration of a column of the history of a run, or None."""
    if name in columns.OF_ALL:
        return columns.OF_ALL[name]
    if name in columns.OF_SOME:
        return columns.OF_SOME[name][0]
    of_parts = of_part_columns(config.physics.formulation)
    return of_parts.get(name) or meaning(config.problem.quantities, name)


def is_of_problem(config, name: str) -> bool:
    """Return whether a column of the history is one of the problem (`Problem.diagnostics`)."""
    of_parts = of_part_columns(config.physics.formulation)
    return not any(name in known for known in (columns.OF_ALL, columns.OF_SOME, of_parts))


@functools.cache
def of_part_columns(formulation: str) -> Mapping[str, Quantity]:
    """Return the columns that a formulation and the parts that can join it declare."""
    return {name: one for kind in _kinds(formulation) for name, one in kind.columns.items()}


def _kinds(formulation: str) -> tuple[type[Part], ...]:
    return (registry.part_class(FORMULATIONS, formulation), *parts.classes(formulation))


def unit_of(config, quantity: Quantity) -> str:
    """Return the unit of a quantity, in the physical units of a run that has some."""
    powers = exponents(quantity.unit) if config.units.are_given else None
    return quantity.unit if powers is None else config.units.symbol(*powers)


def of_entry(problem, name: str) -> Quantity | None:
    """Return the declaration of an entry of a summary, such as report.peak_density, or None.

    problem: the problem of the run, or its class.
    """
    table, _, rest = name.partition(".")
    if table == "report" and rest:
        return meaning(problem.quantities, rest)
    if name.startswith("errors.fields.") and name.count(".") == 3:
        name = f"errors.fields.FIELD.{name.rpartition('.')[2]}"
    return of_summary().get(name)


def of_criterion(formulation: str, name: str) -> str | None:
    """Return what a criterion of the column `limiter` means, or None."""
    of_parts = (kind.criterion_words(name) for kind in _kinds(formulation))
    shared = faults.SETS.get(name) or faults.SETS_FOR_ALL.get(name)
    return shared or next(filter(None, of_parts), None)


def criteria() -> dict[str, str]:
    """Return what each criterion means, those of parts after those of every run."""
    formulations = registry.names(FORMULATIONS, folders=True)  # have no criterion of their own
    limiting = [
        kind
        for name in formulations
        for kind in parts.classes(name)
        if kind.name not in formulations
        and (
            kind.largest_courant is not Part.largest_courant
            or kind.step_limit is not Part.step_limit
        )
    ]
    names = (*CRITERIA, "checkpoint", *(kind.name for kind in limiting))
    return {name: str(of_criterion(DEFAULT, name)) for name in names}


@functools.cache
def of_summary() -> Mapping[str, Quantity]:
    """Return the declaration of each entry of summary.json, by a name such as cost.session.steps.

    FIELD in a name stands for a field, [] for each entry of a list. Raises KeyError, with the name,
    for an entry without a declaration.
    """
    return dict(_entries(Summary, ""))


def _entries(table: Any, prefix: str) -> dict[str, Quantity]:
    found: dict[str, Quantity] = {}
    for name, hint in get_type_hints(table, include_extras=True).items():
        if get_origin(hint) is NotRequired:
            (hint,) = get_args(hint)
        if get_origin(hint) is not Annotated:
            raise KeyError(f"{prefix}{name}")
        kind, found[f"{prefix}{name}"] = get_args(hint)
        inner, of_each = _inner(kind)
        if inner is not None:
            found |= _entries(inner, f"{prefix}{name}{of_each}.")
    return found


def _inner(kind: Any) -> tuple[Any, str]:
    """The table inside a type, or None, and what follows the name for each such table."""
    if get_origin(kind) is UnionType:
        kind = get_args(kind)[0]
    suffix = ""
    if get_origin(kind) in (dict, list):
        suffix = ".FIELD" if get_origin(kind) is dict else "[]"
        kind = get_args(kind)[-1]
    return (kind, suffix) if is_typeddict(kind) else (None, "")
