"""The command `sph` and its subcommands on single runs; for many runs see `cli_studies`."""

import signal
import sys

if __name__ == "__main__":  # python -m sph.cli: install signal handlers before the slow imports
    from sph.__main__ import main as program

    sys.exit(program())

from pathlib import Path

import click

from sph import cli_results, cli_studies, standard_streams
from sph.docstrings import docstring
from sph.errors import ConfigError, FileError, NumericalError, SphError
from sph.shell_words import quoted
from sph.version import __version__

OVERRIDES = click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE",
    help="Set a key of the configuration, e.g. --set physics.alpha=2.0. May be repeated.",
)  # fmt: skip
THREADS = click.option(
    "--threads",
    type=click.IntRange(min=1),
    metavar="N",
    help="Number of threads. Overrides the key run.threads.",
)
STRICT = click.option(
    "--strict", is_flag=True, help="Exit with code 3 if the finished run has warnings."
)


class Program(click.Group):
    """A command group that prints an SphError as its message and exits with its exit code."""

    def main(self, *arguments, **settings):
        standard_streams.secure()
        return super().main(*arguments, **settings)

    def invoke(self, context):
        try:
            return super().invoke(context)
        except SphError as error:
            click.echo(f"sph: {error}", err=True)
            sys.exit(error.exit_code)
        except OSError as error:  # such as a file name that is too long
            where = "" if error.filename is None else f"{error.filename}: "
            click.echo(f"sph: {where}{error.strerror or error}.", err=True)
            sys.exit(FileError.exit_code)
        except MemoryError as error:
            click.echo(f"sph: out of memory: {error}\nTry: a smaller problem.n.", err=True)
            sys.exit(ConfigError.exit_code)
        except KeyboardInterrupt:  # a second Ctrl-C; the first asks a run for a checkpoint
            click.echo("sph: ended by Ctrl-C", err=True)
            sys.exit(128 + signal.SIGINT)


@click.group(cls=Program, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="sph")
def main():
    """Smoothed-particle hydrodynamics (SPH) of gases, liquids and solids.

    \b
    First steps:
      sph list                           lists problems, kernels and schemes
      sph new shock_tube -o tube.toml    writes a commented configuration
      sph run tube.toml                  runs it, in the directory runs/tube
      sph plot runs/tube                 draws profiles and the history
      sph movie runs/tube                makes a movie

    \b
    Exit codes: 0 done, 2 wrong configuration or command line, 3 numerical
    failure, 4 input or output error, 75 stopped early with a checkpoint.
    """


@main.command()
@click.argument("config", type=click.Path(path_type=Path))
@OVERRIDES
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="Run directory, for all output. Default: runs/<name of CONFIG>.")  # fmt: skip
@THREADS
@click.option("--dry-run", is_flag=True,
              help="Check CONFIG and describe the run, without running.")  # fmt: skip
@click.option("--force", is_flag=True, help="Replace an earlier run in DIR.")
@STRICT
def run(config, overrides, directory, threads, dry_run, force, strict):
    """Run the configuration file CONFIG (TOML).

    The run directory holds checkpoints, the history of all time steps, and
    summary.json, which gives conservation errors and, if an exact solution
    exists, the errors of the final state.
    """
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
    from sph.scene import Scene

    _ = Scene(resolved).all_parts  # errors of declarations, before a directory is made
    target = RunDirectory.create(where, force)
    _print_result(runner.run(resolved, target, progress.suited()), target, strict)


@main.command()
@click.argument("source", metavar="RUN_OR_CHECKPOINT", type=click.Path(path_type=Path))
@OVERRIDES
@THREADS
@click.option("-o", "directory", type=click.Path(path_type=Path), metavar="DIR",
              help="New run directory to continue in. Default: the run's own.")  # fmt: skip
@STRICT
def restart(source, overrides, threads, directory, strict):
    """Continue a run from a checkpoint.

    RUN_OR_CHECKPOINT is a checkpoint file, or a run directory, of which the
    last valid checkpoint is used. Without -o, the run's later checkpoints are
    replaced. docs/configuration.md says which keys --set may change in a
    restart.
    """
    from sph import progress, restarting

    overrides = _with_threads(overrides, threads)
    _print_result(*restarting.restart(source, overrides, directory, progress.suited()), strict)


@main.command()
@click.argument("problem")
@click.option("-o", "target", type=click.Path(path_type=Path), metavar="FILE",
              help="Write to FILE, which must not exist. Default: standard output.")  # fmt: skip
def new(problem, target):
    """Print a commented configuration for PROBLEM.

    PROBLEM is a name, which `sph list` shows, or a Python file of your own, NAME.py.
    The text gives the meaning, bounds and default of each key.
    """
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
    """List problems, kernels, schemes, other models and stress cases."""
    from sph import registry
    from sph.config.outside import of_packages
    from sph.config.physics import model_folders
    from sph.stress.case import load as stress_cases

    top = {f"sph.{name}": name for name in ("problems", "formulations", "parts", "kernels", "eos")}
    for package, title in (top | model_folders()).items():
        click.echo(f"{title}:")
        folders = package in ("sph.formulations", "sph.parts")
        for name in registry.names(package, folders):
            module = registry.load(package, name, folders)
            first, *_ = docstring(module).splitlines() or ["(no docstring)"]
            click.echo(f"  {name:24s} {first}")
        for name, kind in of_packages().items() if package == "sph.problems" else ():
            first, *_ = docstring(kind).splitlines() or ["(no docstring)"]
            click.echo(f"  {name:24s} {first} ({kind.model_fields['package'].default})")
    click.echo("stress cases:")
    for case in stress_cases():
        click.echo(f"  {case.name:24s} {case.title}")


def _print_result(result, target, strict):
    """Print the summary of a finished run to stdout, and the kinds of its warnings to stderr.

    Raises NumericalError if `strict` and there are warnings.
    """
    from sph import warnings
    from sph.analysis import summary

    click.echo(summary.in_words(result))
    click.echo(f"Results: {target.path} (`sph plot {quoted(target.path)}` draws them).")
    if kinds := warnings.kinds(result):
        text = f"{target.path} ended with warnings: {', '.join(kinds)} (see docs/warnings.md)."
        if strict:
            raise NumericalError(text)
        click.echo(f"sph: {text}", err=True)


def _with_threads(overrides, threads):
    return [*overrides, *([f"run.threads={threads}"] if threads else [])]


main.add_command(cli_results.plot)
main.add_command(cli_results.movie)
main.add_command(cli_results.info)
main.add_command(cli_results.export)
main.add_command(cli_studies.sweep)
main.add_command(cli_studies.report)
main.add_command(cli_studies.stress)
main.add_command(cli_studies.stability)

for _command in (main, *main.commands.values()):
    _command.help = docstring(_command.callback)
