"""Entry point of `sph` and `python -m sph`: signal handlers before the slow imports."""

import gc
import sys
from importlib.util import find_spec

from sph import stop_signals


def main():
    """Run the command line. SIGINT and SIGTERM end the program with one line, without traceback."""
    stop_signals.end_at_once()
    if find_spec("fcntl") is None or find_spec("resource") is None:
        print(
            "sph: this operating system is not supported: expected Linux or macOS.\n"
            "Try: on Windows, the Windows Subsystem for Linux.",
            file=sys.stderr,
        )
        sys.exit(4)
    # Imports and compilation make many objects and little garbage: at Python's threshold of 700
    # objects, looking for it takes a twentieth of their time.
    gc.set_threshold(100_000)
    from sph.cli import main as commands

    try:
        commands(prog_name="sph")
    finally:
        gc.freeze()  # at its end, Python looks for garbage in everything else: 0.07 s


if __name__ == "__main__":
    main()
