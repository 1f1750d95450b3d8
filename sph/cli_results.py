"""The commands on results: `sph info` and `sph export`."""

from pathlib import Path

import click

from sph import standard_streams


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
