"""Frames of a sequence on disk. Knows nothing of Blender."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable

# as the `linpred` command reads them: the last ####, else the first %04d, else the first $F4
PLACES = ((r"#+", -1), (r"%\d*d", 0), (r"\$F\d?", 0))


def place_of_number(path: str) -> tuple[int, int, int] | None:
    """Where in `path` the frame number stands: start, end, and its digits. `None` for the name of a single file."""
    if os.path.exists(path):
        return None
    folder = len(path) - len(os.path.basename(path))
    for place, which in PLACES:
        found = list(re.finditer(place, path[folder:]))
        if found:
            start, end = (folder + at for at in found[which].span())
            text = path[start:end]
            digits = len(text) if text[0] == "#" else max(1, int("0" + "".join(filter(str.isdigit, text))))
            return start, end, digits
    return None


def path_of_frame(pattern: str, frame: int) -> str:
    """The path of a frame; a path without a place for the number is every frame's."""
    place = place_of_number(pattern)
    if place is None:
        return pattern
    start, end, digits = place
    return f"{pattern[:start]}{frame:0{digits}d}{pattern[end:]}"


def frames_on_disk(pattern: str, frames: Iterable[int]) -> list[int]:
    """Those of `frames` whose files are there."""
    return [frame for frame in frames if os.path.exists(path_of_frame(pattern, frame))]
