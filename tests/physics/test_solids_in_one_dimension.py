"""Shocks and waves in solids against exact solutions; the wave also in 2-D and 3-D."""

import numpy as np
import pytest

# g at order 0: gradients on a lattice are g times the true ones, and long waves run at g times
# their speed. Sums over an infinite lattice at 1.2 spacings (m/rho)^(1/D).
LATTICE = {"line": 1.0205, "square": 0.9910, "hexagonal": 1.0271, "space": 0.9809}


def expected(lattice: str, spacings: float) -> float:
    """The error of the wave speed at order 0, from that many particle spacings per wavelength.

    The second term is the error at order 1, from the width of the kernel: measured in 1-D.
    """
    return LATTICE[lattice] - 1.0 - 0.0036 * (50.0 / spacings) ** 2


def figures(outcome) -> dict[str, float]:
    """The figures of a run, with those of its history."""
    problem = outcome.simulation.scene.config.problem
    history = {
        name: np.array([row[name] for row in outcome.diagnostics])
        for name in outcome.diagnostics[0]
    }
    found = problem.over_time(
        outcome.simulation.scene.eos, history | {"t": np.array(outcome.times)}
    )
    return outcome.report() | found


def test_flyer_plate_matches_hugoniot(run):
    found = figures(run("flyer_plate", "problem.n=200"))
    # 3e-4, 1e-4, 6e-3 (heat at the plane of impact) and 6e-4 were measured with 200 particles
    assert found["shock_pressure"] == pytest.approx(1.76625e10, rel=1e-3)
    assert found["shock_density"] == pytest.approx(8831.25, rel=4e-4)
    assert found["shock_internal_energy"] == pytest.approx(1.25e5, rel=0.01)
    assert found["shock_speed"] == pytest.approx(4500.0, rel=2e-3)


def test_flyer_plate_conserves_energy(run):
    # twice what was measured, in the first steps, in which the plates meet
    assert run("flyer_plate", "problem.n=200", "physics.C=0.15").energy_drift < 1e-4


def test_density_behind_shock_does_not_depend_on_time_step(run):
    short, long = (
        run("flyer_plate", "problem.n=100", f"physics.C={C}").report()["shock_density_error"]
        for C in (0.1, 0.38)
    )
    # 4.454e-4 and 4.456e-4 were measured; 4.1e-4 and 3.1e-4 if the gradient is that at the end of
    # the step (without eq 416)
    assert long == pytest.approx(short, abs=1e-5)


def test_elastic_plastic_shock_has_precursor_and_plastic_front(run):
    found = figures(run("elastic_plastic_shock", "problem.n=400"))
    # 6e-3, 3e-4, 1e-3 and 4e-4 were measured with 400 particles; the plateau at the elastic limit
    # is then as wide as three times the fronts
    assert found["elastic_limit"] == pytest.approx(7.873e8, rel=0.015)
    assert found["precursor_speed"] == pytest.approx(5176.5, rel=2e-3)
    assert found["shock_speed"] == pytest.approx(3811.1, rel=3e-3)
    assert found["shock_stress"] == pytest.approx(3.1961e9, rel=1e-3)


def test_material_behind_plastic_front_is_at_yield_surface(run):
    particles = run("elastic_plastic_shock", "problem.n=400").particles
    deviator = -particles.deviatoric_stress[0, 0]
    # the radial return ends each step, so only round-off is left
    assert deviator.max() <= 4e8 * (1.0 + 1e-12)
    distance = np.abs(particles.position[0])
    behind = (distance > 0.005) & (distance < 0.02)  # at the plane of impact the stress overshot
    # oscillations behind the front unload by up to 0.7 % (measured), elastically
    assert deviator[behind].min() > 0.985 * 4e8
    # two thirds of the strain, less the elastic part Y/(3 G)
    plastic = 2.0 / 3.0 * np.log(8050.68 / 7850.0) - 6e8 / (3.0 * 8e10)
    # 4e-5 was measured
    assert np.median(particles.plastic_strain[behind]) == pytest.approx(plastic, rel=1e-3)


def test_wave_in_free_bar_has_speed_of_theory_at_order_1(run):
    coarse, fine = (
        figures(run("elastic_bar", f"problem.n={n}", "time.end=6e-4"))["wave_speed_error"]
        for n in (50, 100)
    )
    # -.0034 and -.0009 were measured: second order, from the width of the kernel
    assert abs(fine) < 0.0015
    assert coarse / fine == pytest.approx(4.0, abs=0.5)


def test_wave_without_viscosity_neither_decays_nor_gains_energy(run):
    outcome = run("elastic_bar", "physics.q_a=0", "physics.q_b=0", "physics.C=0.3")
    # 2e-7 of the amplitude in a radian; a fit of cosines has such errors
    assert abs(figures(outcome)["mode_damping"]) < 1e-6
    # 1.2e-3 was measured: 0.3 (w dt)^3 a radian, because velocities are predicted for the heating
    assert outcome.energy_drift < 1.5e-3


@pytest.mark.parametrize("n", [50, 100])
def test_wave_at_order_0_is_too_fast_by_error_of_gradients(run, n):
    found = figures(run("elastic_bar", f"problem.n={n}", "physics.correction=0", "time.end=6e-4"))
    assert found["wave_speed_error"] == pytest.approx(expected("line", n), abs=4e-4)


def test_wave_at_order_0_has_speed_of_theory_with_wide_kernel(run):
    found = figures(
        run(
            "elastic_bar", "problem.n=100", "physics.correction=0", "physics.spacing_ratio=2.0",
            "time.end=6e-4",
        )
    )  # fmt: skip
    assert abs(found["wave_speed_error"]) < 0.004  # 0.0026 was measured


@pytest.mark.parametrize(
    ("name", "dimension", "lattice", "n"),
    [
        ("square", 2, "cubic", 648),
        ("hexagonal", 2, "hexagonal", 648),
        ("space", 3, "cubic", 1728),
    ],
)
def test_wave_in_plane_and_space_is_off_by_error_of_gradients(run, name, dimension, lattice, n):
    found = figures(
        run(
            "elastic_bar", f"problem.dimension={dimension}", f"problem.lattice={lattice}",
            f"problem.n={n}", "physics.correction=0", "time.end=3.5e-4",
        )
    )  # fmt: skip
    spacings = (n * 8.0 ** (dimension - 1)) ** (1.0 / dimension)
    # -.0106, .0237 and -.0224 were measured; other lattices are off by 0.01 and more
    assert found["wave_speed_error"] == pytest.approx(expected(name, spacings), abs=2.5e-3)
