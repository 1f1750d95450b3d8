"""Smoothed-particle hydrodynamics (SPH) of compressible gas and of solids.

    >>> import sph
    >>> done = sph.run({"problem": {"name": "shock_tube", "n": 100}, "time": {"end": 0.05}})
    >>> done.checkpoints[-1].density.shape
    (99,)

docs/api.md describes the interface for Python.
"""

import importlib

from sph.version import __version__

# Modules of the public names, imported on first use: the command line starts without them.
_HOMES = {
    **dict.fromkeys(("Checkpoint", "Particles", "Run", "Simulation", "View", "open", "run"), "api"),
    **dict.fromkeys(("InitialState", "Limit", "Problem"), "problems.base"),
    **dict.fromkeys(
        ("ConfigError", "FileError", "NumericalError", "SphError", "Stopped"), "errors"
    ),
}

__all__ = ["__version__", *sorted(_HOMES)]


def __getattr__(name: str):
    if name not in _HOMES:
        raise AttributeError(f"module 'sph' has no attribute {name!r}")
    found = getattr(importlib.import_module(f"sph.{_HOMES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
