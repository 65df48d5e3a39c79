"""The compiled half of the package: computes what the other half has checked."""

from typing import Any, Callable, Iterable, Iterator, final

__all__ = [
    "Busy",
    "InputError",
    "Rows",
    "VERSION",
    "beside",
    "check",
    "compare",
    "denoise",
    "denoise_file",
    "frames",
    "inspect",
    "main",
    "merge",
    "plan",
    "sample_map",
    "sample_map_file",
    "stitch",
]

VERSION: str

_FrameFiles = tuple[str, str | None]
_Beside = tuple[list[_FrameFiles], list[_FrameFiles]]

class InputError(ValueError): ...
class Busy(RuntimeError): ...

@final
class Rows(Iterator[tuple[int, dict[str, Any]]]):
    def __new__(cls, source: Iterator[list[tuple[str, str, Any]]], height: int, computing: dict[str, Any]) -> Rows: ...
    def __iter__(self) -> Rows: ...
    def __next__(self) -> tuple[int, dict[str, Any]]: ...
    def report(self) -> dict[str, Any] | None: ...

def denoise(
    arrays: list[tuple[str, str, Any]],
    computing: dict[str, Any],
    progress: Callable[[int, int], object] | None,
) -> tuple[dict[str, Any], dict[str, Any]]: ...
def frames(
    reading: dict[str, Any], output: str | None, wanted: str | Iterable[int] | None, temporal: int | None
) -> list[tuple[int, str, str | None, str, _Beside | None]] | None: ...
def beside(reading: dict[str, Any], before: list[str], after: list[str], temporal: int) -> _Beside: ...
def denoise_file(
    reading: dict[str, Any],
    writing: dict[str, Any],
    computing: dict[str, Any],
    warn: Callable[[str], object],
    progress: Callable[[int, int], object] | None,
) -> dict[str, Any]: ...
def check(reading: dict[str, Any], writing: dict[str, Any], computing: dict[str, Any]) -> None: ...
def plan(reading: dict[str, Any], writing: dict[str, Any], computing: dict[str, Any]) -> tuple[int, int, str]: ...
def inspect(reading: dict[str, Any], pixels: bool, asked: int | None) -> str: ...
def compare(
    image: str,
    reference: str,
    input: str | None,
    map: list[str],
    heatmap: str | None,
    picture: str | None,
    asked: int | None,
    max_memory: str | None,
) -> str: ...
def stitch(bands: list[str], output: str) -> None: ...
def sample_map(
    arrays: list[tuple[str, str, Any]],
    wanted: tuple[float | None, float | None],
    computing: dict[str, Any],
    progress: Callable[[int, int], object] | None,
) -> tuple[Any, dict[str, Any]]: ...
def sample_map_file(
    reading: dict[str, Any],
    output: str,
    wanted: tuple[float | None, float | None],
    computing: dict[str, Any],
    warn: Callable[[str], object],
    progress: Callable[[int, int], object] | None,
) -> dict[str, Any]: ...
def merge(
    passes: list[str],
    reading: dict[str, Any],
    output: str,
    warn: Callable[[str], object],
    progress: Callable[[int, int], object] | None,
) -> None: ...
def main(arguments: list[str]) -> int: ...
