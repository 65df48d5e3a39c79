#!/usr/bin/env python3
"""Denoises raw images by Open Image Denoise (pip install pyoidn numpy) and prints what that cost as JSON.

    python3 oidn.py --version
    python3 oidn.py FOLDER WIDTH HEIGHT COPIES THREADS [QUALITY [prefiltered]]

FOLDER holds `colour`, `albedo` and `normal`: interleaved little-endian f32, HEIGHT x WIDTH x 3. They are mirrored to COPIES x COPIES
images; the result of one copy is written to FOLDER/denoised. QUALITY is fast, balanced or high (the default); prefiltered has
albedo and normal denoised first, each by itself, as Intel advises where they are noisy, and taken for clean. Start-up and a first small image are not counted.
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


FILTERS = {}
"""By the name of a feature, what denoises it: made once, as in a renderer."""


def without_noise(name, image, quality):
    """A feature, denoised by itself."""
    import numpy as np
    import pyoidn

    if name not in FILTERS:
        device = pyoidn.Device()
        device.commit()
        FILTERS[name] = device, pyoidn.Filter(device, "RT")
    device, one = FILTERS[name]
    clean = np.empty_like(image)
    one.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
    one.set_image("output", clean, pyoidn.OIDN_FORMAT_FLOAT3)
    one.set_quality({"fast": 4, "balanced": 5, "high": 6}[quality])
    one.commit()
    one.execute()
    error = device.get_error()
    if error:
        sys.exit(f"Open Image Denoise: {error}")
    return clean


def denoised_from(colour, albedo, normal, quality, prefiltered):
    from pyoidn.denoise import denoise

    if prefiltered:
        albedo, normal = without_noise("albedo", albedo, quality), without_noise("normal", normal, quality)
    return denoise(color=colour, albedo=albedo, normal=normal, hdr=True, clean_aux=prefiltered, quality=quality)


def main(folder, width, height, copies, threads, quality="high", prefiltered=False):
    # before the library counts the processors
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:threads])
    import numpy as np

    colour, albedo, normal = (read(folder, name, width, height, copies) for name in ("colour", "albedo", "normal"))
    small = [image[:64, :64].copy() for image in (colour, albedo, normal)]
    denoised_from(*small, quality, prefiltered)
    before = status("VmRSS:")
    cpu, wall = processor_seconds(), time.perf_counter()
    denoised = denoised_from(colour, albedo, normal, quality, prefiltered)
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
    elif len(sys.argv) in (6, 7, 8):
        how = sys.argv[6:]
        if how and (how[0] not in ("fast", "balanced", "high") or how[1:] not in ([], ["prefiltered"])):
            sys.exit(__doc__)
        main(sys.argv[1], *map(int, sys.argv[2:6]), *how[:1], prefiltered=len(how) == 2)
    else:
        sys.exit(__doc__)
