"""Pictures of runs and checkpoints: `draw` selects them; each module draws one kind."""

from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from sph.analysis import truth
from sph.analysis.figures import history, maps, profiles, style
from sph.analysis.figures.main import main_picture, shows_profiles
from sph.analysis.figures.sources import Source, State, find_source, labels
from sph.analysis.figures.times import states_at
from sph.analysis.figures.view import View, figure
from sph.errors import ConfigError
from sph.output.files import explained, refuse_link, replacing
from sph.output.history import read as read_history
from sph.output.run_directory import RunDirectory

FORMATS = ("png", "pdf", "svg")
MOST_TIMES = 6


def draw(
    sources: Sequence[Path],
    target: Path | None = None,
    view: View | None = None,
    times: Sequence[float] = (),
    dpi: int | None = None,
    say: Callable[[str], object] = lambda _line: None,
) -> list[Path]:
    """Draw runs or checkpoints; returns the files written.

    Without `target` a run gets a set of pictures in its figures/, a checkpoint one picture there,
    or beside it where it is in no run. With `target` the main picture of one source goes there, or
    one picture that compares several; its suffix says in which format. With `view` or `times` each
    source gets one picture of the checkpoints or frames nearest to `times`, by default of the last
    checkpoint: a map, or profiles of a 1-D run. dpi: pixels per inch, by default style.DPI. say: is
    called with a line for each time that is drawn in place of another one.
    Raises ConfigError for a suffix that is none of FORMATS, for sources that one picture cannot
    compare, for views that cannot be drawn and for times beyond the run, FileError for what is
    missing, damaged or cannot be written.
    """
    if target is not None:
        _check_format(Path(target))
    found = [find_source(Path(path)) for path in sources]
    with style.paper(dpi):
        if view or times:
            if target is not None and len(found) > 1:
                raise ConfigError("options of maps and times need one source with -o.")
            return [
                _draw_view(source, target, view or View(), states_at(source, times, say))
                for source in found
            ]
        if target is None:
            return [path for source in found for path in _draw_own(source)]
        states = [source.last() for source in found]
        if len(found) == 1:
            return [_save(main_picture(states[0]), Path(target))]
        return [_save(comparison(states, labels(found)), Path(target))]


def comparison(states: Sequence[State], names: Sequence[str]) -> Figure:
    """Profiles over each other, or maps side by side. Raises ConfigError where they do not fit."""
    kinds = {_kind(state) for state in states}
    if len(kinds) > 1:
        raise ConfigError(
            f"one picture cannot compare {' with '.join(sorted(kinds))}.\n"
            "Try: runs of one problem, or leave out -o for pictures of each."
        )
    compared = profiles.compared if shows_profiles(states[0]) else maps.compared
    return compared(states, names)


def _kind(state: State) -> str:
    if not shows_profiles(state):
        return "maps"
    names = ", ".join(state.problem.profiles)
    return f"profiles of {names} {'over the radius' if state.is_radial else 'along x'}"


def _draw_own(source: Source) -> list[Path]:
    """The pictures of one source, where they belong."""
    run = source.run
    if run is None or not source.is_run:
        directory = source.path.parent if run is None else run.figures
        return [_save(main_picture(source.last()), directory / f"{source.path.stem}.png")]
    return [_save(picture, run.figures / f"{name}.png") for name, picture in _pictures(source, run)]


def _draw_view(source: Source, target: Path | None, view: View, states: Sequence[State]) -> Path:
    if states[-1].dimension == 1 and view == View():
        picture, name = profiles.over_time(states), "profiles_at_times"
    else:
        picture, name = figure(states, view), view.name_of(maps.main_field(*states))
    directory = source.path.parent if source.run is None else source.run.figures
    return _save(picture, Path(target or directory / f"{name}.png"))


def _pictures(source: Source, run: RunDirectory):
    """(name, figure) of each picture of a run's set, one at a time to hold one in memory."""
    last = source.last()
    states = source.over_time(MOST_TIMES)
    # over x or the radius; shapes of the user's own are in general functions of neither
    if shows_profiles(last) or (last.dimension == 3 and last.problem.profiled):
        yield "profiles", profiles.single(last)
    if last.dimension > 1:
        yield "slice" if last.dimension == 3 else "map", maps.single(last)
    in_profiles = last.dimension == 1 or last.is_radial
    if in_profiles:
        yield "evolution", profiles.over_time(states)
    else:  # strain stays, so that the last state has most of it
        yield "evolution", maps.over_time(states, maps.main_field(last))
    if run.history.exists():
        steps = read_history(run.history)
        if steps["t"].size:
            config, mass = last.checkpoint.config, float(last.particles.mass.sum())
            theory = truth.theory(config, steps["t"])
            yield "history", history.figure(steps, last.title, theory, config, mass)


def _check_format(target: Path) -> None:
    if target.suffix.lower().lstrip(".") not in FORMATS:
        raise ConfigError(
            f"{target} names no format that a picture can have.\n"
            f"Try: a name that ends in .{', .'.join(FORMATS[:-1])} or .{FORMATS[-1]}."
        )


def _save(figure: Figure, path: Path) -> Path:
    """Write `figure`, all or nothing; the directory figures/ is made where it is missing."""
    if path.parent.name == "figures":
        refuse_link(path.parent)
        with explained(f"cannot write {path}"):
            path.parent.mkdir(exist_ok=True)
    with replacing(path) as unfinished:
        figure.savefig(unfinished, format=path.suffix.lower().lstrip("."), bbox_inches="tight")
    return path
