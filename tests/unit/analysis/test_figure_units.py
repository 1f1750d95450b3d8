"""Axes of figures have the physical units of the run, if it has some."""

import numpy as np
import pytest
from test_figures import low_resolution, state_of, write_run  # noqa: F401  (a fixture)

from sph import config, quantity
from sph.analysis.figures import history, maps, profiles, style
from sph.output.history import read

GALAXY = ("units.length=kpc", "units.mass=M_sun", "units.time=Myr")
LENGTH = r"[$\mathrm{kpc}$]"
DENSITY = r"[$M_\odot\,\mathrm{kpc}^{-3}$]"


def test_profile_has_units_on_both_axes():
    panels = profiles.single(state_of("shock_tube", *GALAXY)).axes
    assert panels[0].get_ylabel() == rf"density $\rho$ {DENSITY}"
    assert panels[1].get_ylabel() == r"velocity $v$ [$\mathrm{kpc}\,\mathrm{Myr}^{-1}$]"
    assert panels[2].get_xlabel() == f"$x$ {LENGTH}"


def test_profile_over_the_radius_has_units_of_both_velocities():
    panels = profiles.single(state_of("gresho", *GALAXY)).axes
    speed = r"[$\mathrm{kpc}\,\mathrm{Myr}^{-1}$]"
    assert panels[1].get_ylabel() == f"rotation velocity $v_\\phi$\n{speed}"
    assert panels[2].get_ylabel() == f"radial velocity $v_r$\n{speed}"
    assert panels[2].get_xlabel() == f"distance from the centre $r$ {LENGTH}"


def test_maps_have_units_of_fields_axes_and_time():
    states = [state_of("kelvin_helmholtz", *GALAXY, time=t) for t in (0.0, 0.5)]
    single = maps.single(states[1])
    assert single.axes[0].get_title().endswith(DENSITY)
    assert single.axes[0].get_ylabel() == f"$y$ {LENGTH}"
    assert single.get_suptitle().endswith("$t$ = 0.5 Myr")
    several = maps.over_time(states, "density")
    assert several.axes[-1].get_ylabel() == rf"density $\rho$ {DENSITY}"
    assert several.axes[0].get_ylabel() == f"$y$ {LENGTH}"


def test_history_has_units_of_its_columns(tmp_path):
    states = [state_of("kelvin_helmholtz", *GALAXY, time=t) for t in (0.0, 0.5)]
    run = write_run(tmp_path / "run", states)
    made = config.from_text(run.config.read_text())
    steps = read(run.history)
    steps["mode_amplitude"] = np.array([1.0, 2.0])
    panels = history.figure(steps, "a run", None, made).axes
    energy = r"[$M_\odot\,\mathrm{kpc}^{2}\,\mathrm{Myr}^{-2}$]"
    assert panels[0].get_ylabel() == f"energy $E$ {energy}"
    assert panels[1].get_ylabel() == "energy drift"
    assert panels[3].get_ylabel() == r"time step $\Delta t$ [$\mathrm{Myr}$]"
    assert panels[4].get_ylabel() == r"mode amplitude [$\mathrm{kpc}\,\mathrm{Myr}^{-1}$]"
    assert panels[4].get_xlabel() == r"time $t$ [$\mathrm{Myr}$]"


def test_figures_without_units_have_plain_axes(tmp_path):
    states = [state_of("kelvin_helmholtz", time=t) for t in (0.0, 0.5)]
    found = maps.single(states[1])
    run = write_run(tmp_path / "run", states)
    config_of = states[0].checkpoint.config
    found_history = history.figure(read(run.history), "a run", None, config_of)
    for figure in (found, found_history, profiles.single(state_of("shock_tube"))):
        texts = [
            panel.get_xlabel() + panel.get_ylabel() + panel.get_title() for panel in figure.axes
        ]
        assert not any("[" in text for text in texts)


@pytest.mark.parametrize("name", ["M_sun", "um", "R_earth", "h"])
def test_labels_can_be_drawn(name):
    """Matplotlib refuses wrong mathematics when a figure is drawn."""
    length = name if name in ("um", "R_earth") else 2.5e10
    mass = name if name == "M_sun" else "kg"
    time = name if name == "h" else "s"
    table = f"[units]\nlength = {length!r}\nmass = {mass!r}\ntime = {time!r}\n"
    units = config.from_text(f'[problem]\nname = "noh"\n{table}').units
    figure = style.new_figure(1.0, 1.0)
    label = style.labelled("$P$", quantity.PRESSURE, units)
    figure.text(0.0, 0.0, label)
    figure.canvas.draw()
    assert label.startswith("$P$ [$")
    assert np.count_nonzero([part in label for part in ("{-1}", "{-2}")]) == 2


@pytest.mark.parametrize("problem", ["shock_tube", "gresho"])
def test_labels_are_shorter_than_their_panels(tmp_path, problem):
    state = state_of(problem, *GALAXY)
    made = state.checkpoint.config
    run = write_run(tmp_path / "run", [state_of(problem, *GALAXY, time=t) for t in (0.0, 0.5)])
    steps = read(run.history)
    steps["momentum_x"] = np.linspace(0.0, 1.0, steps["t"].size)
    with style.paper():
        for figure in (profiles.single(state), history.figure(steps, "a run", None, made, 1.0)):
            figure.canvas.draw()
            for panel in figure.axes:
                label = panel.yaxis.get_label()
                assert label.get_window_extent().height <= panel.bbox.height, label.get_text()


def test_titles_have_units(tmp_path):
    states = [state_of("point_explosion", *GALAXY, time=t) for t in (0.1, 0.2)]
    assert maps.single(states[0]).get_suptitle().endswith("at $z$ = 0 kpc")
    made = states[0].checkpoint.config
    steps = read(write_run(tmp_path / "run", states).history)
    for axis in "xyz":
        steps[f"momentum_{axis}"][:] = 0.0
    unit = r"$M_\odot\,\mathrm{kpc}\,\mathrm{Myr}^{-1}$"
    title = history.figure(steps, "a run", None, made, 1e9).get_suptitle()
    assert "conserved to round-off" in title
    assert title.endswith(unit)
