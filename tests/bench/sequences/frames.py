"""Sequences of noisy frames with references, as files."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR

COLOUR, VARIANCE = ("R", "G", "B"), ("variance.R", "variance.G", "variance.B")
NORMAL, ALBEDO = ("N.X", "N.Y", "N.Z"), ("albedo.R", "albedo.G", "albedo.B")
FEATURES = (*NORMAL, *ALBEDO, "Z")
FEATURE_VARIANCES = (*(f"NVariance.{c}" for c in "XYZ"), *(f"albedoVariance.{c}" for c in "RGB"), "ZVariance.Z")
POSITION, MOTION = ("P.X", "P.Y", "P.Z"), ("motion.X", "motion.Y")


@dataclass(frozen=True)
class Sequence:
    """Frames `<name>_<number>_<samples>spp.exr`, and beside each its `<name>_<number>_ref.exr`.

    `numbers` follow one another without a gap and are written with as many digits each.
    """

    folder: Path
    name: str
    samples: int
    numbers: tuple[str, ...]

    @property
    def label(self) -> str:
        return f"{self.name}, {self.samples} spp"

    @property
    def slug(self) -> str:
        """A folder's name."""
        return f"{self.name}-{self.samples}spp"

    @property
    def pattern(self) -> str:
        """The noisy frames as `linpred denoise` takes them: a `#` for each digit."""
        return str(self.folder / f"{self.name}_{'#' * len(self.numbers[0])}_{self.samples}spp.exr")

    def noisy(self, number: str) -> Path:
        return self.folder / f"{self.name}_{number}_{self.samples}spp.exr"

    def reference(self, number: str) -> Path:
        return self.folder / f"{self.name}_{number}_ref.exr"


def find(folder: Path) -> list[Sequence]:
    """The sequences of a folder; ends the program where frames or references are missing."""
    found: dict[tuple[str, int], list[str]] = {}
    for path in sorted(folder.glob("*.exr")):
        parts = re.fullmatch(r"(.+)_(\d+)_(\d+)spp\.exr", path.name)
        if parts:
            found.setdefault((parts[1], int(parts[3])), []).append(parts[2])
    sequences = [Sequence(folder, name, samples, tuple(numbers)) for (name, samples), numbers in found.items()]
    if not sequences:
        sys.exit(f"{folder}: no frames NAME_00_8spp.exr there")
    for sequence in sequences:
        first = int(sequence.numbers[0])
        if [int(number) for number in sequence.numbers] != list(range(first, first + len(sequence.numbers))):
            sys.exit(f"{folder}: frames of {sequence.name} are missing between {sequence.numbers[0]} and {sequence.numbers[-1]}")
        for number in sequence.numbers:
            if not sequence.reference(number).is_file():
                sys.exit(f"{sequence.reference(number)}: no such reference")
    return sequences


def planes(path: Path, names: tuple[str, ...]) -> np.ndarray:
    """Channels of a file, (height, width, channels), f64; ends the program where one is missing."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        missing = [name for name in names if name not in channels]
        if missing:
            sys.exit(f"{path}: no channel {', '.join(missing)}; it has {', '.join(sorted(channels))}")
        return np.stack([channels[name].pixels.astype(np.float64) for name in names], -1)


def reference_noise(path: Path) -> np.ndarray:
    """The variance of the reference's own mean; zeros where the file does not say."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        if not all(name in channels for name in VARIANCE):
            return np.zeros((*next(iter(channels.values())).pixels.shape, 3))
        return np.stack([channels[name].pixels.astype(np.float64) for name in VARIANCE], -1)


def write_colour(path: Path, colour: np.ndarray) -> None:
    """(height, width, 3) as R G B of 32 bits, as denoisers store their pictures."""
    _write(path, dict(zip(COLOUR, np.moveaxis(colour, -1, 0))), {})


def rewrite(source: Path, path: Path, changed: dict[str, np.ndarray]) -> None:
    """A file with other values in some of its channels."""
    with OpenEXR.File(str(source), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
        # what the renderer said of the frame, but nothing of how the file was laid out
        said = {name: value for name, value in file.header().items() if name in ("spp", "renderer")}
    _write(path, {**channels, **changed}, said)


def _write(path: Path, channels: dict[str, np.ndarray], said: dict[str, object]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **said}
    with OpenEXR.File(header, {name: np.ascontiguousarray(plane, np.float32) for name, plane in channels.items()}) as file:
        file.write(str(path))
