"""The arithmetic of the page on inputs whose answer is known: `python -m pytest tests/bench/papers`."""

import sys
from pathlib import Path

import numpy as np
import pytest

HERE = Path(__file__).resolve().parent
sys.path += [str(HERE), str(HERE.parent), *(str(HERE.parent / folder) for folder in ("sequences", "adaptive"))]

import convergence
import pictures
import regression
import sampling
import wlr
from camera import Camera

SIDE, SAMPLES = 4, 40


def series() -> np.ndarray:
    return np.random.default_rng(1).random((SIDE * SIDE, SAMPLES, 10)).astype(np.float32)


def camera(samples: int) -> Camera:
    camera = Camera(series(), SIDE, 3)
    camera.render(np.full((SIDE, SIDE), samples))
    return camera


def test_a_mean_of_medians_is_that_of_the_whole_chunks_that_were_rendered() -> None:
    found = sampling.chunk_medians(camera(27), series())
    grey = np.roll(series()[..., :3].mean(-1), -3, axis=1)
    expected = (np.median(grey[:, :10], axis=1) + np.median(grey[:, 10:20], axis=1)) / 2
    np.testing.assert_allclose(found.ravel(), expected, rtol=1e-6)


def test_one_huge_sample_hides_an_error_from_the_mean_and_not_from_the_medians() -> None:
    samples = series()
    samples[5, 3, :3] = 1000
    huge = Camera(samples, SIDE, 3)
    huge.render(np.full((SIDE, SIDE), 20))
    by_mean, by_medians = (sampling.relative_error(huge, samples, medians)[1, 1] for medians in (False, True))
    assert by_medians > 500 * by_mean


def test_a_demand_is_the_papers_relative_error() -> None:
    found = sampling.demand(np.array(0.3), np.array(2.0), np.array(2.0), np.array(8))
    assert found == pytest.approx(0.3 * 8 ** (-4 / 6) / 2.003)


def test_whole_samples_keep_their_sum() -> None:
    weight = np.random.default_rng(2).random((64, 64))
    assert sampling.rounded(weight, 5000, 1).sum() == pytest.approx(5000, rel=0.02)


def test_an_error_is_without_the_references_noise() -> None:
    colour, noise = np.full((2, 2, 3), 3.0), np.full((2, 2, 3), 0.04)
    reference = pictures.Reference(colour, noise)
    assert reference.error(colour + 0.2) == pytest.approx(0, abs=1e-12)
    assert reference.error(colour + 0.3) == pytest.approx(0.05 / 9.01)
    assert reference.own_error == pytest.approx(0.04 / 9.01)


def test_a_mean_of_independent_samples_has_a_slope_of_minus_one() -> None:
    assert convergence.slope([4, 16, 64], [1 / 4, 1 / 16, 1 / 64]) == pytest.approx(-1)


def test_an_estimate_at_h_1_is_steins_of_a_linear_smoother() -> None:
    random = np.random.default_rng(3)
    z, y, variance = random.random((60, 2)) - 0.5, random.random(60), 0.01 + random.random(60)
    z[7] = 0
    design = wlr._design(z)
    value, _, stein = regression._estimates(design, y, variance, 7, 8.0)
    moved = y.copy()
    moved[7] += 1e-6
    bandwidths = wlr._feature_bandwidths(design, y, np.ones(60), 1.0)
    there, _ = wlr._estimate(design, bandwidths, np.ones(60), moved, variance)
    slope = (there - value) / 1e-6
    assert stein == pytest.approx((value - y[7]) ** 2 - variance[7] + 2 * slope * variance[7], rel=1e-4)


def test_a_window_without_features_is_a_mean_with_the_variance_of_one() -> None:
    random = np.random.default_rng(4)
    y, variance = random.random(50), random.random(50)
    value, curves, _ = regression._estimates(np.ones((50, 1)), y, variance, 3, 8.0)
    assert value == pytest.approx(y.mean())
    assert curves == pytest.approx((y.mean() - y[3]) ** 2 + variance.sum() / 2500)
