"""What one would try first: bilinear reprojection along the motion, and a mean."""

from __future__ import annotations

import numpy as np
from judge import carried

PAST = 3
"""Frames before a frame that are averaged with it."""


def paths(motions: list[np.ndarray], frame: int) -> list[np.ndarray]:
    """From each pixel of a frame to where it was 1, 2, ... frames before, (height, width, 2): the motions (of all frames) one after the other."""
    total, found = np.zeros_like(motions[frame]), []
    for before in range(frame, max(frame - PAST, 0), -1):
        step, _ = carried(motions[before], total)
        total = total + step
        found.append(total)
    return found


def mean_of_frames(images: list[np.ndarray], motions: list[np.ndarray], frame: int) -> np.ndarray:
    """Mean of a frame and those before it, as far as a pixel's way stays inside them."""
    total, count = images[frame].copy(), np.ones(images[frame].shape[:2])
    for back, path in enumerate(paths(motions, frame), 1):
        image, inside = carried(images[frame - back], path)
        total += image * inside[..., None]
        count += inside
    return total / count[..., None]


def mean_of_noise(variances: list[np.ndarray], motions: list[np.ndarray], frame: int) -> np.ndarray:
    """Variance of that mean: bilinear weights and shares enter with their squares."""
    total, count = variances[frame].copy(), np.ones(variances[frame].shape[:2])
    for back, path in enumerate(paths(motions, frame), 1):
        variance, inside = _carried_variance(variances[frame - back], path)
        total += variance * inside[..., None]
        count += inside
    return total / (count**2)[..., None]


def _carried_variance(variance: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variance of the bilinear mean of independent pixels."""
    height, width = path.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    at_x, at_y = x + path[..., 0], y + path[..., 1]
    inside = (at_x >= 0) & (at_x <= width - 1) & (at_y >= 0) & (at_y <= height - 1)
    left, top = np.floor(at_x), np.floor(at_y)
    total = np.zeros_like(variance)
    for down in (0, 1):
        for right in (0, 1):
            weight = np.abs(1 - right - (at_x - left)) * np.abs(1 - down - (at_y - top))
            row, column = np.clip(top + down, 0, height - 1).astype(int), np.clip(left + right, 0, width - 1).astype(int)
            total += (weight**2)[..., None] * variance[row, column]
    return total, inside
