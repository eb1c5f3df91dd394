"""The program `surfel`, as `surfel ...` or `python -m surfel ...`."""

import os
import signal
import sys

from surfel._native import run_program


def main() -> int:
    """Runs the program by its command line; returns its exit code."""
    # The program stops by its own handler of Ctrl-C, as it does outside of Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # The interpreter by which the program finds this package.
    os.environ.setdefault("SURFEL_PYTHON", sys.executable)
    return run_program(["surfel", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
