"""A strip of pictures: a part of a frame, and what is different from the frame before, for each of four rows."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import judge
import numpy as np
from frames import COLOUR, MOTION, planes
from methods import Bench

ROWS = {"noisy": "noisy", "linpred": "frame by frame", "linpred --temporal": "--temporal", "reference": "reference"}
"""What is shown, and how it is called."""
LARGER, GAP, TEXT = 3, 6, 16
"""How many times the pixels are enlarged; pixels between pictures; height of a line of text."""
MID = 128


@dataclass(frozen=True)
class Part:
    """A rectangle of a frame."""

    left: int
    top: int
    width: int
    height: int

    @classmethod
    def parse(cls, text: str) -> Part:
        try:
            found = cls(*map(int, text.split(",")))
        except (TypeError, ValueError):
            raise argparse.ArgumentTypeError(f"{text!r} is not LEFT,TOP,WIDTH,HEIGHT") from None
        if found.left < 0 or found.top < 0 or found.width < 1 or found.height < 1:
            raise argparse.ArgumentTypeError(f"{text!r}: no such part of a picture")
        return found

    def of(self, image: np.ndarray) -> np.ndarray:
        return image[self.top : self.top + self.height, self.left : self.left + self.width]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--strip", default="balls", help="name of the sequence that is shown")
    parser.add_argument("--strip-frame", type=int, default=5, help="not the first")
    parser.add_argument("--strip-part", type=Part.parse, default=Part(40, 154, 132, 64), metavar="LEFT,TOP,WIDTH,HEIGHT")
    parser.add_argument("--strip-times", type=float, default=6, help="what differences are multiplied by")


def draw(bench: Bench, path: Path, asked: argparse.Namespace) -> None:
    """Writes the strip as PNG; what the methods have made is read from their files."""
    from PIL import Image, ImageDraw, ImageFont

    sequence, frame, part = bench.sequence, asked.strip_frame, asked.strip_part
    at = [int(number) for number in sequence.numbers].index(frame)
    now, before = sequence.numbers[at], sequence.numbers[at - 1]
    motion = planes(sequence.noisy(now), MOTION)
    width, height = part.width * LARGER, part.height * LARGER
    sheet = Image.new("RGB", (2 * width + GAP, len(ROWS) * (TEXT + height)), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(12)
    pen.text((width + GAP + 2, 1), f"less frame {int(before)}, carried along the motion, x {asked.strip_times:g}", "black", font)
    for row, (method, label) in enumerate(ROWS.items()):
        top = row * (TEXT + height)
        pen.text((2, top + 1), f"frame {frame}, {label}", "black", font)
        picture, old = (_picture(bench, method, number) for number in (now, before))
        difference = judge.srgb(picture) - judge.srgb(judge.carried(old, motion)[0])
        for column, shown in enumerate((255 * judge.srgb(picture), MID + 255 * asked.strip_times * difference)):
            cut = np.clip(np.round(part.of(shown)), 0, 255).astype(np.uint8)
            sheet.paste(Image.fromarray(cut.repeat(LARGER, 0).repeat(LARGER, 1)), (column * (width + GAP), top + TEXT))
    sheet.save(path, optimize=True)


def missing(bench: Bench, asked: argparse.Namespace) -> str:
    """Why there can be no strip, if there cannot."""
    numbers = {int(number): number for number in bench.sequence.numbers}
    if asked.strip_frame not in list(numbers)[1:]:
        return f"{bench.sequence.label} has no frame {asked.strip_frame} with one before it"
    for method in ROWS:
        for frame in (asked.strip_frame, asked.strip_frame - 1):
            if method != "reference" and not bench.file(method, numbers[frame]).is_file():
                return f"{method} has no picture of frame {frame}"
    return ""


def _picture(bench: Bench, method: str, number: str) -> np.ndarray:
    return planes(bench.sequence.reference(number) if method == "reference" else bench.file(method, number), COLOUR)
