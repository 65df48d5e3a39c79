"""A renderer whose samples are there already: so many more of each pixel, as statistics or as the file that linpred reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR

MEANS = ("R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z", "Z")
VARIANCES = (*(f"variance.{c}" for c in "RGB"), *(f"albedoVariance.{c}" for c in "RGB"), *(f"NVariance.{c}" for c in "XYZ"), "ZVariance.Z")


class Camera:
    """Samples of each pixel, added up as they come: the first n of its series, which begins at `offset` and is a ring.

    `series` has shape (pixels, samples, 10): colour, albedo, normal, depth; `side` is the picture's.
    """

    def __init__(self, series: np.ndarray, side: int, offset: int) -> None:
        self.side, self.offset = side, offset
        pixels, self.most = series.shape[:2]
        self._series = series.reshape(-1, 10)
        self._counts = np.zeros(pixels, np.int64)
        self._first = series[:, offset].astype(np.float64)
        self._sums, self._squares = np.zeros((pixels, 10)), np.zeros((pixels, 10))

    def render(self, counts: np.ndarray) -> None:
        """So many more samples of each pixel (side, side); no pixel gets more than its series has."""
        more = np.minimum(counts.ravel(), self.most - self._counts)
        for index in range(int(more.max(initial=0))):
            pixel = np.flatnonzero(more > index)
            sample = (self.offset + self._counts[pixel] + index) % self.most
            # less the first, so that a pixel that never varies has a variance of 0
            off = self._series[pixel * self.most + sample] - self._first[pixel]
            self._sums[pixel] += off
            self._squares[pixel] += off**2
        self._counts += more

    @property
    def counts(self) -> np.ndarray:
        """Samples of each pixel, (side, side)."""
        return self._counts.reshape(self.side, self.side)

    @property
    def means(self) -> np.ndarray:
        """(side, side, 10): colour, albedo, normal, depth."""
        return (self._first + self._sums / np.maximum(self._counts, 1)[:, None]).reshape(self.side, self.side, 10)

    @property
    def variances(self) -> np.ndarray:
        """Of the means; NaN in pixels with fewer than two samples."""
        n = self._counts[:, None].astype(np.float64)
        spread = np.maximum(self._squares - self._sums**2 / np.maximum(n, 1), 0)
        return np.where(n > 1, spread / np.maximum(n * (n - 1), 1), np.nan).reshape(self.side, self.side, 10)

    def arrays(self) -> dict[str, np.ndarray]:
        """The arguments of `linpred.denoise`."""
        means, variances = self.means.astype(np.float32), self.variances.astype(np.float32)
        found: dict[str, np.ndarray] = dict(colour=means[..., :3], variance=variances[..., :3])
        for name, channels in (("albedo", slice(3, 6)), ("normal", slice(6, 9)), ("depth", 9)):
            found[name], found[f"{name}_variance"] = means[..., channels], variances[..., channels]
        return found

    def write(self, path: Path) -> None:
        """The file that `linpred.merge` would make of the passes."""
        planes = [*np.moveaxis(self.means, -1, 0), *np.moveaxis(self.variances, -1, 0), self.counts]
        channels = {name: np.ascontiguousarray(plane, np.float32) for name, plane in zip((*MEANS, *VARIANCES, "sampleCount"), planes)}
        with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels) as file:
            file.write(str(path))


def read_map(path: Path) -> np.ndarray:
    """How many more samples of each pixel a map asks for."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return np.rint(file.channels()["samples"].pixels).astype(np.int64)
