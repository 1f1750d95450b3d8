"""What a run or checkpoint holds: state, settings, steps, cost, figures with their meaning."""

from pathlib import Path
from typing import Any

import numpy as np

from sph import meanings
from sph.analysis import errors, truth
from sph.analysis.info import run_state, settings
from sph.clock import STARTING
from sph.config import Config, restarts
from sph.errors import FileError
from sph.output import checkpoint as checkpoints
from sph.output import history
from sph.output.checkpoint import Checkpoint
from sph.output.run_directory import RunDirectory

Found = dict[str, Any]  # of JSON values


def of(path: Path) -> Found:
    """Return what there is to know of a run directory or a checkpoint, as JSON values.

    Raises FileError if `path` is neither, or cannot be read.
    """
    path = Path(path)
    if not path.exists():
        raise FileError(f"{path} does not exist.\nTry: a run directory, or a checkpoint in one.")
    if path.is_dir():
        return _of_run(run_state.opened_run(path))
    return _of_checkpoint(path, checkpoints.read(path))


def _of_run(run: RunDirectory) -> Found:
    config, last = run_state.config_and_checkpoint(run)
    summary = run.whole_summary() if run.summary.exists() else None
    rows = history.read(run.history) if run.history.exists() else {"step": np.empty(0)}
    lineage = list(last.lineage) if last else []
    return {
        "kind": "run",
        "path": str(run.path),
        "state": run_state.of(run, config, last, summary, rows),
        "warnings": summary["warnings"] if summary else [],
        "lineage": lineage,
        "settings_changed": restarts.settings_changed(lineage),
        "settings": settings.different(config),
        "units": config.units.model_dump() if config.units.are_given else None,
        "steps": _steps(config, rows) if rows["step"].size > 1 else None,
        "time": _time(summary) if summary else None,
        "errors": summary["errors"] if summary else None,
        "errors_left_out": summary["errors_left_out"] if summary else "the run has not ended",
        "figures": _figures(config, summary or {"relaxation": run.read_relaxation() or {}}),
        "columns": _columns(config, rows),
        "compiled_in": summary["compiled_in"] if summary else None,
        "left_out": summary["left_out"] if summary else None,
    }


def _of_checkpoint(path: Path, state: Checkpoint) -> Found:
    config, particles = state.config, state.particles
    found, why, report = None, None, None
    if checkpoints.PART in state.lineage:  # of a failed run: no state of a flow
        why = f"the file contains only {checkpoints.PART}"
    else:
        found = errors.against_exact(config, state.time, particles, state.pressure)
        why = truth.left_out(config, state.time, particles.position)
        report = truth.figures(config, state.time, particles, state.pressure)
    return {
        "kind": "checkpoint",
        "path": str(path),
        "state": run_state.of_checkpoint(state),
        "lineage": list(state.lineage),
        "settings_changed": restarts.settings_changed(state.lineage),
        "settings": settings.different(config),
        "units": config.units.model_dump() if config.units.are_given else None,
        "errors": found,
        "errors_left_out": why,
        "figures": _figures(config, {"errors": found or {}, "report": report or {}}),
        "fields": _fields(state),
    }


def _steps(config: Config, rows: dict[str, np.ndarray]) -> Found:
    """Lengths of the steps, and what limited them. The limit of a row is that of the next step."""
    lengths, limiters = np.diff(rows["t"]), rows["limiter"][:-1]
    names, counts = np.unique(limiters.astype(str), return_counts=True)
    spent = {name: float(lengths[limiters == name].sum()) for name in names}
    order = np.argsort(-counts, kind="stable")
    return {
        "number": int(lengths.size),
        "shortest": float(lengths.min()),
        "median": float(np.median(lengths)),
        "longest": float(lengths.max()),
        "limited_by": [
            {
                "criterion": str(names[i]),
                "share_of_steps": float(counts[i] / lengths.size),
                "share_of_time": spent[names[i]] / float(lengths.sum()),
                "meaning": meanings.of_criterion(config.physics.formulation, str(names[i])),
            }
            for i in order
        ],
    }


def _time(summary) -> Found:
    """CPU seconds of the last session by phase, in falling order; "other" is in no phase."""
    session = summary["cost"]["session"]
    phases = dict(sorted(session["phases_cpu_seconds"].items(), key=lambda one: -one[1]))
    start = phases.pop(STARTING, 0.0)
    phases["other"] = max(session["cpu_seconds"] - sum(phases.values()), 0.0)
    return {
        "cpu_seconds": session["cpu_seconds"],
        "wall_seconds": session["wall_seconds"],
        "compile_cpu_seconds": session["compile_cpu_seconds"],
        "start_cpu_seconds": start,
        "phases_cpu_seconds": phases,
    }


def _figures(config: Config, summary) -> list[Found]:
    """Each number of a summary with its meaning and unit; None for what nobody declared."""
    found = []
    for name, value in _numbers(summary, ""):
        known = meanings.of_entry(config.problem, name)
        found.append(
            {
                "name": name,
                "value": value,
                "unit": meanings.unit_of(config, known) if known else None,
                "meaning": known.help if known else None,
            }
        )
    return found


def _numbers(table: Any, prefix: str):
    for name, value in table.items():
        if isinstance(value, dict) and name != "phases_cpu_seconds":
            yield from _numbers(value, f"{prefix}{name}.")
        elif isinstance(value, int | float) or (value is None and prefix):
            yield f"{prefix}{name}", value


def _columns(config: Config, rows: dict[str, np.ndarray]) -> list[Found]:
    """Each column of the history with its last value."""
    if not rows["step"].size:
        return []
    found = []
    for name, values in rows.items():
        known = meanings.of_column(config, name)
        last = values[-1]
        found.append(
            {
                "name": name,
                "last": last if isinstance(last, str) else float(last),
                "of_problem": meanings.is_of_problem(config, name),
                "unit": meanings.unit_of(config, known) if known else None,
                "meaning": known.help if known else None,
            }
        )
    return found


def _fields(state: Checkpoint) -> list[Found]:
    """Extremes of scalars, and of the lengths of vectors."""
    arrays = state.particles.arrays() | {"pressure": state.pressure}
    found = []
    for name, array in arrays.items():
        if name == "id" or array.ndim > 2:
            continue
        values = array if array.ndim == 1 else np.linalg.norm(array, axis=0)
        found.append(
            {
                "name": name if array.ndim == 1 else f"|{name}|",
                "smallest": float(values.min()),
                "mean": float(values.mean()),
                "largest": float(values.max()),
            }
        )
    return found
