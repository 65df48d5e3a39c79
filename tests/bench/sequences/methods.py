"""The methods: each makes a picture of every frame of a sequence."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import lpr
import naive
import numpy as np
import program
import wlr
from frames import ALBEDO, COLOUR, FEATURE_VARIANCES, FEATURES, MOTION, NORMAL, POSITION, VARIANCE, Sequence, planes, rewrite, write_colour
from program import Failed

OIDN = Path(__file__).resolve().parent.parent / "oidn.py"
Pictures = list[np.ndarray]


@dataclass(frozen=True)
class Made:
    """Pictures (height, width, 3) of all frames, and CPU seconds per frame of methods whose time is told."""

    pictures: Pictures
    seconds: float | None = None


class Bench:
    """A sequence, the program, and what methods have made of it so far, which is kept in `folder`."""

    def __init__(self, sequence: Sequence, linpred: Path, folder: Path) -> None:
        self.sequence, self.linpred, self.folder = sequence, linpred, folder
        self._made: dict[str, Made] = {}

    def made(self, method: str) -> Made:
        """What a method makes, which is then also in files; made once."""
        if method not in self._made:
            # of a method that fails none are left of another run
            shutil.rmtree(self.folder / slug(method), ignore_errors=True)
            found = METHODS[method](self)
            for number, picture in zip(self.sequence.numbers, found.pictures, strict=True):
                write_colour(self.file(method, number), picture)
            # as they are stored, so that whoever reads the files judges the same
            self._made[method] = replace(found, pictures=[picture.astype(np.float32).astype(np.float64) for picture in found.pictures])
        return self._made[method]

    def file(self, method: str, number: str) -> Path:
        return self.folder / slug(method) / f"{number}.exr"

    def read(self, names: tuple[str, ...]) -> Pictures:
        """Channels of all noisy frames."""
        return [planes(self.sequence.noisy(number), names) for number in self.sequence.numbers]

    def denoised(self, pattern: str, *options: str) -> Made:
        """`linpred denoise` of the frames of a pattern, one thread; fails with the program's own words."""
        with tempfile.TemporaryDirectory() as folder:
            digits = "#" * len(self.sequence.numbers[0])
            command = [str(self.linpred), "denoise", pattern, "-o", f"{folder}/{digits}.exr", "--threads", "1", *options]
            seconds = program.run(command) / len(self.sequence.numbers)
            return Made([planes(Path(folder) / f"{number}.exr", COLOUR) for number in self.sequence.numbers], seconds)


def slug(method: str) -> str:
    """A method's name as a file's: `LPR 6, 11 x 11` is `lpr-6-11-x-11`."""
    return "-".join("".join(c if c.isalnum() else " " for c in method.lower()).split())


def noisy(bench: Bench) -> Made:
    return Made(bench.read(COLOUR))


def program(*options: str) -> Callable[[Bench], Made]:
    """`linpred denoise` of the whole sequence."""
    return lambda bench: bench.denoised(bench.sequence.pattern, *options)


def network(path: Path) -> tuple[np.ndarray, float]:
    """What Open Image Denoise makes of a file, quality high, albedo and normal as rendered, and the CPU seconds of that without start-up."""
    images = {"colour": planes(path, COLOUR), "albedo": planes(path, ALBEDO).clip(0, 1), "normal": planes(path, NORMAL).clip(-1, 1)}
    height, width = images["colour"].shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        for name, image in images.items():
            image.astype("<f4").tofile(Path(folder) / name)
        done = subprocess.run([sys.executable, str(OIDN), folder, str(width), str(height), "1", "1"], capture_output=True, text=True)
        if done.returncode:
            raise Failed(f"oidn.py: {done.stderr.strip().splitlines()[-1]}")
        picture = np.fromfile(Path(folder) / "denoised", "<f4").reshape(height, width, 3).astype(np.float64)
    return picture, json.loads(done.stdout)["cost"]["cpu"]


def oidn(bench: Bench) -> Made:
    """Open Image Denoise, frame by frame."""
    pictures, seconds = zip(*(network(bench.sequence.noisy(number)) for number in bench.sequence.numbers), strict=True)
    return Made(list(pictures), sum(seconds) / len(seconds))


