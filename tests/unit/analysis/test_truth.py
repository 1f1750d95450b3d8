"""Where exact solutions hold: of every problem until when, where, and under which physics."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from sph import config, registry
from sph.analysis import errors, truth

PROBLEMS = registry.names("sph.problems")
# Until when the exact solution holds, worked out by hand, and a word of what ends it. Sod's shock
# runs at 1.75216 and sound at 1.18322 in the left gas and 1.05830 in the right (Toro 2009).
ENDS = {
    "walls": ("shock_tube", (), 0.5 / 1.75216, r"reaches the end at x = 0\.5"),
    "a periodic tube": (
        "shock_tube", ("problem.boundary=periodic",), 0.25 / 1.75216, "meets the wave from the end",
    ),
    "an open tube": (
        "shock_tube", ("problem.boundary=open",), 0.5 / (1.75216 + 1.05830), "meets the wave",
    ),
    # gas at -1 hits the lower wall, whose shock runs at Mach M, M^2 - 1.2 M/1.18322 - 1 = 0
    "a tube between walls that moves": (
        "shock_tube",
        ("problem.left.velocity=-1", "problem.right.velocity=-1"),
        0.5 / (1.62830 * 1.18322 + 1.18322), r"meets the wave from the end at x = -0\.5",
    ),
    "a tube that is open sideways": (
        "shock_tube", ("problem.dimension=2", "problem.boundary=['mirror', 'open']"), 0.0,
        "open ends along y",
    ),
    "open uniform gas": ("uniform", ("problem.boundary=open",), 0.5 / 1.18322, "along x meet"),
    "uniform gas open along y": (
        "uniform", ("problem.boundary=['periodic', 'open']",), 0.5 / 1.18322, "along y meet",
    ),
    # at the upper wall the same shock
    "uniform gas that runs into a wall": (
        "uniform", ("problem.boundary=mirror", "problem.velocity=1"),
        1.0 / (1.0 + 1.18322 - (1.0 - 1.62830 * 1.18322)), "along x meet",
    ),
    "noh": ("noh", (), 1.0 / (1.0 + 1.0 / 3.0), "outer end of the gas"),
    # 1.152 t^0.4, and the pressure behind 3/4 of the speed's square
    "the box of a blast": (
        "point_explosion", (), (0.5 / 1.152) ** 2.5, "nearest face of the domain",
    ),
    # sound in the background, at 0.0408, comes in from the faces until the shock reaches them
    "a blast in an open box": (
        "point_explosion", ("problem.background_pressure=1e-3", "problem.boundary=open"),
        ((0.5 - 0.04082 * (0.5 / 1.152) ** 2.5) / 1.152) ** 2.5, "nearest face",
    ),
    "a blast that weakens": (
        "point_explosion", ("problem.background_pressure=5",),
        (1e-3 * 0.75 * (0.4 * 1.152) ** 2 / 5.0) ** (1 / 1.2), "background_pressure",
    ),
    "shu_osher": ("shu_osher", (), 9.5 / (math.sqrt(1.4) * (3.0 + 1.25**0.5)), "from the end"),
    "sound_wave": ("sound_wave", ("problem.amplitude=0.1",), 1 / (0.1 * math.pi * 8 / 3), "breaks"),
    "evrard": ("evrard", (), 10.0, "computation of the reference"),
    # Us = 3600 + 1.8 * 500
    "flyer_plate": ("flyer_plate", (), 0.05 / 4500.0, "rear sides"),
    "elastic_plastic_shock": ("elastic_plastic_shock", (), 0.05 / 5176.5, "rear sides"),
    "keplerian_ring": ("keplerian_ring", (), 0.15 / math.sqrt(5e-6 / 3), "ring's edges"),
}  # fmt: skip
FOR_EVER = {
    "blast_waves", "blob", "bodies", "contrast", "elastic_bar", "expanding_ball", "file", "gresho",
    "hydrostatic_tank", "kelvin_helmholtz", "kelvin_helmholtz_smooth", "oscillating_plate",
    "particles", "polytrope", "rayleigh_taylor", "regions", "rotating_disc", "rubber_rings",
    "square", "taylor_bar", "uniform", "yee",
}  # fmt: skip


def made(problem: str, *overrides: str):
    return config.from_text(f'[problem]\nname = "{problem}"\n').override(overrides)


def at_start(what) -> SimpleNamespace:
    """The particles of a configuration at t = 0, with a density and a pressure of 1."""
    start = what.problem.initial(what.physics.eos_model())
    n = start.mass.size
    return SimpleNamespace(
        **start._replace(others={})._asdict(),
        density=np.ones(n),
        support=np.full(n, 0.1),
        id=np.arange(1, n + 1),
    )


def test_every_problem_states_end_of_exact_solution():
    assert {case[0] for case in ENDS.values()} | FOR_EVER == set(PROBLEMS)


@pytest.mark.parametrize("case", ENDS)
def test_exact_solution_available_until_its_end_only(case):
    problem, overrides, end, reason = ENDS[case]
    here = made(problem, *overrides)
    # the numbers above have four digits
    assert truth.departure(here, 0.999 * end) is None
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(truth.departure(here, 1.001 * end + 1e-9))
    small = made(problem, *overrides, "problem.n=400")
    particles = at_start(small)
    pressure = np.ones(particles.mass.size)
    assert errors.against_exact(small, 1.001 * end + 1e-9, particles, pressure) is None
    near = case == "a blast that weakens"  # 400 particles have none within its radius
    assert (errors.against_exact(small, 0.5 * end, particles, pressure) is None) == near


@pytest.mark.parametrize("problem", sorted(FOR_EVER))
def test_exact_solution_steady_never_ends(problem):
    assert truth.departure(made(problem), 1e4) is None


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize(
    "other",
    [
        {"external": {"name": "point_mass", "mass": 0.5}},
        {"heating": {"name": "relaxation", "energy": 1.0, "time": 0.1}},
    ],
    ids=lambda other: next(iter(other)),
)
def test_exact_solution_with_field_or_heating_is_missing(problem, other):
    small = () if problem in ("particles", "file") else ("problem.n=100",)
    plain = made(problem, *small)
    # set on the table itself: a configuration refuses a point mass in a periodic box
    physics = type(plain.physics)(**plain.physics.model_dump(exclude_none=True) | other)
    departed = dataclasses.replace(plain, physics=physics)
    particles = at_start(plain)
    pressure, history = np.ones(particles.mass.size), {}
    name = f"physics.{next(iter(other))}"
    assert truth.left_out(plain, 0.0, particles.position) in (
        None,
        "this problem has no exact solution",
    )
    why = truth.left_out(departed, 0.0, particles.position)
    assert (name in why) if plain.problem.has_exact else why == truth.NONE
    assert errors.against_exact(departed, 0.0, particles, pressure) is None
    # over_time would fail on a history without columns: it is not asked
    found = truth.figures(departed, 0.0, particles, pressure, history)
    eos = departed.physics.eos_model()
    assert found == departed.problem.report(eos, 0.0, particles, pressure)
    assert truth.theory(departed, np.array([0.0, 1.0])) == {}


@pytest.mark.parametrize("field", ["mass = 1.1", "mass = 1.0, softening = 0.01"])
def test_ring_exact_solution_needs_its_central_mass_only(field):
    other = made("keplerian_ring", f'physics.external={{ name = "point_mass", {field} }}')
    assert "point mass of 1" in truth.departure(other, 1.0)
    own = made("keplerian_ring", 'physics.external={ name = "point_mass", mass = 1.0 }')
    assert truth.departure(own, 1.0) is None


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_implosion_exact_solution_needs_cold_gas(dimension):
    # (gamma - 1)/2 4^D behind, and ahead of it p times 4^(5/3 (D - 1))
    limit = 1e-3 * 4.0**dimension / 3.0 / 4.0 ** (5 / 3 * (dimension - 1))
    cold, warm = (
        made("noh", f"problem.dimension={dimension}", f"problem.pressure={share * limit}")
        for share in (0.999, 1.001)
    )
    assert truth.departure(cold, 0.1) is None
    assert "cold gas" in truth.departure(warm, 0.1)


def test_implosion_after_end_has_whole_domain_as_error_region():
    noh = made("noh").problem
    x = np.array([[0.1, 0.9]])
    inside, words = noh.error_region(made("noh").physics.eos_model(), 1.2, x)
    assert inside.all()
    assert words == "the whole domain"


def test_error_region_excludes_waves_from_ends():
    tube = made("shock_tube", "problem.boundary=periodic")
    problem, eos = tube.problem, tube.physics.eos_model()
    x = np.linspace(-0.499, 0.499, 999)[None]
    # a shock from the lower end into the dense gas? no: its fan, whose head runs at 1.18322
    low, high = -0.5 + 0.118322, 0.5 - 0.175216
    inside, words = truth.region(problem, eos, 0.1, x)
    np.testing.assert_array_equal(inside, ((low < x) & (x < high))[0])
    assert words == "-0.3817 < x < 0.3248, where no wave from the domain's ends has arrived"
    ranged = made("shock_tube", "problem.boundary=periodic", "problem.error_range=[-0.2, 0.4]")
    inside, words = truth.region(ranged.problem, eos, 0.1, x)
    np.testing.assert_array_equal(inside, ((x > -0.2) & (x < high))[0])
    assert words.startswith("-0.2 < x < 0.4, within -0.3817 < x < 0.3248")
    quiet = made("shock_tube", "problem.boundary=periodic", "problem.error_range=[-0.2, 0.3]")
    assert truth.region(quiet.problem, eos, 0.1, x)[1] == "-0.2 < x < 0.3"


def test_tube_figures_exclude_waves_from_ends():
    tube = made("shock_tube", "problem.boundary=periodic", "problem.n=400")
    eos, start = tube.physics.eos_model(), at_start(tube)
    x = start.position[0]
    exact = tube.problem.exact(eos, 0.1, start.position)
    density = np.where((x > -0.3817) & (x < 0.3248), exact["density"], 9.0)
    for name, values in (("density", density), ("velocity", exact["velocity"])):
        setattr(start, name, values)
    found = truth.figures(tube, 0.1, start, exact["pressure"])
    assert found["density_L1_relative"] < 1e-14  # round-off
    assert found["peak_density"] == 9.0  # of the gas that there is


def test_uniform_gas_error_region_is_whole_domain():
    gas = made("uniform", "problem.boundary=['periodic', 'open']", "problem.velocity=[0.3, 0.5]")
    problem, eos = gas.problem, gas.physics.eos_model()
    low, high = 0.1 * (0.5 + 1.18322), 1.0 + 0.1 * (0.5 - 1.18322)
    np.testing.assert_allclose(
        problem.undisturbed(eos, 0.1), [[-np.inf, np.inf], [low, high]], rtol=1e-5
    )
    y = np.array([[0.5] * 4, [0.168, 0.169, 0.931, 0.932]])
    assert truth.region(problem, eos, 0.1, y)[0].tolist() == [False, True, True, False]
    assert truth.region(problem, eos, 0.0, y)[0].all()
    moving = made("uniform", "problem.velocity=[1e3, -2.0]")
    assert np.isinf(moving.problem.undisturbed(eos, 1e3)).all()


def test_wave_of_round_off_is_ignored():
    # the slow shock of the stress suite: its left wave, of 4e-4, would meet the end's at t = 0.258
    tube = made(
        "shock_tube", "problem.domain=[-1.0, 3.0]", "problem.boundary=open",
        "problem.left={ density = 3.86, velocity = -0.81, pressure = 10.33 }",
        "problem.right={ density = 1.0, velocity = -3.44, pressure = 1.0 }",
    )  # fmt: skip
    assert truth.departure(tube, 0.5) is None


@pytest.mark.parametrize("boundary", ["mirror", "periodic"])
def test_contact_alone_exact_solution_never_ends(boundary):
    tube = made("shock_tube", "problem.right.pressure=1.0", f"problem.boundary={boundary}")
    assert truth.departure(tube, 1e3) is None


@pytest.mark.parametrize("name", ["blast_waves", "shu_osher", "shock_tube"])
def test_finite_volume_solution_is_not_called_exact(name):
    made_config = made(name, "problem.n=100")
    state = at_start(made_config)
    found = errors.against_exact(made_config, 0.0, state, np.ones(state.mass.size))
    expected = "the exact solution" if name == "shock_tube" else "a finite-volume solution"
    assert found["against"] == expected


@pytest.mark.parametrize(
    ("time", "departs", "with_history", "asked"),
    [
        (0.5, None, True, ["report", "compare", "over_time"]),
        (0.5, None, False, ["report", "compare"]),
        (0.6, None, True, ["report", "over_time"]),  # the history began while theory held
        (0.5, "gravity", True, ["report"]),
    ],
)
def test_figures_requested_only_where_meaningful(time, departs, with_history, asked):
    problem = SimpleNamespace(
        departs=lambda physics: departs, exact_ends=lambda eos: (0.5, "it breaks"),
        report=lambda *given: {"report": given}, compare=lambda *given: {"compare": given},
        over_time=lambda *given: {"over_time": given},
    )  # fmt: skip
    physics = SimpleNamespace(eos_model=lambda: "eos")
    made_config = SimpleNamespace(problem=problem, physics=physics)
    history = {"t": np.array([0.0, time])} if with_history else None
    found = truth.figures(made_config, time, "particles", "pressure", history)
    assert list(found) == asked
    assert found["report"] == ("eos", time, "particles", "pressure")
    assert found.get("over_time", ("eos", history)) == ("eos", history)


def test_error_region_text_names_only_axes_with_ends():
    gas = made("uniform", "problem.boundary=['periodic', 'open']")
    inside, words = truth.region(
        gas.problem, gas.physics.eos_model(), 0.1, np.array([[0.5, 0.5], [0.5, 0.1]])
    )
    assert inside.tolist() == [True, False]
    assert words == "0.1183 < y < 0.8817, where no wave from the domain's ends has arrived"
