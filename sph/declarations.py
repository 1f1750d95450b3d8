"""Checks of what parts and models declare: errors name the class and say what is expected.

A declaration is checked once: that of a class when its file is read, that of a part when a scene
is put together, and what its methods return at the start of a run or restart.
"""

import inspect
import re
import types
from collections.abc import Iterable, Sequence
from typing import Any, get_type_hints

import numpy as np

from sph.errors import DeclarationError
from sph.part import STAGES, Evolved, Key, Part, Pass, Rule
from sph.state import Field, Public, State

# Names of fields and columns: attributes in Python, datasets in checkpoints, columns in CSV files.
NAME = re.compile(r"[a-z][a-z0-9_]{0,60}")
KEY = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,60}")
RANKS = (0, 1, 2)
NOT_PUBLIC = {"Pressures", "Pressure", "Density", "InternalEnergy", "SmoothingLength"}
# Attributes of a state, and what a checkpoint and the history hold besides the fields of parts.
NOT_FIELDS = {
    *dir(State), "fields", "time", "step", "next_step", "list_position", "list_support",
    "list_skin", "energy_injected", "energy_added", "baseline_energy", "baseline_scale",
}  # fmt: skip
NOT_COLUMNS = {
    "step", "t", "dt", "limiter_particle", "limiter", "kinetic_energy",
    "kinetic_energy_without_bulk", "internal_energy", "total_energy", "energy_drift",
    "energy_injected", "energy_added", "momentum_x", "momentum_y", "momentum_z", "min_density",
    "max_density", "min_internal_energy", "max_internal_energy", "wall_seconds", "cpu_seconds",
    "held_supports", "volume_ratio",
}  # fmt: skip


def only_class(module: types.ModuleType, found: Iterable[type], what: str) -> type:
    """Return the one class in `found`, those of the module that are `what`."""
    found = list(found)
    if len(found) != 1:
        names = ", ".join(kind.__name__ for kind in found) or "none"
        raise DeclarationError(
            f"{module.__file__}: expected one class that is {what}, found {names}"
        )
    return found[0]


# --- models -----------------------------------------------------------------------------------


def check_model(kind: Any, package: types.ModuleType) -> None:
    """Check a class with the decorator @model. package: that of its folder."""
    reserved = {"name", "switch", *(name for name in dir(kind) if name not in kind._fields)}
    try:
        get_type_hints(kind, include_extras=True)
    except Exception as error:
        raise _wrong(kind, f"an annotation cannot be resolved ({error})") from error
    for name in kind._fields:
        if name in reserved or name == "issues":
            raise _wrong(kind, f"parameter {name!r}: this name is reserved; rename it")
    for name, default in kind._field_defaults.items():
        if not isinstance(default, bool | int | float):
            raise _wrong(kind, f"parameter {name!r}: the default is {default!r}, expected a number")
    if missing := [name for name in kind.required() if not hasattr(kind, name)]:
        raise _wrong(kind, f"{', '.join(missing)} missing: expected a method or parameter")
    for name, verb in vars(package).items():
        expected = getattr(verb, "verb_parameters", None)
        method = getattr(kind, name, None)
        if expected is None or not inspect.isfunction(method):
            continue
        found = list(inspect.signature(method).parameters)
        if found[1:] != expected[1:]:
            raise _wrong(
                kind, f"{name}({', '.join(found)}): expected {name}({', '.join(expected)})"
            )


# --- classes of parts -------------------------------------------------------------------------


def check_part_class(kind: type[Part], optional: bool) -> None:
    """Check what the class of a part declares. optional: False for a formulation."""
    _check_entries(kind, "keys", kind.keys, Key)
    _check_entries(kind, "formulations", kind.formulations, str)
    if kind.of.__func__ is Part.of.__func__:  # type: ignore[attr-defined]
        raise _wrong(kind, "expected a class method of(scene) that returns the part or None")
    if optional and not kind.keys:
        raise _wrong(kind, "keys: expected at least one, which turns the part on")
    for key in kind.keys:
        if not KEY.fullmatch(key.name):
            raise _wrong(kind, f"key {key.name!r}: expected a name of letters, digits and _")
        if isinstance(key.kind, str) or (key.kind is None and not key.models):
            raise _wrong(kind, f"key {key.name!r}: expected kind, a type such as float, or models")


def check_formulations(kind: type[Part], known: Sequence[str]) -> None:
    """Check that the formulations that a part names exist."""
    if unknown := [name for name in kind.formulations if name not in known]:
        raise _wrong(
            kind, f"formulations: {unknown[0]!r} is none, expected one of {', '.join(known)}"
        )


