"""Shock tubes against the exact Riemann solution."""

import numpy as np
import pytest

from sph.parts.viscosity import Viscosity

# An independent dense transcription of the equations gives .0048/.0123/.0055 at N = 400 with the
# walls at the lattice's own ends; the bounds leave 8 % for the set-up at the walls in density
# and pressure, and 26 % in velocity, the most sensitive to it.
SOD_400 = {"density": 0.0052, "velocity": 0.0155, "pressure": 0.0060}


@pytest.mark.parametrize("field", SOD_400)
def test_sod_error_within_limit(run, field):
    assert run("sod").l1(field) <= SOD_400[field]


def test_sod_converges_with_the_number_of_particles(run):
    numbers = np.array([100, 200, 400, 800])
    error = [run("sod", f"problem.n={n}").l1("density") for n in numbers]
    order = -np.polyfit(np.log(numbers), np.log(error), 1)[0]
    # First order is what a shock allows; the lattice error of the density sum (0.25 % at
    # eta = 1.6, see test_lattice_error.py) flattens it towards N = 1600.
    assert order >= 0.80


@pytest.mark.parametrize("stem", ["shock_tube", "strong_shock"])
def test_tube_plateaus_match_exact_star_states(run, stem):
    plateaus = {name: x for name, x in run(stem).report().items() if name.startswith("plateau")}
    assert len(plateaus) == 6
    for name, deviation in plateaus.items():
        # the medians miss the exact star states by the smoothing of shock and contact; a wrong
        # jump condition would show as 10 % and more
        assert abs(deviation) < 0.02, name


def test_strong_shock_density_peak_matches_published(run):
    # The scheme heats the contact too little and overshoots there: the published data of the
    # test and an independent transcription both give 6.30 where 6.00 is exact.
    assert run("strong_shock").report()["peak_density"] == pytest.approx(6.30, abs=0.03)


@pytest.mark.parametrize(
    ("stem", "bound"), [("sod", 1e-4), ("shock_tube", 1e-4), ("strong_shock", 1e-4)]
)
def test_tube_energy_drift_within_bound(run, stem, bound):
    # the transcription drifts by 1.0e-5 at C = 0.15; ten times that is still far below the error
    assert run(stem).energy_drift < bound


def test_courant_number_near_stability_limit_raises_energy_drift(run, monkeypatch):
    # The transcription's figures for 200 particles: 6.6e-3 at C = 0.3, 1.0e-5 at 0.15, 5.2e-6 at
    # 0.075. They agree to the digits given, so the step and its criteria are the same; 0.3 is more
    # than alpha = 2 bears, and is held at 0.207 here, which the transcription does not know.
    def drift(C):
        # as shipped, a run that drifts as without the bound stops at 0.005
        keys = ("problem.n=200", f"physics.C={C}", "physics.max_energy_drift=0.02")
        energies = run("shock_tube", *keys).energies
        return abs(energies[-1] / energies[0] - 1)

    assert drift(0.15) == pytest.approx(1.0e-5, rel=0.06)
    assert drift(0.075) == pytest.approx(5.2e-6, rel=0.06)
    assert drift(0.3) < 1e-4  # ten times that of 0.15 is still far below the error
    monkeypatch.setattr(Viscosity, "largest_courant", lambda part: (np.inf, ""))
    assert drift("0.30") == pytest.approx(6.6e-3, rel=0.02)  # another run: `run` keeps them by key


@pytest.mark.slow
def test_tube_3d_matches_tube_1d(run):
    """A coarse 3-D Sod tube, for its shape; the full one is in scripts/."""
    outcome = run("sod_3d", "problem.n=12348")  # half the cells along each axis
    # First order from the fine run's .0194: twice that, and 15 % for the coarse right side.
    assert outcome.l1("density") < 0.045
    p = outcome.particles
    across = np.abs(p.velocity[1:]).max()
    # nothing drives motion across the tube but the lattice's rearrangement behind the shock
    assert across < 0.2


def test_shock_into_stiffened_gas_matches_exact_solution(run):
    outcome = run("stiffened_tube", "problem.n=400")
    plateaus = {n: x for n, x in outcome.report().items() if n.startswith("plateau")}
    # 0.0005 at most was measured with 400 and with 1000 particles, 0.026 in pressure with the
    # default kernel: the density sum of a lattice is too high by so much less
    assert len(plateaus) == 6
    assert max(map(abs, plateaus.values())) < 0.002
    # the shock's width is some 10 of 400 spacings, and the error that of a part of it
    assert abs(outcome.report()["shock_right_error"]) < 0.01
    assert outcome.report()["density_L1_relative"] < 0.005
    assert outcome.energy_drift < 1e-5  # 5e-7 was measured
