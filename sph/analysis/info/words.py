"""The text of `sph info`."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

from sph.config.toml_text import value_text

WIDTH = 98
LONGEST_VALUE = 40


def in_words(found: dict[str, Any]) -> str:
    """Return what `sph.analysis.info.of` found, for a terminal."""
    state = found["state"]
    size = "" if state["particles"] is None else f", {state['particles']} particles"
    lines = [f"{found['path']}: {state['problem']}, {state['dimension']}-D{size}"]
    lines += _run_state(state) if found["kind"] == "run" else _checkpoint_state(state)
    lines += [
        _wrapped(f"Warning ({one['kind']}): {one['text']}") for one in found.get("warnings", [])
    ]
    lines += [_wrapped(f"Lineage: {one}.") for one in found["lineage"]]
    lines += ["", *_settings(found["settings"])]
    if found.get("steps"):
        lines += ["", *_steps(found["steps"])]
    if found.get("time"):
        lines += ["", *_time(found["time"])]
    lines += ["", *_errors(found)]
    lines += _figures(found["figures"])
    if of_problem := [one for one in found.get("columns", ()) if one["of_problem"]]:
        lines += ["", "Columns of the problem, in the last row of the history:"]
        lines += [line for one in of_problem for line in _entry(one["name"], one["last"], one)]
    if "fields" in found:
        lines += ["", *_fields(found["fields"])]
    if found.get("left_out"):
        lines += ["", "Physics of the run:", *(f"  {one}" for one in found["compiled_in"])]
        lines += ["Left out:", *(f"  {one}" for one in found["left_out"])]
    return "\n".join(lines)


def _run_state(state: dict[str, Any]) -> list[str]:
    version = f", by sph {state['version']}" if state["version"] else ""
    lines = [f"State: {state['status']} at t = {_times(state)}, step {state['step']}{version}"]
    if state["reason"]:
        lines.append(_wrapped(f"Reason: {state['reason']}"))
    if last := state["last_checkpoint"]:
        lines.append(
            f"Checkpoints: {state['checkpoints']}, the last valid one at t = {last['time']:.6g} "
            f"({last['path']})"
        )
    else:
        lines.append("Checkpoints: none")
    if state["frames"]:
        lines.append(f"Frames: {state['frames']} (`sph movie` uses them)")
    return lines


def _times(state: dict[str, Any]) -> str:
    return f"{state['time']:.6g} of {state['end']:g} {state['time_unit']}".rstrip()


def _checkpoint_state(state: dict[str, Any]) -> list[str]:
    return [
        f"State: t = {_times(state)}, step {state['step']}; next step "
        f"{state['next_step']:.4g} or less"
    ]


def _settings(settings: Sequence[dict[str, Any]]) -> list[str]:
    if not settings:
        return ["Settings: the defaults of the problem"]
    lines, rows = ["Settings that differ from the defaults:"], []
    for one in settings:
        value, default = setting_text(one["value"]), setting_text(one["default"])
        if max(len(value), len(default)) > LONGEST_VALUE:
            rows += [(one["key"], f"= {value}"), ("", f"default {default}")]
        else:
            rows.append((one["key"], f"= {value}  (default {default})"))
    return lines + _aligned(rows)


def setting_text(value: Any) -> str:
    """Return the value of a key as TOML, or "none"."""
    return "none" if value is None else value_text(value)


def _steps(steps: dict[str, Any]) -> list[str]:
    rows = [
        (f"{100.0 * one['share_of_steps']:.1f} %", one["criterion"], one["meaning"] or "")
        for one in steps["limited_by"]
    ]
    return [
        f"Steps: {steps['number']}, from {steps['shortest']:.3g} to {steps['longest']:.3g}, median "
        f"{steps['median']:.3g}. What limited them, as shares of the steps:",
        *_aligned(rows),
    ]


def _time(time: dict[str, Any]) -> list[str]:
    total = sum(time["phases_cpu_seconds"].values()) or 1.0
    rows = [
        (f"{100.0 * one / total:.1f} %", name)
        for name, one in sorted(time["phases_cpu_seconds"].items(), key=lambda one: -one[1])
    ]
    apart = time["compile_cpu_seconds"] + time["start_cpu_seconds"]
    words = (
        f"Time of the last session: elapsed {time['wall_seconds']:.3g} s; {apart:.3g} CPU s for "
        f"compilation and the start of Numba, and {time['cpu_seconds']:.3g} CPU s for:"
    )
    return [_wrapped(words), *_aligned(rows)]


def _errors(found: dict[str, Any]) -> list[str]:
    errors = found["errors"]
    if not errors:
        return [_wrapped(f"Errors: left out, because {found['errors_left_out']}")]
    rows = [("field", "L1", "L2", "Linf", "L1 relative")]
    for name, norms in errors["fields"].items():
        relative = norms["relative_L1"]
        shown = [f"{norms[one]:.4g}" for one in ("L1", "L2", "Linf")]
        rows.append((name, *shown, "" if relative is None else f"{100 * relative:.3g} %"))
    named = errors.get("reference")
    truth = errors["against"] if named is None else f"the run {named}"
    return [_wrapped(f"Errors against {truth}, {errors['region']}:"), *_aligned(rows)]


# Tables of the summary whose figures follow the errors, with a heading.
HEADINGS = {
    "report": "Figures of the problem",
    "conservation": "Conservation",
    "nearest": "Distance to the nearest neighbour",
    "tearing": "Solid bodies",
    "relaxation": "Relaxation to a glass",
    "cost": "Cost",
}


def _figures(figures: Sequence[dict[str, Any]]) -> list[str]:
    lines: list[str] = []
    for table, heading in HEADINGS.items():
        rows = [one for one in figures if one["name"].startswith(f"{table}.")]
        if rows:
            lines += ["", f"{heading}:"]
            for one in rows:
                lines += _entry(one["name"].partition(".")[2], one["value"], one)
    return lines


def _entry(name: str, value: float | None, one: dict[str, Any]) -> list[str]:
    """Return a value with its unit and its meaning."""
    unit = f" {one['unit']}" if one["unit"] else ""
    meaning = one["meaning"] or "no meaning is declared: see the file of the problem"
    return [f"  {name} = {number(value)}{unit}", _wrapped(meaning, "      ")]


def number(value: float | None) -> str:
    """Return a number with six digits, or "none"."""
    if value is None:
        return "none"
    return str(value) if isinstance(value, int) else f"{value:.6g}"


def _fields(fields: Sequence[dict[str, Any]]) -> list[str]:
    rows = [("field", "smallest", "mean", "largest")]
    rows += [
        (one["name"], *(f"{one[name]:.6g}" for name in ("smallest", "mean", "largest")))
        for one in fields
    ]
    return ["Particles:", *_aligned(rows)]


def _aligned(rows: Iterable[Sequence[str]]) -> list[str]:
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = (
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        for row in rows
    )
    return [f"  {line}".rstrip() for line in lines]


def _wrapped(text: str, indent: str = "") -> str:
    first, *rest = text.split("\n")
    further = indent or "  "
    wrapped = textwrap.fill(first, WIDTH, initial_indent=indent, subsequent_indent=further)
    return "\n".join([wrapped, *rest])
