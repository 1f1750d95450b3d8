"""Compiled steps: several time steps of a small scene in one call (`driver.take`).

A step of some hundred particles costs Python more time than arithmetic. Compiled steps serve scenes
whose passes run in the calling thread and whose parts do nothing in Python during a step. Other
scenes take one step after another by `Simulation.advance`, which has the same results.
"""

import ctypes
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from numba.extending import is_jitted

from sph import totals
from sph.clock import SHORTEST
from sph.errors import NumericalError
from sph.integrators import leapfrog, step_size
from sph.neighbours import search
from sph.neighbours.approach import first_contact
from sph.part import IN_PYTHON, Part
from sph.scene import Scene
from sph.steps import driver, rows
from sph.steps.calls import Held, Table, address, words_of

MOST = 512  # steps whose rows are kept as numbers

LONGEST = 0.05  # seconds after which `take` returns, so that stop signals are heeded

# Steps that a session takes before compiled ones, which take some ten milliseconds to set up.
ORDINARY = 10

# The only arrays that a pass may exchange, and the phases besides those of passes.
SWAPPED = ("support", "support_before")
PHASES = ("predict, correct", "step size, sums")


def suit(scene: Scene) -> bool:
    """Whether all that a step of a scene does is compiled."""
    functions = [one.function for one in scene.passes]
    functions += [f for part in scene.all_parts for one in part.evolved for f in one.rule]
    swaps = {one.swaps for one in scene.passes} - {None, SWAPPED}
    wideners = [one for one in scene.passes[1:] if one.widens]
    in_python = [name for part in scene.all_parts for name in in_python_of(part)]
    return all(map(is_jitted, functions)) and not (swaps or wideners or in_python)


def in_python_of(part: Part) -> list[str]:
    """Return the names of the methods that Python must call in each step of this part."""
    own = [name for name in IN_PYTHON if getattr(type(part), name) is not getattr(Part, name)]
    return [name for name in own if name not in part.idle]


