"""Frames in memory, and frames of which only some rows are."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generator, Iterable, Iterator, Mapping, Tuple, Union

import numpy as np

from linpred import _linpred
from linpred._options import MOST, computing, mapping, whole
from linpred._progress import Progress, as_function

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Feature = Union[ArrayLike, Tuple[ArrayLike, ArrayLike]]
    Name = Tuple[str, str]
    Plane = Tuple[str, str, NDArray[Any]]

FEATURES = {"normal": 3, "albedo": 3, "depth": 1}
"""The features that are known by their names, and their channels."""


@dataclass(frozen=True)
class Report:
    """What a run did, and what it could leave.

    Attributes:
        pixels: Pixels of the image.
        passed_through: Pixels without noise, which came out as they were.
        repaired: Pixels that were not finite, predicted from their neighbours.
        fireflies: Pixels far brighter than all around by no more than a sample, predicted likewise.
        estimated: Pixels of an image with variances that had none: theirs was estimated from the picture.
        cells: Cells of 19 x 19 pixels.
        cells_skipped: Of those, the ones without noise.
        feature_blocks: Blocks of features: a normal, an albedo, a depth or another one each.
        feature_blocks_skipped: Of those, the ones with no noise in reach.
        models: Models that were built.
        fitting_seconds: Time that threads spent on cells, added up over the threads.
    """

    pixels: int
    passed_through: int
    repaired: int
    fireflies: int
    estimated: int
    cells: int
    cells_skipped: int
    feature_blocks: int
    feature_blocks_skipped: int
    models: int
    fitting_seconds: float


@dataclass(frozen=True, eq=False)
class DenoisedRow:
    """A denoised row of a frame. All arrays are float32.

    Attributes:
        colour: Radiance, (width, 3). Always finite.
        error: Estimated mean squared error of each pixel, mean over the channels, radiance squared, (width,). Its square root is a standard error.
        radius: Half-width of the windows that predicted each pixel, weighted mean, 0 to 9 pixels, (width,).
        rank: Rank of the models behind each pixel, weighted mean, (width,).
        alpha: Alpha, 0 to 1, (width,); None if none was given.
        layers: The layers that were given, by name, (width, 3) each. If they summed up to the colour, they still do.
        scalars: The scalars that were given, by name, (width,) each.
    """

    colour: NDArray[np.float32]
    error: NDArray[np.float32]
    radius: NDArray[np.float32]
    rank: NDArray[np.float32]
    alpha: NDArray[np.float32] | None
    layers: dict[str, NDArray[np.float32]]
    scalars: dict[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Denoised(DenoisedRow):
    """A denoised frame. All arrays are float32.

    Attributes:
        colour: Radiance, (height, width, 3). Always finite.
        error: Estimated mean squared error of each pixel, mean over the channels, radiance squared, (height, width). Its square root is a standard error.
        radius: Half-width of the windows that predicted each pixel, weighted mean, 0 to 9 pixels, (height, width).
        rank: Rank of the models behind each pixel, weighted mean, (height, width).
        alpha: Alpha, 0 to 1, (height, width); None if none was given.
        layers: The layers that were given, by name, (height, width, 3) each. If they summed up to the colour, they still do.
        scalars: The scalars that were given, by name, (height, width) each.
        report: What the run did.
    """

    report: Report


def denoise(
    colour: ArrayLike,
    *,
    variance: ArrayLike | None = None,
    halves: tuple[ArrayLike, ArrayLike] | None = None,
    albedo: ArrayLike | None = None,
    normal: ArrayLike | None = None,
    depth: ArrayLike | None = None,
    albedo_variance: ArrayLike | None = None,
    normal_variance: ArrayLike | None = None,
    depth_variance: ArrayLike | None = None,
    features: Mapping[str, Feature] | None = None,
    alpha: ArrayLike | None = None,
    layers: Mapping[str, ArrayLike] | None = None,
    scalars: Mapping[str, ArrayLike] | None = None,
    quality: str = "balanced",
    coverage: int | None = None,
    formulas: str = "robust",
    threads: int | None = None,
    progress: Progress = None,
) -> Denoised:
    """Denoises a frame in memory.

    Arrays are float16, float32 or float64, of any strides and byte order. They are read where they lie, a row at a time; only what is not
    aligned, or of foreign byte order, is copied before. Do not write to them during the call: other threads run meanwhile. Masks of masked arrays are not looked at.

    Args:
        colour: Linear radiance, (height, width, 3). Pixels with a NaN, an infinity or more than 1e15 are repaired, and counted.
        variance: Variance of the pixels' means (of one sample, divided by the number of samples), (height, width, 3), radiance squared. 0 says
            that a pixel is exact: it comes out as it is. Where it is negative, NaN or infinite it is estimated from the picture; without it,
            everywhere.
        halves: The means of either half of each pixel's samples, two arrays like ``colour``, which must be their mean. In place of ``variance``.
        albedo: Diffuse albedo, (height, width, 3).
        normal: Normals of the surfaces, (height, width, 3), in any space.
        depth: Distance from the camera, (height, width) or (height, width, 1); infinite, 0 or 1e10 where there is nothing.
        albedo_variance: Variance of the means of ``albedo``, of its shape; estimated if it is not given. ``normal_variance`` and ``depth_variance`` likewise.
        features: Features by name, each an array or a pair (array, variance). What is not called ``albedo``, ``normal`` or ``depth`` is whatever else light may follow:
            positions in the world, roughness, second normals, what another denoiser made; of one to three channels each, (height, width) or (height, width, 1 to 3), six
            in all. Where it is not finite it is filled in from its neighbours; infinite, or 1e9 and more, is where there is nothing.
        alpha: Alpha, 0 to 1, (height, width); ``colour`` is premultiplied.
        layers: More layers of light by name, (height, width, 3) each, denoised with the models of ``colour``, so that they still sum up.
        scalars: Channels that are no light (depths, masks, motion) by name, (height, width) each, denoised likewise.
        quality: ``"fast"``, ``"balanced"`` or ``"high"``.
        coverage: The number behind ``quality``: how many good models must predict a pixel before no new one is built for it, 1 to 1024.
        formulas: ``"robust"``, or the papers' to the letter: ``"literal"`` (linear predictions), ``"wlr"`` (weighted local regression, slow).
        threads: Threads that compute, at most one on each processor, which is the default. The result does not depend on it.
        progress: A function of (rows done, rows of the frame), called on this thread, or a ``tqdm`` bar. What it raises ends the run.

    Raises:
        ValueError: An array has the wrong shape or there are no pixels; an option is out of range.
        TypeError: An array does not hold floats.
        MemoryError: There is no memory for the output.
        KeyboardInterrupt: Ctrl-C was pressed; the run has ended.

    The interpreter's lock is released meanwhile. Memory: that of the output, 6 floats per pixel and 3 per layer, beside some 90 rows.

    >>> import numpy as np
    >>> noisy = np.random.default_rng(1).uniform(0.0, 1.0, (48, 64, 3))
    >>> clean = denoise(noisy, variance=np.full(noisy.shape, 1 / 12))
    >>> clean.colour.shape, clean.report.pixels
    ((48, 64, 3), 3072)
    >>> bool(clean.colour.std() < 0.1 * noisy.std())
    True
    """
    given = dict(
        colour=colour,
        variance=variance,
        halves=halves,
        albedo=albedo,
        normal=normal,
        depth=depth,
        albedo_variance=albedo_variance,
        normal_variance=normal_variance,
        depth_variance=depth_variance,
        features=features,
        alpha=alpha,
        layers=layers,
        scalars=scalars,
    )
    planes = planes_of(given, 2)
    options = computing(quality, coverage, formulas, threads)
    arrays, report = _linpred.denoise(planes, options, as_function(progress))
    return Denoised(**_named(arrays, [plane[:2] for plane in planes]), report=Report(**report))


def denoise_rows(
    rows: Iterable[Mapping[str, Any]],
    height: int,
    *,
    quality: str = "balanced",
    coverage: int | None = None,
    formulas: str = "robust",
    threads: int | None = None,
) -> Rows:
    """Denoises a frame row by row, for frames larger than memory or still being rendered.

    Args:
        rows: Gives the rows from top to bottom, as mappings from the names of :func:`denoise`'s arrays to arrays without the first dimension:
            ``{"colour": (width, 3), "depth": (width,), "layers": {"diffuse": (width, 3)}}``. Or several rows at a time, with the first dimension:
            ``{"colour": (n, width, 3), ...}``. All have the arrays of the first. It is asked on the thread that iterates, no sooner than a row is wanted.
        height: Rows of the frame.
        quality, coverage, formulas, threads: As for :func:`denoise`.

    Returns:
        An iterator over the denoised rows, from top to bottom, some 90 rows behind; its ``report`` is what the run did, once it has ended. It can be closed, or used with ``with``, to end a run early. The bits are those of
        :func:`denoise`. Memory grows with the width of the frame alone.

    >>> import numpy as np
    >>> def render():
    ...     for y in range(40):
    ...         yield {"colour": np.random.default_rng(y).uniform(0.0, 1.0, (64, 3))}
    >>> rows = denoise_rows(render(), height=40)
    >>> np.stack([row.colour for row in rows]).shape
    (40, 64, 3)
    >>> rows.report.pixels
    2560
    """
    return Rows(rows, height, computing(quality, coverage, formulas, threads))


class Rows(Iterator[DenoisedRow]):
    """Denoised rows from top to bottom; see :func:`denoise_rows`. Dropped or closed before its end, the run is given up, and the source closed."""

    def __init__(self, rows: Iterable[Mapping[str, Any]], height: int, options: dict[str, Any]) -> None:
        height = whole("height", height)
        if not 1 <= height < MOST:
            raise ValueError(f"height {height}: it is 1 to {MOST - 1} rows")
        # written by the source, at its first row; with a reference to self it would keep itself, and the run, for ever
        self._names: list[Name] = []
        self._source = _single_rows(rows, self._names)
        self._rows: _linpred.Rows | None = _linpred.Rows(self._source, height, options)
        self._report: Report | None = None

    def __next__(self) -> DenoisedRow:
        if self._rows is None:
            raise StopIteration
        try:
            _, arrays = next(self._rows)
        except StopIteration:
            report = self._rows.report()
            self._report = None if report is None else Report(**report)
            self.close()
            raise
        except _linpred.Busy as error:
            # the run itself goes on
            raise RuntimeError(*error.args) from None
        except BaseException:
            self.close()
            raise
        named = _named(arrays, self._names)
        return DenoisedRow(
            colour=named["colour"][0],
            error=named["error"][0],
            radius=named["radius"][0],
            rank=named["rank"][0],
            alpha=None if named["alpha"] is None else named["alpha"][0],
            layers={name: layer[0] for name, layer in named["layers"].items()},
            scalars={name: scalar[0] for name, scalar in named["scalars"].items()},
        )

    def close(self) -> None:
        """Gives the run up, if it has not ended, and closes the source."""
        self._rows = None
        if inspect.getgeneratorstate(self._source) != inspect.GEN_RUNNING:
            self._source.close()

    def __enter__(self) -> Rows:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def report(self) -> Report | None:
        """What the run did; None before its end."""
        return self._report


def _single_rows(rows: Iterable[Mapping[str, Any]], names: list[Name]) -> Generator[list[Plane], None, None]:
    """The rows one by one, each with the arrays of the first in their order, whose names are written to ``names``."""
    y = 0
    for given in rows:
        row = _row(given)
        several = np.ndim(row["colour"]) > 2
        planes = {(role, name): array for role, name, array in planes_of(row, 2 if several else 1)}
        if not names:
            names.extend(planes)
        if set(names) != set(planes):
            raise ValueError(f"row {y} has other arrays than row 0")
        for own in range(planes[names[0]].shape[0]):
            yield [(role, name, planes[role, name][own : own + 1]) for role, name in names]
            y += 1


ARRAYS = {"colour", "variance", "halves", *FEATURES, *(f"{name}_variance" for name in FEATURES), "features", "alpha", "layers", "scalars"}
"""What the arguments of :func:`denoise` that hold arrays are called, and the entries of a row."""


def _row(given: object) -> dict[str, Any]:
    """A row as the arguments of :func:`denoise` that it stands for."""
    row = mapping("row", given)
    unknown = set(row) - ARRAYS
    if unknown:
        raise ValueError(f"row: {', '.join(sorted(map(repr, unknown)))} is none of {', '.join(sorted(ARRAYS))}")
    if "colour" not in row:
        raise ValueError("row: there is no colour")
    return {name: row.get(name) for name in ARRAYS}


def _features(given: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """The features that there are, in their own order, each with its variance or None, from either place where they may be given."""
    found = {name: (given[name], given[f"{name}_variance"]) for name in FEATURES}
    for name, feature in mapping("features", given["features"]).items():
        own, variance = found.get(name, (None, None))
        if own is not None:
            raise ValueError(f"{name} is given twice: as an argument and in features")
        if isinstance(feature, tuple):
            if len(feature) != 2:
                raise ValueError(f"features: {name!r} is a tuple of {len(feature)}: it is (array, variance), or an array")
            feature, variance = feature
        found[name] = feature, variance
    for name, (feature, variance) in found.items():
        if feature is None and variance is not None:
            raise ValueError(f"{name}_variance is given without {name}")
        if feature is None and name not in FEATURES:
            raise TypeError(f"features[{name!r}]: None is no array")
    return {name: pair for name, pair in found.items() if pair[0] is not None}


def planes_of(given: Mapping[str, Any], dimensions: int) -> list[Plane]:
    """The arrays that there are of :data:`ARRAYS`, as (role, name, array), each with rows, columns and channels."""
    if given["variance"] is not None and given["halves"] is not None:
        raise ValueError("variance and halves both say what the noise is: give one of them")
    features = _features(given)
    colour = _array("colour", given["colour"], 3, dimensions, None)
    size = colour.shape[:2]

    def plane(name: str, value: ArrayLike, channels: int | None) -> NDArray[Any]:
        return _array(name, value, channels, dimensions, size)

    planes: list[Plane] = [("colour", "", colour)]
    if given["variance"] is not None:
        planes.append(("variance", "", plane("variance", given["variance"], 3)))
    if given["halves"] is not None:
        if not isinstance(given["halves"], (tuple, list)) or len(given["halves"]) != 2:
            raise ValueError("halves: it is a pair of arrays, the means of either half of the samples")
        for role, half in zip(("half_a", "half_b"), given["halves"]):
            planes.append((role, "", plane("halves", half, 3)))
    for name, (feature, variance) in features.items():
        known = name in FEATURES
        role, own = (name, "") if known else ("feature", name)
        array = plane(name if known else f"features[{name!r}]", feature, FEATURES.get(name))
        planes.append((role, own, array))
        if variance is not None:
            label = f"{name}_variance" if known else f"variance of features[{name!r}]"
            planes.append((f"{role}_variance", own, plane(label, variance, array.shape[-1])))
    if given["alpha"] is not None:
        planes.append(("alpha", "", plane("alpha", given["alpha"], 1)))
    for name, layer in mapping("layers", given["layers"]).items():
        planes.append(("layer", name, plane(f"layers[{name!r}]", layer, 3)))
    for name, scalar in mapping("scalars", given["scalars"]).items():
        planes.append(("scalar", name, plane(f"scalars[{name!r}]", scalar, 1)))
    return planes


def samples_plane(samples: ArrayLike, size: tuple[int, ...]) -> Plane:
    """The samples of each pixel, or one number for all, of any type, as a plane."""
    array = np.asarray(samples)
    if array.dtype.kind not in "uif":
        raise TypeError(f"samples: dtype {array.dtype}, but they are numbers")
    array = array.astype(np.float32)
    if array.ndim == 0:
        array = np.broadcast_to(array, size)
    return "samples", "", _array("samples", array, 1, 2, size)


def _array(
    name: str, value: ArrayLike, channels: int | None, dimensions: int, size: tuple[int, ...] | None
) -> NDArray[Any]:
    """The value as an array of (rows, columns, channels), any number of them for None, that can be read where it lies; ``dimensions`` of rows and columns are given."""
    if value is None:
        raise TypeError(f"{name}: None is no array")
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    if array.dtype.kind != "f" or array.dtype.itemsize > 8:
        raise TypeError(f"{name}: dtype {array.dtype}, but it is float16, float32 or float64, as linear radiance is")
    sides = ("height", "width")[-dimensions:]
    shape = array.shape
    if channels in (1, None) and array.ndim == dimensions:
        array = array[..., np.newaxis]
    if channels is None and array.ndim == dimensions + 1:
        channels = array.shape[-1]
    if array.ndim != dimensions + 1 or array.shape[-1] != channels:
        wanted = ", ".join(sides if channels == 1 else (*sides, str(channels or "channels")))
        hint = "; alpha has an argument of its own" if name == "colour" and shape[-1:] == (4,) else ""
        raise ValueError(f"{name}: shape {shape}, but it is ({wanted}){hint}")
    if dimensions == 1:
        array = array[np.newaxis]
    if 0 in array.shape:
        raise ValueError(f"{name}: shape {shape} holds no pixel")
    if size is not None and array.shape[:2] != size:
        raise ValueError(f"{name}: shape {shape}, but the colour has {' x '.join(map(str, size[-dimensions:]))} pixels ({' x '.join(sides)})")
    array = np.require(array, array.dtype.newbyteorder("="), ["ALIGNED"])
    if any(stride % array.itemsize for stride in array.strides):
        # a field of a structured array: its pixels lie between others' bytes
        array = np.ascontiguousarray(array)
    return array


def _named(arrays: dict[str, Any], names: Iterable[Name]) -> dict[str, Any]:
    """The arrays with their layers and scalars by name."""
    of_role: dict[str, list[str]] = {"layer": [], "scalar": []}
    for role, name in names:
        of_role.setdefault(role, []).append(name)
    layers = dict(zip(of_role["layer"], arrays["layers"]))
    scalars = dict(zip(of_role["scalar"], arrays["scalars"]))
    return {**arrays, "layers": layers, "scalars": scalars}
