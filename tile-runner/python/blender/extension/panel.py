"""The panel: a tab in the sidebar of the image editor, where renders are looked at."""

from __future__ import annotations

import bpy

from . import operators, passes


class IMAGE_PT_linpred(bpy.types.Panel):
    """linpred's tab."""

    bl_label = "Denoise"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "linpred"

    def draw(self, context: bpy.types.Context) -> None:
        """Called by Blender whenever the editor is drawn."""
        layout, scene = self.layout, context.scene
        settings = scene.linpred
        layout.use_property_split = True
        layout.use_property_decorate = False

        layout.prop(settings, "source")
        if settings.source == "FILES":
            layout.prop(settings, "input")
            layout.prop(settings, "output")
            layout.prop(settings, "skip_existing")
            layout.label(text=f"Frames {scene.frame_start} to {scene.frame_end} of the scene")
        layout.prop(settings, "quality")
        layout.prop(settings, "error_layer")

        if passes.lacks_passes(scene):
            layout.label(text="Denoising Data is off", icon="INFO")
        layout.operator("linpred.set_passes", icon="RENDERLAYERS")
        run = operators.current
        if run is None:
            layout.operator("linpred.denoise", icon="SHADERFX")
        else:
            layout.progress(factor=run.job.fraction, text=f"{run.job.label} (Esc cancels)")
