"""The extension in Blender without a window: built, installed as a user installs it, and run on renders of Cycles.

Needs the package `linpred`, and `bpy` and `OpenEXR` of PyPI. What is absent is said.
"""

from __future__ import annotations

import atexit
import importlib
import math
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

# where Blender keeps its extensions; read when bpy is imported
RESOURCES = tempfile.mkdtemp(prefix="linpred-blender-")
atexit.register(shutil.rmtree, RESOURCES, ignore_errors=True)
os.environ["BLENDER_USER_RESOURCES"] = RESOURCES

try:
    import bpy
    import linpred
    import numpy as np
    import OpenEXR
except ImportError as error:
    said = f"NOT TESTED: the Blender extension in Blender, as {error.name} is absent"
    # a warning, because pytest is silent about what it skips
    warnings.warn(said, stacklevel=1)
    pytest.skip(said, allow_module_level=True)

HERE = Path(__file__).parent
EXTENSION = "bl_ext.user_default.linpred"
SIZE = 80
COMBINED = [f"ViewLayer.Combined.{component}" for component in "RGB"]


def build(folder: Path, *wheels: Path) -> Path:
    """The archive that build.py writes."""
    command = [sys.executable, HERE / "build.py", "--output", folder, *wheels]
    told = subprocess.run(command, check=False, capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    assert "not validated" not in told.stderr
    return Path(told.stdout.splitlines()[0])


@pytest.fixture(scope="session")
def addon(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The installed extension."""
    archive = build(tmp_path_factory.mktemp("archive"))
    bpy.ops.extensions.package_install_files(filepath=str(archive), repo="user_default", enable_on_install=True)
    return importlib.import_module(EXTENSION)


@pytest.fixture
def scene(addon: ModuleType) -> bpy.types.Scene:
    """A small scene, nothing set that linpred asks for."""
    return new_scene()


def new_scene() -> bpy.types.Scene:
    """A ball and a cube on a floor under a large lamp, 16 samples."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=EXTENSION)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 16
    scene.cycles.use_adaptive_sampling = False
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    furnish(scene)
    return scene


def furnish(scene: bpy.types.Scene) -> None:
    """Objects, materials, lamp, sky and camera."""

    def material(colour: tuple[float, float, float]) -> None:
        made = bpy.data.materials.new("material")
        made.use_nodes = True
        made.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*colour, 1)
        bpy.context.object.data.materials.append(made)

    bpy.ops.mesh.primitive_plane_add(size=20)
    material((0.6, 0.6, 0.55))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1, location=(-1.2, 0, 1))
    bpy.ops.object.shade_smooth()
    material((0.7, 0.1, 0.08))
    bpy.ops.mesh.primitive_cube_add(size=1.4, location=(1.1, 0.3, 0.7), rotation=(0, 0, 0.5))
    material((0.1, 0.2, 0.7))
    bpy.ops.object.light_add(type="AREA", location=(3, -3, 5), rotation=(0.7, 0.5, 0))
    bpy.context.object.data.energy, bpy.context.object.data.size = 400, 4
    scene.world = bpy.data.worlds.new("sky")
    scene.world.color = (0.25, 0.3, 0.4)
    bpy.ops.object.camera_add(location=(0, -7.5, 3), rotation=(math.radians(75), 0, 0))
    scene.camera = bpy.context.object


