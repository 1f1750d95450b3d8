"""The continuum engine against the dense transcription: every field, on every kind of scene.

Each case runs with lists built for the very state, with lists of an earlier state that are still
good, and with lists too small for the supports, so that they are widened on the way.
"""

from dataclasses import dataclass
from typing import Any

import continuum
import dense
import numpy as np
import pytest
from marks import slow_except

from sph import config, passes, simd
from sph.config import physics
from sph.domain import Domain
from sph.neighbours import order as ordering
from sph.neighbours.search import Origin, Search
from sph.problems import base
from sph.scene import Scene
from sph.state import State
from sph.threads import Team

# Of the sum of absolute pair terms, with the condition of order 1's matrix in it. Both sides do the
# same sums in another order.
ROUND_OFF = 1e-11
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
        return any(one.get("strength", {}).get("yield_stress") for one in self.materials)

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


CASES = [
    Case((OPEN,), 0, (GAS,)),
    Case((MIRROR,), 1, (ELASTIC,), tensile=0.3),
    Case((PERIODIC,), -1, (PLASTIC, WATER)),
    Case((OPEN, OPEN), 1, (PLASTIC,), tensile=0.3),
    Case((MIRROR, MIRROR), 0, (ELASTIC,), tensile=0.2),
    Case((MIRROR, OPEN), 1, (ELASTIC, PLASTIC)),
    Case((PERIODIC, MIRROR), 1, (WATER,), balsara=False),
    Case((PERIODIC, PERIODIC), -1, (ELASTIC,), tensile=0.3, balsara=False),
    Case((OPEN, MIRROR), 0, (GAS, WATER)),
    Case((OPEN, OPEN), 0, (GAS, PLASTIC), tensile=0.3, kernel="wendland_c2"),
    Case((MIRROR, PERIODIC), 0, (ELASTIC,), thin=0.05),
    Case((OPEN, OPEN, OPEN), 0, (ELASTIC,)),
    Case((MIRROR, MIRROR, MIRROR), 1, (PLASTIC,), tensile=0.3),
    Case((PERIODIC, MIRROR, OPEN), 1, (ELASTIC, WATER), balsara=False),
    Case((OPEN, PERIODIC, MIRROR), 0, (ELASTIC, PLASTIC), tensile=0.3),
    Case((MIRROR, OPEN, PERIODIC), -1, (GAS,)),
    Case((OPEN, OPEN, OPEN), 1, (GAS,), kernel="wendland_c2"),
    Case((MIRROR, PERIODIC, MIRROR), 1, (ELASTIC,), thin=0.1),
]
# Together, the cases without the mark `slow` have every order, three dimensions, every boundary,
# fluid and solid, two materials, and the tensile correction.
MARKED = slow_except({1, 2, 5, 14}, CASES)


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


def on_yield_surface(material, deviator):
    """(D, D, N) S scaled down so that sqrt(3/2 S : S) is at most Y, with the components along
    axes that the scene lacks: S_zz = -(S_xx + S_yy) in 2-D, S_yy = S_zz = -S_xx/2 in 1-D."""
    limit, missing = material.get("strength", {}).get("yield_stress"), 3 - len(deviator)
    if limit is None:
        return deviator
    squares = (deviator**2).sum(axis=(0, 1))
    if missing:
        squares = squares + np.trace(deviator) ** 2 / missing
    return deviator * np.minimum(1.0, limit / np.sqrt(1.5 * squares))


# --- particles ---


@dataclass
class Particles:
    """Matter in one memory order, with what lists are built from."""

    position: np.ndarray
    velocity: np.ndarray
    mass: np.ndarray
    density: np.ndarray
    energy: np.ndarray
    deviator: np.ndarray  # (D, D, N), not yet returned to the yield surface
    material: np.ndarray  # (N,) index
    initial_density: np.ndarray
    earlier: np.ndarray  # positions the lists are built from
    listed: np.ndarray  # supports likewise

    def ordered(self, order):
        return Particles(**{k: np.ascontiguousarray(a[..., order]) for k, a in vars(self).items()})


def scattered(box, count, random, beyond):
    """(D, count) positions crowded near a corner, some as far as `beyond` out of the box."""
    low, high = box.T[:, :, None]
    d = len(box)
    towards = random.uniform(-1, 1, (d, count))
    towards /= abs(towards).max(axis=0)
    radius = ((np.arange(count) + random.random(count)) / count) ** (1.6, 1.0, 0.7)[d - 1]
    centre = low + 0.2 * (high - low)
    position = centre + radius * np.where(towards < 0, centre - low, high - centre) * towards
    position += beyond * np.sign(towards) * radius
    if d > 1:  # in 1-D two in one place would alone have more mass than a support is to hold
        position[:, 4] = position[:, 3]
        position[0, 5] = low[0, 0]  # where a mirror puts the image too
    return position


