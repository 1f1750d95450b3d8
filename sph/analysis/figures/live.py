"""A picture of a run that is going on, drawn anew after each output: `sph plot --live`."""

import io
import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from sph.analysis.figures import style
from sph.analysis.figures.main import main_picture
from sph.analysis.figures.sources import State
from sph.analysis.figures.view import View, figure
from sph.errors import ConfigError, FileError
from sph.output import checkpoint, frames
from sph.output.files import explained, refuse_link, replacing
from sph.output.run_directory import RunDirectory

POLL = 0.5  # seconds between looks at the run directory
# Looks that find no process in the run directory before the run counts as ended: a run that begins
# unlocks its directory for a moment.
MOST_QUIET = 2
WINDOW = (10.0, 7.0)  # inches, at most
TOOLKITS = ("QtAgg", "TkAgg", "GTK4Agg", "GTK3Agg")  # of windows, the first that is installed


class Window:
    """A window that shows the last picture. Closing it ends the drawing."""

    def __init__(self, toolkit: str, title: str):
        """Raises ImportError if the toolkit is not installed or has no display."""
        from matplotlib import pyplot

        pyplot.switch_backend(toolkit)
        self._pyplot, self._title = pyplot, title
        self._figure: Any = None  # opened with the first picture, whose shape it has

    def _open(self, ratio: float) -> None:
        """Open the window; ratio: of its width to its height."""
        height = min(WINDOW[1], WINDOW[0] / ratio)
        self._figure = self._pyplot.figure(self._title, figsize=(ratio * height, height))
        self._axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self._figure.show()

    def show(self, picture: Figure) -> str:
        """Show a picture; returns what was done, in words."""
        pixels = np.asarray(Image.open(_png(picture)))
        height, width = pixels.shape[:2]
        if self._figure is None:
            self._open(width / height)
        self._axes.clear()
        self._axes.set_axis_off()
        self._axes.imshow(pixels)
        self._figure.canvas.draw_idle()
        self._figure.canvas.flush_events()
        return "drew"

    def wait(self, seconds: float) -> bool:
        """Wait, and keep the window responsive; returns whether the window is still open."""
        if self._figure is None:
            time.sleep(seconds)
            return True
        self._figure.canvas.start_event_loop(seconds)
        return self._pyplot.fignum_exists(self._figure.number)


class PngFile:
    """A PNG file that always holds the last picture."""

    def __init__(self, path: Path):
        self.path = path

    def show(self, picture: Figure) -> str:
        """Replace the file atomically; returns what was done, in words. Raises FileError."""
        content = _png(picture).getvalue()  # first, so that an interrupt leaves no unfinished file
        if self.path.parent.name == "figures":
            refuse_link(self.path.parent)
            with explained(f"cannot write {self.path}"):
                self.path.parent.mkdir(exist_ok=True)
        with replacing(self.path) as unfinished:
            unfinished.write(content)
        return f"drew {self.path}"

    def wait(self, seconds: float) -> bool:
        """Wait; returns True, because a file cannot be closed."""
        time.sleep(seconds)
        return True


def target_of(directory: RunDirectory, target: Path | None) -> Window | PngFile:
    """A window, or the file `target`, by default figures/live.png where no window is possible."""
    if target is None and has_display():
        for toolkit in TOOLKITS:
            try:
                return Window(toolkit, str(directory.path))
            except ImportError:
                continue
    return PngFile(target or directory.figures / "live.png")


def has_display() -> bool:
    """Whether windows can be shown."""
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return bool(named) or sys.platform == "darwin"


def watch(
    path: Path, view: View | None, target: Path | None, dpi: int | None,
    say: Callable[[str], object],
) -> str:  # fmt: skip
    """Draw the newest state of the run `path` after each output until the run ends.

    view: a map; None for the main picture of the run. Without a display, or with `target`, the
    picture goes to a PNG file. say: prints a line. Returns how the run ended, in words. Raises
    FileError if `path` is no run directory or the picture cannot be written, and ConfigError for a
    view that cannot be drawn and a target that does not end in .png.
    """
    if target is not None and target.suffix.lower() != ".png":
        raise ConfigError(f"{target}: --live writes PNG files.\nTry: a name that ends in .png.")
    directory = RunDirectory.open(path)
    shown, seen, quiet = target_of(directory, target), None, 0
    while quiet < MOST_QUIET:
        # before the look at the outputs, so that the last one is not missed
        quiet = 0 if _is_going_on(directory) else quiet + 1
        signs = _signs(directory)
        if signs != seen and (state := newest(directory)) is not None:
            seen = signs
            with style.paper(dpi):
                picture = figure([state], view) if view else main_picture(state)
                words = shown.show(picture)
            unit = state.units.symbol(0, 0, 1)
            say(f"{words}: t = {state.time:.4g} {unit}".rstrip())
        if not shown.wait(POLL):
            return "the window was closed"
    status = directory.read_summary().get("status")
    if seen is None:
        raise FileError(
            f"{path} has no checkpoints, and no run is going on in it, so there is nothing to "
            "draw.\nTry: `sph run` first, then this command while the run goes on."
        )
    return f"the run is {status}" if status else "no run is going on in this directory"


def newest(directory: RunDirectory) -> State | None:
    """The newest state that can be read, of a frame or a checkpoint; None if there is none.

    A run may write, replace or remove files meanwhile: what cannot be read is left out.
    """
    for path in reversed(_existing(directory.checkpoints)):
        with suppress(FileError):
            found = checkpoint.read(path)
            for frame in reversed(_existing(directory.frames.paths)):
                with suppress(FileError):
                    later = frames.read(frame, found.config)
                    return State(later if later.step > found.step else found)
            return State(found)
    return None


def _is_going_on(directory: RunDirectory) -> bool:
    """Whether a run has locked the directory or, where there are no locks, lacks its summary."""
    is_running = directory.is_running()
    return not directory.summary.exists() if is_running is None else is_running


def _existing(paths: Callable[[], list[Path]]) -> list[Path]:
    """The result of `paths`, empty where the directory is removed meanwhile."""
    try:
        return paths()
    except FileNotFoundError:
        return []


def _signs(directory: RunDirectory) -> list[tuple[str, int]]:
    """Name and time of the newest checkpoint and frame: they change with each output."""
    found = []
    for paths in (directory.checkpoints, directory.frames.paths):
        for path in _existing(paths)[-1:]:
            with suppress(FileNotFoundError):
                found.append((path.name, path.stat().st_mtime_ns))
    return found


def _png(picture: Figure) -> io.BytesIO:
    content = io.BytesIO()
    picture.savefig(content, format="png", bbox_inches="tight")
    return content
