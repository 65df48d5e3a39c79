"""The result as an image of Blender, in the image editors."""

from __future__ import annotations

import bpy

NAME = "linpred"
# marks images that a run made, which the next run may replace; a user's image of the same name is left alone
MARK = "linpred_result"


def load(path: str, *, keep_in_blend: bool, frames: list[int]) -> bpy.types.Image:
    """The file as an image named `linpred`, in the place of the one of the run before; a renamed one stays.

    `keep_in_blend` packs the file, so that it may be removed. With `frames`, the image is a sequence.
    """
    image = bpy.data.images.load(path)
    if frames:
        image.source = "SEQUENCE"
    if keep_in_blend:
        image.pack()
        # the name that Save As offers; the temporary one will not exist
        image.filepath_raw = f"//{NAME}.exr"
    previous = bpy.data.images.get(NAME)
    if previous is not None and MARK in previous:
        # editors, materials and nodes that show it go on with the new one
        previous.user_remap(image)
        bpy.data.images.remove(previous)
    image.name = NAME
    image[MARK] = True
    return image


def show(context: bpy.types.Context, image: bpy.types.Image, frames: list[int]) -> None:
    """Shows the image in the editor that the user is in, and in those that show a render, an earlier result or nothing."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type != "IMAGE_EDITOR" or area.ui_type != "IMAGE_EDITOR":
                continue
            space = area.spaces.active
            free = space.image is None or space.image.type == "RENDER_RESULT" or space.image == image
            if area == context.area or (free and not space.use_image_pin):
                space.image = image
                if frames:
                    follow_frame(space.image_user, frames)
                area.tag_redraw()


def follow_frame(user: bpy.types.ImageUser, frames: list[int]) -> None:
    """Has an editor show the file of the scene's current frame."""
    user.frame_start = frames[0]
    user.frame_offset = frames[0] - 1
    user.frame_duration = frames[-1] - frames[0] + 1
    user.use_auto_refresh = True
