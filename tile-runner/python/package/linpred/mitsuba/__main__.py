"""The command line, ``python -m linpred.mitsuba``."""

from __future__ import annotations

import argparse
import sys
import warnings

from linpred import InputError
from linpred.mitsuba import Pass, Rendered, _loop, _options, _render

DONE, USAGE, INPUT, MEMORY, STOPPED = 0, 2, 3, 4, 130
"""Exit codes, those of ``linpred``."""

ENDINGS = {
    "spp": "all samples are rendered",
    "error": "the error is predicted to be below the target",
    "time": "no other pass fits into the time",
    "exact": "no pixel varies any more",
}


class Terminal(_loop.Watch):
    """Prints a line for each pass, and on a terminal how far a pass is."""

    def __init__(self, quiet: bool) -> None:
        self._quiet, self._bar = quiet, not quiet and sys.stderr.isatty()

    def note(self, sentence: str) -> None:
        print(f"note: {sentence}", file=sys.stderr)

    def rendering(self, number: int, done: int, of_all: int) -> None:
        if self._bar:
            filled = 30 * done // max(of_all, 1)
            print(f"\rpass {number} [{'#' * filled}{'.' * (30 - filled)}] {100 * done // max(of_all, 1)} %", end="", file=sys.stderr, flush=True)

    def passed(self, where: Pass) -> None:
        if self._quiet:
            return
        start = "\r\x1b[K" if self._bar else ""
        seconds = f"rendered {where.rendering:.1f} s, everything else {where.other:.1f} s"
        print(f"{start}pass {where.number}: {where.samples:.2f} samples per pixel, predicted error {where.error:.3g}, {seconds}", file=sys.stderr, flush=True)


def arguments() -> argparse.ArgumentParser:
    """What the command line takes."""
    parser = argparse.ArgumentParser(
        prog="python -m linpred.mitsuba",
        description="Renders a scene with Mitsuba 3 where samples help the denoised picture most, and denoises it.",
        epilog="After a crash or Ctrl-C the same command goes on where it was ended.",
    )
    parser.add_argument("scene", help="the scene, an XML file of Mitsuba 3")
    parser.add_argument("-o", "--output", required=True, metavar="CLEAN.exr", help="the denoised file; renewed between passes")
    parser.add_argument("--spp", type=int, default=32, metavar="N", help="samples per pixel at most, on average (32)")
    parser.add_argument("--target-error", type=float, metavar="E", help="ends when the predicted relative error of the denoised picture is this low")
    parser.add_argument("--time", type=float, metavar="SECONDS", help="ends before this many seconds have passed, those of runs that were ended included")
    parser.add_argument("--quality", default="balanced", help="of the last denoising: fast, balanced (the default) or high")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="another one draws other samples (0)")
    parser.add_argument("--sensor", type=int, default=0, metavar="N", help="which of the scene's sensors, counted from 0")
    parser.add_argument("--variant", metavar="NAME", help="of Mitsuba: llvm_ad_rgb or cuda_ad_rgb; the first that works by default")
    parser.add_argument("--noisy", metavar="ALL.exr", help="keeps the merged noisy image, with variances, features and samples per pixel")
    parser.add_argument("--keep", action="store_true", help="keeps the folder of the passes, CLEAN.exr.passes: a larger --spp goes on from there")
    parser.add_argument("--restart", action="store_true", help="begins anew, whatever that folder holds")
    parser.add_argument("--threads", type=int, metavar="N", help="threads that compute; all by default")
    parser.add_argument("--max-memory", metavar="SIZE", help="what linpred may use, such as 512M")
    parser.add_argument("--quiet", action="store_true", help="prints nothing but what goes wrong")
    return parser


def report(done: Rendered) -> str:
    """What a loop did, in a few lines."""
    lines = [
        f"{done.output}: {ENDINGS[done.ended]}",
        f"{done.samples:.2f} samples per pixel in {done.passes} passes, predicted relative error {done.error:.3g}",
        f"{done.rendering:.1f} s of rendering, {done.other:.1f} s of everything else",
    ]
    if done.left_out:
        lines.append(f"{done.left_out} samples were not finite and are left out")
    return "\n".join(lines)


def main(given: list[str] | None = None) -> int:
    """Does what the arguments ask for, and returns the exit code."""
    asked = arguments().parse_args(given)
    warnings.showwarning = lambda message, *_, **__: print(f"warning: {message}", file=sys.stderr)
    try:
        options = _options(
            asked.output, asked.spp, asked.target_error, asked.time, asked.quality, asked.seed, asked.noisy, asked.keep, asked.threads, asked.max_memory
        )
        done = _render(asked.scene, options, asked.sensor, asked.variant, asked.restart, Terminal(asked.quiet))
    except KeyboardInterrupt:
        print("\nstopped; the same command goes on from the last whole pass, which is kept beside the output", file=sys.stderr)
        return STOPPED
    except MemoryError as error:
        return _failed(error, MEMORY)
    except (InputError, OSError) as error:
        return _failed(error, INPUT)
    except (ValueError, ImportError) as error:
        return _failed(error, USAGE)
    if not asked.quiet:
        print(report(done))
    return DONE


def _failed(error: Exception, code: int) -> int:
    at = f"{error.filename}: {error.strerror}" if isinstance(error, OSError) and error.filename else error
    print(f"error: {at}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
