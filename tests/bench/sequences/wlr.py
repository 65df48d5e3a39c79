"""Weighted local regression (WLR), each channel for itself, over windows of a frame or of several: the whole of the paper but its sampling.

Within a function: n pixels of the window, `z` (n, rank) their local features less those of the centre, `design` (n, 1 + 2 rank) the rows 1, z, z^2 of which
a linear fit takes the first 1 + rank, `y` (n) a channel. What the paper leaves open is chosen here and said in the README.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numba
import numpy as np

TRIED = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
"""Shared bandwidths of section 7."""
RIDGE = 1e-6
"""Of the sum of weights, on slopes and curvatures: a kernel may hold fewer pixels than there are unknowns."""
FLATTEST = 1e-6
"""The least second derivative that a bandwidth is taken from."""
LEAST_VARIANCE = 1e-3
"""Share of the window's mean variance that no pixel is thought to be below, where weights are divided by variances."""
EVEN = 1e6
"""A bandwidth that tells no pixels apart."""
ROUNDING = 1e-12
"""Squared singular values below this share of the largest are none."""


@dataclass(frozen=True)
class Recipe:
    """The paper's own choices, which its figures compare with others.

    `truncation`: C of section 4. `rank`: so many local features everywhere, instead of those above the noise (Fig. 3); 0: those. `curvatures`: h_q of Eq. 9
    (Table I). `alike`: one bandwidth for all features (b_j = 1). `shared`: this h everywhere, instead of the optimum (Fig. 5, 6); 0: the optimum. `even`: all
    pixels weigh the same (Fig. 7).
    """

    truncation: float = 2.0
    rank: int = 0
    curvatures: float = 1.0
    alike: bool = False
    shared: float = 0.0
    even: bool = False


@dataclass(frozen=True)
class Window:
    """(2 radius + 1)^2 pixels of the frames up to `frames` before and after; what is outside is left out.

    `outliers`: weights are divided by the pixels' variances, the heuristic of section 8.
    """

    radius: int
    frames: int
    outliers: bool = False
    recipe: Recipe = Recipe()


@dataclass(frozen=True)
class Volume:
    """All frames: `colour` and `variance` (frames, height, width, 3), `features` and `feature_variance` (frames, height, width, any)."""

    colour: np.ndarray
    variance: np.ndarray
    features: np.ndarray
    feature_variance: np.ndarray
    samples: int


