"""Changes of the configuration in a restart: the class of each key, and messages on changes.

The class is declared with the key, `Field(..., json_schema_extra=RECORDED)`, or for all keys of a
table in its class attribute `restart`.
"""

import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from sph.config.toml_text import value_text
from sph.problems.base import Section

CLASSES = {
    "free": "may change; affects no result, or only the end time and the output times",
    "recorded": "may change; affects the equations or their numerical solution, so the change is "
    "recorded in the run's lineage",
    "same kind": "as recorded, but a number must stay a number, a table a table, and a key that is "
    "not given must stay so",
    "refused": "may not change, because the state in the checkpoint and the reference value of "
    "energy drift depend on it",
}
FREE, RECORDED, SAME_KIND, REFUSED = ({"restart": name} for name in CLASSES)

_KINDS = {float: "one number", str: "a name", dict: "a table", type(None): "none"}
_LINEAGE = re.compile(r"restarted at step \d+, t = (\S+) with (.+)")


class Change(NamedTuple):
    """A changed key TABLE.KEY, its values before and now (None: not given), and its class."""

    key: str
    was: Any
    now: Any
    rule: str | None

    def __str__(self) -> str:
        return f"{self.key} = {_text(self.now)} (was {_text(self.was)})"


def class_of(section: type[Section], key: str) -> str | None:
    """Return the class (a key of CLASSES) of a key of that table, or None if none is declared."""
    declared = section.model_fields[key].json_schema_extra
    found = declared.get("restart") if isinstance(declared, dict) else None
    return section.restart if found is None else str(found)


def changes(before, after) -> list[Change]:
    """Return the keys whose values differ between two `Config`s."""
    found = []
    for table, section in vars(after).items():
        was = getattr(before, table).model_dump(exclude_none=True)
        now = section.model_dump(exclude_none=True)
        found += [
            Change(f"{table}.{key}", was.get(key), now.get(key), class_of(type(section), key))
            for key in type(section).model_fields
            if was.get(key) != now.get(key)
        ]
    return found


def refusals(changed: Iterable[Change]) -> list[str]:
    """Return one message for each change that is not allowed in a restart."""
    found = []
    for one in changed:
        if one.rule == "refused":
            found.append(
                f"{one.key} cannot be changed in a restart, because the state in the checkpoint "
                "depends on it and energy drift is measured from the start of the run"
            )
        elif one.rule == "same kind" and type(one.was) is not type(one.now):
            kind = _KINDS[type(one.was)]
            found.append(f"{one.key} = {_text(one.now)}: expected {kind}, as in the checkpoint")
    return found


def lineage(step: int, time: float, changed: Iterable[Change]) -> str:
    """Return the line on a restart for the lineage of the checkpoints that it writes."""
    recorded = ", ".join(str(one) for one in changed if one.rule != "free")
    return f"restarted at step {step}, t = {time!r}{f' with {recorded}' if recorded else ''}"


def settings_changed(lines: Sequence[str]) -> list[str]:
    """Return the changed settings in a lineage, each "KEY = VALUE (was VALUE) at t = TIME"."""
    found = map(_LINEAGE.fullmatch, lines)
    return [f"{match[2]} at t = {float(match[1]):g}" for match in found if match]


def _text(value: Any) -> str:
    return "not given" if value is None else value_text(value)
