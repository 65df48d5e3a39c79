"""What LPR and Pajot et al. say of where samples should go, on samples rendered once (`../adaptive/renders.py`)."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from camera import Camera
from frames import COLOUR, planes
from pictures import Program, Reference
from scipy.ndimage import uniform_filter

FIRST, LAST = 4, 8
"""Samples per pixel of LPR Fig. 5: before the map, and with it."""
MAP_COLUMNS = ("scene", "offset", "correlation", "5x5", "own map", "reference's map", "uniform", "higher by")


def maps(scene: str, series: np.ndarray, side: int, offset: int, reference: Path, program: Program) -> tuple:
    """LPR Fig. 5: the map by the estimated error beside the one by the true one, and the error of the pictures that both lead to.

    Models, placement and pictures are LPR's to the letter (the study's `map`). The true error is that of the models over their prediction windows.
    """
    judged = Reference.read(reference)
    with tempfile.TemporaryDirectory() as folder:
        noisy, made = Path(folder) / "noisy.exr", Path(folder) / "map.exr"

        def picture(camera: Camera) -> dict[str, np.ndarray]:
            camera.write(noisy)
            program.study("map", noisy, reference, made)
            layers = {name: planes(made, (name,))[..., 0] for name in ("estimated", "true", "rank")}
            return {**layers, "colour": planes(made, COLOUR)}

        camera = Camera(series, side, offset)
        camera.render(np.full((side, side), FIRST))
        first = picture(camera)
        own = demand(first["estimated"], (first["colour"] ** 2).sum(-1), first["rank"], camera.counts)
        best = demand(first["true"], (judged.colour**2).sum(-1), first["rank"], camera.counts)
        errors = []
        for wanted in (own, best, np.ones((side, side))):
            camera = Camera(series, side, offset)
            camera.render(np.full((side, side), FIRST))
            camera.render(rounded(wanted, (LAST - FIRST) * side * side, offset))
            errors.append(judged.error(picture(camera)["colour"]))
    smooth = [uniform_filter(one / one.mean(), 5, mode="reflect") for one in (own, best)]
    return scene, offset, _alike(own, best), _alike(*smooth), *errors, errors[0] / errors[1] - 1


def demand(error: np.ndarray, squared: np.ndarray, rank: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """LPR section 5.2: xi n^(-4 / (d + 4)) / (f^2 + 0.001), errors and squares summed over the channels."""
    return np.maximum(error, 0) * counts ** (-4.0 / (rank + 4.0)) / (squared + 3 * 0.001)


def rounded(weight: np.ndarray, of_all: float, seed: int) -> np.ndarray:
    """Whole numbers in proportion to the weights, with that sum on average."""
    samples = weight * (of_all / max(weight.sum(), 1e-300))
    return np.floor(samples + np.random.default_rng(seed).random(weight.shape)).astype(np.int64)


def _alike(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


START, END, STEP = 10, 32, 4
"""Samples per pixel of Pajot et al.'s algorithm: one chunk for a first median, then steps of adaptive samples with as many uniform ones beside them, or not."""
CHUNK = 10
ROBUST_COLUMNS = ("scene", "offset", "way", "rmse", "worst hundredth", "spread of the relative error", "most samples")


def robust(scene: str, series: np.ndarray, side: int, offset: int, reference: Path) -> Iterator[tuple]:
    """Pajot et al.: by the mean or by the mean of medians, with errors cut at their 95th percentile or not, with uniform samples in between or not.

    Of the undenoised picture, as in the paper: rMSE, the part of it that the worst hundredth of the pixels has, and the spread (standard deviation over mean)
    of the true relative error over 15 x 15 pixels, which the paper wants uniform.
    """
    judged = Reference.read(reference)
    ways = {
        "uniform": None,
        "mean": (False, False, False),
        "mean of medians": (True, False, False),
        "mean, cut": (False, True, False),
        "mean of medians, cut": (True, True, False),
        "mean of medians, cut, alternating": (True, True, True),
    }
    for way, choice in ways.items():
        camera = Camera(series, side, offset)
        camera.render(np.full((side, side), START))
        if choice is None:
            camera.render(np.full((side, side), END - START))
        else:
            step(camera, series, choice, offset)
        picture = camera.means[..., :3]
        squared = (picture - judged.colour) ** 2 - judged.noise
        relative = (squared / (judged.colour**2 + 0.01)).mean(-1)
        local = np.maximum(uniform_filter(relative, 15, mode="reflect"), 0)
        worst = np.sort(relative.ravel())[-relative.size // 100 :].sum() / relative.sum()
        yield scene, offset, way, float(relative.mean()), float(worst), float(local.std() / local.mean()), int(camera.counts.max())


def step(camera: Camera, series: np.ndarray, choice: tuple[bool, bool, bool], offset: int) -> None:
    """Renders up to `END` samples per pixel."""
    by_medians, cut, alternating = choice
    side = camera.side
    while (left := END - camera.counts.mean()) > 0.5:
        adaptive = min(STEP, left) / (2 if alternating else 1)
        error = relative_error(camera, series, by_medians)
        if cut:
            error = np.minimum(error, np.percentile(error, 95))
        camera.render(rounded(error, adaptive * side * side, int(1000 * left) + offset))
        if alternating:
            camera.render(rounded(np.ones((side, side)), adaptive * side * side, int(1000 * left) + offset + 1))


def relative_error(camera: Camera, series: np.ndarray, by_medians: bool) -> np.ndarray:
    """Var / (N M^2) of the luminance, M the pixel's mean or the mean of the medians of chunks of 10 samples over 3 x 3 pixels, the mean where that is 0."""
    mean = camera.means[..., :3].mean(-1)
    variance = np.nan_to_num(camera.variances[..., :3]).mean(-1)
    level = mean
    if by_medians:
        medians = chunk_medians(camera, series)
        padded = np.pad(medians, 1, mode="edge")
        level = sum(padded[y : y + camera.side, x : x + camera.side] for y in range(3) for x in range(3)) / 9
        level = np.where(level > 0, level, mean)
    return np.where(variance > 0, variance / np.maximum(level**2, 1e-8), 0)


def chunk_medians(camera: Camera, series: np.ndarray) -> np.ndarray:
    """Mean, over a pixel's whole chunks, of the chunks' medians."""
    grey = series[..., :3].mean(-1)
    order = (camera.offset + np.arange(series.shape[1])) % series.shape[1]
    medians = np.median(grey[:, order][:, : series.shape[1] // CHUNK * CHUNK].reshape(len(grey), -1, CHUNK), axis=-1)
    whole = np.maximum(camera.counts.ravel() // CHUNK, 1)
    sums = np.cumsum(medians, axis=1)
    return (sums[np.arange(len(grey)), np.minimum(whole, medians.shape[1]) - 1] / whole).reshape(camera.side, camera.side)
