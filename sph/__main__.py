"""The program from its first moment: signals are heeded before any import that takes time."""

import sys
from importlib.util import find_spec

from sph import stop_signals


def main():
    """Run the command line. A signal that no command takes care of ends it in one line."""
    stop_signals.end_at_once()
    if find_spec("fcntl") is None or find_spec("resource") is None:
        print(
            "sph: this system is not POSIX: sph runs on Linux and macOS.\n"
            "Try: on Windows, the Windows Subsystem for Linux.",
            file=sys.stderr,
        )
        sys.exit(4)
    from sph.cli import main as commands

    commands(prog_name="sph")


if __name__ == "__main__":
    main()
