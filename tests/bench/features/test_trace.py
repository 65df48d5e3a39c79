"""The path tracer tells what it says it tells, on scenes whose answer is known: `python -m pytest tests/bench/features`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import renders
import scenes
import trace
from renders import mi

SIDE = 16
FLOOR, TINT = 0.37, 0.8


def means(scene: dict[str, Any], samples: int = 16) -> dict[str, np.ndarray]:
    """Each layer's samples, (pixels, samples, channels)."""
    found = trace.trace(mi.load_dict(scene), 1, samples, scenes.DEPTH)
    layers: dict[str, list[np.ndarray]] = {}
    for index, name in enumerate(trace.CHANNELS):
        layers.setdefault(name.partition(".")[0], []).append(found[..., index])
    return {name: np.stack(planes, -1) for name, planes in layers.items()}


def looking_down(**more: Any) -> dict[str, Any]:
    """A camera above a floor, or what is put between, under a lamp that is larger than the view."""
    return {
        "type": "scene",
        "camera": scenes._camera(SIDE, (0, 2, 0.01), (0, 0, 0), 20),
        "floor": scenes._rectangle((0, 0, 0), (0, 1, 0), 2, 2, bsdf=scenes._diffuse(scenes._rgb(*[FLOOR] * 3))),
        "lamp": scenes._lamp((0, 5, 0), (0, -1, 0), 1, 1, (1, 1, 1)),
        **more,
    }


def leaning_mirror() -> dict[str, Any]:
    """Turns the view by a right angle, towards a wall."""
    return {
        "mirror": scenes._rectangle((0, 1, 0), (1, 1, 0), 1, 1.4, bsdf=scenes._mirror(TINT)),
        "wall": scenes._rectangle((3, 1, 0), (-1, 0, 0), 4, 4, bsdf=scenes._diffuse(scenes._rgb(*[FLOOR] * 3))),
    }


@pytest.mark.parametrize("name", list(scenes.SCENES))
def test_colour_is_that_of_mitsubas_own_path_tracer(name: str) -> None:
    scene, samples = mi.load_dict(scenes.SCENES[name](SIDE)), 1024
    own = trace.trace(scene, 1, samples, scenes.DEPTH, caustics=True)[..., :3].mean(-1, dtype=np.float64)
    path = mi.load_dict({"type": "path", "max_depth": scenes.DEPTH, "rr_depth": 100})
    theirs = np.stack([np.array(mi.render(scene, integrator=path, spp=samples // 8, seed=seed)).mean(-1) for seed in range(8)])
    # both have the same noise; the mean over half the picture each
    error = np.sqrt(2 * own.var(1).reshape(2, -1).sum(1) / samples)
    unlike = own.mean(1).reshape(2, -1).sum(1) - theirs.mean(0).reshape(2, -1).sum(1)
    assert (np.abs(unlike) < 4 * error).all()
    assert (error < 0.015 * own.mean(1).reshape(2, -1).sum(1)).all()


def test_without_caustics_there_is_less_light_and_less_noise() -> None:
    scene = mi.load_dict(scenes.gallery(SIDE))
    without, with_them = (trace.trace(scene, 1, 256, scenes.DEPTH, caustics)[..., :3] for caustics in (False, True))
    assert 0.95 * with_them.mean() < without.mean() < with_them.mean()
    assert without.var(1).mean() < with_them.var(1).mean()


def test_a_mirror_shows_the_features_of_what_it_reflects() -> None:
    found = means(looking_down(**leaning_mirror()))
    np.testing.assert_allclose(found["reflAlbedo"], TINT * FLOOR, rtol=1e-5)
    np.testing.assert_allclose(found["reflN"], np.broadcast_to([-1.0, 0, 0], found["reflN"].shape), atol=1e-5)
    np.testing.assert_allclose(found["N"], np.broadcast_to([0.5**0.5, 0.5**0.5, 0], found["N"].shape), atol=1e-5)
    assert (found["roughness"] == 0).all()


def test_a_diffuse_surface_has_its_own_features() -> None:
    found = means(looking_down())
    np.testing.assert_allclose(found["albedo"], FLOOR, rtol=1e-5)
    np.testing.assert_allclose(found["reflAlbedo"], found["albedo"], rtol=1e-5)
    np.testing.assert_allclose(found["reflN"], found["N"], atol=1e-6)
    np.testing.assert_allclose(found["P"][..., 1], 0, atol=1e-5)
    # rays begin at the near plane, a hundredth before the camera
    np.testing.assert_allclose(np.linalg.norm(found["P"] - [0, 2, 0.01], axis=-1) - found["Z"][..., 0], 0.01, rtol=0.05)
    assert (found["roughness"] == 1).all()


def test_shadow_is_the_share_of_the_light_that_is_seen() -> None:
    assert (means(looking_down())["shadow"] == 1).all()
    # hides half of the lamp from the middle of the floor, and nothing of the floor from the camera
    half = scenes._rectangle((-0.5, 2.5, 0), (0, -1, 0), 1, 3, bsdf=scenes._diffuse(scenes._rgb(0, 0, 0)))
    seen = means(looking_down(blind=half), samples=256)["shadow"].mean(1).reshape(SIDE, SIDE)
    middle = seen[:, SIDE // 2 - 1 : SIDE // 2 + 1].mean()
    assert 0.45 < middle < 0.55
    assert abs(seen[:, 0].mean() - seen[:, -1].mean()) > 0.2


def test_sums_are_the_mean_and_the_variance_of_the_mean() -> None:
    samples = np.random.default_rng(1).random((5, 12, 2)).astype(np.float32)
    sums = renders.Sums(samples[:, 0])
    for first in range(0, 12, 4):
        sums.add(samples[:, first : first + 4])
    np.testing.assert_allclose(sums.means, samples.mean(1, dtype=np.float64), rtol=1e-12)
    np.testing.assert_allclose(sums.variances, samples.var(1, ddof=1, dtype=np.float64) / 12, rtol=1e-9)