def filtered(volume: Volume, window: Window, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """A frame's picture and the variance of it (Eq. 11), (height, width, 3) each."""
    picture, noise, _ = studied(volume, window, frame)
    return picture, noise


def studied(volume: Volume, window: Window, frame: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same, and how many local features each pixel's window has, (height, width)."""
    arrays = (volume.colour, volume.variance, volume.features, volume.feature_variance)
    return _frame(*arrays, float(volume.samples), frame, window.radius, window.frames, window.outliers, astuple(window.recipe))


@numba.njit(parallel=True, cache=True)
def _frame(colour, variance, features, feature_variance, samples, frame, radius, around, outliers, recipe):
    """Algorithm 1 at each pixel, for each channel."""
    frames, height, width = colour.shape[:3]
    picture, noise, ranks = np.empty((height, width, 3)), np.empty((height, width, 3)), np.empty((height, width))
    first, last = max(frame - around, 0), min(frame + around + 1, frames)
    for row in numba.prange(height):
        top, bottom = max(row - radius, 0), min(row + radius + 1, height)
        for column in range(width):
            left, right = max(column - radius, 0), min(column + radius + 1, width)
            shape = (last - first, bottom - top, right - left)
            n = shape[0] * shape[1] * shape[2]
            centre = ((frame - first) * shape[1] + row - top) * shape[2] + column - left
            x = _with_place(features[first:last, top:bottom, left:right], shape)
            of_x = np.zeros(x.shape)
            of_x[:, 3:] = np.ascontiguousarray(feature_variance[first:last, top:bottom, left:right]).reshape(n, -1)
            z = _local_features(x, of_x, centre, recipe[0], recipe[1])
            design, ranks[row, column] = _design(z), z.shape[1]
            y = np.ascontiguousarray(colour[first:last, top:bottom, left:right]).reshape(n, 3)
            of_y = np.ascontiguousarray(variance[first:last, top:bottom, left:right]).reshape(n, 3)
            for c in range(3):
                of_channel = of_y[:, c].copy()
                guard = _against_outliers(of_channel) if outliers else np.ones(n)
                found = _regression(design, y[:, c].copy(), of_channel, guard, centre, samples, recipe)
                picture[row, column, c], noise[row, column, c] = found
    return picture, noise, ranks


@numba.njit(cache=True)
def _with_place(features, shape):
    """Frame number, row and column before the features, (n, 3 + features)."""
    x = np.empty((shape[0] * shape[1] * shape[2], 3 + features.shape[3]))
    i = 0
    for t in range(shape[0]):
        for row in range(shape[1]):
            for column in range(shape[2]):
                x[i, 0], x[i, 1], x[i, 2] = t, row, column
                x[i, 3:] = features[t, row, column]
                i += 1
    return x


@numba.njit(cache=True)
def _local_features(x, variance, centre, truncation, rank):
    """Sections 7 and 4: features mapped to [-1, 1], and of their singular directions those above C ||E||_2 (Eq. 5), or the `rank` first; z = V_k^T (x - x_c)."""
    of_all = x.shape[1]
    deviation, moved = np.sqrt(variance), np.empty(x.shape)
    for j in range(of_all):
        low, high = x[:, j].min(), x[:, j].max()
        scale = 2 / (high - low) if high > low else 0.0
        x[:, j] = (x[:, j] - low) * scale - 1
        deviation[:, j] *= scale
        moved[:, j] = x[:, j] - x[:, j].mean()
    # squared singular values of Z and of E, ascending
    squared, directions = np.linalg.eigh(moved.T @ moved)
    noise = np.linalg.eigvalsh(deviation.T @ deviation)[-1]
    least = ROUNDING * squared[-1] if rank else max(truncation**2 * noise, ROUNDING * squared[-1])
    kept = (squared > least).sum()
    if rank:
        kept = min(kept, rank)
    return (x - x[centre]) @ np.ascontiguousarray(directions[:, of_all - kept :])


@numba.njit(cache=True)
def _design(z):
    """Rows 1, z, z^2 (Eq. 4, Eq. 9)."""
    n, rank = z.shape
    design = np.ones((n, 1 + 2 * rank))
    design[:, 1 : 1 + rank] = z
    design[:, 1 + rank :] = z**2
    return design


@numba.njit(cache=True)
def _against_outliers(variance):
    """Section 8: weights are divided by the variance of the sample mean."""
    return 1 / (variance + LEAST_VARIANCE * variance.mean() + 1e-12)


@numba.njit(cache=True)
def _regression(design, y, variance, guard, centre, samples, recipe):
    """Algorithm 1 for a channel: the picture at the centre and its variance."""
    curvatures, alike, shared, even = recipe[2:]
    rank = (design.shape[1] - 1) // 2
    if even:
        # so wide that no pixel weighs less than another
        return _estimate(design, np.full(rank, EVEN), guard, y, variance)
    bandwidths = np.ones(rank) if alike else _feature_bandwidths(design, y, guard, curvatures)
    if shared:
        return _estimate(design, shared * bandwidths, guard, y, variance)
    bias, noise = np.empty(len(TRIED)), np.empty(len(TRIED))
    for i, h in enumerate(TRIED):
        value, noise[i] = _estimate(design, h * bandwidths, guard, y, variance)
        # Eq. 10
        bias[i] = value - y[centre]
    return _estimate(design, _shared_bandwidth(bias, noise, len(bandwidths), samples) * bandwidths, guard, y, variance)


@numba.njit(cache=True)
def _feature_bandwidths(design, y, guard, h):
    """b_j = |d^2 f / dz_j^2|^(-1/2), from a quadratic fit without cross terms, h_q = `h` (Eq. 9)."""
    size = design.shape[1]
    rank = (size - 1) // 2
    weights = _weights(design, np.full(rank, h), guard)
    fitted = np.linalg.solve(_normal_matrix(design, weights, size), (weights * y) @ design)
    return 1 / np.sqrt(np.maximum(np.abs(2 * fitted[1 + rank :]), FLATTEST))


@numba.njit(cache=True)
def _estimate(design, bandwidths, guard, y, variance):
    """The linear fit's value at the centre, the sum of l_i y_i, and its variance, that of l_i^2 var(y_i) (Eq. 6, Eq. 11)."""
    size = 1 + len(bandwidths)
    weights = _weights(design, bandwidths, guard)
    first = np.zeros(size)
    first[0] = 1
    row = np.linalg.solve(_normal_matrix(design, weights, size), first)
    value, noise = 0.0, 0.0
    for i in range(len(weights)):
        if weights[i] > 0:
            equivalent = 0.0
            for a in range(size):
                equivalent += row[a] * design[i, a]
            equivalent *= weights[i]
            value += equivalent * y[i]
            noise += equivalent**2 * variance[i]
    return value, noise


@numba.njit(cache=True)
def _shared_bandwidth(bias, noise, rank, samples):
    """Where the curves' MSE is least: bias = a0 + a1 h^2 (Eq. 12), variance = c0 + c1 / (n h^k) (Eq. 13), h = (k c1 / (4 a1^2 n))^(1 / (k + 4))."""
    if rank == 0:
        return TRIED[-1]
    curvature = _slope(TRIED**2, bias)
    fall = _slope(1 / (samples * TRIED**rank), noise)
    if fall <= 0:
        return TRIED[0]
    # not by division, which a bias that stays the same would not survive
    wide, narrow = (rank * fall) ** (1 / (rank + 4)), (4 * curvature**2 * samples) ** (1 / (rank + 4))
    return min(max(wide / max(narrow, 1e-30), TRIED[0]), TRIED[-1])


@numba.njit(cache=True)
def _slope(at, values):
    """Of the straight line by ordinary least squares."""
    off = at - at.mean()
    return (off * values).sum() / (off**2).sum()


@numba.njit(cache=True)
def _weights(design, bandwidths, guard):
    """Product over the features of Epanechnikov's 3/4 (1 - t^2) for |t| < 1, times `guard`."""
    inverse = 1 / bandwidths**2
    weights = guard * 0.75 ** len(bandwidths)
    for i in range(len(weights)):
        for j in range(len(bandwidths)):
            weights[i] *= max(1 - design[i, 1 + j] ** 2 * inverse[j], 0.0)
    return weights


@numba.njit(cache=True)
def _normal_matrix(design, weights, size):
    """X^T W X of Eq. 4, of the first columns."""
    matrix = np.zeros((size, size))
    for i in range(len(weights)):
        if weights[i] > 0:
            for a in range(size):
                weighted = weights[i] * design[i, a]
                for b in range(a + 1):
                    matrix[a, b] += weighted * design[i, b]
    for a in range(1, size):
        matrix[:a, a] = matrix[a, :a]
        matrix[a, a] += RIDGE * matrix[0, 0]
    return matrix
