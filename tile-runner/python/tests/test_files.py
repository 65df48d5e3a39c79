"""Files: what the command line makes of them, as functions."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from conftest import REFERENCE, SAMPLE, noise, read, same, write

import linpred


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "linpred", *map(str, arguments)], capture_output=True, text=True)


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample, denoised by the command."""
    path = tmp_path_factory.mktemp("command") / "clean.exr"
    done = command("denoise", SAMPLE, "-o", path, "--quality", "fast")
    assert done.returncode == 0, done.stderr
    return path


def small_file(path: Path, seed: int = 1) -> Path:
    write(path, dict(zip("RGB", noise(30, 40, seed).transpose(2, 0, 1))))
    return path


def test_a_file_is_byte_for_byte_that_of_the_command(clean: Path, tmp_path: Path) -> None:
    report = linpred.denoise_file(SAMPLE, tmp_path / "clean.exr", quality="fast")
    assert (tmp_path / "clean.exr").read_bytes() == clean.read_bytes()
    assert isinstance(report, linpred.FileReport)
    assert (report.input, report.output) == (str(SAMPLE), str(tmp_path / "clean.exr"))
    assert report.pictures[0].pixels == 128 * 128
    assert not report.skipped


def test_options_are_those_of_the_command(tmp_path: Path) -> None:
    options = dict(
        quality="fast",
        coverage=2,
        preset="auto",
        map={"albedo": "none", "depth": "Z"},
        spp=16,
        layers=["albedo"],
        wrap="x",
        error_layer=True,
        models_layer=True,
        compression="piz",
        max_memory="1G",
    )
    linpred.denoise_file(SAMPLE, tmp_path / "package.exr", **options)
    written = "--quality fast --coverage 2 --preset auto --map albedo=none --map depth=Z --spp 16 --layers albedo --wrap x --error-layer --models-layer --compression piz"
    done = command("denoise", SAMPLE, "-o", tmp_path / "command.exr", *written.split(), "--max-memory", "1G")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "package.exr").read_bytes() == (tmp_path / "command.exr").read_bytes()


def test_inspect_and_compare_give_what_the_command_prints(clean: Path, tmp_path: Path) -> None:
    found = linpred.inspect(SAMPLE, pixels=True, map={"albedo": "none"})
    printed = command("inspect", SAMPLE, "--pixels", "--map", "albedo=none", "--json").stdout
    assert found == json.loads(printed)
    pictures = dict(heatmap=tmp_path / "heat.png", picture=tmp_path / "seen.png")
    found = linpred.compare(clean, REFERENCE, input=SAMPLE, **pictures)
    printed = command("compare", clean, REFERENCE, "--input", SAMPLE, "--json").stdout
    assert found == json.loads(printed)
    assert found["gain"] > 4.0
    for picture in pictures.values():
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_bands_are_stitched_to_the_whole(clean: Path, tmp_path: Path) -> None:
    bands = [tmp_path / f"band{n}.exr" for n in (1, 2)]
    told: list[tuple[int, int]] = []
    for n, band in zip("12", bands):
        linpred.denoise_file(SAMPLE, band, quality="fast", band=f"{n}/2", progress=lambda *rows: told.append(rows))
        assert told[-1][0] == told[-1][1] < 128
    linpred.stitch(reversed(bands), tmp_path / "whole.exr")
    assert (tmp_path / "whole.exr").read_bytes() == clean.read_bytes()


def passes_of(tmp_path: Path, names: str = "ab") -> list[Path]:
    """Passes of 3, 4, ... samples per pixel, all of one mean."""
    paths = []
    for n, name in enumerate(names, 3):
        counts = np.full((30, 40), n, np.float32)
        write(tmp_path / f"{name}.exr", dict(zip("RGB", noise(30, 40, n).transpose(2, 0, 1)), sampleCount=counts))
        paths.append(tmp_path / f"{name}.exr")
    return paths


def test_passes_are_merged_to_the_file_of_the_command(tmp_path: Path) -> None:
    passes, told = passes_of(tmp_path), []
    linpred.merge(reversed(passes), tmp_path / "all.exr", progress=lambda *rows: told.append(rows))
    assert told[-1] == (30, 30)
    done = command("merge", *passes, "-o", tmp_path / "command.exr")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "all.exr").read_bytes() == (tmp_path / "command.exr").read_bytes()
    a, b, merged = (read(path) for path in (*passes, tmp_path / "all.exr"))
    assert np.allclose(merged["R"], (3 * a["R"] + 4 * b["R"]) / 7, rtol=1e-6)
    assert np.all(merged["sampleCount"] == 7)
    linpred.merge(passes, tmp_path / "asked.exr", spp=5)
    assert np.all(read(tmp_path / "asked.exr")["sampleCount"] == 10)


