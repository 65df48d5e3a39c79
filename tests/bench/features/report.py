#!/usr/bin/env python3
"""What a run says: tables. Makes those of a folder anew from its results.csv and failed.csv:

    python tests/bench/features/report.py DIR
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from pathlib import Path

# this file is a program of its own, too
sys.path.append(str(Path(__file__).resolve().parent.parent))

import csv_files
from methods import METHODS, NOISY, NONE

KEY = ("folder", "scene", "samples", "method")
COLUMNS = (*KEY, "gain", "rmse", "psnr", "flip", "energy", "top1", "pinholes", "sparks", "seconds")
FAILED_COLUMNS = (*KEY, "why")
Key = tuple[str, str, str, str]


def replace(folder: Path, key: Key, row: tuple[object, ...] | None, why: str) -> None:
    """Puts what was measured, or why nothing was, in the place of what that method had for that image before."""
    for name, columns, new in (("results.csv", COLUMNS, row), ("failed.csv", FAILED_COLUMNS, (why,) if why else None)):
        kept = [tuple(line[column] for column in columns) for line in csv_files.read(folder / name) if tuple(line[column] for column in KEY) != key]
        csv_files.write(folder / name, columns, [*kept, (*key, *new)] if new else kept)


class Figures:
    """A folder's results by method and image."""

    def __init__(self, folder: Path) -> None:
        self.rows = {(line["method"], (line["folder"], line["scene"], int(line["samples"]))): line for line in csv_files.read(folder / "results.csv")}
        self.failed = {tuple(line[column] for column in KEY): line["why"] for line in csv_files.read(folder / "failed.csv")}
        self.images = sorted({image for _, image in self.rows})
        self.folders = sorted({image[0] for image in self.images})

    def of(self, method: str, images: Iterable[tuple[str, str, int]], column: str) -> list[float]:
        return [float(self.rows[method, image][column] or "nan") for image in images]

    def all_of(self, method: str, images: list[tuple[str, str, int]]) -> bool:
        return bool(images) and all((method, image) in self.rows for image in images)


def _geometric(values: list[float]) -> float:
    return math.exp(sum(map(math.log, values)) / len(values))


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def _furthest(values: list[float]) -> float:
    """From 1."""
    return max(values, key=lambda value: abs(value - 1))


def table(folder: Path) -> None:
    """Writes `table.md`."""
    figures = Figures(folder)
    text = []
    for name in figures.folders:
        images = [image for image in figures.images if image[0] == name]
        text += [f"# {name}\n", *_gains(figures, images), *_measures(figures, images), *_noise(figures, images)]
    if figures.failed:
        text.append("# What failed\n")
        text += [f"- {key[0]}, {key[1]}, {key[2]} spp, {key[3]}: {why}" for key, why in figures.failed.items()]
    (folder / "table.md").write_text("\n".join(text) + "\n")


def _gains(figures: Figures, images: list[tuple[str, str, int]]) -> list[str]:
    """Gain of each image, and over all."""
    head = " | ".join(f"{scene} {samples}" for _, scene, samples in images)
    lines = ["Gain:\n", f"| further features | {head} | all | of none's |", "|---" * (len(images) + 3) + "|"]
    for method in METHODS:
        if method != "noisy" and figures.all_of(method, images):
            gains = figures.of(method, images, "gain")
            ratio = f"{_geometric(gains) / _geometric(figures.of(NONE, images, 'gain')):.3f}" if figures.all_of(NONE, images) else ""
            lines.append(f"| {method} | {' | '.join(f'{gain:.2f}' for gain in gains)} | {_geometric(gains):.2f} | {ratio} |")
    return [*lines, ""]


def _measures(figures: Figures, images: list[tuple[str, str, int]]) -> list[str]:
    """Everything else, over all images."""
    lines = ["Means over the images, of energy and highlights the one that is furthest off:\n"]
    lines += ["| further features | PSNR, dB | FLIP | energy | highlights | pinholes | sparks | CPU, of none's |", "|---" * 8 + "|"]
    for method in METHODS:
        if not figures.all_of(method, images):
            continue
        cells = [f"{_mean(figures.of(method, images, 'psnr')):.2f}", f"{_mean(figures.of(method, images, 'flip')):.4f}"]
        cells += [f"{_furthest(figures.of(method, images, column)):.3f}" for column in ("energy", "top1")]
        cells += [f"{_mean(figures.of(method, images, column)):.0f}" for column in ("pinholes", "sparks")]
        ratio = sum(figures.of(method, images, "seconds")) / sum(figures.of(NONE, images, "seconds")) if figures.all_of(NONE, images) else math.nan
        lines.append(f"| {method} | {' | '.join(cells)} | {'' if math.isnan(ratio) else f'{ratio:.2f}'} |")
    return [*lines, ""]


def _noise(figures: Figures, images: list[tuple[str, str, int]]) -> list[str]:
    """What features that say nothing cost, of the gain without them."""
    lines = ["Gain lost to features that say nothing:\n", "| | all images | worst | where |", "|---|---|---|---|"]
    for method in NOISY:
        if figures.all_of(method, images) and figures.all_of(NONE, images):
            ratios = [own / none for own, none in zip(figures.of(method, images, "gain"), figures.of(NONE, images, "gain"), strict=True)]
            worst = min(range(len(images)), key=ratios.__getitem__)
            lines.append(f"| {method} | {_percent(_geometric(ratios))} | {_percent(ratios[worst])} | {images[worst][1]}, {images[worst][2]} spp |")
    return [*lines, ""] if len(lines) > 3 else []


def _percent(ratio: float) -> str:
    return f"{100 * (1 - ratio):.2f} %"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    table(Path(sys.argv[1]))
