"""Where the next samples go: each method takes what is known after a pass and gives so many more samples to each pixel."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import linpred
import numpy as np
from camera import Camera, read_map
from scipy.ndimage import binary_dilation, maximum_filter, uniform_filter

DARK = 0.003
FALL, MODERATION, EVEN = 0.7, 0.63, 0.25
"""linpred's own (`core/src/sampling.rs`), for the map of the true error."""


@dataclass
class State:
    """What a method may know.

    `reference` and `reference_variance` are for the oracle alone; `seed` is that of rounding; `folder` holds files in passing.
    """

    camera: Camera
    budget: float
    seed: int
    folder: Path
    reference: np.ndarray
    reference_variance: np.ndarray

    @property
    def noisy(self) -> np.ndarray:
        """Pixels with a variance in any of the 3 x 3 around."""
        return maximum_filter(np.nan_to_num(self.camera.variances[..., :3]).max(-1), 3) > 0


def denoised(camera: Camera, quality: str = "fast") -> linpred.Denoised:
    """What linpred makes of the samples so far."""
    return linpred.denoise(**camera.arrays(), quality=quality, threads=1)


def uniform(state: State) -> np.ndarray:
    return rounded(np.full(state.camera.counts.shape, state.budget), state.seed)


def ours(state: State) -> np.ndarray:
    """`linpred sample-map`."""
    noisy, to = state.folder / "all.exr", state.folder / "map.exr"
    state.camera.write(noisy)
    linpred.sample_map_file(noisy, to, budget=state.budget, threads=1)
    return read_map(to)


def own_variance(state: State) -> np.ndarray:
    """In proportion to the relative variance of the noisy pixel, by its own mean: the naive estimate of Pajot et al."""
    means, variances = state.camera.means[..., :3], np.nan_to_num(state.camera.variances[..., :3])
    return proportional(variances.mean(-1) / ((means**2).mean(-1) + DARK), state)


def lpr(state: State) -> np.ndarray:
    """LPR section 5.2 to the letter: new samples in proportion to its relative error."""
    found = denoised(state.camera)
    colour = found.colour.astype(np.float64)
    expected = found.error * state.camera.counts ** (-4.0 / (found.rank + 4.0))
    return proportional(expected / ((colour**2).mean(-1) + 0.001), state)


def oracle(state: State) -> np.ndarray:
    """linpred's allocation, by the error that its picture has."""
    return rounded(by_error(true_error(state), state), state.seed)


def true_error(state: State) -> np.ndarray:
    """Relative squared error of the denoised picture, the reference's own noise taken off, mean over 5 x 5 pixels."""
    squared = (denoised(state.camera).colour.astype(np.float64) - state.reference) ** 2 - state.reference_variance
    relative = squared.mean(-1) / ((np.maximum(state.reference, 0) ** 2).mean(-1) + DARK)
    return np.maximum(uniform_filter(relative, 5, mode="reflect"), 0)


def by_error(error: np.ndarray, state: State) -> np.ndarray:
    """Totals in proportion to the demands, and a share for all noisy pixels alike."""
    counts, noisy = state.camera.counts.astype(np.float64), state.noisy
    demand = np.where(noisy, (error * counts**FALL) ** (MODERATION / (1 + FALL)), 0)
    of_all = state.budget * counts.size
    return filled(demand, counts, (1 - EVEN) * of_all) + noisy * (EVEN * of_all / max(noisy.sum(), 1))


def filled(demand: np.ndarray, counts: np.ndarray, of_all: float) -> np.ndarray:
    """What is missing where totals are one level times the demands: `of_all` in sum."""
    need = counts.ravel() / np.maximum(demand.ravel(), 1e-300)
    order = np.argsort(need)
    levels = (of_all + np.cumsum(counts.ravel()[order])) / np.maximum(np.cumsum(demand.ravel()[order]), 1e-300)
    # the first level that the next pixel's total is above already
    last = np.argmax(levels <= np.append(need[order][1:], np.inf))
    return np.maximum(levels[last] * demand - counts, 0)


def proportional(weight: np.ndarray, state: State) -> np.ndarray:
    share = state.budget * weight.size / max(weight.sum(), 1e-300)
    return rounded(weight * share, state.seed)


def rounded(samples: np.ndarray, seed: int) -> np.ndarray:
    """Whole numbers with that mean."""
    return np.floor(samples + np.random.default_rng(seed).random(samples.shape)).astype(np.int64)


MAPS = {"uniform": uniform, "linpred": ours, "own variance": own_variance, "LPR": lpr, "oracle": oracle}


class Cycles:
    """Cycles' adaptive sampling: rounds of samples for the pixels whose noise is above a threshold, and those beside them.

    The noise of a pixel is |mean - mean of every second sample| over the square root of the mean, of the channels' sums. The threshold
    is the one that leads to so many samples on average; what a round costs is known beforehand, because the samples are.
    """

    ROUND = 4

    def __init__(self, series: np.ndarray, side: int, offset: int) -> None:
        pixels, most = series.shape[:2]
        self.rounds, self.side = most // self.ROUND, side
        colour = np.roll(series[..., :3], -offset, axis=1)[:, : self.rounds * self.ROUND].reshape(pixels, self.rounds, self.ROUND, 3)
        samples = np.arange(1, self.rounds + 1)[:, None] * self.ROUND
        means = np.cumsum(colour.sum(2), axis=1) / samples
        halves = np.cumsum(colour[:, :, ::2].sum(2), axis=1) / (samples / 2)
        self.noise = np.abs(means - halves).sum(-1) / (1e-4 + np.sqrt(np.maximum(means.sum(-1), 0)))

    def counts(self, samples: float) -> np.ndarray:
        """Samples of each pixel for that many on average."""
        low, high = 1e-7, float(self.noise.max())
        for _ in range(12):
            threshold = np.sqrt(low * high)
            low, high = (threshold, high) if self._until(threshold).mean() > samples else (low, threshold)
        return self._until(high)

    def _until(self, threshold: float) -> np.ndarray:
        counts = np.full((self.side, self.side), self.ROUND, np.int64)
        active = np.ones((self.side, self.side), bool)
        for index in range(self.rounds - 1):
            above = (self.noise[:, index] >= threshold).reshape(self.side, self.side)
            active &= binary_dilation(above & active, np.ones((3, 3)))
            if not active.any():
                break
            counts += self.ROUND * active
        return counts
