"""What WLR says of its own parts, tried with the recipe of `../sequences/wlr.py`: the whole method, and the method without a part or with another in its place."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numba
import numpy as np
import wlr
from frames import COLOUR, FEATURE_VARIANCES, FEATURES, VARIANCE, planes
from pictures import Noisy, Reference, middle

WHOLE = wlr.Window(radius=9, frames=0)
ALL_FEATURES = 9


def _with(**changed: object) -> wlr.Window:
    return replace(WHOLE, recipe=wlr.Recipe(**changed))


WAYS = {
    "whole: C = 2, h_q = 1": WHOLE,
    "C = 1": _with(truncation=1.0),
    "2 local features everywhere": _with(rank=2),
    "all local features": _with(rank=ALL_FEATURES),
    "h_q = 0.4": _with(curvatures=0.4),
    "h_q = 0.6": _with(curvatures=0.6),
    "h_q = 0.8": _with(curvatures=0.8),
    "one bandwidth for all features": _with(alike=True),
    "h b_j = 0.2 everywhere": _with(alike=True, shared=0.2),
    "h b_j = 1 everywhere": _with(alike=True, shared=1.0),
    "h = 1, a bandwidth for each feature": _with(shared=1.0),
    "even weights": _with(even=True),
    "outlier heuristic": replace(WHOLE, outliers=True),
    "31 x 31 pixels": replace(WHOLE, radius=15),
}
"""WLR section 4, Table I, section 5.2, Fig. 3, 5, 6, 7 and 15, in the words of the tables."""

COLUMNS = ("scene", "samples", "way", "rmse", "seconds", "rank")


def rows(noisy: Noisy, side: int) -> Iterator[tuple]:
    """A line for each way, of the side x side pixels in the middle of a picture."""
    volume = _volume(noisy, side)
    reference = Reference.read(noisy.reference).cut(side)
    yield noisy.scene, noisy.samples, "input", reference.error(volume.colour[0]), "", ""
    wlr.studied(_cut(volume, 8), WHOLE, 0)  # compiled before anything is timed
    for way, window in WAYS.items():
        began = time.process_time()
        picture, _, ranks = wlr.studied(volume, window, 0)
        seconds = time.process_time() - began
        yield noisy.scene, noisy.samples, way, reference.error(picture), round(seconds, 2), float(ranks.mean())


def _volume(noisy: Noisy, side: int) -> wlr.Volume:
    arrays = (middle(planes(noisy.path, names), side)[None] for names in (COLOUR, VARIANCE, FEATURES, FEATURE_VARIANCES))
    return wlr.Volume(*map(np.ascontiguousarray, arrays), samples=noisy.samples)


def _cut(volume: wlr.Volume, side: int) -> wlr.Volume:
    arrays = (array[:, :side, :side] for array in (volume.colour, volume.variance, volume.features, volume.feature_variance))
    return wlr.Volume(*map(np.ascontiguousarray, arrays), samples=volume.samples)


ESTIMATE_COLUMNS = ("scene", "samples", "estimate", "correlation", "rank correlation", "root mean square off", "mean over the true mean")


def estimates(scene: str, renders: list[wlr.Volume], reference: Reference) -> Iterator[tuple]:
    """WLR Fig. 6: estimates of the squared error at h = 1, from one render, beside what it is over many of them.

    The truth is the mean over the renders of the squared error against the reference, whose noise is taken off; the estimates are those of the first render.
    Figures are over pixels, mean of the channels; "off" is relative to the truth's root mean square.
    """
    each = [_errors(*(array[0] for array in (v.colour, v.variance, v.features, v.feature_variance)), float(v.samples), 9) for v in renders]
    truth = np.mean([((picture - reference.colour) ** 2 - reference.noise).mean(-1) for picture, _, _ in each], axis=0)
    _, curves, stein = each[0]
    for name, estimate in (("curves of bias and variance", curves), ("SURE", stein)):
        estimate = estimate.mean(-1)
        off = np.sqrt(np.mean((estimate - truth) ** 2) / np.mean(truth**2))
        ranks = [plane.ravel().argsort().argsort() for plane in (estimate, truth)]
        alike = [float(np.corrcoef(a.ravel(), b.ravel())[0, 1]) for a, b in ((estimate, truth), ranks)]
        yield scene, renders[0].samples, name, *alike, float(off), float(estimate.mean() / truth.mean())


@numba.njit(parallel=True, cache=True)
def _errors(colour, variance, features, feature_variance, samples, radius):
    """At h = 1: the picture, its MSE by the fitted curves (Eq. 12, 13) and by SURE, (height, width, 3) each."""
    height, width = colour.shape[:2]
    picture, curves, stein = np.empty((height, width, 3)), np.empty((height, width, 3)), np.empty((height, width, 3))
    for row in numba.prange(height):
        top, bottom = max(row - radius, 0), min(row + radius + 1, height)
        for column in range(width):
            left, right = max(column - radius, 0), min(column + radius + 1, width)
            shape = (1, bottom - top, right - left)
            n = shape[1] * shape[2]
            centre = (row - top) * shape[2] + column - left
            x = wlr._with_place(np.ascontiguousarray(features[top:bottom, left:right]).reshape(shape + (features.shape[2],)), shape)
            of_x = np.zeros(x.shape)
            of_x[:, 3:] = np.ascontiguousarray(feature_variance[top:bottom, left:right]).reshape(n, -1)
            design = wlr._design(wlr._local_features(x, of_x, centre, 2.0, 0))
            for c in range(3):
                y = np.ascontiguousarray(colour[top:bottom, left:right, c]).reshape(n)
                of_y = np.ascontiguousarray(variance[top:bottom, left:right, c]).reshape(n)
                found = _estimates(design, y, of_y, centre, samples)
                picture[row, column, c], curves[row, column, c], stein[row, column, c] = found
    return picture, curves, stein


@numba.njit(cache=True)
def _estimates(design, y, variance, centre, samples):
    """Value, MSE by the curves and SURE of a channel at h = 1."""
    even = np.ones(len(y))
    bandwidths = wlr._feature_bandwidths(design, y, even, 1.0)
    bias, noise = np.empty(len(wlr.TRIED)), np.empty(len(wlr.TRIED))
    value = 0.0
    for i, h in enumerate(wlr.TRIED):
        value, noise[i] = wlr._estimate(design, h * bandwidths, even, y, variance)
        bias[i] = value - y[centre]
    rank = len(bandwidths)
    # a mean, rank 0, has the same variance at every h
    spread = _line(1 / (samples * wlr.TRIED**rank), noise, 1 / samples) if rank else noise.mean()
    at_one = _line(wlr.TRIED**2, bias, 1.0) ** 2 + max(spread, 0.0)
    # the last of those tried is h = 1
    alone = np.zeros(len(y))
    alone[centre] = 1.0
    own_weight, _ = wlr._estimate(design, bandwidths, even, alone, variance)
    stein = (value - y[centre]) ** 2 - variance[centre] + 2 * own_weight * variance[centre]
    return value, at_one, stein


@numba.njit(cache=True)
def _line(at, values, where):
    """The straight line by ordinary least squares, there."""
    return values.mean() + wlr._slope(at, values) * (where - at.mean())
