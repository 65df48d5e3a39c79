"""The program under test, and what it takes."""

from __future__ import annotations

import resource
import subprocess


class Failed(Exception):
    """A method has no picture; the message says why."""


def run(command: list[str]) -> float:
    """Runs a program; CPU seconds of it. Fails with its own words."""
    before = _children_seconds()
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        raise Failed(f"{command[0]}: {error.strerror}") from error
    if done.returncode:
        raise Failed(f"exit status {done.returncode}: {' '.join(done.stderr.split())[:300]}")
    return _children_seconds() - before


def _children_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
