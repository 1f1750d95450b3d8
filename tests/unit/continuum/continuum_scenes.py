"""Scenes of the continuum formulation for tests, and the laws of their materials written out."""

from dataclasses import dataclass
from typing import Any

import continuum
import numpy as np

from sph import config
from sph.config import physics
from sph.problems import base
from sph.scene import Scene
from sph.threads import Team

PERIODIC, MIRROR, OPEN = "periodic", "mirror", "open"

GAS = {"eos": {"name": "ideal_gas", "gamma": 1.4}}
WATER = {"eos": {"name": "tait", "rho_0": 1.2, "c_0": 1.5}}
ELASTIC = {
    "eos": {"name": "tait", "rho_0": 0.9, "c_0": 1.3},
    "strength": {"name": "elastic", "shear_modulus": 0.8},
}
PLASTIC = {
    "eos": {"name": "tait", "rho_0": 1.1, "c_0": 1.7},
    "strength": {"name": "elastic_plastic", "shear_modulus": 1.3, "yield_stress": 1.1},
}
JOHNSON_COOK = {
    "eos": {"name": "tait", "rho_0": 1.0, "c_0": 1.4},
    "strength": {
        "name": "johnson_cook", "shear_modulus": 0.9, "A": 0.2, "B": 0.5, "n": 0.4, "C": 0.1,
        "m": 0.8, "reference_rate": 0.5, "specific_heat": 1.0, "room_temperature": 0.5,
        "melting_temperature": 4.0,
    },
}  # fmt: skip


class EagerTeam(Team):
    """Hands over even a single block, which real teams find too little: N is small here."""

    def run(self, function, items, *arguments, smallest=1):
        return super().run(function, items, *arguments, smallest=1)


@dataclass(frozen=True)
class Case:
    """What is compiled in: order, materials, tensile correction, Balsara's factor, kernel."""

    boundaries: tuple[str, ...]
    order: int
    materials: tuple[dict, ...]
    tensile: float = 0.0
    balsara: bool = True
    kernel: str = "cubic_spline"
    thin: float = 1.0  # what is left of the last axis: supports are wider than it

    def __str__(self):
        parts = [f"{self.dimension}d", *self.boundaries, f"order {self.order}"]
        parts += [
            one.get("strength", one["eos"])["name"].replace("_", " ") for one in self.materials
        ]
        parts += ["tensile"] * (self.tensile > 0) + ["balsara"] * self.balsara
        parts += [self.kernel] * (self.kernel != "cubic_spline")
        parts += [f"thin {self.thin:g}"] * (self.thin != 1.0)
        return "-".join(parts)

    @property
    def dimension(self):
        return len(self.boundaries)

    @property
    def is_solid(self):
        return any("strength" in one for one in self.materials)

    @property
    def yields(self):
        return any(
            one.get("strength", {}).get("name", "elastic") != "elastic" for one in self.materials
        )

    @property
    def spacing_ratio(self):
        return (1.2, 1.1, 0.95)[self.dimension - 1]  # supports stay within the box

    @property
    def box(self):
        box = np.array([[0.0, 1.0], [-0.5, 0.5], [1.0, 2.25]])[: self.dimension]
        box[-1, 1] = box[-1, 0] + self.thin * (box[-1, 1] - box[-1, 0])
        return box

    @property
    def dense_scene(self):
        return continuum.Scene(
            self.box,
            self.boundaries,
            kernel=self.kernel,
            order=self.order,
            spacing_ratio=self.spacing_ratio,
            q_a=1.7,
            q_b=0.8,
            balsara=self.balsara,
            tensile=self.tensile if self.is_solid else 0.0,
        )


# --- the laws of the materials, written out ---


def pressure_of(material, density, energy):
    """(pressure, bulk sound speed, what round-off in the pressure is measured by)."""
    eos = material["eos"]
    if eos["name"] == "ideal_gas":
        p = (eos["gamma"] - 1) * density * energy
        return p, np.sqrt(eos["gamma"] * p / density), p
    c = eos["c_0"]
    return c**2 * (density - eos["rho_0"]), np.full(density.size, c), c**2 * density