class Steps:
    """The compiled steps of a simulation."""

    def __init__(self, simulation: Any):
        self._simulation = simulation
        self._suit = suit(simulation.scene)
        self.has_new_lists = True  # set by the simulation whenever it builds lists
        self._plan: driver.Plan = None  # type: ignore[assignment]  # made by `_prepare`
        self._held: dict[str, np.ndarray] = {}  # arrays whose addresses the words contain
        self._kinds: list[np.dtype] = []  # of the arrays in the lists
        self._momentum = np.empty(simulation.scene.dimension)
        self._fences = np.array(simulation.watchdog.fences, np.float64).reshape(-1, 3)
        self._table = np.empty((MOST, driver.MOMENTUM + simulation.scene.dimension))
        self._filled = 0  # rows of the table,
        self._first = 0  # the first of which is that of this step
        passes = [one.phase for one in simulation.scene.passes]
        self._phases = list(dict.fromkeys((*PHASES, *passes)))

    @property
    def may_begin(self) -> bool:
        """Whether the next step may be a compiled one."""
        s = self._simulation
        return self._suit and s.steps_here >= ORDINARY and not s.team.shares(s.sweep.wanted.size)

    def take(self, until: float, most: int) -> None:
        """Take up to `most` steps, which end at `until` or earlier. Raises NumericalError."""
        s = self._simulation
        most = min(most, s.watchdog.steps_to_mark(s.step))
        if self._filled + most > MOST:
            self.pour()
            most = min(most, MOST)
        now = np.array([s.time, s.limit.dt, s.energy_injected, s.held_supports, 0.0, 0.0, 0.0])
        begun, is_predicted, end = time.perf_counter(), False, self._filled + most
        while True:
            longest = LONGEST + begun - time.perf_counter()
            reason = self._call(until, now, end, is_predicted, longest)
            if reason != driver.STALE:
                break
            s.build_lists(float(now[driver.LENGTH]))
            now[driver.REACH] = s.search.reach_factor
            is_predicted = True
        if reason == driver.WIDER:
            s.complete(float(now[driver.LENGTH]), float(now[driver.UNTIL]))
            s.keep_row()

    def pour(self) -> None:
        """Append the rows of the steps since the last call to those of the simulation."""
        s = self._simulation
        if self._filled:
            table = self._table[: self._filled]
            s.rows.append(rows.of_table(s.scene, table, self._first))
            self._filled = 0

    def _call(self, until: float, now: np.ndarray, end: int, *options: Any) -> int:
        """Call the driver, and set the simulation to the state after it. Return the reason."""
        s, clock = self._simulation, self._simulation.clock
        wall, cpu = clock.wall, clock.cpu
        self._prepare()
        table = self._table[self._filled : end]
        spent = np.zeros(len(self._phases))
        is_predicted, longest = options
        reason, steps, swapped = driver.take(
            self._plan, self._bounds(until, longest), self._arrays(), self._words, self._numbers,
            now, table, spent, is_predicted,
        )  # fmt: skip
        if swapped:
            s.particles.swap(*SWAPPED)
            self._held |= {name: getattr(s.particles, name) for name in SWAPPED}
        s.energy_injected = float(now[driver.GIVEN])
        s.held_supports, s.search.reach_factor = int(now[driver.LIMITED]), float(now[driver.REACH])
        used = clock.cpu - cpu
        clock.divide(used, self._phases, spent)
        if steps:
            taken = table[:steps]
            share = used / max(clock.wall - wall, SHORTEST)
            taken[:, driver.CPU] = cpu + share * taken[:, driver.WALL]
            taken[:, driver.WALL] += wall
            self._end(taken, reason == driver.DOUBTFUL)
        return reason

    def _end(self, taken: np.ndarray, is_doubtful: bool) -> None:
        """Set the simulation to the end of steps, and check the last one. Raises NumericalError."""
        s, last = self._simulation, taken[-1].tolist()
        if not self._filled:
            self._first = s.step + 1
        self._filled += len(taken)
        s.time = last[driver.TIME]
        s.step += len(taken)
        s.steps_here += len(taken)
        kinetic, relative, internal, *others = last[driver.KINETIC : driver.RATES + 1]
        momentum = taken[-1, driver.MOMENTUM :].copy()
        s.totals = totals.Totals(kinetic, relative, internal, {}, momentum, *others)
        s.energy_drift = last[driver.DRIFT]
        s.limit = rows.limit_of(s.scene, last)
        try:
            if is_doubtful:
                s.watchdog.check(s)
                s.columns()
            else:
                s.watchdog.check_pace(s)
        except NumericalError:
            self._filled -= 1
            raise

    # --- what the driver is given ---

    def _bounds(self, until: float, longest: float) -> driver.Bounds:
        s = self._simulation
        scene, bounds = s.scene, s.scene.step_bounds
        return driver.Bounds(
            until=float(until),
            skin=float(s.search.origin.skin),
            courant=bounds.courant,
            end=bounds.end,
            max_support=scene.max_support,
            max_drift=s.watchdog.max_drift,
            baseline_energy=s.baseline.energy,
            baseline_scale=s.baseline.scale,
            added=s.energy_added,
            box_volume=scene.domain.volume if scene.is_filled else 0.0,
            step=s.step,
            longest=longest,
        )

    def _arrays(self) -> driver.Arrays:
        p, wanted = self._simulation.particles, self._simulation.sweep.wanted
        return driver.Arrays(
            wanted, p.density, p.position, self._momentum, p.support, p.support_before,
            self._fences,
        )  # fmt: skip

    def _prepare(self) -> None:
        """Make the words of the calls hold the present arrays."""
        s = self._simulation
        neighbours, held = s.neighbours(), self._present()
        kinds = [one.dtype for one in _arrays_in(neighbours)]
        if self._plan is None or kinds != self._kinds:
            self._build(neighbours, held)
        elif self.has_new_lists:
            words = words_of(neighbours)
            for place in self._places["neighbours"]:
                self._words[place : place + len(words)] = words
        for name, array in held.items():
            if self._held.get(name) is not array and name in self._places:
                self._words[self._places[name]] = address(array)
        self._held, self._kinds, self.has_new_lists = held, kinds, False

    def _present(self) -> dict[str, np.ndarray]:
        """Return the arrays that steps replace, by name."""
        s, p = self._simulation, self._simulation.particles
        found = {field.name: getattr(p, field.name) for field in p.fields}
        found["list_position"], found["list_support"], _ = s.search.origin
        return found

    def _build(self, neighbours, held: dict[str, np.ndarray]) -> None:
        s, scene, table = self._simulation, self._simulation.scene, Table()
        domain, bounds = scene.domain, scene.step_bounds
        blocks = s.sweep.wanted.size
        dt, next_dt = Held("dt", 0.0), Held("next_dt", 0.0)
        lists = Held("neighbours", neighbours._replace(reach_factor=Held("reach", 1.0)))

        def of(*names):
            return [Held(name, held[name]) if name in held else None for name in names]

        motion = ("position", "velocity", "acceleration")
        table.add(leapfrog._move, dt, *of(*motion, "predicted_velocity"))
        for one in s.evolved:
            table.add(one.rule.predict, dt, *of(one.value, one.rate, "mass", one.predicted))
        table.add(search._motion, *of("position", "support", "list_position", "list_support"))
        for one in scene.passes:
            extra = [s.sweep.wanted] * one.widens + [dt] * one.takes_step
            table.add(
                one.function, 0, blocks, s.sweep.dim, s.sweep.models, lists, *of(*one.arrays),
                *extra,
            )  # fmt: skip
        table.add(leapfrog._straight_correct, dt, *of("velocity", "acceleration", "mass"))
        for one in s.evolved:
            table.add(one.rule.correct, dt, *of(one.value, one.rate, "mass"))
        table.add(
            totals.sums,
            *of("mass", "velocity", "internal_energy", "density", "acceleration", "energy_rate"),
            scene.keeps_momentum, self._momentum,
        )  # fmt: skip
        acceleration = ["acceleration"] if bounds.acceleration else [None]
        table.add(
            step_size._smallest,
            *of("support", "signal_speed", "internal_energy", "energy_rate", *acceleration, "id"),
            bounds.energy,
        )
        if "div_v" in held:
            table.add(step_size._fastest_change, *of("div_v", "id"))
        else:
            table.add(step_size._largest_change, *of("support", "support_before", "id"))
        table.add(
            first_contact, *of(*motion, "support", "id"), domain.images, domain.longest_reach,
            next_dt, 2.0 / 3.0 * bounds.courant,
        )  # fmt: skip
        self._words, calls = table.finished()
        self._numbers = self._words.view(np.float64)
        self._places = table.places
        self._plan = self._plan_of(calls)

    def _plan_of(self, calls: np.ndarray) -> driver.Plan:
        passes, evolved = self._simulation.scene.passes, self._simulation.evolved

        def places(name):
            return np.array(self._places.get(name, []), np.int64)

        return driver.Plan(
            calls=calls,
            motion=1 + len(evolved),
            widens=passes[0].widens,
            swaps=np.array([one.swaps is not None for one in passes]),
            phases=np.array([self._phases.index(one.phase) for one in passes]),
            dt=places("dt"),
            reach=places("reach"),
            next_dt=places("next_dt"),
            first=places(SWAPPED[0]),
            second=places(SWAPPED[1]),
            has_divergence="div_v" in self._present(),
            clock=np.array([_clock_address(), time.CLOCK_MONOTONIC]),
        )


def _arrays_in(entries) -> Iterator[np.ndarray]:
    for one in entries:
        if isinstance(one, np.ndarray):
            yield one
        elif isinstance(one, tuple):
            yield from _arrays_in(one)


def _clock_address() -> int:
    return ctypes.cast(ctypes.CDLL(None).clock_gettime, ctypes.c_void_p).value
