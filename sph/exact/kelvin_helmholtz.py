"""Linear theory of a compressible shear layer: growth rates and growing perturbations.

A perturbation (u, v, p)(y, t) e^(ikx) of velocity and pressure, in a stream U(y) along x of density
R(y) at uniform pressure, obeys the linearised Euler equations of an adiabatic gas,

    du/dt = -ik U u - U' v - ik p/R
    dv/dt = -ik U v - p'/R
    dp/dt = -ik U p - R c^2 (ik u + v')

(Drazin & Reid 2004, Hydrodynamic Stability, section 22, with compression), which do not contain the
perturbation of density. y is periodic, and derivatives are spectral (Fourier).
"""

from typing import NamedTuple

import numpy as np

# Relative to the perturbation, and far below the errors of simulations.
TOLERANCE = 1e-7


class ShearLayer(NamedTuple):
    """A stream along x, given at n evenly spaced points of one period in y."""

    period: float
    velocity: np.ndarray  # (n,) U along x
    density: np.ndarray  # (n,) R
    stiffness: np.ndarray  # (n,) R c^2: gamma P in an ideal gas


def points(period: float, n: int) -> np.ndarray:
    """Return the (n,) points in y of a `ShearLayer`."""
    return period * (np.arange(n) + 0.5) / n


def growth_rate(layer: ShearLayer, wavenumber: float) -> float:
    """Return the growth rate of the fastest mode e^(ikx), the largest real part of eigenvalues."""
    from scipy.linalg import eigvals  # costs 0.1 s to import

    n = layer.velocity.size
    columns = np.eye(3 * n, dtype=complex).reshape(3, n, 3 * n)
    operator = _rates(layer, wavenumber)(columns).reshape(3 * n, 3 * n)
    return float(eigvals(operator).real.max())


def evolution(layer: ShearLayer, wavenumber: float, start, times: np.ndarray) -> np.ndarray:
    """Return perturbations (M, 3, n) of u, v, p at ascending `times` (M,), from `start` (3, n)."""
    from scipy.integrate import solve_ivp

    if times[-1] == 0.0:
        return np.stack([start] * len(times))
    rates, shape = _rates(layer, wavenumber), np.shape(start)
    found = solve_ivp(
        lambda _, state: rates(state.reshape(shape)).ravel(),
        (0.0, times[-1]), np.asarray(start, dtype=complex).ravel(), method="DOP853",
        t_eval=times, rtol=TOLERANCE, atol=TOLERANCE * np.abs(start).max(),
    )  # fmt: skip
    return found.y.T.reshape(-1, *shape)


def vortex_sheet(wavenumber: float, velocities, densities) -> float:
    """Return the growth rate of a vortex sheet between two incompressible streams.
    k |U_1 - U_2| sqrt(R_1 R_2)/(R_1 + R_2) (Drazin & Reid 2004, eq 4.20 without gravity).
    """
    (first, second), (light, heavy) = velocities, densities
    return wavenumber * abs(first - second) * (light * heavy) ** 0.5 / (light + heavy)


def _rates(layer: ShearLayer, k: float):
    """Return the right-hand side, a function of one perturbation (3, n) or of many (3, n, M)."""
    n = layer.velocity.size
    wave = 2j * np.pi * np.fft.fftfreq(n, layer.period / n)
    if n % 2 == 0:
        wave[n // 2] = 0.0  # the derivative of the Nyquist mode vanishes at the points

    def derive(fields):
        """Return the spectral derivative along the second axis of (F, n, ...)."""
        along = wave.reshape(-1, *(1,) * (fields.ndim - 2))
        return np.fft.ifft(along * np.fft.fft(fields, axis=1), axis=1)

    slope = derive(layer.velocity[None])[0].real

    def rates(disturbance):
        shape = (-1,) + (1,) * (disturbance.ndim - 2)
        U, R, stiffness = (each.reshape(shape) for each in layer[1:])
        u, v, p = disturbance
        v_slope, p_slope = derive(disturbance[1:])
        return np.stack(
            [
                -1j * k * (U * u + p / R) - slope.reshape(shape) * v,
                -1j * k * U * v - p_slope / R,
                -1j * k * U * p - stiffness * (1j * k * u + v_slope),
            ]
        )

    return rates
