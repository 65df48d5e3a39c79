"""Passes and output that linpred needs from Cycles, and the last render in a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

# in the others noise is changed or cannot be read back
LOSSLESS = {"NONE", "ZIP", "ZIPS", "PIZ", "RLE"}


class Refused(Exception):
    """What was asked for cannot be done; the message is a sentence for the user."""


def set_passes(scene: bpy.types.Scene, *, with_output: bool) -> list[str]:
    """Switches on what linpred reads and Cycles' own denoiser off, and says what was changed; `with_output` also has files hold all of it."""
    if scene.render.engine != "CYCLES":
        raise Refused("linpred needs passes of Cycles: set the render engine to Cycles first")
    changes = []

    def put(owner: object, name: str, value: object, what: str) -> None:
        if getattr(owner, name) != value:
            setattr(owner, name, value)
            changes.append(what)

    for layer in scene.view_layers:
        where = f" in {layer.name}" if len(scene.view_layers) > 1 else ""
        put(layer, "use_pass_combined", True, f"Combined on{where}")
        put(layer.cycles, "denoising_store_passes", True, f"Denoising Data on{where}")
        put(layer.cycles, "pass_debug_sample_count", True, f"Sample Count on{where}")
    put(scene.cycles, "use_denoising", False, "Denoise off")
    if with_output:
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):  # since 5.0, which offers the format only under this
            put(settings, "media_type", "MULTI_LAYER_IMAGE", "Media Type Multi-Layer EXR")
        put(settings, "file_format", "OPEN_EXR_MULTILAYER", "OpenEXR MultiLayer")
        put(settings, "color_depth", "32", "Float (Full)")
        if settings.exr_codec not in LOSSLESS:
            put(settings, "exr_codec", "ZIP", "Codec ZIP")
    return changes


def lacks_passes(scene: bpy.types.Scene) -> bool:
    """Whether a render would lack features, so that the panel can say it before time is spent."""
    return scene.render.engine == "CYCLES" and not all(layer.cycles.denoising_store_passes for layer in scene.view_layers if layer.use)


def save_last_render(scene: bpy.types.Scene, path: str) -> None:
    """Writes the last render of the scene with all passes, layers and views into an EXR file."""
    result = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
    nothing = f"There is no render of {scene.name} yet: render first"
    if result is None:
        raise Refused(nothing)
    with _multilayer(scene.render.image_settings):
        try:
            _save(result, scene, path)
        except RuntimeError as error:
            if "does not have any image data" in str(error):
                raise Refused(nothing) from error
            raise Refused(f"The render could not be written: {told(error)}") from error


def _save(result: bpy.types.Image, scene: bpy.types.Scene, path: str) -> None:
    """Blender sees that a render has several views only once it has read it: the first attempt splits the views, and fails with that."""
    try:
        result.save_render(path, scene=scene)
    except RuntimeError:
        if not scene.render.use_multiview:
            raise
        result.save_render(path, scene=scene)


def holds_composite(path: str) -> bool:
    """Whether the compositor's picture lies beside the view layers of a file: it has no features of its own."""
    with open(path, "rb") as file:
        # names of channels stand in the header
        return b"Composite.Combined" in file.read(1 << 16)


@contextmanager
def _multilayer(settings: bpy.types.ImageFormatSettings) -> Iterator[None]:
    """Blender writes a render as the scene's output is set up, and knows no other way to ask for passes: set up, and put back."""
    names = [each.identifier for each in settings.bl_rna.properties if each.type != "POINTER" and not each.is_readonly]
    # the format decides which values the others can take, and the media type which formats
    names.sort(key=lambda name: (name != "media_type", name != "file_format", name != "color_mode"))
    before = {name: getattr(settings, name) for name in names}
    # of the user's only where it counts; a new format resets it
    space = settings.linear_colorspace_settings.name if settings.color_management == "OVERRIDE" else ""
    try:
        if "media_type" in before:
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format = "OPEN_EXR_MULTILAYER"
        settings.color_depth = "32"
        settings.exr_codec = "ZIP"
        # all views in one file: Blender splits the others and then reports a failure
        settings.views_format = "MULTIVIEW"
        # radiance as rendered, whatever the output is converted to
        settings.color_management = "FOLLOW_SCENE"
        yield
    finally:
        for name, value in before.items():
            # a value that the format does not offer reads as ""; nothing here changed it then
            if value != "":
                setattr(settings, name, value)
        if space != "":
            settings.linear_colorspace_settings.name = space


def told(error: RuntimeError) -> str:
    """Blender's own words without their label."""
    return str(error).removeprefix("Error: ").strip()
