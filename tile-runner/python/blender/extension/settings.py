"""What a user can choose, kept in the scene: `scene.linpred`."""

import bpy

SOURCES = (
    ("LAST_RENDER", "Last Render", "The picture that was rendered last, with its passes"),
    ("FILES", "Files", "A multilayer EXR file on disk, or a sequence of them"),
)
QUALITIES = (
    ("fast", "Fast", "A pixel is predicted well by one model"),
    ("balanced", "Balanced", "By three models, which differ in the features that they see"),
    ("high", "High", "By sixteen models, which differ in the features that they see"),
)


class LinpredSettings(bpy.types.PropertyGroup):
    """Settings of linpred."""

    source: bpy.props.EnumProperty(name="Source", items=SOURCES, default="LAST_RENDER")
    input: bpy.props.StringProperty(
        name="Input",
        description="The noisy render; #### stands for the frame number of a sequence",
        subtype="FILE_PATH",
    )
    output: bpy.props.StringProperty(
        name="Output",
        description="The denoised file, a multilayer EXR as the input; with #### where the input has it",
        subtype="FILE_PATH",
    )
    skip_existing: bpy.props.BoolProperty(
        name="Skip Existing",
        description="Leave frames alone whose output is there already",
    )
    quality: bpy.props.EnumProperty(
        name="Quality",
        description="How much time to spend for how much accuracy",
        items=QUALITIES,
        default="balanced",
    )
    error_layer: bpy.props.BoolProperty(
        name="Error Layer",
        description="Add a layer with the estimated squared error of each pixel, linpred.error",
    )
