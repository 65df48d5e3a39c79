"""What the commands do to files."""

from __future__ import annotations

import json
import os
import warnings as python_warnings
from dataclasses import dataclass
from typing import Any, Callable, Iterable, Mapping, Union

from linpred import _linpred
from linpred._errors import InputWarning, SequenceError
from linpred._frames import Report, _computing
from linpred._progress import Progress, as_function

Path = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True)
class FileReport:
    """What was done with a file."""

    input: str
    """The noisy file."""
    output: str
    """The denoised file."""
    frame: int | None
    """Its number in a sequence; None for a single image."""
    skipped: bool
    """Whether it was left alone because the output was there."""
    pictures: tuple[Report, ...] = ()
    """What the run of each picture did: most files have one, a view or a view layer is a picture of its own."""
    notes: tuple[str, ...] = ()
    """What there is to know about the file."""
    warnings: tuple[str, ...] = ()
    """What is not as it should be; also raised as :class:`InputWarning`."""
    clamped: int = 0
    """Samples that half precision cannot hold, clamped to its largest value."""
    layers_off: int = 0
    """Pixels whose layers do not sum to the colour in the input, so they cannot in the output."""


@dataclass(frozen=True)
class Plan:
    """How a file would be denoised."""

    threads: int
    """Threads that would compute."""
    memory: int
    """Bytes of memory that would be used at most."""
    text: str
    """What they would be used for."""


def denoise_file(
    input: Path,
    output: Path,
    *,
    quality: str = "balanced",
    coverage: int | None = None,
    formulas: str = "robust",
    preset: str = "auto",
    map: Mapping[str, str] | None = None,
    spp: int | None = None,
    other_half: Path | None = None,
    layers: Iterable[str] = (),
    wrap: str = "auto",
    error_layer: bool = False,
    models_layer: bool = False,
    threads: int | None = None,
    max_memory: int | str | None = None,
    frames: str | Iterable[int] | None = None,
    skip_existing: bool = False,
    band: str | None = None,
    progress: Progress = None,
) -> FileReport | list[FileReport]:
    """Denoises an EXR file into another, with the bits of the command ``linpred denoise``, whose options these are.

    Args:
        input: The noisy file. With a place for the frame number in its name (``shot.####.exr``, ``shot.%04d.exr``, ``shot.$F4.exr``) a sequence.
        output: The denoised file, with a place for the number if the input has one. It appears whole or not at all; channels that are not
            denoised are kept as they are.
        quality, coverage, formulas, threads: As for :func:`linpred.denoise`.
        preset: Whose channel names to expect: ``"auto"``, or the name of a renderer (``linpred denoise --help`` lists them).
        map: Channels or layers by role, ``{"albedo": "kd", "variance": "none"}``; wins over the preset.
        spp: Samples per pixel, where the file does not state them, or states them wrongly.
        other_half: The image from the other half of the samples: the two are averaged, their difference gives the variance.
        layers: More layers to denoise, ``["diffuse", "light_*"]``, with the models of the colour, so that they still sum up.
        wrap: Whether windows wrap around the left and right ends, as in a panorama: ``"auto"``, ``"x"`` or ``"none"``.
        error_layer: Adds the channel ``linpred.error``, the estimated mean squared error of each pixel.
        models_layer: Adds ``linpred.radius`` and ``linpred.rank``.
        max_memory: Bytes that may be used, or ``"256M"``; 2 GiB by default. A job that needs more is refused before it begins.
        frames: Of a sequence, ``"1-100x2,205"`` or numbers; those whose files exist by default.
        skip_existing: Leaves frames alone whose output exists.
        band: ``"i/N"``: only the i-th of N bands of the image, for :func:`stitch`.
        progress: A function of (rows done, rows of all frames), called on this thread, or a ``tqdm`` bar. What it raises ends the run, which leaves
            nothing behind. Frames count as high as the one at work.

    Returns:
        A report, or a list of them for a sequence.

    Raises:
        ValueError: The options make no sense, whatever the file holds.
        InputError: The file cannot be denoised as asked for (a ValueError, too).
        SequenceError: Some frames could not be denoised; the others are (an InputError, too).
        OSError: A file cannot be read or written.
        MemoryError: The job takes more memory than it may or can have.
        KeyboardInterrupt: Ctrl-C was pressed; no output is left half-written.

    Warns:
        InputWarning: Something about the file is not as it should be.
    """
    reading = _reading(input, preset, map, spp, other_half, layers, wrap, max_memory)
    writing = dict(output=os.fspath(output), error_layer=error_layer, models_layer=models_layer, band=band)
    computing = _computing(quality, coverage, formulas, threads)
    wanted = list(frames) if frames is not None and not isinstance(frames, str) else frames
    sequence = _linpred.frames(reading, os.fspath(output), wanted)
    if sequence is None:
        told = _Told(as_function(progress), 0, 1)
        return _one(reading, writing, computing, None, skip_existing, told)
    reports: list[FileReport] = []
    failures: dict[int, Exception] = {}
    for index, (number, path, half, out) in enumerate(sequence):
        one, to = dict(reading, path=path, other_half=half), dict(writing, output=out)
        told = _Told(as_function(progress), index, len(sequence))
        try:
            reports.append(_one(one, to, computing, number, skip_existing, told))
        except (ValueError, OSError, MemoryError) as error:
            if error is told.raised:
                raise
            failures[number] = error
    if failures:
        raise SequenceError(failures, reports)
    return reports


