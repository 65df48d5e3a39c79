"""Mitsuba in the loop: what a pass measures, and that a loop goes on after anything that ends it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import xml.etree.ElementTree as xml
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import read, same

import linpred
import linpred.mitsuba
from linpred.mitsuba import __main__ as command
from linpred.mitsuba import _loop, _passes, _scene

HEIGHT, WIDTH = 24, 32

SCENE = f"""<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="4"/></integrator>
  <sensor type="thinlens">
    <float name="fov" value="40"/><float name="aperture_radius" value="0.05"/><float name="focus_distance" value="4"/>
    <transform name="to_world"><lookat origin="0, 1, 4" target="0, 0.4, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="{WIDTH}"/><integer name="height" value="{HEIGHT}"/><rfilter type="box"/></film>
  </sensor>
  <shape type="sphere"><point name="center" x="0" y="0.5" z="0"/><float name="radius" value="0.5"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.2, 0.2"/></bsdf></shape>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/></transform><bsdf type="diffuse"/></shape>
  <shape type="sphere"><point name="center" x="2" y="3" z="1"/><float name="radius" value="0.3"/>
    <emitter type="area"><rgb name="radiance" value="20, 20, 18"/></emitter></shape>
</scene>
"""


@pytest.fixture(scope="session")
def mi() -> Any:
    """Mitsuba, if it works here."""
    try:
        return _scene.mitsuba(None)
    except ImportError as error:
        pytest.skip(f"NOT TESTED: Mitsuba in the loop: {error}")


@pytest.fixture
def scene(mi: Any, tmp_path: Path) -> Path:
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def view(mi: Any, scene: Path) -> _scene.View:
    return _scene.load(scene, None, 0)


def changed(scene: Path, tag: str, attributes: dict[str, str], **other: str) -> Path:
    """The scene with other attributes of the first element of that kind."""
    tree = xml.parse(scene)
    found = next(one for one in tree.iter(tag) if all(one.get(name) == value for name, value in attributes.items()))
    for name, value in other.items():
        found.set(name, value)
    tree.write(scene)
    return scene


def some_counts(view: _scene.View) -> np.ndarray:
    return np.random.default_rng(3).integers(0, 9, (view.height, view.width))


def test_a_pass_has_as_many_samples_as_each_pixel_was_to_get(view: _scene.View, monkeypatch: pytest.MonkeyPatch) -> None:
    counts = some_counts(view)
    monkeypatch.setattr(_passes, "LANES", 1000)
    told: list[tuple[int, int]] = []
    found = _passes.trace(view, counts, 1, 0, lambda done, of_all: told.append((done, of_all)))
    assert np.array_equal(found.counts, counts)
    assert np.array_equal(np.isnan(found.variances[..., 0]), counts < 2)
    assert not found.means[counts == 0].any()
    assert len(told) > 2 and told[-1] == (counts.sum(), counts.sum())


def test_mean_and_variance_are_those_of_the_samples(view: _scene.View) -> None:
    counts = some_counts(view)
    pixels = np.repeat(np.arange(counts.size, dtype=np.uint32), counts.ravel())
    values, kept = _passes._samples(view, view.mi.UInt32(pixels), _passes._first_seed(5, 2 * _passes.WAVEFRONTS))
    samples = np.stack([np.array(value, np.float64) for value in values], axis=-1)
    assert np.array(kept).all()
    found = _passes.trace(view, counts, 5, 2)
    means, variances = found.means.reshape(-1, 10), found.variances.reshape(-1, 10)
    for pixel in np.flatnonzero(counts.ravel() >= 2):
        own = samples[pixels == pixel]
        np.testing.assert_allclose(means[pixel], own.mean(0), rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(variances[pixel], own.var(0, ddof=1) / len(own), rtol=1e-5, atol=1e-14)


def test_the_same_pass_is_the_same_bits_and_another_is_not(view: _scene.View) -> None:
    counts = some_counts(view)
    once, again, other = (_passes.trace(view, counts, 1, number) for number in (4, 4, 5))
    assert same(once.means, again.means) and same(once.variances, again.variances)
    assert not np.array_equal(once.means[..., :3], other.means[..., :3])


def test_means_are_the_picture_that_mitsuba_renders(view: _scene.View) -> None:
    found = _passes.trace(view, np.full((HEIGHT, WIDTH), 1024), 1, 0)
    picture = np.array(view.mi.render(view.scene, spp=1024, seed=9))[..., :3]
    expected = 2 * found.variances[..., :3]
    # squares of differences of independent pictures, in units of what is expected: 1 on average over 2,304 values, of heavy tails
    off = ((found.means[..., :3] - picture) ** 2)[expected > 0] / expected[expected > 0]
    assert 0.8 < off.mean() < 1.25


def test_a_crop_window_is_the_part_of_the_picture(mi: Any, scene: Path, view: _scene.View) -> None:
    text = scene.read_text().replace("<rfilter", '<integer name="crop_width" value="12"/><integer name="crop_height" value="8"/>'
        '<integer name="crop_offset_x" value="10"/><integer name="crop_offset_y" value="6"/><rfilter')  # fmt: skip
    scene.write_text(text)
    part = _scene.load(scene, None, 0)
    assert (part.width, part.height) == (12, 8)
    depth = _passes.trace(part, np.full((8, 12), 512), 1, 0).means[..., 9]
    whole = _passes.trace(view, np.full((HEIGHT, WIDTH), 512), 2, 0).means[..., 9]
    assert np.abs(depth - whole[6:14, 10:22]).mean() < 0.05
    assert np.abs(depth - whole[6:14, 11:23]).mean() > 0.2


def test_samples_that_are_not_finite_are_left_out_and_counted(view: _scene.View, monkeypatch: pytest.MonkeyPatch) -> None:
    sound = _passes._samples

    def faulty(view: _scene.View, pixel: Any, seed: int) -> tuple[list[Any], Any]:
        values, kept = sound(view, pixel, seed)
        lane = view.mi.UInt32(np.arange(len(kept)))
        return [values[0] * view.mi.Float(float("nan")), *values[1:]], kept & (lane % 4 != 0)

    counts = np.full((HEIGHT, WIDTH), 4)
    monkeypatch.setattr(_passes, "_samples", faulty)
    found = _passes.trace(view, counts, 1, 0)
    assert found.left_out == HEIGHT * WIDTH and (found.counts == 3).all()
    monkeypatch.undo()
    every = sound(view, view.mi.UInt32(np.repeat(np.arange(counts.size, dtype=np.uint32), 4)), _passes._first_seed(1, 0))[0][1]
    green = np.array(every, np.float64).reshape(-1, 4)[:, 1:].mean(1)
    np.testing.assert_allclose(found.means[..., 1].ravel(), green, rtol=1e-6, atol=1e-12)


def test_a_value_that_is_not_finite_makes_a_sample_that_is_not(mi: Any, scene: Path) -> None:
    # the sphere and the floor are seen by light that no float holds, what is around them by none
    scene.write_text(SCENE.replace("20, 20, 18", "inf, inf, inf"))
    view = _scene.load(scene, None, 0)
    found = _passes.trace(view, np.full((HEIGHT, WIDTH), 8), 1, 0)
    assert np.isfinite(found.means).all()
    assert found.counts.sum() == 8 * HEIGHT * WIDTH - found.left_out
    assert 0.1 < found.left_out / (8 * HEIGHT * WIDTH) < 0.95


def test_values_whose_squares_no_float_holds_have_the_largest_variance(mi: Any, scene: Path) -> None:
    scene.write_text(SCENE.replace("20, 20, 18", "1e38, 1e38, 1e38"))
    found = _passes.trace(_scene.load(scene, None, 0), np.full((HEIGHT, WIDTH), 8), 1, 0)
    assert found.left_out == 0 and np.isfinite(found.variances).all()
    assert found.variances.max() == np.finfo(np.float32).max


def test_a_pass_file_has_the_channels_that_merge_reads(view: _scene.View, tmp_path: Path) -> None:
    found = _passes.trace(view, some_counts(view), 1, 0)
    _passes.write(view, found, str(tmp_path / "pass.exr"))
    channels = read(tmp_path / "pass.exr")
    assert all(channel.dtype == np.float32 for channel in channels.values())
    assert set(channels) == {*_passes.MEANS, *_passes.VARIANCES, "sampleCount"}
    for index, name in enumerate(_passes.MEANS):
        assert same(channels[name], found.means[..., index]), name
    for index, name in enumerate(_passes.VARIANCES):
        assert same(channels[name], found.variances[..., index]), name
    assert same(channels["sampleCount"], found.counts)


def test_a_loop_ends_with_its_samples_and_a_denoised_picture(scene: Path, tmp_path: Path) -> None:
    told: list[linpred.mitsuba.Pass] = []
    clean = tmp_path / "clean.exr"
    done = linpred.mitsuba.render(scene, clean, spp=12, noisy=tmp_path / "all.exr", progress=told.append)
    assert [where.number for where in told] == [1, 2, 3] and done.passes == 3
    assert done.ended == "spp" and done.left_out == 0 and done.notes == ()
    merged = read(tmp_path / "all.exr")
    assert merged["sampleCount"].mean() == pytest.approx(done.samples)
    assert done.samples == pytest.approx(12, abs=0.2)
    assert merged["sampleCount"].min() >= 4 and merged["sampleCount"].max() > 14
    assert read(clean)["R"].shape == (HEIGHT, WIDTH)
    assert not linpred.mitsuba.passes_of(clean).exists()


def test_what_is_black_is_rendered_all_the_same(scene: Path, tmp_path: Path) -> None:
    # the sphere alone, in the middle of nothing
    scene.write_text("".join(line for line in SCENE.splitlines(keepends=True) if "rectangle" not in line))
    done = linpred.mitsuba.render(scene, tmp_path / "clean.exr", spp=12, noisy=tmp_path / "all.exr")
    assert (done.ended, done.passes) == ("spp", 3) and done.samples == pytest.approx(12)
    assert read(tmp_path / "all.exr")["sampleCount"].mean() == pytest.approx(12)


def test_a_picture_without_noise_is_not_rendered_on_and_on(scene: Path, tmp_path: Path) -> None:
    kept = SCENE.index("<shape")
    scene.write_text(SCENE[:kept] + '<emitter type="constant"/></scene>')
    done = linpred.mitsuba.render(scene, tmp_path / "clean.exr", spp=64)
    assert (done.ended, done.passes, done.error) == ("exact", 1, 0)
    assert np.unique(read(tmp_path / "clean.exr")["R"]).size == 1


def test_passes_that_are_kept_are_gone_on_from(scene: Path, tmp_path: Path) -> None:
    clean = tmp_path / "clean.exr"
    linpred.mitsuba.render(scene, clean, spp=8, keep=True)
    first = {path.name: path.read_bytes() for path in linpred.mitsuba.passes_of(clean).glob("pass-*.exr")}
    done = linpred.mitsuba.render(scene, clean, spp=16, keep=True)
    assert done.passes == 4 and sorted(first) == ["pass-000.exr", "pass-001.exr"]
    for name, data in first.items():
        assert (linpred.mitsuba.passes_of(clean) / name).read_bytes() == data
    straight = tmp_path / "straight.exr"
    linpred.mitsuba.render(scene, straight, spp=16)
    assert straight.read_bytes() == clean.read_bytes()


# Kills itself with the rename whose number is given: before it, so that what it is of is not there yet.
VICTIM = """
import os, signal, sys
import linpred.mitsuba
scene, output, last = sys.argv[1], sys.argv[2], int(sys.argv[3])
renames, rename = 0, os.replace
def replace(*names):
    global renames
    renames += 1
    if renames == last:
        os.kill(os.getpid(), signal.SIGKILL)
    rename(*names)
