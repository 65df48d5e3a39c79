"""Features beside normal, albedo and depth: arrays by name, and layers of files by theirs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import SAMPLE, noise, read, same, small, stacked, write

import linpred

HEIGHT, WIDTH = 48, 60


def picture() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A noisy colour, its variance, and the pattern that its light follows."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    pattern = np.where((x * x // 7 + y * y // 5) % 3 == 0, 0.9, 0.2).astype(np.float32)
    colour = pattern[..., np.newaxis] * (0.5 + noise(HEIGHT, WIDTH))
    variance = np.repeat(pattern[..., np.newaxis] ** 2 / 12, 3, axis=-1)
    return colour, variance, pattern


def error(clean: linpred.Denoised, pattern: np.ndarray) -> float:
    return float(np.mean((clean.colour - pattern[..., np.newaxis]) ** 2))


def test_light_that_follows_a_feature_is_predicted_from_it() -> None:
    colour, variance, pattern = picture()
    without = error(linpred.denoise(colour, variance=variance), pattern)
    for feature in (pattern, pattern[..., np.newaxis], np.stack([pattern, 0 * pattern], axis=-1), (pattern, 0 * pattern)):
        clean = linpred.denoise(colour, variance=variance, features={"hint": feature})
        # the pattern is hardly coarser than noise, and is taken for some of it where nothing tells otherwise
        part = 0.3 if isinstance(feature, tuple) else 0.5
        assert error(clean, pattern) < part * without


def test_arrays_get_the_bits_of_layers(tmp_path: Path) -> None:
    frame = small()
    del frame["alpha"]
    position, rough = noise(24, 30, 5), noise(24, 30, 6)[..., 0]
    spread = np.full((24, 30), 0.01, np.float32)
    channels = {"Z": frame["depth"], "rough": rough, "spread": spread}
    layers = {"": frame["colour"], "variance": frame["variance"], "albedo": frame["albedo"]}
    for layer, array in layers.items():
        channels.update({f"{layer}.{name}".lstrip("."): array[..., k] for k, name in enumerate("RGB")})
    for layer, array in {"N": frame["normal"], "P": position}.items():
        channels.update({f"{layer}.{name}": array[..., k] for k, name in enumerate("XYZ")})
    write(tmp_path / "noisy.exr", channels)
    linpred.denoise_file(tmp_path / "noisy.exr", tmp_path / "clean.exr", features=["P", "rough=spread"])
    clean = linpred.denoise(**frame, features={"position": position, "rough": (rough, spread)})
    assert same(clean.colour, stacked(read(tmp_path / "clean.exr"), "", "RGB"))
    rows = ({**{name: array[y] for name, array in frame.items()}, "features": {"position": position[y], "rough": (rough[y], spread[y])}} for y in range(24))
    by_rows = np.stack([row.colour for row in linpred.denoise_rows(rows, height=24)])
    assert same(clean.colour, by_rows)
    assert [role["channels"] for role in linpred.inspect(tmp_path / "noisy.exr", features="P:X,Z")["roles"] if role["role"] == "feature"] == [["P.X", "P.Z"]]


@pytest.mark.parametrize(
    ("features", "words"),
    [
        ({"a": np.zeros((24, 30, 4))}, "a: a feature of 4 channels: one has 1 to 3"),
        ({"a": np.zeros((24, 30, 3)), "b": np.zeros((24, 30, 3)), "c": np.zeros((24, 30))}, "c: further features of 7 channels: there is room for 6"),
        ({"a": np.zeros((24, 31))}, r"features\['a'\]: shape \(24, 31\), but the colour has 24 x 30 pixels"),
        ({"a": np.zeros(24)}, r"features\['a'\]: shape \(24,\), but it is \(height, width, channels\)"),
        ({"a": (np.zeros((24, 30, 3)), np.zeros((24, 30)))}, r"variance of features\['a'\]: shape \(24, 30\), but it is \(height, width, 3\)"),
    ],
)
def test_what_is_no_feature_is_refused_in_a_sentence(features: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        linpred.denoise(**small(), features=features)


def test_no_array_is_no_feature() -> None:
    with pytest.raises(TypeError, match=r"features\['a'\]: None is no array"):
        linpred.denoise(**small(), features={"a": None})


def test_a_layer_that_is_not_there_is_told_of(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="feature nothing: .* has no such layer or channel"):
        linpred.denoise_file(SAMPLE, tmp_path / "clean.exr", features=["nothing"])
