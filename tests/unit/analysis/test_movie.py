"""Movies: frames of one size and one scale of colours, in order, and clear refusals."""

import sys

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image, ImageSequence
from test_figures import low_resolution, state_of, tube, write_run  # noqa: F401 - fixtures

from sph import progress
from sph.analysis.figures import movie, profile_axes, profiles
from sph.analysis.figures.sources import find_source
from sph.analysis.figures.view import View
from sph.cli import main
from sph.errors import ConfigError, FileError
from sph.output import frames


@pytest.fixture
def growing(tmp_path):
    """Three checkpoints; the second is twice as dense."""
    states = [state_of("kelvin_helmholtz", time=t) for t in (0.0, 0.1, 0.2)]
    states[1].particles.density[:] *= 2.0
    return write_run(tmp_path / "shear", states)


def test_gif_has_frame_of_same_size_for_each_checkpoint(growing):
    path = movie.make(growing.path, None, View(), per_second=5, dpi=40)
    assert path == growing.figures / "movie.gif"
    with Image.open(path) as image:
        frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(image)]
        assert image.info["duration"] == 200
    assert len(frames) == 3
    assert len({frame.size for frame in frames}) == 1
    assert all(side % 2 == 0 for side in frames[0].size)
    first, second, third = (np.asarray(frame, dtype=float) for frame in frames)
    # first and third show one state: they differ by the time in the title alone
    middle = slice(first.shape[0] // 3, None)
    assert np.abs(first - third)[middle].max() == 0.0
    assert np.abs(first - second)[middle].max() > 50.0


def test_movie_has_one_scale_of_all_frames(growing):
    states = find_source(growing.path).over_time(9)
    plane = View().plane(states, 32)
    scale = movie._scale(states, View(), plane)
    values = [movie.maps.drawn(state, plane, "", "").values for state in states]
    assert (scale.vmin, scale.vmax) == (np.min(values), np.max(values))
    assert np.max(values[0]) < scale.vmax
    fixed = movie._scale(states, View(limits=(1.0, 2.0)), plane)
    assert (fixed.vmin, fixed.vmax) == (1.0, 2.0)


def test_mp4_without_encoder_is_refused(messages, growing, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with messages.raised(ConfigError):
        movie.make(growing.path, tmp_path / "a.mp4", View())


def test_mp4_has_all_frames(growing, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = movie.make(growing.path, tmp_path / "a.mp4", View(), dpi=40)
    assert ffmpeg.count_frames_and_secs(str(path))[0] == 3


def test_movie_of_unknown_suffix_is_refused(messages, growing, tmp_path):
    with messages.raised(ConfigError):
        movie.make(growing.path, tmp_path / "a.avi", View())


def test_movie_of_frames_where_the_run_has_some(growing):
    states = [state_of("kelvin_helmholtz", time=t) for t in (0.0, 0.1, 0.2, 0.3)]
    with growing.frames.held():
        for step, state in enumerate(states):
            path = growing.frames.path_of(step)
            frames.write(path, state.particles, state.scalar("pressure"), state.time, step)
            found = [one.time for one in find_source(growing.path).for_movie()]
            # one frame is no movie: then the checkpoints
            assert found == ([0.0, 0.1, 0.2] if step == 0 else [s.time for s in states[: step + 1]])
    path = movie.make(growing.path, None, View("pressure"), dpi=40)
    with Image.open(path) as image:
        assert image.n_frames == 4
    last = [*find_source(growing.path).for_movie()][-1]
    np.testing.assert_allclose(last.scalar("pressure"), states[-1].scalar("pressure"), 2.0**-24)
    np.testing.assert_allclose(last.scalar("speed"), states[-1].scalar("speed"), 1e-6)


def axes_of(states):
    axes = profile_axes.of_movie(states)
    pictures = [profiles.frame(state, axes) for state in states]
    for picture in pictures:
        picture.canvas.draw()
    return axes, pictures


def test_movie_of_line_has_the_same_axes_in_all_frames(tube):  # noqa: F811
    states = [*find_source(tube.path).for_movie()]
    states[1].particles.internal_energy[:] *= 3.0
    axes, pictures = axes_of(states)
    for index, name in enumerate(states[0].problem.profiles):
        panels = [picture.axes[index] for picture in pictures]
        limits = {(panel.get_xlim(), panel.get_ylim(), panel.get_yscale()) for panel in panels}
        places = {tuple(panel.get_position().bounds) for panel in panels}
        assert len(limits) == len(places) == 1
        for panel in panels:
            shown = [values for line in panel.get_lines() for values in line.get_ydata()]
            low, high = panel.get_ylim()
            assert low <= min(shown) <= max(shown) <= high
        values = [state.particles.velocity[0] if name == "velocity" else state.scalar(name)
                  for state in states]  # fmt: skip
        assert axes.fields[name].high >= np.max(values)
    assert [len(panel.get_lines()) for panel in pictures[1].axes] == [2] * 4  # and exact


def test_movie_of_line_is_made(tube):  # noqa: F811
    with Image.open(movie.make(tube.path, None, View(), dpi=40)) as image:
        sizes = {frame.size for frame in ImageSequence.Iterator(image)}
        assert (image.n_frames, len(sizes)) == (3, 1)


def test_frames_without_exact_solution_have_panels_in_the_same_places():
    states = [state_of("shock_tube", time=t) for t in (0.2, 0.6)]
    assert [state.left_out is None for state in states] == [True, False]
    axes, pictures = axes_of(states)
    assert axes.reason_lines == 2
    assert [picture.get_suptitle().count("\n") for picture in pictures] == [2, 2]
    first, second = ([tuple(panel.get_position().bounds) for panel in picture.axes]
                     for picture in pictures)  # fmt: skip
    np.testing.assert_allclose(first, second, atol=0.002)


def test_small_wave_is_less_its_mean_in_all_frames():
    axes, pictures = axes_of([state_of("sound_wave", time=t) for t in (0.0, 0.25)])
    assert "density" in axes.less_mean
    assert {picture.axes[0].get_ylabel() for picture in pictures} == {r"$\rho$ less its mean"}
    assert axes.fields["density"].high < 1e-3


def test_movie_of_line_with_map_or_of_checkpoint_is_refused(messages, growing, tube):  # noqa: F811
    with messages.raised(ConfigError):
        movie.make(tube.path, None, View("density"))
    with messages.raised(FileError):
        movie.make(growing.checkpoint_path(1), None, View())


def test_movie_tells_of_each_picture(growing, tmp_path, monkeypatch):
    class Shown(progress.Pictures):
        def note(self, text):
            told.append(text)

    told = []
    monkeypatch.setattr(progress, "LINE_INTERVAL", 0.0)
    movie.make(growing.path, tmp_path / "a.gif", View(), dpi=20, shown=Shown())
    # three frames, and two for the palette
    assert told == [f"drew {k} of 5 pictures" for k in range(1, 6)]


def test_scale_of_movie_without_matter_in_view(growing):
    view = View(is_log=True)
    plane = view.plane(find_source(growing.path).over_time(9), 8)
    nothing = [state_of("kelvin_helmholtz", time=0.0)]
    nothing[0].particles.density[:] = np.nan
    scale = movie._scale(nothing, view._replace(field="density"), plane)
    assert np.isfinite([scale.vmin, scale.vmax]).all()


def test_commands_pass_their_options_on(growing, tmp_path):
    options = ["--field", "speed", "--range", "0.1", "0.2", "--zoom", "0", "0.2", "0", "0.1"]
    runner = CliRunner()
    done = runner.invoke(
        main, ["plot", str(growing.path), *options, "--time", "0", "--time", "0.2"]
    )
    assert done.output == f"drew {growing.figures / 'map_of_speed.png'}\n"
    target = str(tmp_path / "a.gif")
    done = runner.invoke(main, ["movie", str(growing.path), *options, "-o", target, "--fps", "20"])
    assert done.output == f"drew {target}\n"
    with Image.open(target) as image:
        assert (image.n_frames, image.info["duration"]) == (3, 50)