def check_keys(kinds: Iterable[type[Part]], taken: Iterable[str], restarts: Iterable[str]) -> None:
    """Check that no two keys of [physics] have equal names.

    taken: names of the other keys of [physics] and of its attributes; restarts: the classes of keys
    in a restart.
    """
    owners: dict[str, str] = dict.fromkeys(taken, "the table [physics] itself")
    for kind in kinds:
        for key in kind.keys:
            if key.name in owners:
                raise _wrong(kind, f"key {key.name!r} is declared by {owners[key.name]} too")
            owners[key.name] = _label(kind)
            if key.restart not in restarts:
                raise _wrong(
                    kind, f"key {key.name!r}: restart={key.restart!r}, expected one of "
                    f"{', '.join(map(repr, restarts))}"
                )  # fmt: skip


# --- parts of a scene -------------------------------------------------------------------------


def check_part(part: Any, kind: type[Part], optional: bool) -> None:
    """Check what a part declares for a scene. optional: whether scenes without the part exist."""
    if not isinstance(part, kind):
        raise _wrong(kind, f"of(scene) returned {part!r}, expected a {kind.__name__} or None")
    for name, expected in (
        ("fields", Field), ("evolved", Evolved), ("passes", Pass), ("needs", str), ("columns", str),
    ):  # fmt: skip
        _check_entries(kind, name, getattr(part, name), expected)
    for field in part.fields:
        _check_field(kind, field)
    for column in part.columns:
        if not NAME.fullmatch(column) or column in NOT_COLUMNS:
            raise _wrong(
                kind, f"column {column!r}: expected a name of lower-case letters, digits and _ "
                "that no column of every history has"
            )  # fmt: skip
    for one in part.passes:
        if one.stage not in STAGES:
            raise _wrong(kind, f"pass at stage {one.stage!r}: expected one of {', '.join(STAGES)}")
        _check_entries(kind, "reads", one.reads, str)
        _check_entries(kind, "writes", one.writes, str)
        if not callable(one.run):
            raise _wrong(kind, f"pass at stage {one.stage!r}: run = {one.run!r} is not a function")
    described = part.described()
    if not isinstance(described, tuple) or [type(one) for one in described] != [list, list]:
        raise _wrong(kind, f"described() returned {described!r:.60}, expected a pair of lists")
    if optional:
        _check_restart(part, kind)
    elif not hasattr(part, "models"):
        raise _wrong(kind, "models missing: expected the models of its passes")


def _check_field(kind: type[Part], field: Field) -> None:
    if not NAME.fullmatch(field.name) or field.name in NOT_FIELDS:
        raise _wrong(
            kind, f"field {field.name!r}: expected a name of lower-case letters, digits and _ that "
            "is neither reserved in checkpoints nor an attribute of State"
        )  # fmt: skip
    if field.rank not in RANKS:
        raise _wrong(
            kind, f"field {field.name!r}: rank = {field.rank!r}, expected 0 (scalar), 1 (vector) "
            "or 2 (tensor)"
        )  # fmt: skip
    if field.integer and field.name != "id":
        raise _wrong(kind, f"field {field.name!r}: only the ID is an integer")
    if field.public is not None:
        name = getattr(field.public, "name", "")
        if not isinstance(field.public, Public) or not re.fullmatch(r"\w+", str(name)):
            raise _wrong(
                kind, f"field {field.name!r}: expected public=Public(name, …) of sph.state"
            )
        if name in NOT_PUBLIC:
            raise _wrong(kind, f"field {field.name!r}: the public name {name!r} is reserved")


def _check_restart(part: Part, kind: type[Part]) -> None:
    """Check that no restart adds or drops a part whose state a checkpoint cannot give."""
    kept = [field.name for field in part.fields if field.stored and not field.remade]
    if not kept and not part.columns:
        return
    key = kind.keys[0]
    if key.restart == "refused" or (key.restart == "same kind" and key.kind is not bool):
        return
    raise _wrong(
        kind, f"key {key.name!r}: expected restart=\"same kind\" or, for kind=bool, \"refused\", "
        "because a restart that adds or drops the part lacks its stored fields and columns "
        f"({', '.join([*kept, *part.columns])})"
    )  # fmt: skip


def check_together(parts: Sequence[Part], kinds: Iterable[type[Part]], roles: Any) -> None:
    """Check the parts of a scene.

    kinds: the classes of all parts, also of those it leaves out; roles: those of terms that the
    formulation calls.
    """
    terms: dict[str, Part] = {}
    owners: dict[str, Part] = {}
    publics: dict[str, str] = {}
    columns: dict[str, Part] = {}
    reserved = {name: kind for kind in kinds for name in kind.reserves}
    for part in parts:
        for field in part.fields:
            name = field.name
            owner = type(owners[name]) if name in owners else reserved.get(name, type(part))
            if name in owners or owner is not type(part):
                raise _wrong(type(part), f"field {name!r} is declared by {_label(owner)} too")
            owners[name] = part
            if field.public is not None:
                if field.public.name in publics:
                    raise _wrong(
                        type(part), f"field {name!r}: the public name {field.public.name!r} is "
                        f"that of field {publics[field.public.name]!r} too"
                    )  # fmt: skip
                publics[field.public.name] = name
        for column in part.columns:
            if column in columns:
                other = _label(type(columns[column]))
                raise _wrong(type(part), f"column {column!r} is declared by {other} too")
            columns[column] = part
        for role in part.terms:
            if role not in roles:
                expected = f"one of {', '.join(roles)}" if roles else "none"
                raise _wrong(
                    type(part), f"term {role!r}: {_label(type(parts[0]))} calls {expected}"
                )  # fmt: skip
            if role in terms:
                raise _wrong(type(part), f"term {role!r} is that of {_label(type(terms[role]))}")
            terms[role] = part
    fields = {field.name: field for part in parts for field in part.fields}
    for part in parts:
        _check_names(part, fields)


