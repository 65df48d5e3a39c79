"""How far a sequence of pictures is from its references: the error of each frame, and the flicker between frames.

The measures are those of the README, over pixels and channels, the references' own noise taken off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from frames import COLOUR, MOTION, Sequence, planes, reference_noise
from scipy.ndimage import map_coordinates

STEADY = 3
"""Frames before this one are not counted: methods that remember have little to remember there."""
DARK = 0.01
"""Added to the squared reference that errors are relative to."""
SAME, SAME_DARK = 0.25, 0.05
"""How far apart, of their brightness, two references may be where a pixel counts as visible in both frames."""


@dataclass(frozen=True)
class Measured:
    """Of one frame. `flicker` and `visible` (the share of the pixels it is taken over) are NaN in the first."""

    gain: float
    psnr: float
    energy: float
    flicker: float
    visible: float


@dataclass(frozen=True)
class _Frame:
    picture: np.ndarray
    reference: np.ndarray
    noise: np.ndarray


def carried(image: np.ndarray, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An image (height, width, channels) of the frame before as this frame sees it, bilinearly, and where that lies inside it.

    `motion` (height, width, 2): what pixel (x, y) shows was at (x, y) + motion.
    """
    height, width = motion.shape[:2]
    y, x = np.mgrid[0:height, 0:width]
    at = np.array([y + motion[..., 1], x + motion[..., 0]])
    inside = (at[0] >= 0) & (at[0] <= height - 1) & (at[1] >= 0) & (at[1] <= width - 1)
    return np.stack([map_coordinates(image[..., c], at, order=1, mode="nearest") for c in range(image.shape[-1])], -1), inside


def judge(sequence: Sequence, pictures: list[np.ndarray]) -> list[Measured]:
    """The measures of each frame; one picture (height, width, 3) for each, in their order."""
    found, before = [], None
    for number, picture in zip(sequence.numbers, pictures, strict=True):
        noisy, reference = planes(sequence.noisy(number), COLOUR), planes(sequence.reference(number), COLOUR)
        if picture.shape != reference.shape:
            raise ValueError(f"frame {number} of {sequence.label} is {picture.shape}, its reference {reference.shape}")
        now = _Frame(picture, reference, reference_noise(sequence.reference(number)))
        gain = relative_error(noisy, now) / relative_error(picture, now)
        flicker, visible = (np.nan, np.nan) if before is None else _flicker(now, before, planes(sequence.noisy(number), MOTION))
        found.append(Measured(gain, psnr(picture, reference), float(picture.mean() / reference.mean()), flicker, visible))
        before = now
    return found


def relative_error(picture: np.ndarray, frame: _Frame) -> float:
    """rMSE = mean of ((a - f)^2 - var f) / (f^2 + 0.01)."""
    return float((((picture - frame.reference) ** 2 - frame.noise) / (frame.reference**2 + DARK)).mean())


def psnr(picture: np.ndarray, reference: np.ndarray) -> float:
    """Of the tone-mapped picture, dB."""
    squared = np.mean((srgb(picture) - srgb(reference)) ** 2)
    return float(-10 * np.log10(max(squared, 1e-12)))


def srgb(colour: np.ndarray) -> np.ndarray:
    """Linear light as a screen shows it: clamped to 0..1, sRGB's curve."""
    light = np.clip(colour, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def _flicker(now: _Frame, before: _Frame, motion: np.ndarray) -> tuple[float, float]:
    """Mean of (d_out - d_ref)^2 / (f^2 + 0.01), d = frame less frame before, over what is visible in both; and how much that is."""
    old_reference, inside = carried(before.reference, motion)
    old_noise, _ = carried(before.noise, motion)
    brightness = now.reference.mean(-1)
    same = inside & (np.abs(old_reference - now.reference).mean(-1) < SAME * (brightness + SAME_DARK))
    unlike = (now.picture - carried(before.picture, motion)[0]) - (now.reference - old_reference)
    relative = (unlike**2 - (now.noise + old_noise)) / (now.reference**2 + DARK)
    return float(relative[same].mean()), float(same.mean())


def steady(rows: list[Measured]) -> Measured:
    """Means over the frames that count; the geometric one of gain."""
    counted = rows[STEADY:]
    if not counted:
        raise ValueError(f"{len(rows)} frames; those from the {STEADY + 1}th on are counted")
    means = {name: float(np.mean([getattr(row, name) for row in counted])) for name in ("psnr", "energy", "flicker", "visible")}
    return Measured(gain=float(np.exp(np.mean([np.log(row.gain) for row in counted]))), **means)
