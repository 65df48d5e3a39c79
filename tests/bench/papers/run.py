#!/usr/bin/env python3
"""What the three papers claim, tried here. See README.md beside it.

    python tests/bench/papers/run.py --scenes ../shared/scenes --mitsuba ../shared/mitsuba --out DIR [--linpred target/release/linpred]
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

# matrices of ten rows: threads of their own would only wait for each other
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

HERE = Path(__file__).resolve().parent
sys.path += [str(HERE.parent), str(HERE.parent / "sequences"), str(HERE.parent / "adaptive")]

import convergence
import numpy as np
import provenance
import regression
import renders
import sampling
import tables
from camera import Camera
from methods import Failed
from pictures import Noisy, Program, Reference, find, middle
from wlr import Volume

REPOSITORY = HERE.parents[2]
STUDIED = ("toasters", "sibenik", "pool")
"""Scenes of WLR's parts, of LPR's maps and of the robust estimates."""
CONVERGING = ("toasters",)
"""Rendered up to 1024 samples per pixel."""
EMPTY = ("backdrop",)
"""Scenes of which most is without noise: there is nothing to choose."""
SAMPLES = 16
"""Per pixel, of what is not tried at all counts."""
TWICE = (32,)
"""Samples per pixel (LPR Fig. 4: 32) at which two renders are compared."""
RENDERS = 24
"""Of 8 samples per pixel each, over which errors are taken for expectations (WLR: 1000 renders)."""


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=Path, required=True, help="folder of <scene>_<n>spp.exr and <scene>_ref.exr")
    parser.add_argument("--mitsuba", type=Path, help="folder of scenes.py and render.py, for what is rendered (mitsuba beside --scenes)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--linpred", type=Path, default=REPOSITORY / "target" / "release" / "linpred", help="the program")
    parser.add_argument("--study", type=Path, default=REPOSITORY / "target" / "release" / "papers", help="the program of the tests' crate")
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "linpred-adaptive", help="samples that ../adaptive renders")
    parser.add_argument("--renders", type=Path, default=Path(tempfile.gettempdir()) / "linpred-papers", help="pictures that are rendered here")
    parser.add_argument("--side", type=int, default=128, help="pixels a side of the middle that WLR is tried on")
    parser.add_argument("--only", default="", help=f"some parts, with commas: {', '.join(PARTS)}; results of the others stay")
    found = parser.parse_args()
    found.mitsuba = found.mitsuba or found.scenes.parent / "mitsuba"
    unknown = [part for part in found.only.split(",") if part and part not in PARTS]
    if unknown:
        sys.exit(f"no part {unknown[0]}: there are {', '.join(PARTS)}")
    if not find(found.scenes):
        sys.exit(f"{found.scenes}: no <scene>_<n>spp.exr with a <scene>_ref.exr beside it")
    for program, how in ((found.linpred, "-p linpred"), (found.study, "-p linpred-tests --bin papers")):
        if not program.is_file():
            sys.exit(f"{program} is not there: cargo build --release {how}")
    return found


def choice(asked: argparse.Namespace, program: Program) -> Iterable[dict[str, object]]:
    """Half-widths by the estimate and by the reference; where there is a picture of twice the samples, of two renders."""
    rendered = [noisy for scene in CONVERGING for noisy in convergence.render(asked.mitsuba, scene, asked.renders)]
    stored = [noisy for noisy in find(asked.scenes) if noisy.scene not in EMPTY]
    for noisy in (*stored, *(noisy for noisy in rendered if noisy.samples in TWICE)):
        twice = noisy.path.with_name(f"{noisy.scene}_{2 * noisy.samples}spp.exr")
        more = (twice, str(noisy.samples)) if twice.is_file() else ()
        for row in program.study("choice", noisy.path, noisy.reference, *more):
            yield {"scene": noisy.scene, "samples": noisy.samples, **row}


def validation(asked: argparse.Namespace, program: Program) -> Iterable[dict[str, object]]:
    for noisy in find(asked.scenes):
        if noisy.samples == SAMPLES and noisy.scene not in EMPTY:
            for row in program.study("validation", noisy.path, noisy.reference):
                yield {"scene": noisy.scene, "samples": noisy.samples, **row}


def centres(asked: argparse.Namespace, program: Program) -> Iterable[dict[str, object]]:
    """Models and error of the program's own runs."""
    options = {
        "literal": ("--formulas", "literal"),
        "wlr": ("--formulas", "wlr"),
        "robust, fast": ("--quality", "fast"),
        "robust, balanced": ("--quality", "balanced"),
    }
    for noisy in find(asked.scenes):
        reference = Reference.read(noisy.reference)
        for name, chosen in options.items():
            try:
                picture, layers, models = program.denoised(noisy.path, *chosen)
            except Failed as why:
                yield {"scene": noisy.scene, "samples": noisy.samples, "formulas": name, "failed": str(why)}
                continue
            figures = {"models per pixel": models / layers["rank"].size, "mean rank": float(layers["rank"].mean()), "rmse": reference.error(picture)}
            yield {"scene": noisy.scene, "samples": noisy.samples, "formulas": name, **figures, "failed": ""}


