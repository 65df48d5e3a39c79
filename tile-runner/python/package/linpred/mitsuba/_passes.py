"""A pass: so many samples of each pixel, their mean, and the variance of that mean.

Samples are traced in wavefronts of bounded size. A wavefront holds whole pixels, a pixel's samples lie side by side in it, and a second kernel with a lane
for each pixel adds them up in that order, in double precision and less the pixel's first sample: a pixel that never varies has a variance of exactly 0, and
no bit depends on threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable

import numpy as np

from linpred.mitsuba._scene import View

LANES = 1 << 19
"""Samples of a wavefront: enough to keep the processors busy, and some 100 MB of memory."""

WAVEFRONTS = 1 << 20
"""More than a pass has, so that no two wavefronts of a loop draw the same numbers."""

COLOUR, FEATURES = 3, 7
VALUES = COLOUR + FEATURES
"""Values of a sample: colour, albedo, shading normal, depth."""

LARGEST = float(np.finfo(np.float32).max)

MEANS = ("R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z", "Z")
VARIANCES = (*(f"variance.{c}" for c in "RGB"), *(f"albedoVariance.{c}" for c in "RGB"), *(f"NVariance.{c}" for c in "XYZ"), "ZVariance.Z")
SAMPLES = "sampleCount"


CHANNELS = (*MEANS, *VARIANCES, SAMPLES)
"""Of a pass file, in the order of :class:`Statistics`."""


@dataclass(frozen=True)
class Statistics:
    """What a pass found.

    Attributes:
        pixels: Shape (height, width, 21), float32: the means, their variances, the samples.
        left_out: Samples with a value that is not finite: in no mean, and not in the counts.
    """

    pixels: np.ndarray[Any, Any]
    left_out: int

    @property
    def means(self) -> np.ndarray[Any, Any]:
        """Shape (height, width, 10): colour, albedo, shading normal and depth; the features are 0 where rays hit nothing. 0 in pixels without a sample."""
        return self.pixels[..., :VALUES]

    @property
    def variances(self) -> np.ndarray[Any, Any]:
        """Shape (height, width, 10): of the means. NaN in pixels with fewer than two samples."""
        return self.pixels[..., VALUES : 2 * VALUES]

    @property
    def counts(self) -> np.ndarray[Any, Any]:
        """Shape (height, width): the samples that the means are of."""
        return self.pixels[..., -1]


def trace(view: View, counts: np.ndarray[Any, Any], seed: int, number: int, tell: Callable[[int, int], object] | None = None) -> Statistics:
    """Renders ``counts`` (height, width: whole numbers, 0 or more) samples of each pixel.

    ``seed`` and ``number``, which no other pass of the seed has, decide which: the same samples whenever they are asked for. ``tell`` learns of samples done
    and of all.
    """
    # a pixel's samples are of one wavefront
    wanted = np.minimum(counts.reshape(-1), LANES).astype(np.uint32)
    pixels = np.flatnonzero(wanted).astype(np.uint32)
    wanted = wanted[pixels]
    found = np.zeros((view.height * view.width, len(CHANNELS)), np.float32)
    found[:, VALUES : 2 * VALUES] = np.nan
    done, of_all = 0, int(wanted.sum(dtype=np.int64))
    for index, part in enumerate(_wavefronts(wanted)):
        first = _first_seed(seed, number * WAVEFRONTS + index)
        found[pixels[part]] = _wavefront(view, pixels[part], wanted[part], first)
        done += int(wanted[part].sum())
        if tell is not None:
            tell(done, of_all)
    left_out = of_all - int(found[:, -1].sum(dtype=np.float64))
    return Statistics(found.reshape(view.height, view.width, len(CHANNELS)), left_out)


def _wavefronts(wanted: np.ndarray[Any, Any]) -> list[slice]:
    """Runs of pixels whose samples fit into a wavefront."""
    ends = np.cumsum(wanted, dtype=np.int64)
    found, first = [], 0
    while first < len(wanted):
        before = int(ends[first - 1]) if first else 0
        last = int(np.searchsorted(ends, before + LANES, side="right"))
        found.append(slice(first, last))
        first = last
    return found


def _first_seed(seed: int, wavefront: int) -> int:
    """Wavefronts of one seed have successive numbers, from a place that the seed decides."""
    place = int(np.random.SeedSequence(seed).generate_state(1)[0])
    return int((place + wavefront) % 2**32)


def _wavefront(view: View, pixels: np.ndarray[Any, Any], wanted: np.ndarray[Any, Any], seed: int) -> np.ndarray[Any, Any]:
    """Means, their variances and the samples of each of these pixels: shape (pixels, 21)."""
    import drjit as dr

    mi = view.mi
    starts = np.cumsum(wanted, dtype=np.uint32) - wanted
    with dr.suspend_grad():
        values, kept = _samples(view, mi.UInt32(np.repeat(pixels, wanted)), seed)
        # what the kernel of the sums reads has to be in memory
        dr.eval(values, kept)
        first, sums, squares, count = _sums(mi, values, kept, mi.UInt32(starts), mi.UInt32(wanted))
        n = mi.Float64(count)
        means = [start + total / dr.maximum(n, 1) for start, total in zip(first, sums)]
        spread = [dr.maximum(square - total * total / dr.maximum(n, 1), 0) for square, total in zip(squares, sums)]
        # values of 10^38, whose square a float cannot hold, are finite all the same
        squared_error = [dr.minimum(s / (n * (n - 1)), LARGEST) for s in spread]
        variances = [dr.select(n > 1, one, float("nan")) for one in squared_error]
        dr.eval(means, variances, count)
    return np.stack([np.array(column, np.float32) for column in (*means, *variances, count)], axis=-1)


def _samples(view: View, pixel: Any, seed: int) -> tuple[list[Any], Any]:
    """One path through a random point of each lane's pixel: its values, and whether all of them are finite."""
    import drjit as dr

    mi, camera = view.mi, view.sensor
    lanes = dr.width(pixel)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(dr.opaque(mi.UInt32, seed), lanes)
    corner = mi.Vector2f(mi.Float(pixel % view.width), mi.Float(pixel // view.width))
    place = (corner + sampler.next_2d()) / mi.ScalarVector2f(view.width, view.height)
    lens = sampler.next_2d() if camera.needs_aperture_sample() else mi.Point2f(0.5)
    time = camera.shutter_open()
    if camera.shutter_open_time() > 0:
        time = time + sampler.next_1d() * camera.shutter_open_time()
    ray, weight = camera.sample_ray_differential(time, sampler.next_1d(), mi.Point2f(place), lens)
    colour, _, others = view.integrator.sample(view.scene, sampler, ray, camera.get_medium())
    colour = colour * weight
    found = [colour.x, colour.y, colour.z, *others]
    values = [found[channel] for channel in view.channels]
    kept = mi.Bool(True)
    for value in values:
        kept &= dr.isfinite(value)
    # an albedo above 1 says that a texture is wrong; it would make a feature of its own of that
    values[3:6] = [dr.clip(value, 0, 1) for value in values[3:6]]
    return values, kept & (dr.zeros(mi.UInt32, lanes) == 0)


def _sums(mi: Any, values: list[Any], kept: Any, starts: Any, wanted: Any) -> tuple[list[Any], list[Any], list[Any], Any]:
    """Of each pixel: its first sample that counts, sums and sums of squares of the differences to it, and how many samples count."""
    import drjit as dr

    Float64, UInt32 = mi.Float64, mi.UInt32
    pixels = dr.width(starts)

    def more(index: Any, *_: Any) -> Any:
        return index < wanted

    def add(index: Any, count: Any, first: list[Any], sums: list[Any], squares: list[Any]) -> tuple[Any, ...]:
        lane = starts + index
        counts = dr.gather(mi.Bool, kept, lane)
        sample = [Float64(dr.gather(mi.Float, value, lane)) for value in values]
        first = [dr.select(counts & (count == 0), now, before) for now, before in zip(sample, first)]
        off = [dr.select(counts, now - start, 0) for now, start in zip(sample, first)]
        sums = [total + d for total, d in zip(sums, off)]
        squares = [total + d * d for total, d in zip(squares, off)]
        return index + 1, count + dr.select(counts, UInt32(1), UInt32(0)), first, sums, squares

    zeros = [[dr.zeros(Float64, pixels) for _ in values] for _ in range(3)]
    state = (dr.zeros(UInt32, pixels), dr.zeros(UInt32, pixels), *zeros)
    _, count, first, sums, squares = dr.while_loop(state, more, add, label="linpred: sums of a pass")
    return first, sums, squares, count


def write(view: View, found: Statistics, path: str) -> None:
    """Writes a pass as an EXR file of floats: what ``linpred.merge`` reads."""
    mi = view.mi
    bitmap = mi.Bitmap(found.pixels, mi.Bitmap.PixelFormat.MultiChannel, list(CHANNELS))
    bitmap.write(path, mi.Bitmap.FileFormat.OpenEXR)


def counts(view: View, path: str) -> np.ndarray[Any, Any]:
    """How many samples of each pixel a map of ``linpred.sample_map_file`` asks for, shape (height, width)."""
    bitmap = view.mi.Bitmap(path)
    names = [field.name for field in bitmap.struct_()]
    pixels = np.array(bitmap).reshape(view.height, view.width, len(names))
    samples: np.ndarray[Any, Any] = np.rint(pixels[..., names.index("samples")]).astype(np.int64)
    return samples
