"""Pictures: which are drawn, where they go, and that their axes hold the data they should."""

import shutil

import numpy as np
import pytest
from matplotlib.colors import LogNorm
from matplotlib.image import imread
from states import gas_state

from sph import config, kernels, registry
from sph.analysis import errors, figures
from sph.analysis.figures import history, maps, profiles, style
from sph.analysis.figures.sources import State, evenly, find_source, von_mises
from sph.analysis.figures.times import states_at
from sph.analysis.figures.view import View, figure
from sph.analysis.interpolate import with_cover
from sph.errors import ConfigError, FileError
from sph.output import checkpoint, frames
from sph.output.history import History
from sph.output.history import read as read_history
from sph.output.run_directory import RunDirectory
from sph.scene import Scene
from sph.state import State as Particles
from sph.totals import Baseline, Budget

SMALL = {"shock_tube": 60, "point_explosion": 512, "particles": 4, "file": 1024}
SETS = {
    1: {"profiles", "evolution", "history"},
    2: {"map", "evolution", "history"},
    3: {"slice", "evolution", "history"},
}


@pytest.fixture(autouse=True)
def low_resolution(monkeypatch):
    monkeypatch.setattr(style, "DPI", 40)
    monkeypatch.setattr(maps, "PIXELS", 48)
    monkeypatch.setattr(maps, "PIXELS_OF_MANY", 32)


def state_of(problem: str, *overrides: str, time: float | None = None) -> State:
    """The initial particles of a problem, on which an exact solution is laid where there is one."""
    made = config.from_text(f'[problem]\nname = "{problem}"\nn = {SMALL.get(problem, 400)}\n')
    made = made.override(overrides)
    time = made.time.end if time is None else time
    eos = made.physics.eos_model()
    start = made.problem.initial(eos)
    particles = gas_state(*start[:4])
    volume = np.prod(made.problem.box[:, 1] - made.problem.box[:, 0])
    wave = 1.0 + 0.3 * np.cos(2.0 * np.pi * particles.position[-1])
    particles.density[:] = particles.mass.sum() / volume * wave
    exact = made.problem.exact(eos, time, particles.position)
    if exact is not None:
        # a floor for the hollow middle of a blast
        particles.density[:] = np.maximum(exact["density"], 0.01)
        particles.velocity[:] = exact["velocity"]
        particles.internal_energy[:] = np.minimum(exact.get("internal_energy", 0.0), 1e3)
    D = made.problem.dimension
    ratio = kernels.support_ratio(made.physics.kernel_model(), D)
    is_solid = made.physics.formulation == "continuum"
    eta = made.physics.spacing_ratio if is_solid else made.physics.eta
    particles.support[:] = ratio * eta * (particles.mass / particles.density) ** (1 / D)
    particles.declare(Scene(made).fields)  # others that the scene has are zero
    if particles.get("initial_support") is not None:
        particles.initial_support[:] = particles.support
    return drawable(particles, made, time)


def drawable(particles: Particles, made, time: float) -> State:
    """The state of a checkpoint of these particles."""
    lists = {
        "list_position": particles.position.copy(),
        "list_support": particles.support.copy(),
        "list_skin": 0.1,
    }
    return State(
        checkpoint.Checkpoint(
            particles,
            time,
            step=3,
            next_step=0.1,
            **lists,
            config=made,
            lineage=(),
            budget=Budget(0.0, 0.0, Baseline(1.0, 1.0)),
        )
    )


def write_run(path, states) -> RunDirectory:
    """A run directory with those states as checkpoints and a history of as many steps."""
    run = RunDirectory.create(path)
    made = states[0].checkpoint.config
    run.write_config(made.to_toml())
    diagnostics = [made.problem.diagnostics(state.particles) for state in states]
    steps = History.create(run.history, made.problem.dimension, list(diagnostics[0]))
    for step, state in enumerate(states):
        row = dict.fromkeys(steps.columns, 1.0 + step) | diagnostics[step]
        row |= {"step": step, "t": state.time, "limiter": "signal_speed"}
        steps.extend({name: [value] for name, value in row.items()})
        checkpoint.write(run.checkpoint_path(step), state.checkpoint)
    steps.close()
    return run


@pytest.fixture
def tube(tmp_path):
    return write_run(tmp_path / "tube", [state_of("shock_tube", time=t) for t in (0.0, 0.1, 0.2)])


@pytest.fixture
def shear(tmp_path):
    return write_run(tmp_path / "shear", [state_of("kelvin_helmholtz", time=t) for t in (0.0, 0.5)])


def lines(panel) -> list[np.ndarray]:
    """(2, M) of each line, in the order drawn."""
    return [np.array(line.get_data()) for line in panel.get_lines()]


# --- sets of pictures -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("problem", registry.names("sph.problems"))
def test_run_of_every_problem_is_drawn(tmp_path, problem):
    states = [state_of(problem, time=0.0), state_of(problem)]
    run = write_run(tmp_path / "run", states)
    drawn = figures.draw([run.path])
    D, problem = states[0].dimension, states[0].problem
    has_profiles = D == 1 or (problem.profiled and (D == 3 or states[-1].may_have_exact))
    expected = SETS[D] | ({"profiles"} if has_profiles else set())
    assert {path.stem for path in drawn} == expected
    for path in drawn:
        assert path.parent == run.figures
        picture = imread(path)[..., :3]
        # about 7 inches at 40 dpi; the white of the paper is not all there is on it
        assert min(picture.shape[:2]) > 80
        assert 0.01 < (picture.min(axis=2) < 0.7).mean() < 0.99


