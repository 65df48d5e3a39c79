"""A picture of a reflection: noisy, without and with the reflection features, reference."""

from __future__ import annotations

import argparse
from pathlib import Path

import images
import numpy as np
from images import COLOUR
from methods import NONE, Bench, Failed

REFERENCE = "reference"
SHOWN = {
    "noisy": "as rendered",
    NONE: "without",
    "reflected both": "with what is reflected",
    "OIDN": "Open Image Denoise",
    REFERENCE: "reference",
}
"""What is shown, and how it is called."""
METHODS = SHOWN.keys() - {REFERENCE}
LARGER, GAP, TEXT = 2, 4, 16
"""How many times the pixels are enlarged; pixels between pictures; height of a line of text."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--picture", default="gallery", help="the scene of the picture")
    parser.add_argument("--picture-samples", type=int, default=16)
    parser.add_argument("--picture-part", type=_part, default=(130, 170, 120, 125), metavar="LEFT,TOP,WIDTH,HEIGHT")


def _part(text: str) -> tuple[int, int, int, int]:
    try:
        left, top, width, height = map(int, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not LEFT,TOP,WIDTH,HEIGHT") from None
    if min(left, top) < 0 or min(width, height) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: no such part of a picture")
    return left, top, width, height


def draw(bench: Bench, asked: argparse.Namespace) -> None:
    """Writes `reflection.png` if it is this image's; says so where it cannot."""
    if (bench.image.scene, bench.image.samples) != (asked.picture, asked.picture_samples):
        return
    try:
        shown = [images.planes(bench.image.reference, COLOUR) if method == REFERENCE else bench.made(method).picture for method in SHOWN]
    except Failed as why:
        print(f"no picture: {why}", flush=True)
        return
    _sheet(shown, asked.out / "reflection.png", asked)


def _sheet(shown: list[np.ndarray], path: Path, asked: argparse.Namespace) -> None:
    from PIL import Image, ImageDraw, ImageFont

    left, top, width, height = asked.picture_part
    sheet = Image.new("RGB", (len(shown) * (width * LARGER + GAP) - GAP, TEXT + height * LARGER), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(12)
    for column, (picture, label) in enumerate(zip(shown, SHOWN.values(), strict=True)):
        part = np.round(255 * srgb(picture[top : top + height, left : left + width])).astype(np.uint8)
        at = column * (width * LARGER + GAP)
        pen.text((at + 2, 1), label, "black", font)
        sheet.paste(Image.fromarray(part.repeat(LARGER, 0).repeat(LARGER, 1)), (at, TEXT))
    sheet.save(path, optimize=True)


def srgb(colour: np.ndarray) -> np.ndarray:
    """Linear light as a screen shows it: clamped to 0..1, sRGB's curve."""
    light = np.clip(colour, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)
