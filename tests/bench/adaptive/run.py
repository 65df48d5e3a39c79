#!/usr/bin/env python3
"""Error of the denoised picture against samples per pixel, by who says where the samples go. See README.md beside it.

    python tests/bench/adaptive/run.py --scenes ../shared/mitsuba --out DIR [--stored ../shared/scenes] [--referee ../shared/tools] [--cache DIR]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
TOTALS = (4, 8, 12, 16, 24, 36, 54, 64)
"""Samples per pixel after each pass, as `linpred.mitsuba` takes them."""
MEASURED = (4, 8, 16, 36, 64)
UNIFORM = (*TOTALS, 96, 192)
"""More of uniform sampling, to tell how many samples it needs for an error."""
LOOKED_AT = 16
"""Samples per pixel of the pictures, and of FLIP, which takes longer than all else."""


@dataclass(frozen=True)
class Task:
    scene: str
    seed: int
    seeds: int
    arguments: argparse.Namespace


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=Path, required=True, help="folder of scenes.py and common.py")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--stored", type=Path, help="folder of <scene>_ref.exr (scenes beside --scenes)")
    parser.add_argument("--referee", type=Path, help="folder of score.py, whose measures are used (tools beside --scenes)")
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "linpred-adaptive", help="folder of rendered samples, some 1.5 GB")
    parser.add_argument("--seeds", type=int, default=2, help="runs with other samples; 0 leaves results.csv as it is")
    parser.add_argument("--only", default="", help="scenes, with commas")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--no-loop", action="store_true", help="leaves out the seconds of linpred.mitsuba")
    found = parser.parse_args()
    found.stored = found.stored or found.scenes.parent / "scenes"
    found.referee = found.referee or found.scenes.parent / "tools"
    for folder, file in ((found.scenes, "scenes.py"), (found.referee, "score.py")):
        if not (folder / file).is_file():
            sys.exit(f"{folder}: no {file} there")
    return found


def measured(task: Task):
    """Rows of the table, and pictures and maps by name."""
    import numpy as np

    sys.path[:0] = [str(HERE), str(task.arguments.referee)]
    import methods
    import renders
    import score
    from camera import Camera

    series = renders.series(task.scene, task.arguments.cache)
    reference, variance = renders.reference(task.scene, task.arguments.scenes, task.arguments.cache, task.arguments.stored, score)
    offset = task.seed * series.shape[1] // task.seeds
    rows, kept = [], {"reference": reference}

    def measure(method: str, camera: Camera, total: int) -> None:
        picture = methods.denoised(camera, "balanced").colour.astype(np.float64)
        found = score.errors(picture, reference, variance)
        flip = score.flip(picture, reference) if total == LOOKED_AT else ""
        counts = camera.counts
        got = (float(counts.mean()), int(counts.max()))
        capped = float((counts >= camera.most).mean())
        rows.append((task.scene, task.seed, method, total, *got, found["rmse"], found["psnr"], flip, found["energy"], capped))
        if total == LOOKED_AT:
            kept[method], kept[f"{method} map"] = picture, counts.copy()

    with tempfile.TemporaryDirectory() as folder:
        for method, where in methods.MAPS.items():
            camera = Camera(series, renders.SIZE, offset)
            for number, total in enumerate(UNIFORM if method == "uniform" else TOTALS):
                state = methods.State(camera, total - camera.counts.mean(), 1000 * task.seed + number, Path(folder), reference, variance)
                camera.render(where(state) if number else np.full((renders.SIZE, renders.SIZE), total))
                if method == "uniform" or total in MEASURED:
                    measure(method, camera, total)
                if method == "uniform" and total in (4, 8):
                    rows.extend(correlations(task, camera, state.folder, total, reference, variance))
    cycles = methods.Cycles(series, renders.SIZE, offset)
    for total in MEASURED:
        camera = Camera(series, renders.SIZE, offset)
        camera.render(cycles.counts(total))
        measure("Cycles-like", camera, total)
    return rows, kept


def correlations(task: Task, camera, folder: Path, samples: int, reference, variance):
    """Pearson's, of linpred's map and the oracle's, both for as many samples again, over means of 5 x 5 and 9 x 9 pixels."""
    import methods
    import numpy as np
    from scipy.ndimage import uniform_filter

    state = methods.State(camera, samples, task.seed, folder, reference, variance)
    maps = [methods.ours(state).astype(np.float64), methods.by_error(methods.true_error(state), state)]
    for size in (5, 9):
        means = [uniform_filter(one, size, mode="reflect").ravel() for one in maps]
        yield (task.scene, task.seed, f"correlation {size}x{size}", samples, samples, "", float(np.corrcoef(means)[0, 1]), "", "", "", "")


def loop_seconds(scene: str, arguments: argparse.Namespace):
    """Seconds of a whole loop: rendering, and everything else."""
    sys.path[:0] = [str(HERE)]
    import linpred.mitsuba
    import renders

    live = renders.Live(arguments.scenes, scene)
    description, depth = live.scenes.ALL[scene](renders.SIZE, renders.SIZE)
    loaded = live.common.mi.load_dict({**description, "integrator": {"type": "path", "max_depth": depth, "rr_depth": 5}})
    for samples in (16, 64):
        with tempfile.TemporaryDirectory() as folder:
            done = linpred.mitsuba.render(loaded, Path(folder) / "clean.exr", spp=samples)
        yield (scene, samples, done.passes, round(done.rendering, 2), round(done.other, 2))


def main() -> None:
    asked = arguments()
    sys.path[:0] = [str(HERE), str(HERE.parent), str(asked.referee)]
    import provenance
    import renders
    import report
    import score

    scenes = [scene for scene in renders.SCENES if not asked.only or scene in asked.only.split(",")]
    asked.out.mkdir(parents=True, exist_ok=True)
    began = time.strftime("%Y-%m-%d")
    # one after the other: Mitsuba uses all processors itself
    for scene in scenes:
        renders.render_series(scene, asked.scenes, asked.cache)
        renders.reference(scene, asked.scenes, asked.cache, asked.stored, score)
    with open(asked.out / "commands.txt", "a") as file:
        file.write(f"{began} {provenance.machine()} {provenance.revision()}: python {' '.join(sys.argv)}\n")
    tasks = [Task(scene, seed, asked.seeds, asked) for seed in range(asked.seeds) for scene in scenes]
    rows = []
    with ProcessPoolExecutor(asked.processes) as workers:
        for task, (found, pictures) in zip(tasks, workers.map(measured, tasks)):
            rows.extend(found)
            report.write(asked.out, "results.csv", report.COLUMNS, rows)
            if task.seed == 0:
                report.pictures(task.scene, pictures, asked.out)
            print(f"{task.scene}, seed {task.seed}: measured", flush=True)
    if not asked.no_loop:
        seconds = []
        for scene in scenes:
            seconds.extend(loop_seconds(scene, asked))
            report.write(asked.out, "loop.csv", report.LOOP_COLUMNS, seconds)
    report.table(asked.out)
    report.plot(asked.out)


if __name__ == "__main__":
    main()
