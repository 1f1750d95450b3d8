"""Exact Riemann problem of an ideal or stiffened gas, vacuum included.

Reference: Toro, Riemann Solvers and Numerical Methods for Fluid Dynamics (2009), chapter 4.
Two half-spaces of gas meet at x = 0 when t = 0; everything after depends on xi = x/t only. From
left to right: undisturbed gas, a shock or a fan, star state, contact, star state, a shock or a fan,
undisturbed gas. Where the gases part faster than they can expand, vacuum opens in the middle.

A state of density 0 (and pressure 0) is vacuum; pressure 0 at a density above 0 is cold gas.

`eos` is an equation of state with `gamma` and `p_inf`. A stiffened gas is an ideal one in P + p_inf
(Menikoff & Plohr 1989, Rev. Mod. Phys. 61, 75): inside, pressure stands for that sum, and outside
its lowest value, cold gas or vacuum, is -p_inf.
"""

import math
from typing import NamedTuple

import numpy as np

from sph.exact.riemann_waves import (
    State,
    escape_speed,
    mass_flux,
    sound_speed,
    star_density,
    star_pressure,
    velocity_change,
)

# A wave that changes the pressure ahead by less than this part of it is none: states given in three
# digits leave such waves (4e-4 in the slow shock of the stress suite), and round-off weaker ones.
FAINT = 1e-3


class Star(NamedTuple):
    """Between the outer waves; with `vacuum`, `velocity` is the middle of the vacuum's edges."""

    pressure: float
    velocity: float
    density_left: float
    density_right: float
    vacuum: bool


class WaveSpeeds(NamedTuple):
    """x/t of every wave, ascending, so that the star states are the plateaus beside `contact`.

    A fan lies between head and tail, which are equal for a shock. Where there is vacuum (opened or
    given) the tails are its edges.
    """

    left_head: float
    left_tail: float
    contact: float
    right_tail: float
    right_head: float


def star_state(left: State, right: State, eos) -> Star:
    """Pressure, velocity and the two densities between the outer waves.

    Raises ValueError for a state or a gamma that is no gas, or where both states are vacuum.
    """
    star = _star_state(*_as_ideal(left, right, eos), eos.gamma)
    return star._replace(pressure=star.pressure - eos.p_inf)


def wave_speeds(left: State, right: State, eos) -> WaveSpeeds:
    """Speeds of both outer waves and the contact. Raises ValueError as `star_state`."""
    left, right = _as_ideal(left, right, eos)
    return _wave_speeds(left, right, _star_state(left, right, eos.gamma), eos.gamma)


def reach(left: State, right: State, eos) -> tuple[float, float]:
    """x/t of the first and the last change of state: a head, or the contact where a wave is FAINT.

    Raises ValueError as `star_state`.
    """
    star, speed = star_state(left, right, eos), wave_speeds(left, right, eos)
    first, last = (
        abs(star.pressure - state.pressure) > FAINT * abs(state.pressure + eos.p_inf)
        for state in (left, right)
    )
    return (
        speed.left_head if first else speed.contact,
        speed.right_head if last else speed.contact,
    )


