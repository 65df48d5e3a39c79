"""The loop: a pass, what it leaves in error, where the next one samples."""

from __future__ import annotations

import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import linpred
from linpred.mitsuba import _passes
from linpred.mitsuba._folder import Folder
from linpred.mitsuba._scene import View

FIRST = 4
"""Samples of each pixel in the first pass: the fewest that a variance and the error of a denoised pixel are worth anything with."""

EARLY = (4, 8, 12, 16)
GROWTH = 1.5
"""Samples per pixel after a pass, on average: these, then by half again. Steps that are finer cost more denoising than they save."""

SHARE_OF_PICTURES = 1 / 20
"""Of the time that was rendered: what the pictures in between may take."""

LEAST = 0.5
"""No pass for less than this many samples per pixel."""

@dataclass(frozen=True)
class Pass:
    """Where a loop is after a pass.

    Attributes:
        number: Of the pass, from 1.
        samples: Samples per pixel so far, on average.
        most: The most that the next pass gives a pixel.
        error: The predicted relative error of the denoised picture now: mean over the pixels of estimated squared error over squared radiance + 0.003.
        rendering: Seconds of rendering so far.
        other: Seconds of everything else so far, but those of loading the scene and building Mitsuba's kernels.
    """

    number: int
    samples: float
    most: int
    error: float
    rendering: float
    other: float


class Watch:
    """Who is told how far a loop is; nobody, as it stands."""

    def note(self, sentence: str) -> None:
        """Something about the scene or the loop."""

    def rendering(self, number: int, done: int, of_all: int) -> None:
        """Samples of a pass."""

    def passed(self, where: Pass) -> None:
        """A pass is done, and its error known."""


@dataclass(frozen=True)
class Options:
    """What a loop is asked for; see :func:`linpred.mitsuba.render`."""

    output: Path
    spp: int
    target_error: float | None
    time: float | None
    quality: str
    seed: int
    noisy: Path | None
    keep: bool
    threads: int | None
    max_memory: int | str | None


