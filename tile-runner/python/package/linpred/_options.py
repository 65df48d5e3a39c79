"""Options as the compiled half takes them: of the right types, or refused in a sentence that names them. What they may say is checked there."""

from __future__ import annotations

import operator
import os
from collections.abc import Mapping as AnyMapping
from typing import Any, Iterable, Mapping, Union

Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]

MOST = 2**31 - 1
"""What no number of threads, models, samples or rows reaches."""


def _type(name: str, value: object, wanted: str) -> TypeError:
    return TypeError(f"{name}: {value!r} is of type {type(value).__name__}; it is {wanted}")


def whole(name: str, value: object) -> int:
    """A whole number; those out of all range are refused by the range of the option."""
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise _type(name, value, "a whole number") from None
    return max(-MOST, min(number, MOST))


def whole_or_none(name: str, value: object) -> int | None:
    """The same, if there is one."""
    return None if value is None else whole(name, value)


def number(name: str, value: object) -> float:
    """A number; NumPy's, too."""
    if isinstance(value, (str, bytes, bool)) or not hasattr(value, "__float__"):
        raise _type(name, value, "a number")
    try:
        return float(value)
    except (TypeError, ValueError):
        raise _type(name, value, "a number") from None


def number_or_none(name: str, value: object) -> float | None:
    """The same, if there is one."""
    return None if value is None else number(name, value)


def text(name: str, value: object) -> str:
    """A string."""
    if not isinstance(value, str):
        raise _type(name, value, "a string")
    return value


def flag(name: str, value: object) -> bool:
    """True or False; NumPy's, too."""
    if not isinstance(value, bool) and type(value).__name__ not in ("bool", "bool_"):
        raise _type(name, value, "True or False")
    return bool(value)


def path(name: str, value: object) -> str:
    """A path as a string."""
    try:
        return os.fsdecode(value)  # type: ignore[arg-type]
    except TypeError:
        raise _type(name, value, "a path") from None


def path_or_none(name: str, value: object) -> str | None:
    """The same, if there is one."""
    return None if value is None else path(name, value)


def strings(name: str, value: object) -> list[str]:
    """Several strings: a list of them, or one with commas between."""
    if isinstance(value, str):
        return value.split(",")
    if not isinstance(value, Iterable):
        raise _type(name, value, "a list of strings")
    return [text(name, one) for one in value]


def mapping(name: str, value: object) -> Mapping[str, Any]:
    """A mapping from strings; an empty one for None."""
    if value is None:
        return {}
    if not isinstance(value, AnyMapping):
        raise _type(name, value, "a mapping, such as a dictionary")
    for key in value:
        text(f"{name}: name", key)
    return value


def size(name: str, value: object) -> str | None:
    """Bytes, as the command line takes them."""
    return value if value is None or isinstance(value, str) else str(whole_size(name, value))


def whole_size(name: str, value: object) -> int:
    """A number of bytes."""
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise _type(name, value, "a whole number of bytes, or a string such as '256M'") from None


def computing(quality: object, coverage: object, formulas: object, threads: object) -> dict[str, Any]:
    """What to compute."""
    return dict(
        quality=text("quality", quality),
        formulas=text("formulas", formulas),
        coverage=whole_or_none("coverage", coverage),
        threads=whole_or_none("threads", threads),
    )


def reading(
    input: object,
    preset: object,
    map: object,
    features: object,
    spp: object,
    other_half: object,
    layers: object,
    wrap: object,
    max_memory: object,
) -> dict[str, Any]:
    """Which channels of which file."""
    return dict(
        path=path("input", input),
        preset=text("preset", preset),
        map=entries(map),
        features=[features] if isinstance(features, str) else strings("features", features),
        spp=whole_or_none("spp", spp),
        other_half=path_or_none("other_half", other_half),
        layers=strings("layers", layers),
        wrap=text("wrap", wrap),
        max_memory=size("max_memory", max_memory),
        neighbours=None,
    )


def reach(temporal: object) -> int | None:
    """How many frames on each side may help; None for none."""
    if temporal is None or isinstance(temporal, bool):
        return 3 if temporal else None
    return whole("temporal", temporal)


def paths(name: str, value: object) -> list[str]:
    """Several paths, or one."""
    if isinstance(value, (str, bytes, os.PathLike)):
        return [path(name, value)]
    if not isinstance(value, Iterable):
        raise _type(name, value, "a path, or a list of them")
    return [path(name, one) for one in value]


def entries(map: object) -> list[str]:
    """Roles as the command line takes them."""
    return [f"{role}={text(f'map[{role!r}]', channel)}" for role, channel in mapping("map", map).items()]


def writing(output: object, error_layer: object, models_layer: object, band: object, compression: object) -> dict[str, Any]:
    """How to write."""
    return dict(
        output=path("output", output),
        error_layer=flag("error_layer", error_layer),
        models_layer=flag("models_layer", models_layer),
        band=None if band is None else text("band", band),
        compression=text("compression", compression),
    )
