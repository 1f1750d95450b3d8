"""Whether a run has ended, runs or was interrupted, and how far it is."""

from pathlib import Path
from typing import Any

from sph import config as configuration
from sph.config import Config
from sph.errors import ConfigError, FileError
from sph.output import checkpoint as checkpoints
from sph.output.checkpoint import Checkpoint
from sph.output.files import read_text
from sph.output.run_directory import RunDirectory
from sph.summary import Summary


def is_run(path: Path) -> bool:
    """Whether `path` is a run directory."""
    return (path / "checkpoints").is_dir()


def opened_run(path: Path) -> RunDirectory:
    """Return the run directory at `path`. Raises FileError, which names runs inside `path`."""
    inside = sorted(one.parent.name for one in path.glob("*/config.toml"))
    if inside and not is_run(path):
        raise FileError(
            f"{path} is not a run directory, but contains {len(inside)} run(s).\n"
            f"Try: {path / inside[0]}; or `sph report {path}`, which compares them."
        )
    return RunDirectory.open(path)


def config_and_checkpoint(run: RunDirectory) -> tuple[Config, Checkpoint | None]:
    """Return the configuration, that of config.toml if it can be read, and the last checkpoint.

    The checkpoint is None if the run has written none. Raises FileError if neither can be read.
    """
    last = checkpoints.read(run.latest()) if run.checkpoints() else None
    try:
        return configuration.from_text(read_text(run.config), str(run.config)), last
    except (OSError, FileError, ConfigError) as error:
        if last is None:
            raise FileError(
                f"{run.path} has neither a checkpoint nor a valid config.toml: {error}"
            ) from None
        return last.config, last


def of(
    run: RunDirectory, config: Config, last: Checkpoint | None, summary: Summary | None, rows
) -> dict[str, Any]:
    """Return status, reason, time, step and versions of a run.

    status: that of the summary, or "running" if a process has locked the directory, or
    "interrupted".
    """
    status = summary["status"] if summary else _status_without_summary(run)
    has_rows = rows["step"].size > 0
    return {
        "status": status,
        "reason": summary["reason"] if summary else None,
        "problem": config.problem.name,
        "dimension": config.problem.dimension,
        "particles": last.particles.number if last else None,
        "time": float(rows["t"][-1]) if has_rows else (last.time if last else 0.0),
        "end": config.time.end,
        "time_unit": config.units.symbol(0, 0, 1),
        "step": int(rows["step"][-1]) if has_rows else (last.step if last else 0),
        "checkpoints": len(run.checkpoints()),
        "frames": len(run.frames.paths()),
        "last_checkpoint": _shown(run, last),
        "version": summary["version"] if summary else None,
    }


def of_checkpoint(state: Checkpoint) -> dict[str, Any]:
    """Return time, step, next step and size of a checkpoint."""
    return {
        "problem": state.config.problem.name,
        "dimension": state.config.problem.dimension,
        "particles": state.particles.number,
        "time": state.time,
        "end": state.config.time.end,
        "time_unit": state.config.units.symbol(0, 0, 1),
        "step": state.step,
        "next_step": state.next_step,
    }


def _shown(run: RunDirectory, last: Checkpoint | None) -> dict[str, Any] | None:
    if last is None:
        return None
    return {"path": str(run.latest()), "time": last.time, "step": last.step}


def _status_without_summary(run: RunDirectory) -> str:
    return "running" if run.is_running() else "interrupted"
