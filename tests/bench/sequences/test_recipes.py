"""The recipes are what their formulas say, on inputs whose answer is known: `python -m pytest tests/bench/sequences`."""

from __future__ import annotations

import lpr
import naive
import numpy as np
import pytest
import wlr

SHAPE = (6, 9)


def random(*shape: int) -> np.ndarray:
    return np.random.default_rng(1).random(shape)


def grid() -> np.ndarray:
    """A position of its own for each pixel."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.stack([x, y, np.zeros(SHAPE)], -1).astype(float)


def test_a_line_is_the_least_squares_of_its_frames_weighted_by_their_age() -> None:
    colours = list(random(7, *SHAPE, 3))
    found = lpr.filtered(colours, [grid()] * 7, lpr.Search(radius=0, product=True))
    for last in range(7):
        times = np.arange(1.0, last + 2)
        z = np.stack([np.ones_like(times), times], -1)
        weights = lpr.FORGETTING ** (times[-1] - times)
        # the start (y_1, 0) fades as an observation before the first frame would
        prior = lpr.DELTA * lpr.FORGETTING ** times[-1]
        matrix = np.einsum("t,ti,tj->ij", weights, z, z) + prior * np.eye(2)
        moments = np.einsum("t,ti,thwc->ihwc", weights, z, np.stack(colours[: last + 1]))
        moments[0] += prior * colours[0]
        beta = np.linalg.solve(matrix, moments.reshape(2, -1)).reshape(moments.shape)
        np.testing.assert_allclose(found[last], np.einsum("i,ihwc->hwc", z[-1], beta), rtol=1e-9)


@pytest.mark.parametrize("product", [True, False])
def test_a_line_follows_the_surface_that_moves(product: bool) -> None:
    colour = random(*SHAPE, 3)
    moved = [(np.roll(colour, 2 * frame, axis=1), np.roll(10 * grid(), 2 * frame, axis=1)) for frame in range(3)]
    colours, positions = zip(*moved)
    found = lpr.filtered(list(colours), list(positions), lpr.Search(radius=2, product=product))
    inside = slice(4, None)
    np.testing.assert_allclose(found[2][:, inside], colours[2][:, inside], rtol=1e-9)
    still = lpr.filtered(list(colours), list(positions), lpr.Search(radius=1, product=product))
    assert np.abs(still[2][:, inside] - colours[2][:, inside]).max() > 0.1


def volume(colour: np.ndarray, features: np.ndarray) -> wlr.Volume:
    return wlr.Volume(colour, np.full(colour.shape, 0.01), features, np.zeros(features.shape), samples=8)


@pytest.mark.parametrize("window", [wlr.Window(4, 0), wlr.Window(2, 1), wlr.Window(2, 1, outliers=True)])
def test_regression_keeps_what_is_linear_in_the_features(window: wlr.Window) -> None:
    features = random(3, *SHAPE, 4)
    colour = 0.3 + features @ np.random.default_rng(2).random((4, 3))
    picture, variance = wlr.filtered(volume(colour, features), window, 1)
    np.testing.assert_allclose(picture, colour[1], atol=1e-4)
    assert 0 < variance.min() and variance.mean() < 0.01


def test_regression_smooths_what_no_feature_tells() -> None:
    noisy = random(3, *SHAPE, 3)
    picture, variance = wlr.filtered(volume(noisy, np.zeros((3, *SHAPE, 1))), wlr.Window(4, 1), 1)
    assert picture.std() < 0.8 * noisy[1].std()
    assert variance.mean() < 0.005


def test_an_estimate_is_the_weighted_least_squares_at_the_centre() -> None:
    z, y, variance, bandwidths = random(40, 3) - 0.5, random(40), random(40), np.array([0.6, 0.9, 2.0])
    value, noise = wlr._estimate(wlr._design(z), bandwidths, np.ones(40), y, variance)
    weights = np.prod(0.75 * np.maximum(1 - (z / bandwidths) ** 2, 0), axis=1)
    design = np.concatenate([np.ones((40, 1)), z], axis=1)
    equivalent = np.linalg.solve(design.T * weights @ design, design.T * weights)[0]
    assert value == pytest.approx(equivalent @ y, rel=1e-4)
    assert noise == pytest.approx(equivalent**2 @ variance, rel=1e-4)


def test_a_shared_bandwidth_is_where_the_curves_meet_at_least_error() -> None:
    rank, samples, curvature, fall = 2, 8.0, 0.7, 0.9
    bias, noise = curvature * wlr.TRIED**2, fall / (samples * wlr.TRIED**rank)
    h = np.linspace(0.2, 1, 100_001)
    error = (curvature * h**2) ** 2 + fall / (samples * h**rank)
    assert wlr._shared_bandwidth(bias, noise, rank, samples) == pytest.approx(h[error.argmin()], abs=1e-4)


def test_a_mean_follows_the_motion_and_ends_at_the_border() -> None:
    image = random(*SHAPE, 2)
    frames = [np.roll(image, 2 * frame, axis=1) for frame in range(5)]
    motion = np.zeros((*SHAPE, 2))
    motion[..., 0] = -2
    mean = naive.mean_of_frames(frames, [motion] * 5, 4)
    np.testing.assert_allclose(mean[:, 6:], frames[4][:, 6:], rtol=1e-12)
    np.testing.assert_allclose(mean[:, :2], frames[4][:, :2], rtol=1e-12)


def test_the_variance_of_a_mean_is_that_of_its_weights() -> None:
    motion = np.zeros((*SHAPE, 2))
    motion[..., 0] = 0.25
    noise = naive.mean_of_noise([np.ones((*SHAPE, 1))] * 2, [motion] * 2, 1)
    np.testing.assert_allclose(noise[:, :-1], (1 + 0.75**2 + 0.25**2) / 4, rtol=1e-12)
    np.testing.assert_allclose(noise[:, -1], 1, rtol=1e-12)


def test_regression_without_its_parts_is_what_remains_of_it() -> None:
    colour, features = random(1, *SHAPE, 3), random(1, *SHAPE, 4)
    found = {}
    for name, recipe in (("even", wlr.Recipe(even=True, rank=20)), ("two", wlr.Recipe(rank=2)), ("wide", wlr.Recipe(alike=True, shared=1e5, rank=20))):
        found[name] = wlr.studied(volume(colour, features), wlr.Window(9, 0, recipe=recipe), 0)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    design = np.stack([np.ones(SHAPE), y, x, *np.moveaxis(features[0], -1, 0)], -1).reshape(-1, 7)
    least_squares = design @ np.linalg.lstsq(design, colour[0].reshape(-1, 3), rcond=None)[0]
    np.testing.assert_allclose(found["even"][0].reshape(-1, 3), least_squares, atol=1e-3)
    np.testing.assert_allclose(found["wide"][0], found["even"][0], atol=1e-6)
    assert set(found["two"][2].ravel()) == {2} and set(found["even"][2].ravel()) == {6}
