#!/usr/bin/env python3
"""Renders three frames with Blender Cycles whose middle one says where its surfaces are in the others.

    pip install bpy==5.0.1        # Python 3.11
    python3 cycles_motion.py      # cycles_motion.0002.exr to .0004.exr, 40 x 30 pixels

A camera that moves and turns looks at a cube that moves and turns above a ground, both of them textured. All of it speeds up, so that what was and what will be are
not each other's opposites, and goes to the right, to the left, up and down, so that no sign or order of the vectors' components but the right one fits.
"""

import math

import bpy

# of each frame: the cube to the right, and up; the camera's tilt, and turn, in radians; and its place to the right
FRAMES = {
    1: (-0.5, 0.1, 0.0, 0.0, 0.0),
    2: (-0.35, 0.0, 0.02, 0.02, 0.10),
    3: (0.0, 0.0, 0.05, 0.0, 0.15),
    4: (0.45, 0.3, 0.06, -0.06, 0.10),
}
# the first and the last frame that are written; Cycles needs to know what comes before and after a frame
WRITTEN = (2, 4)
MIDDLE = 3


def textured(name, scale, colour):
    """A material that glows in spots, and so has no noise of light."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    place = nodes.new("ShaderNodeTexCoord")
    spots = nodes.new("ShaderNodeTexNoise")
    spots.inputs["Scale"].default_value = scale
    spots.inputs["Detail"].default_value = 1
    contrast = nodes.new("ShaderNodeMapRange")
    contrast.inputs["From Min"].default_value = 0.35
    contrast.inputs["From Max"].default_value = 0.65
    mix = nodes.new("ShaderNodeMixRGB")
    mix.inputs[1].default_value = (0.02, 0.02, 0.02, 1)
    mix.inputs[2].default_value = (*colour, 1)
    glow = nodes.new("ShaderNodeEmission")
    output = nodes.new("ShaderNodeOutputMaterial")
    for source, target in (
        (place.outputs["Object"], spots.inputs["Vector"]),
        (spots.outputs[0], contrast.inputs["Value"]),
        (contrast.outputs[0], mix.inputs[0]),
        (mix.outputs[0], glow.inputs[0]),
        (glow.outputs[0], output.inputs[0]),
    ):
        links.new(source, target)
    return material


def build(scene):
    """The ground, the cube and the camera, with their motion."""
    bpy.ops.mesh.primitive_plane_add(size=30)
    bpy.context.object.data.materials.append(textured("ground", 0.9, (0.3, 0.8, 1.0)))
    bpy.ops.mesh.primitive_cube_add(size=1.8)
    cube = bpy.context.object
    cube.data.materials.append(textured("cube", 1.5, (1.0, 0.5, 0.1)))
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    for frame, (right, up, tilt, turn, place) in FRAMES.items():
        cube.location = (right, 0, 1.2 + up)
        cube.rotation_euler = (0, 0, 0.3 + 0.08 * frame)
        camera.location = (0.5 + place, -6.5, 4.2)
        camera.rotation_euler = (math.radians(58) + tilt, 0, 0.05 + turn)
        for thing in (cube, camera):
            thing.keyframe_insert("location", frame=frame)
            thing.keyframe_insert("rotation_euler", frame=frame)


def settings(scene):
    """Small noiseless pictures in half floats, in the file that Blender calls multilayer."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 64
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    # with it Cycles writes vectors of 0
    scene.render.use_motion_blur = False
    scene.render.resolution_x, scene.render.resolution_y = 40, 30
    scene.render.resolution_percentage = 100
    for stamp in ("date", "time", "render_time", "filename", "memory", "hostname"):
        setattr(scene.render, f"use_stamp_{stamp}", False)
    image = scene.render.image_settings
    image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER"
    image.color_depth, image.exr_codec = "16", "ZIP"


def main():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    settings(scene)
    build(scene)
    passes = scene.view_layers[0]
    for frame in range(WRITTEN[0], WRITTEN[1] + 1):
        passes.use_pass_vector = passes.use_pass_position = frame == MIDDLE
        scene.frame_set(frame)
        scene.render.filepath = f"cycles_motion.{frame:04d}.exr"
        bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