def parts_of_wlr(asked: argparse.Namespace, program: Program) -> Iterable[dict[str, object]]:
    for noisy in find(asked.scenes):
        if noisy.scene in STUDIED and noisy.samples == SAMPLES:
            yield from _named(regression.COLUMNS, regression.rows(noisy, asked.side))
            reference = Reference.read(noisy.reference).cut(asked.side)
            for way, options in {"LPR, literal": ("--formulas", "literal"), "robust, balanced": ("--quality", "balanced")}.items():
                picture, layers, _ = program.denoised(noisy.path, *options)
                rank = float(middle(layers["rank"], asked.side).mean())
                yield {"scene": noisy.scene, "samples": noisy.samples, "way": way, "rmse": reference.error(middle(picture, asked.side)), "rank": rank}


def estimates(asked: argparse.Namespace, program: Program) -> Iterable[dict[str, object]]:
    for scene in STUDIED:
        series, reference = _series(asked, scene), asked.scenes / f"{scene}_ref.exr"
        side = asked.side
        volumes = []
        for first in range(0, 8 * RENDERS, 8):
            camera = Camera(series, renders.SIZE, first)
            camera.render(np.full((renders.SIZE, renders.SIZE), 8))
            means, variances = (middle(plane, side)[None] for plane in (camera.means, camera.variances))
            # normal, albedo, depth: the recipe's order does not matter
            volumes.append(Volume(*(np.ascontiguousarray(plane) for plane in (means[..., :3], variances[..., :3], means[..., 3:], variances[..., 3:])), samples=8))
        yield from _named(regression.ESTIMATE_COLUMNS, regression.estimates(scene, volumes, Reference.read(reference).cut(side)))


def maps(asked: argparse.Namespace, program: Program) -> Iterable[dict[str, object]]:
    for scene in STUDIED:
        series = _series(asked, scene)
        yield from _named(sampling.MAP_COLUMNS, [sampling.maps(scene, series, renders.SIZE, 0, asked.scenes / f"{scene}_ref.exr", program)])


def robust(asked: argparse.Namespace, program: Program) -> Iterable[dict[str, object]]:
    for scene in STUDIED:
        series = _series(asked, scene)
        yield from _named(sampling.ROBUST_COLUMNS, sampling.robust(scene, series, renders.SIZE, 0, asked.scenes / f"{scene}_ref.exr"))


def converging(asked: argparse.Namespace, program: Program) -> Iterable[dict[str, object]]:
    for scene in CONVERGING:
        yield from _named(convergence.COLUMNS, convergence.rows(convergence.render(asked.mitsuba, scene, asked.renders), program))


Part = Callable[[argparse.Namespace, Program], Iterable[dict[str, object]]]
PARTS: dict[str, Part] = {
    "choice": choice,
    "validation": validation,
    "centres": centres,
    "regression": parts_of_wlr,
    "estimates": estimates,
    "maps": maps,
    "robust": robust,
    "convergence": converging,
}


def _named(columns: tuple[str, ...], rows: Iterable[tuple]) -> Iterable[dict[str, object]]:
    return (dict(zip(columns, row, strict=True)) for row in rows)


def _series(asked: argparse.Namespace, scene: str):
    renders.render_series(scene, asked.mitsuba, asked.cache)
    return renders.series(scene, asked.cache)


def main() -> None:
    asked = arguments()
    asked.out.mkdir(parents=True, exist_ok=True)
    with open(asked.out / "commands.txt", "a") as file:
        file.write(f"{time.strftime('%Y-%m-%d')} {provenance.machine()} {provenance.revision()}: python {' '.join(sys.argv)}\n")
    program = Program(asked.linpred, asked.study)
    for name, part in PARTS.items():
        if asked.only and name not in asked.only.split(","):
            continue
        rows = []
        for row in part(asked, program):
            rows.append(row)
            tables.write(asked.out / f"{name}.csv", rows)
        print(f"{name}: {len(rows)} rows", flush=True)
    tables.write_all(asked.out)


if __name__ == "__main__":
    main()
