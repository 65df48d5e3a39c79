#!/usr/bin/env python3
"""Crops of renders at 4 x: noisy | linpred | Open Image Denoise | reference, one line for each (pip install numpy OpenEXR pillow pyoidn).

    python3 crops.py LINPRED FOLDER OUT.png SCENE:SAMPLES:X,Y ...

FOLDER holds SCENE_<SAMPLES>spp.exr and SCENE_ref.exr; a crop is 72 x 72 pixels from (X, Y) on. linpred runs with --quality high, the network with albedo and
normal as rendered.
"""
import os
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image
from pyoidn.denoise import denoise

from side_by_side import linear, srgb

SIDE, SCALE = 72, 4


def oidn(path):
    albedo = np.clip(linear(path, ["albedo.R", "albedo.G", "albedo.B"]), 0, 1)
    normal = np.clip(linear(path, ["N.X", "N.Y", "N.Z"]), -1, 1)
    return denoise(color=linear(path), albedo=albedo, normal=normal, hdr=True, quality="high")


def line(linpred, folder, crop, out):
    scene, samples, place = crop.split(":")
    x, y = map(int, place.split(","))
    noisy = os.path.join(folder, f"{scene}_{samples}spp.exr")
    subprocess.run([linpred, "denoise", noisy, "-o", out, "--quality", "high", "-q"], check=True)
    reference = os.path.join(folder, f"{scene}_ref.exr")
    images = [linear(noisy), linear(out), oidn(noisy), linear(reference)]
    return np.concatenate([srgb(image[y : y + SIDE, x : x + SIDE]) for image in images], 1)


def main(linpred, folder, picture, *crops):
    with tempfile.TemporaryDirectory() as work:
        lines = [line(linpred, folder, crop, os.path.join(work, "out.exr")) for crop in crops]
    image = Image.fromarray(np.concatenate(lines, 0))
    size = (image.width * SCALE, image.height * SCALE)
    image.resize(size, Image.NEAREST).save(picture, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) < 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
