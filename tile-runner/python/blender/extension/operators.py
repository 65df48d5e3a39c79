"""The two buttons: set the passes, and denoise."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field

import bpy

from . import passes, result
from .frames import frames_on_disk, path_of_frame, place_of_number
from .job import Job, Task
from .passes import Refused

# how often the bar moves, in seconds
TICK = 0.1


@dataclass
class Run:
    """A job, and what becomes of its files."""

    job: Job
    output: str
    # of a sequence those that are denoised, and how many of the scene's are not on disk
    frames: list[int] = field(default_factory=list)
    absent: int = 0
    # of the last render's files, removed in the end
    folder: str | None = None

    def clean_up(self) -> None:
        """Removes what is temporary."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


# the run that is under way: there is one at most, as it takes all processors
current: Run | None = None


def stop() -> None:
    """Ends the run that is under way, and forgets it."""
    global current
    if current is not None:
        current.job.cancel()
        current.job.wait()
        current.clean_up()
        current = None


class LINPRED_OT_set_passes(bpy.types.Operator):
    """Switch on the passes that linpred reads and Cycles' own denoiser off; for files also the output format that holds them"""

    bl_idname = "linpred.set_passes"
    bl_label = "Set Passes"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012, Blender asks for a set

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        try:
            changes = passes.set_passes(scene, with_output=scene.linpred.source == "FILES")
        except Refused as refused:
            self.report({"ERROR"}, str(refused))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Set: {', '.join(changes)}" if changes else "All passes were set already")
        return {"FINISHED"}


class LINPRED_OT_denoise(bpy.types.Operator):
    """Denoise the last render, or files on disk. Esc cancels"""

    bl_idname = "linpred.denoise"
    bl_label = "Denoise"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012, Blender asks for a set

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if current is not None:
            cls.poll_message_set("A run is under way")
            return False
        return context.scene is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Scripts: returns when all is done."""
        if not begin(self, context):
            return {"CANCELLED"}
        manager = context.window_manager
        manager.progress_begin(0, 1)
        try:
            while not current.job.wait(TICK):
                manager.progress_update(current.job.fraction)
        except KeyboardInterrupt:
            current.job.cancel()
            current.job.wait()
        finally:
            manager.progress_end()
        return finish(self, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        """The button: returns at once, `modal` does the rest."""
        if bpy.app.background:  # there are no events
            return self.execute(context)
        if not begin(self, context):
            return {"CANCELLED"}
        manager = context.window_manager
        manager.progress_begin(0, 1)
        self.timer = manager.event_timer_add(TICK, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Every event that reaches the window while the run is under way."""
        if current is None:  # the extension was switched off
            self.leave(context)
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            current.job.cancel()
            return {"RUNNING_MODAL"}
        if event.type == "TIMER":
            context.window_manager.progress_update(current.job.fraction)
            redraw(context)
            if current.job.wait(0):
                self.leave(context)
                return finish(self, context)
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator, as when another file is opened."""
        stop()
        self.leave(context)

    def leave(self, context: bpy.types.Context) -> None:
        """Puts back what `invoke` has set up."""
        context.window_manager.event_timer_remove(self.timer)
        context.window_manager.progress_end()
        redraw(context)


CLASSES = (LINPRED_OT_set_passes, LINPRED_OT_denoise)


def begin(operator: bpy.types.Operator, context: bpy.types.Context) -> bool:
    """Starts the run that the settings ask for; if it cannot be, the user is told."""
    global current
    try:
        current = prepare(context.scene)
    except Refused as refused:
        operator.report({"ERROR"}, str(refused))
        return False
    except OSError as error:
        operator.report({"ERROR"}, f"The render could not be written: {error}")
        return False
    except KeyboardInterrupt:
        operator.report({"ERROR"}, "Cancelled")
        return False
    current.job.start()
    return True


def prepare(scene: bpy.types.Scene) -> Run:
    """The run that the settings ask for, not started; Refused with a sentence where it cannot be."""
    try:
        # here and not above, so that the panel is there to say it
        import linpred
    except ImportError as error:
        raise Refused(f"The Python package linpred is missing from this extension: {error}") from error
    if bpy.app.is_job_running("RENDER"):
        raise Refused("A render is under way: wait for its end")

    def job(tasks: list[Task]) -> Job:
        return Job(tasks, linpred.denoise_file, linpred.InputWarning)

    return run_of_last_render(scene, job) if scene.linpred.source == "LAST_RENDER" else run_of_files(scene, job)


def run_of_last_render(scene: bpy.types.Scene, job: Callable[[list[Task]], Job]) -> Run:
    """The render is copied into a file first: this takes a moment, and then the next render may begin."""
    folder = tempfile.mkdtemp(prefix="linpred-", dir=bpy.app.tempdir)
    noisy, clean = (os.path.join(folder, name) for name in ("noisy.exr", "clean.exr"))
    try:
        passes.save_last_render(scene, noisy)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    task = Task("Last render", options(scene) | {"input": noisy, "output": clean})
    return Run(job([task]), output=clean, folder=folder)


def run_of_files(scene: bpy.types.Scene, job: Callable[[list[Task]], Job]) -> Run:
    """One task for each frame of the scene's range that is on disk, or one for a single file."""
    settings = scene.linpred
    source, output = (bpy.path.abspath(path) for path in (settings.input, settings.output))
    if not source or not output:
        raise Refused(f"Choose the {'output' if source else 'input'} file first")
    arguments = options(scene) | {"input": source, "output": output, "skip_existing": settings.skip_existing}
    if place_of_number(source) is None:
        task = Task(os.path.basename(source), arguments)
        return Run(job([task]), output=output)
    wanted = range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
    frames = frames_on_disk(source, wanted)
    if not frames:
        raise Refused(f"No frame from {scene.frame_start} to {scene.frame_end} of {source} is on disk")
    tasks = [Task(f"Frame {frame}, {count} of {len(frames)}", arguments | {"frames": [frame]}) for count, frame in enumerate(frames, 1)]
    return Run(job(tasks), output=output, frames=frames, absent=len(wanted) - len(frames))


