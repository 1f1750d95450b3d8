"""Errors a user meets: a message that says what to do, and the exit code of the program."""


class SphError(Exception):
    """Shown as its message alone, without a traceback."""

    exit_code = 1


class ConfigError(SphError):
    """The configuration or the command line is wrong."""

    exit_code = 2


class NumericalError(SphError):
    """The run came to numbers that mean nothing; `particle`: the ID of one that shows it, or 0."""

    exit_code = 3

    def __init__(self, message: str, particle: int = 0):
        super().__init__(message)
        self.particle = particle


class FileError(SphError):
    """A file or directory is missing, not what it should be, or cannot be written."""

    exit_code = 4


class AtEnd(SphError):
    """There is nothing left to compute, and nothing was asked for that would change that."""

    exit_code = 0


class Stopped(SphError):
    """The run stopped early and left a checkpoint that can be restarted."""

    exit_code = 75


def first_line(message: str) -> str:
    """What a message says first, without its full stop."""
    return message.partition("\n")[0].rstrip(".")
