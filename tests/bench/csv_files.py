"""Results as CSV files with a line of names."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path


def read(path: Path) -> list[dict[str, str]]:
    """The lines of a file by their columns; none where there is no file."""
    if not path.is_file():
        return []
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def write(path: Path, columns: Iterable[str], lines: Iterable[Iterable[object]]) -> None:
    """Writes a file anew."""
    with open(path, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(lines)