class Loop:
    """A loop at work."""

    def __init__(self, view: View, options: Options, folder: Folder, watch: Watch) -> None:
        self.view, self.options, self.folder, self.watch = view, options, folder, watch
        self._began, self._before = time.monotonic(), folder.spent
        self._pictures = 0.0
        self._picture_cost: float | None = None
        self._pictured_at = 0.0

    def run(self) -> tuple[Pass, str]:
        """Renders until there is enough; where it ended, and why: ``"spp"``, ``"error"``, ``"time"``, or ``"exact"`` where no pixel varies any more."""
        self._warm_up()
        if not self._passes():
            first = min(FIRST, self.options.spp)
            self._render(np.full((self.view.height, self.view.width), first), first)
        while True:
            found = self._assess()
            where = self._where(found)
            self.watch.passed(where)
            why = self._enough(found, where)
            if why is not None:
                self._finish()
                return where, why
            self._show(where, found["seconds"])
            self._render(_passes.counts(self.view, str(self.folder.path / _map(where.number))), found["added"])

    def _finish(self) -> None:
        merged = self._merged(len(self._passes()))
        self._denoise(self.options.quality)
        if self.options.noisy is not None:
            part = self.options.noisy.with_name(f"{self.options.noisy.name}.part")
            shutil.copyfile(merged, part)
            os.replace(part, self.options.noisy)
        if not self.options.keep:
            self.folder.remove()

    def _spent(self) -> float:
        return self._before + time.monotonic() - self._began

    def _passes(self) -> list[dict[str, Any]]:
        """What is said of the passes that are there, up to the first that is not."""
        found: list[dict[str, Any]] = []
        while (entry := self.folder.of(_pass(len(found)))) is not None:
            found.append(entry)
        return found

    def _warm_up(self) -> None:
        """Has Mitsuba's kernels built, which is no measure of a pass."""
        one = np.zeros((self.view.height, self.view.width), np.int64)
        # of two pixels: Dr.Jit takes an array of one for a number, which makes another kernel
        one.reshape(-1)[:2] = 2
        _passes.trace(self.view, one, self.options.seed, 0)

    def _render(self, counts: Any, asked: float) -> None:
        """Renders the next pass: ``asked`` samples per pixel on average, as its map says."""
        number = len(self._passes())

        def make(part: Path) -> dict[str, Any]:
            began = time.monotonic()
            found = _passes.trace(self.view, counts, self.options.seed, number, lambda done, of_all: self.watch.rendering(number + 1, done, of_all))
            traced = time.monotonic()
            _passes.write(self.view, found, str(part))
            return {"asked": float(asked), "left_out": found.left_out, "seconds": traced - began, "writing": time.monotonic() - traced}

        self.folder.add(_pass(number), make, self._spent)

    def _assess(self) -> dict[str, Any]:
        """Merges the passes, and asks where the next one should sample: what is said of its map. Nothing is done twice."""
        passes, target = self._passes(), self.options.target_error
        step = self._step(passes)
        known = self.folder.of(_map(len(passes)))
        if known is not None and (known["step"], known["target"]) == (step, target):
            return known
        began = time.monotonic()
        merged = self._merged(len(passes))

        def make(part: Path) -> dict[str, Any]:
            # what one more sample would bring is asked for even at the end: it tells the error
            report = self._map(merged, part, max(step, 1.0), target)
            if report.added < 1.0 and not report.reached:
                # what little is missing is only estimated; passes smaller than that cost more denoising than they save
                report = self._map(merged, part, 1.0, None)
            found = {name: getattr(report, name) for name in ("samples", "added", "most", "error", "reached")}
            return {**found, "step": step, "target": target, "seconds": time.monotonic() - began}

        return self.folder.add(_map(len(passes)), make, self._spent)

    def _merged(self, passes: int) -> Path:
        """The file of so many passes, made of the one before and the last pass, so that no pass is read twice."""
        if passes == 1:
            return self.folder.path / _pass(0)
        name, last = _all(passes), self.folder.path / _pass(passes - 1)
        if self.folder.of(name) is None:
            before = self._merged(passes - 1)

            def make(part: Path) -> dict[str, Any]:
                linpred.merge([before, last], part, max_memory=self.options.max_memory)
                return {}

            self.folder.add(name, make, self._spent)
            if passes > 2:
                before.unlink()
        return self.folder.path / name

    def _map(self, merged: Path, to: Path, budget: float, target: float | None) -> linpred.SampleReport:
        options = self.options
        return linpred.sample_map_file(merged, to, budget=budget, target_error=target, threads=options.threads, max_memory=options.max_memory)

    def _step(self, passes: list[dict[str, Any]]) -> float:
        """Samples per pixel of the next pass, on average; 0 if there is to be none."""
        samples = sum(done["asked"] for done in passes)
        step = min(next_total(samples), self.options.spp) - samples
        if self.options.time is not None:
            last = passes[-1]
            costs = [found["seconds"] for number in range(1, len(passes) + 1) if (found := self.folder.of(_map(number)))]
            # its file and its assessment, and the picture at the end, which takes about as long
            other = last["writing"] + 2 * costs[-1] if costs else 0.0
            step = min(step, (self.options.time - self._spent() - other) * last["asked"] / max(last["seconds"], 1e-3))
        return step if step >= LEAST else 0.0

    def _enough(self, found: dict[str, Any], where: Pass) -> str | None:
        """Why no other pass is needed, if so."""
        if found["reached"]:
            return "error"
        if found["step"] == 0.0:
            asked = sum(done["asked"] for done in self._passes())
            return "spp" if self.options.spp - asked < LEAST else "time"
        return "exact" if where.error == 0.0 else None

    def _where(self, found: dict[str, Any]) -> Pass:
        passes = self._passes()
        rendering = sum(done["seconds"] for done in passes)
        maps = (self.folder.of(_map(number)) for number in range(1, len(passes) + 1))
        other = sum(done["writing"] for done in passes) + sum(one["seconds"] for one in maps if one is not None) + self._pictures
        return Pass(len(passes), found["samples"], int(found["most"]), found["error"], rendering, other)

    def _show(self, where: Pass, assessed: float) -> None:
        """Renews the picture if that is cheap beside what was rendered since it was renewed."""
        cost = self._picture_cost if self._picture_cost is not None else assessed
        if cost < SHARE_OF_PICTURES * (where.rendering - self._pictured_at):
            self._denoise("fast")
            self._pictured_at = where.rendering

    def _denoise(self, quality: str) -> None:
        began = time.monotonic()
        options = self.options
        linpred.denoise_file(self._merged(len(self._passes())), options.output, quality=quality, threads=options.threads, max_memory=options.max_memory)
        self._picture_cost = time.monotonic() - began
        self._pictures += self._picture_cost

    @property
    def left_out(self) -> int:
        """Samples that were not finite."""
        return sum(int(done["left_out"]) for done in self._passes())


def next_total(samples: float) -> float:
    """How many samples per pixel there are to be after the next pass.

    >>> [next_total(n) for n in (0, 4, 11.9, 12, 16, 24, 36)]
    [4, 8, 16, 16, 24.0, 36.0, 54.0]
    """
    total: float = EARLY[0]
    for total in EARLY:
        if total >= samples + LEAST:
            return total
    while total < samples + LEAST:
        total *= GROWTH
    return total


def _pass(number: int) -> str:
    return f"pass-{number:03}.exr"


def _all(passes: int) -> str:
    """Of so many passes."""
    return f"all-{passes:03}.exr"


def _map(number: int) -> str:
    """Of the samples of the pass with this number."""
    return f"map-{number:03}.exr"
