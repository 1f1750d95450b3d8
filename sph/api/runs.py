"""Runs that a script starts."""

import logging
import os
import re
import shutil
import tempfile
import weakref
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sph import config as configuration
from sph import progress, runner
from sph.analysis import reference
from sph.api.concise import concise
from sph.api.results import Run
from sph.api.view import View
from sph.config import Config
from sph.errors import ConfigError, Stopped
from sph.output.run_directory import RunDirectory
from sph.scene import Scene
from sph.simulation import Simulation as Engine

CALLBACK = "the callback"  # which stopped the run, in messages and in the summary

log = logging.getLogger("sph")


@concise
def run(
    config: str | os.PathLike[str] | Mapping[str, Any] | Config,
    overrides: Sequence[str] | Mapping[str, Any] = (),
    callback: Callable[[View], object] | None = None,
    output: str | os.PathLike[str] | None = None,
    *,
    each: Literal["output", "step"] = "output",
    force: bool = False,
    show_progress: bool = False,
) -> Run:
    """Run a configuration to its end, and return the run.

    config: path of a configuration file; or its tables as a dictionary, with the keys of
      docs/configuration.md; or the `config` of another run.
    overrides: keys to change, {"problem.n": 400} or ["problem.n=400"] as after --set.
    callback: called with the simulation (`View`) at t = 0 and after each checkpoint, or after each
      time step if each = "step". If it returns False, of Python or NumPy, the run stops with a
      checkpoint, and the status "stopped"; after None, as without `return`, it goes on.
    output: run directory, which must not hold a run unless `force` is true; if None, a temporary
      directory, which is removed once nothing refers to the returned run and its checkpoints.
    show_progress: show the progress on stderr, as `sph run` does. Otherwise notes, such as that
      code is being compiled, go to the logger "sph".

    Raises ConfigError, NumericalError and FileError with the messages of `sph run`, and Stopped
    if a signal (Ctrl-C) stops the run.

    >>> tube = {"problem": {"name": "shock_tube", "n": 100}, "time": {"end": 0.05}}
    >>> done = sph.run(tube, overrides={"physics.alpha": 1.0})
    >>> done.status
    'done'
    >>> bool(done.summary["errors"]["fields"]["density"]["relative_L1"] < 0.1)
    True
    >>> bool(done.history["t"][-1] == done.checkpoints[-1].time == 0.05)
    True
    """
    resolved = _resolved(config, overrides)
    target = None if output is None else Path(output)
    reference.check(resolved, target)
    _ = Scene(resolved).all_parts  # errors of declarations, before a directory is made
    scratch = None
    if target is None:
        scratch = _Scratch()
        target = scratch.path
    directory = RunDirectory.create(target, force)
    shown = progress.suited() if show_progress else _Log()
    try:
        runner.run(resolved, directory, _Watched(shown, callback, each))
    except Stopped as stopped:
        if CALLBACK not in str(stopped):
            raise
    return Run(directory, scratch)


class _Scratch:
    """A temporary directory, which is removed when nothing refers to this object."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="sph-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


def _resolved(config: Any, overrides: Sequence[str] | Mapping[str, Any]) -> Config:
    texts = configuration.as_overrides(overrides)
    try:
        if isinstance(config, Config):
            return config.override(texts)
        if isinstance(config, Mapping):
            return configuration.from_tables(config, texts)
        return configuration.load(Path(config), texts)
    except ConfigError as error:
        error.args = (re.sub("^--set ", "overrides: ", str(error), flags=re.MULTILINE),)
        raise


class _Log(progress.Messages):
    """Progress that writes notes to the logger."""

    def note(self, text: str) -> None:
        log.info(text)

    def start(self, begin: float, end: float) -> None: ...

    def step(self, simulation: Engine) -> None: ...

    def wrote(self, path: Path, simulation: Engine) -> None: ...


class _Watched(progress.Messages):
    """Progress that also calls the callback of a script, which may stop the run."""

    def __init__(self, shown: Any, callback: Callable[[View], object] | None, each: str):
        if each not in ("output", "step"):
            raise ValueError(f'each = {each!r}: expected "output" or "step"')
        self.shown, self.callback = shown, callback
        self.each_step = callback is not None and each == "step"

    def note(self, text: str) -> None:
        self.shown.note(text)

    def start(self, begin: float, end: float) -> None:
        self.shown.start(begin, end)

    def close(self) -> None:
        self.shown.close()

    def step(self, simulation: Engine) -> str | None:
        self.shown.step(simulation)
        return self._reason(simulation) if self.each_step else None

    def wrote(self, path: Path, simulation: Engine) -> str | None:
        self.shown.wrote(path, simulation)
        return None if self.each_step else self._reason(simulation)

    def _reason(self, simulation: Engine) -> str | None:
        """Call back. Return why the run is to stop, or None."""
        if self.callback is None:
            return None
        answer = self.callback(View(simulation))
        if isinstance(answer, np.ndarray | np.generic) and answer.dtype == bool:
            answer = bool(answer)  # `density.max() < 20` is no False of Python
        return CALLBACK if answer is False else None
