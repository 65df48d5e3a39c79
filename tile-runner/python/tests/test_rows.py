"""Frames row by row: the bits of whole frames, asked for no sooner than they are needed."""

from __future__ import annotations

import os
from typing import Any, Iterator

import numpy as np
import pytest
from conftest import noise, same, small

import linpred

HEIGHT = 150


def frame() -> dict[str, Any]:
    arrays: dict[str, Any] = small(HEIGHT, 30)
    arrays["layers"] = {"glow": 0.5 * arrays["colour"]}
    arrays["scalars"] = {"mask": arrays["depth"]}
    return arrays


def part(arrays: dict[str, Any], rows: Any) -> dict[str, Any]:
    """Some rows of each array."""
    return {name: part(array, rows) if isinstance(array, dict) else array[rows] for name, array in arrays.items()}


def stack(rows: list[linpred.Denoised]) -> dict[str, np.ndarray]:
    names = ("colour", "error", "radius", "rank", "alpha")
    return {name: np.stack([getattr(row, name) for row in rows]) for name in names}


@pytest.mark.parametrize("at_a_time", [0, 1, 7, HEIGHT])
def test_rows_have_the_bits_of_the_frame(at_a_time: int) -> None:
    arrays = frame()
    whole = linpred.denoise(**arrays)
    step = range(0, HEIGHT, max(at_a_time, 1))
    source = (part(arrays, y if at_a_time == 0 else slice(y, y + at_a_time)) for y in step)
    rows = linpred.denoise_rows(source, HEIGHT)
    assert rows.report is None
    denoised = list(rows)
    assert len(denoised) == HEIGHT
    for name, array in stack(denoised).items():
        assert same(array, getattr(whole, name)), name
    assert same(np.stack([row.layers["glow"] for row in denoised]), whole.layers["glow"])
    assert same(np.stack([row.scalars["mask"] for row in denoised]), whole.scalars["mask"])
    assert rows.report.models == whole.report.models
    assert rows.report.pixels == HEIGHT * 30


def test_a_row_is_asked_for_no_sooner_than_it_is_wanted() -> None:
    asked = []

    def source() -> Iterator[dict[str, Any]]:
        for y in range(HEIGHT):
            asked.append(y)
            yield {"colour": noise(1, 30, y)[0]}

    rows = linpred.denoise_rows(source(), HEIGHT)
    assert asked == []
    ahead = []
    for y, _ in enumerate(rows):
        ahead.append(len(asked) - y)
    assert 20 < max(ahead) < 120


def rows_of(*given: dict[str, Any]) -> list[linpred.Denoised]:
    return list(linpred.denoise_rows(iter(given), 3))


ROW = {"colour": noise(1, 30)[0]}
WRONG = {
    "the rows end before row 2 of 3": (ROW, ROW),
    "row: there is no colour": ({"albedo": ROW["colour"]},),
    "row 1 has 29 pixels, row 0 has 30": (ROW, {"colour": noise(1, 29)[0]}),
    "row 1 has other arrays than row 0": (ROW, {**ROW, "albedo": ROW["colour"]}),
    "colour: shape (30, 4), but it is (width, 3); alpha has an argument of its own": ({"colour": np.zeros((30, 4))},),
    "depth: shape (29,), but the colour has 30 pixels (width)": ({**ROW, "depth": np.zeros(29)},),
}


@pytest.mark.parametrize("sentence", WRONG)
def test_rows_that_make_no_sense_are_refused_with_a_sentence(sentence: str) -> None:
    with pytest.raises(ValueError) as refused:
        rows_of(*WRONG[sentence])
    assert str(refused.value) == sentence


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(ValueError, match="^row: 'color' is none of albedo, "):
        rows_of({"color": ROW["colour"]})
    with pytest.raises(ValueError, match="^height 0: it is 1 to "):
        linpred.denoise_rows(iter([ROW]), 0)


def test_what_the_source_raises_comes_out_and_ends_the_run() -> None:
    class OwnError(Exception):
        pass

    def source() -> Iterator[dict[str, Any]]:
        yield ROW
        raise OwnError

    rows = linpred.denoise_rows(source(), 3)
    with pytest.raises(OwnError):
        next(rows)
    assert list(rows) == []
    assert rows.report is None


def test_layers_are_told_apart_by_their_names() -> None:
    bright = noise(3, 30)
    both = [{"a": bright[y], "b": 0 * bright[y]} for y in range(3)]
    both[1] = dict(reversed(both[1].items()))
    for row in rows_of(*({"colour": bright[y], "layers": both[y]} for y in range(3))):
        assert row.layers["a"].max() > 0 == row.layers["b"].max()
    with pytest.raises(ValueError, match="^row 1 has other arrays than row 0$"):
        rows_of(*({"colour": bright[y], "layers": {str(y): bright[y]}} for y in range(3)))


class Watched:
    """A source that tells when it is closed."""

    def __init__(self) -> None:
        self.closed = 0

    def __call__(self, count: int) -> Iterator[dict[str, Any]]:
        try:
            for y in range(count):
                yield {"colour": noise(1, 8, y)[0]}
        finally:
            self.closed += 1


@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="NOT TESTED: no /proc tells how many threads there are")
def test_rows_that_are_dropped_leave_no_thread_and_close_their_source() -> None:
    def threads() -> int:
        return len(os.listdir("/proc/self/task"))

    source, before = Watched(), threads()
    for _ in range(40):
        next(linpred.denoise_rows(source(200), 200))
    for _ in range(40):
        with linpred.denoise_rows(source(200), 200) as rows:
            next(rows)
        assert list(rows) == []
    for _ in range(40):
        list(linpred.denoise_rows(source(20), 20))
    assert source.closed == 120
    assert threads() <= before


def test_the_report_of_a_run_at_work_is_none() -> None:
    told = []

    def source() -> Iterator[dict[str, Any]]:
        for y in range(3):
            told.append(rows.report)
            yield ROW

    rows = linpred.denoise_rows(source(), 3)
    list(rows)
    assert told == [None] * 3
    assert rows.report.pixels == 90


def test_a_source_that_asks_for_its_own_rows_is_told() -> None:
    def source() -> Iterator[dict[str, Any]]:
        yield ROW
        next(rows)

    rows = linpred.denoise_rows(source(), 3)
    with pytest.raises(RuntimeError, match="the source of the rows itself"):
        next(rows)
