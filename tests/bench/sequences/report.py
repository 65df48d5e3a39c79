#!/usr/bin/env python3
"""What a run says: tables and a plot. Makes those of a folder anew from its results.csv and failed.csv:

    python tests/bench/sequences/report.py DIR
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

# this file is a program of its own, too
sys.path.append(str(Path(__file__).resolve().parent.parent))

import csv_files
import judge
from judge import Measured
from methods import METHODS, VARIANTS

COLUMNS = ("sequence", "method", "frame", "gain", "psnr", "energy", "flicker", "visible", "seconds")
FAILED_COLUMNS = ("sequence", "method", "why")
DRAWN = {
    "linpred": "#555555",
    "linpred --temporal": "#c0392b",
    "OIDN": "#2980b9",
    "LPR 6 on balanced": "#8e44ad",
    "mean of denoised": "#b8860b",
    "mean of noisy": "#27ae60",
}
"""Methods of the plot and their colours. WLR flickers so much more that the others would not be told apart."""


def replace(folder: Path, sequence: str, method: str, rows: list[tuple], failed: list[tuple]) -> None:
    """Puts what was measured in the place of what that method had for that sequence before."""
    for name, columns, found in (("results.csv", COLUMNS, rows), ("failed.csv", FAILED_COLUMNS, failed)):
        kept = [row for row in csv_files.read(folder / name) if (row["sequence"], row["method"]) != (sequence, method)]
        csv_files.write(folder / name, columns, [tuple(row[column] for column in columns) for row in kept] + found)


class Figures:
    """A folder's results by sequence and method."""

    def __init__(self, folder: Path) -> None:
        self.frames: dict[tuple[str, str], list[tuple[int, Measured]]] = {}
        self.seconds: dict[tuple[str, str], str] = {}
        rows = csv_files.read(folder / "results.csv")
        for row in rows:
            key = row["sequence"], row["method"]
            measured = Measured(*(float(row[name]) for name in ("gain", "psnr", "energy", "flicker", "visible")))
            self.frames.setdefault(key, []).append((int(row["frame"]), measured))
            self.seconds[key] = row["seconds"]
        self.failed = {(row["sequence"], row["method"]): row["why"] for row in csv_files.read(folder / "failed.csv")}
        self.sequences = sorted({sequence for sequence, _ in (*self.frames, *self.failed)})

    def steady(self, sequence: str, method: str) -> Measured:
        return judge.steady([measured for _, measured in self.frames[sequence, method]])


def table(folder: Path) -> None:
    """Writes `table.md`."""
    figures = Figures(folder)
    text = [f"Frames from the {judge.STEADY + 1}th to the last: gain is the geometric mean, all else the mean.\n"]
    for sequence in figures.sequences:
        text += _of_sequence(figures, sequence, [method for method in METHODS if method not in VARIANTS])
    text.append("# What the papers leave open\n")
    for sequence in figures.sequences:
        text += _of_sequence(figures, sequence, list(VARIANTS))
    if figures.failed:
        text.append("# What failed\n")
        text += [f"- {sequence}, {method}: {why}" for (sequence, method), why in figures.failed.items()]
    (folder / "table.md").write_text("\n".join(text) + "\n")


def _of_sequence(figures: Figures, sequence: str, methods: list[str]) -> list[str]:
    methods = [method for method in methods if (sequence, method) in (figures.frames | figures.failed)]
    if not methods:
        return []
    lines = [f"## {sequence}\n", "| method | gain | PSNR, dB | energy | flicker | flicker, of linpred's | CPU s per frame |", "|---|---|---|---|---|---|---|"]
    alone = figures.steady(sequence, "linpred").flicker if (sequence, "linpred") in figures.frames else float("nan")
    for method in methods:
        if (sequence, method) in figures.failed:
            lines.append(f"| {method} | failed, see below | | | | | |")
        else:
            row, seconds = figures.steady(sequence, method), figures.seconds[sequence, method]
            shown = f"{float(seconds):.2f}" if seconds else ""
            ratio = "" if math.isnan(alone) else f"{row.flicker / alone:.2f}"
            lines.append(f"| {method} | {row.gain:.2f} | {row.psnr:.2f} | {row.energy:.3f} | {row.flicker:.5f} | {ratio} | {shown} |")
    return [*lines, ""]


def plot(folder: Path) -> None:
    """Draws `plot.svg`: gain and flicker of each frame, a column of panels for each sequence."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "linpred", "font.size": 9})
    figures = Figures(folder)
    columns = len(figures.sequences)
    drawing, panels = plt.subplots(2, columns, figsize=(1.6 + 3.2 * columns, 5.2), squeeze=False, sharex="col")
    for column, sequence in enumerate(figures.sequences):
        for panel, name in zip(panels[:, column], ("gain", "flicker")):
            for method, colour in DRAWN.items():
                drawn = [(frame, getattr(row, name)) for frame, row in figures.frames.get((sequence, method), [])]
                panel.plot([x for x, _ in drawn], [y for _, y in drawn], "o-", color=colour, markersize=3, linewidth=1.2, label=method)
            panel.grid(color="#dddddd", linewidth=0.5)
            # flicker may come out negative
            panel.set_ylim(bottom=min(0, panel.get_ylim()[0]))
        panels[0][column].set_title(sequence)
        panels[1][column].set_xlabel("frame")
    panels[0][0].set_ylabel("gain (more is better)")
    panels[1][0].set_ylabel("flicker (less is better)")
    panels[0][-1].legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
    drawing.tight_layout()
    drawing.savefig(folder / "plot.svg", metadata={"Date": None})


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    table(Path(sys.argv[1]))
    plot(Path(sys.argv[1]))
