#!/usr/bin/env python3
"""Denoises raw images by Open Image Denoise (pip install pyoidn numpy), quality high, and prints what that cost as JSON.

    python3 oidn.py --version
    python3 oidn.py FOLDER WIDTH HEIGHT COPIES THREADS

FOLDER holds `colour`, `albedo` and `normal`: interleaved little-endian f32, HEIGHT x WIDTH x 3. They are mirrored to COPIES x COPIES
images; the result of one copy is written to FOLDER/denoised. Start-up and a first small image are not counted.
"""
import json
import os
import resource
import sys
import time


def status(name):
    for line in open("/proc/self/status"):
        if line.startswith(name):
            return int(line.split()[1]) / 1024
    return 0.0


def processor_seconds():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def read(folder, name, width, height, copies):
    import numpy as np

    image = np.fromfile(os.path.join(folder, name), dtype=np.float32).reshape(height, width, 3)
    more = ((0, height * (copies - 1)), (0, width * (copies - 1)), (0, 0))
    return np.ascontiguousarray(np.pad(image, more, mode="symmetric"))


def main(folder, width, height, copies, threads):
    # before the library counts the processors
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:threads])
    import numpy as np
    from pyoidn.denoise import denoise

    colour, albedo, normal = (read(folder, name, width, height, copies) for name in ("colour", "albedo", "normal"))
    small = [image[:64, :64].copy() for image in (colour, albedo, normal)]
    denoise(color=small[0], albedo=small[1], normal=small[2], hdr=True, quality="high")
    before = status("VmRSS:")
    cpu, wall = processor_seconds(), time.perf_counter()
    denoised = denoise(color=colour, albedo=albedo, normal=normal, hdr=True, quality="high")
    cost = dict(cpu=processor_seconds() - cpu, wall=time.perf_counter() - wall, peak_mib=status("VmHWM:"), before_mib=before)
    if copies == 1:
        denoised.astype(np.float32).tofile(os.path.join(folder, "denoised"))
    print(json.dumps(dict(cost=cost)))


if __name__ == "__main__":
    if sys.argv[1:] == ["--version"]:
        import numpy  # noqa: F401
        import pyoidn  # noqa: F401
        from importlib.metadata import version

        print("pyoidn", version("pyoidn"))
    elif len(sys.argv) == 6:
        main(sys.argv[1], *map(int, sys.argv[2:]))
    else:
        sys.exit(__doc__)
