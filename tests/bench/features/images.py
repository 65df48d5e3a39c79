"""Images as files: layers of channels, read and written by name."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR

COLOUR, ALBEDO, NORMAL = ("R", "G", "B"), ("albedo.R", "albedo.G", "albedo.B"), ("N.X", "N.Y", "N.Z")
REFLECTED_ALBEDO, REFLECTED_NORMAL = tuple(f"reflAlbedo.{c}" for c in "RGB"), tuple(f"reflN.{c}" for c in "XYZ")


def variance_of(channel: str) -> str:
    """The name of the channel that holds the variance of a channel's mean: `variance.R`, `albedoVariance.R`, `ZVariance.Z`, `roughnessVariance`."""
    layer, dot, component = channel.rpartition(".")
    if not layer:
        return {**{c: f"variance.{c}" for c in COLOUR}, "Z": "ZVariance.Z"}.get(component, f"{component}Variance")
    return f"{layer}Variance{dot}{component}"


@functools.lru_cache(maxsize=2)
def channels(path: Path) -> dict[str, np.ndarray]:
    """All channels of a file by name, (height, width) each; what is asked for again at once is not read again."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


def planes(path: Path, names: tuple[str, ...]) -> np.ndarray:
    """Channels of a file, (height, width, channels), f64; ends the program where one is missing."""
    found = channels(path)
    missing = [name for name in names if name not in found]
    if missing:
        sys.exit(f"{path}: no channel {', '.join(missing)}; it has {', '.join(sorted(found))}")
    return np.stack([found[name].astype(np.float64) for name in names], -1)


def write(path: Path, layers: Mapping[str, np.ndarray], said: Mapping[str, object]) -> None:
    """Each channel with the type of its array, but no wider than 32 bits; whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **said}
    narrow = {name: np.ascontiguousarray(plane, np.float16 if plane.dtype == np.float16 else np.float32) for name, plane in layers.items()}
    with OpenEXR.File(header, narrow) as file:
        file.write(str(part))
    os.replace(part, path)
