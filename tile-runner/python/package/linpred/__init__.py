"""linpred denoises Monte Carlo renders on the CPU, by linear predictions from normal, albedo and depth.

Arrays in memory::

    clean = linpred.denoise(colour, variance=variance, albedo=albedo, normal=normal, depth=depth)
    clean.colour, clean.error

Files, as the command ``linpred`` (also ``python -m linpred``) denoises them::

    linpred.denoise_file("noisy.exr", "clean.exr", quality="high")

Where a renderer should take more samples, of arrays and of files::

    linpred.sample_map(colour, variance=variance, samples=4, budget=8).samples

Passes of one picture, each with samples of its own, are put together by :func:`merge`. The whole loop with Mitsuba 3: :mod:`linpred.mitsuba`.

Frames larger than memory, row by row: :func:`denoise_rows`. What is in a file, and how far it is from a reference: :func:`inspect`,
:func:`compare`.

The same input and options give the same bits, whatever the threads, in memory, row by row, and from a file.
"""

from __future__ import annotations

from linpred._errors import InputError, InputWarning, SequenceError
from linpred._files import (
    FileReport,
    Help,
    Plan,
    compare,
    denoise_file,
    inspect,
    merge,
    plan,
    stitch,
)
from linpred._frames import Denoised, DenoisedRow, Report, Rows, denoise, denoise_rows
from linpred._linpred import VERSION as __version__
from linpred._sampling import SampleMap, SampleReport, sample_map, sample_map_file

__all__ = [
    "Denoised",
    "DenoisedRow",
    "FileReport",
    "Help",
    "InputError",
    "InputWarning",
    "Plan",
    "Report",
    "Rows",
    "SampleMap",
    "SampleReport",
    "SequenceError",
    "__version__",
    "compare",
    "denoise",
    "denoise_file",
    "denoise_rows",
    "inspect",
    "merge",
    "plan",
    "sample_map",
    "sample_map_file",
    "stitch",
]
