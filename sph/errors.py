"""Errors that are reported to the user, each with the exit code of the program.

Their messages say what was wrong, where, what was expected and what to try.
"""


class SphError(Exception):
    """Base class. The command line prints the message, without a traceback."""

    exit_code = 1


class ConfigError(SphError):
    """The configuration or the command line is wrong."""

    exit_code = 2


class NumericalError(SphError):
    """The run produced NaNs or unphysical values.

    particle: ID of a particle that is affected, or 0 if the error concerns the whole run.
    """

    exit_code = 3

    def __init__(self, message: str, particle: int = 0):
        super().__init__(message)
        self.particle = particle


class FileError(SphError):
    """A file or directory is missing, of the wrong kind, unreadable or cannot be written."""

    exit_code = 4


class AtEnd(SphError):
    """The run has already reached its end time, so there is nothing to compute."""

    exit_code = 0


class Stopped(SphError):
    """The run stopped early and left a checkpoint that can be restarted."""

    exit_code = 75


def first_line(message: str) -> str:
    """Return the first line of a message, without its full stop."""
    return message.partition("\n")[0].rstrip(".")
