#!/usr/bin/env python3
"""Error and flicker of denoised sequences, by method. See README.md beside it.

    python tests/bench/sequences/run.py --sequences ../shared/sequences --out DIR [--linpred target/release/linpred] [--referee ../shared/tools]
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

# matrices of ten rows: threads of their own would only wait for each other
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parent))

import frames
import judge
import provenance
import report
import strip
from methods import METHODS, Bench, Failed

TOLERANCE = 1e-9
"""Between the referee's figures and these, relative."""


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sequences", type=Path, nargs="+", required=True, help="folders of NAME_00_8spp.exr and NAME_00_ref.exr")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--linpred", type=Path, default=HERE.parents[2] / "target" / "release" / "linpred", help="the program")
    parser.add_argument("--referee", type=Path, help="folder of temporal.py: it must find the same figures")
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "linpred-sequences", help="folder of what the methods make")
    parser.add_argument("--only", default="", help="names of sequences, with commas")
    parser.add_argument("--methods", default="", help="with semicolons; rows of others stay in results.csv as they are")
    strip.add_arguments(parser)
    found = parser.parse_args()
    unknown = [method for method in found.methods.split(";") if method and method not in METHODS]
    if unknown:
        sys.exit(f"no method {unknown[0]!r}: there are {'; '.join(METHODS)}")
    if found.referee and not (found.referee / "temporal.py").is_file():
        sys.exit(f"{found.referee}: no temporal.py there")
    return found


def measure(bench: Bench, method: str, referee: Path | None) -> tuple[list[tuple], list[tuple]]:
    """Rows of `results.csv` and of `failed.csv`."""
    sequence = bench.sequence
    try:
        made = bench.made(method)
    except Failed as why:
        return [], [(sequence.label, method, str(why))]
    measured = judge.judge(sequence, made.pictures)
    if referee:
        compare(bench, method, measured, referee)
    seconds = "" if made.seconds is None else round(made.seconds, 3)
    rows = [
        (sequence.label, method, number, row.gain, row.psnr, row.energy, row.flicker, row.visible, seconds)
        for number, row in zip(sequence.numbers, measured, strict=True)
    ]
    return rows, []


def compare(bench: Bench, method: str, measured: list[judge.Measured], referee: Path) -> None:
    """Ends the program where the referee finds another figure in the same files."""
    sys.path.append(str(referee))
    import temporal

    sequence = bench.sequence
    if sequence.samples != 8 or len(sequence.numbers[0]) != 2:
        sys.exit(f"{sequence.label}: the referee judges NAME_00_8spp.exr")
    pattern = str(bench.file(method, "%02d"))
    for number, ours, theirs in zip(sequence.numbers, measured, temporal.judge(str(sequence.folder), sequence.name, pattern), strict=True):
        for name in ("gain", "psnr", "energy", "flicker"):
            own, other = getattr(ours, name), theirs[name]
            if not abs(own - other) <= TOLERANCE * abs(other) and not (own != own and other != other):
                sys.exit(f"{sequence.label}, frame {number}, {method}: {name} is {own}, the referee's {other}")


def main() -> None:
    asked = arguments()
    sequences = [sequence for folder in asked.sequences for sequence in frames.find(folder) if not asked.only or sequence.name in asked.only.split(",")]
    if not sequences:
        sys.exit(f"no sequence {asked.only} in {', '.join(map(str, asked.sequences))}")
    methods = [method for method in METHODS if not asked.methods or method in asked.methods.split(";")]
    asked.out.mkdir(parents=True, exist_ok=True)
    with open(asked.out / "commands.txt", "a") as file:
        file.write(f"{time.strftime('%Y-%m-%d')} {provenance.machine()} {provenance.revision()}: python {' '.join(sys.argv)}\n")
    for sequence in sequences:
        bench = Bench(sequence, asked.linpred, asked.pictures / sequence.slug)
        for method in methods:
            rows, failed = measure(bench, method, asked.referee)
            report.replace(asked.out, sequence.label, method, rows, failed)
            print(f"{sequence.label}, {method}: {'failed: ' + failed[0][2] if failed else 'measured'}", flush=True)
    report.table(asked.out)
    report.plot(asked.out)
    draw_strip(sequences, asked)


def draw_strip(sequences: list[frames.Sequence], asked: argparse.Namespace) -> None:
    """Says so where it cannot."""
    for sequence in sequences:
        if sequence.name == asked.strip:
            bench = Bench(sequence, asked.linpred, asked.pictures / sequence.slug)
            why = strip.missing(bench, asked)
            if why:
                print(f"no strip: {why}", flush=True)
            else:
                strip.draw(bench, asked.out / "strip.png", asked)


if __name__ == "__main__":
    main()
