#!/usr/bin/env python3
"""Renders the glossy scenes with Mitsuba 3: noisy images with further features, and references of seeds of their own. See README.md beside it.

    python tests/bench/features/renders.py --out DIR [--only gallery,tray] [--reference 1024]

Begun references are continued: what is summed up so far is beside them.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import zlib
from pathlib import Path

import images
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

import scenes
import trace

SIDE = 512
SAMPLES = (4, 16, 64)
AT_ONCE = 4
"""Samples of each pixel that are traced in one go: a million paths."""
BLOCK = 32
"""Samples of the reference between two writings of what is summed up."""
COLOURS = len(images.COLOUR)


class Sums:
    """Samples of each pixel added up: as many of each."""

    def __init__(self, first: np.ndarray) -> None:
        # less the first sample, so that a pixel that never varies has a variance of 0
        self.first, self.count = first.astype(np.float64), 0
        self.sums, self.squares = np.zeros_like(self.first), np.zeros_like(self.first)

    def add(self, samples: np.ndarray) -> None:
        """(pixels, samples, channels)."""
        off = samples - self.first[:, None]
        self.count += samples.shape[1]
        self.sums += off.sum(1)
        self.squares += (off**2).sum(1)

    @property
    def means(self) -> np.ndarray:
        return self.first + self.sums / self.count

    @property
    def variances(self) -> np.ndarray:
        """Of the means."""
        return np.maximum(self.squares - self.sums**2 / self.count, 0) / (self.count * (self.count - 1))

    def save(self, path: Path) -> None:
        part = path.with_suffix(".part.npz")
        np.savez(part, first=self.first, count=self.count, sums=self.sums, squares=self.squares)
        os.replace(part, path)

    @classmethod
    def load(cls, path: Path) -> Sums:
        with np.load(path) as stored:
            found = cls(stored["first"])
            found.count, found.sums, found.squares = int(stored["count"]), stored["sums"], stored["squares"]
        return found


def seed(name: str, number: int) -> int:
    """Of the number-th pass of a scene; noisy images count from 0, references from a million."""
    return zlib.crc32(name.encode()) % 1_000_000 * 2000 + number


def write(path: Path, sums: Sums) -> None:
    """All channels of the means, and the variances of the means."""
    shape = (SIDE, SIDE)
    channels: dict[str, np.ndarray] = {}
    for index, name in enumerate(trace.CHANNELS[: sums.means.shape[1]]):
        channels[name] = sums.means[:, index].reshape(shape)
        channels[images.variance_of(name)] = sums.variances[:, index].reshape(shape)
    images.write(path, channels, {"spp": sums.count, "renderer": f"Mitsuba {mi.__version__}"})


def render_noisy(name: str, out: Path) -> None:
    """The first 4, 16 and 64 of a series of samples, where they are not there yet."""
    if all((out / f"{name}_{samples}spp.exr").is_file() for samples in SAMPLES):
        return
    scene, sums = mi.load_dict(scenes.SCENES[name](SIDE)), None
    for number in range(max(SAMPLES) // AT_ONCE):
        found = trace.trace(scene, seed(name, number), AT_ONCE, scenes.DEPTH)
        sums = sums or Sums(found[:, 0])
        sums.add(found)
        if sums.count in SAMPLES:
            write(out / f"{name}_{sums.count}spp.exr", sums)


def render_reference(name: str, out: Path, samples: int) -> None:
    """Goes on until there are so many samples of each pixel."""
    state = out / f"{name}_ref.npz"
    scene = mi.load_dict(scenes.SCENES[name](SIDE))

    def more(count: int) -> np.ndarray:
        return trace.trace(scene, seed(name, 1_000_000 + count), AT_ONCE, scenes.DEPTH)[..., :COLOURS]

    if state.is_file():
        sums = Sums.load(state)
    else:
        first = more(0)
        sums = Sums(first[:, 0])
        sums.add(first)
    while sums.count < samples:
        sums.add(more(sums.count))
        if sums.count % BLOCK == 0 or sums.count >= samples:
            sums.save(state)
            write(out / f"{name}_ref.exr", sums)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder of the images")
    parser.add_argument("--only", default="", help="scenes, with commas")
    parser.add_argument("--reference", type=int, default=1024, help="samples of each pixel of the references")
    asked = parser.parse_args()
    unknown = [name for name in asked.only.split(",") if name and name not in scenes.SCENES]
    if unknown:
        sys.exit(f"no scene {unknown[0]!r}: there are {', '.join(scenes.SCENES)}")
    asked.out.mkdir(parents=True, exist_ok=True)
    for name in scenes.SCENES:
        if not asked.only or name in asked.only.split(","):
            began = time.perf_counter()
            render_noisy(name, asked.out)
            render_reference(name, asked.out, asked.reference)
            print(f"{name}: {time.perf_counter() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()
