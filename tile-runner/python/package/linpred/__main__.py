"""The command line, ``linpred``."""

from __future__ import annotations

import signal
import sys

from linpred import _linpred


def main() -> int:
    """Does what the arguments of the process ask for, and returns the exit code."""
    # the command stops cleanly at a signal, and says so by its exit code; Python would raise an exception on top
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _linpred.main(["linpred", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
