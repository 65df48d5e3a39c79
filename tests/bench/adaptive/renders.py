"""Samples of the scenes, rendered once with Mitsuba so that every method sees the same ones, and references; both are kept in a folder.

A method that gives a pixel n samples gets the first n of that pixel's series, which is what a renderer would have given it.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

SIZE = 256
SCENES = ("courtyard", "toasters", "sibenik", "pool", "backdrop")
# Where four fifths of the picture have no noise, the rest gets five times as many samples as the mean.
SERIES = {"backdrop": 448}
SERIES_OTHERWISE = 192
AT_ONCE = 16
"""Samples of each pixel that are traced in one go."""
SHUTTER = 32
"""Moments of the moving scene's shutter."""
# The live render of this scene differs from its stored reference (texture of the floor), so it gets one of its own.
OWN_REFERENCE = {"courtyard": 2048}


class Live:
    """A scene, loaded, and samples of it: what `common.py` beside the scenes traces."""

    def __init__(self, folder: Path, name: str) -> None:
        if not (folder / "scenes.py").is_file():
            sys.exit(f"{folder}: no scenes.py there; --scenes names the folder of the five scenes as Python dictionaries")
        sys.path.insert(0, str(folder))
        try:
            import common
            import scenes
        except ImportError as error:
            sys.exit(f"the scenes need what cannot be imported here: {error}; pip install mitsuba==3.9.1 OpenEXR numpy scipy trimesh pillow")
        self.common, self.scenes, self.name = common, scenes, name
        description, depth = scenes.ALL[name](SIZE, SIZE)
        self.scene = common.mi.load_dict(description)
        self.integrator = common.integrator(depth)
        self.seed = 777_000_000 + common.base_seed(name) % 1_000_000

    def frame(self, seed: int, samples: int) -> np.ndarray:
        """(pixels, samples, 10) independent samples: colour, albedo, normal, depth."""
        frame = self.common.frame(self.scene, self.integrator, seed, SIZE, SIZE, samples)
        return frame.transpose(1, 2, 0, 3).reshape(SIZE * SIZE, samples, -1)

    def moments(self):
        """The shutter's moments, one after the other, with the scene as it is then."""
        parameters = self.common.mi.traverse(self.scene)
        for moment in range(SHUTTER):
            description, _ = self.scenes.pool(8, 8, time=(moment + 0.5) / SHUTTER)
            for key, value in description.items():
                if isinstance(value, dict) and value.get("type") == "sphere":
                    parameters[f"{key}.to_world"] = self.common.mi.Transform4f(value["to_world"].matrix)
            parameters.update()
            yield moment

    def series(self, samples: int) -> tuple[np.ndarray, np.ndarray]:
        """Colour (float32) and features (float16) of `samples` samples of every pixel."""
        pixels = SIZE * SIZE
        colour, features = np.empty((pixels, samples, 3), np.float32), np.empty((pixels, samples, 7), np.float16)
        if self.name == "pool":
            # every sample has a moment of its own
            when = np.random.default_rng(self.seed).integers(0, SHUTTER, (pixels, samples), dtype=np.uint8)
            for moment in self.moments():
                pixel, index = np.nonzero(when == moment)
                found = self.common.trace(self.scene, self.integrator, self.seed + moment, pixel % SIZE, pixel // SIZE)
                colour[pixel, index], features[pixel, index] = found[:, :3], found[:, 3:]
            return colour, features
        for first in range(0, samples, AT_ONCE):
            found = self.frame(self.seed + first, AT_ONCE)
            colour[:, first : first + AT_ONCE], features[:, first : first + AT_ONCE] = found[..., :3], found[..., 3:]
        return colour, features

    def reference(self, samples: int) -> tuple[np.ndarray, np.ndarray]:
        """Mean of samples that are in no series, and the variance of that mean, both (SIZE, SIZE, 3)."""
        total, squares = np.zeros((SIZE * SIZE, 3)), np.zeros((SIZE * SIZE, 3))
        batches = samples // AT_ONCE
        for batch in range(batches):
            mean = self.frame(self.seed + 500_000 + batch, AT_ONCE)[..., :3].mean(1, dtype=np.float64)
            total += mean
            squares += mean**2
        mean = total / batches
        variance = np.maximum(squares / batches - mean**2, 0) / (batches - 1)
        return mean.reshape(SIZE, SIZE, 3), variance.reshape(SIZE, SIZE, 3)


def render_series(name: str, scenes: Path, cache: Path) -> None:
    """Renders the scene's samples into `cache`, if they are not there."""
    if not all(file.is_file() for file in _files(name, cache)):
        print(f"{name}: rendering samples", flush=True)
        for file, array in zip(_files(name, cache), Live(scenes, name).series(SERIES.get(name, SERIES_OTHERWISE))):
            _save(file, array)


def series(name: str, cache: Path) -> np.ndarray:
    """The scene's samples, (pixels, samples, 10) float32, as they were rendered into `cache`."""
    colour, features = (np.load(file, mmap_mode="r") for file in _files(name, cache))
    return np.concatenate([colour, features], axis=-1, dtype=np.float32)


def _files(name: str, cache: Path) -> list[Path]:
    return [cache / f"{name}_{which}.npy" for which in ("c", "f")]


def reference(name: str, scenes: Path, cache: Path, stored: Path, referee) -> tuple[np.ndarray, np.ndarray]:
    """The scene's reference and its variance: the stored one, or one of its own."""
    if name not in OWN_REFERENCE:
        path = str(stored / f"{name}_ref.exr")
        return referee.colour(path), referee.noise(path)
    file = cache / f"{name}_reference.npy"
    if not file.is_file():
        print(f"{name}: rendering a reference of {OWN_REFERENCE[name]} samples per pixel", flush=True)
        _save(file, np.stack(Live(scenes, name).reference(OWN_REFERENCE[name])))
    mean, variance = np.load(file)
    return mean, variance


def _save(file: Path, array: np.ndarray) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(".part.npy")
    np.save(part, array)
    os.replace(part, file)
