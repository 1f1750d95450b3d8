"""Exact Riemann problem of an ideal or stiffened gas, vacuum included.

Reference: Toro, Riemann Solvers and Numerical Methods for Fluid Dynamics (2009), chapter 4.
Two half-spaces of gas meet at x = 0 at t = 0; the solution depends only on xi = x/t. From left to
right: undisturbed gas, a shock or rarefaction fan, star state, contact, star state, a shock or fan,
undisturbed gas. If the gases separate faster than they can expand, vacuum opens between them.

A state of density 0 (and pressure 0) is vacuum; pressure 0 at positive density is cold gas.

`eos` is an equation of state with `gamma` and `p_inf`. A stiffened gas is an ideal one in P + p_inf
(Menikoff & Plohr 1989, Rev. Mod. Phys. 61, 75). Private functions use that sum as pressure; in
public functions the lowest pressure, of cold gas or vacuum, is -p_inf.
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

# Relative change of pressure below which a wave is ignored: states rounded to three digits produce
# such waves (4e-4 in the slow shock of the stress suite), and round-off produces weaker ones.
FAINT = 1e-3


class Star(NamedTuple):
    """State between the outer waves. With `vacuum`, `velocity` is the mean of its two edges."""

    pressure: float
    velocity: float
    density_left: float
    density_right: float
    vacuum: bool


class WaveSpeeds(NamedTuple):
    """Velocities x/t of the waves, ascending. The star states are on both sides of `contact`.

    A fan extends from head to tail, which are equal for a shock. The tails are the edges of vacuum,
    if there is one.
    """

    left_head: float
    left_tail: float
    contact: float
    right_tail: float
    right_head: float


def star_state(left: State, right: State, eos) -> Star:
    """Return pressure, velocity and the two densities between the outer waves.

    Raises ValueError for an invalid state or gamma, or if both states are vacuum.
    """
    star = _star_state(*_as_ideal(left, right, eos), eos.gamma)
    return star._replace(pressure=star.pressure - eos.p_inf)


def wave_speeds(left: State, right: State, eos) -> WaveSpeeds:
    """Return the velocities of all waves. Raises ValueError as `star_state`."""
    left, right = _as_ideal(left, right, eos)
    return _wave_speeds(left, right, _star_state(left, right, eos.gamma), eos.gamma)


def reach(left: State, right: State, eos) -> tuple[float, float]:
    """Return x/t of the first and last change of state: a head, or the contact if a wave is FAINT.

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
    """Return density, velocity and pressure, each (N,), at `xi` (N,), x/t from the diaphragm.

    In vacuum the velocity is x/t limited to the two edges, which makes the profile continuous.
    Infinite `xi` gives the undisturbed states. Raises ValueError as `star_state`.
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
    """Return the states with pressure P + p_inf, those of an ideal gas, after checks."""
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
    # Two cold gases with equal velocity touch without vacuum: a contact at pressure 0.
    return parting > fastest or (parting == fastest and fastest > 0.0)


def _vacuum_edges(left: State, right: State, gamma: float) -> tuple[float, float]:
    """Return the velocities of the vacuum's edges (Toro section 4.6), equal if a side is vacuum."""
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
    """Return the velocities of head and tail of the left wave."""
    if state.density == 0.0:  # no wave: the edge of the gas on the other side
        return star.velocity, star.velocity
    if not star.vacuum and star.pressure >= state.pressure:
        shock = state.velocity - mass_flux(state, star.pressure, gamma) / state.density
        return shock, shock
    head = state.velocity - sound_speed(state, gamma)
    if star.density_left == 0.0:
        return head, state.velocity + escape_speed(state, gamma)
    tail = star.velocity - math.sqrt(gamma * star.pressure / star.density_left)
    return head, max(head, tail)  # round-off may reverse a fan of zero width


def _left_profile(state: State, star: Star, speed: WaveSpeeds, gamma: float, xi):
    """Return density, velocity, pressure left of the contact: state, fan (Toro eq 4.56), star."""
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
