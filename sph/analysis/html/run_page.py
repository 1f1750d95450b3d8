"""The page on one run."""

from pathlib import Path
from typing import Any

from sph.analysis import figures, info
from sph.analysis.html import provenance
from sph.analysis.html.page import (
    Section,
    escaped,
    items,
    page,
    paragraph,
    picture,
    preformatted,
    table,
)
from sph.analysis.info.words import HEADINGS, number, setting_text
from sph.errors import FileError
from sph.output.files import read_text
from sph.output.run_directory import RunDirectory

CAPTIONS = {
    "profiles": "Profiles of the last state",
    "map": "Map of the last state",
    "slice": "Slice through the last state",
    "evolution": "The run over time",
    "history": "History: energies, energy drift, momentum and time steps",
}


def of(directory: Path) -> tuple[list[Path], str]:
    """Return the pictures of a run, drawn anew, and the text of the page. Raises FileError."""
    found = info.of(directory)
    drawn = figures.draw([directory]) if found["state"]["last_checkpoint"] else []
    return drawn, text(found, drawn)


def text(found: dict[str, Any], pictures: list[Path]) -> str:
    """Return the page. found: of `sph.analysis.info.of` for a run; pictures: PNG files."""
    run = RunDirectory(Path(found["path"]))
    sections = [
        Section("Pictures", _pictures(pictures)),
        Section("Errors", _errors(found)),
        *_figures(found["figures"]),
        Section("Steps", _steps(found)),
        Section("History", _history(found["columns"])),
        Section("Time by phase", _time(found["time"])),
        Section("Configuration", _configuration(found["settings"], run)),
        Section("Physics", _physics(found)),
        Section("Provenance", provenance.section(found, run)),
    ]
    name = run.path.resolve().name
    return page(f"{name}: {found['state']['problem']}", _head(found), sections)


def _head(found: dict[str, Any]) -> str:
    state = found["state"]
    size = "" if state["particles"] is None else f", {state['particles']} particles"
    words = (
        f"{state['dimension']}-D{size}, t = {number(state['time'])} of {number(state['end'])}"
        f"{' ' * bool(state['time_unit'])}{state['time_unit']}, "
        f"step {state['step']}"
    )
    status = escaped(state["status"])
    parts = [f'<p><span class="status {status}">{status}</span> {escaped(words)}</p>']
    if state["reason"]:
        parts.append(f"<pre>{escaped(state['reason'])}</pre>")
    parts += [
        paragraph(f"Warning ({one['kind']}): {one['text']}", "warning") for one in found["warnings"]
    ]
    parts += [
        paragraph(f"Setting changed in a restart: {one}.", "warning")
        for one in found["settings_changed"]
    ]
    return "\n".join(parts)


def _pictures(pictures: list[Path]) -> str:
    if not pictures:
        return paragraph("None: the run has no checkpoint.")
    return "\n".join(
        picture(path, CAPTIONS.get(path.stem, path.stem.replace("_", " "))) for path in pictures
    )


def _errors(found: dict[str, Any]) -> str:
    errors = found["errors"]
    if not errors:
        return paragraph(f"Left out, because {found['errors_left_out']}.")
    rows = [
        (
            name,
            *(number(norms[one]) for one in ("L1", "L2", "Linf")),
            "" if norms["relative_L1"] is None else number(norms["relative_L1"]),
        )
        for name, norms in errors["fields"].items()
    ]
    named = errors.get("reference")
    truth = errors.get("against", "") if named is None else f"the run {named}"
    words = f"Against {truth}; {errors['region']}, {errors['particles']} particles."
    header = ("field", "L1", "L2", "Linf", "relative L1")
    return paragraph(words) + "\n" + table(header, rows, ("", *["number"] * 4))


def _figures(figures: list[dict[str, Any]]) -> list[Section]:
    """A section for each table of the summary."""
    found = []
    for name, heading in HEADINGS.items():
        rows = [
            (
                one["name"].partition(".")[2],
                number(one["value"]),
                one["unit"] or "",
                one["meaning"] or "no meaning is declared",
            )
            for one in figures
            if one["name"].startswith(f"{name}.")
        ]
        if rows:
            shown = table(
                ("name", "value", "unit", "meaning"), rows, ("name", "number", "unit", "")
            )
            found.append(Section(heading, shown))
    return found


def _steps(found: dict[str, Any]) -> str:
    steps = found["steps"]
    if not steps:
        return paragraph("The history has fewer than two rows.")
    words = (
        f"{steps['number']} steps, from {number(steps['shortest'])} to "
        f"{number(steps['longest'])}, median {number(steps['median'])}."
    )
    rows = [
        (
            one["criterion"],
            f"{100.0 * one['share_of_steps']:.1f} %",
            one["share_of_steps"],
            one["meaning"] or "",
        )
        for one in steps["limited_by"]
    ]
    header = ("limited by", "steps", "", "meaning")
    return paragraph(words) + "\n" + table(header, rows, ("name", "number", "bar", ""))


def _history(columns: list[dict[str, Any]]) -> str:
    rows = [
        (
            one["name"],
            one["last"] if isinstance(one["last"], str) else number(one["last"]),
            one["unit"] or "",
            one["meaning"] or "no meaning is declared",
        )
        for one in columns
    ]
    header = ("column", "last value", "unit", "meaning")
    return table(header, rows, ("name", "number", "unit", ""))


def _time(time: dict[str, Any] | None) -> str:
    if time is None:
        return paragraph("Known when the run has ended.")
    phases = time["phases_cpu_seconds"]
    total = sum(phases.values()) or 1.0
    rows = [
        (name, f"{spent:.4g}", f"{100.0 * spent / total:.1f} %", spent / total)
        for name, spent in sorted(phases.items(), key=lambda one: -one[1])
    ]
    words = (
        f"Last session: elapsed {time['wall_seconds']:.4g} s. Compilation took "
        f"{time['compile_cpu_seconds']:.4g} CPU s and the start of Numba "
        f"{time['start_cpu_seconds']:.4g} CPU s, besides:"
    )
    header = ("phase", "CPU s", "share", "")
    return paragraph(words) + "\n" + table(header, rows, ("", "number", "number", "bar"))


def _configuration(settings: list[dict[str, Any]], run: RunDirectory) -> str:
    rows = [
        (one["key"], setting_text(one["value"]), setting_text(one["default"])) for one in settings
    ]
    shown = (
        table(("key", "value", "default"), rows, ("name", "value", "value"))
        if rows
        else paragraph("The defaults of the problem.")
    )
    try:
        whole = preformatted("config.toml", read_text(run.config))
    except (FileError, OSError) as error:
        whole = paragraph(f"config.toml cannot be read: {error}")
    return f"{paragraph('Settings that differ from the defaults:') if rows else ''}{shown}\n{whole}"


def _physics(found: dict[str, Any]) -> str:
    if found["compiled_in"] is None:
        return paragraph("Known when the run has ended.")
    return "\n".join(
        [
            paragraph("The run computed:"),
            items(found["compiled_in"]),
            paragraph("It left out, and why:"),
            items(found["left_out"]),
        ]
    )
