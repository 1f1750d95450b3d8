"""Compiled steps: several time steps of a small scene in one call (`driver.take`).

A step of some hundred particles costs Python more time than arithmetic. Compiled steps serve scenes
of one chunk of particles, whose passes run in the calling thread, and whose parts do nothing in
Python during a step. Other scenes take one step after another by `Simulation.advance`, which has
the same results.
"""

import ctypes
import time
from typing import Any

import numpy as np

from sph import totals
from sph.clock import SHORTEST
from sph.errors import NumericalError
from sph.integrators import step_size
from sph.passes import SMALLEST
from sph.steps import driver, rows
from sph.steps.calls import Unsuitable
from sph.steps.program import PHASES, SWAPPED, Program, suits
from sph.threads import CHUNK

MOST = 512  # steps whose rows are kept as numbers

LONGEST = 0.05  # seconds after which `take` returns, so that stop signals are heeded

# Steps that a session takes before compiled ones, which take some ten milliseconds to set up.
ORDINARY = 10

CLOCK = np.array(
    [ctypes.cast(ctypes.CDLL(None).clock_gettime, ctypes.c_void_p).value, time.CLOCK_MONOTONIC],
    np.int64,
)


class Steps:
    """The compiled steps of a simulation."""

    def __init__(self, simulation: Any):
        scene, watchdog = simulation.scene, simulation.watchdog
        self.has_new_lists = True  # set by the simulation whenever it builds lists
        self._simulation = simulation
        self._suits = suits(scene)
        self._program: Program = None  # type: ignore[assignment]  # made before the first call
        self._fences = np.array(watchdog.fences, np.float64).reshape(-1, 3)
        self._phases = list(dict.fromkeys((*PHASES, *(one.phase for one in scene.passes))))
        self._table = np.empty((MOST, driver.MOMENTUM + scene.dimension))
        self._filled = 0  # rows of the table
        self._first = 0  # number of the step that has the first of these rows
        bounds = scene.step_bounds
        self._fixed = np.empty(driver.LONGEST + 1)
        self._fixed[driver.COURANT], self._fixed[driver.END] = bounds.courant, bounds.end
        self._fixed[driver.MAX_DRIFT] = watchdog.max_drift
        self._fixed[driver.LOWEST] = watchdog.lowest_energy
        self._fixed[driver.BOX] = scene.domain.volume if scene.is_filled else 0.0

    def may_begin(self) -> bool:
        """Return whether the next step may be a compiled one."""
        s = self._simulation
        if not self._suits or s.steps_here < ORDINARY:
            return False
        superblocks = s.search.lists.count.size
        if s.team.shares(superblocks, SMALLEST) or s.particles.number > CHUNK:
            return False
        try:
            self._prepare()
        except Unsuitable:
            self._suits = False
        return self._suits

    def take(self, until: float, most: int, pause: float) -> None:
        """Take up to `most` steps, which end at `until` or earlier. Raises NumericalError.

        The step that reaches `pause` is the last.
        """
        s = self._simulation
        most = min(most, s.watchdog.steps_to_mark(s.step))
        if self._filled + most > MOST:
            self.pour()
            most = min(most, MOST)
        now = np.array([s.time, s.limit.dt, s.energy_injected, s.held_supports, 0.0, 0.0, 0.0, 0.0])
        begun, first, end = time.perf_counter(), 0, self._filled + most
        while True:
            step = s.step
            self._fixed[driver.PAUSE] = pause
            self._fixed[driver.LONGEST] = LONGEST + begun - time.perf_counter()
            reason = self._call(until, now, end, first)
            if reason != driver.STALE:
                break
            s.renew_lists(float(now[driver.LENGTH]))
            now[driver.REACH] = s.search.reach_factor
            first = self._program.after_prediction
        if reason == driver.WIDER:
            if s.step > step or not first:
                s.renew_lists(float(now[driver.LENGTH]))  # counts widenings from here on
            s.complete(float(now[driver.LENGTH]), float(now[driver.UNTIL]))
            s.keep_row()

    def pour(self) -> None:
        """Append the rows of the steps since the last call to those of the simulation."""
        s = self._simulation
        if self._filled:
            table = self._table[: self._filled]
            s.rows.append(rows.of_table(s.scene, table, self._first))
            self._filled = 0

    def _call(self, until: float, now: np.ndarray, end: int, first: int) -> int:
        """Call the driver, and set the simulation to the state after it. Return the reason."""
        s, clock, fixed = self._simulation, self._simulation.clock, self._fixed
        wall, cpu = clock.wall, clock.cpu
        self._prepare()
        s.sweep.wanted.fill(1.0)
        fixed[driver.STOP], fixed[driver.SKIN], fixed[driver.STEP] = (
            until,
            s.search.origin.skin,
            s.step,
        )
        fixed[driver.BASE_ENERGY], fixed[driver.BASE_SCALE] = s.baseline
        fixed[driver.ADDED] = s.energy_added
        table, spent = self._table[self._filled : end], np.zeros(len(self._phases))
        held = self._program
        reason, steps, swapped = driver.take(
            held.calls, held.places, held.words, held.numbers, fixed, held.momentum, now, table,
            spent, CLOCK, first,
        )  # fmt: skip
        if swapped:
            s.particles.swap(*SWAPPED)
            held.note_swap()
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
        s, scene, last = self._simulation, self._simulation.scene, taken[-1].tolist()
        if not self._filled:
            self._first = s.step + 1
        self._filled += len(taken)
        s.time = last[driver.TIME]
        s.step += len(taken)
        s.steps_here += len(taken)
        s.updates_here += len(taken) * s.particles.number
        kinetic, relative, internal, *others = last[driver.KINETIC : driver.RATES + 1]
        momentum = taken[-1, driver.MOMENTUM :].copy()
        s.totals = totals.Totals(kinetic, relative, internal, {}, momentum, *others)
        s.energy_drift = last[driver.DRIFT]
        s.limit = rows.limit_of(scene, last)
        try:
            if is_doubtful:
                bounds, domain = scene.step_bounds, scene.domain
                s.limit = step_size.before_contact(s.limit, bounds, s.particles, domain)
                rows.set_limit(taken[-1], s.limit)
                s.watchdog.check(s)
                s.columns()
            else:
                s.watchdog.check_pace(s)
        except NumericalError:
            self._filled -= 1
            raise

    def _prepare(self) -> None:
        """Give the program the present arrays. Raises Unsuitable."""
        if self._program is None or (self.has_new_lists and not self._program.fits()):
            self._program = Program(self._simulation, self._phases, self._fences)
        else:
            self._program.refresh(self.has_new_lists)
        self.has_new_lists = False
