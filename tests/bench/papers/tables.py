#!/usr/bin/env python3
"""What a run says: tables and a plot. Makes those of a folder anew from its CSV files:

    python tests/bench/papers/tables.py DIR
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

Row = dict[str, str]


def write(path: Path, rows: list[dict[str, object]]) -> None:
    """As CSV, numbers to five digits."""
    columns = list(dict.fromkeys(column for row in rows for column in row))
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows({column: _short(value) for column, value in row.items()} for row in rows)


def _short(value: object) -> object:
    return f"{value:.5g}" if isinstance(value, float) else value


def write_all(folder: Path) -> None:
    """Writes `table.md` and `convergence.svg`."""
    text = []
    for name, title, make in TABLES:
        rows = _read(folder / f"{name}.csv")
        if rows:
            text += [f"## {title}\n", *make(rows), ""]
    (folder / "table.md").write_text("\n".join(text))
    if rows := _read(folder / "convergence.csv"):
        import convergence

        convergence.plot(rows, folder / "convergence.svg")


def _read(path: Path) -> list[Row]:
    if not path.is_file():
        return []
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def _plain(rows: list[Row]) -> list[str]:
    """All columns as they are."""
    return _lines(list(rows[0]), [list(row.values()) for row in rows])


def _lines(columns: list[str], rows: Iterable[list[str]]) -> list[str]:
    return [f"| {' | '.join(columns)} |", f"|{'---|' * len(columns)}", *(f"| {' | '.join(row)} |" for row in rows)]


def _crossed(row: str, value: str) -> Callable[[list[Row]], list[str]]:
    """A line for each `row`, a column for each picture (scene and samples), and the mean over them: of errors the geometric one."""
    geometric = value == "rmse"

    def table(rows: list[Row]) -> list[str]:
        pictures = list(dict.fromkeys((found["scene"], found["samples"]) for found in rows if found["samples"]))
        cells = {(found[row], found["scene"], found["samples"]): found.get(value, "") for found in rows}
        lines = []
        for name in dict.fromkeys(found[row] for found in rows):
            values = [cells.get((name, *picture), "") for picture in pictures]
            numbers = [float(v) for v in values if v] or [float("nan")]
            average = np.exp(np.mean(np.log(np.maximum(numbers, 1e-12)))) if geometric else np.mean(numbers)
            lines.append([name, *values, f"{average:.4g}" if any(values) else ""])
        return _lines([value, *(f"{scene} {samples}" for scene, samples in pictures), "geometric mean" if geometric else "mean"], lines)

    return table


def _several(row: str, *values: str) -> Callable[[list[Row]], list[str]]:
    """A table for each value that some line has."""

    def table(rows: list[Row]) -> list[str]:
        there = [value for value in values if any(found.get(value) for found in rows)]
        return [line for value in there for line in (*_crossed(row, value)(rows), "")]

    return table


def _validation(rows: list[Row]) -> list[str]:
    """Errors and models, and the times apart."""
    times = [{**row, "ratio": row["rmse"], "what": row["estimate"].removeprefix("time: ")} for row in rows if row["estimate"].startswith("time: ")]
    rest = [row for row in rows if not row["estimate"].startswith("time: ")]
    return [*_several("estimate", "rmse", "models per pixel", "mean rank")(rest), *_crossed("what", "ratio")(times)]


def _convergence(rows: list[Row]) -> list[str]:
    import convergence

    text = _crossed("method", "rmse")([row for row in rows if row["samples"]])
    text += ["", "Slope of the logarithm over all counts, and over those from 64 on; -1 is that of the mean of independent samples.", ""]
    lines = []
    for scene, method in dict.fromkeys((row["scene"], row["method"]) for row in rows if row["samples"]):
        points = [(int(row["samples"]), float(row["rmse"])) for row in rows if (row["scene"], row["method"]) == (scene, method)]
        slopes = [convergence.slope(*zip(*(p for p in points if p[0] >= least and p[1] > 0))) for least in (0, 64)]
        lines.append([scene, method, *(f"{slope:.2f}" for slope in slopes)])
    return text + _lines(["scene", "method", "all", "from 64"], lines)


TABLES: tuple[tuple[str, str, Callable[[list[Row]], list[str]]], ...] = (
    (
        "choice",
        "Half-widths by the estimate and by the reference",
        _several(
            "way",
            "correlation",
            "correlation of cells",
            "correlation from r = 1 on",
            "correlation of cells from r = 1 on",
            "rank correlation",
            "mean k",
            "mean k of the reference",
            "own pixel",
            "own pixel of the reference",
            "error over the reference's choice",
            "own error over the reference's choice",
            "widest: correlation of logarithms",
            "reference choices of two renders",
            "estimate with the other render's reference",
        ),
    ),
    ("validation", "Estimates over the same windows, by LPR's own placement", _validation),
    ("centres", "The program's models", _several("formulas", "models per pixel", "mean rank", "rmse")),
    ("regression", "Parts of WLR", _several("way", "rmse", "rank", "seconds")),
    ("estimates", "Estimates of WLR's squared error at h = 1", _plain),
    ("maps", "Maps of samples, LPR section 5.2", _plain),
    ("robust", "Robust estimates, Pajot et al.", _plain),
    ("convergence", "rMSE against samples", _convergence),
)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.path += [str(Path(__file__).resolve().parent.parent / folder) for folder in ("sequences", "adaptive")]
    write_all(Path(sys.argv[1]))
