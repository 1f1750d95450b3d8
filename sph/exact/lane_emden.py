"""Polytropes, self-gravitating spheres with P ~ rho^(1 + 1/n), and their radial pulsation.

Chandrasekhar (1939), An Introduction to the Study of Stellar Structure, chapter IV. In the variable
xi = r/alpha, rho = rho_c theta^n and P = P_c theta^(n + 1), where theta solves the Lane-Emden
equation theta'' + 2 theta'/xi + theta^n = 0 with theta = 1 in the centre; the surface is its first
zero (eqs 245 and 246). Radial pulsation: Cox (1980), Theory of Stellar Pulsation, chapter 8.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

START = 1e-3  # the series about xi = 0 errs by 1e-18 there, to which DOP853 adds its 1e-13
NODES = 4000  # of the table: cubic Hermite interpolation then errs by 1e-12
TERMS = 16  # of the mode: its frequency changes by less than 1e-9 with more
HALVINGS = 45  # bisection to 3e-14 of the radius


class _Solution(NamedTuple):
    surface: float  # xi of the first zero of theta
    slope: float  # -theta' there
    theta: Callable  # of xi/surface
    share: Callable  # of the mass, of xi/surface


class Mode(NamedTuple):
    """A radial mode: `squared_frequency` (rad per unit time, squared), and its shape."""

    squared_frequency: float
    coefficients: np.ndarray  # of Legendre polynomials in 2 (r/R)^2 - 1

    @property
    def frequency(self) -> float:
        """Angular frequency. Raises ValueError if the polytrope is unstable."""
        if not self.squared_frequency > 0.0:
            raise ValueError("the polytrope is unstable: it needs gamma above 4/3")
        return math.sqrt(self.squared_frequency)

    @property
    def period(self) -> float:
        """2 pi over the frequency. Raises ValueError if the polytrope is unstable."""
        return 2.0 * math.pi / self.frequency

    def shape(self, share: np.ndarray) -> np.ndarray:
        """Return the displacement over the radius at r/R = share (N,); 1 at the surface."""
        at = np.clip(share, 0.0, 1.0)
        return np.polynomial.legendre.legval(2.0 * at * at - 1.0, self.coefficients)


class Polytrope(NamedTuple):
    """A polytrope of index 0 <= n < 5 with a mass and a radius, in units with a constant G."""

    n: float
    mass: float = 1.0
    radius: float = 1.0
    G: float = 1.0

    @property
    def central_density(self) -> float:
        found = _solve(self.n)
        return self.mean_density * found.surface / (3.0 * found.slope)

    @property
    def mean_density(self) -> float:
        return 3.0 * self.mass / (4.0 * math.pi * self.radius**3)

    @property
    def central_pressure(self) -> float:
        alpha = self.radius / _solve(self.n).surface
        return 4.0 * math.pi * self.G * (alpha * self.central_density) ** 2 / (self.n + 1.0)

    @property
    def potential_energy(self) -> float:
        """Gravitational energy: -3/(5 - n) G M^2/R (Betti and Ritter)."""
        return -3.0 / (5.0 - self.n) * self.G * self.mass**2 / self.radius

    @property
    def escape_speed(self) -> float:
        """Escape speed from the surface."""
        return math.sqrt(2.0 * self.G * self.mass / self.radius)

    def density(self, radius: np.ndarray) -> np.ndarray:
        """Return the density at radii (N,); 0 outside."""
        theta = self._theta(radius)
        return self.central_density * np.where(theta > 0.0, theta**self.n, 0.0)

    def pressure(self, radius: np.ndarray) -> np.ndarray:
        """Return the pressure at radii (N,); 0 outside."""
        return self.central_pressure * self._theta(radius) ** (self.n + 1.0)

    def pressure_of(self, density: np.ndarray) -> np.ndarray:
        """Return the pressure K rho^(1 + 1/n) at densities (N,), for n > 0."""
        share = np.asarray(density) / self.central_density
        return self.central_pressure * share ** (1.0 + 1.0 / self.n)

    def enclosed_mass(self, radius: np.ndarray) -> np.ndarray:
        """Return the mass inside the radii (N,)."""
        share = np.clip(np.asarray(radius) / self.radius, 0.0, 1.0)
        return self.mass * np.clip(_solve(self.n).share(share), 0.0, 1.0)

    def radius_of_mass(self, mass: np.ndarray) -> np.ndarray:
        """Return the radii (N,) inside which the masses (N,) are: the inverse of enclosed_mass."""
        low, high = np.zeros(np.shape(mass)), np.full(np.shape(mass), self.radius)
        for _ in range(HALVINGS):  # Newton's step has no end at the surface, where density is 0
            middle = 0.5 * (low + high)
            outside = self.enclosed_mass(middle) < mass
            low, high = np.where(outside, middle, low), np.where(outside, high, middle)
        return 0.5 * (low + high)

    def squared_buoyancy(self, radius: np.ndarray, gamma: float) -> np.ndarray:
        """Return N^2, the squared Brunt-Vaisala frequency, at radii (N,) inside the surface.

        Negative where the gas is unstable to convection: everywhere if gamma < 1 + 1/n (eq 248).
        """
        pull = self.G * self.enclosed_mass(radius) / np.asarray(radius) ** 2
        stiffness = self.n / (self.n + 1.0) - 1.0 / gamma
        return pull**2 * self.density(radius) / self.pressure(radius) * stiffness

    def fundamental_mode(self, gamma: float) -> Mode:
        """Return the fundamental radial mode of gas with the adiabatic index `gamma`."""
        squared, coefficients = _fundamental(self.n, gamma)
        return Mode(squared * self.G * self.mass / self.radius**3, coefficients)

    def _theta(self, radius: np.ndarray) -> np.ndarray:
        share = np.minimum(np.asarray(radius) / self.radius, 1.0)
        return np.where(share < 1.0, np.maximum(_solve(self.n).theta(share), 0.0), 0.0)


@functools.cache
def _solve(index: float) -> _Solution:
    """Solve the Lane-Emden equation. Raises ValueError for an index outside [0, 5)."""
    from scipy.integrate import solve_ivp  # costs 0.2 s to import
    from scipy.interpolate import CubicHermiteSpline

    if not 0.0 <= index < 5.0:
        raise ValueError(f"index {index}: expected 0 <= index < 5; others have no finite radius")

    def rates(xi, state):
        return state[1], -2.0 / xi * state[1] - max(state[0], 0.0) ** index

    def surface(_, state):
        return state[0]

    surface.terminal = True  # type: ignore[attr-defined]
    start = START**2
    first = (1.0 - start / 6.0 + index * start**2 / 120.0, START * (-1 / 3 + index * start / 30.0))
    found = solve_ivp(
        rates, (START, math.inf), first, method="DOP853", rtol=1e-13, atol=1e-15,
        events=surface, dense_output=True,
    )  # fmt: skip
    end, slope = float(found.t_events[0][0]), float(-found.y_events[0][0][1])
    share = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, NODES))  # close together at the surface
    xi = share * end
    theta, rate = found.sol(np.maximum(xi, START))
    centre = xi < START
    theta[centre], rate[centre] = 1.0 - xi[centre] ** 2 / 6.0, -xi[centre] / 3.0
    theta = np.maximum(theta, 0.0)
    theta[-1] = 0.0
    mass = -rate * share**2 / slope
    mass_rate = theta**index * share**2 * end / slope
    return _Solution(
        end,
        slope,
        CubicHermiteSpline(share, theta, rate * end),
        CubicHermiteSpline(share, mass, mass_rate),
    )


@functools.cache
def _fundamental(index: float, gamma: float) -> tuple[float, np.ndarray]:
    """Return sigma^2 in units of G M/R^3 and the coefficients of the shape (see `Mode`).

    The shape makes sigma^2 of eq 247 stationary, so its coefficients are the first eigenvector of
    two symmetric matrices (Rayleigh-Ritz).
    """
    from scipy.linalg import eigh

    star = Polytrope(index)
    node, weight = np.polynomial.legendre.leggauss(100)
    angle = 0.25 * np.pi * (node + 1.0)
    x = np.sin(angle)  # close together at the surface, where powers of theta need not be smooth
    weight = weight * 0.25 * np.pi * np.cos(angle)
    density, pressure = star.density(x), star.pressure(x)
    weighted_pull = density * star.enclosed_mass(x) * x  # rho g x^3
    legendre = [np.polynomial.legendre.Legendre.basis(k) for k in range(TERMS)]
    shape = np.array([one(2.0 * x * x - 1.0) for one in legendre])
    slope = np.array([one.deriv()(2.0 * x * x - 1.0) * 4.0 * x for one in legendre])
    # einsum, since the threads of a matrix product take longer to start than it takes
    stiffness = np.einsum("kx,x,lx", slope, weight * gamma * pressure * x**4, slope)
    stiffness += np.einsum("kx,x,lx", shape, weight * (3.0 * gamma - 4.0) * weighted_pull, shape)
    inertia = np.einsum("kx,x,lx", shape, weight * density * x**4, shape)
    squared, vectors = eigh(stiffness, inertia, subset_by_index=[0, 0])
    return float(squared[0]), vectors[:, 0] / vectors[:, 0].sum()  # each polynomial is 1 at R
