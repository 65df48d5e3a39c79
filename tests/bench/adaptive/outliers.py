#!/usr/bin/env python3
"""How far estimates of a relative error are misled by outliers: Figure 1a of Pajot et al., Robust Adaptive Sampling for Monte-Carlo-Based Rendering.

    python tests/bench/adaptive/outliers.py [--region 1] [--runs 8]

A wall of radiance 1: 64 samples in each pixel, uniform from 0 to 2. In REGION x REGION pixels in its middle some of the samples are replaced by outliers,
which a renderer draws where it samples badly what matters. Of these pixels the table tells estimated over true relative error:

naive     Var / (N I^2), I the pixel's own mean, over Var / N: the figure's e_a / e_r; geometric mean over runs with other samples
medians   the paper's own, I replaced by the mean of medians of chunks of 10 samples, over 3 x 3 pixels; likewise
denoised  the same variance, I replaced by what linpred makes of the pixel: how linpred makes an error relative; likewise
linpred   linpred's predicted squared error over its colour's square and 0.003, over what its squared error is, over 1.003: means over the runs of
          either, divided, because one run's squared error is no expectation
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

try:
    import linpred
except ImportError:
    sys.exit("linpred is not installed: pip install ./tile-runner/python")

SIZE, SAMPLES, CHUNK = 48, 64, 10
DARK = 0.003
COUNTS, VALUES = (0, 1, 2, 4, 8, 16), (10.0, 100.0, 1e3, 1e4)


def wall(outliers: int, value: float, region: slice, random: np.random.Generator) -> np.ndarray:
    """(SIZE, SIZE, SAMPLES) grey samples."""
    samples = random.uniform(0, 2, (SIZE, SIZE, SAMPLES))
    for y in range(region.start, region.stop):
        for x in range(region.start, region.stop):
            samples[y, x, random.choice(SAMPLES, outliers, replace=False)] = value
    return samples


def mean_of_medians(samples: np.ndarray) -> np.ndarray:
    """Of each pixel, over the 3 x 3 around it: the order of a pixel's samples is that of rendering."""
    whole = SAMPLES // CHUNK * CHUNK
    medians = np.median(samples[..., :whole].reshape(SIZE, SIZE, -1, CHUNK), axis=-1).mean(-1)
    padded = np.pad(medians, 1, mode="edge")
    return sum(padded[y : y + SIZE, x : x + SIZE] for y in range(3) for x in range(3)) / 9


def grey(plane: np.ndarray) -> np.ndarray:
    return np.repeat(plane[..., None], 3, axis=-1).astype(np.float32)


def estimates(samples: np.ndarray, region: slice) -> dict[str, np.ndarray]:
    """Of the region's pixels: I of each kind, and linpred's own error beside the one it makes."""
    mean, variance = samples.mean(-1), samples.var(-1, ddof=1) / SAMPLES
    flat = grey(np.full((SIZE, SIZE), 0.5))
    clean = linpred.denoise(grey(mean), variance=grey(variance), albedo=flat, normal=flat, depth=flat[..., 0], threads=1)
    colour = clean.colour[..., 0].astype(np.float64)
    found = dict(naive=mean, medians=mean_of_medians(samples), denoised=colour, predicted=clean.error / (colour**2 + DARK), true=(colour - 1) ** 2 / (1 + DARK))
    return {name: plane[region, region].ravel() for name, plane in found.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--region", type=int, default=1, help="pixels a side that have outliers")
    parser.add_argument("--runs", type=int, default=8)
    asked = parser.parse_args()
    first = (SIZE - asked.region) // 2
    region = slice(first, first + asked.region)
    print(f"linpred {linpred.__version__}, {asked.region} x {asked.region} pixels with outliers, {asked.runs} runs\n")
    print("| outliers of 64 | value | naive | medians | denoised | linpred |\n|---|---|---|---|---|---|")
    within = [0, 0, 0]
    misled = 0
    for value in VALUES:
        for count in COUNTS:
            runs = [estimates(wall(count, value, region, np.random.default_rng([run, count])), region) for run in range(asked.runs)]
            every = {name: np.concatenate([run[name] for run in runs]) for name in runs[0]}
            ratios = [float(np.exp(np.mean(np.log(np.maximum(every[name], 1e-9) ** -2.0)))) for name in ("naive", "medians", "denoised")]
            ratios.append(float(every["predicted"].mean() / max(every["true"].mean(), 1e-12)))
            print(f"| {count} | {value:g} | {' | '.join(f'{ratio:.3g}' for ratio in ratios)} |")
            if ratios[0] < 0.1:
                misled += 1
                within = [seen + (1 / 3 <= ratio <= 3) for seen, ratio in zip(within, ratios[1:])]
    found = ", ".join(f"{name} {seen}" for name, seen in zip(("medians", "denoised", "linpred"), within))
    print(f"\nWhere the naive estimate is below 0.1 of the true one ({misled} rows), within 1/3 to 3 of it: {found}.")


if __name__ == "__main__":
    main()
