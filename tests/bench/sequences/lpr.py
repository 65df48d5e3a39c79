"""The temporal filter of LPR section 6: a line in time for each pixel, by recursive least squares on denoised frames.

What the paper leaves open is chosen here and said in the README: the size of the search window, and which of two pixels alike is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

FORGETTING, DELTA = 0.98, 0.001
"""lambda and delta of the paper."""
LEAST = 1e-30
"""Of each factor of the search: otherwise a pixel with the same position and another colour would be as good as the same pixel."""


@dataclass(frozen=True)
class Search:
    """Squares of `2 radius + 1` pixels; the two distances are multiplied or added."""

    radius: int
    product: bool


@dataclass
class Lines:
    """A model of each pixel: `beta` (height, width, 2, 3) by channel, `p` (height, width, 2, 2) for all channels."""

    beta: np.ndarray
    p: np.ndarray

    @classmethod
    def initial(cls, colour: np.ndarray) -> Lines:
        """beta(0) = (y, 0), P(0) = I / delta, as section 7 has it for pixels."""
        height, width = colour.shape[:2]
        beta = np.zeros((height, width, 2, 3))
        beta[:, :, 0] = colour
        return cls(beta, np.broadcast_to(np.eye(2) / DELTA, (height, width, 2, 2)).copy())


def filtered(colours: list[np.ndarray], positions: list[np.ndarray], search: Search) -> list[np.ndarray]:
    """beta(t)^T z of each pixel of each frame, t = 1, 2, ..."""
    lines, found = Lines.initial(colours[0]), []
    for index, (colour, position) in enumerate(zip(colours, positions)):
        if index:
            origin = _origins(colour, position, positions[index - 1], lines.beta, index + 1.0, search.radius, search.product)
            lines = Lines(lines.beta[origin[..., 0], origin[..., 1]], lines.p[origin[..., 0], origin[..., 1]])
        found.append(_updated(colour, lines, index + 1.0))
    return found


@numba.njit(parallel=True, cache=True)
def _origins(colour, position, old_position, beta, time, radius, product):
    """The pixel of the frame before whose model each pixel continues, (height, width, 2).

    Section 6: the largest 1 / (||W_o(t-1) - W_i(t)||^2 x ||y_i(t) - beta_o(t-1)^T z_i(t)||^2); of pixels alike, the nearest.
    """
    height, width = colour.shape[:2]
    found = np.empty((height, width, 2), np.int64)
    for y in numba.prange(height):
        for x in range(width):
            best, nearest = np.inf, 0
            for row in range(max(y - radius, 0), min(y + radius + 1, height)):
                for column in range(max(x - radius, 0), min(x + radius + 1, width)):
                    place, error = LEAST, LEAST
                    for c in range(3):
                        place += (old_position[row, column, c] - position[y, x, c]) ** 2
                        error += (colour[y, x, c] - beta[row, column, 0, c] - beta[row, column, 1, c] * time) ** 2
                    distance = place * error if product else place + error
                    off = (row - y) ** 2 + (column - x) ** 2
                    if distance < best or (distance == best and off < nearest):
                        best, nearest = distance, off
                        found[y, x, 0], found[y, x, 1] = row, column
    return found


def _updated(colour: np.ndarray, lines: Lines, time: float) -> np.ndarray:
    """Eq. 6 with z = (1, t); what the lines say of this frame."""
    z = np.array([1.0, time])
    pz = lines.p @ z
    gain = pz / (FORGETTING + pz @ z)[..., None]
    lines.p = (lines.p - gain[..., :, None] * pz[..., None, :]) / FORGETTING
    innovation = colour - np.einsum("hwic,i->hwc", lines.beta, z)
    lines.beta = lines.beta + gain[..., :, None] * innovation[..., None, :]
    return np.einsum("hwic,i->hwc", lines.beta, z)
