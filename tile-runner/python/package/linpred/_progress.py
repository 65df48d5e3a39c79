"""How far a run is."""

from __future__ import annotations

from typing import Callable, Protocol, Union


class Bar(Protocol):
    """What of a ``tqdm`` bar is used."""

    total: float | None
    n: float

    def update(self, n: float = ...) -> object:
        """Moves the bar on by ``n`` rows."""


Progress = Union[Callable[[int, int], object], Bar, None]
"""A function of (rows done, of all), or a ``tqdm`` bar."""


def as_function(progress: Progress) -> Callable[[int, int], object] | None:
    """The function that tells a bar, or the function itself."""
    if progress is None or callable(progress):
        return progress
    bar = progress
    if not hasattr(bar, "update"):
        raise TypeError(f"progress: {type(bar).__name__} is neither a function of (done, of all) nor a bar with an update method")

    def tell(done: int, of_all: int) -> None:
        bar.total = of_all
        bar.update(done - bar.n)

    return tell