def test_passes_that_cannot_be_merged_are_refused_in_a_sentence(tmp_path: Path) -> None:
    passes, out = passes_of(tmp_path), tmp_path / "all.exr"
    with pytest.raises(ValueError, match="are one file"):
        linpred.merge([passes[0], passes[0]], out)
    with pytest.raises(TypeError, match="^passes: .* is one path"):
        linpred.merge(str(passes[0]), out)
    with pytest.raises(FileNotFoundError, match="missing.exr"):
        linpred.merge([*passes, tmp_path / "missing.exr"], out)
    small_file(tmp_path / "uncounted.exr")
    with pytest.raises(linpred.InputError, match="give spp=N"):
        linpred.merge([tmp_path / "uncounted.exr"], out)
    with pytest.raises(MemoryError, match="max_memory"):
        linpred.merge(passes, out, max_memory="1M")

    def fail(done: int, of_all: int) -> None:
        raise ValueError("enough")

    with pytest.raises(ValueError, match="^enough$"):
        linpred.merge(passes, out, progress=fail)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.exr", "b.exr", "uncounted.exr"]


def test_pixels_that_take_no_part_are_warned_of(tmp_path: Path) -> None:
    a, b = passes_of(tmp_path)
    broken = read(a)
    broken["G"][3, 5] = np.nan
    write(a, broken)
    with pytest.warns(linpred.InputWarning, match="^1 pixels of the passes are not finite"):
        linpred.merge([a, b], tmp_path / "all.exr")
    assert read(tmp_path / "all.exr")["sampleCount"][3, 5] == 4


def test_a_plan_says_what_a_run_would_take() -> None:
    plan = linpred.plan(SAMPLE, threads=1)
    assert plan.threads == 1
    assert 1 << 20 < plan.memory < 1 << 28
    assert "MiB" in plan.text
    with pytest.raises(MemoryError, match="max_memory is 1.0 MiB"):
        linpred.plan(SAMPLE, max_memory=1 << 20)


def test_a_sequence_is_denoised_frame_by_frame(tmp_path: Path) -> None:
    for n in (1, 2, 4):
        small_file(tmp_path / f"shot.{n:04}.exr", n)
    told = []
    names = tmp_path / "shot.####.exr", tmp_path / "clean.####.exr"
    reports = linpred.denoise_file(*names, progress=lambda *rows: told.append(rows))
    assert isinstance(reports, list)
    assert [report.frame for report in reports] == [1, 2, 4]
    assert told[-1] == (90, 90)
    assert told == sorted(told)
    one = linpred.denoise_file(tmp_path / "shot.0002.exr", tmp_path / "alone.exr")
    assert isinstance(one, linpred.FileReport)
    assert (tmp_path / "alone.exr").read_bytes() == (tmp_path / "clean.0002.exr").read_bytes()
    (tmp_path / "clean.0004.exr").unlink()
    for wanted in ("2,4", [2, 4]):
        linpred.denoise_file(*names, frames=wanted, skip_existing=True)
    reports = linpred.denoise_file(*names, frames=range(2, 5, 2), skip_existing=True)
    assert isinstance(reports, list)
    assert [(report.frame, report.skipped) for report in reports] == [(2, True), (4, True)]


def test_frames_that_help_each_other_are_those_of_the_command(tmp_path: Path) -> None:
    for frame in range(1, 5):
        # without motion or variances no frame would help another
        channels = dict(zip("RGB", noise(30, 40, frame).transpose(2, 0, 1)))
        motion = np.ones((30, 40), np.float32)
        write(tmp_path / f"shot.{frame}.exr", {**channels, "motion.X": motion, "motion.Y": motion})
    done = command("denoise", tmp_path / "shot.#.exr", "-o", tmp_path / "command.#.exr", "--temporal", "--quality", "fast")
    assert done.returncode == 0, done.stderr
    shot = tmp_path / "shot.#.exr"
    reports = linpred.denoise_file(shot, tmp_path / "whole.#.exr", temporal=True, quality="fast")
    assert isinstance(reports, list)
    for frame, report in enumerate(reports, 1):
        name = tmp_path / f"command.{frame}.exr"
        assert Path(report.output).read_bytes() == name.read_bytes()
        assert len(report.help) == 1 and report.help[0].frames >= 1.0
    # one of them, by itself
    for beside in [dict(before=shot, after=shot), dict(before=[tmp_path / "shot.1.exr"], after=[tmp_path / "shot.3.exr", tmp_path / "shot.4.exr"])]:
        report = linpred.denoise_file(tmp_path / "shot.2.exr", tmp_path / "one.exr", temporal=3, quality="fast", **beside)
        assert (tmp_path / "one.exr").read_bytes() == (tmp_path / "command.2.exr").read_bytes()
    alone = linpred.plan(tmp_path / "shot.2.exr")
    assert linpred.plan(tmp_path / "shot.2.exr", temporal=1, after=shot).memory > alone.memory


