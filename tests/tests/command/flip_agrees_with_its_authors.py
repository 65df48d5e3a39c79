"""The figures that flip_agrees_with_its_authors.rs expects, by the authors' own program.

    pip install numpy flip-evaluator==1.7 && python3 flip_agrees_with_its_authors.py

Its mean is a sum in single precision, so the mean of its map is taken in double precision.
"""
import flip_evaluator
import numpy as np


def noise(seed, index):
    """As `linpred_tests::images::noise`."""
    wrap = 0xFFFFFFFF
    x = (index * 0x9E3779B9 & wrap) ^ (seed * 0x85EBCA6B & wrap)
    x = (x ^ (x >> 16)) * 0x7FEB352D & wrap
    x = (x ^ (x >> 15)) * 0x846CA68B & wrap
    return (((x ^ (x >> 16)) >> 8) / np.float64(1 << 24)).astype(np.float32)


def pair(width, height, seed):
    one, half = np.float32(1), np.float32(0.5)
    i = np.arange(width * height, dtype=np.uint64)
    lamp = np.where(noise(seed, i // 3) > np.float32(0.96), np.float32(40), one)
    reference = [noise(seed + 1 + k, i // 5) * lamp for k in range(3)]
    image = [plane * (half + noise(seed + 4 + k, i)) for k, plane in enumerate(reference)]
    return [np.ascontiguousarray(np.stack(a, -1).reshape(height, width, 3)) for a in (reference, image)]


for width, height, seed in [(97, 61, 1), (64, 32, 2), (9, 5, 3), (1, 40, 4)]:
    reference, image = pair(width, height, seed)
    errors, _, parameters = flip_evaluator.evaluate(reference, image, "HDR", applyMagma=False)
    mean = errors[:, :, 0].astype(np.float64).mean()
    print(f"({width}, {height}), {seed}, {mean:.9f}", parameters["numExposures"])
