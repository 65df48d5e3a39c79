#!/usr/bin/env python3
"""What further features buy. See README.md beside it.

    python tests/bench/features/run.py --scenes DIR [DIR ...] --out DIR [--linpred target/release/linpred] [--referee ../shared/tools]
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parent))

import images
import picture
import provenance
import report
from methods import METHODS, Bench, Failed, Image, Made


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=Path, nargs="+", required=True, help="folders of <scene>_<samples>spp.exr and <scene>_ref.exr")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--linpred", type=Path, default=HERE.parents[2] / "target" / "release" / "linpred", help="the program")
    parser.add_argument("--referee", type=Path, help="folder of score.py, whose measures are used (tools beside the first of --scenes)")
    parser.add_argument("--only", default="", help="scenes, with commas")
    parser.add_argument("--samples", default="", help="samples per pixel, with commas")
    parser.add_argument("--methods", default="", help="with semicolons; rows of others stay in results.csv as they are")
    picture.add_arguments(parser)
    found = parser.parse_args()
    found.referee = found.referee or found.scenes[0].parent / "tools"
    unknown = [method for method in found.methods.split(";") if method and method not in METHODS]
    if unknown:
        sys.exit(f"no method {unknown[0]!r}: there are {'; '.join(METHODS)}")
    if not (found.referee / "score.py").is_file():
        sys.exit(f"{found.referee}: no score.py there; --referee names its folder")
    return found


def find(asked: argparse.Namespace) -> list[Image]:
    """The images of all folders; ends the program where there is none or a reference is missing."""
    found = []
    for folder in asked.scenes:
        for path in folder.glob("*spp.exr"):
            parts = re.fullmatch(r"(.+)_(\d+)spp", path.stem)
            if parts and (not asked.only or parts[1] in asked.only.split(",")) and (not asked.samples or parts[2] in asked.samples.split(",")):
                found.append(Image(folder, parts[1], int(parts[2])))
    for image in found:
        if not image.reference.is_file():
            sys.exit(f"{image.reference}: no such reference")
    if not found:
        sys.exit(f"no images {asked.only} <scene>_<samples>spp.exr in {', '.join(map(str, asked.scenes))}")
    return sorted(found, key=lambda image: (asked.scenes.index(image.folder), image.scene, image.samples))


class Judge:
    """The referee's measures of one image's pictures."""

    def __init__(self, image: Image, referee: Any) -> None:
        self.referee, self.reference, self.noise = referee, referee.colour(str(image.reference)), referee.noise(str(image.reference))
        self.before = referee.errors(referee.colour(str(image.path)), self.reference, self.noise)["rmse"]

    def row(self, made: Made) -> tuple[Any, ...]:
        """Of `results.csv`."""
        # as a file would hold it, so that whoever judges the file finds the same
        found = self.referee.errors(made.picture.astype("f4").astype("f8"), self.reference, self.noise, with_flip=True)
        measures = ("rmse", "psnr", "flip", "energy", "top1", "pinholes", "sparks")
        return (self.before / found["rmse"], *(found[name] for name in measures), "" if made.seconds is None else round(made.seconds, 3))


def main() -> None:
    asked = arguments()
    sys.path.append(str(asked.referee))
    import score

    chosen = [method for method in METHODS if not asked.methods or method in asked.methods.split(";")]
    asked.out.mkdir(parents=True, exist_ok=True)
    found = find(asked)
    with open(asked.out / "commands.txt", "a") as file:
        file.write(f"{time.strftime('%Y-%m-%d')} {provenance.machine()} {provenance.revision()}: python {' '.join(sys.argv)}\n")
    for image in found:
        bench, channels = Bench(image, asked.linpred), images.channels(image.path).keys()
        judge = Judge(image, score)
        for method in chosen:
            if channels >= set(METHODS[method].needs):
                row, why = None, ""
                try:
                    row = judge.row(bench.made(method))
                except Failed as failed:
                    why = str(failed)
                report.replace(asked.out, (image.folder.name, image.scene, str(image.samples), method), row, why)
        print(f"{image.folder.name}, {image.scene}, {image.samples} spp: measured", flush=True)
        if picture.METHODS <= set(chosen):
            picture.draw(bench, asked)
    report.table(asked.out)


if __name__ == "__main__":
    main()
