"""Crops the 37 x 37 tile at (X, Y) of a render into tile.f16: planes of little-endian halves.

python3 make_tile.py courtyard_16spp.exr X Y, with the packages OpenEXR and numpy. Planes in order: radiance (3) and
its variance of the mean (3), albedo (3) and its variance (3), normal (3) and its variance (3), depth and its variance.
"""

import sys

import numpy as np
import OpenEXR

SIDE = 37


def main(path, x, y):
    channels = OpenEXR.File(path).channels()
    images = [channels[name].pixels for name in ("RGB", "variance", "albedo", "albedoVariance")]
    for names in (("N.X", "N.Y", "N.Z"), ("NVariance.X", "NVariance.Y", "NVariance.Z"), ("Z",), ("ZVariance.Z",)):
        images.append(np.stack([channels[name].pixels for name in names], axis=-1))
    planes = np.concatenate(images, axis=-1)[y : y + SIDE, x : x + SIDE]
    np.moveaxis(planes, -1, 0).astype("<f2").tofile("tile.f16")


main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