def mean_after(bench: Bench) -> Made:
    """Denoised frames, then their mean along the motion."""
    pictures, motions = bench.made("linpred").pictures, bench.read(MOTION)
    return Made([naive.mean_of_frames(pictures, motions, frame) for frame in range(len(pictures))])


def mean_before(bench: Bench) -> Made:
    """The noisy colours' mean along the motion, then denoised; features are those of the frame itself."""
    sequence, motions = bench.sequence, bench.read(MOTION)
    colours, variances = bench.read(COLOUR), bench.read(VARIANCE)
    pattern = Path(sequence.pattern).name
    with tempfile.TemporaryDirectory() as folder:
        for frame, number in enumerate(sequence.numbers):
            means = naive.mean_of_frames(colours, motions, frame), naive.mean_of_noise(variances, motions, frame)
            changed = {name: plane for names, mean in zip((COLOUR, VARIANCE), means) for name, plane in zip(names, np.moveaxis(mean, -1, 0))}
            rewrite(sequence.noisy(number), Path(folder) / sequence.noisy(number).name, changed)
        return Made(bench.denoised(f"{folder}/{pattern}", "--quality", "balanced").pictures)


def lines(denoised: str, search: lpr.Search) -> Callable[[Bench], Made]:
    """LPR section 6 on the frames that a method has denoised."""
    return lambda bench: Made(lpr.filtered(bench.made(denoised).pictures, bench.read(POSITION), search))


def regression(window: wlr.Window) -> Callable[[Bench], Made]:
    """WLR on the noisy frames."""
    return lambda bench: Made(_each_frame(_volume(bench), window)[0])


def regression_twice(bench: Bench) -> Made:
    """WLR of each frame by itself, and again over the frames that came out, with their variances: the paper's own choice."""
    volume = _volume(bench)
    pictures, variances = _each_frame(volume, wlr.Window(radius=9, frames=0))
    return Made(_each_frame(replace(volume, colour=np.stack(pictures), variance=np.stack(variances)), TOGETHER)[0])


TOGETHER = wlr.Window(radius=3, frames=2)
"""7 x 7 x 5, as section 8 of the paper has it for animations."""


def _volume(bench: Bench) -> wlr.Volume:
    colour, variance, features, of_features = (np.stack(bench.read(names)) for names in (COLOUR, VARIANCE, FEATURES, FEATURE_VARIANCES))
    return wlr.Volume(colour, variance, features, of_features, bench.sequence.samples)


def _each_frame(volume: wlr.Volume, window: wlr.Window) -> tuple[Pictures, Pictures]:
    pictures, variances = zip(*(wlr.filtered(volume, window, frame) for frame in range(len(volume.colour))), strict=True)
    return list(pictures), list(variances)


METHODS: dict[str, Callable[[Bench], Made]] = {
    "noisy": noisy,
    "linpred": program("--quality", "balanced"),
    "linpred --temporal": program("--quality", "balanced", "--temporal"),
    "linpred literal": program("--formulas", "literal"),
    "OIDN": oidn,
    "mean of denoised": mean_after,
    "mean of noisy": mean_before,
    "LPR 6 on literal": lines("linpred literal", lpr.Search(radius=5, product=True)),
    "LPR 6 on balanced": lines("linpred", lpr.Search(radius=5, product=True)),
    "WLR on noisy": regression(TOGETHER),
    "WLR twice": regression_twice,
}
"""Those of the table, in its order. The window of LPR 6 is 11 x 11 pixels."""

SEARCHES = {
    f"LPR 6 on balanced, {2 * radius + 1} x {2 * radius + 1}, {'product' if product else 'sum'}": lines("linpred", lpr.Search(radius, product))
    for product in (True, False)
    for radius in (1, 3, 5, 10)
}
VARIANTS = {**SEARCHES, "WLR on noisy, outlier weights": regression(replace(TOGETHER, outliers=True))}
"""Of what the papers leave open."""
METHODS |= VARIANTS
