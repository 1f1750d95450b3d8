"""Movies of runs: pictures that share their size, scale of colours and axes."""

import functools
import importlib
import itertools
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from sph.analysis.figures import maps, profile_axes, profiles, style
from sph.analysis.figures.sources import Source, State, States, find_source
from sph.analysis.figures.view import View
from sph.analysis.interpolate import Plane
from sph.errors import ConfigError
from sph.output.files import explained, refuse_link, replacing
from sph.progress import Pictures

FORMATS = (".gif", ".mp4")
COLOURS = 256  # of a gif

Drawn = Callable[[States], Iterator[np.ndarray]]  # the pixels of the frames of these states


def make(
    source: Path, target: Path | None, view: View, per_second: int = 10, dpi: int | None = None,
    shown: Pictures | None = None,
) -> Path:  # fmt: skip
    """Write a movie of the run `source`; returns its path, by default figures/movie.gif.

    Frames of the run or, without these, checkpoints are read three times, one at a time: for the
    part of the domain that all share, for the scale of colours, and for the pictures; those of 1-D
    runs twice. per_second: pictures. dpi: by default style.DPI. shown: is told of each picture.
    Raises ConfigError for other suffixes than FORMATS, for .mp4 without imageio-ffmpeg and for
    views that cannot be drawn, FileError for what is missing, damaged or cannot be written.
    """
    write = _writer(Path(target)) if target else _write_gif
    found = find_source(Path(source))
    states = found.for_movie()
    with style.paper():
        picture = _pictures(states, view, found.last())
        path = Path(target) if target else _in_figures(found)
        shown = shown or Pictures()
        drawn = functools.partial(_frames, drawn=picture, dpi=dpi or style.DPI, shown=shown)
        with replacing(path) as unfinished:
            extra = 2 if write is _write_gif else 0  # for its palette
            shown.start(len(states.paths) + extra)
            write(drawn, states, unfinished, per_second)
    return path


def _pictures(states: States, view: View, last: State) -> Callable[[State], Figure]:
    """What draws a state as a frame of the movie. Raises ConfigError."""
    if last.dimension == 1 and view == View():
        axes = profile_axes.of_movie(states)
        return lambda state: profiles.frame(state, axes)
    view.check(last)
    view = view._replace(field=view.field or maps.main_field(last))  # one for all frames
    plane = view.plane(states, maps.PIXELS)
    scale = _scale(states, view, plane)

    def picture(state: State) -> Figure:
        one = maps.drawn(state, plane, state.when, state.title, view.field)
        return maps.side_by_side([one], scale)

    return picture


def _scale(states: States, view: View, plane: Plane) -> Normalize:
    """One scale for all frames, from the lowest to the highest value of all."""
    if view.limits:
        return view.scale(*view.limits)
    ends, middle = [], []
    for state in states:
        values = maps.drawn(state, plane, "", "", view.field).values
        values = values[np.isfinite(values)]
        if values.size:  # there may be no matter in --zoom or --slice
            ends += [values.min(), values.max()]
            middle.append(np.median(values))
    if not ends:
        return style.scale(np.zeros(0))
    if view.is_log or view.is_linear:
        return view.scale(min(ends), max(ends))
    return style.scale(np.array([*ends, *np.repeat(middle, 2)]))


def _frames(
    states: States, drawn: Callable[[State], Figure], dpi: int, shown: Pictures
) -> Iterator[np.ndarray]:
    """(height, width, 3) bytes of each frame; sides are even, as codecs of video ask."""
    for state in states:
        picture = drawn(state)
        picture.set_dpi(dpi)
        canvas = FigureCanvasAgg(picture)
        canvas.draw()
        pixels = np.asarray(canvas.buffer_rgba())[..., :3]
        height, width = (side - side % 2 for side in pixels.shape[:2])
        shown.drew()
        yield np.ascontiguousarray(pixels[:height, :width])


def _writer(target: Path) -> Callable:
    """What writes a file of that suffix. Raises ConfigError."""
    suffix = target.suffix.lower()
    if suffix not in FORMATS:
        raise ConfigError(
            f"{target} names no format that a movie can have.\n"
            f"Try: a name that ends in {' or '.join(FORMATS)}."
        )
    if suffix == ".gif":
        return _write_gif
    try:
        ffmpeg = importlib.import_module("imageio_ffmpeg")
    except ImportError:
        raise ConfigError(
            f"{target}: movies in .mp4 need the package imageio-ffmpeg, which is not installed.\n"
            'Try: pip install "sph[movie]", or a name that ends in .gif.'
        ) from None
    return functools.partial(_write_mp4, ffmpeg)


def _write_gif(drawn: Drawn, states: States, file: BinaryIO, per_second: int) -> None:
    """One palette for all frames, of the first and the last, so that no colour flickers.

    Pillow keeps all frames in memory, a byte for each pixel.
    """
    both = Image.fromarray(np.concatenate([*drawn(states.ends())]))
    palette = both.quantize(COLOURS)
    first, *others = (
        Image.fromarray(pixels).quantize(palette=palette, dither=Image.Dither.NONE)
        for pixels in drawn(states)
    )
    first.save(
        file, format="gif", save_all=True, append_images=others, loop=0, optimize=False,
        duration=round(1000 / per_second),
    )  # fmt: skip


def _write_mp4(ffmpeg, drawn: Drawn, states: States, file: BinaryIO, per_second: int) -> None:
    """The encoder writes files only: to one of its own, which is copied."""
    frames = drawn(states)
    first = next(frames)
    height, width = first.shape[:2]
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "movie.mp4"
        writer = ffmpeg.write_frames(str(path), (width, height), fps=per_second, macro_block_size=2)
        writer.send(None)
        for pixels in itertools.chain([first], frames):
            writer.send(pixels)
        writer.close()
        file.write(path.read_bytes())


def _in_figures(source: Source) -> Path:
    assert source.run is not None
    refuse_link(source.run.figures)
    with explained(f"cannot write {source.run.figures}"):
        source.run.figures.mkdir(exist_ok=True)
    return source.run.figures / "movie.gif"