def test_a_frame_that_cannot_help_is_warned_of_and_named(tmp_path: Path) -> None:
    small_file(tmp_path / "shot.1.exr")
    (tmp_path / "shot.2.exr").write_text("not a picture")
    with pytest.warns(linpred.InputWarning, match="shot.2.exr does not help"):
        report = linpred.denoise_file(tmp_path / "shot.1.exr", tmp_path / "out.exr", temporal=1, after=tmp_path / "shot.2.exr")
    assert isinstance(report, linpred.FileReport)
    assert report.help == (linpred.Help(1.0, (), ()),)
    assert len(report.unused) == 1 and "not an EXR" in report.unused[0]


def test_help_that_makes_no_sense_is_refused(tmp_path: Path) -> None:
    one, two = small_file(tmp_path / "shot.1.exr"), small_file(tmp_path / "shot.2.exr", 2)
    for input, output, options, words in [
        (one, "out.exr", dict(temporal=True), "before and after"),
        (one, "out.exr", dict(after=two), "temporal"),
        (one, "out.exr", dict(temporal=0, after=two), "1 to 8"),
        (one, "out.exr", dict(temporal=9, after=two), "1 to 8"),
        (tmp_path / "shot.#.exr", "out.#.exr", dict(temporal=True, after=two), "single image"),
        (one, "out.exr", dict(temporal=True, before=one), "one file"),
        (tmp_path / "shot.#.exr", "shot.#.exr", dict(temporal=True), "is the input"),
    ]:
        with pytest.raises(ValueError, match=words):
            linpred.denoise_file(input, tmp_path / output, **options)
    with pytest.raises(TypeError, match="before"):
        linpred.denoise_file(one, tmp_path / "out.exr", temporal=True, before=3)  # type: ignore[arg-type]


def test_frames_that_are_skipped_count_as_done(tmp_path: Path) -> None:
    for n in (1, 2, 3):
        small_file(tmp_path / f"shot.{n}.exr", n)
    names = tmp_path / "shot.#.exr", tmp_path / "clean.#.exr"
    linpred.denoise_file(*names, frames="1,3")
    for existing in ("13", "123"):
        told: list[tuple[int, int]] = []
        reports = linpred.denoise_file(*names, skip_existing=True, progress=lambda *rows: told.append(rows))
        assert [str(report.frame) for report in reports if report.skipped] == list(existing)
        assert told[-1][0] == told[-1][1]


def test_options_that_make_no_sense_are_no_fault_of_a_frame(tmp_path: Path) -> None:
    small_file(tmp_path / "shot.1.exr")
    names = tmp_path / "shot.#.exr", tmp_path / "clean.#.exr"
    for option in (dict(quality="best"), dict(threads=0), dict(band="9"), dict(wrap="y"), dict(max_memory="much")):
        with pytest.raises(ValueError) as refused:
            linpred.denoise_file(*names, skip_existing=True, **option)
        assert not isinstance(refused.value, linpred.InputError)
    for option in (dict(spp="16"), dict(error_layer=1), dict(band=(1, 2)), dict(map="colour=R"), dict(max_memory=2e9), dict(frames=5)):
        with pytest.raises(TypeError, match=f"^{next(iter(option))}: "):
            linpred.denoise_file(*names, **option)
    with pytest.raises(ValueError, match="^frames: -1 is no frame number"):
        linpred.denoise_file(*names, frames=[-1])
    with pytest.raises(TypeError, match="^bands: .* is one path"):
        linpred.stitch("band.exr", tmp_path / "whole.exr")
    plan = linpred.plan(names[0])
    assert plan == linpred.plan(os.fsencode(tmp_path / "shot.1.exr"))


def test_a_sequence_error_can_be_passed_to_another_process() -> None:
    error = linpred.SequenceError({1: ValueError("x")}, [])
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) == "1 of 1 frames failed; frame 1: x"
    assert list(again.failures) == [1]


