"""Checks of the classes of parts, and of what parts declare for a scene."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

from sph.declarations.messages import check_entries, label, wrong
from sph.part import STAGES, Evolved, Key, Part, Pass, Rule
from sph.state import Field, Public, State

# Names of fields and columns: attributes in Python, datasets in checkpoints, columns in CSV files.
NAME = re.compile(r"[a-z][a-z0-9_]{0,60}")
KEY = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,60}")
RANKS = (0, 1, 2)
NOT_PUBLIC = {
    "Pressures", "Pressure", "StressTensors", "Density", "InternalEnergy", "SmoothingLength",
}  # fmt: skip
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


# --- classes of parts -------------------------------------------------------------------------


def check_part_class(kind: type[Part], optional: bool) -> None:
    """Check what the class of a part declares. optional: False for a formulation."""
    check_entries(kind, "keys", kind.keys, Key)
    check_entries(kind, "formulations", kind.formulations, str)
    if kind.of.__func__ is Part.of.__func__:  # type: ignore[attr-defined]
        raise wrong(kind, "expected a class method of(scene) that returns the part or None")
    if optional and not kind.keys:
        raise wrong(kind, "keys: expected at least one, which turns the part on")
    for key in kind.keys:
        if not KEY.fullmatch(key.name):
            raise wrong(kind, f"key {key.name!r}: expected a name of letters, digits and _")
        if isinstance(key.kind, str) or (key.kind is None and not key.models):
            raise wrong(kind, f"key {key.name!r}: expected kind, a type such as float, or models")


def check_formulations(kind: type[Part], known: Sequence[str]) -> None:
    """Check that the formulations that a part names exist."""
    if unknown := [name for name in kind.formulations if name not in known]:
        raise wrong(
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
                raise wrong(kind, f"key {key.name!r} is declared by {owners[key.name]} too")
            owners[key.name] = label(kind)
            if key.restart not in restarts:
                raise wrong(
                    kind, f"key {key.name!r}: restart={key.restart!r}, expected one of "
                    f"{', '.join(map(repr, restarts))}"
                )  # fmt: skip


# --- parts of a scene -------------------------------------------------------------------------


def check_part(part: Any, kind: type[Part], optional: bool) -> None:
    """Check what a part declares for a scene. optional: whether scenes without the part exist."""
    if not isinstance(part, kind):
        raise wrong(kind, f"of(scene) returned {part!r}, expected a {kind.__name__} or None")
    for name, expected in (
        ("fields", Field), ("evolved", Evolved), ("passes", Pass), ("needs", str), ("columns", str),
    ):  # fmt: skip
        check_entries(kind, name, getattr(part, name), expected)
    for field in part.fields:
        _check_field(kind, field)
    for column in part.columns:
        if not NAME.fullmatch(column) or column in NOT_COLUMNS:
            raise wrong(
                kind, f"column {column!r}: expected a name of lower-case letters, digits and _ "
                "that no column of every history has"
            )  # fmt: skip
    for one in part.passes:
        if one.stage not in STAGES:
            raise wrong(kind, f"pass at stage {one.stage!r}: expected one of {', '.join(STAGES)}")
        for name in ("reads", "updates", "writes"):
            check_entries(kind, name, getattr(one, name), str | None)  # type: ignore[arg-type]
        if not callable(one.function):
            raise wrong(
                kind, f"pass at stage {one.stage!r}: function = {one.function!r} is not a function"
            )  # fmt: skip
    described = part.described()
    if not isinstance(described, tuple) or [type(one) for one in described] != [list, list]:
        raise wrong(kind, f"described() returned {described!r:.60}, expected a pair of lists")
    if optional:
        _check_restart(part, kind)
    elif not hasattr(part, "models"):
        raise wrong(kind, "models missing: expected the models of its passes")


def _check_field(kind: type[Part], field: Field) -> None:
    if not NAME.fullmatch(field.name) or field.name in NOT_FIELDS:
        raise wrong(
            kind, f"field {field.name!r}: expected a name of lower-case letters, digits and _ that "
            "is neither reserved in checkpoints nor an attribute of State"
        )  # fmt: skip
    if field.rank not in RANKS:
        raise wrong(
            kind, f"field {field.name!r}: rank = {field.rank!r}, expected 0 (scalar), 1 (vector) "
            "or 2 (tensor)"
        )  # fmt: skip
    if field.integer and field.name != "id":
        raise wrong(kind, f"field {field.name!r}: only the ID is an integer")
    if field.public is not None:
        name = getattr(field.public, "name", "")
        if not isinstance(field.public, Public) or not re.fullmatch(r"\w+", str(name)):
            raise wrong(kind, f"field {field.name!r}: expected public=Public(name, …) of sph.state")
        if name in NOT_PUBLIC:
            raise wrong(kind, f"field {field.name!r}: the public name {name!r} is reserved")
        if field.rank == 2:
            raise wrong(kind, f"field {field.name!r}: a tensor has no public name")


def _check_restart(part: Part, kind: type[Part]) -> None:
    """Check that no restart adds or drops a part whose state a checkpoint cannot give."""
    kept = [field.name for field in part.fields if field.stored and not field.remade]
    if not kept and not part.columns:
        return
    key = kind.keys[0]
    if key.restart == "refused" or (key.restart == "same kind" and key.kind is not bool):
        return
    raise wrong(
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
                raise wrong(type(part), f"field {name!r} is declared by {label(owner)} too")
            owners[name] = part
            if field.public is not None:
                if field.public.name in publics:
                    raise wrong(
                        type(part), f"field {name!r}: the public name {field.public.name!r} is "
                        f"that of field {publics[field.public.name]!r} too"
                    )  # fmt: skip
                publics[field.public.name] = name
        for column in part.columns:
            if column in columns:
                other = label(type(columns[column]))
                raise wrong(type(part), f"column {column!r} is declared by {other} too")
            columns[column] = part
        for role in part.terms:
            if role not in roles:
                expected = f"one of {', '.join(roles)}" if roles else "none"
                raise wrong(
                    type(part), f"term {role!r}: {label(type(parts[0]))} calls {expected}"
                )  # fmt: skip
            if role in terms:
                raise wrong(type(part), f"term {role!r} is that of {label(type(terms[role]))}")
            terms[role] = part
    fields = {field.name: field for part in parts for field in part.fields}
    for part in parts:
        _check_names(part, fields)


def _check_names(part: Part, fields: dict[str, Field]) -> None:
    """Check that what a part reads, writes, needs and evolves are fields of the scene."""
    used = [
        (f"pass at stage {one.stage!r}", tuple(sorted(one.fields_read | one.fields_written)))
        for one in part.passes
    ]
    used += [("needs", part.needs)]
    used += [("evolved", one[:3]) for one in part.evolved]
    for where, names in used:
        if unknown := [name for name in names if name not in fields]:
            raise wrong(
                type(part), f"{where}: {unknown[0]!r} is not a field of this scene; expected one "
                f"of {', '.join(sorted(fields))}"
            )  # fmt: skip
    for one in part.evolved:
        value, rate, predicted = (fields[name] for name in one[:3])
        if not value.rank == rate.rank == predicted.rank:  # rules index all three alike
            raise wrong(type(part), f"evolved {value.name!r}: expected three fields of equal rank")
        if not (value.stored and (rate.stored or rate.remade)):
            raise wrong(
                type(part), f"evolved {value.name!r}: expected value and rate to be stored, or a "
                "restart would begin with zeros"
            )  # fmt: skip
        if not isinstance(one.rule, Rule):
            raise wrong(type(part), f"evolved {value.name!r}: expected a Rule, not {one.rule!r}")
