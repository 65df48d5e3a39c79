"""The job and the frames of a sequence, which know nothing of Blender: these tests need nothing but pytest."""

from __future__ import annotations

import importlib.util
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest


def load(name: str) -> ModuleType:
    """A file of the extension alone: the package as a whole imports bpy."""
    spec = importlib.util.spec_from_file_location(f"linpred_blender_{name}", Path(__file__).parent / "extension" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look it up
    spec.loader.exec_module(module)
    return module


job, frames = load("job"), load("frames")


def run(denoise_file: Callable[..., object], files: int = 1) -> object:
    """The outcome of a job over so many files."""
    tasks = [job.Task(f"file {number}", {"input": number}) for number in range(files)]
    started = job.Job(tasks, denoise_file, UserWarning)
    started.start()
    assert started.wait(10)
    return started


def test_a_file_that_fails_does_not_stop_the_others() -> None:
    def denoise_file(*, input: int, progress: object) -> None:
        if input == 1:
            raise ValueError("no colour in it")

    outcome = run(denoise_file, files=3).outcome
    assert (outcome.done, outcome.failures, outcome.cancelled) == (2, ["no colour in it"], False)


def test_what_went_wrong_with_a_frame_is_told_and_not_that_something_did() -> None:
    def denoise_file(*, input: int, progress: object) -> None:
        # linpred.SequenceError
        error = ValueError("1 of 1 frames failed; frame 7: cannot write clean.0007.exr")
        error.failures = {7: OSError("cannot write clean.0007.exr")}
        raise error

    assert run(denoise_file).outcome.failures == ["cannot write clean.0007.exr"]


def test_an_unforeseen_failure_is_a_sentence_and_its_place_is_on_the_console(capfd: pytest.CaptureFixture[str]) -> None:
    def denoise_file(*, input: int, progress: object) -> None:
        raise KeyError("odd")

    assert run(denoise_file).outcome.failures == ["unexpected KeyError: 'odd'"]
    assert "in denoise_file" in capfd.readouterr().err


def test_notes_are_told_once_and_other_warnings_not() -> None:
    def denoise_file(*, input: int, progress: object) -> None:
        warnings.warn("no normal", UserWarning, stacklevel=1)
        warnings.warn(f"{input}", UserWarning, stacklevel=1)
        warnings.warn("a file was not closed", ResourceWarning, stacklevel=1)

    # whatever others have set; pytest puts it back
    warnings.simplefilter("always", ResourceWarning)
    warnings.simplefilter("ignore", UserWarning)
    assert list(run(denoise_file, files=2).outcome.notes) == ["no normal", "0", "1"]


def test_the_bar_goes_from_0_to_1_over_all_files() -> None:
    seen = []

    def denoise_file(*, input: int, progress: Callable[[int, int], None]) -> None:
        for rows in range(0, 5, 2):
            progress(rows, 4)
            seen.append(started.fraction)

    tasks = [job.Task("", {"input": number}) for number in range(2)]
    started = job.Job(tasks, denoise_file, UserWarning)
    assert started.fraction == 0
    started.start()
    assert started.wait(10)
    assert seen == [0, 0.25, 0.5, 0.5, 0.75, 1]


def test_a_job_ends_at_the_next_row_when_cancelled() -> None:
    rows = []

    def denoise_file(*, input: int, progress: Callable[[int, int], None]) -> None:
        for row in range(10):
            if row == 3:
                started.cancel()
            rows.append(row)
            progress(row, 10)

    started = job.Job([job.Task("", {"input": 0})], denoise_file, UserWarning)
    started.start()
    assert started.wait(10)
    assert rows == [0, 1, 2, 3]
    assert (started.outcome.cancelled, started.outcome.done, started.outcome.failures) == (True, 0, [])


def test_a_job_that_is_cancelled_begins_no_other_file() -> None:
    files = []

    def denoise_file(*, input: int, progress: Callable[[int, int], None]) -> None:
        files.append(input)
        started.cancel()

    started = job.Job([job.Task("", {"input": number}) for number in range(2)], denoise_file, UserWarning)
    started.start()
    assert started.wait(10)
    assert files == [0]
    assert (started.outcome.cancelled, started.outcome.done) == (True, 1)


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself Ctrl-C there")
def test_ctrl_c_while_waiting_does_not_take_the_job_for_ended() -> None:
    # embarrassingly, a first version joined the thread, and removed the files under the hands of linpred
    signal.signal(signal.SIGINT, signal.default_int_handler)  # Blender 4.2 puts its own in place when it renders
    go_on = threading.Event()

    def denoise_file(*, input: int, progress: Callable[[int, int], None]) -> None:
        go_on.wait(10)

    started = job.Job([job.Task("", {"input": 0})], denoise_file, UserWarning)
    started.start()
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        started.wait(10)
    assert not started.wait(0)
    go_on.set()
    assert started.wait(10)
    assert started.outcome.done == 1


@pytest.mark.parametrize(
    ("pattern", "path"),
    [
        ("a/shot.####.exr", "a/shot.0037.exr"),
        ("a/shot_#.##.exr", "a/shot_#.37.exr"),
        ("a/shot.%04d.exr", "a/shot.0037.exr"),
        ("a/shot.%d.exr", "a/shot.37.exr"),
        ("a/shot.$F4.exr", "a/shot.0037.exr"),
        ("a/shot.$F.exr", "a/shot.37.exr"),
        ("a##/shot.exr", "a##/shot.exr"),
        ("a/100%.exr", "a/100%.exr"),
    ],
)
def test_a_pattern_names_the_file_that_the_linpred_command_reads(pattern: str, path: str) -> None:
    assert frames.path_of_frame(pattern, 37) == path


def test_a_file_that_has_the_name_of_a_pattern_is_a_single_file(tmp_path: Path) -> None:
    single = tmp_path / "odd.####.exr"
    assert frames.place_of_number(str(single)) is not None
    single.touch()
    assert frames.place_of_number(str(single)) is None


def test_frames_that_are_not_on_disk_are_left_out(tmp_path: Path) -> None:
    for frame in (2, 5, 7):
        (tmp_path / f"{frame:03}.exr").touch()
    assert frames.frames_on_disk(str(tmp_path / "###.exr"), range(1, 7)) == [2, 5]
