"""Waves, vortices, an implosion and a contact against what is known of them."""

import numpy as np
import pytest

from sph.problems import base

SHIPPED = ["sound_wave", "sound_wave_2d", "gresho", "yee", "noh", "shu_osher", "blast_waves"]
NUMBERS = np.array([32, 64, 128, 256])


def order(numbers, errors) -> float:
    return -np.polyfit(np.log(numbers), np.log(errors), 1)[0]


@pytest.mark.slow
@pytest.mark.parametrize("stem", SHIPPED)
def test_shipped_configuration_keeps_limits_of_its_problem(run, stem):
    outcome = run(stem)
    figures = outcome.report() | {"energy_drift": outcome.energy_drift}
    limits: dict[str, base.Limit] = outcome.simulation.scene.config.problem.limits
    for name, limit in limits.items():
        assert limit.holds(figures[name]), (name, limit.reason)


# --- sound wave -------------------------------------------------------------------------------


def wave_reports(run, *overrides):
    return [run("sound_wave", f"problem.n={n}", *overrides).report() for n in NUMBERS]


@pytest.mark.parametrize("figure", ["error_velocity_relative", "error_density_relative"])
def test_sound_wave_1d_without_viscosity_converges_at_second_order(run, figure):
    errors = [report[figure] for report in wave_reports(run)]
    # Smoothing by the kernel and leapfrog are of second order. Viscosity, of first, is turned off
    # by the softening of Balsara's factor, which at this amplitude is far above the divergence.
    assert order(NUMBERS, errors) >= 1.8
    assert errors[-1] < 1e-3  # 0.00076 was measured


def test_sound_wave_1d_with_viscosity_converges_at_first_order(run):
    errors = [r["error_velocity_relative"] for r in wave_reports(run, "physics.balsara=false")]
    assert 0.8 < order(NUMBERS, errors) < 1.2
    damping = wave_reports(run, "physics.balsara=false")[-1]["wave_amplitude_error"]
    # bulk viscosity (alpha = 1) over a kernel's width damps 0.026 in a period, 0.00004 without
    assert -0.05 < damping < -0.01


@pytest.mark.slow
def test_sound_wave_2d_has_error_floor_that_falls_with_eta(run):
    def across(n_x, *overrides):
        keys = ("problem.dimension=2", f"problem.n={n_x * n_x // 8}", *overrides)
        return run("sound_wave", *keys).report()

    coarse, fine = across(64), across(128)
    # the sums over a square lattice are off by the same at every spacing: waves run 0.4 % too fast
    assert order([64, 128], [r["error_velocity_relative"] for r in (coarse, fine)]) < 0.5
    assert fine["phase_speed_error"] == pytest.approx(0.0040, abs=5e-4)
    wider = across(128, "physics.eta=2.4")
    assert abs(wider["phase_speed_error"]) < 0.5 * fine["phase_speed_error"]


def test_steepened_wave_matches_exact_solution(run):
    outcome = run("sound_wave", "problem.n=512", "problem.amplitude=0.1")
    report = outcome.report()
    # crests are 13 % faster than sound; a wave that kept its shape would be wrong by some 0.27
    assert report["error_velocity_relative"] < 0.03  # 0.016 was measured


# --- vortices ---------------------------------------------------------------------------------

DEFAULTS = ("physics.kernel=wendland_c2", "physics.eta=1.6", "physics.alpha=1.0")


@pytest.mark.slow
def test_vortex_shipped_settings_beat_defaults(run):
    good, plain = run("gresho").report(), run("gresho", *DEFAULTS).report()
    # 0.0263 and 0.0733 were measured
    assert good["error_v_phi"] < 0.031 < 0.06 < plain["error_v_phi"] < 0.09
    assert good["peak_v_phi"] > 0.85 > 0.75 > plain["peak_v_phi"]


@pytest.mark.slow
def test_vortex_with_bulk_velocity_has_no_larger_error(run):
    at_rest = run("gresho", "problem.n=1024").report()
    moving = run("gresho", "problem.n=1024", "problem.velocity=[1.0, 0.5]").report()
    # the scheme is Galilean invariant: differences are round-off, amplified by the flow's chaos
    assert moving["error_v_phi"] == pytest.approx(at_rest["error_v_phi"], rel=1e-3)


@pytest.mark.slow
def test_smooth_vortex_converges(run):
    errors = [run("yee", f"problem.n={n}").l1("velocity") for n in (1024, 4096)]
    # in the number along an axis. First order is what viscosity and the noise of particles that
    # left their lattice allow at fixed eta; 0.83 was measured
    assert order([32, 64], errors) > 0.7


# --- implosion --------------------------------------------------------------------------------


def test_planar_implosion_matches_independent_code(run):
    outcome = run("noh")
    report = outcome.report()
    # half a unit of the last digit it gives
    for name, value in (("density", 0.0169), ("pressure", 0.0052), ("velocity", 0.0070)):
        assert report[f"planar_norm_{name}"] == pytest.approx(value, abs=5e-5), name
    # that took 1033 with one output only, and each output cuts a step
    assert outcome.simulation.step == pytest.approx(1033, abs=5)
    assert report["shock_radius"] == pytest.approx(0.2, abs=0.005)  # two spacings of 0.01/4


def test_implosion_with_mirror_matches_whole_domain(run):
    half = run("noh").report()
    whole = run("noh", "problem.n=200", "problem.domain=[-1.0, 1.0]", "problem.boundary='open'")
    report = whole.report()
    for name in ("plateau_density_error", "plateau_pressure_error", "central_density_error"):
        # the same sums in another order: round-off amplified by the shock's oscillations
        assert report[name] == pytest.approx(half[name], abs=1e-4), name
    p = whole.particles
    # the loose end falls freely: cold gas expands at 0.004 at the most
    assert np.abs(p.position).max() == pytest.approx(0.4, abs=0.01)


def test_cylindrical_implosion_plateau_within_measured_error(run):
    keys = ("problem.n=1257", "problem.domain=[0.0, 1.0]", "problem.boundary='mirror'")
    report = run("noh_2d", *keys).report()
    assert report["plateau_density_exact"] == pytest.approx(16.0)
    # 40 particles to the radius: 10 % and 7 % too low were measured, 4 % and 2 % with 100
    assert -0.13 < report["plateau_density_error"] < 0.0
    assert -0.10 < report["plateau_pressure_error"] < 0.0
    assert report["shock_radius"] == pytest.approx(0.2, abs=0.02)


# --- contact ----------------------------------------------------------------------------------


def test_square_with_shipped_scheme_becomes_round(run):
    start = run("square", "problem.n=448", max_steps=0).report()
    assert start == {"squareness": 1.0, "dense_outside": 0.0}
    report = run("square", "problem.n=448", "time.end=4.0").report()
    # 0.06 was measured: all but a disc, whose caps beyond the square's sides hold 9.1 % of it and
    # which the gap that opens at its edge makes larger by half a row of 16
    assert report["squareness"] < 0.2
    assert 0.08 < report["dense_outside"] < 0.16


@pytest.mark.slow
def test_density_waves_behind_shock_within_measured_error(run):
    report = run("shu_osher", "problem.n=800").report()
    # Mach 3 into a mean density of 1: -4 + 1.8 x 3 x 1.18322 = 2.389, bent by the waves to 2.396
    assert report["shock_position"] == pytest.approx(2.396, abs=0.02)
    # 6400 particles converge to 0.449, as does a finite-volume code; 0.400 was measured with 800
    assert 0.38 < report["wave_density"] < 0.449
    finer = run("shu_osher").report()
    assert report["wave_density"] < finer["wave_density"] < 0.45
