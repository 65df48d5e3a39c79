"""What the tests share: the sample as arrays, and frames of noise."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import linpred

REPOSITORY = Path(__file__).resolve().parents[3]
SAMPLE = REPOSITORY / "tests" / "data" / "toasters_16spp.exr"
REFERENCE = REPOSITORY / "tests" / "data" / "toasters_ref.exr"


def pytest_report_header() -> str:
    """Says which package is tested: the installed one."""
    return f"linpred {linpred.__version__} from {Path(linpred.__file__).parent}, Python {sys.version.split()[0]}, NumPy {np.__version__}"


def read(path: Path | str) -> dict[str, np.ndarray]:
    """Every channel of a file of one part."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.array(channel.pixels) for name, channel in file.channels().items()}


def write(path: Path | str, channels: dict[str, np.ndarray]) -> None:
    """A file of one part."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {name: np.ascontiguousarray(pixels) for name, pixels in channels.items()}) as file:
        file.write(str(path))


def stacked(channels: dict[str, np.ndarray], layer: str, names: str) -> np.ndarray:
    """A layer as one array; the channels of the nameless one have no prefix."""
    prefix = f"{layer}." if layer else ""
    return np.stack([channels[prefix + name].astype(np.float32) for name in names], axis=-1)


@pytest.fixture(scope="session")
def sample() -> dict[str, np.ndarray]:
    """The sample's arrays, by the names of ``linpred.denoise``'s arguments."""
    channels = read(SAMPLE)
    return {
        "colour": stacked(channels, "", "RGB"),
        "variance": stacked(channels, "variance", "RGB"),
        "albedo": stacked(channels, "albedo", "RGB"),
        "albedo_variance": stacked(channels, "albedoVariance", "RGB"),
        "normal": stacked(channels, "N", "XYZ"),
        "normal_variance": stacked(channels, "NVariance", "XYZ"),
        "depth": channels["Z"].astype(np.float32),
        "depth_variance": channels["ZVariance.Z"].astype(np.float32),
    }


def noise(height: int, width: int, seed: int = 1) -> np.ndarray:
    """Uniform noise from 0 to 1, whose variance is 1/12, rounded as a half is, so that every type of floats holds it."""
    random = np.random.default_rng(seed).uniform(0.0, 1.0, (height, width, 3))
    return random.astype(np.float16).astype(np.float32)


def small(height: int = 24, width: int = 30) -> dict[str, np.ndarray]:
    """The arrays of a small frame, one of each."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    slope = np.stack([x / width, y / height, 0.5 + 0 * x], axis=-1).astype(np.float16).astype(np.float32)
    return {
        "colour": noise(height, width),
        "variance": np.full((height, width, 3), 1 / 16, np.float32),
        "albedo": slope,
        "normal": slope[..., ::-1].copy(),
        "depth": slope[..., 0].copy(),
        "alpha": slope[..., 1].copy(),
    }


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two arrays hold the same bits."""
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
