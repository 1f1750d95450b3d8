"""The commands over many runs: `sph sweep`, `sph report`, `sph stress` and `sph stability`."""

from pathlib import Path

import click

from sph.errors import NumericalError
from sph.shell_words import quoted


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@click.option("--vary", "varies", multiple=True, required=True, metavar="KEY=A,B,…",
              help="Values of a key, e.g. physics.alpha=0.5,1.0 or problem.n=100:1600:x2 or "
              "physics.C=0.05:0.3:+0.05; may be repeated.")  # fmt: skip
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Set a key for all points; may be repeated.")  # fmt: skip
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="Where the runs go; runs/<name of CONFIG>-sweep if not given.")  # fmt: skip
@click.option("--jobs", type=click.IntRange(min=1), metavar="N",
              help="Points at once; as many as there are processors if not given.")  # fmt: skip
@click.option("--scheduler", metavar="ADDRESS",
              help="Run on a Dask scheduler, e.g. tcp://127.0.0.1:8786.")  # fmt: skip
@click.option("--slurm", multiple=True, metavar="KEY=VALUE",
              help="Run as Slurm jobs, with this option of submitit, e.g. timeout_min=60 or "
              "partition=short; may be repeated.")  # fmt: skip
@click.option("--yes", "is_sure", is_flag=True, help="Run also more than 1000 points.")
def sweep(config, varies, overrides, directory, jobs, scheduler, slurm, is_sure):
    """Run CONFIG at every combination of the values, each a run directory in DIR.

    Run again, it does only what is missing or failed, and goes on with what was interrupted.
    """
    from sph.sweep import command

    target = directory or Path("runs") / f"{config.stem}-sweep"
    click.echo(command.run(config, varies, overrides, target, jobs, scheduler, slurm, is_sure))
    click.echo(f"Results: {target} (`sph report {quoted(target)}` compares them).")


@click.command()
@click.argument("sources", metavar="DIR...", nargs=-1, required=True,
                type=click.Path(path_type=Path))  # fmt: skip
@click.option("--field", default="density", show_default=True, metavar="NAME",
              help="A field, or a figure of the summary such as report.NAME.")  # fmt: skip
@click.option("--norm", type=click.Choice(["L1", "L2", "Linf"]), default="L1", show_default=True)
@click.option("--x", "cost", type=click.Choice(["cpu", "wall", "updates", "n"]), default="cpu",
              show_default=True, help="What the error is drawn and weighed against.")  # fmt: skip
@click.option("--by", multiple=True, metavar="KEY",
              help="Tell lines apart by this key; all keys that vary if not given.")  # fmt: skip
@click.option("--reference", type=click.Path(path_type=Path), metavar="DIR",
              help="For runs made already: take errors against this finer run, in place "
              "of those in their summaries.")  # fmt: skip
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="Where all goes; report/ in the first DIR if not given.")  # fmt: skip
def report(sources, field, norm, cost, by, reference, directory):
    """Compare runs, or the runs in a directory: error against what it cost.

    Says which settings are the fastest at their error, and by how much the others are slower.
    """
    from sph.analysis import report as reports

    question = reports.Question(field, norm, cost, by, reference)
    target = directory or sources[0] / "report"
    found = reports.make(sources, question)
    click.echo(reports.in_words(found))
    for path in reports.write(found, target):
        click.echo(f"wrote {path}")


@click.command()
@click.option("--only", multiple=True, metavar="NAME",
              help="Run this case alone, or all that match a pattern such as 'noh_*'; may be "
              "repeated. `sph list` names them.")  # fmt: skip
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              default=Path("runs/stress"), show_default=True,
              help="Where the runs go.")  # fmt: skip
@click.option("--jobs", type=click.IntRange(min=1), metavar="N",
              help="Runs at once; as many as there are processors if not given.")  # fmt: skip
def stress(only, directory, jobs):
    """Run the suite of hard cases and judge each by its limits; exits with 3 if one falls short.

    Settings that are to fail must be caught failing. Run again, it does only what is missing.
    """
    from sph.stress import command, table

    suite, results = command.run(only, directory, jobs)
    click.echo(table.as_text(results))
    for sentence in table.sentences(suite.cases, results):
        click.echo(sentence)
    click.echo(f"Results: {directory} (stress.json, stress.md, and a directory for each case).")
    if not table.is_passed(results):
        raise NumericalError(table.closing(results))
    click.echo(table.closing(results))


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@click.option("--key", default="physics.C", show_default=True, metavar="physics.C|physics.eta",
              help="The key whose stable range is looked for.")  # fmt: skip
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Set a key of the configuration; may be repeated.")  # fmt: skip
@click.option("--limit", "limits", multiple=True, metavar="KEY=VALUE",
              help="What a stable run keeps and how it is looked for: reference, error_growth, "
              "deviation, negligible, resolution; may be repeated.")  # fmt: skip
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="Where the runs go; runs/<name of CONFIG>-stability if not given.")  # fmt: skip
@click.option("--jobs", type=click.IntRange(min=1), metavar="N",
              help="Runs at once; as many as there are processors if not given.")  # fmt: skip
def stability(config, key, overrides, limits, directory, jobs):
    """Find by bisection how far C or eta of CONFIG is from where runs stop being stable.

    Run again, it does only what is missing. Exits with 3 if nothing that was tried is stable.
    """
    from sph.stability import command, picture, table

    target = directory or Path("runs") / f"{config.stem}-stability"
    found = command.run(config, key, overrides, target, limits, jobs)
    words = table.in_words(found)
    for path in (*table.write(found, target), picture.draw(found, target / f"{key}.png")):
        click.echo(f"wrote {path}")
    if all(edge.inside is None for edge in found.edges.values()):
        raise NumericalError(words)
    click.echo(words)
