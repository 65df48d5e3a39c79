#!/usr/bin/env python3
"""What a run says: a table, a plot, pictures. Makes the table and the plot of a folder anew from its results.csv:

    python tests/bench/adaptive/report.py DIR
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

COLOURS = {"uniform": "#555555", "linpred": "#c0392b", "own variance": "#b8860b", "Cycles-like": "#2980b9", "LPR": "#8e44ad", "oracle": "#27ae60"}
COMPARED = (8, 16, 36, 64)
CROP = 64
SHOWN, CORNER = "toasters", (186, 50)
"""The scene of the pictures, and the upper left corner (x, y) of what is shown enlarged."""


COLUMNS = ("scene", "seed", "method", "total", "samples", "most", "rmse", "psnr", "flip", "energy", "capped")
LOOP_COLUMNS = ("scene", "samples", "passes", "rendering", "other")


def write(folder: Path, name: str, columns: tuple[str, ...], lines: list[tuple]) -> None:
    """Writes what was measured so far."""
    with open(folder / name, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(lines)


class Figures:
    """The rows of a folder's results by scene, seed, method and samples per pixel."""

    def __init__(self, folder: Path) -> None:
        self.correlations: dict[tuple[str, str, int], list[float]] = {}
        self._rows: dict[tuple[str, int, str, int], dict[str, float]] = {}
        with open(folder / "results.csv", newline="") as file:
            for row in csv.DictReader(file):
                scene, seed, method, total = row.pop("scene"), int(row.pop("seed")), row.pop("method"), int(row.pop("total"))
                found = {name: float(value) for name, value in row.items() if value != ""}
                if method.startswith("correlation"):
                    self.correlations.setdefault((scene, method, total), []).append(found["rmse"])
                else:
                    self._rows[scene, seed, method, total] = found
        self.scenes = list(dict.fromkeys(key[0] for key in self._rows))
        # those that all scenes have, where a run was ended early
        seeds = ({key[1] for key in self._rows if key[0] == scene} for scene in self.scenes)
        self.seeds = sorted(set.intersection(*seeds))

    def of(self, scene: str, method: str, samples: int, name: str) -> list[float]:
        """A figure of each seed."""
        return [self._rows[scene, seed, method, samples][name] for seed in self.seeds]

    def curve(self, scene: str, method: str) -> tuple[np.ndarray, np.ndarray]:
        """Samples per pixel and rMSE, mean over the seeds."""
        samples = sorted({key[3] for key in self._rows if key[0] == scene and key[2] == method})
        return np.array(samples), np.array([self.mean(scene, method, one, "rmse") for one in samples])

    def mean(self, scene: str, method: str, samples: int, name: str) -> float:
        """Over the seeds."""
        return float(np.mean(self.of(scene, method, samples, name)))

    def over_uniform(self, scene: str, method: str, samples: int, name: str = "rmse") -> float:
        """Geometric mean over the seeds."""
        here, there = (np.log(self.of(scene, one, samples, name)) for one in (method, "uniform"))
        return float(np.exp(np.mean(here - there)))

    def decibels(self, scene: str, method: str) -> float:
        """PSNR less that of uniform sampling, 16 samples."""
        return self.mean(scene, method, 16, "psnr") - self.mean(scene, "uniform", 16, "psnr")

    def saved(self, scene: str, method: str, samples: int) -> str:
        """How many times the samples uniform sampling needs for the same error."""
        at, errors = self.curve(scene, "uniform")
        errors = np.minimum.accumulate(errors)
        error = self.mean(scene, method, samples, "rmse")
        if error < errors[-1]:
            return f"> {at[-1] / samples:.2f}"
        return f"{np.exp(np.interp(-np.log(error), -np.log(errors), np.log(at))) / samples:.2f}"


def geometric(values: list[float]) -> float:
    return float(np.exp(np.mean(np.log(values))))


def table(folder: Path) -> None:
    """Writes the figures as tables."""
    figures = Figures(folder)
    text = [
        f"Means over {len(figures.seeds)} runs with other samples. The last column is the mean over the scenes but backdrop, four fifths of",
        "which have no noise: the geometric one of ratios. Samples are those of a pixel, on average.\n",
    ]
    tables = Tables(figures, text)
    for samples in COMPARED:
        tables.add(f"rMSE over that of uniform sampling, {samples} samples", lambda s, m: figures.over_uniform(s, m, samples))
    tables.add("The same, 16 samples, the worse run", lambda s, m: float(max(_ratios(figures, s, m, "uniform"))), max)
    tables.add("rMSE, 16 samples", lambda s, m: figures.mean(s, m, 16, "rmse"), form=".5f", methods=tuple(COLOURS))
    tables.add("PSNR less that of uniform sampling, dB, 16 samples", figures.decibels, np.mean, "+.2f")
    tables.add("FLIP over that of uniform sampling, 16 samples", lambda s, m: figures.over_uniform(s, m, 16, "flip"))
    for samples in (16, 64):
        tables.add(f"Energy: mean over the reference's, {samples} samples", lambda s, m: figures.mean(s, m, samples, "energy"), np.mean, ".4f", tuple(COLOURS))
    for samples in (16, 64):
        tables.add(f"How many times the {samples} samples uniform sampling needs for the same rMSE", lambda s, m: figures.saved(s, m, samples), None)
    tables.add("rMSE over that with the oracle's map, 16 samples", lambda s, m: geometric(_ratios(figures, s, m, "oracle")))
    tables.add("The most samples that a pixel got, 16 samples", lambda s, m: max(figures.of(s, m, 16, "most")), None, ".0f")
    tables.add("Share of the pixels that got all the samples there were, 64 samples", lambda s, m: figures.mean(s, m, 64, "capped"), None, ".4f")
    text.extend(_correlations(figures))
    text.extend(_seconds(folder))
    (folder / "table.md").write_text("\n".join(text))


