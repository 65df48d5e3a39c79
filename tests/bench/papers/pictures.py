"""Pictures of a scene, what the program makes of them, and how far that is from the reference."""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from frames import COLOUR, planes, reference_noise
from methods import Failed


@dataclass(frozen=True)
class Noisy:
    """A scene at so many samples per pixel, as a file, and its reference."""

    scene: str
    samples: int
    path: Path
    reference: Path

    @property
    def label(self) -> str:
        return f"{self.scene}, {self.samples}"


@dataclass(frozen=True)
class Reference:
    """Radiance and the variance of its mean, (height, width, 3)."""

    colour: np.ndarray
    noise: np.ndarray

    @staticmethod
    def read(path: Path) -> Reference:
        return Reference(planes(path, COLOUR), reference_noise(path))

    def error(self, picture: np.ndarray) -> float:
        """rMSE as `linpred compare` has it: mean of ((a - f)^2 - var f) / (f^2 + 0.01)."""
        return float(np.mean(((picture - self.colour) ** 2 - self.noise) / (self.colour**2 + 0.01)))

    @property
    def own_error(self) -> float:
        """The rMSE that its noise would be if it were not taken off."""
        return float(np.mean(self.noise / (self.colour**2 + 0.01)))

    def cut(self, side: int) -> Reference:
        return Reference(middle(self.colour, side), middle(self.noise, side))


def middle(planes: np.ndarray, side: int) -> np.ndarray:
    """The side x side pixels in the middle of (height, width, ...)."""
    top, left = ((size - side) // 2 for size in planes.shape[:2])
    return planes[top : top + side, left : left + side]


def find(folder: Path) -> list[Noisy]:
    """The pictures of a folder: `<scene>_<n>spp.exr` with `<scene>_ref.exr` beside them."""
    found = []
    for path in folder.glob("*spp.exr"):
        parts = re.fullmatch(r"(.+)_(\d+)spp\.exr", path.name)
        if parts and (reference := folder / f"{parts[1]}_ref.exr").is_file():
            found.append(Noisy(parts[1], int(parts[2]), path, reference))
    return sorted(found, key=lambda noisy: (noisy.scene, noisy.samples))


class Program:
    """The program `linpred`, and the study of the tests' crate."""

    def __init__(self, linpred: Path, study: Path) -> None:
        self.linpred, self._study = linpred, study

    def denoised(self, noisy: Path, *options: str) -> tuple[np.ndarray, dict[str, np.ndarray], int]:
        """The picture, its extra layers by name, and how many models it took; fails with the program's own words."""
        with tempfile.TemporaryDirectory() as folder:
            to = Path(folder) / "denoised.exr"
            said = _run([str(self.linpred), "denoise", str(noisy), "-o", str(to), "--models-layer", "--error-layer", "--log-format", "json", "-v", *options])
            layers = {name: planes(to, (f"linpred.{name}",))[..., 0] for name in ("error", "rank", "radius")}
            return planes(to, COLOUR), layers, _models(said.stderr)

    def study(self, *arguments: str | Path) -> list[dict[str, str]]:
        """Rows of a table of the study."""
        return list(csv.DictReader(io.StringIO(_run([str(self._study), *map(str, arguments)]).stdout)))


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        raise Failed(f"{command[0]}: {error.strerror}") from error
    if done.returncode:
        said = [json.loads(line).get("message", line) if line.startswith("{") else line for line in done.stderr.splitlines()]
        raise Failed(f"exit status {done.returncode} of {Path(command[0]).name} {command[1]}: {' '.join(said[-1:])[:300]}")
    return done


def _models(log: str) -> int:
    """From the report of a run."""
    for line in log.splitlines():
        found = json.loads(line) if line.startswith("{") else {}
        fields = {**found, **found.get("fields", {})}
        if "models" in fields:
            return int(fields["models"])
    raise Failed("the program does not say how many models it built")
