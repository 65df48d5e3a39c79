"""Mitsuba 3 in the loop: renders a scene where samples help the denoised picture most, and denoises it.

::

    python -m linpred.mitsuba scene.xml --spp 32 -o clean.exr

or, from Python, with a path or a scene that is loaded::

    report = linpred.mitsuba.render("scene.xml", "clean.exr", spp=32, target_error=0.002)
    report.samples, report.error

The first pass renders 4 samples of every pixel. After each pass the passes are merged (:func:`linpred.merge`), linpred predicts what error its picture has
and where more samples lower it most (:func:`linpred.sample_map_file`), and the next pass renders those: 8, 12, 16 samples per pixel in all, then by half
again, until there are enough, or the predicted error is below the target, or the time is up.

What is needed to go on is kept beside the output, in ``clean.exr.passes``. After a crash, a kill or Ctrl-C the same call goes on where it ended, to the same
bits as if nothing had happened.

Mitsuba is no dependency of linpred: ``pip install 'linpred[mitsuba]'``. Its LLVM variants need an LLVM library on the machine (Debian: ``libllvm19``; where
Dr.Jit finds another that fails, its path in ``DRJIT_LIBLLVM_PATH``).
"""

from __future__ import annotations

import operator
import os
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Callable

from linpred import _linpred
from linpred._options import Path, computing, flag, number, path, reading, whole, writing
from linpred.mitsuba import _loop, _scene
from linpred.mitsuba._folder import Folder
from linpred.mitsuba._loop import Pass

__all__ = ["Pass", "Rendered", "render"]


@dataclass(frozen=True)
class Rendered:
    """What a loop did.

    Attributes:
        output: The denoised file.
        passes: How many there were, those of runs before that were ended among them.
        samples: Samples per pixel, on average.
        error: The predicted relative error of the denoised picture: mean over the pixels of estimated squared error over squared radiance + 0.003.
        ended: Why: ``"spp"``, ``"error"`` (below the target), ``"time"``, or ``"exact"`` (no pixel varies).
        left_out: Samples with a value that is not finite: they are in no mean.
        rendering: Seconds in Mitsuba.
        other: Seconds of writing passes, merging, mapping and denoising; loading the scene and building Mitsuba's kernels is in neither.
        notes: What is not rendered as the scene says.
    """

    output: str
    passes: int
    samples: float
    error: float
    ended: str
    left_out: int
    rendering: float
    other: float
    notes: tuple[str, ...]


def render(
    scene: Any,
    output: Path,
    *,
    spp: int = 32,
    target_error: float | None = None,
    time: float | None = None,
    quality: str = "balanced",
    seed: int = 0,
    sensor: int = 0,
    variant: str | None = None,
    noisy: Path | None = None,
    keep: bool = False,
    restart: bool = False,
    threads: int | None = None,
    max_memory: int | str | None = None,
    progress: Callable[[Pass], object] | None = None,
) -> Rendered:
    """Renders a scene of Mitsuba 3 adaptively, and denoises it.

    Each sample is a path of the scene's own integrator through a random point of a pixel, for that pixel alone (box filter): pixels have to be independent
    for their noise to be told from detail. Thin lenses, shutters and crop windows are the sensor's. The alpha of the film is not kept.

    Args:
        scene: The scene's XML file, or a ``mitsuba.Scene``.
        output: The denoised EXR file. A first one is there before the end, and is renewed now and then.
        spp: Samples per pixel at most, on average; 1 or more.
        target_error: Ends as soon as the predicted relative error of the denoised picture is this low (:class:`Rendered`).
        time: Seconds that it may take, with those of runs that were ended: the last pass is as large as fits. The first pass is always rendered.
        quality: Of the last denoising, as for :func:`linpred.denoise`; those in between are ``"fast"``.
        seed: Another one draws other samples; 0 or more.
        sensor: Which of the scene's sensors, counted from 0.
        variant: Of Mitsuba: ``"llvm_ad_rgb"`` or ``"cuda_ad_rgb"``. The one that is set, or the first that works, by default.
        noisy: Where to put the merged noisy image, with variances, features and samples per pixel.
        keep: Keeps the folder of the passes; a call with a larger ``spp`` goes on from there.
        restart: Begins anew, whatever the folder holds.
        threads: Threads that compute, for Mitsuba as well; all by default.
        max_memory: Bytes that linpred may use, or ``"256M"``.
        progress: A function that is told of each pass. What it raises ends the loop, which can be resumed.

    Returns:
        What was done.

    Raises:
        ImportError: Mitsuba is missing, or none of its variants works on this machine.
        ValueError: The options make no sense.
        InputError: The scene cannot be rendered, or the folder of the passes is of another scene, size or seed (a ValueError, too).
        OSError: A file cannot be read or written.
        MemoryError: linpred needs more memory than ``max_memory`` allows.
        KeyboardInterrupt: Ctrl-C was pressed; the same call goes on from the last pass.
    """
    options = _options(output, spp, target_error, time, quality, seed, noisy, keep, threads, max_memory)
    if progress is not None and not callable(progress):
        raise TypeError(f"progress: {progress!r} cannot be called")
    return _render(scene, options, whole("sensor", sensor), variant, restart, _Calls(progress))


