"""The commands on results: `sph plot`, `sph movie`, `sph info` and `sph export`."""

from contextlib import closing
from pathlib import Path

import click

from sph import progress, standard_streams
from sph.errors import ConfigError

MAP_FIELDS = ("density", "pressure", "internal_energy", "speed", "plastic_strain", "von_mises")
AXES = ("x", "y", "z")
DPI = click.option("--dpi", type=click.IntRange(20, 1200), metavar="N",
                   help="Pixels per inch. Default: 180.")  # fmt: skip


def _slice(_context, _option, text):
    """The axis and the value of x=0.5. Raises BadParameter."""
    if text is None:
        return None
    axis, _, value = text.partition("=")
    try:
        return AXES.index(axis), float(value)
    except ValueError:
        raise click.BadParameter(f"{text}: expected x, y or z and a number, as in z=0.5.") from None


def _axis(_context, _option, name):
    return None if name is None else AXES.index(name)


def map_options(command):
    """Add the options of maps, by the names in `figures.View`."""
    for option in (
        click.option("--projection", type=click.Choice(AXES), callback=_axis,
                     help="Of a 3-D run, draw the column density, or the mean of --field "
                     "weighted by mass, along this axis."),
        click.option("--slice", metavar="AXIS=VALUE", callback=_slice,
                     help="Draw this slice of a 3-D run, e.g. --slice x=0.5. Default: z at the "
                     "centre of the problem."),
        click.option("--zoom", nargs=4, type=float, metavar="X0 X1 Y0 Y1",
                     help="Draw this part of the domain: ends of the horizontal and of the "
                     "vertical axis, cut to the domain. Default: all of it."),
        click.option("--linear", "is_linear", is_flag=True,
                     help="Use a linear scale of colours. Default: linear; logarithmic if the "
                     "highest value is above 1000 times the lowest or 10 times the median. With "
                     "--range, linear unless there is --log."),
        click.option("--log", "is_log", is_flag=True,
                     help="Use a logarithmic scale of colours, of four decades at most without "
                     "--range."),
        click.option("--range", "limits", nargs=2, type=float, metavar="LO HI",
                     help="Ends of the scale of colours. Default: those of the values."),
        click.option("--field", type=click.Choice(MAP_FIELDS),
                     help="Quantity to draw; grey is where there is no matter. Default: density; "
                     "of a solid plastic strain, or von Mises stress if nothing has yielded."),
    ):  # fmt: skip
        command = option(command)
    return command


@click.command()
@click.argument("sources", metavar="RUN_OR_CHECKPOINT...", nargs=-1, required=True,
                type=click.Path(path_type=Path))  # fmt: skip
@click.option("-o", "target", type=click.Path(path_type=Path), metavar="FILE",
              help="Write one picture to FILE. Default: several, in figures/.")  # fmt: skip
@map_options
@click.option("--time", "times", multiple=True, type=float, metavar="T",
              help="Draw the checkpoint or frame nearest to time T. May be repeated. "
              "Default: the last checkpoint.")  # fmt: skip
@click.option("--live", is_flag=True,
              help="Draw one run while it goes on, in a window or, without a display, "
              "in figures/live.png.")  # fmt: skip
@DPI
def plot(sources, target, times, live, dpi, **options):
    """Draw profiles, maps, slices and the history of runs.

    RUN_OR_CHECKPOINT is a run directory or a checkpoint file. Options of maps
    (--field, --range, --log, --linear, --zoom, --slice, --projection) and --time draw
    one picture alone, such as figures/map_of_density.png.

    With --live, the picture of RUN is drawn again after each checkpoint and
    each frame (output.frames), until the run ends, the window is closed or
    Ctrl-C. With -o FILE.png the picture goes to FILE in place of a window.
    """
    from sph.analysis import figures

    view = figures.View(**options)
    chosen = view if view != figures.View() else None
    if live:
        from sph.analysis.figures import live as live_picture

        if len(sources) > 1 or times:
            raise ConfigError("--live draws one run, and its newest state: leave out --time.")
        click.echo(live_picture.watch(sources[0], chosen, target, dpi, click.echo))
        return
    for path in figures.draw(sources, target, chosen, times, dpi, standard_streams.note):
        click.echo(f"drew {path}")


@click.command()
@click.argument("source", metavar="RUN", type=click.Path(path_type=Path))
@click.option("-o", "target", type=click.Path(path_type=Path), metavar="FILE",
              help="Write to FILE, .gif or .mp4. Default: figures/movie.gif.")  # fmt: skip
@map_options
@click.option("--fps", type=click.IntRange(1, 60), default=10, show_default=True, metavar="N",
              help="Frames per second.")  # fmt: skip
@DPI
def movie(source, target, fps, dpi, **options):
    """Make a movie of a run from its frames or, without these, its checkpoints.

    The key output.frames sets the number of frames. All pictures have one
    size, one part of the domain and one scale of colours; those of a 1-D run
    are profiles with the same axes. Files .mp4 need the package
    imageio-ffmpeg.
    """
    from sph.analysis import figures
    from sph.analysis.figures import movie as movies

    with closing(progress.suited_to_pictures()) as shown:
        made = movies.make(source, target, figures.View(**options), fps, dpi, shown)
    click.echo(f"drew {made}")


@click.command()
@click.argument("source", metavar="RUN_OR_CHECKPOINT", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print JSON, with all digits.")
def info(source, as_json):
    """Describe a run or a checkpoint.

    Prints its state, the settings that differ from the defaults, what limited
    the time steps, where the time went, errors, conservation and every figure
    of the summary with its meaning. docs/output.md lists all meanings.
    """
    from sph.analysis import info as about
    from sph.analysis.info.words import in_words
    from sph.output.json_text import json_text

    found = about.of(source)
    standard_streams.deliver(json_text(found) if as_json else in_words(found) + "\n")


@click.command()
@click.argument("source", metavar="RUN_OR_CHECKPOINT", type=click.Path(path_type=Path))
@click.option("--csv", "as_csv", is_flag=True,
              help="Write particles_*.csv and, for problems with profiles, profile_*.csv, with "
              "the exact solution where there is one.")  # fmt: skip
@click.option("--vtk", "as_vtk", is_flag=True,
              help="Write particles*.vtkhdf, which ParaView and pyvista open.")  # fmt: skip
@click.option("--time", "times", type=float, multiple=True, metavar="T",
              help="Export the checkpoint nearest to time T. May be repeated. Default: the last "
              "valid one.")  # fmt: skip
@click.option("--all", "every", is_flag=True, help="Export every checkpoint.")
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="Directory of the files. Default: export/ in the run directory.")  # fmt: skip
def export(source, as_csv, as_vtk, times, every, directory):
    """Write particles and profiles for other programs.

    Particles are in the order of their IDs, positions in the coordinates of
    the run. Several checkpoints become several CSV files, and time steps of
    one VTK file.
    """
    from sph.analysis import export as exports

    formats = ["csv"] * as_csv + ["vtk"] * as_vtk
    for path in exports.write(source, formats, times, every, directory):
        click.echo(f"wrote {path}")