def test_own_shapes_in_space_have_no_profiles_over_x(tmp_path):
    shape = (
        '{shape = "sphere", centre = [0.5, 0.5, 0.5], radius = 0.4, density = 1.0, pressure = 1.0}'
    )
    keys = ("problem.dimension=3", f"problem.region=[{shape}]", 'problem.boundary="open"')
    run = write_run(tmp_path / "ball", [state_of("regions", *keys, time=t) for t in (0.0, 0.1)])
    assert {path.stem for path in figures.draw([run.path])} == {"slice", "evolution", "history"}


@pytest.mark.slow
def test_several_runs_each_get_their_own_figures(tube, shear):
    drawn = figures.draw([tube.path, shear.path])
    assert {path.parent for path in drawn} == {tube.figures, shear.figures}


def test_checkpoint_in_run_gets_one_picture(tube):
    assert figures.draw([tube.checkpoint_path(1)]) == [tube.figures / "checkpoint_000001.png"]
    assert len(list(tube.figures.iterdir())) == 1


def test_checkpoint_without_run_is_drawn_next_to_file(tmp_path):
    path = tmp_path / "mine.h5"
    checkpoint.write(path, state_of("shock_tube").checkpoint)
    assert figures.draw([path]) == [tmp_path / "mine.png"]