class _Calls(_loop.Watch):
    """Calls the caller's function."""

    def __init__(self, progress: Callable[[Pass], object] | None) -> None:
        self._progress = progress

    def passed(self, where: Pass) -> None:
        if self._progress is not None:
            self._progress(where)


def _options(
    output: object,
    spp: object,
    target_error: float | None,
    time: float | None,
    quality: object,
    seed: object,
    noisy: object,
    keep: object,
    threads: object,
    max_memory: int | str | None,
) -> _loop.Options:
    """The options, checked before anything is rendered."""
    to = path("output", output)
    # what the last step would refuse
    _linpred.check(reading(to, "auto", None, (), None, None, (), "auto", max_memory), writing(to, False, False, None, "keep"), computing(quality, None, "robust", threads))
    if os.path.isdir(to):
        raise IsADirectoryError(21, "the output is a folder", to)
    if not os.path.isdir(os.path.dirname(to) or "."):
        raise FileNotFoundError(2, "no such folder for the output", os.path.dirname(to))
    if whole("spp", spp) < 1:
        raise ValueError(f"spp: {spp} samples per pixel; it is 1 or more")
    # a number of any size: one that was cut off would draw another's samples
    drawn = operator.index(seed)  # type: ignore[arg-type]
    if drawn < 0:
        raise ValueError(f"seed: {seed}; it is 0 or more")
    for name, value in (("target_error", target_error), ("time", time)):
        if value is not None and not 0 < number(name, value) < float("inf"):
            raise ValueError(f"{name}: {value}; it is more than 0")
    merged = None if noisy is None else FilePath(path("noisy", noisy))
    if merged is not None and not merged.parent.is_dir():
        raise FileNotFoundError(2, "no such folder for the noisy image", str(merged.parent))
    if merged is not None and merged.resolve() == FilePath(to).resolve():
        raise ValueError(f"noisy: {merged} is the output, too")
    return _loop.Options(
        FilePath(to),
        whole("spp", spp),
        target_error,
        time,
        str(quality),
        drawn,
        merged,
        flag("keep", keep),
        None if threads is None else whole("threads", threads),
        max_memory,
    )


def _render(scene: Any, options: _loop.Options, sensor: int, variant: str | None, restart: bool, watch: _loop.Watch) -> Rendered:
    if isinstance(scene, (str, bytes, os.PathLike)):
        given = FilePath(path("scene", scene)).resolve()
        for name, written in (("output", options.output), ("noisy", options.noisy)):
            if written is not None and written.resolve() == given:
                raise ValueError(f"{name}: {written} is the scene")
    view = _scene.load(scene, variant, sensor)
    for sentence in view.notes:
        watch.note(sentence)
    if options.threads is not None:
        view.set_threads(options.threads)
    identity = {"scene": view.checksum, "size": [view.width, view.height], "seed": options.seed}
    folder = Folder(passes_of(options.output), identity, restart)
    loop = _loop.Loop(view, options, folder, watch)
    where, why = loop.run()
    return Rendered(
        str(options.output),
        where.number,
        where.samples,
        where.error,
        why,
        loop.left_out,
        where.rendering,
        where.other,
        view.notes,
    )


def passes_of(output: FilePath) -> FilePath:
    """The folder beside an output where its passes are kept."""
    return output.with_name(f"{output.name}.passes")