class Tables:
    """Tables of methods and scenes, added to lines of text."""

    def __init__(self, figures: Figures, text: list[str]) -> None:
        self._scenes, self._text = figures.scenes, text

    def add(self, title: str, cell, mean=geometric, form: str = ".3f", methods: tuple[str, ...] = tuple(COLOURS)[1:]) -> None:
        """A table: `cell` of scene and method, `mean` of the scenes but backdrop, if there is any."""
        self._text.append(f"## {title}\n\n| method | {' | '.join(self._scenes)} | mean |\n|---|{'---|' * (len(self._scenes) + 1)}")
        for method in methods:
            values = {scene: cell(scene, method) for scene in self._scenes}
            of_all = "" if mean is None else format(mean([value for scene, value in values.items() if scene != "backdrop"]), form)
            shown = (value if isinstance(value, str) else format(value, form) for value in values.values())
            self._text.append(f"| {method} | {' | '.join(shown)} | {of_all} |")
        self._text.append("")


def _ratios(figures: Figures, scene: str, method: str, other: str) -> np.ndarray:
    """Of rMSE at 16 samples, for each seed."""
    return np.divide(figures.of(scene, method, 16, "rmse"), figures.of(scene, other, 16, "rmse"))


def _correlations(figures: Figures) -> list[str]:
    lines = ["## Correlation of linpred's map with the oracle's\n", f"| samples per pixel | over means of | {' | '.join(figures.scenes)} | mean of all |"]
    lines.append(f"|---|---|{'---|' * (len(figures.scenes) + 1)}")
    for kind, samples in dict.fromkeys(key[1:] for key in figures.correlations):
        values = [float(np.mean(figures.correlations[scene, kind, samples])) for scene in figures.scenes]
        lines.append(f"| {samples} | {kind.split()[1]} | {' | '.join(f'{value:.2f}' for value in values)} | {np.mean(values):.2f} |")
    return [*lines, ""]


def _seconds(folder: Path) -> list[str]:
    if not (folder / "loop.csv").is_file():
        return []
    with open(folder / "loop.csv", newline="") as file:
        seconds = list(csv.DictReader(file))
    lines = ["## Seconds of a whole loop, `linpred.mitsuba.render`\n"]
    lines += ["| scene | samples per pixel | passes | rendering | everything else | share |", "|---|---|---|---|---|---|"]
    for row in seconds:
        rendering, other = float(row["rendering"]), float(row["other"])
        lines.append(f"| {row['scene']} | {row['samples']} | {row['passes']} | {rendering:.1f} | {other:.1f} | {other / (rendering + other):.0%} |")
    return [*lines, ""]


def plot(folder: Path) -> None:
    """Error against samples per pixel, a panel for each scene."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "linpred", "font.size": 9})
    figures = Figures(folder)
    drawing, panels = plt.subplots(1, len(figures.scenes), figsize=(3.2 * len(figures.scenes), 3.4), squeeze=False)
    for panel, scene in zip(panels[0], figures.scenes):
        for method, colour in COLOURS.items():
            samples, errors = figures.curve(scene, method)
            shown = samples <= 64
            panel.loglog(samples[shown], errors[shown], "o-", color=colour, markersize=3, linewidth=1.2, label=method)
        panel.set_title(scene)
        panel.set_xlabel("samples per pixel")
        panel.set_xticks([4, 8, 16, 32, 64], ["4", "8", "16", "32", "64"])
        panel.minorticks_off()
        panel.grid(color="#dddddd", linewidth=0.5)
    panels[0][0].set_ylabel("rMSE of the denoised picture")
    panels[0][-1].legend(frameon=False)
    drawing.tight_layout()
    drawing.savefig(folder / "plot.svg", metadata={"Date": None})


def pictures(scene: str, found: dict[str, np.ndarray], folder: Path) -> None:
    """The maps of a scene, and of one scene the pictures side by side: whole, and a part of them enlarged."""
    _png(folder / f"map-{scene}.png", np.concatenate([_shade(found["linpred map"]), _shade(found["oracle map"])], axis=1))
    if scene != SHOWN:
        return
    shade = np.repeat(_shade(found["linpred map"])[..., None], 3, axis=-1)
    panels = [_srgb(found["uniform"]), _srgb(found["linpred"]), _srgb(found["reference"]), shade]
    _png(folder / "adaptive.png", np.concatenate(panels, axis=1))
    x, y = CORNER
    crops = [panel[y : y + CROP, x : x + CROP].repeat(4, 0).repeat(4, 1) for panel in panels]
    _png(folder / "adaptive-crop.png", np.concatenate(crops, axis=1))


def _shade(counts: np.ndarray) -> np.ndarray:
    """Samples per pixel as grey: each doubling is a step, from 4 (black) to 128 (white)."""
    grey = np.clip(np.log2(np.maximum(counts, 1) / 4) / 5, 0, 1)
    return np.round(255 * grey).astype(np.uint8)


def _srgb(colour: np.ndarray) -> np.ndarray:
    light = np.clip(colour, 0, 1)
    return np.round(255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)).astype(np.uint8)


def _png(path: Path, pixels: np.ndarray) -> None:
    from PIL import Image

    Image.fromarray(pixels).save(path, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    table(Path(sys.argv[1]))
    plot(Path(sys.argv[1]))