def solve(left: State, right: State, eos, xi) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Density, velocity and pressure, each (N,), at `xi` (N,) = x/t counted from the diaphragm.

    In vacuum, where velocity has no meaning, it is x/t held between the two edges, which makes it
    continuous. Infinite `xi` gives the undisturbed states. Raises ValueError as `star_state`.
    """
    left, right = _as_ideal(left, right, eos)
    density, velocity, pressure = _solve(left, right, eos.gamma, np.asarray(xi, dtype=float))
    return density, velocity, pressure - eos.p_inf


def _star_state(left: State, right: State, gamma: float) -> Star:
    if _has_vacuum(left, right, gamma):
        edge_left, edge_right = _vacuum_edges(left, right, gamma)
        return Star(0.0, 0.5 * (edge_left + edge_right), 0.0, 0.0, True)
    pressure = star_pressure(left, right, gamma)
    f_left, _ = velocity_change(left, pressure, gamma)
    f_right, _ = velocity_change(right, pressure, gamma)
    return Star(
        pressure,
        0.5 * (left.velocity + right.velocity) + 0.5 * (f_right - f_left),  # Toro eq 4.9
        star_density(left, pressure, gamma),
        star_density(right, pressure, gamma),
        False,
    )


def _solve(left: State, right: State, gamma: float, xi):
    star = _star_state(left, right, gamma)
    speed = _wave_speeds(left, right, star, gamma)
    from_left = _left_profile(left, star, speed, gamma, xi)
    density, velocity, pressure = _left_profile(
        _mirrored(right), _mirrored_star(star), _mirrored_speeds(speed), gamma, -xi
    )
    is_left = xi < speed.contact
    density = np.where(is_left, from_left[0], density)
    velocity = np.where(is_left, from_left[1], -velocity)
    pressure = np.where(is_left, from_left[2], pressure)
    in_vacuum = np.clip(xi, speed.left_tail, speed.right_tail)
    return density, np.where(density == 0.0, in_vacuum, velocity), pressure


def _as_ideal(left: State, right: State, eos) -> tuple[State, State]:
    """The states of the ideal gas that this one is in P + p_inf, checked."""
    if not (math.isfinite(eos.gamma) and eos.gamma > 1.0):
        raise ValueError(f"gamma must be a finite number above 1, not {eos.gamma}")
    left, right = (s._replace(pressure=s.pressure + eos.p_inf) for s in (left, right))
    pressure = "P + p_inf" if eos.p_inf else "pressure"
    for side, state in (("left", left), ("right", right)):
        if not all(math.isfinite(value) for value in state):
            raise ValueError(f"the {side} state must be finite, not {tuple(state)}")
        if state.density < 0.0 or state.pressure < 0.0:
            raise ValueError(
                f"density and {pressure} of the {side} state must not be negative, "
                f"not {state.density} and {state.pressure}"
            )
        if state.density == 0.0 and state.pressure > 0.0:
            raise ValueError(f"the {side} state has {pressure} {state.pressure} without density")
    if left.density == 0.0 and right.density == 0.0:
        raise ValueError("both states are vacuum")
    return State(*map(float, left)), State(*map(float, right))


def _mirrored(state: State) -> State:
    return State(state.density, -state.velocity, state.pressure)


def _mirrored_star(star: Star) -> Star:
    return Star(star.pressure, -star.velocity, star.density_right, star.density_left, star.vacuum)


def _mirrored_speeds(speed: WaveSpeeds) -> WaveSpeeds:
    return WaveSpeeds(*(-value for value in reversed(speed)))


def _has_vacuum(left: State, right: State, gamma: float) -> bool:
    if left.density == 0.0 or right.density == 0.0:
        return True
    fastest = escape_speed(left, gamma) + escape_speed(right, gamma)
    parting = right.velocity - left.velocity
    # Two cold gases at rest to each other touch without a vacuum: a contact at pressure 0.
    return parting > fastest or (parting == fastest and fastest > 0.0)


def _vacuum_edges(left: State, right: State, gamma: float) -> tuple[float, float]:
    """Speeds of both edges of the vacuum (Toro section 4.6); equal if one state is vacuum."""
    if left.density == 0.0:
        return (right.velocity - escape_speed(right, gamma),) * 2
    edge_left = left.velocity + escape_speed(left, gamma)
    if right.density == 0.0:
        return edge_left, edge_left
    return edge_left, right.velocity - escape_speed(right, gamma)


def _wave_speeds(left: State, right: State, star: Star, gamma: float) -> WaveSpeeds:
    left_head, left_tail = _left_wave(left, star, gamma)
    right_head, right_tail = _left_wave(_mirrored(right), _mirrored_star(star), gamma)
    return WaveSpeeds(left_head, left_tail, star.velocity, -right_tail, -right_head)


def _left_wave(state: State, star: Star, gamma: float) -> tuple[float, float]:
    """Speeds of head and tail of the left wave (the right one is its mirror image)."""
    if state.density == 0.0:  # no wave: the edge of the gas on the other side
        return star.velocity, star.velocity
    if not star.vacuum and star.pressure >= state.pressure:
        shock = state.velocity - mass_flux(state, star.pressure, gamma) / state.density
        return shock, shock
    head = state.velocity - sound_speed(state, gamma)
    if star.density_left == 0.0:
        return head, state.velocity + escape_speed(state, gamma)
    tail = star.velocity - math.sqrt(gamma * star.pressure / star.density_left)
    return head, max(head, tail)  # a fan of no width may be turned over by round-off


def _left_profile(state: State, star: Star, speed: WaveSpeeds, gamma: float, xi):
    """Density, velocity, pressure left of the contact: state, fan (Toro eq 4.56), star state."""
    head, tail = speed.left_head, speed.left_tail
    at_star = (star.density_left, star.velocity, star.pressure)
    if head == tail:
        return tuple(np.where(xi < head, *pair) for pair in zip(state, at_star, strict=True))
    c = sound_speed(state, gamma)
    mach = (np.clip(xi, head, tail) - state.velocity) / c  # from -1 at the head
    ratio = np.maximum(0.0, (2.0 - (gamma - 1.0) * mach) / (gamma + 1.0))  # c / c_K
    fan = (
        state.density * ratio ** (2.0 / (gamma - 1.0)),
        state.velocity + 2.0 * c * (1.0 + mach) / (gamma + 1.0),
        state.pressure * ratio ** (2.0 * gamma / (gamma - 1.0)),
    )
    where = [xi <= head, xi < tail]
    return tuple(
        np.select(where, values[:2], values[2]) for values in zip(state, fan, at_star, strict=True)
    )
