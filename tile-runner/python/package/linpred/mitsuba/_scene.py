"""A scene as the loop needs it: loaded, looked through for what cannot be handled, and told from others."""

from __future__ import annotations

import hashlib
import os
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from linpred._errors import InputError

VARIANTS = ("llvm_ad_rgb", "cuda_ad_rgb")
"""Those that the loop works with, in the order they are tried in."""

FEATURES = {"linpred_albedo": "albedo", "linpred_normal": "sh_normal", "linpred_depth": "depth"}
"""What Mitsuba calls the features, by the names they are asked for under: such as no scene has."""


@dataclass(frozen=True)
class View:
    """What is rendered: a scene through one of its sensors.

    Attributes:
        mi: The module ``mitsuba``, its variant chosen.
        scene: The scene.
        sensor: The sensor.
        integrator: The scene's own integrator with the features beside it.
        channels: Where the colour and the features lie in what the integrator gives: ten indices, colour first.
        width, height: Pixels; of the film's crop window, if it has one.
        notes: What is not rendered as the scene says, in sentences.
        checksum: Of everything that the picture depends on.
    """

    mi: Any
    scene: Any
    sensor: Any
    integrator: Any
    channels: tuple[int, ...]
    width: int
    height: int
    notes: tuple[str, ...]
    checksum: str

    def set_threads(self, threads: int) -> None:
        """How many threads Mitsuba computes with."""
        import drjit as dr

        dr.set_thread_count(threads)


def mitsuba(variant: str | None) -> Any:
    """The module ``mitsuba`` with a variant chosen: the one that is asked for, the one that is set, or the first that this machine has.

    Raises ImportError where Mitsuba is missing, ValueError for a variant that the loop does not work with.
    """
    try:
        import mitsuba as mi
    except ImportError as error:
        raise ImportError(f"Mitsuba 3 is needed, and cannot be imported ({error}): pip install 'linpred[mitsuba]'") from error
    wanted = variant or mi.variant()
    if wanted is not None:
        if wanted not in VARIANTS:
            raise ValueError(f"variant: {wanted} renders no colour of three channels, or one ray at a time; use {' or '.join(VARIANTS)}")
        failure = _choose(mi, wanted)
        if failure is not None:
            raise ValueError(f"variant: {wanted} does not work on this machine: {failure}")
        return mi
    failures = {name: _choose(mi, name) for name in VARIANTS}
    for name, failure in failures.items():
        if failure is None:
            mi.set_variant(name)
            return mi
    raise ImportError(f"no variant of Mitsuba that the loop works with runs on this machine: {'; '.join(f'{name}: {why}' for name, why in failures.items())}")


def _choose(mi: Any, name: str) -> str | None:
    """Sets a variant; why it does not work, if so."""
    try:
        if mi.variant() != name:
            mi.set_variant(name)
        # the back end of Dr.Jit is loaded with the first array
        mi.Float([0.0, 1.0]) + 1.0
    except (ImportError, RuntimeError, AttributeError) as error:
        return str(error).strip()
    return None


def load(scene: Any, variant: str | None, sensor: int) -> View:
    """A scene from its file, or one that is loaded. Raises InputError, naming the file, for what cannot be rendered."""
    path = os.fsdecode(scene) if isinstance(scene, (str, bytes, os.PathLike)) else None
    mi = mitsuba(variant)
    if path is None:
        if not isinstance(scene, mi.Scene):
            raise TypeError(f"scene: {type(scene).__name__} is neither a path nor a scene of Mitsuba's variant {mi.variant()}")
        return view(mi, scene, "the scene", sensor)
    if not os.path.isfile(path):
        raise FileNotFoundError(2, "no such scene", path)
    try:
        loaded = mi.load_file(path)
    except Exception as error:  # Mitsuba raises RuntimeError and others of its own
        raise InputError(f"{path}: Mitsuba cannot load it: {error}") from error
    return view(mi, loaded, path, sensor)


def view(mi: Any, scene: Any, name: str, sensor: int) -> View:
    """A scene that is loaded, looked through; `name` is what sentences call it."""
    sensors, integrator = scene.sensors(), scene.integrator()
    if not 0 <= sensor < len(sensors):
        raise InputError(f"{name}: no sensor {sensor}; it has {len(sensors)}, counted from 0")
    if integrator is None:
        raise InputError(f"{name}: it says of no integrator how it is rendered; add <integrator type=\"path\"/>")
    if not isinstance(integrator, mi.SamplingIntegrator) or isinstance(integrator, mi.CppADIntegrator):
        raise InputError(f"{name}: its integrator, {_kind(integrator)}, does not follow rays from the camera on its own; use path, direct or volpath")
    camera = sensors[sensor]
    wrapped = mi.load_dict({"type": "aov", "aovs": ",".join(f"{key}:{value}" for key, value in FEATURES.items()), "linpred_colour": integrator})
    width, height = (int(size) for size in camera.film().crop_size())
    return View(
        mi,
        scene,
        camera,
        wrapped,
        _channels(wrapped.aov_names()),
        width,
        height,
        _notes(camera),
        _checksum(mi, scene, sensor),
    )


def _kind(thing: Any) -> str:
    """What Mitsuba calls a class of its own; those in Python say the name of the one they are made of."""
    in_python = type(thing).__module__.startswith("mitsuba.python")
    return type(thing).__name__ if in_python else str(thing.class_name())


def _channels(names: list[str]) -> tuple[int, ...]:
    """The colour is given apart, before the other channels: three more places."""
    features = (3 + index for index, name in enumerate(names) if name.split(".")[0] in FEATURES)
    return (0, 1, 2, *features)


def _notes(camera: Any) -> tuple[str, ...]:
    reconstruction = _kind(camera.film().rfilter())
    if reconstruction == "BoxFilter":
        return ()
    return (
        f"samples count for their own pixel alone (box filter), not by the film's {reconstruction}: "
        "filters that mix pixels make noise that cannot be told from detail",
    )


def _checksum(mi: Any, scene: Any, sensor: int) -> str:
    """Of the objects, their numbers, their meshes and textures as they are loaded: a file that the scene refers to counts as well as the scene's own.

    Objects without a name are named by their address, which is another in every run, so names are left out and the order they make, too. Left out as well are
    normals of vertices: those that Mitsuba makes for a mesh without any are sums in no fixed order, and differ in their last bits whenever they are made.
    """
    parameters = mi.traverse(scene)
    names = ((key, key.rpartition(".")[2]) for key in parameters.keys())
    parts = (_digest(name, parameters[key]) for key, name in names if name != "vertex_normals")
    said = _without_addresses(str(scene)).splitlines()
    lines = [mi.__version__, str(mi.variant()), str(sensor), *sorted(said), *sorted(parts)]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _without_addresses(text: str) -> str:
    return re.sub(r"0x[0-9a-f]+|[0-9]{12,}", "", text)


def _digest(name: str, value: Any) -> str:
    """Of a parameter: the bytes of its numbers, or its words where it is a thing of another kind, such as a transform."""
    numbers = np.asarray(value)
    data = _without_addresses(repr(value)).encode() if numbers.dtype.hasobject else np.ascontiguousarray(numbers).tobytes()
    return hashlib.sha256(name.encode() + b" " + data).hexdigest()