os.replace = replace
linpred.mitsuba.render(scene, output, spp=12)
"""


def test_a_loop_that_is_killed_wherever_it_is_ends_with_the_same_bits(scene: Path, tmp_path: Path) -> None:
    straight, clean = tmp_path / "straight.exr", tmp_path / "clean.exr"
    linpred.mitsuba.render(scene, straight, spp=12)
    killed = 0
    while True:
        # each run gets one or two renames further: with the journal written and its file not yet there, and with both
        last = 2 + killed % 2
        run = subprocess.run([sys.executable, "-c", VICTIM, scene, clean, str(last)], capture_output=True, text=True)
        if run.returncode == 0:
            break
        assert run.returncode == -signal.SIGKILL, run.stderr
        killed += 1
        assert killed < 40, sorted(linpred.mitsuba.passes_of(clean).iterdir())
    assert killed > 4
    assert clean.read_bytes() == straight.read_bytes()


def test_a_pass_that_was_half_written_is_none(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    straight, clean, write = tmp_path / "straight.exr", tmp_path / "clean.exr", _passes.write
    linpred.mitsuba.render(scene, straight, spp=8)

    def half(view: _scene.View, found: _passes.Statistics, path: str) -> None:
        write(view, found, path)
        data = Path(path).read_bytes()
        Path(path).write_bytes(data[: len(data) // 2])
        raise KeyboardInterrupt

    monkeypatch.setattr(_passes, "write", half)
    with pytest.raises(KeyboardInterrupt):
        linpred.mitsuba.render(scene, clean, spp=8)
    monkeypatch.undo()
    assert not list(linpred.mitsuba.passes_of(clean).glob("pass-*.exr"))
    linpred.mitsuba.render(scene, clean, spp=8)
    assert clean.read_bytes() == straight.read_bytes()


def test_a_pass_that_was_lost_is_made_again(scene: Path, tmp_path: Path) -> None:
    straight, clean = tmp_path / "straight.exr", tmp_path / "clean.exr"
    linpred.mitsuba.render(scene, straight, spp=12, keep=True)
    linpred.mitsuba.render(scene, clean, spp=12, keep=True)
    lost = linpred.mitsuba.passes_of(clean) / "pass-001.exr"
    lost.unlink()
    linpred.mitsuba.render(scene, clean, spp=12, keep=True)
    assert lost.read_bytes() == (linpred.mitsuba.passes_of(straight) / "pass-001.exr").read_bytes()
    assert clean.read_bytes() == straight.read_bytes()


def test_a_pass_that_is_cut_off_is_named(scene: Path, tmp_path: Path) -> None:
    clean = tmp_path / "clean.exr"
    linpred.mitsuba.render(scene, clean, spp=8, keep=True)
    broken = linpred.mitsuba.passes_of(clean) / "pass-001.exr"
    broken.write_bytes(broken.read_bytes()[:2000])
    # what was merged of it before it was cut off
    (linpred.mitsuba.passes_of(clean) / "all-002.exr").unlink()
    with pytest.raises((linpred.InputError, OSError), match="pass-001"):
        linpred.mitsuba.render(scene, clean, spp=12)


def test_passes_of_another_loop_are_refused(scene: Path, tmp_path: Path) -> None:
    clean = tmp_path / "clean.exr"
    linpred.mitsuba.render(scene, clean, spp=4, keep=True)
    with pytest.raises(linpred.InputError, match="another seed .*restart"):
        linpred.mitsuba.render(scene, clean, spp=4, seed=1)
    changed(scene, "float", {"name": "fov"}, value="41")
    with pytest.raises(linpred.InputError, match="another scene .*restart"):
        linpred.mitsuba.render(scene, clean, spp=4)
    done = linpred.mitsuba.render(scene, clean, spp=4, restart=True)
    assert done.passes == 1
    journal = linpred.mitsuba.passes_of(clean)
    journal.mkdir()
    (journal / "loop.json").write_text("{")
    with pytest.raises(linpred.InputError, match="loop.json: not the journal of a loop"):
        linpred.mitsuba.render(scene, clean, spp=4)


def test_a_scene_is_the_same_whenever_it_is_loaded_and_not_when_anything_in_it_changed(view: _scene.View, scene: Path) -> None:
    assert _scene.load(scene, None, 0).checksum == view.checksum
    found = {view.checksum}
    for tag, attributes, other in (
        ("rgb", {"name": "reflectance"}, {"value": "0.7, 0.2, 0.21"}),
        ("integer", {"name": "max_depth"}, {"value": "5"}),
        ("point", {"name": "center"}, {"x": "0.01"}),
        ("float", {"name": "aperture_radius"}, {"value": "0.06"}),
    ):
        found.add(_scene.load(changed(scene, tag, attributes, **other), None, 0).checksum)
    assert len(found) == 5


def test_a_target_ends_the_loop_early(scene: Path, tmp_path: Path) -> None:
    done = linpred.mitsuba.render(scene, tmp_path / "clean.exr", spp=64, target_error=0.5)
    assert (done.ended, done.passes) == ("error", 1) and done.error <= 0.5
    target = done.error * 0.8
    done = linpred.mitsuba.render(scene, tmp_path / "clean.exr", spp=64, target_error=target)
    assert done.ended == "error" and done.passes > 1 and done.error <= target
    # no whole step where less is enough
    assert done.samples < 16


def test_however_little_time_there_is_the_first_pass_is_rendered(scene: Path, tmp_path: Path) -> None:
    done = linpred.mitsuba.render(scene, tmp_path / "clean.exr", spp=64, time=1e-3)
    assert (done.ended, done.passes) == ("time", 1)
    assert read(tmp_path / "clean.exr")["R"].shape == (HEIGHT, WIDTH)


def test_time_before_a_loop_was_ended_counts(scene: Path, tmp_path: Path) -> None:
    clean = tmp_path / "clean.exr"
    linpred.mitsuba.render(scene, clean, spp=4, keep=True)
    journal = linpred.mitsuba.passes_of(clean) / "loop.json"
    said = json.loads(journal.read_text())
    assert said["spent"] > 0
    journal.write_text(json.dumps({**said, "spent": 1e6}))
    done = linpred.mitsuba.render(scene, clean, spp=64, time=1e5)
    assert (done.ended, done.passes) == ("time", 1)


def test_ctrl_c_ends_cleanly_and_says_how_to_go_on(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    clean, trace = tmp_path / "clean.exr", _passes.trace

    def interrupted(view: _scene.View, counts: np.ndarray, seed: int, number: int, tell: Any = None) -> Any:
        if number == 1:
            raise KeyboardInterrupt
        return trace(view, counts, seed, number, tell)

    monkeypatch.setattr(_passes, "trace", interrupted)
    assert command.main([str(scene), "-o", str(clean), "--spp", "8"]) == 130
    printed = capsys.readouterr()
    assert "the same command goes on" in printed.err and printed.err.count("pass 1:") == 1
    monkeypatch.undo()
    assert command.main([str(scene), "-o", str(clean), "--spp", "8"]) == 0
    printed = capsys.readouterr()
    assert "8.0" in printed.out and "2 passes" in printed.out and "s of rendering" in printed.out


@pytest.mark.parametrize(
    ("given", "code", "sentence"),
    [
        (["--spp", "0"], 2, "spp: 0"),
        (["--time", "-1"], 2, "time: -1"),
        (["--target-error", "nan"], 2, "target_error: nan"),
        (["--quality", "best"], 2, "best"),
        (["--variant", "scalar_rgb"], 2, "scalar_rgb"),
        (["--variant", "llvm_ad_spectral"], 2, "llvm_ad_spectral"),
        (["--target-error", "inf"], 2, "target_error: inf"),
        (["--noisy", "absent/all.exr"], 3, "no such folder for the noisy image"),
        (["--sensor", "3"], 3, "no sensor 3"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], given: list[str], code: int, sentence: str
) -> None:
    clean = tmp_path / "clean.exr"
    assert command.main([str(scene), "-o", str(clean), *given]) == code
    assert sentence in capsys.readouterr().err
    assert not clean.exists() and not linpred.mitsuba.passes_of(clean).exists()


def test_a_scene_that_cannot_be_rendered_is_refused(mi: Any, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    light, differentiated, silent = (tmp_path / name for name in ("light.xml", "differentiated.xml", "silent.xml"))
    silent.write_text("".join(line for line in SCENE.splitlines(keepends=True) if "integrator" not in line))
    light.write_text(SCENE.replace('integrator type="path"', 'integrator type="ptracer"'))
    differentiated.write_text(SCENE.replace('integrator type="path"', 'integrator type="prb"'))
    for path, sentence in (
        (silent, "no integrator"),
        (light, "ParticleTracerIntegrator"),
        (differentiated, "PRBIntegrator"),
        (tmp_path / "none.xml", "none.xml: no such scene"),
        (__file__, "Mitsuba cannot load it"),
    ):
        assert command.main([str(path), "-o", str(tmp_path / "clean.exr")]) == 3
        assert sentence in capsys.readouterr().err
    with pytest.raises(TypeError, match="neither a path nor a scene"):
        linpred.mitsuba.render(7, tmp_path / "clean.exr")


def test_nothing_is_lost_that_the_loop_did_not_make(scene: Path, tmp_path: Path) -> None:
    clean = tmp_path / "clean.exr"
    folder = linpred.mitsuba.passes_of(clean)
    folder.mkdir()
    (folder / "precious.txt").write_text("mine")
    for restart in (False, True):
        with pytest.raises(linpred.InputError, match="no loop has made it"):
            linpred.mitsuba.render(scene, clean, spp=4, restart=restart)
    (folder / "precious.txt").rename(tmp_path / "precious.txt")
    linpred.mitsuba.render(scene, clean, spp=4, keep=True)
    (tmp_path / "precious.txt").rename(folder / "precious.txt")
    linpred.mitsuba.render(scene, clean, spp=4, restart=True)
    assert [file.name for file in folder.iterdir()] == ["precious.txt"]


def test_no_file_is_written_over_another_of_the_loop(scene: Path, tmp_path: Path) -> None:
    clean, before = tmp_path / "clean.exr", scene.read_bytes()
    for output, noisy, words in ((scene, None, "is the scene"), (clean, scene, "is the scene"), (clean, clean, "is the output")):
        with pytest.raises(ValueError, match=words):
            linpred.mitsuba.render(scene, output, noisy=noisy, spp=4)
    assert scene.read_bytes() == before and not clean.exists()


def test_large_seeds_are_seeds_of_their_own(scene: Path, tmp_path: Path) -> None:
    pictures = []
    for seed in (2**31 - 1, 2**31, 2**32):
        linpred.mitsuba.render(scene, tmp_path / "clean.exr", spp=4, seed=seed)
        pictures.append((tmp_path / "clean.exr").read_bytes())
    assert len(set(pictures)) == 3


def test_another_filter_than_the_box_is_noted(mi: Any, scene: Path, tmp_path: Path) -> None:
    scene.write_text(SCENE.replace('rfilter type="box"', 'rfilter type="gaussian"'))
    done = linpred.mitsuba.render(mi.load_file(str(scene)), tmp_path / "clean.exr", spp=4)
    assert len(done.notes) == 1 and "GaussianFilter" in done.notes[0]


def test_without_mitsuba_a_sentence_says_so(tmp_path: Path) -> None:
    code = "import sys; sys.modules['mitsuba'] = None; from linpred.mitsuba.__main__ import main; sys.exit(main())"
    run = subprocess.run([sys.executable, "-c", code, "scene.xml", "-o", tmp_path / "clean.exr"], capture_output=True, text=True)
    assert run.returncode == 2 and "pip install 'linpred[mitsuba]'" in run.stderr, run.stderr


def test_totals_grow_by_what_a_step_is_worth() -> None:
    totals = [0.0]
    while totals[-1] < 60:
        totals.append(_loop.next_total(totals[-1]))
    assert totals[1:] == [4, 8, 12, 16, 24, 36, 54, 81]
