"""Smoothed particle hydrodynamics from the command line."""

from sph.version import __version__

__all__ = ["__version__"]
