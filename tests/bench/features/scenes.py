"""Glossy scenes as Mitsuba dictionaries: only rectangles, boxes and spheres, with textures of `textures.py`. Metres; y is up."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mitsuba as mi
import numpy as np
import textures

Dictionary = dict[str, Any]
DEPTH = 7
"""Most segments of a path, the one from the camera to what it sees and the one to the light included."""


def _image(texels: np.ndarray, repeats: float = 1) -> Dictionary:
    return {"type": "bitmap", "data": mi.TensorXf(texels), "raw": True, "to_uv": mi.ScalarTransform4f().scale([repeats, repeats, 1])}


def _rgb(*colour: float) -> Dictionary:
    return {"type": "rgb", "value": list(colour)}


def _diffuse(colour: Dictionary) -> Dictionary:
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": colour}}


def _glossy(colour: Dictionary, roughness: Dictionary | float, metallic: float = 0) -> Dictionary:
    return {"type": "principled", "base_color": colour, "roughness": roughness, "metallic": metallic, "specular": 0.7}


def _mirror(reflectance: float) -> Dictionary:
    return {"type": "conductor", "material": "none", "specular_reflectance": _rgb(*[reflectance] * 3)}


def _rectangle(centre: tuple[float, ...], towards: tuple[float, ...], width: float, height: float, **more: Any) -> Dictionary:
    """Its normal is `towards`; its width is horizontal, unless it lies."""
    up = [0, 0, -1] if abs(towards[1]) > 0.9 else [0, 1, 0]
    target = [c + t for c, t in zip(centre, towards, strict=True)]
    placed = mi.ScalarTransform4f().look_at(list(centre), target, up).scale([width / 2, height / 2, 1])
    return {"type": "rectangle", "to_world": placed, **more}


def _ball(centre: tuple[float, ...], radius: float, bsdf: Dictionary) -> Dictionary:
    return {"type": "sphere", "center": list(centre), "radius": radius, "bsdf": bsdf}


def _box(centre: tuple[float, ...], half: tuple[float, ...], turned: float, bsdf: Dictionary) -> Dictionary:
    placed = mi.ScalarTransform4f().translate(list(centre)).rotate([0, 1, 0], turned).scale(list(half))
    return {"type": "cube", "to_world": placed, "bsdf": bsdf}


def _lamp(centre: tuple[float, ...], towards: tuple[float, ...], width: float, height: float, light: tuple[float, ...]) -> Dictionary:
    return _rectangle(centre, towards, width, height, emitter={"type": "area", "radiance": _rgb(*light)})


def _camera(side: int, origin: tuple[float, ...], target: tuple[float, ...], degrees: float) -> Dictionary:
    film = {"type": "hdrfilm", "width": side, "height": side, "rfilter": {"type": "box"}, "pixel_format": "rgb", "sample_border": False}
    return {"type": "perspective", "fov": degrees, "to_world": mi.ScalarTransform4f().look_at(list(origin), list(target), [0, 1, 0]), "film": film}


def gallery(side: int) -> Dictionary:
    """A room with a polished floor that is worn in places, a large mirror, a wall of brushed metal, and pictures to be reflected in them."""
    paper, plain = _image(textures.wallpaper(1)), _diffuse(_rgb(0.7, 0.68, 0.64))
    pictures = {
        "mosaic": _diffuse(_image(textures.mosaic(2))),
        "julia": _diffuse(_image(textures.julia(-0.79 + 0.15j))),
        "checker": _diffuse(_image(textures.checker(14, (0.06, 0.06, 0.08), (0.85, 0.8, 0.7)))),
        "stones": _diffuse(_image(textures.mosaic(3, stones=18))),
    }
    return {
        "type": "scene",
        "camera": _camera(side, (-0.5, 1.55, 1.9), (0.2, 0.95, -3), 66),
        "floor": _rectangle((0, 0, 0), (0, 1, 0), 6, 8, bsdf=_glossy(_image(textures.parquet(4)), _image(textures.wear(5)))),
        "ceiling": _rectangle((0, 3, 0), (0, -1, 0), 6, 8, bsdf=plain),
        "back": _rectangle((0, 1.5, -4), (0, 0, 1), 6, 3, bsdf=_diffuse(paper)),
        "left": _rectangle((-3, 1.5, 0), (1, 0, 0), 8, 3, bsdf=_diffuse(paper)),
        "right": _rectangle((3, 1.5, 0), (-1, 0, 0), 8, 3, bsdf=_glossy(_rgb(0.85, 0.82, 0.78), 0.22, metallic=1)),
        "front": _rectangle((0, 1.5, 4), (0, 0, -1), 6, 3, bsdf=_diffuse(paper)),
        "looking glass": _rectangle((0.3, 1.45, -3.97), (0, 0, 1), 3.6, 2.3, bsdf=_mirror(0.93)),
        "left 1": _rectangle((-2.96, 1.6, -2.4), (1, 0, 0), 1.9, 1.5, bsdf=pictures["mosaic"]),
        "left 2": _rectangle((-2.96, 1.6, 0.2), (1, 0, 0), 1.9, 1.5, bsdf=pictures["julia"]),
        "front 1": _rectangle((-1.6, 1.6, 3.96), (0, 0, -1), 2, 1.7, bsdf=pictures["stones"]),
        "front 2": _rectangle((1.3, 1.6, 3.96), (0, 0, -1), 2.4, 1.7, bsdf=pictures["checker"]),
        "ball 1": _ball((-1.3, 0.5, -1.6), 0.5, _mirror(0.9)),
        "ball 2": _ball((1.75, 0.55, -2.0), 0.55, _glossy(_rgb(0.95, 0.72, 0.4), 0.18, metallic=1)),
        "ball 3": _ball((0.35, 0.3, -0.5), 0.3, _glossy(_rgb(0.55, 0.05, 0.06), 0.08)),
        "block 1": _box((0.5, 0.35, -2.5), (0.35, 0.35, 0.35), 25, _diffuse(_image(textures.checker(6, (0.1, 0.25, 0.5), (0.8, 0.8, 0.75))))),
        "block 2": _box((-2.1, 0.6, -3.1), (0.3, 0.6, 0.3), -15, pictures["stones"]),
        "block 3": _box((1.7, 0.25, 0.1), (0.25, 0.25, 0.25), 40, _glossy(_image(textures.mosaic(6, stones=9)), 0.12)),
        "lamp 1": _lamp((-1, 2.98, -1.5), (0, -1, 0), 2.2, 1.2, (4.6, 4.2, 3.6)),
        "lamp 2": _lamp((1.2, 2.98, 1.8), (0, -1, 0), 2.2, 1.2, (4.2, 4.3, 4.6)),
        "lamp 3": _lamp((2.3, 2.1, -3.3), (-0.6, -0.6, 0.53), 0.7, 0.7, (7, 5, 3)),
    }


def tray(side: int) -> Dictionary:
    """Balls and blocks on a tray of brushed metal and a lacquered table, in a tent of pictures."""
    mosaic, stones = _diffuse(_image(textures.mosaic(12), 2)), _diffuse(_image(textures.mosaic(13, stones=14)))
    return {
        "type": "scene",
        "camera": _camera(side, (0.0, 1.5, 3.1), (0, 0.35, 0), 46),
        "table": _rectangle((0, 0, 0), (0, 1, 0), 9, 9, bsdf=_glossy(_image(textures.parquet(14, boards=16)), 0.1)),
        "tray": _box((0, 0.03, 0.1), (1.15, 0.03, 0.8), 0, _glossy(_rgb(0.8, 0.8, 0.82), 0.2, metallic=1)),
        "behind": _rectangle((0, 2, -3), (0, 0, 1), 9, 4, bsdf=mosaic),
        "left": _rectangle((-3.5, 2, 0), (1, 0, 0), 9, 4, bsdf=stones),
        "right": _rectangle((3.5, 2, 0), (-1, 0, 0), 9, 4, bsdf=_diffuse(_image(textures.julia(-0.4 + 0.6j)))),
        "before": _rectangle((0, 2, 4), (0, 0, -1), 9, 4, bsdf=_diffuse(_image(textures.checker(16, (0.08, 0.1, 0.3), (0.85, 0.8, 0.7))))),
        "ball 1": _ball((-0.65, 0.41, -0.15), 0.35, _mirror(0.92)),
        "ball 2": _ball((0.12, 0.36, 0.0), 0.3, _glossy(_rgb(0.95, 0.64, 0.54), 0.15, metallic=1)),
        "ball 3": _ball((0.75, 0.31, 0.1), 0.25, _glossy(_rgb(0.05, 0.2, 0.08), 0.05)),
        "ball 4": _ball((-0.2, 0.21, 0.6), 0.15, _glossy(_image(textures.mosaic(15, stones=8)), 0.3)),
        "block": _box((0.55, 0.18, -0.45), (0.18, 0.12, 0.18), 30, _diffuse(_image(textures.checker(4, (0.7, 0.2, 0.1), (0.9, 0.85, 0.7))))),
        "lamp 1": _lamp((-1.6, 3.6, 1.2), (0.4, -0.85, -0.33), 1.6, 1.6, (9, 8.5, 7.5)),
        "lamp 2": _lamp((2.2, 3.4, 0.4), (-0.5, -0.85, -0.1), 1, 1, (11, 11.5, 13)),
        "sky": _rectangle((0, 4.2, 0.5), (0, -1, 0), 9, 9, bsdf=_diffuse(_rgb(0.75, 0.78, 0.8))),
    }


SCENES: dict[str, Callable[[int], Dictionary]] = {"gallery": gallery, "tray": tray}
