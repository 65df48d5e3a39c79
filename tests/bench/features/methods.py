"""What is compared: linpred with sets of further features, and Open Image Denoise."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import images
import numpy as np
import program
from images import ALBEDO, COLOUR, NORMAL, REFLECTED_ALBEDO, REFLECTED_NORMAL
from program import Failed

OIDN = Path(__file__).resolve().parent.parent / "oidn.py"
USUAL = (*COLOUR, *ALBEDO, *NORMAL, "Z")
POSITION = ("P.X", "P.Y", "P.Z")
NOISE = 6
"""White noise channels, as many as linpred takes."""
MIRROR = 0.01
"""Roughness below which a surface is a mirror."""
REFLECTIONS = (*zip(ALBEDO, REFLECTED_ALBEDO, strict=True), *zip(NORMAL, REFLECTED_NORMAL, strict=True))
"""Channels of what is hit first, and those of what it reflects."""
OF_MIRRORS = (*REFLECTED_ALBEDO, *REFLECTED_NORMAL, "roughness")


@dataclass(frozen=True)
class Made:
    """A picture (height, width, 3), and the CPU seconds it took, reading and writing files included; none of the input itself."""

    picture: np.ndarray
    seconds: float | None


@dataclass(frozen=True)
class Image:
    """A noisy image `<scene>_<samples>spp.exr` of a folder, and its reference `<scene>_ref.exr`."""

    folder: Path
    scene: str
    samples: int

    @property
    def path(self) -> Path:
        return self.folder / f"{self.scene}_{self.samples}spp.exr"

    @property
    def reference(self) -> Path:
        return self.folder / f"{self.scene}_ref.exr"


class Bench:
    """An image and the program; pictures that other methods need are made once."""

    def __init__(self, image: Image, linpred: Path) -> None:
        self.image, self.linpred = image, linpred
        self._made: dict[str, Made] = {}

    def made(self, method: str) -> Made:
        if method not in self._made:
            self._made[method] = METHODS[method].make(self)
        return self._made[method]

    def noise(self, variances: bool) -> dict[str, np.ndarray]:
        """White noise as a renderer would hand it over that draws one number per sample: means, and, if asked for, the variances of the means."""
        shape = images.planes(self.image.path, COLOUR).shape[:2]
        random = np.random.default_rng(zlib.crc32(self.image.path.name.encode()))
        found = {}
        for number in range(1, NOISE + 1):
            count = self.image.samples
            found[f"noise{number}"] = random.standard_normal(shape) / np.sqrt(count)
            of_mean = random.chisquare(count - 1, shape) / (count - 1) / count
            if variances:
                found[f"noise{number}Variance"] = of_mean
        return found

    def denoised(self, more: dict[str, np.ndarray], features: tuple[str, ...]) -> Made:
        """`linpred denoise`, balanced, one thread, of the usual channels and `more`; fails with the program's own words."""
        with tempfile.TemporaryDirectory() as folder:
            noisy, clean = Path(folder) / "noisy.exr", Path(folder) / "clean.exr"
            channels = {**self.with_variances(USUAL), **more}
            images.write(noisy, channels, {"spp": self.image.samples})
            asked = [word for feature in features for word in ("--feature", feature)]
            command = [str(self.linpred), "denoise", str(noisy), "-o", str(clean), "--quality", "balanced", "--threads", "1", *asked]
            seconds = program.run(command)
            return Made(images.planes(clean, COLOUR), seconds)

    def with_variances(self, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        """Channels of the image by name, and their variances, of those that have some."""
        found = images.channels(self.image.path)
        return {name: found[name] for own in names for name in (own, images.variance_of(own)) if name == own or name in found}

    def in_mirrors(self) -> dict[str, np.ndarray]:
        """Albedo, normal and their variances, in mirrors those of what they reflect: what the manual of Open Image Denoise recommends."""
        found = images.channels(self.image.path)
        mirror = found["roughness"] < MIRROR
        pairs = [(of(own), of(reflected)) for own, reflected in REFLECTIONS for of in (str, images.variance_of)]
        return {own: np.where(mirror, found[reflected], found[own]) for own, reflected in pairs}

    def oidn(self, albedo: np.ndarray, normal: np.ndarray) -> Made:
        """Open Image Denoise, quality high; seconds without start-up."""
        layers = {"colour": images.planes(self.image.path, COLOUR), "albedo": albedo.clip(0, 1), "normal": normal.clip(-1, 1)}
        height, width = albedo.shape[:2]
        with tempfile.TemporaryDirectory() as folder:
            for name, layer in layers.items():
                layer.astype("<f4").tofile(Path(folder) / name)
            done = subprocess.run([sys.executable, str(OIDN), folder, str(width), str(height), "1", "1"], capture_output=True, text=True)
            if done.returncode:
                raise Failed(f"oidn.py: {done.stderr.strip().splitlines()[-1]}")
            picture = np.fromfile(Path(folder) / "denoised", "<f4").reshape(height, width, 3).astype(np.float64)
        return Made(picture, json.loads(done.stdout)["cost"]["cpu"])


@dataclass(frozen=True)
class Method:
    """How a picture is made, and the channels that the file must have for it."""

    make: Callable[[Bench], Made]
    needs: tuple[str, ...] = ()


def features(names: tuple[str, ...], *asked: str) -> Method:
    """linpred with channels of the file as further features."""
    return Method(lambda bench: bench.denoised(bench.with_variances(names), asked), names)


def white_noise(count: int, variances: bool) -> Method:
    """linpred with channels that say nothing."""
    asked = [f"noise{number}" + (f"=noise{number}Variance" if variances else "") for number in range(1, count + 1)]
    return Method(lambda bench: bench.denoised(bench.noise(variances), tuple(asked)))


def with_oidn(bench: Bench) -> Made:
    """linpred with what Open Image Denoise makes as a feature, whose variance nobody knows."""
    picture = bench.made("OIDN").picture
    return bench.denoised({f"oidn.{c}": picture[..., index] for index, c in enumerate(COLOUR)}, ("oidn",))


def beside(bench: Bench) -> Made:
    """linpred with what mirrors reflect as features, which elsewhere are the albedo and the normal once more."""
    renamed = {f"in{name}": channel for name, channel in bench.in_mirrors().items()}
    return bench.denoised(renamed, ("inalbedo=inalbedoVariance", "inN=inNVariance"))


def instead(bench: Bench) -> Made:
    """linpred with what mirrors reflect for their albedo and normal: no further features."""
    return bench.denoised(bench.in_mirrors(), ())


def oidn(bench: Bench) -> Made:
    """Albedo and normal of what is hit first."""
    path = bench.image.path
    return bench.oidn(images.planes(path, ALBEDO), images.planes(path, NORMAL))


def oidn_in_mirrors(bench: Bench) -> Made:
    found = bench.in_mirrors()
    return bench.oidn(*(np.stack([found[name].astype(np.float64) for name in names], -1) for names in (ALBEDO, NORMAL)))


def oidn_reflected(bench: Bench) -> Made:
    """Albedo and normal of what every surface reflects."""
    path = bench.image.path
    return bench.oidn(images.planes(path, REFLECTED_ALBEDO), images.planes(path, REFLECTED_NORMAL))


ROUGHNESS, SHADOW = "roughness=roughnessVariance", "shadow=shadowVariance"
NONE = "none"
METHODS: dict[str, Method] = {
    "noisy": Method(lambda bench: Made(images.planes(bench.image.path, COLOUR), None)),
    NONE: features(()),
    "position": features(POSITION, "P"),
    "reflected albedo": features(REFLECTED_ALBEDO, "reflAlbedo"),
    "reflected normal": features(REFLECTED_NORMAL, "reflN"),
    "reflected both": features((*REFLECTED_ALBEDO, *REFLECTED_NORMAL), "reflAlbedo", "reflN"),
    "reflections in mirrors": Method(beside, OF_MIRRORS),
    "reflections in mirrors, instead": Method(instead, OF_MIRRORS),
    "position, reflected albedo": features((*POSITION, *REFLECTED_ALBEDO), "P", "reflAlbedo"),
    "roughness": features(("roughness",), ROUGHNESS),
    "shadow": features(("shadow",), SHADOW),
    "reflected albedo, roughness, shadow": features((*REFLECTED_ALBEDO, "roughness", "shadow"), "reflAlbedo", ROUGHNESS, SHADOW),
    "OIDN's picture": Method(with_oidn),
    "1 of noise": white_noise(1, True),
    "6 of noise": white_noise(NOISE, True),
    "1 of noise, no variance": white_noise(1, False),
    "6 of noise, no variance": white_noise(NOISE, False),
    "OIDN": Method(oidn),
    "OIDN, reflections in mirrors": Method(oidn_in_mirrors, OF_MIRRORS),
    "OIDN, reflections": Method(oidn_reflected, (*REFLECTED_ALBEDO, *REFLECTED_NORMAL)),
}
"""Those of the table, in its order: linpred with these further features, then Open Image Denoise by itself."""
NOISY = tuple(method for method in METHODS if "of noise" in method)
"""Those whose features say nothing."""
