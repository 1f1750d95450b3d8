"""The command line."""

import signal
import sys

if __name__ == "__main__":  # python -m sph.cli: as `sph`, before the imports below take time
    from sph.__main__ import main as program

    sys.exit(program())

from pathlib import Path

import click

from sph import cli_studies, standard_streams
from sph.docstrings import docstring
from sph.errors import ConfigError, FileError, NumericalError, SphError
from sph.shell_words import quoted
from sph.version import __version__

OVERRIDES = click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE",
    help="Set a key of the configuration, e.g. --set physics.alpha=2.0; may be repeated.",
)  # fmt: skip
THREADS = click.option(
    "--threads", type=click.IntRange(min=1), metavar="N", help="Threads: run.threads for this run."
)
STRICT = click.option(
    "--strict", is_flag=True, help="Exit with 3 where the run ends with a warning."
)


class Program(click.Group):
    """Shows the program's own errors as their message and exits with their code."""

    def main(self, *arguments, **settings):
        standard_streams.secure()
        return super().main(*arguments, **settings)

    def invoke(self, context):
        try:
            return super().invoke(context)
        except SphError as error:
            click.echo(f"sph: {error}", err=True)
            sys.exit(error.exit_code)
        except OSError as error:  # such as a name that is too long, wherever it was looked at
            where = "" if error.filename is None else f"{error.filename}: "
            click.echo(f"sph: {where}{error.strerror or error}.", err=True)
            sys.exit(FileError.exit_code)
        except MemoryError as error:
            click.echo(f"sph: out of memory: {error}\nTry: a smaller problem.n.", err=True)
            sys.exit(ConfigError.exit_code)
        except KeyboardInterrupt:  # the second of two, where the first asks for a checkpoint
            click.echo("sph: ended by Ctrl-C", err=True)
            sys.exit(128 + signal.SIGINT)


@click.group(cls=Program, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="sph")
def main():
    """Smoothed particle hydrodynamics: fast, checked, and honest about its error."""


@main.command()
@click.argument("config", type=click.Path(path_type=Path))
@OVERRIDES
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="The run directory; runs/<name of CONFIG> if not given.")  # fmt: skip
@THREADS
@click.option("--dry-run", is_flag=True, help="Check CONFIG and say what the run would be.")
@click.option("--force", is_flag=True, help="Replace an earlier run in DIR.")
@STRICT
def run(config, overrides, directory, threads, dry_run, force, strict):
    """Run CONFIG, a TOML file, from its initial state to its end."""
    from sph import config as configuration

    resolved = configuration.load(config, _with_threads(overrides, threads))
    from sph.analysis import reference

    where = directory or Path("runs") / config.stem
    reference.check(resolved, where)
    if dry_run:
        from sph import preview

        standard_streams.deliver(preview.describe(resolved) + "\n")
        return
    from sph import progress, runner
    from sph.output.run_directory import RunDirectory

    target = RunDirectory.create(where, force)
    _tell(runner.run(resolved, target, progress.suited()), target, strict)


@main.command()
@click.argument("source", metavar="RUN_OR_CHECKPOINT", type=click.Path(path_type=Path))
@OVERRIDES
@THREADS
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="Go on in a new run directory; in the same one if not given.")  # fmt: skip
@STRICT
def restart(source, overrides, threads, directory, strict):
    """Go on from a run's last good checkpoint, or from that very checkpoint.

    In the same directory later checkpoints are replaced.
    """
    from sph import progress, restarting

    overrides = _with_threads(overrides, threads)
    _tell(*restarting.restart(source, overrides, directory, progress.suited()), strict)


@main.command()
@click.argument("sources", metavar="RUN_OR_CHECKPOINT...", nargs=-1, required=True,
                type=click.Path(path_type=Path))  # fmt: skip
@click.option("-o", "target", type=click.Path(path_type=Path), metavar="FILE",
              help="The file of one picture; else they go to figures/ of the run.")  # fmt: skip
def plot(sources, target):
    """Draw runs or checkpoints: profiles, maps, slices and the history."""
    from sph.analysis import figures

    for path in figures.draw(sources, target):
        click.echo(f"drew {path}")


@main.command()
@click.argument("problem")
@click.option("-o", "target", type=click.Path(path_type=Path), metavar="FILE",
              help="Write to FILE, which must not be there yet.")  # fmt: skip
def new(problem, target):
    """Print a configuration for PROBLEM with every key, its meaning, bounds and default."""
    from sph import config as configuration

    text = configuration.template(problem)
    if target is None:
        standard_streams.deliver(text)
        return
    from sph.output.files import write_new

    write_new(target, text)
    click.echo(f"wrote {target}")


@main.command("list")
def list_choices():
    """Name the problems, kernels, schemes, the other choices and the stress cases there are."""
    from sph import registry
    from sph.stress.case import load as stress_cases

    for package in (
        "problems", "kernels", "schemes", "eos", "viscosity.switches", "conductivity", "external",
        "heating",
    ):  # fmt: skip
        click.echo(f"{package}:")
        for name in registry.names(f"sph.{package}"):
            module = registry.load(f"sph.{package}", name)
            click.echo(f"  {name:24s} {docstring(module).strip().splitlines()[0]}")
    click.echo("stress cases:")
    for case in stress_cases():
        click.echo(f"  {case.name:24s} {case.title}")


def _tell(result, target, strict):
    """The closing words on stdout; that there are warnings also on stderr, where logs are read."""
    from sph import warnings
    from sph.analysis import summary

    click.echo(summary.in_words(result))
    click.echo(f"Results: {target.path} (`sph plot {quoted(target.path)}` draws them).")
    if kinds := warnings.kinds(result):
        said = f"{target.path} ended with warnings: {', '.join(kinds)} (see docs/warnings.md)"
        if strict:
            raise NumericalError(f"{said}.")
        click.echo(f"sph: {said}.", err=True)


def _with_threads(overrides, threads):
    return [*overrides, *([f"run.threads={threads}"] if threads else [])]


main.add_command(cli_studies.sweep)
main.add_command(cli_studies.report)
main.add_command(cli_studies.stress)
main.add_command(cli_studies.stability)

for _command in (main, *main.commands.values()):
    _command.help = docstring(_command.callback)
