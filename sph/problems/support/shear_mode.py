"""Amplitude of a mode at the two faces of a slab that shears."""

import numpy as np


def mode_amplitude(particles, x, height, velocity, wavelength: float) -> float:
    """Amplitude of the mode of that wavelength along x in `velocity` (N,) (their eqs 10-13).

    `height` (N,) is y above the middle of the slab, whose faces are at heights of +-1/4. Particles
    weigh by their volume and by their distance from the nearer face, as a surface mode decays.
    """
    wavenumber = 2.0 * np.pi / wavelength
    weight = particles.mass / particles.density * surface_weight(height, wavenumber)
    sine = (weight * velocity * np.sin(wavenumber * x)).sum()
    cosine = (weight * velocity * np.cos(wavenumber * x)).sum()
    return float(2.0 * np.hypot(sine, cosine) / weight.sum())


def surface_weight(height: np.ndarray, wavenumber: float) -> np.ndarray:
    """(N,) weight of particles at a height (N,) above the middle of the slab."""
    return np.exp(-wavenumber * np.abs(np.abs(height) - 0.25))