def _check_names(part: Part, fields: dict[str, Field]) -> None:
    """Check that what a part reads, writes, needs and evolves are fields of the scene."""
    used = [(f"pass at stage {one.stage!r}", (*one.reads, *one.writes)) for one in part.passes]
    used += [("needs", part.needs)]
    used += [("evolved", one[:3]) for one in part.evolved]
    for where, names in used:
        if unknown := [name for name in names if name not in fields]:
            raise _wrong(
                type(part), f"{where}: {unknown[0]!r} is not a field of this scene; expected one "
                f"of {', '.join(sorted(fields))}"
            )  # fmt: skip
    for one in part.evolved:
        value, rate, predicted = (fields[name] for name in one[:3])
        if not value.rank == rate.rank == predicted.rank:  # rules index all three alike
            raise _wrong(type(part), f"evolved {value.name!r}: expected three fields of equal rank")
        if not (value.stored and (rate.stored or rate.remade)):
            raise _wrong(
                type(part), f"evolved {value.name!r}: expected value and rate to be stored, or a "
                "restart would begin with zeros"
            )  # fmt: skip
        if not isinstance(one.rule, Rule):
            raise _wrong(type(part), f"evolved {value.name!r}: expected a Rule, not {one.rule!r}")


# --- what methods return ----------------------------------------------------------------------


def check_returned(parts: Iterable[Part], state: State) -> None:
    """Check names and shapes of the energies, sums and step limits of parts."""
    for part in parts:
        energies, sums = part.energies(state), part.sums(state)
        if {*energies, *sums} != {*part.columns} or energies.keys() & sums.keys():
            raise _wrong(
                type(part), f"energies and sums return ({', '.join([*energies, *sums])}), expected "
                f"the names in `columns`: ({', '.join(part.columns)})"
            )  # fmt: skip
        limit = part.step_limit(state)
        arrays = {**energies, **({} if limit is None else {"step_limit": limit})}
        for name, array in arrays.items():
            if np.shape(array) != (state.number,):
                raise _wrong(
                    type(part), f"{name} has the shape {np.shape(array)}, expected one number per "
                    f"particle ({state.number},)"
                )  # fmt: skip
        for name, value in sums.items():
            if not isinstance(value, int | float | np.number):
                raise _wrong(type(part), f"{name} is {value!r:.60}, expected a number")


def check_issues(kind: type, found: Any, keys: Iterable[str]) -> None:
    """Check what `issues` returned: pairs of a key of [physics] and a message."""
    if not isinstance(found, list | tuple):
        raise _wrong(kind, f"issues returned {found!r:.60}, expected a list")
    for one in found:
        if not isinstance(one, tuple) or len(one) != 2 or one[0] not in keys:
            raise _wrong(kind, f"issues returned {one!r:.60}, expected (key of [physics], message)")


def check_arrays(parts: Iterable[Part], state: State) -> None:
    """Check types and shapes of the stored arrays, which passes may have replaced."""
    for part in parts:
        for field in part.fields:
            if not field.stored or field.integer:
                continue
            array = getattr(state, field.name)
            shape = field.shape(state.dimension, state.number)
            if np.shape(array) != shape or np.asarray(array).dtype != np.float64:
                raise _wrong(
                    type(part), f"field {field.name!r} became {np.asarray(array).dtype} "
                    f"{np.shape(array)}, expected float64 {shape}"
                )  # fmt: skip


# --- messages ---------------------------------------------------------------------------------


def _check_entries(kind: type, name: str, found: Any, expected: type) -> None:
    """Check that an attribute is a tuple (or list) of `expected`."""
    if not isinstance(found, tuple | list) or hasattr(found, "_fields"):
        hint = " (a comma is missing)" if isinstance(found, expected) else ""
        raise _wrong(kind, f"{name} = {found!r:.60}: expected a tuple of {expected.__name__}{hint}")
    for one in found:
        if not isinstance(one, expected):
            raise _wrong(kind, f"{name}: {one!r:.60} is not a {expected.__name__}")


def _label(kind: type) -> str:
    return f"{kind.__module__}.{kind.__name__}"


def _wrong(kind: type, what: str) -> DeclarationError:
    return DeclarationError(f"{_label(kind)}: {what}")