def isolated(position, box):
    """Move one particle, and a pair, so far out of an open box that they meet no others."""
    size = np.ptp(box, axis=1)
    position[:, 10] = box[:, 1] + 3.0 * size
    position[:, 11] = box[:, 1] + 6.0 * size
    position[:, 12] = position[:, 11] + 0.01 * size
    return position


def random_matter(case, lists, seed=3):
    """Random particles with lists as asked for, and the skin of these."""
    random = np.random.default_rng(seed)
    d, count = case.dimension, (60, 150, 250)[case.dimension - 1]
    # between two builds particles may be past a wall that they will be brought back through
    position = scattered(case.box, count, random, beyond=0.02 if lists == "reused" else 0.0)
    mass = random.uniform(1, 1.3, count) / count
    spacing_ratio = case.spacing_ratio
    # densities whose supports follow the distance of neighbours, as evolved ones do
    kernel = dense.Scene(
        case.box,
        case.boundaries,
        kernel="cubic_spline",
        eta=2 * spacing_ratio / dense.H_PER_h["cubic_spline"][d - 1],
    )
    gas = position, np.zeros_like(position), mass, np.ones(count)
    density = dense.start(kernel, *gas).rates.density * random.uniform(0.93, 1.07, count)
    if set(case.boundaries) == {OPEN}:
        position = isolated(position, case.box)
    stress = random.normal(size=(d, d, count))
    material = random.integers(len(case.materials), size=count)
    stress = stress + stress.transpose(1, 0, 2)
    for index, one in enumerate(case.materials):
        if "strength" not in one:
            stress[:, :, material == index] = 0.0
    support = case.dense_scene.lengths(mass, density) * 2
    earlier, listed, skin = position, support, 0.2
    if lists == "reused":
        # 0.1 H of motion and 3 % of H from two particles leave a reach of 1.1 H at least
        shift = random.normal(size=position.shape)
        earlier = position + 0.1 * support * shift / np.linalg.norm(shift, axis=0)
        listed, skin = random.uniform(0.97, 1.03, count) * support, 0.32
    if lists == "widened":
        listed, skin = 0.9 * support, 0.01
    matter = Particles(
        position,
        random.normal(size=position.shape),
        mass,
        density,
        random.uniform(0.5, 2, count),
        stress,
        material,
        density * random.uniform(0.9, 1.1, count),
        earlier,
        listed,
    )
    return matter, skin


# --- the two sides ---


def expected_of(case, matter):
    """(rates of the transcription, further fields by name with their scales)."""
    n, d = matter.mass.size, case.dimension
    pressure, sound, scale, G = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    deviator = matter.deviator.copy()
    for index, one in enumerate(case.materials):
        its = matter.material == index
        pressure[its], sound[its], scale[its] = pressure_of(
            one, matter.density[its], matter.energy[its]
        )
        G[its] = shear_modulus(one)
        deviator[:, :, its] = on_yield_surface(one, deviator[:, :, its])
    sound = np.sqrt(sound**2 + 4 / 3 * G / matter.density)
    unit = np.eye(d)[:, :, None]
    stress = deviator - pressure * unit
    if not case.is_solid:
        stress = -pressure * unit
    rates = continuum.rates(
        case.dense_scene,
        continuum.Matter(
            matter.position,
            matter.velocity,
            matter.mass,
            matter.density,
            stress,
            sound,
            matter.initial_density,
        ),
    )
    L, L_scale = rates.velocity_gradient, rates.velocity_gradient_scale
    stress_scale = continuum.norm(deviator) + scale
    fields = {
        "support": (2 * case.dense_scene.lengths(matter.mass, matter.density), None),
        "pressure": (pressure, scale),
        "sound_speed": (sound, None),
        "predicted_stress": (deviator, stress_scale),
        "stress": (stress, stress_scale),
        # the antisymmetric part of the rate holds the spin
        "stress_rate": (
            continuum.deviatoric_rate(L, G) + continuum.spin(L),
            (1 + 4 * G) * L_scale,
        ),
        "tension": (continuum.tensile_stress(case.dense_scene, stress), stress_scale),
        "div_v": (rates.divergence, rates.divergence_scale),
        "kernel_factor": (rates.normalisation, rates.normalisation),
        "kernel_gradient": (rates.normalisation_slope, rates.normalisation_slope_scale),
    }
    if case.order == 1:
        back = rates.falls_back
        fields["kernel_gradient"] = (
            np.where(back, rates.normalisation_slope, 0.0),
            (rates.normalisation_slope_scale),
        )
        fields["kernel_matrix"] = (
            np.where(back, rates.normalisation * unit, rates.correction),
            np.where(back, rates.normalisation, rates.correction_scale),
        )
    for name in ("velocity_gradient", "density_rate", "balsara", "acceleration", "energy_rate",
                 "signal_speed"):  # fmt: skip
        fields[name] = getattr(rates, name), getattr(rates, f"{name}_scale")
    return rates, fields


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
        formulation="continuum", **laws, kernel=case.kernel, spacing_ratio=case.spacing_ratio,
        correction=case.order, q_a=1.7, q_b=0.8, balsara=case.balsara,
        tensile_correction=case.tensile,
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