@pytest.fixture(scope="session")
def reference(addon: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """The picture of `scene` with 1024 samples, of another seed."""
    scene = new_scene()
    scene.cycles.samples, scene.cycles.seed, scene.cycles.use_denoising = 1024, 4711, False
    bpy.ops.render.render()
    path = tmp_path_factory.mktemp("reference") / "reference.exr"
    save(scene, "Render Result", path)
    return colour(channels(path))


def multilayer(scene: bpy.types.Scene) -> None:
    """Output of the scene as the tests read it."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth, settings.exr_codec, settings.views_format = "32", "ZIP", "MULTIVIEW"


def save(scene: bpy.types.Scene, image: str, path: Path) -> None:
    """Writes an image of Blender by Blender."""
    multilayer(scene)
    try:
        bpy.data.images[image].save_render(str(path), scene=scene)
    except RuntimeError:  # views are split at the first attempt
        bpy.data.images[image].save_render(str(path), scene=scene)


def channels(path: Path) -> dict[str, np.ndarray]:
    """All channels of a file, by OpenEXR. Parts of 5.x name their view in an attribute, other views are in names."""
    read = {}
    for part in OpenEXR.File(str(path), separate_channels=True).parts:
        view = part.header.get("view", "left")
        read |= {name if view == "left" else f"{view}.{name}": channel.pixels for name, channel in part.channels.items()}
    return read


def colour(of: dict[str, np.ndarray]) -> np.ndarray:
    """The picture in the channels of a file."""
    return np.stack([of[name] for name in COMBINED], axis=-1).astype(float)


def error_of(picture: np.ndarray, reference: np.ndarray) -> float:
    """Relative mean squared error."""
    return float(np.mean((picture - reference) ** 2 / (reference**2 + 0.01)))


def output_settings(scene: bpy.types.Scene) -> dict[str, object]:
    """All that can be set of the output, and of films."""
    settings = scene.render.image_settings
    return {
        f"{owner.bl_rna.identifier}.{each.identifier}": getattr(owner, each.identifier)
        for owner in (settings, settings.linear_colorspace_settings, scene.render.ffmpeg)
        for each in owner.bl_rna.properties
        if each.type != "POINTER" and not each.is_readonly
    }


def left_in_temporary_folder() -> list[str]:
    """Files and folders of runs."""
    return [name for name in os.listdir(bpy.app.tempdir) if name.startswith("linpred")]


def render_frames(scene: bpy.types.Scene, folder: Path, last: int) -> None:
    """Frames 1 to `last` in `folder`, and the settings to denoise them."""
    scene.linpred.source = "FILES"
    bpy.ops.linpred.set_passes()
    scene.cycles.use_animated_seed = True
    scene.frame_start, scene.frame_end = 1, last
    scene.render.filepath = str(folder / "noisy.####.exr")
    bpy.ops.render.render(animation=True)
    scene.linpred.input = str(folder / "noisy.####.exr")
    scene.linpred.output = str(folder / "clean.####.exr")


def test_one_button_sets_what_linpred_reads_and_says_what_it_changed(scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]) -> None:
    layer, settings = scene.view_layers[0], scene.render.image_settings
    settings.file_format = "PNG"
    scene.cycles.use_denoising = True
    bpy.ops.linpred.set_passes()
    assert (layer.cycles.denoising_store_passes, layer.cycles.pass_debug_sample_count) == (True, True)
    assert not scene.cycles.use_denoising
    assert "Set: Denoising Data on, Sample Count on, Denoise off" in capfd.readouterr().out
    assert settings.file_format == "PNG", "the last render needs no file"

    scene.linpred.source = "FILES"
    settings.file_format = "OPEN_EXR"
    settings.exr_codec = "DWAA"
    bpy.ops.linpred.set_passes()
    assert (settings.file_format, settings.color_depth, settings.exr_codec) == ("OPEN_EXR_MULTILAYER", "32", "ZIP")
    capfd.readouterr()
    bpy.ops.linpred.set_passes()
    assert "All passes were set already" in capfd.readouterr().out


def test_the_last_render_denoised_is_closer_to_1024_samples(scene: bpy.types.Scene, reference: np.ndarray, tmp_path: Path) -> None:
    bpy.ops.linpred.set_passes()
    bpy.ops.render.render()
    scene.render.image_settings.file_format = "JPEG"
    scene.render.image_settings.color_management = "OVERRIDE"
    before = output_settings(scene)
    assert bpy.ops.linpred.denoise() == {"FINISHED"}
    assert output_settings(scene) == before
    assert left_in_temporary_folder() == []

    save(scene, "Render Result", tmp_path / "noisy.exr")
    save(scene, "linpred", tmp_path / "clean.exr")
    noisy, clean = channels(tmp_path / "noisy.exr"), channels(tmp_path / "clean.exr")
    gain = error_of(colour(noisy), reference) / error_of(colour(clean), reference)
    kept = colour(clean).mean() / colour(noisy).mean()
    print(f"gain {gain:.2f}, mean {kept:.5f} of the noisy one's")
    # 4.5 measured; a reference that was denoised, or was the input, would be far beyond
    assert 3 < gain < 12
    assert abs(kept - 1) < 0.003
    # alpha is 1 everywhere
    assert noisy.keys() == clean.keys()
    for name in noisy.keys() - COMBINED:
        assert np.array_equal(noisy[name], clean[name]), name


def test_the_image_that_blender_has_is_what_linpred_wrote(scene: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = tmp_path / "written.exr"

    def denoise_file(*, input: str, output: str, **arguments: object) -> None:
        # compared with a render that Blender wrote under the tests' own settings
        shutil.copy(input, tmp_path / "input.exr")
        original(input, output, **arguments)
        shutil.copy(output, written)

    original = linpred.denoise_file
    monkeypatch.setattr(linpred, "denoise_file", denoise_file)
    bpy.ops.linpred.set_passes()
    bpy.ops.render.render()
    save(scene, "Render Result", tmp_path / "render.exr")
    # what a user may have set for files must change neither radiance nor precision
    settings = scene.render.image_settings
    settings.color_depth, settings.color_management = "16", "OVERRIDE"
    settings.linear_colorspace_settings.name = "ACEScg"
    bpy.ops.linpred.denoise()
    settings.color_management = "FOLLOW_SCENE"
    save(scene, "linpred", tmp_path / "image.exr")
    for one, other in (("render.exr", "input.exr"), ("written.exr", "image.exr")):
        one, other = channels(tmp_path / one), channels(tmp_path / other)
        assert one.keys() == other.keys()
        assert all(np.array_equal(one[name], other[name]) for name in one)


def test_every_output_setting_is_as_before_after_the_render_was_saved(scene: bpy.types.Scene, addon: ModuleType, tmp_path: Path) -> None:
    settings = scene.render.image_settings
    scene.render.resolution_x = scene.render.resolution_y = 16
    bpy.ops.render.render()
    tried = 0
    for media in ("IMAGE", "MULTI_LAYER_IMAGE", "VIDEO") if hasattr(settings, "media_type") else (None,):
        if media is not None:
            settings.media_type = media
        for kind in settings.bl_rna.properties["file_format"].enum_items:
            try:
                settings.file_format = kind.identifier
            except TypeError:  # not of this media type
                continue
            settings.quality, settings.color_management = 71, "OVERRIDE"
            settings.linear_colorspace_settings.name = "ACEScg"
            before = output_settings(scene)
            importlib.import_module(f"{EXTENSION}.passes").save_last_render(scene, str(tmp_path / "render.exr"))
            assert output_settings(scene) == before, (media, kind.identifier)
            tried += 1
    assert tried > 10


def test_a_sequence_is_denoised_from_disk_to_disk(
    scene: bpy.types.Scene, reference: np.ndarray, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    render_frames(scene, tmp_path, last=2)
    scene.frame_end = 4
    assert bpy.ops.linpred.denoise() == {"FINISHED"}
    told = capfd.readouterr().out
    assert "2 frames of the scene's range are not on disk" in told
    assert "Done: 2 frames" in told
    for frame in (1, 2):
        noisy, clean = (channels(tmp_path / f"{name}.000{frame}.exr") for name in ("noisy", "clean"))
        gain = error_of(colour(noisy), reference) / error_of(colour(clean), reference)
        print(f"frame {frame}: gain {gain:.2f}")
        assert 3 < gain < 12
        assert all(np.array_equal(noisy[name], clean[name]) for name in noisy.keys() - COMBINED)
    image = bpy.data.images["linpred"]
    assert image.source == "SEQUENCE"
    assert image.packed_file is None
    assert Path(bpy.path.abspath(image.filepath)) == tmp_path / "clean.0001.exr"


def test_what_the_settings_say_reaches_linpred(scene: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(linpred, "denoise_file", lambda **arguments: asked.append(arguments))
    (tmp_path / "noisy.exr").touch()
    scene.linpred.source = "FILES"
    scene.linpred.input, scene.linpred.output = str(tmp_path / "noisy.exr"), str(tmp_path / "clean.exr")
    with pytest.raises(RuntimeError, match="^Error: The denoised file could not be loaded: Cannot read"):
        bpy.ops.linpred.denoise()
    scene.linpred.quality, scene.linpred.error_layer, scene.linpred.skip_existing = "fast", True, True
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    with pytest.raises(RuntimeError, match="^Error: The denoised file could not be loaded: Cannot read"):
        bpy.ops.linpred.denoise()
    files = {"input": scene.linpred.input, "output": scene.linpred.output}
    for arguments in asked:
        del arguments["progress"]
    assert asked == [
        {**files, "quality": "balanced", "error_layer": False, "skip_existing": False, "threads": None},
        {**files, "quality": "fast", "error_layer": True, "skip_existing": True, "threads": 1},
    ]


def test_a_frame_that_fails_does_not_stop_the_others_and_is_told(scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene.cycles.samples = 1
    render_frames(scene, tmp_path, last=3)
    (tmp_path / "noisy.0001.exr").write_bytes(b"no picture")
    with pytest.raises(RuntimeError, match="^Error: 1 of 3 frames failed. .*noisy.0001.exr: not an EXR file[^\n]*\n$"):
        bpy.ops.linpred.denoise()
    assert sorted(path.name for path in tmp_path.glob("clean*")) == ["clean.0002.exr", "clean.0003.exr"]
    assert bpy.path.basename(bpy.data.images["linpred"].filepath) == "clean.0002.exr"


def test_frames_whose_output_is_there_are_left_alone_when_asked(scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene.cycles.samples = 1
    render_frames(scene, tmp_path, last=2)
    (tmp_path / "clean.0001.exr").write_bytes(b"kept")
    scene.linpred.skip_existing = True
    bpy.ops.linpred.denoise()
    assert (tmp_path / "clean.0001.exr").read_bytes() == b"kept"
    assert COMBINED[0] in channels(tmp_path / "clean.0002.exr")


def test_all_view_layers_and_views_are_denoised_in_one_run(
    scene: bpy.types.Scene, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scene.view_layers.new("second")
    scene.render.use_multiview = True
    scene.cycles.samples = 4
    composite(scene)
    scene.linpred.error_layer = True
    bpy.ops.linpred.set_passes()
    bpy.ops.render.render()
    capfd.readouterr()
    bpy.ops.linpred.denoise()
    assert "The compositor's picture is denoised too, without features" in capfd.readouterr().out
    save(scene, "Render Result", tmp_path / "noisy.exr")
    save(scene, "linpred", tmp_path / "clean.exr")
    noisy, clean = channels(tmp_path / "noisy.exr"), channels(tmp_path / "clean.exr")
    changed = {name.rpartition(".")[0] for name in noisy if not np.array_equal(noisy[name], clean[name])}
    pictures = {name.rpartition(".")[0] for name in noisy if re.search(r"Combined\..*R$", name)}
    assert len(pictures) == 6, "two layers and the compositor's, of two views"
    assert changed == pictures
    # Blender keeps one letter of a channel's name: linpred.error comes as linpred.X
    assert any("linpred" in name for name in clean.keys() - noisy.keys())


def composite(scene: bpy.types.Scene) -> None:
    """Switches on a compositor that passes the first view layer on."""
    if bpy.app.version < (5, 0):
        scene.use_nodes = True
        return
    tree = bpy.data.node_groups.new("compositor", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    tree.links.new(tree.nodes.new("CompositorNodeRLayers").outputs["Image"], tree.nodes.new("NodeGroupOutput").inputs[0])
    scene.compositing_node_group = tree


def test_the_next_result_takes_the_place_of_the_last_but_not_of_a_renamed_or_foreign_one(scene: bpy.types.Scene) -> None:
    scene.cycles.samples = 1
    bpy.ops.linpred.set_passes()
    bpy.ops.render.render()
    foreign = bpy.data.images.new("linpred", 4, 4)
    bpy.ops.linpred.denoise()
    assert bpy.data.images["linpred"] == foreign
    foreign.name = "mine"
    bpy.data.images["linpred.001"].name = "kept"
    editor = image_editor()
    editor.image = None
    for _ in range(2):
        bpy.ops.linpred.denoise()
        assert editor.image == bpy.data.images["linpred"]
    bpy.ops.object.empty_add(type="IMAGE")
    user = bpy.context.object
    user.data = bpy.data.images["linpred"]
    bpy.ops.linpred.denoise()
    assert user.data == bpy.data.images["linpred"], "what showed the result shows the new one"
    assert sorted(image.name for image in bpy.data.images if image.type != "RENDER_RESULT" and image.source == "FILE") == [
        "kept",
        "linpred",
    ]


def image_editor() -> bpy.types.SpaceImageEditor:
    """An image editor in the window that Blender has without showing it."""
    area = bpy.context.window_manager.windows[0].screen.areas[0]
    area.ui_type = "IMAGE_EDITOR"
    return area.spaces.active


def cancel_at_first_row(addon: ModuleType, monkeypatch: pytest.MonkeyPatch, of_file: int) -> None:
    """Has linpred's own progress meet a user who cancels."""
    operators, original, files = importlib.import_module(f"{EXTENSION}.operators"), linpred.denoise_file, []

    def denoise_file(*, progress: Callable[[int, int], None], **arguments: object) -> None:
        def told(done_rows: int, all_rows: int) -> None:
            if len(files) == of_file:
                operators.current.job.cancel()
            progress(done_rows, all_rows)

        files.append(arguments)
        original(**arguments, progress=told)

    monkeypatch.setattr(linpred, "denoise_file", denoise_file)


def test_cancelling_leaves_nothing_behind(
    scene: bpy.types.Scene, addon: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.cycles.samples = 1
    # rows enough that linpred is not done before it can be told
    scene.render.resolution_x = scene.render.resolution_y = 5 * SIZE
    scene.linpred.quality = "high"
    render_frames(scene, tmp_path, last=3)
    cancel_at_first_row(addon, monkeypatch, of_file=2)
    with pytest.raises(RuntimeError, match="^Error: Cancelled; 1 of 3 frames are done\n$"):
        bpy.ops.linpred.denoise()
    assert sorted(path.name for path in tmp_path.glob("*")) == [
        "clean.0001.exr",
        "noisy.0001.exr",
        "noisy.0002.exr",
        "noisy.0003.exr",
    ]
    scene.linpred.source = "LAST_RENDER"
    monkeypatch.undo()
    cancel_at_first_row(addon, monkeypatch, of_file=1)
    bpy.ops.render.render()
    with pytest.raises(RuntimeError, match="^Error: Cancelled\n$"):
        bpy.ops.linpred.denoise()
    assert left_in_temporary_folder() == []
    assert "linpred" not in bpy.data.images
    assert importlib.import_module(f"{EXTENSION}.operators").current is None


def test_ctrl_c_cancels_a_script_s_run(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    kind = importlib.import_module(f"{EXTENSION}.job").Job
    original, waits = kind.wait, []

    def wait(job: object, seconds: float | None = None) -> bool:
        waits.append(seconds)
        if len(waits) == 1:
            raise KeyboardInterrupt
        return original(job, seconds)

    bpy.ops.linpred.set_passes()
    scene.render.resolution_x = scene.render.resolution_y = 5 * SIZE
    scene.linpred.quality, scene.cycles.samples = "high", 1
    bpy.ops.render.render()
    monkeypatch.setattr(kind, "wait", wait)
    with pytest.raises(RuntimeError, match="^Error: Cancelled\n$"):
        bpy.ops.linpred.denoise()
    assert len(waits) == 2, "the run has ended"
    assert left_in_temporary_folder() == []


def refused(scene: bpy.types.Scene) -> Iterator[tuple[str, str]]:
    """What a user may do wrong, and the sentence that is told."""
    yield "no render", "There is no render of Scene yet: render first"
    scene.linpred.source = "FILES"
    yield "no input", "Choose the input file first"
    scene.linpred.input = __file__
    yield "no output", "Choose the output file first"
    scene.linpred.output = os.path.join(RESOURCES, "clean.exr")
    yield "not an EXR file", "not an EXR file"
    scene.linpred.input = os.path.join(RESOURCES, "absent.exr")
    yield "an absent file", "absent.exr"
    scene.linpred.input = os.path.join(RESOURCES, "absent.####.exr")
    yield "an absent sequence", "No frame from 1 to 250 of .*absent.####.exr is on disk"


def test_every_failure_is_a_sentence(scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]) -> None:
    for what, sentence in refused(scene):
        with pytest.raises(RuntimeError, match=f"^Error: .*{sentence}.*\n$"):
            bpy.ops.linpred.denoise()
        assert left_in_temporary_folder() == [], what
        assert not os.path.exists(os.path.join(RESOURCES, "clean.exr")), what
    assert "Traceback" not in "".join(capfd.readouterr())


def test_without_cycles_or_the_package_the_user_is_told(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.render.engine = "BLENDER_WORKBENCH"
    with pytest.raises(RuntimeError, match="^Error: linpred needs passes of Cycles: set the render engine to Cycles first\n$"):
        bpy.ops.linpred.set_passes()
    monkeypatch.setitem(sys.modules, "linpred", None)
    with pytest.raises(RuntimeError, match="^Error: The Python package linpred is missing from this extension"):
        bpy.ops.linpred.denoise()


class Window:
    """What `invoke` and `modal` ask of Blender's windows, of which there are none without a display."""

    def __init__(self) -> None:
        self.windows, self.timers, self.handlers, self.progress = [], 0, 0, []

    def event_timer_add(self, _seconds: float, *, window: object) -> str:
        self.timers += 1
        return "timer"

    def event_timer_remove(self, timer: str) -> None:
        assert timer == "timer"
        self.timers -= 1

    def modal_handler_add(self, _operator: object) -> None:
        self.handlers += 1

    def progress_begin(self, low: float, high: float) -> None:
        assert (low, high) == (0, 1)

    def progress_update(self, fraction: float) -> None:
        self.progress.append(fraction)

    def progress_end(self) -> None:
        self.progress.append("end")


class Button:
    """The operator as Blender runs it for a button: its own methods, on events that are made up."""

    def __init__(self, scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
        self.operators = importlib.import_module(f"{EXTENSION}.operators")
        self.manager, self.told = Window(), []
        self.context = SimpleNamespace(scene=scene, window_manager=self.manager, window=None, area=None)
        kind = self.operators.LINPRED_OT_denoise
        self.operator = SimpleNamespace(report=lambda level, text: self.told.append((*level, text)))
        self.operator.leave = lambda context: kind.leave(self.operator, context)
        self.methods = kind
        monkeypatch.setattr(self.operators, "bpy", SimpleNamespace(**{**vars(bpy), "app": self.shown()}))

    @staticmethod
    def shown() -> SimpleNamespace:
        """`bpy.app` of a Blender with windows."""
        return SimpleNamespace(background=False, tempdir=bpy.app.tempdir, is_job_running=bpy.app.is_job_running)

    def press(self) -> set[str]:
        return self.methods.invoke(self.operator, self.context, None)

    def event(self, kind: str, value: str = "NOTHING") -> set[str]:
        return self.methods.modal(self.operator, self.context, SimpleNamespace(type=kind, value=value))


@pytest.fixture
def button(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> Button:
    """A rendered scene, and the button."""
    scene.cycles.samples = 1
    bpy.ops.linpred.set_passes()
    bpy.ops.render.render()
    return Button(scene, monkeypatch)


def test_the_button_returns_at_once_and_the_timer_ends_the_run(button: Button) -> None:
    assert button.press() == {"RUNNING_MODAL"}
    assert (button.manager.timers, button.manager.handlers) == (1, 1)
    assert not bpy.ops.linpred.denoise.poll(), "one run at a time"
    assert button.event("MOUSEMOVE") == {"PASS_THROUGH"}, "Blender stays usable"
    assert button.operators.current.job.wait(60)
    assert button.event("TIMER") == {"FINISHED"}
    assert button.told == [("INFO", "Done")]
    assert button.manager.timers == 0
    assert button.manager.progress == [1, "end"]
    assert "linpred" in bpy.data.images
    assert bpy.ops.linpred.denoise.poll()


def test_escape_cancels_and_leaves_nothing_behind(button: Button, monkeypatch: pytest.MonkeyPatch) -> None:
    wait_for_escape(button, monkeypatch)
    button.press()
    assert button.event("TIMER") == {"PASS_THROUGH"}
    assert button.event("ESC", "RELEASE") == {"PASS_THROUGH"}
    assert button.event("ESC", "PRESS") == {"RUNNING_MODAL"}
    assert button.operators.current.job.wait(60)
    assert button.event("TIMER") == {"CANCELLED"}
    assert button.told == [("INFO", "Cancelled")]
    assert button.manager.timers == 0
    assert left_in_temporary_folder() == []
    assert "linpred" not in bpy.data.images


def wait_for_escape(button: Button, monkeypatch: pytest.MonkeyPatch) -> None:
    """Has linpred stand still at its first row until the run is cancelled."""
    original = linpred.denoise_file

    def denoise_file(*, progress: Callable[[int, int], None], **arguments: object) -> None:
        def told(done_rows: int, all_rows: int) -> None:
            assert run.job._stop.wait(60)
            progress(done_rows, all_rows)

        run = button.operators.current
        original(**arguments, progress=told)

    monkeypatch.setattr(linpred, "denoise_file", denoise_file)


def test_another_file_or_switching_off_ends_the_run(button: Button, monkeypatch: pytest.MonkeyPatch) -> None:
    wait_for_escape(button, monkeypatch)
    button.press()
    job = button.operators.current.job
    button.methods.cancel(button.operator, button.context)
    assert job.wait(0), "nothing runs on"
    assert (button.operators.current, button.manager.timers, left_in_temporary_folder()) == (None, 0, [])

    button.press()
    job = button.operators.current.job
    bpy.ops.preferences.addon_disable(module=EXTENSION)
    assert job.wait(0)
    assert (button.operators.current, left_in_temporary_folder()) == (None, [])
    assert button.event("TIMER") == {"CANCELLED"}
    assert button.manager.timers == 0


def test_a_button_that_cannot_start_says_why(button: Button) -> None:
    button.context.scene.linpred.source = "FILES"
    assert button.press() == {"CANCELLED"}
    assert button.told == [("ERROR", "Choose the input file first")]
    assert (button.manager.timers, button.manager.progress) == (0, [])


class Layout:
    """Keeps what a panel draws, and refuses what Blender's own would."""

    def __init__(self) -> None:
        self.drawn = []

    def prop(self, owner: bpy.types.bpy_struct, name: str) -> None:
        assert name in owner.bl_rna.properties
        self.drawn.append(name)

    def label(self, **given: str) -> None:
        self.check("label", given)
        self.drawn.append(given["text"])

    def operator(self, name: str, **given: str) -> None:
        self.check("operator", given)
        self.drawn.append(name)

    def progress(self, **given: object) -> None:
        self.check("progress", given)
        self.drawn.append((given["factor"], given["text"]))

    @staticmethod
    def check(function: str, given: dict[str, object]) -> None:
        known = bpy.types.UILayout.bl_rna.functions[function].parameters
        assert given.keys() <= set(known.keys())
        assert "icon" not in given or given["icon"] in known["icon"].enum_items


def draw(scene: bpy.types.Scene) -> list[object]:
    """What the panel shows."""
    panel = SimpleNamespace(layout=Layout())
    importlib.import_module(f"{EXTENSION}.panel").IMAGE_PT_linpred.draw(panel, SimpleNamespace(scene=scene))
    return panel.layout.drawn


def test_the_panel_shows_what_the_source_asks_for_and_what_is_missing(scene: bpy.types.Scene) -> None:
    shown = ["source", "quality", "error_layer", "Denoising Data is off", "linpred.set_passes", "linpred.denoise"]
    assert draw(scene) == shown
    bpy.ops.linpred.set_passes()
    shown.remove("Denoising Data is off")
    assert draw(scene) == shown
    scene.linpred.source = "FILES"
    assert draw(scene) == [shown[0], "input", "output", "skip_existing", "Frames 1 to 250 of the scene", *shown[1:]]


def test_the_panel_shows_how_far_a_run_is_in_place_of_the_button(button: Button, monkeypatch: pytest.MonkeyPatch) -> None:
    wait_for_escape(button, monkeypatch)
    button.press()
    assert draw(button.context.scene)[-1] == (0, "Last render (Esc cancels)")
    assert "linpred.denoise" not in draw(button.context.scene)
    button.operators.stop()


def test_the_example_of_the_page_runs_as_it_is(addon: ModuleType, tmp_path: Path) -> None:
    example = re.search(r"```python\n(.*?)```", (HERE / "README.md").read_text(), re.DOTALL)[1]
    (tmp_path / "example.py").write_text(example)
    told = subprocess.run([sys.executable, "example.py"], cwd=tmp_path, check=False, capture_output=True, text=True, timeout=300)
    assert told.returncode == 0, told.stderr
    written = {path.name for path in (tmp_path / "shot").glob("*.exr")}
    assert written == {"noisy.0001.exr", "noisy.0002.exr", "clean.0001.exr", "clean.0002.exr", "still.exr"}
    assert "Traceback" not in told.stderr


def probe(folder: Path, version: str) -> Path:
    """A wheel for this platform with an empty module `linpred_probe`."""
    tag = f"cp38-abi3-{re.sub(r'[-.]', '_', sysconfig.get_platform())}"
    wheel = folder / f"linpred_probe-{version}-{tag}.whl"
    about = f"linpred_probe-{version}.dist-info"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("linpred_probe.py", "")
        archive.writestr(f"{about}/METADATA", f"Metadata-Version: 2.1\nName: linpred-probe\nVersion: {version}\n")
        archive.writestr(f"{about}/WHEEL", f"Wheel-Version: 1.0\nRoot-Is-Purelib: false\nTag: {tag}\n")
        archive.writestr(f"{about}/RECORD", "linpred_probe.py,,\n")
    return wheel


def test_the_same_files_make_the_same_archive_and_its_wheels_are_installed(tmp_path: Path) -> None:
    wheel = probe(tmp_path, re.search(r'^version = "(.*)"', (HERE / "extension/blender_manifest.toml").read_text(), re.MULTILINE)[1])
    with pytest.raises(AssertionError, match="is not of version"):
        build(tmp_path, probe(tmp_path, "99.0"))
    folders = [tmp_path / name for name in ("one", "other")]
    for folder in folders:
        folder.mkdir()
    one, other = (build(folder, wheel) for folder in folders)
    assert one.read_bytes() == other.read_bytes()
    bpy.ops.extensions.package_install_files(filepath=str(one), repo="user_default", enable_on_install=True)
    importlib.invalidate_caches()
    assert importlib.import_module("linpred_probe").__file__.startswith(RESOURCES)
