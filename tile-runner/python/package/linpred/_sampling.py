"""Maps of the samples that a renderer should take next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Iterable, Mapping

import numpy as np

from linpred import _linpred
from linpred._files import warn
from linpred._frames import samples_plane, planes_of
from linpred._options import Path, computing, number_or_none, reading
from linpred._options import path as as_path
from linpred._progress import Progress, as_function

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from linpred._frames import Feature


@dataclass(frozen=True)
class SampleReport:
    """What a map gives, and what for.

    An error is relative here: the estimated squared error of a denoised pixel over the mean square of its colour and 0.003.

    Attributes:
        pixels: Pixels of the image.
        samples: Samples that each has, on average.
        added: Samples that the map gives each, on average.
        most: The most that one of them gets.
        error: The predicted error of the denoised image now, mean over the pixels.
        error_then: The same once the map is rendered.
        reached: Whether the error was as small as the target already; the map is all 0 then.
    """

    pixels: int
    samples: float
    added: float
    most: int
    error: float
    error_then: float
    reached: bool


@dataclass(frozen=True, eq=False)
class SampleMap:
    """How many samples more each pixel should get.

    Attributes:
        samples: Whole numbers, uint32, (height, width).
        report: What they are for.
    """

    samples: NDArray[np.uint32]
    report: SampleReport


def sample_map(
    colour: ArrayLike,
    *,
    samples: ArrayLike,
    budget: float | None = None,
    target_error: float | None = None,
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
    quality: str = "fast",
    coverage: int | None = None,
    formulas: str = "robust",
    threads: int | None = None,
    progress: Progress = None,
) -> SampleMap:
    """Says how many samples more each pixel of a frame should get, by the error that denoising leaves in it.

    Args:
        colour: Linear radiance, (height, width, 3).
        samples: How many samples each pixel has, (height, width), or one number for all.
        budget: How many more a pixel should get, on average. The map sums up to it exactly.
        target_error: As few as it takes until the predicted error of the denoised image is so small (see :class:`SampleReport`); with ``budget``, no more than that.
        variance, halves, albedo, normal, depth, albedo_variance, normal_variance, depth_variance, features, alpha: As for :func:`linpred.denoise`. With a variance, or halves, the map
            is better: the frame is looked at twice.
        quality: How the frame is denoised to see where it is wrong; a better one takes longer and finds no better map.
        coverage, formulas, threads: As for :func:`linpred.denoise`.
        progress: A function of (rows done, rows in all: the frame's, or with a variance twice as many), or a ``tqdm`` bar. What it raises ends the run.

    Raises:
        ValueError: As for :func:`linpred.denoise`; or there is neither a budget nor a target, or it is out of range.

    >>> import numpy as np
    >>> noise = np.full((32, 48, 3), 0.1)
    >>> noise[:, :24] = 0.0
    >>> map = sample_map(np.full((32, 48, 3), 0.5), variance=noise, samples=4, budget=8)
    >>> int(map.samples.sum()) == 8 * 32 * 48, int(map.samples[16, 0])
    (True, 0)
    """
    given: dict[str, Any] = dict(
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
        layers=None,
        scalars=None,
    )
    planes = planes_of(given, 2)
    planes.append(samples_plane(samples, planes[0][2].shape[:2]))
    options = computing(quality, coverage, formulas, threads)
    array, report = _linpred.sample_map(planes, _wanted(budget, target_error), options, as_function(progress))
    return SampleMap(array, SampleReport(**report))


def sample_map_file(
    noisy: Path,
    output: Path,
    *,
    budget: float | None = None,
    target_error: float | None = None,
    quality: str = "fast",
    coverage: int | None = None,
    formulas: str = "robust",
    preset: str = "auto",
    map: Mapping[str, str] | None = None,
    spp: int | None = None,
    other_half: Path | None = None,
    features: str | Iterable[str] = (),
    wrap: str = "auto",
    threads: int | None = None,
    max_memory: int | str | None = None,
    progress: Progress = None,
) -> SampleReport:
    """Makes the map of an EXR file, with the bits of the command ``linpred sample-map``: an EXR file whose channel ``samples`` says how many more each pixel should get.

    Args:
        noisy: The noisy file. It says how many samples its pixels have, by a channel or an attribute, or ``spp`` does.
        output: The map. It appears whole or not at all.
        budget, target_error: As for :func:`sample_map`.
        quality, coverage, formulas: How the file is denoised to see where it is wrong.
        preset, map, spp, other_half, features, wrap, threads, max_memory: As for :func:`linpred.denoise_file`.
        progress: A function of (rows done, rows in all: the image's, or with a variance twice as many), or a ``tqdm`` bar.

    Raises and warns as :func:`linpred.denoise_file`.
    """
    no_layers: Iterable[str] = ()
    read = reading(noisy, preset, map, features, spp, other_half, no_layers, wrap, max_memory)
    compute = computing(quality, coverage, formulas, threads)
    to = as_path("output", output)
    report = _linpred.sample_map_file(read, to, _wanted(budget, target_error), compute, warn, as_function(progress))
    return SampleReport(**report)


def _wanted(budget: object, target_error: object) -> tuple[float | None, float | None]:
    return number_or_none("budget", budget), number_or_none("target_error", target_error)
