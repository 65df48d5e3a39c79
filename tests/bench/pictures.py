#!/usr/bin/env python3
"""Crops of renders at 4 x: noisy | linpred | Open Image Denoise | reference, one line for each (pip install numpy OpenEXR pillow pyoidn).

    python3 pictures.py LINPRED FOLDER OUT.png SCENE:SAMPLES:X,Y ...

FOLDER holds SCENE_<SAMPLES>spp.exr and SCENE_ref.exr; a crop is 72 x 72 pixels from (X, Y) on. linpred runs with --quality high, the network with albedo and
normal as rendered.
"""
import os
import subprocess
import sys
import tempfile

import numpy as np
import OpenEXR
import pyoidn
from PIL import Image

SIDE, SCALE = 72, 4


def planes(path, names):
    channels = OpenEXR.File(path, separate_channels=True).channels()
    return np.stack([channels[name].pixels.astype(np.float32) for name in names], -1)


def oidn(path):
    inputs = {
        "color": planes(path, "RGB"),
        "albedo": np.clip(planes(path, ["albedo.R", "albedo.G", "albedo.B"]), 0, 1),
        "normal": np.clip(planes(path, ["N.X", "N.Y", "N.Z"]), -1, 1),
    }
    images = {name: np.ascontiguousarray(image) for name, image in inputs.items()}
    images["output"] = np.zeros_like(images["color"])
    device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
    device.commit()
    network = pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT)
    for name, image in images.items():
        network.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
    network.set_bool("hdr", True)
    network.set_int("quality", 6)
    network.commit()
    network.execute()
    return images["output"]


def shown(radiance):
    value = np.clip(radiance, 0, 1)
    value = np.where(value <= 0.0031308, 12.92 * value, 1.055 * np.maximum(value, 1e-9) ** (1 / 2.4) - 0.055)
    return (value * 255 + 0.5).astype(np.uint8)


def line(linpred, folder, crop, out):
    scene, samples, place = crop.split(":")
    x, y = map(int, place.split(","))
    noisy = os.path.join(folder, f"{scene}_{samples}spp.exr")
    subprocess.run([linpred, "denoise", noisy, "-o", out, "--quality", "high", "-q"], check=True)
    reference = planes(os.path.join(folder, f"{scene}_ref.exr"), "RGB")
    images = [planes(noisy, "RGB"), planes(out, "RGB"), oidn(noisy), reference]
    return np.concatenate([shown(image[y : y + SIDE, x : x + SIDE]) for image in images], 1)


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
