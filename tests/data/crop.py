#!/usr/bin/env python3
"""Cuts a rectangle out of an EXR file, or mirrors a file up to a larger one; all channels and attributes are kept.

    python3 crop.py crop IN.exr OUT.exr X Y WIDTH HEIGHT     the rectangle whose upper left pixel is (X, Y)
    python3 crop.py mirror IN.exr OUT.exr COLUMNS ROWS       COLUMNS x ROWS copies, every second one mirrored: no edges between them

Needs the packages numpy and OpenEXR (3.3 or later). The output is ZIP scanline; its window begins at (0, 0).
"""
import sys

import numpy as np
import OpenEXR

# What the writer states anew.
LAYOUT = ("channels", "compression", "dataWindow", "displayWindow", "lineOrder", "tiles", "type", "chunkCount", "version")


def rewrite(source, target, change):
    """Writes `source` with `change` applied to every channel's plane."""
    with OpenEXR.File(source, separate_channels=True) as file:
        header = {name: value for name, value in file.header().items() if name not in LAYOUT}
        planes = {name: np.ascontiguousarray(change(channel.pixels)) for name, channel in file.channels().items()}
    header["compression"] = OpenEXR.ZIP_COMPRESSION
    header["type"] = OpenEXR.scanlineimage
    with OpenEXR.File(header, planes) as file:
        file.write(target)


def crop(x, y, width, height):
    def change(plane):
        if y + height > plane.shape[0] or x + width > plane.shape[1]:
            sys.exit(f"the rectangle does not fit into {plane.shape[1]} x {plane.shape[0]} pixels")
        return plane[y : y + height, x : x + width]

    return change


def mirror(columns, rows):
    def change(plane):
        row = np.concatenate([plane[:, ::-1] if i % 2 else plane for i in range(columns)], axis=1)
        return np.concatenate([row[::-1] if i % 2 else row for i in range(rows)], axis=0)

    return change


if __name__ == "__main__":
    if len(sys.argv) == 8 and sys.argv[1] == "crop":
        rewrite(sys.argv[2], sys.argv[3], crop(*map(int, sys.argv[4:])))
    elif len(sys.argv) == 6 and sys.argv[1] == "mirror":
        rewrite(sys.argv[2], sys.argv[3], mirror(*map(int, sys.argv[4:])))
    else:
        sys.exit(__doc__)
