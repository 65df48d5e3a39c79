"""Frames in memory: the bits of the command line, whatever the arrays look like, and a sentence for what is none."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from conftest import SAMPLE, noise, read, same, small, stacked

import linpred


def test_the_installed_package_is_tested() -> None:
    assert "site-packages" in linpred.__file__


@pytest.mark.parametrize("quality", ["fast", "balanced"])
def test_arrays_get_the_bits_of_the_file_they_came_from(sample: dict, quality: str, tmp_path: Path) -> None:
    clean = linpred.denoise(**sample, quality=quality)
    linpred.denoise_file(SAMPLE, tmp_path / "clean.exr", quality=quality, error_layer=True, models_layer=True)
    channels = read(tmp_path / "clean.exr")
    assert same(clean.colour, stacked(channels, "", "RGB"))
    assert same(clean.error, channels["linpred.error"])
    assert same(clean.radius, channels["linpred.radius"])
    assert same(clean.rank, channels["linpred.rank"])
    assert not same(clean.colour, sample["colour"])


def test_halves_get_the_bits_of_a_file_of_two_halves(sample: dict, tmp_path: Path) -> None:
    channels = read(SAMPLE)
    a, b = (stacked(channels, half, "RGB") for half in ("halfA", "halfB"))
    features = {name: sample[name] for name in sample if name not in ("colour", "variance")}
    clean = linpred.denoise(sample["colour"], halves=(a, b), **features, quality="fast")
    linpred.denoise_file(SAMPLE, tmp_path / "clean.exr", quality="fast", map={"half-a": "halfA", "half-b": "halfB", "variance": "none"})
    assert same(clean.colour, stacked(read(tmp_path / "clean.exr"), "", "RGB"))


def test_threads_change_no_bit() -> None:
    frame = small(64, 40)
    one, two = (linpred.denoise(**frame, threads=threads) for threads in (1, 2))
    assert same(one.colour, two.colour)
    assert same(one.error, two.error)


def changed(name: str) -> dict:
    """Arrays of the same values that lie otherwise in memory."""
    frame = small()
    if name == "backwards":
        return {key: np.ascontiguousarray(array[::-1, ::-1])[::-1, ::-1] for key, array in frame.items()}
    if name == "planar":
        return {key: np.asfortranarray(array) for key, array in frame.items()}
    if name == "gaps":
        return {key: np.repeat(np.repeat(array, 2, 0), 3, 1)[::2, ::3] for key, array in frame.items()}
    if name == "float64":
        return {key: array.astype(np.float64) for key, array in frame.items()}
    if name == "float16":
        return {key: array.astype(np.float16) for key, array in frame.items()}
    if name == "foreign bytes":
        return {key: array.astype(array.dtype.newbyteorder()) for key, array in frame.items()}
    if name == "unaligned":
        return {key: np.frombuffer(b"\0" + array.tobytes(), np.uint8)[1:].view(array.dtype).reshape(array.shape) for key, array in frame.items()}
    if name == "fields of records":
        record = np.dtype([("tag", np.uint8), ("pixel", np.float32)])
        records = {key: np.zeros(array.shape, record) for key, array in frame.items()}
        for key, array in frame.items():
            records[key]["pixel"] = array
        return {key: array["pixel"] for key, array in records.items()}
    if name == "lists":
        return {key: array.astype(np.float64).tolist() for key, array in frame.items()}
    if name == "read-only":
        for array in frame.values():
            array.setflags(write=False)
        return frame
    if name == "depth of three dimensions":
        return {**frame, "depth": frame["depth"][..., np.newaxis]}
    if name == "features by name":
        normal, albedo, depth = (frame.pop(name) for name in ("normal", "albedo", "depth"))
        return {**frame, "depth": depth, "features": {"normal": normal, "albedo": albedo}}
    raise AssertionError(name)


LAYOUTS = (
    "backwards",
    "planar",
    "gaps",
    "float64",
    "float16",
    "foreign bytes",
    "unaligned",
    "fields of records",
    "lists",
    "read-only",
    "depth of three dimensions",
    "features by name",
)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_how_an_array_lies_in_memory_changes_no_bit(layout: str) -> None:
    plain, other = linpred.denoise(**small()), linpred.denoise(**changed(layout))
    assert same(plain.colour, other.colour)
    assert same(plain.alpha, other.alpha)


def test_arrays_are_not_written_to() -> None:
    frame = small()
    before = {name: array.tobytes() for name, array in frame.items()}
    linpred.denoise(**frame)
    assert before == {name: array.tobytes() for name, array in frame.items()}


def test_every_array_has_its_effect() -> None:
    frame = small(60, 60)
    plain = linpred.denoise(**frame).colour
    for name in ("variance", "albedo", "normal", "depth"):
        fewer = {key: array for key, array in frame.items() if key != name}
        assert not same(linpred.denoise(**fewer).colour, plain), name
    more = dict(albedo_variance="albedo", normal_variance="normal", depth_variance="depth")
    for name, feature in more.items():
        variance = np.full(frame[feature].shape, 0.25, np.float32)
        assert not same(linpred.denoise(**frame, **{name: variance}).colour, plain), name
        pair = {**frame, "features": {feature: (frame[feature], variance)}}
        del pair[feature]
        assert same(linpred.denoise(**pair).colour, linpred.denoise(**frame, **{name: variance}).colour)


def test_layers_still_sum_up_and_keep_their_names() -> None:
    frame = small(48, 64)
    layers = {"diffuse": 0.75 * frame["colour"], "specular": 0.25 * frame["colour"]}
    clean = linpred.denoise(**frame, layers=layers, scalars={"mask": frame["depth"]})
    assert list(clean.layers) == ["diffuse", "specular"]
    np.testing.assert_allclose(clean.layers["diffuse"] + clean.layers["specular"], clean.colour, rtol=1e-5)
    assert clean.scalars["mask"].shape == (48, 64)
    assert not same(clean.scalars["mask"], clean.alpha)


def test_a_pixel_that_is_not_finite_is_repaired_and_counted() -> None:
    frame = small(48, 64)
    frame["colour"][20, 30] = np.nan
    frame["colour"][40, 10, 1] = np.inf
    clean = linpred.denoise(**frame)
    assert clean.report.repaired == 2
    assert np.isfinite(clean.colour).all()
    assert 0.2 < clean.colour[20, 30].mean() < 0.8


def test_a_pixel_without_noise_comes_out_as_it_is() -> None:
    frame = small(48, 64)
    frame["variance"][:] = 0.0
    clean = linpred.denoise(**frame)
    assert same(clean.colour, frame["colour"])
    assert clean.report.passed_through == clean.report.pixels == 48 * 64


NONE = np.zeros((24, 30, 3), np.float32)
WRONG = {
    "colour: shape (24, 30), but it is (height, width, 3)": dict(colour=NONE[..., 0]),
    "colour: shape (24, 30, 4), but it is (height, width, 3); alpha has an argument of its own": dict(colour=np.zeros((24, 30, 4))),
    "colour: shape (0, 30, 3) holds no pixel": dict(colour=NONE[:0]),
    "colour: shape (24, 0, 3) holds no pixel": dict(colour=NONE[:, :0]),
    "albedo: shape (30, 24, 3), but the colour has 24 x 30 pixels (height x width)": dict(colour=NONE, albedo=NONE.swapaxes(0, 1)),
    "depth: shape (24, 30, 3), but it is (height, width)": dict(colour=NONE, depth=NONE),
    "layers['glow']: shape (24, 30), but it is (height, width, 3)": dict(colour=NONE, layers={"glow": NONE[..., 0]}),
    "variance and halves both say what the noise is: give one of them": dict(colour=NONE, variance=NONE, halves=(NONE, NONE)),
    "halves: it is a pair of arrays, the means of either half of the samples": dict(colour=NONE, halves=(NONE,)),
    "normal is given twice: as an argument and in features": dict(colour=NONE, normal=NONE, features={"normal": NONE}),
    "depth_variance is given without depth": dict(colour=NONE, depth_variance=NONE[..., 0]),
    "quality \"best\": it is fast, balanced or high": dict(colour=NONE, quality="best"),
    "formulas \"new\": they are robust, literal or wlr": dict(colour=NONE, formulas="new"),
    "coverage 0: it is 1 to 1024 models": dict(colour=NONE, coverage=0),
    "coverage 70000: it is 1 to 1024 models": dict(colour=NONE, coverage=70000),
    "threads 0: it is 1 or more": dict(colour=NONE, threads=0),
    "coverage 2147483647: it is 1 to 1024 models": dict(colour=NONE, coverage=2**70),
}

OF_ANOTHER_TYPE = {
    "quality: None is of type NoneType; it is a string": dict(quality=None),
    "threads: '2' is of type str; it is a whole number": dict(threads="2"),
    "coverage: 3.5 is of type float; it is a whole number": dict(coverage=3.5),
    "layers: [1] is of type list; it is a mapping, such as a dictionary": dict(layers=[1]),
    "layers: name: 1 is of type int; it is a string": dict(layers={1: NONE}),
    "layers['a']: None is no array": dict(layers={"a": None}),
    "features: 'albedo' is of type str; it is a mapping, such as a dictionary": dict(features="albedo"),
    "albedo: dtype object, but it is float16, float32 or float64, as linear radiance is": dict(albedo=object()),
}


@pytest.mark.parametrize("sentence", OF_ANOTHER_TYPE)
def test_what_is_of_another_type_is_refused_by_its_name(sentence: str) -> None:
    with pytest.raises(TypeError) as refused:
        linpred.denoise(NONE, **OF_ANOTHER_TYPE[sentence])
    assert str(refused.value) == sentence


@pytest.mark.parametrize("sentence", WRONG)
def test_what_makes_no_sense_is_refused_with_a_sentence(sentence: str) -> None:
    with pytest.raises(ValueError) as refused:
        linpred.denoise(**WRONG[sentence])
    assert str(refused.value) == sentence


@pytest.mark.parametrize("dtype", ["uint8", "int32", "complex64", "bool", "object", "longdouble"])
def test_what_is_no_float_is_refused_with_its_type(dtype: str) -> None:
    with pytest.raises(TypeError, match="^albedo: dtype .*, but it is float16, float32 or float64"):
        linpred.denoise(NONE, albedo=NONE.astype(dtype))


def test_a_frame_that_no_memory_holds_is_refused() -> None:
    # one pixel, seen as many times
    wide = np.broadcast_to(np.zeros((1, 1, 3), np.float32), (1, 2**31 - 1, 3))
    with pytest.raises(MemoryError, match="^there is no memory for the output$"):
        linpred.denoise(wide)
    with pytest.raises(MemoryError, match="^the system does not give .* of memory"):
        next(linpred.denoise_rows([{"colour": wide[0]}], 1))


def test_progress_is_told_on_this_thread_and_ends_at_the_last_row() -> None:
    told = []
    linpred.denoise(**small(70, 30), progress=lambda done, of_all: told.append((done, of_all, threading.get_ident())))
    rows = [done for done, _, _ in told]
    assert rows == sorted(set(rows))
    assert rows[-1] == 70
    assert {(of_all, thread) for _, of_all, thread in told} == {(70, threading.get_ident())}


def test_a_bar_of_tqdm_fits() -> None:
    tqdm = pytest.importorskip("tqdm").tqdm
    with open(os.devnull, "w") as nowhere, tqdm(file=nowhere) as bar:
        linpred.denoise(**small(), progress=bar)
        assert (bar.n, bar.total) == (24, 24)
    with pytest.raises(TypeError, match="^progress: int is neither a function"):
        linpred.denoise(**small(), progress=3)


def test_what_progress_raises_ends_the_run() -> None:
    class OwnError(Exception):
        pass

    told = []

    def fail(done: int, of_all: int) -> None:
        told.append(done)
        raise OwnError

    with pytest.raises(OwnError):
        linpred.denoise(**small(300, 30), progress=fail)
    assert len(told) == 1


LONG_RUN = """
import signal
import numpy, linpred
# a shell that starts the tests in the background has it ignored
signal.signal(signal.SIGINT, signal.default_int_handler)
noisy = numpy.random.default_rng(1).uniform(size=(20000, 100, 3))
print("ready", flush=True)
try:
    linpred.denoise(noisy, quality="high", threads=1)
    print("ended")
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="NOT TESTED: no /proc tells when a run has begun")
def test_ctrl_c_stops_a_run_that_tells_nothing() -> None:
    with subprocess.Popen([sys.executable, "-c", LONG_RUN], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"

        def names() -> set[str]:
            found = set()
            for task in Path(f"/proc/{process.pid}/task").iterdir():
                # one that ends meanwhile has none
                with contextlib.suppress(OSError):
                    found.add((task / "comm").read_text())
            return found

        while "linpred compute\n" not in names():
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        assert process.stdout.read() == "interrupted\n"


DAEMON = """
import threading, time
import numpy, linpred
noisy, begun = numpy.ones((300, 300, 3), "f4"), threading.Event()
threading.Thread(target=lambda: linpred.denoise(noisy, progress=lambda *_: begun.set()), daemon=True).start()
begun.wait()
"""


def test_an_interpreter_ends_while_a_daemon_denoises() -> None:
    runs = [subprocess.Popen([sys.executable, "-c", DAEMON]) for _ in range(6)]
    assert [run.wait() for run in runs] == [0] * 6


def test_other_threads_run_meanwhile() -> None:
    counted, told = [0], []
    done = threading.Event()

    def count() -> None:
        while not done.is_set():
            counted[0] += 1

    counting = threading.Thread(target=count)
    counting.start()
    try:
        linpred.denoise(**small(300, 60), progress=lambda *_: told.append(counted[0]))
    finally:
        done.set()
        counting.join()
    assert told[-1] > told[0] + 1000


def resident() -> int:
    """Bytes of memory in use."""
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="NOT TESTED: no /proc tells the memory in use")
def test_a_thousand_calls_leave_memory_flat() -> None:
    frame = small(9, 9)
    frame["layers"] = {"one": frame["colour"]}

    def call(count: int) -> None:
        for _ in range(count):
            linpred.denoise(**frame, quality="fast", threads=1)
            with pytest.raises(ValueError):
                linpred.denoise(frame["colour"], albedo=NONE)

    call(200)
    before = resident()
    call(1000)
    # what a call takes and gives is 9 x 9 x 20 floats and more: were it kept, six times as much would show
    assert resident() - before < 1 << 20
