#!/usr/bin/env python3
"""Puts EXR images of one size side by side into a PNG, every pixel enlarged to SCALE x SCALE: sRGB of values clamped to 0..1.

    python3 side_by_side.py OUT.png SCALE IN.exr [IN.exr ...]

Needs the packages numpy, OpenEXR (3.3 or later) and Pillow.
"""
import sys

import numpy as np
import OpenEXR
from PIL import Image

GAP = 4


def linear(path, names="RGB"):
    with OpenEXR.File(path, separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[name].pixels for name in names], axis=-1).astype(np.float32)


def srgb(linear):
    linear = np.clip(linear.astype(np.float64), 0, 1)
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(255 * coded).astype(np.uint8)


def main(target, scale, paths):
    panels = [srgb(linear(path)).repeat(scale, axis=0).repeat(scale, axis=1) for path in paths]
    gap = np.full((panels[0].shape[0], GAP, 3), 255, np.uint8)
    row = [panels[0]]
    for panel in panels[1:]:
        row += [gap, panel]
    Image.fromarray(np.concatenate(row, axis=1)).save(target, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3:])