def initial_state(case, matter):
    others = {"density": matter.initial_density, "material": matter.material.astype(float)}
    return base.InitialState(matter.position, matter.velocity, matter.mass, matter.energy, others)


def run_engine(case, matter, skin, threads, lanes=simd.DOUBLE):
    """(matter in block order, fields by name, number of widenings)."""
    team = EagerTeam(threads)
    search = Search(Domain(case.box, case.boundaries), team)
    count = matter.mass.size
    matter = matter.ordered(search.order(matter.earlier, np.arange(count)))
    identity = np.arange(count)
    search.build(Origin(matter.earlier, matter.listed, skin), identity)
    assert not search.stale(matter.position, matter.listed)
    given = initial_state(case, matter)
    scene = scene_of(case, given, 1.0)
    state = State.at_start(scene.fields, *given)
    scene.formulation.start(state)  # the initial lengths
    state.density[:] = state.predicted_density[:] = matter.density
    state.predicted_velocity[:] = matter.velocity
    state.predicted_energy[:] = matter.energy
    if case.is_solid:
        state.predicted_stress[:] = matter.deviator
    sweep = passes.Sweep(state, team, ordering.number_of_blocks(count), scene.formulation.models)
    sweep.wanted.fill(1.0)
    supports, *others = scene.rate_passes
    written = {name for one in scene.rate_passes for name in one.writes if name is not None}
    for name in written:  # what the passes forget to write is then seen
        getattr(state, name)[:] = np.nan
    widenings = -1
    while np.any(sweep.wanted != 0):
        if sweep.wanted.max() > 0:
            search.widen(sweep.wanted, identity)
        make(supports, sweep, search, lanes)
        widenings += 1
    for one in others:
        make(one, sweep, search, lanes)
    team.close()
    names = {*written, *(["predicted_stress"] * case.is_solid), "support"} - {"support_before"}
    return matter, {name: getattr(state, name) for name in names}, widenings


def make(one, sweep, search, lanes):
    sweep.neighbours = passes.Neighbours(
        search.lists, search.images, search.boxes, search.origin.support, search.reach_factor,
        lanes,
    )  # fmt: skip
    sweep.make(one)


@pytest.fixture
def eager_order(monkeypatch):
    """Let several threads share the ordering of a few particles."""
    monkeypatch.setattr(ordering, "SMALLEST_RANGE", 0)


@pytest.mark.usefixtures("eager_order")
@pytest.mark.parametrize("lists", ["fresh", "reused", "widened"])
@pytest.mark.parametrize("case", MARKED, ids=str)
def test_rates_match_dense_transcription(case, lists):
    random, skin = random_matter(case, lists)
    matter, found, widenings = run_engine(case, random, skin, threads=1)
    rates, expected = expected_of(case, matter)
    # the matter is what it is meant to be: supports vary, and lists too
    support = expected["support"][0]
    assert support.max() > 3 * support.min()
    assert case.thin == 1.0 or support.max() > 1.5 * np.diff(case.box).min()
    assert widenings in ((1, 2, 3) if lists == "widened" else (0,))
    if case.order == 1 and set(case.boundaries) == {OPEN}:
        # lone particles in every dimension, pairs in more than one
        assert rates.falls_back.sum() == (1 if case.dimension == 1 else 3)
    for name, values in found.items():
        true, scale = expected[name]
        scale = abs(true) if scale is None else scale
        error = abs(values - true)
        assert np.all(error <= ROUND_OFF * scale), (name, np.max(error / scale))


@pytest.mark.usefixtures("eager_order")
@pytest.mark.parametrize("lists", ["reused", "widened"])
@pytest.mark.parametrize("case", MARKED[1::4], ids=str)
def test_rates_two_threads_equal_one_bit_for_bit(case, lists):
    random, skin = random_matter(case, lists)
    _, one, _ = run_engine(case, random, skin, threads=1)
    _, two, _ = run_engine(case, random, skin, threads=2)
    for name, values in one.items():
        assert values.tobytes() == two[name].tobytes(), name