def options(scene: bpy.types.Scene) -> dict[str, object]:
    """Arguments of `linpred.denoise_file` that are the same for every file."""
    render = scene.render
    fixed = render.threads_mode == "FIXED"
    return {
        "quality": scene.linpred.quality,
        "error_layer": scene.linpred.error_layer,
        "threads": min(render.threads, os.cpu_count() or 1) if fixed else None,
    }


def finish(operator: bpy.types.Operator, context: bpy.types.Context) -> set[str]:
    """Shows the result of the run that has ended, tells the user, and clears up."""
    global current
    run, current = current, None
    outcome = run.job.outcome
    try:
        for note in outcome.notes:
            operator.report({"WARNING"}, note)
        if outcome.cancelled:
            done = f"; {outcome.done} of {len(run.frames)} frames are done" if outcome.done else ""
            # an error for scripts, which must not go on as if there was a result
            operator.report({"ERROR"} if bpy.app.background else {"INFO"}, f"Cancelled{done}")
            return {"CANCELLED"}
        shown = outcome.done and show_result(operator, context, run)
        if outcome.failures:
            several = f"{len(outcome.failures)} of {len(run.frames)} frames failed. " if len(run.frames) > 1 else ""
            first, *others = dict.fromkeys(outcome.failures)
            for failure in others:
                operator.report({"WARNING"}, failure)
            operator.report({"ERROR"}, several + first)
        return {"FINISHED"} if shown else {"CANCELLED"}
    finally:
        run.clean_up()


def show_result(operator: bpy.types.Operator, context: bpy.types.Context, run: Run) -> bool:
    """Loads the result and shows it; whether that could be done."""
    # those that failed are not there
    frames = frames_on_disk(run.output, run.frames)
    path = path_of_frame(run.output, frames[0]) if frames else run.output
    try:
        image = result.load(path, keep_in_blend=run.folder is not None, frames=frames)
    except RuntimeError as error:
        operator.report({"ERROR"}, f"The denoised file could not be loaded: {passes.told(error)}")
        return False
    result.show(context, image, frames)
    if passes.holds_composite(path):
        operator.report(
            {"WARNING"},
            "The compositor's picture is denoised too, without features: choose the view layer in the editor's header",
        )
    if run.absent:
        operator.report({"WARNING"}, f"{run.absent} frames of the scene's range are not on disk")
    operator.report({"INFO"}, f"Done: {run.job.outcome.done} frames" if frames else "Done")
    return True


def redraw(context: bpy.types.Context) -> None:
    """Has the panel show how far the run is."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.tag_redraw()