def shear_modulus(material):
    return material.get("strength", {}).get("shear_modulus", 0.0)


def equivalent_stress(deviator):
    """(N,) sqrt(3/2 S : S), with the components along axes that the scene lacks.

    S_zz = -(S_xx + S_yy) in 2-D, S_yy = S_zz = -S_xx/2 in 1-D.
    """
    squares, missing = (deviator**2).sum(axis=(0, 1)), 3 - len(deviator)
    if missing:
        squares = squares + np.trace(deviator) ** 2 / missing
    return np.sqrt(1.5 * squares)


def yield_stress(strength, plastic_strain, rate, energy):
    """(N,) Y of perfect plasticity, or of Johnson & Cook (1983); inf without a yield stress."""
    if strength["name"] != "johnson_cook":
        return np.full(energy.size, strength.get("yield_stress", np.inf))
    s = strength
    warm = energy / s["specific_heat"] / (s["melting_temperature"] - s["room_temperature"])
    hardened = s["A"] + s["B"] * plastic_strain ** s["n"]
    by_rate = 1 + s["C"] * np.log(np.maximum(rate / s["reference_rate"], 1.0))
    return hardened * by_rate * (1 - np.clip(warm, 0, 1) ** s["m"])


def plastic_flow(strength, equivalent, plastic_strain, rate, energy):
    """(N,) increment x of the plastic strain: S_eq - 3 G x = Y(strain + x) where S_eq > Y."""
    low, high = np.zeros_like(equivalent), equivalent / (3 * strength["shear_modulus"])
    for _ in range(60):  # bisection, to the last bit
        x = 0.5 * (low + high)
        left = equivalent - 3 * strength["shear_modulus"] * x
        above = left > yield_stress(strength, plastic_strain + x, rate, energy)
        low, high = np.where(above, x, low), np.where(above, high, x)
    flows = equivalent > yield_stress(strength, plastic_strain, rate, energy)
    return np.where(flows, 0.5 * (low + high), 0.0)


def law_of(materials, index):
    """A `law` of `continuum.Body`; index (N,) of the particles' materials."""

    def law(density, energy, deviator, rate, plastic_strain):
        n = density.size
        pressure, sound, G, plastic = np.empty(n), np.empty(n), np.empty(n), np.zeros(n)
        equivalent = equivalent_stress(deviator)
        for k, one in enumerate(materials):
            its = index == k
            pressure[its], sound[its], _ = pressure_of(one, density[its], energy[its])
            G[its] = shear_modulus(one)
            if "strength" in one:
                plastic[its] = plastic_flow(
                    one["strength"], equivalent[its], plastic_strain[its], rate[its], energy[its]
                )
        factor = 1 - 3 * G * plastic / np.where(equivalent > 0, equivalent, 1.0)
        sound = np.sqrt(sound**2 + 4 / 3 * G / density)  # of longitudinal waves
        return continuum.Law(pressure, sound, G, factor * deviator, plastic)

    return law


class GivenMatter(base.Problem):
    """A problem whose initial state is handed in."""

    given: Any

    def initial(self, eos):
        return self.given


def scene_of(case, given, end):
    """The scene of a case, for a given initial state."""
    problem = GivenMatter(
        name="given",
        dimension=case.dimension,
        n=given.mass.size,
        domain=case.box.tolist(),
        boundary=list(case.boundaries),
        given=given,
    )
    laws = dict(case.materials[0])
    if len(case.materials) > 1:
        laws = {"materials": {f"m{k}": one for k, one in enumerate(case.materials)}}
    settings = physics.table("continuum")(
        formulation="continuum", **laws, kernel=case.kernel, correction=case.order,
        spacing_ratio=case.spacing_ratio,
        q_a=1.7, q_b=0.8, balsara=case.balsara, tensile_correction=case.tensile,
        max_energy_drift=1.0,  # particles move in disorder at half of c, which no step resolves
    )  # fmt: skip
    return Scene(
        config.Config(
            problem,
            settings,
            config.Time(end=end),
            config.Output(interval=end),
            config.Report(),
            config.Run(),
        )
    )
