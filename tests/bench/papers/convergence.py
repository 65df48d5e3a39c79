"""Error against samples per pixel, of the input and of what is made of it: whether a method is consistent (LPR section 7, Fig. 8; WLR Fig. 12)."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import methods
import numpy as np
from frames import COLOUR, planes
from pictures import Noisy, Program, Reference

SAMPLES = (4, 8, 16, 32, 64, 128, 256, 512, 1024)
COLUMNS = ("scene", "samples", "method", "rmse")
PROGRAM = {
    "literal": ("--formulas", "literal"),
    "wlr": ("--formulas", "wlr"),
    "robust, balanced": ("--quality", "balanced"),
    "robust, high": ("--quality", "high"),
}
NETWORK = "Open Image Denoise, high"
NOISE = "noise of the reference"


def render(scenes: Path, scene: str, folder: Path) -> list[Noisy]:
    """The scene at all counts, nested, with Mitsuba, if the folder does not hold it yet; ends the program where it cannot."""
    found = [folder / scene / f"{scene}_{samples}spp.exr" for samples in SAMPLES]
    if not all(path.is_file() for path in found):
        print(f"{scene}: rendering {SAMPLES[-1]} samples per pixel", flush=True)
        settings = {"SNAPS": ",".join(map(str, SAMPLES)), "SCENES_OUT": str(folder.resolve()), "RES": "256"}
        done = subprocess.run([sys.executable, "render.py", "noisy", scene], cwd=scenes, env={**os.environ, **settings})
        if done.returncode or not all(path.is_file() for path in found):
            sys.exit(f"{scenes}/render.py made no {found[-1].name}; it needs mitsuba==3.9.1 OpenEXR numpy scipy trimesh pillow")
    reference = scenes.parent / "scenes" / f"{scene}_ref.exr"
    return [Noisy(scene, samples, path, reference) for samples, path in zip(SAMPLES, found)]


def rows(pictures: list[Noisy], program: Program) -> Iterator[tuple]:
    """A line for each picture and method; methods that fail are left out and said so."""
    reference = Reference.read(pictures[0].reference)
    yield pictures[0].scene, "", NOISE, reference.own_error
    failed: set[str] = set()
    made: dict[str, Callable[[Path], np.ndarray]] = {"input": lambda path: planes(path, COLOUR)}
    for name, options in PROGRAM.items():
        made[name] = lambda path, options=options: program.denoised(path, *options)[0]
    made[NETWORK] = lambda path: methods.network(path)[0]
    for noisy in pictures:
        for name, picture in made.items():
            if name in failed:
                continue
            try:
                yield noisy.scene, noisy.samples, name, reference.error(picture(noisy.path))
            except methods.Failed as why:
                failed.add(name)
                print(f"left out, {name}: {why}", flush=True)


def slope(samples: list[int], errors: list[float]) -> float:
    """Of the logarithms, by least squares: -1 is what an average of independent samples has."""
    return float(np.polyfit(np.log(samples), np.log(errors), 1)[0])


COLOURS = {
    "input": "#555555",
    "literal": "#8e44ad",
    "wlr": "#b8860b",
    "robust, balanced": "#27ae60",
    "robust, high": "#c0392b",
    NETWORK: "#2980b9",
}


def plot(found: list[dict[str, str]], path: Path) -> None:
    """Both axes logarithmic, a panel for each scene."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "linpred", "font.size": 9})
    scenes = sorted({row["scene"] for row in found})
    drawing, panels = plt.subplots(1, len(scenes), figsize=(2.4 + 4.4 * len(scenes), 4), squeeze=False, sharey=True)
    for panel, scene in zip(panels[0], scenes):
        for method, colour in COLOURS.items():
            points = [(int(row["samples"]), float(row["rmse"])) for row in found if (row["scene"], row["method"]) == (scene, method)]
            if not points:
                continue
            panel.plot([n for n, _ in points], [error for _, error in points], "o-", color=colour, markersize=3, linewidth=1.2, label=method)
        noise = next(float(row["rmse"]) for row in found if (row["scene"], row["method"]) == (scene, NOISE))
        panel.axhline(noise, color="black", linewidth=0.8, linestyle=":", label=f"{NOISE} (taken off)")
        panel.set(xscale="log", yscale="log", title=scene, xlabel="samples per pixel")
        panel.grid(color="#dddddd", linewidth=0.5)
        panel.set_xticks(SAMPLES[::2], [str(n) for n in SAMPLES[::2]])
        panel.minorticks_off()
    panels[0][0].set_ylabel("rMSE")
    panels[0][-1].legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
    drawing.tight_layout()
    drawing.savefig(path, metadata={"Date": None})
    plt.close(drawing)