class _Told:
    """Tells how many rows of all frames are done, and keeps what the caller's function raises: it is no fault of the frame's."""

    def __init__(self, tell: Callable[[int, int], object] | None, index: int, frames: int) -> None:
        self._tell, self._index, self._frames = tell, index, frames
        self.raised: BaseException | None = None

    def __call__(self, done: int, rows: int) -> None:
        if self._tell is None:
            return
        try:
            self._tell(self._index * rows + done, self._frames * rows)
        except BaseException as error:
            self.raised = error
            raise


def _one(
    reading: dict[str, Any],
    writing: dict[str, Any],
    computing: dict[str, Any],
    frame: int | None,
    skip_existing: bool,
    told: _Told,
) -> FileReport:
    input, output = os.fspath(reading["path"]), os.fspath(writing["output"])
    if skip_existing and os.path.exists(output):
        return FileReport(input, output, frame, skipped=True)
    done = _linpred.denoise_file(reading, writing, computing, told)
    for warning in done["warnings"]:
        python_warnings.warn(warning, InputWarning, stacklevel=3)
    return FileReport(
        input,
        output,
        frame,
        skipped=False,
        pictures=tuple(Report(**picture) for picture in done["pictures"]),
        notes=tuple(done["notes"]),
        warnings=tuple(done["warnings"]),
        clamped=done["clamped"],
        layers_off=done["layers_off"],
    )


def plan(
    input: Path,
    *,
    quality: str = "balanced",
    coverage: int | None = None,
    formulas: str = "robust",
    preset: str = "auto",
    map: Mapping[str, str] | None = None,
    spp: int | None = None,
    other_half: Path | None = None,
    layers: Iterable[str] = (),
    wrap: str = "auto",
    error_layer: bool = False,
    models_layer: bool = False,
    threads: int | None = None,
    max_memory: int | str | None = None,
    band: str | None = None,
) -> Plan:
    """How :func:`denoise_file` would denoise a file, from its header alone: what ``--dry-run`` prints. Raises what it would raise before it begins."""
    reading = _reading(input, preset, map, spp, other_half, layers, wrap, max_memory)
    writing = dict(output="", error_layer=error_layer, models_layer=models_layer, band=band)
    return Plan(*_linpred.plan(reading, writing, _computing(quality, coverage, formulas, threads)))


def inspect(
    path: Path,
    *,
    preset: str = "auto",
    map: Mapping[str, str] | None = None,
    spp: int | None = None,
    other_half: Path | None = None,
    layers: Iterable[str] = (),
    wrap: str = "auto",
    pixels: bool = False,
    threads: int | None = None,
    max_memory: int | str | None = None,
) -> dict[str, Any]:
    """Says what a file holds and which channel plays which role: what ``linpred inspect --json`` prints.

    With ``pixels`` they are read, too: what a run would skip, which features never vary, which pixels are not finite. A file that can be opened but not
    denoised is no error: ``"problem"`` says why. The other arguments are those of :func:`denoise_file`.

    >>> found = inspect("tests/data/toasters_16spp.exr")
    >>> [role["role"] for role in found["roles"]][:3], found["problem"]
    (['colour', 'albedo', 'normal'], None)
    """
    reading = _reading(path, preset, map, spp, other_half, layers, wrap, max_memory)
    found: dict[str, Any] = json.loads(_linpred.inspect(reading, pixels, threads))
    return found


def compare(
    image: Path,
    reference: Path,
    *,
    input: Path | None = None,
    map: Mapping[str, str] | None = None,
    heatmap: Path | None = None,
    picture: Path | None = None,
    threads: int | None = None,
    max_memory: int | str | None = None,
) -> dict[str, Any]:
    """Measures how far an image is from a reference: what ``linpred compare --json`` prints, whose help says what the figures are.

    Args:
        image: The image, an EXR file.
        reference: What it should be.
        input: What the image was made of: measured, too, and the gain.
        map: Which layer is the colour, ``{"colour": "beauty"}``.
        heatmap: Where to write a picture of the relative error, PNG.
        picture: Where to write a picture to look at: the images side by side, and the worst places, PNG.
        threads: Threads that compute; no figure depends on it.
        max_memory: Bytes that may be used, or ``"256M"``.
    """
    found: dict[str, Any] = json.loads(
        _linpred.compare(
            os.fspath(image),
            os.fspath(reference),
            None if input is None else os.fspath(input),
            _entries(map),
            None if heatmap is None else os.fspath(heatmap),
            None if picture is None else os.fspath(picture),
            threads,
            None if max_memory is None else str(max_memory),
        )
    )
    return found


def stitch(bands: Iterable[Path], output: Path) -> None:
    """Puts the bands of an image together, in any order, into ``output``: see ``band`` of :func:`denoise_file`."""
    _linpred.stitch([os.fspath(band) for band in bands], os.fspath(output))


def _reading(
    path: Path,
    preset: str,
    map: Mapping[str, str] | None,
    spp: int | None,
    other_half: Path | None,
    layers: Iterable[str],
    wrap: str,
    max_memory: int | str | None,
) -> dict[str, Any]:
    return dict(
        path=os.fspath(path),
        preset=preset,
        map=_entries(map),
        spp=spp,
        other_half=None if other_half is None else os.fspath(other_half),
        layers=layers.split(",") if isinstance(layers, str) else list(layers),
        wrap=wrap,
        max_memory=None if max_memory is None else str(max_memory),
    )


def _entries(map: Mapping[str, str] | None) -> list[str]:
    return [f"{role}={channel}" for role, channel in (map or {}).items()]
