"""linpred for Blender: denoises the last render or renders on disk, and shows the result in the image editor."""

from __future__ import annotations

import bpy

from . import operators, panel, settings

CLASSES = (settings.LinpredSettings, *operators.CLASSES, panel.IMAGE_PT_linpred)


def register() -> None:
    """Called by Blender when the extension is switched on."""
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Scene.linpred = bpy.props.PointerProperty(type=settings.LinpredSettings)


def unregister() -> None:
    """Called by Blender when the extension is switched off, and when Blender ends: no thread may outlive the code that it runs."""
    operators.stop()
    del bpy.types.Scene.linpred
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