@pytest.mark.parametrize(
    ("suffix", "beginning"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")]
)
def test_picture_suffix_selects_format(tube, tmp_path, suffix, beginning):
    target = tmp_path / f"picture.{suffix}"
    assert figures.draw([tube.path], target) == [target]
    assert target.read_bytes().startswith(beginning)
    assert not tube.figures.exists()


def test_several_sources_with_target_make_one_picture(tube, shear, tmp_path):
    for sources in ([tube.path, tube.checkpoint_path(1)], [shear.path, shear.checkpoint_path(0)]):
        assert figures.draw(sources, tmp_path / "both.png") == [tmp_path / "both.png"]


def test_evolution_spans_first_to_last_checkpoint(tube):
    source = find_source(tube.path)
    assert [state.time for state in source.over_time(6)] == [0.0, 0.1, 0.2]
    assert [state.time for state in source.over_time(2)] == [0.0, 0.2]
    assert source.last().time == 0.2


@pytest.mark.parametrize(
    ("count", "most", "expected"),
    [(1, 6, [0]), (6, 6, [0, 1, 2, 3, 4, 5]), (7, 6, [0, 2, 4, 6]), (11, 6, [0, 2, 4, 6, 8, 10]),
     (8, 6, [0, 1, 3, 5, 7])],
)  # fmt: skip
def test_evolution_is_evenly_spaced(count, most, expected):
    assert evenly(count, most) == expected


# --- errors -----------------------------------------------------------------------------------


def test_draw_missing_run_is_refused(messages, tmp_path):
    with messages.raised(FileError):
        figures.draw([tmp_path / "none"])


def test_draw_directory_without_run_is_refused(messages, tmp_path):
    with messages.raised(FileError):
        figures.draw([tmp_path])


def test_draw_run_without_checkpoints_is_refused(messages, tmp_path):
    run = RunDirectory.create(tmp_path / "run")
    with messages.raised(FileError):
        figures.draw([run.path])


def test_draw_unknown_suffix_is_refused_before_reading(messages, tmp_path):
    for name in ("picture.gif", "picture"):
        with messages.raised(ConfigError):
            figures.draw([tmp_path / "none"], tmp_path / name)


def test_draw_unwritable_target_is_refused(messages, tube, tmp_path):
    with messages.raised(FileError):
        figures.draw([tube.path], tmp_path / "nowhere" / "picture.png")


def test_draw_unwritable_figures_directory_is_refused(messages, tube):
    tube.figures.write_text("a file in its place")
    with messages.raised(FileError):
        figures.draw([tube.path])


def test_draw_maps_with_profiles_is_refused(messages, tube, shear, tmp_path):
    with messages.raised(ConfigError):
        figures.draw([tube.path, shear.path], tmp_path / "both.png")


# --- profiles ---------------------------------------------------------------------------------


def test_profiles_show_particles_exact_solution_and_error():
    state = state_of("shock_tube")
    state.particles.density[:] += 0.05
    picture = profiles.single(state)
    particles, exact = lines(picture.axes[0])
    np.testing.assert_array_equal(particles, [state.particles.position[0], state.particles.density])
    at = exact[0]
    np.testing.assert_array_equal(exact[1], state.exact(at[None])["density"])
    assert at[0] == state.particles.position[0].min()
    assert at[-1] == state.particles.position[0].max()
    norm = errors.against_exact(
        state.checkpoint.config, state.time, state.particles, state.checkpoint.pressure
    )["fields"]["density"]["L1"]
    assert norm == pytest.approx(0.05)
    assert "0.05" in picture.axes[0].get_legend().get_texts()[0].get_text()
    assert "0.2" in picture.get_suptitle()


def test_profiles_have_four_field_panels():
    state = state_of("shock_tube")
    shown = [lines(panel)[0][1] for panel in profiles.single(state).axes]
    p = state.particles
    expected = [p.density, p.velocity[0], state.checkpoint.pressure, p.internal_energy]
    for values, right in zip(shown, expected, strict=True):
        np.testing.assert_array_equal(values, right)


def test_profiles_limited_to_error_region():
    state = state_of("shock_tube", "problem.error_range=[-0.1, 0.3]")
    particles, exact = lines(profiles.single(state).axes[0])
    x = state.particles.position[0]
    assert particles.shape[1] == np.sum((x > -0.1) & (x < 0.3))
    assert exact[0].min() > -0.1
    assert exact[0].max() < 0.3


def test_profile_after_exact_solution_ends_has_no_line_and_gives_reason():
    picture = profiles.single(state_of("shock_tube", time=0.6))
    assert len(lines(picture.axes[0])) == 1
    said = " ".join(picture.get_suptitle().split())
    assert "without the exact solution: the exact solution ends at t = 0.2854" in said
    assert [text.get_text() for text in picture.legends[0].get_texts()] == ["SPH"]
    in_part = profiles.over_time([state_of("shock_tube", time=t) for t in (0.2, 0.6)])
    assert "in part without the exact solution" in in_part.get_suptitle()
    assert len(lines(in_part.axes[0])) == 3


def test_exact_line_ends_at_waves_from_domain_ends():
    state = state_of("shock_tube", "problem.boundary=periodic", time=0.1)
    _, (x, density) = lines(profiles.single(state).axes[0])
    # heads of the fan and the shock of the second discontinuity, at 1.18322 and 1.75216
    np.testing.assert_array_equal(np.isfinite(density), (x > -0.381678) & (x < 0.324784))


@pytest.mark.parametrize("problem", ["noh", "point_explosion"])
def test_profile_without_exact_solution_is_drawn(problem):
    state = state_of(problem, "problem.dimension=2", time=1.2)
    picture = figures.main_picture(state)
    assert "without the exact solution" in picture.get_suptitle()


def test_blast_profile_is_over_radius():
    state = state_of("point_explosion")
    offset = state.particles.position - state.problem.box.mean(axis=1)[:, None]
    state.particles.velocity[:] = 3.0 * offset
    found = profiles.profile(state)
    assert found.symbol == "r"
    # v_r = 3 r exactly but for the round-off of a scalar product
    np.testing.assert_allclose(found.fields["velocity"], 3.0 * found.coordinate, rtol=1e-13)
    inside, _ = state.problem.error_region(state.eos, state.time, state.particles.position)
    assert found.coordinate.size == inside.sum()


@pytest.mark.parametrize("time", [0.0, 0.05])
def test_profile_other_problems_not_radial(time):
    assert state_of("point_explosion", time=time).is_radial
    assert state_of("point_explosion", "problem.dimension=2", time=time).is_radial
    assert not state_of("point_explosion", "problem.dimension=1", time=time).is_radial
    assert not state_of("shock_tube", "problem.dimension=2", time=time).is_radial
    assert not state_of("uniform", time=time).is_radial
    assert state_of("gresho", time=time).is_radial
    assert not state_of("kelvin_helmholtz", time=time).is_radial


@pytest.mark.parametrize(
    ("problem", "keys"),
    [("gresho", ["problem.velocity=[0.5, -1.0]"]), ("yee", ["problem.velocity=[-2.0, 1.0]"]),
     ("keplerian_ring", [])],
)  # fmt: skip
def test_vortex_profile_is_rotation_about_centre_that_moves(problem, keys):
    state = state_of(problem, *keys, time=0.75)
    found = profiles.profile(state)
    assert state.problem.profiles == ("density", "v_phi", "v_r", "pressure")
    # round-off of differences of velocities and positions of order 1 to 10
    assert found.fields["v_r"] == pytest.approx(0.0, abs=1e-12)
    assert found.exact["v_r"] == pytest.approx(0.0, abs=1e-12)
    for name in ("v_phi", "density", "pressure"):
        # interpolation between 2000 points of the exact line, with kinks of the Gresho vortex
        exact = np.interp(found.coordinate, found.exact_coordinate, found.exact[name])
        assert found.fields[name] == pytest.approx(exact, rel=1e-3, abs=2e-3)
    assert np.ptp(found.fields["v_phi"]) > 0.1


def test_rotation_is_anticlockwise_and_less_drift():
    state = state_of("gresho", "problem.velocity=[0.5, -1.0]", time=0.5)
    position = state.particles.position
    # the centre has moved to (0.25, -0.5), at the end of the periodic box
    position[:, 0], position[:, 1] = [0.35, -0.5], [0.25, 0.4]
    state.particles.velocity[:, :2] = [[1.5, 0.75], [1.0, -0.5]]
    assert state.radius[:2] == pytest.approx([0.1, 0.1])
    assert state.scalar("v_r")[:2] == pytest.approx([1.0, -0.5])
    assert state.scalar("v_phi")[:2] == pytest.approx([2.0, 0.25])


def test_small_wave_is_drawn_less_its_mean():
    state = state_of("sound_wave")
    state.particles.density[:] *= 1.0025  # 2500 times the amplitude
    panel = profiles.single(state).axes[0]
    particles, exact = lines(panel)
    for values in (particles[1], exact[1]):
        assert np.abs(values).max() == pytest.approx(1e-6, rel=0.01)
    assert panel.get_ylim()[1] < 2e-6
    assert "less its mean" in panel.get_ylabel()
    assert "mean +0.25 %" in panel.get_legend().get_texts()[0].get_text()
    loud = profiles.single(state_of("sound_wave", "problem.amplitude=0.05")).axes[0]
    assert "mean" not in loud.get_ylabel()


def test_step_of_six_decades_is_logarithmic():
    state = state_of("contrast")
    exact = state.exact(state.particles.position)
    state.particles.density[:] = exact["density"]
    state.particles.internal_energy[:] = exact["internal_energy"]
    panels = profiles.single(state).axes
    assert [panel.get_yscale() for panel in panels] == ["log", "linear", "linear", "log"]


def test_evolution_of_round_problem_is_over_radius(tmp_path):
    run = write_run(tmp_path / "run", [state_of("gresho", time=t) for t in (0.0, 0.5)])
    source = find_source(run.path)
    pictures = dict(figures._pictures(source, run))
    assert pictures["evolution"].axes[0].get_shared_x_axes().joined(*pictures["evolution"].axes[:2])
    assert pictures["evolution"].axes[2].get_xlabel() == "distance from the centre $r$"


def test_exact_lines_of_evolution_have_colours_of_their_times():
    picture = profiles.over_time([state_of("shock_tube", time=t) for t in (0.1, 0.2)])
    first, second, *exact = picture.axes[0].get_lines()
    for dots, line in zip((first, second), exact, strict=True):
        assert line.get_color() == pytest.approx([0.6 * part for part in dots.get_color()[:3]])


def test_bins_contain_percentiles():
    # 10 x 101 particles; at each coordinate the values 0 ... 100, whose percentiles are themselves
    coordinate = np.repeat(np.arange(10.0), 101)
    values = np.tile(np.arange(101.0), 10)
    middle, percentiles = profiles.binned(coordinate, values)
    np.testing.assert_allclose(middle, np.arange(10.0), rtol=1e-15)
    np.testing.assert_allclose(percentiles, np.tile([[5.0], [50.0], [95.0]], 10), rtol=1e-15)


def test_compared_profiles_share_panel_with_one_label_each():
    states = [state_of("shock_tube", f"problem.n={n}") for n in (60, 90)]
    picture = profiles.compared(states, ["few", "many"])
    drawn = lines(picture.axes[2])[:2]
    for state, values in zip(states, drawn, strict=True):
        np.testing.assert_array_equal(values[1], state.checkpoint.pressure)
    assert [text.get_text() for text in picture.legends[0].get_texts()] == ["few", "many", "exact"]


def test_axis_logarithmic_only_for_peaks():
    blast = profiles.single(state_of("point_explosion")).axes
    assert [panel.get_yscale() for panel in blast] == ["linear", "linear", "linear", "log"]
    tube = profiles.single(state_of("shock_tube")).axes
    assert {panel.get_yscale() for panel in tube} == {"linear"}


# --- maps -------------------------------------------------------------------------------------


def test_map_shows_interpolated_fields():
    state = state_of("kelvin_helmholtz")
    plane = maps.plane_of(state, 48)
    speed = np.linalg.norm(state.particles.velocity, axis=0)
    values = np.stack([state.particles.density, speed])
    expected, cover = with_cover(values, state.particles, state.domain, state.kernel, plane)
    assert cover.min() > 0.5
    shown = [panel.images[0] for panel in maps.single(state).axes if panel.images]
    for image, values in zip(shown, expected, strict=True):
        np.testing.assert_array_equal(np.ma.getdata(image.get_array()), values)
        assert image.get_extent() == [-0.5, 0.5, -0.5, 0.5]
        assert image.axes.get_aspect() == 1.0


def test_map_shows_pressure_only_where_it_varies():
    assert maps.second_field(state_of("point_explosion")) == "pressure"
    assert maps.second_field(state_of("kelvin_helmholtz")) == "speed"


def solid_state(yields=True) -> State:
    """A disc of two halves of material 0 and 1 that almost touch, under known stress."""
    strength = 'name = "elastic_plastic", shear_modulus = 1.0, yield_stress = 1.0'
    if not yields:
        strength = 'name = "elastic", shear_modulus = 1.0'
    made = config.from_text(
        f"""
        [problem]
        name = "bodies"
        n = 400
        domain = [-1.5, 1.5]
        body = [
          {{ shape = "box", low = [-1.0, -0.5], high = [0.0, 0.5] }},
          {{ shape = "box", low = [0.0, -0.5], high = [1.0, 0.5] }},
        ]
        [physics]
        strength = {{ {strength} }}
        """
    )
    scene = Scene(made)
    particles = Particles.at_start(scene.fields, *scene.initial_state().particles)
    particles.density[:] = 1.0
    particles.support[:] = 2.4 * np.sqrt(particles.mass)
    particles.deviatoric_stress[0, 0] = 0.3
    particles.deviatoric_stress[1, 1] = -0.1
    return drawable(particles, made, 1.0)


@pytest.mark.parametrize(
    ("yields", "fields"), [(True, ["plastic strain", "von Mises"]), (False, ["von Mises", "press"])]
)
def test_map_of_solid_shows_strain_or_stress(yields, fields):
    state = solid_state(yields)
    if yields:
        state.particles.plastic_strain[0] = 1e-3
    panels = maps.single(state).axes[:2]
    for panel, field in zip(panels, fields, strict=True):
        assert panel.get_title().startswith(field)


def test_maps_of_solid_that_has_not_yielded_show_stress():
    states = [solid_state(yields=True) for _ in range(2)]
    assert maps.main_field(*states) == "von_mises"
    assert maps.second_field(states[0]) == "pressure"
    states[1].particles.plastic_strain[-1] = 1e-3
    assert maps.main_field(*states) == "plastic_strain"  # of all, in one scale of colours
    assert maps.main_field(states[1], solid_state(yields=False)) == "von_mises"  # which both have


@pytest.mark.parametrize(("end", "field"), [(0.0, "von Mises"), (1e-3, "plastic strain")])
def test_maps_at_several_times_show_one_field(end, field):
    states = [solid_state(yields=True) for _ in range(2)]
    states[1].particles.plastic_strain[:] = end
    pictures = [maps.compared(states, ["a", "b"]), figure(states, View())]
    for picture in pictures:
        assert picture.axes[-1].get_ylabel().startswith(field)


def test_map_of_solid_ends_at_its_surface_and_outlines_bodies():
    state = solid_state()
    panel = maps.single(state).axes[0]
    shown = panel.images[0].get_array()
    # S_zz = -0.2: the sum of squares is 0.14
    assert shown.compressed() == pytest.approx(np.full(shown.count(), np.sqrt(0.21)))
    left, right, bottom, top = panel.images[0].get_extent()
    area = shown.count() / shown.size * (right - left) * (top - bottom)
    # of the bodies 2: corners are rounded, and pixels 1/16 wide; 3.1 with all that kernels reach
    assert area == pytest.approx(2.0, abs=0.15)
    outlines = [one for one in panel.collections if len(one.get_paths()[0].vertices)]
    middle = [np.abs(one.get_paths()[0].vertices[:, 0]).min() for one in outlines]
    assert len(outlines) == 2  # one around each body
    assert middle == pytest.approx([0.0, 0.0], abs=0.05)


def outlines_on(panel) -> int:
    return len([one for one in panel.collections if len(one.get_paths()[0].vertices)])


def test_every_map_of_solids_outlines_bodies():
    state = solid_state()
    # one field alone, as in movies; and several times, as in evolution.png
    pictures = [figure([state], View("density")), maps.over_time([state, state], "von_mises")]
    for picture in pictures:
        panels = [panel for panel in picture.axes if panel.images]
        assert [outlines_on(panel) for panel in panels] == [2] * len(panels)
    # inside the left body no edge is seen
    assert outlines_on(figure([state], View(zoom=(-0.6, -0.4, -0.1, 0.1))).axes[0]) == 0


@pytest.mark.parametrize(
    ("stress", "expected"),
    # uniaxial stress s in 3-D; in 2-D and 1-D the other normal stresses keep S without trace
    [(np.diag([2.0, -1.0, -1.0]), 3.0), (np.diag([2.0, -1.0]), 3.0), (np.array([[2.0]]), 3.0),
     (np.array([[0.0, 1.0], [1.0, 0.0]]), np.sqrt(3.0))],
)  # fmt: skip
def test_equivalent_stress_has_all_normal_stresses(stress, expected):
    assert von_mises(stress[:, :, None]) == pytest.approx([expected])


def test_maps_over_time_share_colour_scale():
    states = [state_of("kelvin_helmholtz", time=t) for t in (0.0, 0.1, 0.2)]
    states[1].particles.density[:] *= 2.0
    images = [panel.images[0] for panel in maps.over_time(states, "density").axes if panel.images]
    assert len(images) == 3
    limits = {(image.norm.vmin, image.norm.vmax) for image in images}
    assert limits == {
        (min(image.get_array().min() for image in images),
         max(image.get_array().max() for image in images))
    }  # fmt: skip


def test_slice_passes_through_centre():
    state = state_of("point_explosion", "problem.domain=[[0, 1], [0, 1], [0, 3]]")
    assert maps.plane_of(state, 16).height == 1.5
    assert "$z$ = 1.5" in maps.single(state).get_suptitle()


def test_map_open_domain_includes_gas_outside():
    state = state_of("uniform", 'problem.boundary=["open", "periodic"]')
    state.particles.position[0] += 0.5
    plane = maps.plane_of(state, 16)
    margin = 0.5 * np.median(state.particles.support)
    # particles at 0.5 + 1/40 ... 1.5 - 1/40
    assert plane.low[0] == pytest.approx(0.525 - margin)
    assert plane.high[0] == pytest.approx(1.475 + margin)
    assert (plane.low[1], plane.high[1]) == (0.0, 1.0)


def test_evolution_in_one_frame_of_all_times():
    states = [state_of("expanding_ball", time=0.0) for _ in range(2)]
    states[1].particles.position[0] *= 2.0
    drawn = [
        panel.images[0].get_extent()
        for panel in maps.over_time(states, "density").axes
        if panel.images
    ]
    assert drawn[0] == drawn[1]
    own = [maps.plane_of(state, 16) for state in states]
    assert own[1].high[0] > own[0].high[0]
    assert drawn[0][1] == own[1].high[0]
    assert drawn[0][3] == own[0].high[1]


def test_maps_of_different_domains_each_have_numbers_on_axes():
    states = [state_of("uniform", f"problem.domain=[0.0, {end}]") for end in (1.0, 2.0)]
    right = maps.compared(states, ["a", "b"]).axes[1]
    assert right.yaxis.get_tick_params()["labelleft"]
    right = maps.compared([states[0], states[0]], ["a", "b"]).axes[1]
    assert not right.yaxis.get_tick_params()["labelleft"]


def test_map_fades_beyond_gas_in_open_domain_only():
    state = state_of("keplerian_ring")
    image = maps.single(state).axes[0].images[0]
    opacity, (nx, ny) = image.get_alpha(), maps.plane_of(state, 48).shape
    left, right, bottom, top = image.get_extent()
    x, y = np.meshgrid(
        left + (np.arange(nx) + 0.5) * (right - left) / nx,
        bottom + (np.arange(ny) + 0.5) * (top - bottom) / ny,
    )
    radius = np.hypot(x, y)
    # full in the ring of 0.5 to 1.5; gone at half a spacing of 0.125 beyond the kernels' middle
    assert (opacity[(radius > 0.55) & (radius < 1.45)] == 1.0).all()
    assert (opacity[(radius < 0.3) | (radius > 1.7)] == 0.0).all()
    assert ((opacity > 0.0) & (opacity < 1.0)).any()
    assert np.array_equal(np.ma.getmaskarray(image.get_array()), opacity == 0.0)
    assert maps.single(state_of("uniform")).axes[0].images[0].get_alpha() is None


def test_thin_domain_is_stretched_and_says_so():
    picture = maps.single(state_of("uniform", "problem.domain=[[0.0, 100.0], [0.0, 1.0]]"))
    assert "not to scale" in picture.get_suptitle()
    assert picture.axes[0].get_aspect() == pytest.approx(100.0 / maps.WIDEST_RATIO)


# --- options of maps ----------------------------------------------------------------------------


def test_view_sets_field_scale_and_part(shear):
    source = find_source(shear.path)
    lines = []
    states = states_at(source, [0.4, 0.1, 0.45], lines.append)
    assert [state.time for state in states] == [0.0, 0.5]
    assert len(lines) == 3
    view = View("pressure", (2.0, 3.0), True, (0.1, 0.4, 0.2, 0.4))
    images = [panel.images[0] for panel in figure(states, view).axes if panel.images]
    assert len(images) == 2
    for image, state in zip(images, states, strict=True):
        assert image.get_extent() == [0.1, 0.4, 0.2, 0.4]
        assert isinstance(image.norm, LogNorm)
        assert (image.norm.vmin, image.norm.vmax) == (2.0, 3.0)
        pressure = state.scalar("pressure")
        shown = np.ma.getdata(image.get_array())
        assert pressure.min() <= shown.min() < shown.max() <= pressure.max()


def test_views_draw_one_picture_each(shear, tube, tmp_path):
    assert figures.draw([shear.path], view=View("speed")) == [shear.figures / "map_of_speed.png"]
    assert figures.draw([tube.path], times=[0.1]) == [tube.figures / "profiles_at_times.png"]
    sizes = []
    for dpi in (40, 80):
        (path,) = figures.draw([shear.path], tmp_path / "a.png", View("density"), dpi=dpi)
        sizes.append(imread(path).shape[1])
    assert sizes[1] == pytest.approx(2 * sizes[0], abs=4)


@pytest.mark.parametrize(
    "view",
    [View("von_mises"), View(limits=(2.0, 1.0)), View(limits=(0.0, 1.0), is_log=True),
     View(zoom=(0.0, 1.0, 1.0, 0.0)), View(slice=(2, 0.5)), View(projection=0),
     View(is_log=True, is_linear=True)],
)  # fmt: skip
def test_view_that_cannot_be_drawn_is_refused(messages, shear, view):
    with messages.raised(ConfigError):
        figures.draw([shear.path], view=view)


def test_zoom_ends_at_closed_ends_of_domain(messages, shear):
    (state,) = [find_source(shear.path).last()]
    (low, high), (bottom, top) = state.problem.box
    side = high - low
    picture = figure([state], View(zoom=(high - 0.2 * side, high + side, bottom - 1.0, top)))
    extent = picture.axes[0].images[0].get_extent()
    assert extent == pytest.approx([high - 0.2 * side, high, bottom, top])
    # images of the particles beyond the domain are no data
    with messages.raised(ConfigError):
        figure([state], View(zoom=(high, high + side, bottom, top)))


def test_zoom_in_open_domain_may_show_vacuum_beside_particles(messages):
    state = state_of("keplerian_ring")
    view = View(zoom=(1.0, 9.0, -1.0, 1.0))
    assert figure([state], view).axes[0].images[0].get_extent() == [1.0, 9.0, -1.0, 1.0]
    with messages.raised(ConfigError):
        figure([state], View(zoom=(8.0, 9.0, -1.0, 1.0)))


@pytest.mark.parametrize(
    ("low", "high", "extend"),
    [(0.5, 3.0, "neither"), (1.5, 3.0, "min"), (0.5, 1.5, "max"), (1.4, 1.6, "both")],
)
@pytest.mark.parametrize("is_log", [False, True])
def test_colour_bar_has_arrow_where_it_cuts_values(shear, low, high, extend, is_log):
    state = find_source(shear.path).last()
    state.particles.density[:] = 1.5 + state.particles.position[0]  # x from -0.5 to 0.5
    picture = figure([state], View("density", (low, high), is_log))
    assert picture.axes[0].images[0].colorbar.extend == extend


def test_linear_scale_is_kept_where_it_would_be_logarithmic(shear):
    state = find_source(shear.path).last()
    state.particles.density[:] = 10.0 ** (4.0 * state.particles.position[0])
    norms = [
        figure([state], View(is_linear=is_linear)).axes[0].images[0].norm
        for is_linear in (False, True)
    ]
    assert [isinstance(norm, LogNorm) for norm in norms] == [True, False]
    assert norms[1].vmax == norms[0].vmax


def test_times_beyond_run_are_refused(messages, shear):
    lines = []
    for time in (0.6, -0.1):
        with messages.raised(ConfigError):
            figures.draw([shear.path], times=[time], say=lines.append)
    # 1 % of the run beyond its end is the end, which is said
    figures.draw([shear.path], times=[0.5, 0.504], say=lines.append)
    assert lines == ["--time 0.504: the nearest checkpoint or frame is that of t = 0.5"]
    with messages.raised(ConfigError):
        figures.draw([shear.checkpoint_path(0)], times=[0.5])


def test_time_finds_frames_between_checkpoints(shear):
    with shear.frames.held():
        for step, time in ((1, 0.1), (2, 0.2), (3, 0.5)):
            state = state_of("kelvin_helmholtz", time=time)
            path = shear.frames.path_of(step)
            frames.write(path, state.particles, state.scalar("pressure"), time, step)
    states = states_at(find_source(shear.path), [0.0, 0.14, 0.22, 0.5], lambda _line: None)
    assert [state.time for state in states] == [0.0, 0.1, 0.2, 0.5]
    kinds = [isinstance(state.checkpoint, frames.Frame) for state in states]
    assert kinds == [False, True, True, False]  # a checkpoint where both are as near


def test_map_of_line_is_refused(messages, tube):
    with messages.raised(ConfigError):
        figures.draw([tube.path], view=View("density"))


def test_logarithmic_scale_has_four_decades_unless_given():
    found = View(is_log=True).scale(1e-9, 2.0)
    assert (found.vmin, found.vmax) == (2e-4, 2.0)
    found = View(is_log=True).scale(0.1, 2.0)
    assert (found.vmin, found.vmax) == (0.1, 2.0)
    found = View(limits=(1e-9, 2.0), is_log=True).scale(0.1, 0.2)
    assert (found.vmin, found.vmax) == (1e-9, 2.0)


@pytest.fixture
def blast(tmp_path):
    return write_run(tmp_path / "blast", [state_of("point_explosion", time=t) for t in (0.1, 0.2)])


def test_slice_and_projection_have_the_other_two_axes(blast):
    state = find_source(blast.path).last()
    for view, x, y, where, label in (
        (View(slice=(0, 0.1)), "$y$", "$z$", "at $x$ = 0.1", r"density $\rho$"),
        (View(slice=(1, 0.1)), "$x$", "$z$", "at $y$ = 0.1", r"density $\rho$"),
        (View("speed", projection=2), "$x$", "$y$", "projected along $z$",
         r"speed $|\mathbf{v}|$, mean weighted by mass"),
        (View(projection=1), "$x$", "$z$", "projected along $y$", r"column density $\Sigma$"),
    ):  # fmt: skip
        picture = figure([state], view)
        assert (picture.axes[0].get_xlabel(), picture.axes[0].get_ylabel()) == (x, y)
        assert picture.get_suptitle().endswith(where)
        assert picture.axes[-1].get_ylabel() == label
    picture = figure([state], View(projection=2, zoom=(0.0, 0.2, 0.1, 0.2)))
    assert picture.axes[0].images[0].get_extent() == [0.0, 0.2, 0.1, 0.2]


def test_slices_show_other_values_at_other_places(blast):
    state = find_source(blast.path).last()
    state.particles.internal_energy[:] = 1.0 + state.particles.position[0]
    state.particles.density[:] = 1.0
    state.particles.support[:] = 0.25
    for x in (-0.2, 0.3):
        image = figure([state], View("internal_energy", slice=(0, x))).axes[0].images[0]
        # 8 particles a side: off the lattice by half a spacing of 1/8 at most
        np.testing.assert_allclose(np.ma.getdata(image.get_array()), 1.0 + x, atol=0.06)


def test_pictures_of_slices_have_names_of_their_own(blast):
    names = [
        figures.draw([blast.path], view=view)[0].name
        for view in (View(), View(slice=(0, 0.1)), View("speed", projection=1))
    ]
    assert names == ["map_of_density.png", "slice_x_of_density.png", "projection_y_of_speed.png"]


def test_slice_outside_open_domain_is_refused_with_range_of_particles(messages):
    state = state_of("expanding_ball", "problem.dimension=3", time=0.0)
    with messages.raised(ConfigError, "the range that particles reach"):
        figure([state], View(slice=(2, 50.0)))


def test_slice_outside_or_with_projection_is_refused(messages, blast):
    for view in (View(slice=(0, 7.0)), View(slice=(0, 0.0), projection=0)):
        with messages.raised(ConfigError):
            figures.draw([blast.path], view=view)


# --- history ----------------------------------------------------------------------------------


def test_history_figure_shows_drift_limiter_and_diagnostics(shear):
    found = read_history(shear.history)
    found["mode_amplitude"] = np.array([0.1, 1.3])
    found["energy_drift"] = np.array([0.0, 0.25])
    found["limiter"] = np.array(["signal_speed", "energy"], dtype=object)
    energies, drift, momentum, steps, mode = history.figure(found, "a run").axes
    assert len(energies.get_lines()) == 3
    np.testing.assert_array_equal(lines(drift)[0], [found["t"], [0.0, 0.25]])
    assert [line[1].tolist() for line in lines(momentum)] == [[0.0, 1.0]] * 2
    assert [text.get_text() for text in steps.get_legend().get_texts()] == [
        "by signal speed",
        "by energy",
    ]
    assert [line[0].tolist() for line in lines(steps)] == [[0.0], [0.5]]
    assert mode.get_yscale() == "log"
    np.testing.assert_array_equal(lines(mode)[0][1], found["mode_amplitude"])
    assert len(lines(mode)) == 1
    beside = {"mode_amplitude": np.array([0.1, 0.2])}
    *_, mode = history.figure(found, "a run", beside).axes
    np.testing.assert_array_equal(lines(mode)[1][1], beside["mode_amplitude"])


def test_history_figure_leaves_out_zeros_and_round_off_of_momentum(shear):
    found = read_history(shear.history)
    found["mode_amplitude"] = np.zeros(2)
    found["momentum_y"] = np.array([0.0, 1e-15])
    found["momentum_x"] = np.array([3.0, 3.0])
    picture = history.figure(found, "a run", mass=1.0)
    assert [panel.get_ylabel().split(" $")[0] for panel in picture.axes] == [
        "energy", "energy drift", "time step",
    ]  # fmt: skip
    assert r"within $1.00\times10^{-15}$" in picture.get_suptitle()
    found["momentum_y"] = np.array([0.0, 1e-9])
    picture = history.figure(found, "a run", mass=1.0)
    assert len(picture.axes) == 4
    assert "round-off" not in picture.get_suptitle()


def test_history_figure_names_constants_in_place_of_flat_panels(shear):
    found = read_history(shear.history)
    found["mode_amplitude"] = np.array([1.0, 2.0])
    found["volume_ratio"] = np.array([0.9975, 0.9975 * (1.0 + 1e-15)])
    found["held_supports"] = np.array([0.0, 0.0])
    picture = history.figure(found, "a run")
    labels = [panel.get_ylabel() for panel in picture.axes]
    assert not any("volume" in label or "held" in label for label in labels)
    assert (
        picture.get_suptitle() == "a run\n" + r"$\sum m/\rho$ over the volume is 0.998 throughout"
    )
    found["held_supports"] = np.array([0.0, 1.0])
    assert "held supports" in [panel.get_ylabel() for panel in history.figure(found, "a").axes]


def test_history_figure_draws_small_change_of_diagnostic(shear):
    found = read_history(shear.history)
    found["volume_ratio"] = np.array([0.9938, 0.9941])
    panel = history.figure(found, "a run").axes[-1]
    assert panel.get_ylabel().endswith("\nless 0.9938")
    assert lines(panel)[0][1] == pytest.approx([0.0, 0.0003])


def test_history_legends_cover_no_data(shear):
    picture = history.figure(read_history(shear.history), "a run")
    picture.draw_without_rendering()
    for panel in picture.axes:
        if legend := panel.get_legend():
            assert legend.get_window_extent().y0 >= panel.get_window_extent().y1 - 1.0


def test_history_figure_shows_gravitational_energy_and_theory_of_energies(shear):
    found = read_history(shear.history)
    found["gravitational_energy"] = np.array([-2.0, -3.0])
    found["mode_amplitude"] = np.array([1.0, 2.0])
    beside = {name: np.array([1.0, 2.0]) for name in ("kinetic_energy", "gravitational_energy")}
    panels = history.figure(found, "a run", beside).axes
    assert len(panels) == 5  # no panel of its own, unlike the mode's amplitude
    drawn = [line[1].tolist() for line in lines(panels[0])]
    assert drawn[3:] == [[-2.0, -3.0], [1.0, 2.0], [1.0, 2.0]]
    assert [text.get_text() for text in panels[0].get_legend().get_texts()] == [
        "total", "internal", "kinetic", "gravitational", "theory",
    ]  # fmt: skip


# --- style ------------------------------------------------------------------------------------


def test_colour_scale_covers_range_without_blowing_up_round_off():
    assert style.scale(np.array([1.0, np.nan, 3.0])).vmax == 3.0
    wide = style.scale(np.array([1e-9, 1.0]))
    assert wide.vmin == pytest.approx(10.0**-style.MOST_DECADES)
    # a dense cloud of 1 % of the pixels beside a wind of density 1
    cloud = np.concatenate([np.ones(99), [34.0]])
    assert style.scale(cloud).vmin == 1.0
    assert isinstance(style.scale(cloud), LogNorm)
    assert not isinstance(style.scale(np.linspace(1.0, 34.0)), LogNorm)
    # round-off of uniform gas is not blown up to the whole range of colours
    uniform = style.scale(np.array([1.0, 1.0 + 1e-12]))
    assert uniform.vmax - uniform.vmin > 0.1


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.004876, "0.00488"),
        (0.0, "0"),
        (3.1234e-5, r"$3.12\times10^{-5}$"),
        (2e4, r"$2.00\times10^{4}$"),
    ],
)
def test_axis_number_text(value, text):
    assert style.number(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.3, "0.3"), (4e-5, r"$4\times10^{-5}$"), (12430.0, r"$1.243\times10^{4}$")],
)
def test_time_text_has_no_e_notation(value, text):
    assert style.shortest(value) == text


def test_picture_target_link_is_refused(messages, tube, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    tube.figures.symlink_to(tmp_path / "elsewhere")
    with messages.raised(FileError):
        figures.draw([tube.path])
    assert not list((tmp_path / "elsewhere").iterdir())


def test_evolution_of_two_problems_is_refused(messages, tube, shear):
    shutil.copy(shear.checkpoint_path(0), tube.checkpoint_path(0))
    with messages.raised(FileError, "problem.name"):
        list(find_source(tube.path).over_time(6))
