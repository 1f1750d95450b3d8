"""The calls of a step of a simulation, held in memory for the driver."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numba.extending import is_jitted

from sph import totals
from sph.integrators import leapfrog, step_size
from sph.neighbours import approach, search
from sph.part import IN_PYTHON, Part, Pass
from sph.scene import Scene
from sph.steps import driver
from sph.steps.calls import Held, Table, address, words_of

# The only arrays that a pass may exchange.
SWAPPED = ("support", "support_before")

# Phases besides those of passes; their order is that of `spent` in the driver.
PHASES = ("predict, correct", "step size, sums")
LEAPFROG, SUMS = range(2)


def suits(scene: Scene) -> bool:
    """Whether all that a step of a scene does is compiled."""
    functions: list = [one.function for one in scene.passes]
    functions += [f for part in scene.all_parts for one in part.evolved for f in one.rule]
    swaps = {one.swaps for one in scene.passes} - {None, SWAPPED}
    wideners = [one for one in scene.passes[1:] if one.widens]
    in_python = [name for part in scene.all_parts for name in in_python_of(part)]
    is_compiled = all(map(is_jitted, functions)) and not (swaps or wideners or in_python)
    return is_compiled and not scene.has_individual_steps


def in_python_of(part: Part) -> list[str]:
    """Return the names of the methods that Python must call in each step of this part."""
    own = [name for name in IN_PYTHON if getattr(type(part), name) is not getattr(Part, name)]
    return [name for name in own if name not in part.idle]


class Program:
    """The calls of a step, in their order in `Simulation.advance`, and their arguments.

    calls, places, words, numbers, momentum: arguments of `driver.take`; after_prediction: index of
    the first call after the prediction. Raises `Unsuitable` if a call cannot be held.
    """

    def __init__(self, simulation: Any, phases: list[str], fences: np.ndarray):
        self._simulation = simulation
        self._phases, self._fences = phases, fences
        self._table = Table()
        self._ends: list[tuple[int, bool, int]] = []  # of each call: action, swaps, phase
        neighbours = simulation.neighbours()
        self._kinds = self._present_kinds()
        self._held = self._present()
        self.momentum = np.empty(simulation.scene.dimension)
        self._dt = Held("dt", 0.0)
        self._all = (0, simulation.particles.number)  # the range of particles
        self._add_prediction()
        self.after_prediction = len(self._ends)
        lists = Held("neighbours", neighbours._replace(reach_factor=Held("reach", 1.0)))
        for one in simulation.scene.rate_passes:
            self._add_pass(one, lists)
        self._add_correction()
        for one in simulation.scene.last_passes:
            self._add_pass(one, lists)
        self._add_sums()
        self.words, calls = self._table.finished()
        self.numbers = self.words.view(np.float64)
        self.calls = np.hstack([calls, np.array(self._ends, np.int64)])
        self._places = self._table.places
        names = {driver.LENGTH: "dt", driver.REACH: "reach", driver.NEXT: "next_dt"}
        kinds = (*names.items(), *zip((driver.FIRST, driver.SECOND), SWAPPED, strict=True))
        found = [(kind, one) for kind, name in kinds for one in self._places.get(name, [])]
        self.places = np.array(found, np.int64)

    def fits(self) -> bool:
        """Whether the present lists have the types of those that the calls were made for."""
        return self._present_kinds() == self._kinds

    def refresh(self, has_new_lists: bool) -> None:
        """Make the words hold the present arrays."""
        if has_new_lists:
            neighbours = self._simulation.neighbours()
            self.words[self._places["superblocks"]] = neighbours.superblocks
            words = words_of(neighbours)
            for place in self._places["neighbours"]:
                self.words[place : place + len(words)] = words
        present = self._present()
        for name, array in present.items():
            if self._held[name] is not array and name in self._places:
                self.words[self._places[name]] = address(array)
        self._held = present

    def note_swap(self) -> None:
        """Note that the driver has exchanged the two arrays in the words."""
        first, second = SWAPPED
        held = self._held
        held[first], held[second] = held[second], held[first]

    def _present_kinds(self) -> list[tuple[np.dtype, bool]]:
        s = self._simulation
        arrays = _arrays_in((s.neighbours(), s.search.origin))
        return [(one.dtype, one.flags.c_contiguous) for one in arrays]

    def _present(self) -> dict[str, np.ndarray]:
        """Return the arrays that steps replace, by name."""
        s, p = self._simulation, self._simulation.particles
        found = {field.name: getattr(p, field.name) for field in p.fields}
        found["list_position"], found["list_support"], _ = s.search.origin
        found["boxes"] = s.search.boxes
        return found

    # --- the calls, in order

    def _add(self, action: int, function, *arguments, swaps: bool = False, phase: int = -1) -> None:
        self._table.add(function, *arguments)
        self._ends.append((action, swaps, phase))

    def _of(self, *names: str | None) -> list[Held | None]:
        """Return the arrays of fields, None for those that the scene lacks."""
        held = self._held
        return [Held(name, held[name]) if name in held else None for name in names]

    def _rows(self, *names: str) -> list[Held]:
        """Return the arrays of fields in the form of `State.rows`, which the rules take."""
        return [Held(name, self._simulation.particles.rows(name)) for name in names]

    def _add_prediction(self) -> None:
        moved = self._of("position", "velocity", "acceleration", "predicted_velocity")
        self._add(driver.NOTHING, leapfrog.move, *self._all, self._dt, *moved)
        (mass,) = self._of("mass")
        for one in self._simulation.evolved:
            value, rate, predicted = self._rows(one.value, one.rate, one.predicted)
            arrays = value, rate, mass, predicted
            self._add(driver.GIVES, one.rule.predict, *self._all, self._dt, *arrays)
        lists = self._of("position", "support", "list_position", "list_support", "boxes")
        blocks = self._simulation.sweep.wanted.size
        self._add(driver.MOVES, search.motion, 0, blocks, *lists, phase=LEAPFROG)

    def _add_pass(self, one: Pass, lists: Held) -> None:
        s = self._simulation
        phase, swaps = self._phases.index(one.phase), one.swaps is not None
        superblocks = Held("superblocks", lists.value.superblocks)
        models = s.sweep.models if one.models is None else one.models
        arguments = [0, superblocks, s.sweep.dim, models, lists, *self._of(*one.arrays)]
        arguments += [s.sweep.wanted] * one.widens + [self._dt] * one.takes_step
        if not one.widens:
            self._add(driver.NOTHING, one.function, *arguments, swaps=swaps, phase=phase)
            return
        self._add(driver.NOTHING, one.function, *arguments)
        wanted = s.sweep.wanted, *self._of("density")
        self._add(driver.FINDS, driver.found, *wanted, swaps=swaps, phase=phase)
        if s.scene.max_support < np.inf:
            self._add(driver.COUNTS, driver.count, *self._of("support"), s.scene.max_support)

    def _add_correction(self) -> None:
        (mass,) = self._of("mass")
        rules = [("velocity", "acceleration", leapfrog.straight_correct)]
        rules += [(one.value, one.rate, one.rule.correct) for one in self._simulation.evolved]
        for value, rate, rule in rules:
            arrays = *self._rows(value, rate), mass
            self._add(driver.GIVES, rule, *self._all, self._dt, *arrays, phase=LEAPFROG)

    def _add_sums(self) -> None:
        scene = self._simulation.scene
        bounds, domain, of = scene.step_bounds, scene.domain, self._of
        rates = of("acceleration", "energy_rate")
        self._add(
            driver.SUMS, totals.sums, *self._all,
            *of("mass", "velocity", "internal_energy", "density"), *rates, scene.keeps_momentum,
            self.momentum,
        )  # fmt: skip
        self._add(
            driver.BOUNDS, step_size.smallest, *self._all,
            *of("support", "signal_speed", "internal_energy", "energy_rate"),
            *of("acceleration" if bounds.acceleration else None, "id"), bounds.energy,
        )  # fmt: skip
        if "div_v" in self._held:
            arrays = of("div_v", "id")
            self._add(driver.DIVERGES, step_size.fastest_change, *self._all, *arrays)
        else:
            arrays = of("support", "support_before", "id")
            self._add(driver.CHANGES, step_size.largest_change, *self._all, *arrays)
        self._add(
            driver.MEETS, approach.served, *of("velocity", "acceleration", "support"),
            domain.images.sign, domain.longest_reach, Held("next_dt", 0.0), phase=SUMS,
        )  # fmt: skip
        if self._fences.size:
            self._add(driver.FENCES, driver.fenced, *of("position"), self._fences)


def _arrays_in(entries: tuple) -> Iterator[np.ndarray]:
    for one in entries:
        if isinstance(one, np.ndarray):
            yield one
        elif isinstance(one, tuple):
            yield from _arrays_in(one)