def test_a_warning_that_is_made_an_error_comes_before_anything_is_written(clean: Path, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(linpred.InputWarning):
            linpred.denoise_file(clean, tmp_path / "again.exr", quality="fast")
    assert not list(tmp_path.iterdir())


def test_a_frame_that_fails_does_not_stop_the_others(tmp_path: Path) -> None:
    small_file(tmp_path / "shot.1.exr")
    (tmp_path / "shot.2.exr").write_bytes(b"no image")
    small_file(tmp_path / "shot.3.exr")
    with pytest.raises(linpred.SequenceError, match="^1 of 3 frames failed; frame 2: .*shot.2.exr") as failed:
        linpred.denoise_file(tmp_path / "shot.#.exr", tmp_path / "clean.#.exr")
    assert list(failed.value.failures) == [2]
    assert [report.frame for report in failed.value.reports] == [1, 3]
    assert (tmp_path / "clean.3.exr").exists()


def test_what_progress_raises_ends_the_run_and_leaves_nothing(tmp_path: Path) -> None:
    for n in (1, 2):
        small_file(tmp_path / f"shot.{n}.exr")

    def fail(done: int, of_all: int) -> None:
        # an error that a frame could have, too
        raise ValueError("enough")

    for names in (("shot.1.exr", "clean.exr"), ("shot.#.exr", "clean.#.exr")):
        with pytest.raises(ValueError, match="^enough$"):
            linpred.denoise_file(*(tmp_path / name for name in names), progress=fail)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["shot.1.exr", "shot.2.exr"]


def test_errors_are_of_the_kind_that_python_has_for_them(tmp_path: Path) -> None:
    image, out = small_file(tmp_path / "image.exr"), tmp_path / "clean.exr"
    with pytest.raises(FileNotFoundError, match="missing.exr"):
        linpred.denoise_file(tmp_path / "missing.exr", out)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        linpred.denoise_file(image, tmp_path / "nowhere" / "clean.exr")
    broken = tmp_path / "broken.exr"
    broken.write_bytes(image.read_bytes()[:300])
    with pytest.raises(linpred.InputError, match="broken.exr"):
        linpred.denoise_file(broken, out)
    with pytest.raises(ValueError, match="map albedo=kd: "):
        linpred.denoise_file(image, out, map={"albedo": "kd"})
    with pytest.raises(ValueError, match="^preset \"none\": it is one of auto, "):
        linpred.denoise_file(image, out, preset="none")
    with pytest.raises(ValueError, match="^spp 0: it is 1 or more samples"):
        linpred.denoise_file(image, out, spp=0)
    with pytest.raises(ValueError, match="cannot be called .*clean.png; call it .*clean.exr"):
        linpred.denoise_file(image, out.with_suffix(".png"))
    with pytest.raises(MemoryError, match="max_memory"):
        linpred.denoise_file(image, out, max_memory="1M")
    with pytest.raises(linpred.InputError, match="give spp=N, or map="):
        moments = dict(zip(("R", "G", "B", "m2_R", "m2_G", "m2_B"), np.concatenate([noise(30, 40), noise(30, 40)], -1).transpose(2, 0, 1)))
        write(tmp_path / "moments.exr", moments)
        linpred.denoise_file(tmp_path / "moments.exr", out, map={"second-moment": "m2_R,m2_G,m2_B"})
    assert not out.exists()
    with pytest.raises(linpred.InputError, match="broken.exr"):
        linpred.inspect(broken)


def test_what_is_odd_about_a_file_is_warned_of(clean: Path, tmp_path: Path) -> None:
    with pytest.warns(linpred.InputWarning, match="linpred"):
        report = linpred.denoise_file(clean, tmp_path / "again.exr", quality="fast")
    assert isinstance(report, linpred.FileReport)
    assert report.warnings
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        linpred.denoise_file(small_file(tmp_path / "image.exr"), tmp_path / "clean.exr")


def test_the_command_ends_in_its_exit_codes(tmp_path: Path) -> None:
    assert command("--version").stdout == f"linpred {linpred.__version__}\n"
    assert command("denoise").returncode == 2
    assert command("denoise", tmp_path / "missing.exr", "-o", tmp_path / "clean.exr").returncode == 3
    script = Path(sys.executable).parent / "linpred"
    done = subprocess.run([script, "--version"], capture_output=True, text=True)
    assert done.stdout == f"linpred {linpred.__version__}\n"


def test_arrays_of_a_file_are_kept_that_are_not_denoised(clean: Path) -> None:
    before, after = read(SAMPLE), read(clean)
    assert set(before) <= set(after)
    assert all(same(before[name], after[name]) for name in before if name not in "RGB")
