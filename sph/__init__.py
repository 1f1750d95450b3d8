"""Smoothed-particle hydrodynamics (SPH) of compressible gas."""

from sph.version import __version__

__all__ = ["__version__"]
