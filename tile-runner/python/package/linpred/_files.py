"""What the commands do to files."""

from __future__ import annotations

import json
import os
import sys
import warnings as python_warnings
from dataclasses import dataclass
from typing import Any, Callable, Iterable, Mapping

from linpred import _linpred
from linpred._errors import InputWarning, SequenceError
from linpred._frames import Report
from linpred._options import Path, computing, entries, flag, path_or_none, paths, reach, reading, size, whole, whole_or_none, writing
from linpred._options import path as as_path
from linpred._progress import Progress, as_function


@dataclass(frozen=True)
class Help:
    """How a picture was helped by the frames beside its own.

    Attributes:
        frames: How many frames a pixel is made of, its own among them: the mean over what is denoised.
        before: Of each frame before it that helped, nearest first, the mean weight of its pixels: 1 for those that are as good as the frame's own.
        after: Of each frame after it, likewise.
    """

    frames: float
    before: tuple[float, ...]
    after: tuple[float, ...]


@dataclass(frozen=True)
class FileReport:
    """What was done with a file.

    Attributes:
        input: The noisy file.
        output: The denoised file.
        frame: Its number in a sequence; None for a single image.
        skipped: Whether it was left alone because the output was there.
        pictures: What the run of each picture did: most files have one, a view or a view layer is a picture of its own.
        notes: What there is to know about the file.
        warnings: What is not as it should be; also raised as :class:`InputWarning`.
        clamped: Samples that half precision cannot hold, clamped to its largest value.
        layers_off: Pixels whose layers do not sum to the colour in the input, so they cannot in the output.
        help: Of each picture of a frame of a sequence (``temporal``), how the frames beside it helped.
        unused: Which of those did not help, and why.
    """

    input: str
    output: str
    frame: int | None
    skipped: bool
    pictures: tuple[Report, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    clamped: int = 0
    layers_off: int = 0
    help: tuple[Help, ...] = ()
    unused: tuple[str, ...] = ()


@dataclass(frozen=True)
class Plan:
    """How a file would be denoised.

    Attributes:
        threads: Threads that would compute.
        memory: Bytes of memory that would be used at most.
        text: What they would be used for.
    """

    threads: int
    memory: int
    text: str


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
    features: str | Iterable[str] = (),
    wrap: str = "auto",
    error_layer: bool = False,
    models_layer: bool = False,
    compression: str = "keep",
    threads: int | None = None,
    max_memory: int | str | None = None,
    frames: str | Iterable[int] | None = None,
    temporal: bool | int = False,
    before: Path | Iterable[Path] = (),
    after: Path | Iterable[Path] = (),
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
        features: Features beside normal, albedo and depth that light may follow: layers or channels, ``["P", "roughness"]``, ``"P:X,Z"`` for some channels of a layer,
            ``"P=PVariance"`` where its variance has a name of its own; 1 to 3 channels each, 6 in all. ``"auto"``: those that the renderer is known to write.
        wrap: Whether windows wrap around the left and right ends, as in a panorama: ``"auto"``, ``"x"`` or ``"none"``.
        error_layer: Adds the channel ``linpred.error``, the estimated mean squared error of each pixel.
        models_layer: Adds ``linpred.radius`` and ``linpred.rank``, and with ``temporal`` ``linpred.frames``.
        compression: How what is denoised is stored: ``"keep"`` as in the input, but with zip where that would lose data of what is added or kept; ``"zip"``, ``"zips"``,
            ``"rle"``, ``"piz"``, ``"none"``; ``"dwaa"``, which loses data of every channel called R, G, B, RY, BY or Y.
        max_memory: Bytes that may be used, or ``"256M"``; 2 GiB by default. A job that needs more is refused before it begins.
        frames: Of a sequence, ``"1-100x2,205"`` or numbers; those whose files exist by default.
        temporal: Has the frames of a sequence help each other, so that they do not flicker: so many before and after each, 1 to 8, or True for 3.
        before: Of a single image, the frames before it that help: ``"shot.####.exr"``, by the number in the image's name, or their files, nearest first.
        after: The frames after it, likewise.
        skip_existing: Leaves frames alone whose output exists.
        band: ``"i/N"``: only the i-th of N bands of the image, for :func:`stitch`.
        progress: A function of (rows done, rows of all frames), called on this thread, or a ``tqdm`` bar. What it raises ends the run, which leaves
            nothing behind. Frames count as high as the one at work, and those that are skipped or fail as done.

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
        InputWarning: Something about the file is not as it should be; before anything is written. Made an error by a filter, it is the frame's failure. A frame that should
            help and turns out on the way to be damaged is warned of once the file is written without it.
    """
    read = reading(input, preset, map, features, spp, other_half, layers, wrap, max_memory)
    write = writing(output, error_layer, models_layer, band, compression)
    compute = computing(quality, coverage, formulas, threads)
    skip = flag("skip_existing", skip_existing)
    tell = as_function(progress)
    # what makes no sense for any frame is no fault of one
    _linpred.check(read, write, compute)
    far, sides = reach(temporal), (paths("before", before), paths("after", after))
    sequence = _linpred.frames(read, write["output"], _wanted(frames), far)
    _check_sides(far, sides, sequence is None)
    if sequence is None:
        if far is not None:
            read["neighbours"] = _linpred.beside(read, *sides, far)
        return _one(read, write, compute, None, skip, _Told(tell, 1))
    reports: list[FileReport] = []
    failures: dict[int, Exception] = {}
    told = _Told(tell, len(sequence))
    for number, path, half, out, beside in sequence:
        one, to = dict(read, path=path, other_half=half, neighbours=beside), dict(write, output=out)
        try:
            reports.append(_one(one, to, compute, number, skip, told))
        except (ValueError, OSError, MemoryError, InputWarning) as error:
            if error is told.raised:
                raise
            failures[number] = error
        told.next_frame()
    if failures:
        raise SequenceError(failures, reports)
    return reports


def _check_sides(far: int | None, sides: tuple[list[str], list[str]], alone: bool) -> None:
    """Refuses frames beside an image that nobody asks to help it, and help without any."""
    if far is None and any(sides):
        raise ValueError("before, after: they help only with temporal")
    if not alone and any(sides):
        raise ValueError("before, after: they are for a single image: the frames of a sequence find those beside them by their numbers")
    if alone and far is not None and not any(sides):
        raise ValueError("temporal: of a single image, before and after say which frames are beside it")


def _wanted(frames: object) -> str | list[int] | None:
    """The frames that are asked for, as the command line or as Rust takes them."""
    if frames is None or isinstance(frames, str):
        return frames
    if not isinstance(frames, Iterable):
        raise TypeError(f"frames: {frames!r} is neither a string such as '1-100x2,205' nor a list of numbers")
    numbers = [whole("frames", frame) for frame in frames]
    if any(number < 0 for number in numbers):
        raise ValueError(f"frames: {min(numbers)} is no frame number, which is 0 or more")
    return numbers


class _Told:
    """Tells how many rows of all frames are done, and keeps what the caller's function raises: it is no fault of the frame's."""

    def __init__(self, tell: Callable[[int, int], object] | None, frames: int) -> None:
        self._tell, self._frames = tell, frames
        self._index, self._rows, self._done = 0, 1, 0
        self.raised: BaseException | None = None

    def __call__(self, done: int, rows: int) -> None:
        if self._tell is None:
            return
        self._rows, self._done = rows, done
        try:
            self._tell(self._index * rows + done, self._frames * rows)
        except BaseException as error:
            self.raised = error
            raise

    def next_frame(self) -> None:
        """Goes on to the next frame; one that was skipped, or failed, counts as done."""
        if self._done < self._rows:
            self(self._rows, self._rows)
        self._index, self._done = self._index + 1, 0


def warn(text: str) -> None:
    """Warns the caller of the package of what is odd about a file."""
    python_warnings.warn(text, InputWarning, stacklevel=_depth())


def _depth() -> int:
    """How far up the first caller is that is not of this package."""
    depth, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__package__") == __package__:
        depth, frame = depth + 1, frame.f_back
    return depth


def _one(
    read: dict[str, Any],
    write: dict[str, Any],
    compute: dict[str, Any],
    frame: int | None,
    skip_existing: bool,
    told: _Told,
) -> FileReport:
    if skip_existing and os.path.isfile(write["output"]):
        return FileReport(read["path"], write["output"], frame, skipped=True)
    done = _linpred.denoise_file(read, write, compute, warn, told)
    return FileReport(
        read["path"],
        write["output"],
        frame,
        skipped=False,
        pictures=tuple(Report(**picture) for picture in done["pictures"]),
        notes=tuple(done["notes"]),
        warnings=tuple(done["warnings"]),
        clamped=done["clamped"],
        layers_off=done["layers_off"],
        help=tuple(Help(frames, tuple(before), tuple(after)) for frames, before, after in done["help"]),
        unused=tuple(done["unused"]),
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
    features: str | Iterable[str] = (),
    wrap: str = "auto",
    error_layer: bool = False,
    models_layer: bool = False,
    compression: str = "keep",
    threads: int | None = None,
    max_memory: int | str | None = None,
    temporal: bool | int = False,
    before: Path | Iterable[Path] = (),
    after: Path | Iterable[Path] = (),
    band: str | None = None,
) -> Plan:
    """How :func:`denoise_file` would denoise a file, or the first frame of a sequence, from its header alone: what ``--dry-run`` prints. Raises what it would raise before it begins."""
    read = reading(input, preset, map, features, spp, other_half, layers, wrap, max_memory)
    far, sides = reach(temporal), (paths("before", before), paths("after", after))
    frames = _linpred.frames(read, None, None, far)
    _check_sides(far, sides, frames is None)
    if frames is not None:
        _, read["path"], read["other_half"], _, read["neighbours"] = frames[0]
    elif far is not None:
        read["neighbours"] = _linpred.beside(read, *sides, far)
    compute = computing(quality, coverage, formulas, threads)
    return Plan(*_linpred.plan(read, writing("", error_layer, models_layer, band, compression), compute))


def inspect(
    path: Path,
    *,
    preset: str = "auto",
    map: Mapping[str, str] | None = None,
    spp: int | None = None,
    other_half: Path | None = None,
    layers: Iterable[str] = (),
    features: str | Iterable[str] = (),
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
    read = reading(path, preset, map, features, spp, other_half, layers, wrap, max_memory)
    found: dict[str, Any] = json.loads(_linpred.inspect(read, flag("pixels", pixels), whole_or_none("threads", threads)))
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
    figures = _linpred.compare(
        as_path("image", image),
        as_path("reference", reference),
        path_or_none("input", input),
        entries(map),
        path_or_none("heatmap", heatmap),
        path_or_none("picture", picture),
        whole_or_none("threads", threads),
        size("max_memory", max_memory),
    )
    found: dict[str, Any] = json.loads(figures)
    return found


def stitch(bands: Iterable[Path], output: Path) -> None:
    """Puts the bands of an image together, in any order, into ``output``: see ``band`` of :func:`denoise_file`."""
    _linpred.stitch(_paths("bands", bands), as_path("output", output))


def merge(
    passes: Iterable[Path],
    output: Path,
    *,
    preset: str = "auto",
    map: Mapping[str, str] | None = None,
    spp: int | None = None,
    max_memory: int | str | None = None,
    progress: Progress = None,
) -> None:
    """Puts the passes of an image, renders of it with samples of their own, into one file, as if all samples had been taken at once: what ``linpred merge`` does.

    Of every pixel ``output`` has the mean, the variance of all samples together, and how many there are (``sampleCount``, or the channel in which the passes state it).
    The order of the passes does not matter, and merged passes can be merged with more.

    Args:
        passes: The passes, EXR files of one size with the same channels. How many samples each of their pixels has, they state, or ``spp``.
        output: All of them in one. It appears whole or not at all.
        preset, map: As for :func:`denoise_file`, of every pass.
        spp: Samples per pixel of each of the passes, where they do not state them, or state them wrongly.
        max_memory: Bytes that may be used, or ``"256M"``; 2 GiB by default. What it takes grows with the number of passes.
        progress: A function of (rows done, of all), called on this thread, or a ``tqdm`` bar. What it raises ends the run, which leaves nothing behind.

    Raises:
        ValueError: The arguments make no sense, whatever the files hold; a file is given twice.
        InputError: The passes are damaged, not of one picture, or hold samples of each other (a ValueError, too).
        OSError: A file cannot be read or written.
        MemoryError: The job takes more memory than it may or can have.
        KeyboardInterrupt: Ctrl-C was pressed; no output is left half-written.

    Warns:
        InputWarning: Something about a pass is not as it should be; pixels that are not finite took no part.
    """
    paths = _paths("passes", passes)
    read = reading("", preset, map, (), spp, None, (), "auto", max_memory)
    _linpred.merge(paths, read, as_path("output", output), _warn_here, as_function(progress))


def _warn_here(text: str) -> None:
    python_warnings.warn(text, InputWarning, stacklevel=3)


def _paths(name: str, paths: object) -> list[str]:
    """Several paths, not one."""
    if isinstance(paths, (str, bytes, os.PathLike)):
        raise TypeError(f"{name}: {paths!r} is one path; they are a list of paths")
    if not isinstance(paths, Iterable):
        raise TypeError(f"{name}: {paths!r} is no list of paths")
    return [as_path(name, path) for path in paths]
