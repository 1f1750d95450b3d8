"""The commands on many runs: `sph sweep`, `sph report`, `sph stress` and `sph stability`."""

from pathlib import Path

import click

from sph.errors import NumericalError
from sph.shell_words import quoted


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@click.option("--vary", "varies", multiple=True, required=True, metavar="KEY=A,B,…",
              help="Values of a key: a list, as in physics.alpha=0.5,1.0; or first, last and "
              "factor, as in problem.n=100:1600:x2; or first, last and increment, as in "
              "physics.C=0.05:0.3:+0.05. May be repeated.")  # fmt: skip
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Set a key of the configuration for all points. May be repeated.")  # fmt: skip
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="Directory of the sweep. Default: runs/<name of CONFIG>-sweep.")  # fmt: skip
@click.option("--jobs", type=click.IntRange(min=1), metavar="N",
              help="Number of points to run at once. Default: number of processors.")  # fmt: skip
@click.option("--scheduler", metavar="ADDRESS",
              help="Run on this Dask scheduler, e.g. tcp://127.0.0.1:8786.")  # fmt: skip
@click.option("--slurm", multiple=True, metavar="KEY=VALUE",
              help="Run as Slurm jobs with this option of the package submitit, e.g. "
              "timeout_min=60 or partition=short. May be repeated.")  # fmt: skip
@click.option("--yes", "is_sure", is_flag=True,
              help="Allow more than 1000 points.")  # fmt: skip
def sweep(config, varies, overrides, directory, jobs, scheduler, slurm, is_sure):
    """Run CONFIG for all combinations of the values in --vary.

    Each combination is a point of the sweep and has a run directory in DIR.
    The same command, repeated, skips finished points, continues interrupted
    ones from their last checkpoint and runs failed ones again.
    """
    from sph.sweep import command

    target = directory or Path("runs") / f"{config.stem}-sweep"
    click.echo(command.run(config, varies, overrides, target, jobs, scheduler, slurm, is_sure))
    click.echo(f"Results: {target} (`sph report {quoted(target)}` compares them).")


@click.command()
@click.argument("sources", metavar="DIR...", nargs=-1, required=True,
                type=click.Path(path_type=Path))  # fmt: skip
@click.option("--field", default="", metavar="NAME",
              help="Quantity to compare: a field such as density or velocity, or a number in "
              "summary.json such as report.NAME. Default: density; for runs without an exact "
              "solution conservation.energy_drift_max.")  # fmt: skip
@click.option("--norm", type=click.Choice(["L1", "L2", "Linf"]), default="L1", show_default=True,
              help="Norm of a field's error.")  # fmt: skip
@click.option("--x", "cost", type=click.Choice(["cpu", "wall", "updates", "n"]), default="cpu",
              show_default=True, help="Cost that the error is plotted against: CPU seconds, wall-"
              "clock seconds, particle updates, or the number of particles.")  # fmt: skip
@click.option("--by", multiple=True, metavar="KEY",
              help="Draw each value of KEY in its own colour. May be repeated. Default: all keys "
              "that vary, except problem.n.")  # fmt: skip
@click.option("--reference", type=click.Path(path_type=Path), metavar="DIR",
              help="Compute errors against this run of higher resolution. Default: the errors in "
              "each summary.json.")  # fmt: skip
@click.option("--html", "as_html", is_flag=True,
              help="Write report.html, one page without links to other files. DIR may be a single "
              "run: the page describes that run, and is written into its directory.")  # fmt: skip
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="Directory of the report. Default: report/ in the first DIR.")  # fmt: skip
def report(sources, field, norm, cost, by, reference, as_html, directory):
    """Compare the error of several runs with their cost.

    DIR is a run directory, or a directory that contains run directories, such as
    the directory of a sweep. The report says which settings reach a given error
    at the lowest cost, and how much more the other settings cost.
    """
    from sph.analysis import report as reports

    question = reports.Question(field, norm, cost, by, reference)
    if as_html:
        from sph.analysis import html

        for path in html.write(sources, question, directory):
            click.echo(f"wrote {path}")
        return
    target = directory or sources[0] / "report"
    found = reports.make(sources, question)
    click.echo(reports.in_words(found))
    for path in reports.write(found, target):
        click.echo(f"wrote {path}")


@click.command()
@click.option("--only", multiple=True, metavar="NAME",
              help="Run only this case, or the cases that match a pattern such as 'noh_*'. "
              "`sph list` names the cases. May be repeated.")  # fmt: skip
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Set a key of the configuration for all cases, such as run.precision=single. "
              "Keys that a setting of a case sets keep their values. May be repeated.")  # fmt: skip
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              default=Path("runs/stress"), show_default=True,
              help="Directory of the runs.")  # fmt: skip
@click.option("--jobs", type=click.IntRange(min=1), metavar="N",
              help="Number of runs at once. Default: number of processors.")  # fmt: skip
def stress(only, overrides, directory, jobs):
    """Run difficult test cases and check their results.

    A case has several settings. Some settings are known not to work (expected
    failures) and must fail in a stated way. The same command, repeated, runs
    only what is missing. Exits with code 3 if a case does not pass.
    """
    from sph.stress import command, table

    suite, results = command.run(only, directory, jobs, overrides)
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
              help="Key whose stable range is searched.")  # fmt: skip
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Set a key of the configuration. May be repeated.")  # fmt: skip
@click.option("--limit", "limits", multiple=True, metavar="KEY=VALUE",
              help="Change the definition of a stable run or the accuracy of the search. Keys: "
              "reference, error_growth, deviation, negligible, resolution; see "
              "docs/stability.md. May be repeated.")  # fmt: skip
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="Directory of the runs. Default: runs/<name of CONFIG>-stability.")  # fmt: skip
@click.option("--jobs", type=click.IntRange(min=1), metavar="N",
              help="Number of runs at once. Default: number of processors.")  # fmt: skip
def stability(config, key, overrides, limits, directory, jobs):
    """Find by bisection the stable range of physics.C or physics.eta.

    The same command, repeated, runs only what is missing. Exits with code 3 if
    no value that was tried is stable.
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
