"""Textures with detail at every scale, made of numbers alone: (side, side, 3) or (side, side, 1) float32, linear, 0 to 1."""

from __future__ import annotations

import numpy as np

SIDE = 1024


def _grid() -> tuple[np.ndarray, np.ndarray]:
    """x and y of the texels' centres, 0 to 1."""
    along = (np.arange(SIDE) + 0.5) / SIDE
    return np.meshgrid(along, along)


def clouds(seed: int, coarsest: int = 4, octaves: int = 7, falls: float = 0.6) -> np.ndarray:
    """Sum of smooth noise at doubling frequencies, (SIDE, SIDE), scaled to 0 to 1; repeats without a seam."""
    random, total = np.random.default_rng(seed), np.zeros((SIDE, SIDE))
    for octave in range(octaves):
        cells = coarsest << octave
        corners = random.random((cells, cells))
        at = (np.arange(SIDE) + 0.5) / SIDE * cells
        low, part = at.astype(int) % cells, at % 1
        part = part * part * (3 - 2 * part)
        high = (low + 1) % cells
        rows = corners[low] * (1 - part)[:, None] + corners[high] * part[:, None]
        total += falls**octave * (rows[:, low] * (1 - part) + rows[:, high] * part)
    return (total - total.min()) / np.ptp(total)


def _three(grey: np.ndarray, dark: tuple[float, ...], bright: tuple[float, ...]) -> np.ndarray:
    return (np.array(dark) + (np.array(bright) - np.array(dark)) * grey[..., None]).astype(np.float32)


def parquet(seed: int, boards: int = 12) -> np.ndarray:
    """Boards of different browns with grain, laid in a basket weave."""
    x, y = _grid()
    column, row = (x * boards).astype(int), (y * boards).astype(int)
    upright = (column + row) % 2 == 0
    across = np.where(upright, x, y) * boards * 4
    board = across.astype(int) + 1000 * np.where(upright, row, column) + 100_000 * upright
    random = np.random.default_rng(seed)
    tone = random.random(board.max() + 1)[board]
    grain = clouds(seed + 1, coarsest=32, octaves=5)
    seam = np.abs(across % 1 - 0.5) < 0.47
    return _three((0.25 + 0.45 * tone + 0.3 * grain) * seam, (0.05, 0.025, 0.012), (0.55, 0.34, 0.18))


def wear(seed: int) -> np.ndarray:
    """Roughness of a floor that is polished in most places and worn where people walk, (SIDE, SIDE, 1): 0.06 to 0.4."""
    worn = np.clip(4 * (clouds(seed, coarsest=3, octaves=4) - 0.5), 0, 1)
    return (0.06 + 0.34 * worn[..., None]).astype(np.float32)


def mosaic(seed: int, stones: int = 40) -> np.ndarray:
    """Stones of all colours, one around a random point in each square of a grid, with joints."""
    random = np.random.default_rng(seed)
    offset, colour = random.random((2, stones, stones)), random.random((stones, stones, 3)) ** 1.5
    x, y = _grid()
    column, row = (x * stones).astype(int), (y * stones).astype(int)
    nearest, second, found = np.full(x.shape, 9.0), np.full(x.shape, 9.0), np.zeros((SIDE, SIDE, 3))
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            i, j = (row + down) % stones, (column + right) % stones
            away = np.hypot(x * stones - column - right - offset[0, i, j], y * stones - row - down - offset[1, i, j])
            closer = away < nearest
            second = np.where(closer, nearest, np.minimum(second, away))
            nearest = np.where(closer, away, nearest)
            found[closer] = colour[i, j][closer]
    return np.where((second - nearest > 0.08)[..., None], 0.05 + 0.85 * found, 0.6).astype(np.float32)


def julia(constant: complex) -> np.ndarray:
    """How soon z^2 + c leaves a circle, in colours."""
    x, y = _grid()
    z, steps = 3 * (x - 0.5) + 3j * (y - 0.5), np.zeros((SIDE, SIDE))
    for _ in range(60):
        inside = np.abs(z) < 4
        steps += inside
        z = np.where(inside, z * z + constant, z)
    phase = 0.35 * steps[..., None] + np.array([0, 1.2, 2.6])
    return (0.45 + 0.4 * np.cos(phase)).astype(np.float32)


def wallpaper(seed: int, repeats: int = 10) -> np.ndarray:
    """Rosettes in two colours on a cloudy ground."""
    x, y = _grid()
    u, v = (x * repeats) % 1 - 0.5, (y * repeats) % 1 - 0.5
    leaf = np.hypot(u, v) - 0.28 - 0.12 * np.cos(8 * np.arctan2(v, u))
    ground = _three(clouds(seed), (0.42, 0.46, 0.38), (0.66, 0.66, 0.58))
    ground[leaf < 0] = (0.16, 0.27, 0.33)
    ground[np.abs(leaf) < 0.035] = (0.75, 0.6, 0.25)
    return ground


def checker(squares: int, one: tuple[float, ...], other: tuple[float, ...]) -> np.ndarray:
    """Squares of two colours."""
    x, y = _grid()
    return _three(((x * squares).astype(int) + (y * squares).astype(int)) % 2, one, other)
