"""Maps of samples, of arrays and of files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import SAMPLE, noise, read, same, small, write

import linpred


def test_a_map_of_arrays_is_that_of_the_file_they_came_from(sample: dict[str, np.ndarray], tmp_path: Path) -> None:
    path = tmp_path / "map.exr"
    of_file = linpred.sample_map_file(SAMPLE, path, budget=8)
    of_arrays = linpred.sample_map(**sample, samples=16, budget=8)
    assert of_arrays.report == of_file
    assert of_arrays.samples.dtype == np.uint32
    assert np.array_equal(of_arrays.samples, read(path)["samples"])
    assert of_file.samples == 16 and of_file.added == 8 and not of_file.reached
    assert of_file.most == of_arrays.samples.max()


def test_a_file_is_byte_for_byte_that_of_the_command(tmp_path: Path) -> None:
    names = [tmp_path / "package.exr", tmp_path / "command.exr"]
    linpred.sample_map_file(SAMPLE, names[0], target_error=1e-3, budget=30, threads=1)
    options = ["--target-error", "1e-3", "--budget", "30"]
    done = subprocess.run([sys.executable, "-m", "linpred", "sample-map", SAMPLE, "-o", names[1], *options], capture_output=True)
    assert done.returncode == 0, done.stderr
    assert names[0].read_bytes() == names[1].read_bytes()


def test_samples_may_be_one_number_or_one_for_each_pixel_of_any_type() -> None:
    frame = small()
    counts = np.full(frame["colour"].shape[:2], 3)
    maps = [linpred.sample_map(**frame, samples=samples, budget=2.5).samples for samples in (3, 3.0, counts, counts.astype(np.uint8))]
    assert all(same(maps[0], other) for other in maps)
    assert maps[0].sum() == round(2.5 * counts.size)
    counts[:, :15] = 400
    uneven = linpred.sample_map(**frame, samples=counts, budget=2.5).samples
    assert uneven[:, :15].mean() < 0.5 * uneven[:, 15:].mean()


def test_a_target_that_is_met_gives_nothing() -> None:
    frame = small()
    met = linpred.sample_map(**frame, samples=4, target_error=10.0)
    assert met.report.reached and not met.samples.any()
    wanted = met.report.error / 2
    report = linpred.sample_map(**frame, samples=4, target_error=wanted).report
    assert not report.reached and report.error_then <= wanted < report.error
    assert linpred.sample_map(**frame, samples=4, target_error=wanted, budget=0.5).report.added == 0.5


def test_progress_counts_the_rows_of_both_runs_and_what_it_raises_ends_them() -> None:
    told: list[tuple[int, int]] = []
    linpred.sample_map(noise(40, 30), variance=np.full((40, 30, 3), 1 / 12), samples=1, budget=1, progress=lambda done, rows: told.append((done, rows)))
    assert told[-1] == (80, 80) and told == sorted(told)

    def stop(done: int, rows: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        linpred.sample_map(noise(40, 30), samples=1, budget=1, progress=stop)


def test_what_makes_no_sense_is_refused_with_a_sentence(tmp_path: Path) -> None:
    frame = small()
    for arguments, error, words in [
        (dict(samples=4), ValueError, "a budget, a target error, or both"),
        (dict(samples=4, budget=0), ValueError, "budget"),
        (dict(samples=4, budget="many"), TypeError, "budget"),
        (dict(samples=4, target_error=float("nan")), ValueError, "target error"),
        (dict(samples=np.ones((3, 3)), budget=1), ValueError, "samples"),
        (dict(samples="four", budget=1), TypeError, "samples"),
        (dict(samples=4, budget=1, quality="best"), ValueError, "quality"),
    ]:
        with pytest.raises(error, match=words):
            linpred.sample_map(**frame, **arguments)
    write(tmp_path / "silent.exr", dict(zip("RGB", noise(30, 40).transpose(2, 0, 1))))
    with pytest.raises(linpred.InputError, match="samples"):
        linpred.sample_map_file(tmp_path / "silent.exr", tmp_path / "map.exr", budget=1)
    with pytest.raises(OSError):
        linpred.sample_map_file(tmp_path / "absent.exr", tmp_path / "map.exr", budget=1)
    assert not (tmp_path / "map.exr").exists()
